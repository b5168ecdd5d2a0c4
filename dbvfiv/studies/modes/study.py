"""Run of the modes study: finds leading modes of a steady state and keeps them in a record."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.optimize import brentq

from ...case.parameters import PARAMETERS, Mu
from ...errors import CaseError, NotValidError, SolveError
from ...model.state import SteadyState
from ...model.symmetry import EQUILIBRIA, Symmetry, asks_for_equilibria, chosen_symmetries
from ...record.record import GrowingRecord
from ...record.states import state_row
from ..case import Case
from ..session import Session
from ..stability.dimensions import LAW, STORAGE, other_law, require_two_laws
from ..stability.place import condition_of
from ..stability.verdict import FLUTTERS, STABLE, Verdict, oscillates
from ..stability.walk import StabilityWalk
from ..study import Study
from .mode import CURVE, Certificate, law_note, rows_of
from .result import COUNT, COUNTED, MODES, REFUSAL, STATE, ModesResult, tables_of
from .run import ModesOptions, run_modes

#: Factors asked, from that of the case outwards; below a twentieth a wall is as good as undamped.
LOWER, HIGHER = np.geomspace(1.0, 0.05, 9), np.geomspace(1.0, 10.0, 7)
#: Relative accuracy of the factor.
ACCURACY = 1e-4


def run(session: Session, record: GrowingRecord) -> None:
    """Leading modes of the steady state at drive.pressure, under both continuity laws where that is asked for."""
    case = session.case
    both = case.modes.continuity == "both"
    if both:
        require_two_laws(case, "modes", "modes.in_vacuo leaves the fluid out" if case.modes.in_vacuo else "")
        _require_one_class(case)
    if record.notes(REFUSAL):
        return
    done = {note.get("symmetry", EQUILIBRIA) for note in record.notes("certificate")}
    chosen = chosen_symmetries(case.modes.symmetry, case.part)
    missing = [symmetry for symmetry in chosen if symmetry.name not in done]
    further = both and not record.notes(LAW)
    if not (missing or further):
        return
    state = session.equilibrium(record)
    try:
        for symmetry in missing:
            _keep(session, record, state, symmetry)
    except NotValidError as error:
        if not record.rows(STATE):
            record.append(STATE, state_row(session.model, state))
        record.note(REFUSAL, text=str(error))
        return
    if further:
        law = other_law(case)
        mu = Mu.of(session.model.case).at(storage=float(law == STORAGE))
        found = run_modes(session.model, state, mu, options=ModesOptions.of(case), observer=record)
        record.note(LAW, **law_note(found, law))


def _require_one_class(case: Case) -> None:
    """Refuse to compare laws where they do not differ.

    Raises
    ------
    CaseError
    """
    if not asks_for_equilibria(case.modes.symmetry):
        raise CaseError(
            f"modes.continuity is given as 'both' with modes.symmetry = {case.modes.symmetry!r}, but the laws differ "
            f"in class {EQUILIBRIA} alone, since no other motion changes areas; modes.symmetry must be {EQUILIBRIA!r} "
            "then.",
            key="modes.continuity",
        )


def _keep(session: Session, record: GrowingRecord, state: SteadyState, symmetry: Symmetry) -> None:
    """Modes of a class under the case's own law; rows that an interrupted attempt kept of it stay."""
    model = session.model
    found = run_modes(model, state, options=ModesOptions.of(session.case), observer=record, symmetry=symmetry)
    before = record.notes("certificate")
    modes, points = (sum(note.get(name, record.rows(table)) for note in before) for name, table in COUNTED)
    if not record.rows(STATE):
        record.append(STATE, state_row(model, state))
    rows = rows_of(found)
    for row in rows[record.rows(MODES) - modes :]:
        record.append(MODES, row)
    said = {note["text"] for note in record.notes("remark")}
    for sentence in found.notes:
        if sentence not in said:
            record.note("remark", text=sentence)
    certificate = Certificate.of(found)
    if record.rows(COUNT) == points:
        record.extend(COUNT, {column.name: getattr(certificate, column.name) for column in CURVE})
    verdict = found.verdict
    if symmetry.of_equilibria and not found.in_vacuo:
        record.progress("critical damping factor")
        verdict = replace(verdict, critical_damping_factor=_critical_factor(session, state, verdict))
    record.note(
        "certificate",
        **certificate.note(),
        verdict=verdict.summary(),
        symmetry=symmetry.name,
        modes=len(rows),
        points=len(certificate.frequency),
    )


def _critical_factor(session: Session, state: SteadyState, verdict: Verdict) -> float:
    """Factor on the damping of the wall at which flutter begins; NaN where the search for it fails."""
    place = Mu.of(session.case)
    walk = StabilityWalk(session.case, model=session.model)
    walk.give(place, state.q)
    try:
        return critical_damping_factor(walk, place, verdict)
    except SolveError:
        return np.nan


def critical_damping_factor(walk: StabilityWalk, place: Mu, verdict: Verdict) -> float:
    """Factor on the loss factors, or on beta, at which flutter begins, next to 1.

    It lies below 1 where the state is stable and above where it flutters.

    Parameters
    ----------
    walk : StabilityWalk
    place : Mu
    verdict : Verdict
        On the place.

    Returns
    -------
    float
        NaN where the wall has no such damping, the verdict is another, or no factor in reach makes the difference.

    Raises
    ------
    SolveError
        If there is no steady state.
    """
    name = "loss_factor" if place.loss_factor > 0 else "beta"
    own = place[name]
    if own <= 0 or verdict.outcome not in (STABLE, FLUTTERS):
        return np.nan
    factors = LOWER if verdict.outcome == STABLE else HIGHER
    factors = factors[own * factors <= PARAMETERS[name].high]
    places = [place.at(**{name: own * factor}) for factor in factors]
    column = walk.column(places, len(places), edges=True)

    def growth(values) -> float:
        values = np.asarray(values)
        modes = values[oscillates(values)]
        return float(modes.real.max()) if modes.size else np.nan

    def at(factor: float) -> float:
        return growth(column.eigenvalues(condition_of(place.at(**{name: own * factor}))))

    rates = [growth(row) for row in column.leading]
    for a, b, low, high in zip(factors[:-1], factors[1:], rates[:-1], rates[1:]):
        if not (np.isfinite(low) and np.isfinite(high)):
            return np.nan
        if low * high <= 0:
            found = brentq(at, min(a, b), max(a, b), rtol=ACCURACY) if column.eigenvalues else np.nan
            return float(f"{found:.8g}")  # rounding of factorisations would part a resumed run from a whole one
    return np.nan


STUDY = Study("modes", tables_of, run, ModesResult)
