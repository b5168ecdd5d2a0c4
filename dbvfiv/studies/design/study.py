"""Designs: run, storage, what can be read off a run or its file, and figures."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import asdict, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from ...case.parameters import PARAMETERS, Mu
from ...case.statement import QUANTITIES, Statement
from ...case.write import case_toml, write_case
from ...drawing.style import headline, limits, log_axis, new_figure, parameter_label
from ...errors import CaseError, SolveError
from ...model.closed import close_valve
from ...model.leading import other_end
from ...model.symmetry import equilibria_of, only_class_of
from ...record.record import GrowingRecord
from ...record.table import Column, TableSpec
from ...texts import digits
from ..case import Case
from ..inputs import inputs_of
from ..result import StudyResult
from ..session import Session, Study
from ..stability.place import check_scan, number_of, require_head
from ..stability.verdict import OUTCOMES, STABLE
from .problem import (
    AtHead,
    DesignProblem,
    Variable,
    least_ratio,
    margin_spectrum,
    statements_of,
    together,
    variables_of,
)
from .search import HELD, LOOK, Design, Search, best_of, starts_of

DESIGNS, VERIFIED, _STATE, _DESIGN, _SHUT = "designs", "verified", "state", "design", "shut"
#: Number of a design in tables: the case itself.
CASE = -1
_DESIGNS = (
    Column("design", "", "Number of the bound it was sought for", "i8"),
    Column("start", "", "Number of the start", "i8"),
    Column("bound", "SI", "Bound that the front goes over"),
    Column("aim", "SI", "What was aimed at"),
    Column("violation", "", "Largest share by which a bound is missed"),
)
_VERIFIED = (
    Column("design", "", f"Number of the design; {CASE} for the case itself", "i8"),
    Column("pressure", "Pa", "Inlet pressure"),
    Column("outcome", "", f"Verdict: {', '.join(f'{i} {name}' for i, name in enumerate(OUTCOMES))}", "i8"),
    Column("margin", "", "Least damping ratio"),
    Column("flow", "m^3/s", "Volume flow"),
    Column("opening", "m^2", "Area between the lips"),
    Column("loss_coefficient", "", "Head loss over the velocity head at the flange"),
)
#: Designs, and verdicts on the best ones on a finer mesh; a run that goes on finds both again from the states, which
#: are kept.
_TABLES = TableSpec(DESIGNS, _DESIGNS), TableSpec(VERIFIED, _VERIFIED)
_NO_ROWS = {DESIGNS: 0, VERIFIED: 0}


def check(case: Case) -> None:
    """Refuse a case without flow or with a pump, statements that cannot be read, and names of no variable."""
    check_scan(case)
    require_head(case)
    statements_of(case)
    for name in case.design.variables.keys() - PARAMETERS.keys():
        number_of(case, name, f"design.variables.{name}")
    for one in inputs_of(case) if case.uncertainty.inputs else ():
        if one.own is None:
            raise CaseError(
                f"uncertainty.inputs holds {one.name}, which has no one value in this case, so no margin can be "
                "differentiated by it; leave it out.",
                key="uncertainty.inputs",
            )


def run(session: Session, record: GrowingRecord, cases: Path | None = None) -> None:
    """Designs for the aim and constraints of `design` of the case. Raises CaseError for variables or statements that
    cannot be used.

    Parameters
    ----------
    cases : Path, optional
        Folder for the case file of each design.
    """
    case = session.case
    aim, *constraints = statements_of(case)
    result = DesignResult(record, session)
    problem = DesignProblem(case, _known(record), partial(_keep, record), result.band)
    bounds = result.bounds
    starts = starts_of(problem, case.design.starts)
    record.begin("design", len(bounds) * len(starts) * case.design.evaluations)
    best: Design | None = None
    for number, bound in enumerate(bounds):
        asked = [replace(one, bounds=(bound,)) if len(one.bounds) > 1 else one for one in constraints]
        found: list[Design] = []
        for i, share in enumerate(starts):
            tried: list[Design | str] = []
            search = Search(problem, aim, asked, partial(_tell, record, tried))
            if i == 0 and best is not None:
                share = problem.shares_of(best.values)
            design = search.from_start(share, case.design.evaluations)
            if design is None:
                why = next((one for one in reversed(tried) if isinstance(one, str)), "")
                record.fail(f"From start {i + 1} no valve could be computed. {why}".rstrip())
                continue
            found.append(design)
            record.note(_DESIGN, design=number, start=i, **asdict(design))
            row = {"design": number, "start": i, "bound": bound, "aim": design.aim, "violation": design.violation}
            record.append(DESIGNS, row)
        best = best_of(found, aim)
        if best is None:
            continue
        if not best.holds:
            record.warn(
                f"No design holds all constraints{_for(bound, bounds)}: the nearest misses one {_missed(best)}."
            )
        if cases is not None:
            _write_new(problem.case_at(best.values), cases / f"design-{number + 1}.toml", record)
    for number, design in [(CASE, None), *result.best.items()]:
        _verify(problem, case, number, design, result.pressures, record)


def _write_new(case: Case, path: Path, record: GrowingRecord) -> None:
    """Write a case file; one that is there by now stays, with a warning where it is another."""
    if not path.exists():
        write_case(case, path)
    elif path.read_text(encoding="utf-8").rstrip() != case_toml(case, comments=False).rstrip():
        record.warn(f"The case file {str(path)!r} is there by now, of another case, and is not overwritten.")


def _for(bound: float, bounds) -> str:
    return f" with the bound {bound:g}" if len(bounds) > 1 else ""


def _missed(design: Design) -> str:
    """By how much a design misses a constraint."""
    return f"by {design.violation:.2%}" if np.isfinite(design.violation) else "at a head where it has no state"


def _tell(record: GrowingRecord, tried: list[Design | str], one: Design | str) -> None:
    tried.append(one)
    if isinstance(one, str):
        record.progress(f"a step back: {one}")
    else:
        record.progress(f"aim {one.aim:.4g}, constraints missed by {one.violation:.2%}")
        record.item(one)


def _known(record: GrowingRecord) -> dict[tuple, AtHead | str]:
    """States of an interrupted attempt, but those of earlier versions, whose margins counted other modes."""
    found: dict[tuple, AtHead | str] = {}
    for note in record.notes(_STATE):
        if "band" not in note:
            continue
        key = tuple(note["values"]), note["pressure"], note["margin"]
        known = note["found"]
        slopes = {} if isinstance(known, str) else {name: np.array(slope) for name, slope in note["slopes"].items()}
        found[key] = known if isinstance(known, str) else AtHead(known, slopes, note["reserve"])
    return found


def _keep(record: GrowingRecord, key: tuple, found: AtHead | str, band: float | None) -> None:
    """Keep a state in the record as soon as it is known, with the frequency up to which modes count."""
    state, why = dict(zip(("values", "pressure", "margin"), key)), isinstance(found, str)
    at = AtHead({}, {}) if why else found
    told = found if why else at.values
    record.note(_STATE, **state, found=told, slopes=at.slopes, reserve=at.reserve, band=band)


#: Names of the case files of designs.
_MADE = "design-[1-9]*.toml"
#: Share of a range or a bound within which it is what holds a design back; of an aim, within which optima are one.
ACTIVE = 1e-3
#: Difference of an opening between the meshes above which it is said.
APART = 0.1


def _verify(problem: DesignProblem, case: Case, number: int, design: Design | None, pressures, record) -> None:
    """Counted verdicts on a valve at all heads, on a finer mesh, its states from rest."""
    case = case if design is None else problem.case_at(design.values)
    finer, mesh = case.design.finer, case.mesh
    changes = {"mesh.around": round(finer * mesh.around), "mesh.along": round(finer * mesh.along)}
    walk = problem.walk(case.replace(changes))
    for pressure in pressures:
        if pressure < 0:
            record.progress(f"back pressure of {-pressure:.6g} Pa on {finer:g} times the elements each way")
            try:
                model, q = close_valve(walk.case, -pressure)
                record.note(_SHUT, design=number, pressure=-pressure, left=model.passage(q).left)
            except SolveError as error:
                record.fail(f"Design {number + 1} could not be closed: {error}" if number >= 0 else str(error))
            continue
        record.progress(f"verdict at {pressure:.6g} Pa on {finer:g} times the elements each way")
        place = Mu.of(case).at(pressure=pressure)
        try:
            state = walk.state(place)
            spectrum = margin_spectrum(walk, place)
            verdict = walk.verdict(place, spectrum)
            reserve = 0.0
            if verdict.stable and problem.inputs:  # of the search: 95 % of valves have the margin that is told
                values = tuple(one.start for one in problem.variables) if design is None else design.values
                reserve = problem.at(values, pressure, True).reserve
        except SolveError as error:
            record.fail(f"Design {number + 1} could not be verified: {error}" if number >= 0 else str(error))
            continue
        loss = state.hydraulics.loss_coefficient if state.hydraulics else np.nan
        row = {"design": number, "pressure": pressure, "outcome": OUTCOMES.index(verdict.outcome)}
        row |= {
            "margin": least_ratio(spectrum) - reserve if verdict.holds else np.nan,
            "flow": state.volume_flow,
            "opening": state.outlet_area,
        }
        record.append(VERIFIED, row | {"loss_coefficient": loss})
        sought = None if design is None else problem.opening(design.values, pressure)
        if sought is not None and abs(state.outlet_area / sought - 1) > APART:
            record.warn(
                f"Design {number + 1} opens to {1e4 * sought:.4g} cm2 at {pressure:.6g} Pa in the search and to "
                f"{1e4 * state.outlet_area:.4g} cm2 from rest on the finer mesh: the mesh is too coarse, or the valve "
                "has several steady states there."
            )


class DesignResult(StudyResult):
    """Designs for an aim and constraints.

    Attributes
    ----------
    variables : tuple of Variable
    statements : tuple of Statement
        The aim, then the constraints.
    best : dict of Design
        By the number of the bound of the front; one, 0, where there is no front.

    Examples
    --------
    >>> found = dbvfiv.load("my.toml").design()                             # doctest: +SKIP
    >>> found.best[0].values, found.best[0].holds                           # doctest: +SKIP
    """

    kind = "design"

    @cached_property
    def variables(self) -> tuple[Variable, ...]:
        return variables_of(self.case)

    @cached_property
    def statements(self) -> tuple[Statement, ...]:
        return statements_of(self.case)

    @property
    def bounds(self) -> tuple[float, ...]:
        """Bounds of the front; NaN alone without constraints."""
        return max((one.bounds for one in self.statements[1:]), key=len, default=(np.nan,))

    @cached_property
    def pressures(self) -> list[float]:
        """Inlet pressures, Pa, and back pressures below zero, at which designs are verified: those asked, and some
        between in each span.
        """
        return sorted({p for one in self.statements for p in one.between(LOOK)})

    @property
    def band(self) -> float | None:
        """Frequency, Hz, up to which modes count in margins; None where damping orders them."""
        bands = (note.get("band") for note in self.record.notes(_STATE))
        return next((band for band in bands if band), self.case.modes.max_frequency)

    @property
    def found(self) -> list[dict[str, Any]]:
        """Designs from each start: ``design``, ``start`` and what `Design` holds; the last attempt's."""
        known = {(note["design"], note["start"]): note for note in self.record.notes(_DESIGN)}
        return list(known.values())

    @property
    def best(self) -> dict[int, Design]:
        found: dict[int, list[Design]] = {}
        for note in self.found:
            design = Design(tuple(note["values"]), note["aim"], tuple(note["constraints"]), note["violation"])
            found.setdefault(note["design"], []).append(design)
        return {number: best_of(designs, self.statements[0]) for number, designs in found.items()}

    @cached_property
    def aim_of_case(self) -> float | None:
        """Aim of the case itself, on the mesh of the search, margins less their reserve; None where it has no
        state.
        """
        aim, here = self.statements[0], self._of_case(self.statements[0])
        return together(aim, here, [one.reserve for one in here])[0] if here else None

    def _of_case(self, asked: Statement) -> list[AtHead]:
        """Values of the case itself at the heads of a statement, on the mesh of the search; none where it has no
        state.
        """
        starts = [one.start for one in self.variables]
        known = {
            pressure: found
            for (values, pressure, _), found in _known(self.record).items()
            if isinstance(found, AtHead) and asked.quantity in found.values and np.allclose(values, starts, 1e-12, 0.0)
        }
        here = [known.get(p) for p in asked.pressures] or [*known.values()][:1]
        return [] if None in here else here

    def optima(self, number: int = 0) -> list[tuple[float, int]]:
        """Aims at which starts ended with all constraints held, the best first, and the number of starts for each."""
        sign, found = self.statements[0].sign, []
        ends = (note for note in self.found if note["design"] == number and note["violation"] <= HELD)
        for aim in sorted((note["aim"] for note in ends), key=lambda aim: -sign * aim):
            if found and abs(aim - found[-1][0]) <= ACTIVE * abs(aim):
                found[-1] = found[-1][0], found[-1][1] + 1
            else:
                found.append((aim, 1))
        return found

    def active(self, number: int = 0) -> list[str]:
        """Bounds and constraints that hold a design back."""
        design, found = self.best[number], []
        for one, value in zip(self.variables, design.values):
            for end, word in ((one.low, "smallest"), (one.high, "largest")):
                if abs(value - end) <= ACTIVE * (one.high - one.low):
                    found.append(f"{one.name} at its {word}")
        for one, value in zip(self.statements[1:], design.constraints):
            bound = self.bounds[number] if len(one.bounds) > 1 else one.bounds[0]
            sizes = [abs(at.values[one.quantity]) for at in self._of_case(one)]  # a bound may be 0
            if abs(value - bound) <= ACTIVE * max([abs(bound), abs(value), *sizes]):
                found.append(one.text)
        return found

    def case_of(self, number: int = 0) -> Case:
        """Case of a design."""
        return DesignProblem(self.case).case_at(self.best[number].values)

    def verified(self, number: int) -> dict[str, np.ndarray]:
        """Columns of the verdicts on a design by pressure; `CASE` for the case itself."""
        rows = {column.name: self.record.column(VERIFIED, column.name) for column in _VERIFIED}
        here = np.flatnonzero(rows["design"] == number)
        here = here[np.argsort(rows["pressure"][here])]
        return {name: column[here] for name, column in rows.items()}

    def evidence(self, number: int) -> str:
        """Verdicts on a design on the finer mesh, as a sentence."""
        rows = self.verified(number)
        shut = {note["pressure"]: note["left"] for note in self.record.notes(_SHUT) if note["design"] == number}
        gaps = "".join(f", gap left at {digits(p, 4)} Pa {left:.3g} of the gap of the lips" for p, left in shut.items())
        if not len(rows["pressure"]):
            return gaps.removeprefix(", ") or "not verified"
        unstable = [
            f"{OUTCOMES[outcome]} at {digits(p, 4)} Pa"
            for p, outcome in zip(rows["pressure"], rows["outcome"])
            if OUTCOMES[outcome] != STABLE
        ]
        if unstable:
            return ", ".join(unstable) + gaps
        margins = rows["margin"][np.isfinite(rows["margin"])]
        said = f"margin at least {100 * margins.min():.3g} %" if len(margins) else "no mode oscillates"
        return f"stable at {len(rows['pressure'])} heads, {said}{gaps}"

    def summary(self) -> dict[str, Any]:
        aim, *constraints = self.statements
        best = self.best

        def verdicts(number: int) -> dict[str, Any]:
            rows = {name: column.tolist() for name, column in self.verified(number).items() if name != "design"}
            return rows | {"outcome": [OUTCOMES[i] for i in rows["outcome"]]}

        def told(number: int, design: Design) -> dict[str, Any]:
            return {
                "bound": self.bounds[number] if self.bounds[number] == self.bounds[number] else None,
                "values": dict(zip((one.name for one in self.variables), design.values)),
                "aim": design.aim,
                "constraints": dict(zip((one.text for one in constraints), design.constraints)),
                "holds": design.holds,
                "violation": design.violation,
                "active": self.active(number),
                "verified": verdicts(number),
            }

        return {
            "variables": [asdict(one) for one in self.variables],
            "aim": aim.text,
            "aim_of_case": self.aim_of_case,
            "constraints": [one.text for one in constraints],
            "designs": [told(number, design) for number, design in best.items()],
            "starts": [{k: v for k, v in note.items() if k != "what"} for note in self.found],
            "band": self.band,
            "symmetry": equilibria_of(self.case.part).name,
            "case": verdicts(CASE),
            "states": len(self.record.notes(_STATE)),
        } | self.ending()

    def lines(self) -> list[str]:
        aim, *constraints = self.statements
        lines = [f"Aim: {aim.text}; {'; '.join(one.text for one in constraints) or 'no constraints'}."]
        lines.append(f"Margins and verdicts are of {only_class_of(self.case.part)}.")
        if self.case.uncertainty.inputs:
            lines.append("Margins are those that 95 % of valves with the inputs of [uncertainty] have, to first order.")
        if self.band:
            lines.append(f"Modes up to {digits(self.band, 4)} Hz count in margins; {other_end(self.case)}.")
        for number, design in self.best.items():
            lines.append(f"Design {number + 1}{_for(self.bounds[number], self.bounds)}:")
            for one, value in zip(self.variables, design.values):
                sizes = f"{one.start:.5g}", f"{value:.5g}", one.unit
                lines.append(_line(one.name, *sizes, _changed(one.start, value)))
            own = self.aim_of_case
            start = "" if own is None else _shown(aim.quantity, own)
            lines.append(_line(aim.quantity, start, _shown(aim.quantity, design.aim), "", _changed(own, design.aim)))
            for one, value in zip(constraints, design.constraints):
                lines.append(f"  {one.text:<60} {_shown(one.quantity, value)}")
            lines.append(f"  {'all constraints hold' if design.holds else f'a constraint is missed {_missed(design)}'}")
            lines.append(f"  held back by: {', '.join(self.active(number)) or 'nothing'}")
            if self.case.design.starts > 1:
                ends = (f"{_shown(aim.quantity, end)}{f' ({n} starts)' * (n > 1)}" for end, n in self.optima(number))
                lines.append(f"  optima found: {', '.join(ends) or 'none that holds'}")
            lines.append(f"  on the finer mesh: {self.evidence(number)}")
        if len(self.verified(CASE)["pressure"]):
            lines.append(f"The case itself on the finer mesh: {self.evidence(CASE)}.")
        return lines

    def _is_verified(self, number: int) -> bool:
        shut = {note["pressure"] for note in self.record.notes(_SHUT) if note["design"] == number}
        return len(self.verified(number)["pressure"]) + len(shut) >= len(self.pressures)

    def _is_unstable(self, number: int) -> bool:
        """True where a design is not stable on the finer mesh at a head of a margin that may not be below 0."""
        margins = (one for one in self.statements if one.quantity == "margin" and min(one.bounds, default=0.0) >= 0)
        asked, rows = {p for one in margins for p in one.between(LOOK)}, self.verified(number)
        return any(p in asked and OUTCOMES[k] != STABLE for p, k in zip(rows["pressure"], rows["outcome"]))

    def shortfall(self) -> str | None:
        best = self.best
        count = {
            "were not found": (len(self.bounds) - len(best)) * self.complete,
            "miss a constraint": sum(not design.holds for design in best.values()),
            "were not verified at all heads": sum(not self._is_verified(number) for number in best) * self.complete,
            "are not stable on the finer mesh": sum(map(self._is_unstable, best)),
        }
        said = [f"{number} of {len(self.bounds)} designs {what}" for what, number in count.items() if number]
        return "; ".join(said) or super().shortfall()


