"""Leading modes of one state: run, storage, what can be read off it, and fields for ParaView."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np

from ...case.parameters import Mu
from ...errors import CaseError, NotValidError
from ...model.symmetry import asks_for_equilibria, symmetry_named
from ...record.mesh import MeshData, WholeValve
from ...record.record import GrowingRecord, Record
from ...record.states import read_states, state_row, state_table
from ...record.table import TableSpec
from ...record.vtkhdf import Step, motion
from ..case import Case
from ..result import StudyResult
from ..session import Session, Study, describe_surroundings
from ..stability.dimensions import Variant, compare_states, own_variant, variants
from ..stability.verdict import Verdict
from ..stability.walk import StabilityWalk
from ..state import State, StateSteps, states_of
from .search import CURVE, MODE, Certificate, FoundModes, ModeShape, critical_damping_factor, drawn_amplitude, run_modes

STATE, MODES, COUNT = "state", "modes", "count"
#: Kinds of notes: on a variant whose rows are all there, and why the constants of the rubber do not hold at the state.
_FOUND, _REFUSAL = "certificate", "not valid"
HEAD = ("  mode   growth rate    frequency   damping ratio   residual", "                 1/s           Hz")


def tables_of(mesh: MeshData) -> tuple[TableSpec, TableSpec, TableSpec]:
    """Tables of a result on a mesh: the state, its modes, and the curve of the independent count."""
    stations = len(mesh.z)
    row_shapes = {"shape": mesh.nodal_shape, "area": (stations,), "pressure": (stations,)}
    return state_table(STATE, mesh), TableSpec(MODES, MODE, row_shapes, chunk=8), TableSpec(COUNT, CURVE)


def run(session: Session, record: GrowingRecord) -> None:
    """Leading modes of the steady state at drive.pressure, in every variant asked for."""
    case, model = session.case, session.model
    kept = read_states(record, STATE)
    state, place = session.equilibrium(record, kept), Mu.of(model.case)
    if record.notes(_REFUSAL):
        return
    known = _notes(record)
    for verdict in (Verdict.read(note["verdict"]) for note in known.values()):
        if verdict.stable is None:
            record.warn(verdict.reason)
    missing = [variant for variant in variants(case, "modes") if variant not in known]
    if not kept:
        record.append(STATE, state_row(model, state))
    walk = StabilityWalk(model.case, model=model)
    walk.give(place, state)
    record.begin("modes", len(missing))
    for variant in missing:
        here, own = place.at(storage=variant.storage), walk.in_class(variant.motion)
        try:
            found = run_modes(model, state, here, case.modes, record, variant.motion, own)
        except NotValidError as error:
            record.note(_REFUSAL, text=str(error))
            return
        if variant.continuity == own_variant(case).continuity and not case.modes.in_vacuo:
            record.progress("critical damping factor")
            factor, sought = critical_damping_factor(own, here, found.verdict)
            verdict = replace(found.verdict, critical_damping_factor=factor, damping_sought=sought)
            found = replace(found, verdict=verdict)
        _keep(record, variant, found)
        record.item(found)


def _keep(record: GrowingRecord, variant: Variant, found: FoundModes) -> None:
    """Keep what was found in a variant; its note vouches for its rows."""
    for mode in found.modes:
        record.append(MODES, vars(mode) | variant.row)
    curve = {name: getattr(found.certificate, name) for name in ("frequency", "phase")}
    own = {name: np.full(len(found.certificate.phase), value) for name, value in variant.row.items()}
    record.extend(COUNT, curve | own)
    for sentence in found.notes:
        if sentence not in {note["text"] for note in record.notes("remark")}:
            record.note("remark", text=sentence)
    verdict = found.verdict.summary()
    certificate = found.certificate.note()
    record.note(_FOUND, variant=list(variant), certificate=certificate, verdict=verdict, grazing=found.grazing)


def _notes(record: Record) -> dict[Variant, dict[str, Any]]:
    return {Variant(*note["variant"]): note for note in record.notes(_FOUND)}


def _rows(record: Record, table: str, variant: Variant) -> np.ndarray:
    """Numbers of the rows of a variant."""
    same = [record.column(table, name) == value for name, value in variant.row.items()]
    return np.flatnonzero(same[0] & same[1])


def rows_to_keep(known: Record, case: Case) -> dict[str, int]:
    """Rows of the variants that were found; of one that was cut off the rows are found again."""
    found = _notes(known)
    return {table: sum(len(_rows(known, table, variant)) for variant in found) for table in (MODES, COUNT)}


def _mode_step(result: ModesResult, valve: WholeValve, mode: ModeShape) -> Step:
    """A mode as a step; "time" is its number."""
    mesh, shape, parity = result.mesh, mode.shape[:, :3], symmetry_named(mode.symmetry).parity(valve.sign)[:, None]
    points = motion(mesh, valve, result.state.nodal) | {
        "mode_real": valve.vectors(shape.real) * parity,
        "mode_imag": valve.vectors(shape.imag) * parity,
        "mode_amplitude": mode.amplitude[valve.node],
    }
    ones = np.ones(len(valve.quads))
    cells = {
        "thickness": valve.cells(mesh.thickness),
        "growth_rate": mode.growth_rate * ones,
        "frequency": mode.frequency * ones,
    }
    return Step(float(mode.number), points, cells)


def _phase_step(result: ModesResult, valve: WholeValve, mode: ModeShape, share: float) -> Step:
    """A phase of a cycle, given as a share of it; "time" is time in s, or the share where nothing oscillates."""
    state, mesh = result.state, result.mesh
    moved = mode.at_phase(2 * np.pi * share) * drawn_amplitude(state, mode)
    parity = symmetry_named(mode.symmetry).parity(valve.sign)[:, None]
    points = motion(mesh, valve, state.nodal + moved)
    if np.any(parity < 0):
        opposite = motion(mesh, valve, state.nodal - moved)
        points = {name: np.where(parity < 0, opposite[name], field) for name, field in points.items()}
    points |= {"oscillation": valve.vectors(moved[:, :3]) * parity}
    value = share / mode.frequency if mode.frequency > 0 else share
    return Step(value, points, {"thickness": valve.cells(mesh.thickness)})


class ModesResult(StudyResult):
    """Leading modes, by falling growth rate.

    Attributes
    ----------
    modes : tuple of ModeShape
    state : State
        The equilibrium they belong to.
    certificate : Certificate or None
    stable : bool or None
    notes : tuple of str
        What the search and its certificate have to say.

    Examples
    --------
    >>> modes = dbvfiv.load().steady(pressure="6 kPa").modes(density=10)    # doctest: +SKIP
    >>> modes.modes[0].growth_rate, modes.modes[0].frequency, modes.stable  # doctest: +SKIP
    """

    kind = "modes"

    @cached_property
    def found(self) -> dict[Variant, FoundModes]:
        """Modes of each variant that was searched."""
        (_, table, _) = tables_of(self.mesh)
        rows, found = self.record.table_rows(table), {}
        for variant, note in _notes(self.record).items():
            own = ({k: v for k, v in rows[i].items() if k != "continuity"} for i in _rows(self.record, MODES, variant))
            shapes = (ModeShape(number=n, **row | {"symmetry": variant.symmetry}) for n, row in enumerate(own, 1))
            points = _rows(self.record, COUNT, variant)
            curve = {name: self.record.column(COUNT, name)[points] for name in ("frequency", "phase")}
            certificate = Certificate(**note["certificate"], **curve)
            verdict, grazing = Verdict.read(note["verdict"]), note.get("grazing", {})
            found[variant] = FoundModes(tuple(shapes), certificate, verdict, grazing=grazing)
        return found

    @cached_property
    def _classes(self) -> dict[str, FoundModes]:
        """Modes of each class under the flow model of the case, by its name."""
        law = self.case.fluid.continuity
        return {variant.symmetry: found for variant, found in self.found.items() if variant.continuity == law}

    @cached_property
    def modes(self) -> tuple[ModeShape, ...]:
        every = [mode for found in self._classes.values() for mode in found.modes]
        if len(self._classes) > 1:
            every.sort(key=lambda mode: (-mode.growth_rate, mode.angular_frequency))
        return tuple(replace(mode, number=n) for n, mode in enumerate(every, 1))

    @property
    def certificates(self) -> dict[str, Certificate]:
        """One for each class of motion that was searched, by its name."""
        return {name: found.certificate for name, found in self._classes.items()}

    @property
    def verdicts(self) -> dict[str, Verdict]:
        """One for each class of motion that was searched, by its name."""
        return {name: found.verdict for name, found in self._classes.items()}

    @cached_property
    def certificate(self) -> Certificate | None:
        """Certificate of all classes searched; None if the run ended before it had one."""
        return Certificate.joined(self.certificates) if self.certificates else None

    @property
    def notes(self) -> tuple[str, ...]:
        return tuple(note["text"] for note in self.record.notes("remark"))

    @cached_property
    def verdict(self) -> Verdict:
        """Stability of the state in all symmetry classes that were searched."""
        refusals = self.record.notes(_REFUSAL)
        if refusals:
            return Verdict.not_valid(refusals[-1]["text"])
        if not self._classes:
            return Verdict.undecided("The run ended before its modes were found.")
        return Verdict.joined(self.verdicts)

    @property
    def stable(self) -> bool | None:
        return self.verdict.stable

    @property
    def sentence(self) -> str:
        """The verdict in a sentence for people, which names the continuity law and what is outside, and the class of
        motion where only one was searched.
        """
        alone = [f"Modes are of {symmetry_named(name).alone}." for name in self._classes]
        return " ".join([self.verdict.sentence(self.law), *(alone if len(alone) == 1 else ())])

    @property
    def law(self) -> str:
        """Conditions of a verdict, in words: continuity law and fluid outside; in vacuo the latter alone."""
        case = self.case
        return case.outside.words if case.modes.in_vacuo or not case.continuity else f"under {case.continuity}"

    @cached_property
    def other_law(self) -> tuple[str, FoundModes] | None:
        """The other continuity law, and the modes of the same state under it; None where that was not asked for."""
        law = self.case.fluid.continuity
        return next(((v.continuity, found) for v, found in self.found.items() if v.continuity != law), None)

    @property
    def comparison(self) -> str | None:
        """One sentence on what both laws say; None where one was asked."""
        if self.other_law is None:
            return None
        law, found = self.other_law
        return compare_states(self.case.fluid.continuity, self.stable, law, found.stable)

    @cached_property
    def state(self) -> State:
        """The equilibrium, with its layers and figures."""
        return states_of(self, STATE)[0]

    def mode(self, number: int) -> ModeShape:
        """A mode by its number, from 1.

        Raises
        ------
        CaseError
        """
        if not 1 <= number <= len(self.modes):
            raise CaseError(
                f"There is no mode {number} in the {self.kind} result of {self.header.name!r}; it has "
                f"{len(self.modes)}."
            )
        return self.modes[number - 1]

    def summary(self) -> dict[str, Any]:
        if self.certificate is None:
            surroundings = describe_surroundings(self.case)
            return {
                "state": self.state.summary() | surroundings if self.record.rows(STATE) else None,
                "modes": [],
                "unstable_count": None,
                "unstable_count_independent": None,
                "stable": None,
                "verdict": self.verdict.summary(),
                "warnings": list(self.warnings),
            }
        both = {}
        if self.other_law:
            law, found = self.other_law
            more = {"modes": [mode.summary() for mode in found.modes], "verdict": found.verdict.summary()}
            both = {"other_law": {"continuity": law} | found.summary() | more, "comparison": self.comparison}
        return {
            "state": self.state.summary() | describe_surroundings(self.case) | {"in_vacuo": self.case.modes.in_vacuo},
            "modes": [mode.summary() for mode in self.modes],
            "unstable_count": self.certificate.unstable_count,
            "unstable_count_independent": self.certificate.unstable_count_independent,
            "stable": self.stable,
            "verdict": self.verdict.summary(),
            "certificate": self.certificate.summary(),
            "classes": [
                {"symmetry": name, "motion": symmetry_named(name).words} | found.summary()
                for name, found in self._classes.items()
            ],
            "notes": list(self.notes),
            "warnings": list(self.warnings),
        } | both

    def lines(self) -> list[str]:
        if self.certificate is None:
            return [self.sentence]
        rows = [
            f"{m.number:6d}{m.growth_rate:14.4f}{m.frequency:13.4f}{m.damping_ratio:16.4f}{m.residual:11.1e}"
            for m in self.modes
        ]
        head, notes = HEAD, [f"Note: {note}" for note in self.notes]
        if not asks_for_equilibria(self.case.modes.symmetry):
            head = (f"{HEAD[0]}   class", HEAD[1])
            rows = [f"{row}{mode.symmetry:>8}" for row, mode in zip(rows, self.modes)]
            words = ", ".join(f"{name}: {symmetry_named(name).words}" for name in self.certificates)
            notes = [f"Classes: {words}.", *notes]
        if self.other_law is None:
            return [*head, *rows, "", self.sentence, *notes]
        law, other = self.other_law
        table = side_by_side(self.case.fluid.continuity, self.modes, law, other.modes)
        sentence = other.verdict.sentence(f"under {law} continuity {self.case.outside.words}".rstrip())
        return [*table, "", self.sentence, sentence, self.comparison, *notes]

    def steps(self, valve: WholeValve, mode: int | None = None, phases: int = 24) -> Sequence[Step]:
        """The modes one after the other, or one cycle of one of them, its first phase repeated at the end."""
        if mode is None:
            return StateSteps(self.modes, partial(_mode_step, self, valve))
        shares = [number / phases for number in range(phases + 1)]
        return StateSteps(shares, partial(_phase_step, self, valve, self.mode(mode)))

    def animate(self, path: str | Path, mode: int = 1, frames: int = 24) -> Path:
        """Write a GIF of one cycle of a mode."""
        return self.drawing.animate_mode(self, self.mode(mode), path, frames)


def side_by_side(own: str, modes: Sequence[ModeShape], law: str, others: Sequence[ModeShape]) -> list[str]:
    """Table of the modes under both laws, each by falling growth rate."""
    lines = [f"{'':6}{own:>40}{law:>40}", f"{'mode':>6}" + 2 * f"{'1/s':>14}{'Hz':>13}{'damping':>13}"]
    for i in range(max(len(modes), len(others))):
        lines.append(f"{i + 1:6d}" + "".join(_cells(found[i : i + 1]) for found in (modes, others)))
    return lines


def _cells(modes: Sequence[ModeShape]) -> str:
    return "".join(f"{m.growth_rate:14.4f}{m.frequency:13.4f}{m.damping_ratio:13.4f}" for m in modes) or " " * 40


STUDY = Study("modes", tables_of, run, ModesResult, lambda case: variants(case, "modes"), rows_to_keep=rows_to_keep)
