"""Stability maps: what can be read off a run or its file."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import fields
from functools import cached_property
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from eigen.columns import DIRECT, MISSING

from ...model.symmetry import equilibria_of
from ..result import StudyResult
from ..stability.dimensions import leading_class, read_classes
from ..stability.place import describe_fixed, fixed_conditions
from ..stability.verdict import DIVERGES, FLUTTERS, NOT_VALID, OUTCOMES, STABLE, Verdict
from . import cycles, figures
from .column import MapColumn, MapPlan, grid_of
from .curves import OnsetCurve, linked
from .rows import gap_sentence, read_checks, read_columns, read_curves
from .run import Check

LAWS = {0.0: "quasi-steady", 1.0: "storage"}


class MapResult(StudyResult):
    """Growth rate of the leading mode over two parameters.

    Attributes
    ----------
    plan : MapPlan
        Axes and continuity laws.
    columns : tuple of MapColumn
    curves : tuple of OnsetCurve
    checks : tuple of Check
    """

    kind = "map"

    @cached_property
    def plan(self) -> MapPlan:
        return MapPlan.of(self.case)

    @cached_property
    def columns(self) -> tuple[MapColumn, ...]:
        return tuple(sorted(read_columns(self.record, self.plan), key=lambda column: column.value))

    @cached_property
    def curves(self) -> tuple[OnsetCurve, ...]:
        found = read_curves(self.record)
        return linked(self.plan, self.columns) if found is None else found

    @cached_property
    def checks(self) -> tuple[Check, ...]:
        return read_checks(self.record)

    @property
    def failures(self) -> tuple[str, ...]:
        return tuple(gap_sentence(self.plan, column) for column in self.columns if column.failure)

    def grid(self, name: str) -> np.ndarray:
        """growth_rate, frequency, second, unstable, counted, certified or how on the grid (laws, y, x)."""
        return grid_of(self.plan, self.columns, name)

    def cycle_grid(self, name: str) -> np.ndarray:
        """amplitude, frequency or growing of the limit cycles on the grid (laws, y, x); see
        `dbvfiv.studies.map.cycles`.
        """
        return cycles.cycle_grid(self.record, self.plan, name)

    @property
    def moved(self) -> tuple[str, ...]:
        """Parameters that are not the same all over the map."""
        laws = ("storage",) if len(self.plan.laws) > 1 else ()
        return (self.plan.x.parameter, self.plan.y.parameter, *laws)

    def summary(self) -> dict[str, Any]:
        pictures = [self._picture(i) for i in range(len(self.plan.laws))]
        shared = {
            "x": _axis(self.plan.x),
            "y": _axis(self.plan.y),
            "fixed": fixed_conditions(self.case, *self.moved),
            "checks": [{f.name: getattr(check, f.name) for f in fields(check)} for check in self.checks],
            "gaps": list(self.failures),
            "warnings": list(self.warnings),
            "interrupted": not self.complete,
        }
        document = shared | pictures[0] | {"classes": [_class_summary(note) for note in self.classes]}
        if len(pictures) > 1:
            document["laws"] = pictures
        return document

    @cached_property
    def classes(self) -> list[dict[str, Any]]:
        """Cells in the other classes of motion, where they were asked for."""
        return read_classes(self.record)

    def _picture(self, law: int) -> dict[str, Any]:
        leading = {"leading": self._leading(law)} if self.classes else {}
        followed = cycles.summary_of(self.record, self.plan, law) if self.case.map.cycles else {}
        mine = [curve for curve in self.curves if curve.law == law]
        return (
            {
                "continuity": LAWS.get(self.plan.laws[law], self.plan.laws[law]),
                "growth_rate": self.grid("growth_rate")[law].tolist(),
                "frequency": self.grid("frequency")[law].tolist(),
                "unstable_count": self.grid("unstable")[law].tolist(),
                "unstable_count_independent": self.grid("counted")[law].tolist(),
                "certified": self.grid("certified")[law].astype(bool).tolist(),
                "verdict": self._verdicts(law),
                "onset_curves": [curve.points() for curve in mine],
                "onset_frequencies": [curve.frequency.tolist() for curve in mine],
                "onset_curves_exact": [bool(curve.exact) for curve in mine],
            }
            | leading
            | followed
        )

    def _leading(self, law: int) -> dict[str, Any]:
        """Growth rate, frequency and class of the most unstable motion in each cell, (y, x)."""
        names = [equilibria_of(self.case.part).name, *(note["symmetry"] for note in self.classes)]
        rates, frequencies = (
            np.stack([self.grid(name)[law], *(np.array(note[name], float) for note in self.classes)])
            for name in ("growth_rate", "frequency")
        )
        return leading_class(names, rates, frequencies)

    def shortfall(self) -> str | None:
        gaps = len(self.failures)
        return f"{gaps} of {len(self.columns)} columns were not reached" if gaps else None

    def drawers(self) -> Iterator[tuple[str, Callable[[], Figure]]]:
        yield from figures.draw(self)

    def lines(self) -> list[str]:
        lines = [f"At {describe_fixed(self.case, *self.moved)}:"]
        for i in range(len(self.plan.laws)):
            lines.append(self._cells_line(i))
            lines += [self._curve_line(curve) for curve in self.curves if curve.law == i]
            if self.case.map.cycles:
                lines += cycles.sentences(self.record, self.plan, i)
        lines += [self._class_line(note) for note in self.classes]
        if self.checks:
            worst = max(check.error for check in self.checks)
            agreeing = sum(check.agrees for check in self.checks)
            lines.append(
                f"{agreeing} of {len(self.checks)} cells solved again with the full pencil agree; largest "
                f"difference {worst:.1e}."
            )
        return lines

    def _cells_line(self, law: int) -> str:
        certified, how, outcome = (self.grid(name)[law] for name in ("certified", "how", "outcome"))
        number = {name: int((outcome == i).sum()) for i, name in enumerate(OUTCOMES)}
        unstable, invalid = number[FLUTTERS] + number[DIVERGES], number[NOT_VALID]
        gaps, direct = int((how == MISSING).sum()) - invalid, int((how == DIRECT).sum())
        name = LAWS.get(self.plan.laws[law], f"blend {self.plan.laws[law]:g}")
        return (
            f"{name}: {how.shape[1]} x {how.shape[0]} cells, {unstable} unstable, {number[STABLE]} stable, "
            f"{int(certified.sum())} of {how.size} certified"
            + (f", {number[DIVERGES]} of the unstable ones diverge" if number[DIVERGES] else "")
            + (f", {invalid} not valid" if invalid else "")
            + (f", {direct} solved directly" if direct else "")
            + (f", {gaps} in gaps" if gaps else "")
            + "."
        )

    def _verdicts(self, law: int) -> list[list[dict[str, Any]]]:
        """Verdicts on the cells of the grid, (y, x)."""
        found = {column.value: column for column in self.columns if column.level == 0}
        gap = Verdict.undecided("The column of this cell was not solved.").summary()
        table = [
            [found[across].verdict(law, i).summary() if across in found else gap for across in self.plan.across.values]
            for i in range(len(self.plan.along.values))
        ]
        return [list(row) for row in zip(*table)] if self.plan.transposed else table

    @staticmethod
    def _class_line(note: dict[str, Any]) -> str:
        unstable, certified = np.array(note["unstable"]), np.array(note["certified"], bool)
        return (
            f"class {note['symmetry']} ({note['motion']}): {int(((unstable > 0) & certified).sum())} cells unstable, "
            f"{int(((unstable == 0) & certified).sum())} stable, {int(certified.sum())} of {unstable.size} certified."
        )

    def _curve_line(self, curve: OnsetCurve) -> str:
        kind = "exact" if curve.exact else "not exact"
        return (
            f"  onset curve, {kind}, {len(curve.x)} points: {self.plan.x.parameter} "
            f"{min(curve.x):.6g} to {max(curve.x):.6g}, "
            f"{self.plan.y.parameter} {min(curve.y):.6g} to {max(curve.y):.6g}, "
            f"{min(curve.frequency):.4g} to {max(curve.frequency):.4g} Hz"
        )


def _axis(axis) -> dict[str, Any]:
    return {"parameter": axis.parameter, "values": list(axis.values), "log": axis.log}


def _class_summary(note: dict[str, Any]) -> dict[str, Any]:
    """Plain numbers of a class for JSON."""
    return {
        "symmetry": note["symmetry"],
        "motion": note["motion"],
        "growth_rate": note["growth_rate"],
        "frequency": note["frequency"],
        "unstable_count": note["unstable"],
        "unstable_count_independent": note["counted"],
        "certified": [[bool(cell) for cell in row] for row in note["certified"]],
    }