def _line(name: str, before: str, after: str, unit: str, change: str) -> str:
    """A number of the case and of the design, side by side."""
    return f"  {name:<34}{before:>12} {'->' if before else '  '} {after:<12}{unit:<8}{change}".rstrip()


def _changed(before: float | None, after: float) -> str:
    return f"{100 * (after / before - 1):+.1f} %" if before and before > 0 else ""


def _shown(quantity: str, value: float) -> str:
    row = QUANTITIES[quantity]
    text = row.show(float(f"{value:.5g}"))
    return text if isinstance(text, str) and row.shown else f"{value:.5g}"


STUDY = Study(
    "design",
    lambda _mesh: _TABLES,
    run,
    DesignResult,
    check,
    rows_to_keep=lambda _known, _case: _NO_ROWS,
    files={"cases": _MADE},
)


#: Columns of verdicts that are drawn, their labels and factors.
_DRAWN = {
    "margin": ("Least damping ratio, %", 100.0),
    "loss_coefficient": ("Loss coefficient", 1.0),
    "opening": ("Opening, cm²", 1e4),
}


def draw(result: StudyResult) -> Iterator[tuple[str, Callable[[], Figure]]]:
    """Figures that the result has numbers for."""
    if result.best and len(result.verified(-1)["pressure"]):
        yield "heads", lambda: draw_heads(result)
    if len(result.best) > 1:
        yield "front", lambda: draw_front(result)


def draw_heads(result: StudyResult) -> Figure:
    """Margin, loss and opening over the driving pressure, of the case and its designs."""
    figure = new_figure(9.6, 3.6)
    axes = figure.subplots(1, len(_DRAWN))
    several = len(result.best) > 1
    for number in (-1, *result.best):
        rows = result.verified(number)
        label = "the case" if number < 0 else f"design {number + 1}" if several else "the design"
        for place, (name, (_, factor)) in zip(axes, _DRAWN.items()):
            style = {"color": "0.45", "ls": "--"} if number < 0 else {}
            place.plot(rows["pressure"] / 1e3, factor * rows[name], marker="o", ms=3, label=label, **style)
    for place, (label, _) in zip(axes, _DRAWN.values()):
        place.set_xlabel(parameter_label(result.case, "pressure"))
        place.set_ylabel(label)
        log_axis(place.xaxis, *limits(result.verified(CASE)["pressure"] / 1e3, log=True))
    axes[0].axhline(0.0, color="0.25", lw=1.0)
    axes[0].legend(frameon=False, fontsize=8)
    return headline(figure, f"{result.header.name}: {result.statements[0].text}")


def draw_front(result: StudyResult) -> Figure:
    """Aim over the bound of the constraint that has several, designs that miss a constraint hollow."""
    aim, front = result.statements[0], max(result.statements[1:], key=lambda one: len(one.bounds))
    figure = new_figure(5.6, 4.2)
    axes = figure.add_subplot()
    scale = {"%": 100.0, "L/s": 1e3, "cm^2": 1e4}
    x_unit, y_unit = (QUANTITIES[one.quantity].shown for one in (front, aim))
    found = [(result.bounds[number], design.aim, design.holds) for number, design in result.best.items()]
    x, y, holds = (np.array(column) for column in zip(*found))
    x, y = x * scale.get(x_unit, 1.0), y * scale.get(y_unit, 1.0)
    axes.plot(x, y, color="0.6", lw=1.0)
    axes.plot(x[holds], y[holds], "o", color="#1f5f8b")
    axes.plot(x[~holds], y[~holds], "o", mfc="none", color="#1f5f8b", label="misses a constraint")
    axes.set_xlabel(f"{front.quantity.capitalize()}, bound, {x_unit}".rstrip(", "))
    axes.set_ylabel(f"{aim.quantity.capitalize()}, {y_unit}".rstrip(", "))
    if not holds.all():
        axes.legend(frameon=False)
    return headline(figure, f"{result.header.name}: {aim.text}")
