"""Modes along a parameter: what their file holds and what can be read off them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from ...case.axis import Axis
from ...case.parameters import PARAMETERS
from ...model.symmetry import chosen_symmetries
from ...record.mesh import MeshData
from ...record.states import SUMMARY
from ...record.table import Column, TableSpec
from ..result import StudyResult
from ..session import describe_surroundings
from ..stability.verdict import Verdict
from . import figures

POINTS, BRANCHES, CHECKS, STATES = "points", "branches", "checks", "states"
_POINTS = (
    Column("value", "SI", "Value of the parameter"),
    Column("unstable_count", "", "Unstable eigenvalues, both of a pair counted", "i8"),
)
_BRANCHES = (
    Column("id", "", "Number of the branch, by falling largest growth rate", "i8"),
    Column("value", "SI", "Value of the parameter"),
    Column("growth_rate", "1/s", "NaN where the branch does not exist"),
    Column(
        "angular_frequency",
        "rad/s",
        "Imaginary part of the eigenvalue; negative for the second of two real modes that have merged",
    ),
    Column("confidence", "", "0 to 1, of the match with the value before"),
)
_CHECKS = (
    Column("value", "SI", "Value of the parameter"),
    Column("error", "", "Relative error of the basis, or largest residual of full solves"),
    Column("unstable_count", "", "Unstable eigenvalues listed", "i8"),
    Column("unstable_count_independent", "", "Unstable eigenvalues by the argument principle", "i8"),
    Column("agrees", "", "Whether both counts are equal", "bool"),
    Column("accurate", "", "Whether the error is within the tolerance", "bool"),
)


def tables_of(_mesh: MeshData) -> tuple[TableSpec, ...]:
    """Tables of a sweep."""
    return (
        TableSpec(POINTS, _POINTS),
        TableSpec(BRANCHES, _BRANCHES),
        TableSpec(CHECKS, _CHECKS),
        TableSpec(STATES, SUMMARY, {"max_displacement_position": (3,)}),
    )


@dataclass(frozen=True, eq=False)
class Branch:
    """A mode followed along the parameter.

    Attributes
    ----------
    id : int
    growth_rate : (p,) 1/s
        NaN where the branch does not exist.
    angular_frequency : (p,) rad/s
    confidence : (p,)
    """

    id: int
    growth_rate: np.ndarray
    angular_frequency: np.ndarray
    confidence: np.ndarray

    @property
    def frequency(self) -> np.ndarray:
        """(p,) Hz, not negative."""
        return np.abs(self.angular_frequency) / (2 * np.pi)

    def summary(self) -> dict[str, Any]:
        """Plain numbers for JSON; None where the branch does not exist."""
        columns = {"growth_rate": self.growth_rate, "frequency": self.frequency, "confidence": self.confidence}
        return {"id": self.id} | {
            name: [float(v) if np.isfinite(v) else None for v in values] for name, values in columns.items()
        }


@dataclass(frozen=True)
class Crossing:
    """Crossing of zero growth by a branch, interpolated between two values of the parameter.

    Attributes
    ----------
    branch : int
    value : float
    frequency : float, Hz
    to_unstable : bool
        True where the branch becomes unstable as the parameter grows.
    """

    branch: int
    value: float
    frequency: float
    to_unstable: bool


class SweepResult(StudyResult):
    """Modes tracked along one parameter.

    Attributes
    ----------
    parameter : str
        "pressure", "density", "alpha", "beta" or "loss_factor".
    values : (p,) SI
        Those done.
    branches : tuple of Branch
    unstable_count : (p,) int
        Both eigenvalues of a pair count.
    checks : tuple of dict
        See `dbvfiv.studies.sweep.spectra.Check`.
    certified : bool
    points : tuple of dict
        States, see `dbvfiv.record.states.SUMMARY`: one for each value over pressure, a single one otherwise.
    notes : tuple of str
    """

    kind = "sweep"

    @cached_property
    def _found(self) -> dict[str, Any]:
        """Tables of a sweep that is over; of one that goes on or was killed, what was kept on the way."""
        over = self.record.notes("over")
        kept = self.record.notes("kept")
        return {} if over or not kept else kept[-1]

    def _rows(self, table: str) -> list[dict[str, Any]]:
        if self._found:
            return self._found[table]
        spec = next(spec for spec in tables_of(self.mesh) if spec.name == table)
        rows = self.record.table_rows(spec)
        over = self.record.notes("over")
        return rows[slice(*over[-1]["rows"][table])] if over else rows

    @property
    def axis(self) -> Axis:
        return self.case.sweep.axis

    @property
    def parameter(self) -> str:
        return self.axis.parameter

    @cached_property
    def values(self) -> np.ndarray:
        return np.array([row["value"] for row in self._rows(POINTS)], float)

    @cached_property
    def unstable_count(self) -> np.ndarray:
        return np.array([row["unstable_count"] for row in self._rows(POINTS)], int)

    @cached_property
    def branches(self) -> tuple[Branch, ...]:
        rows, count = self._rows(BRANCHES), max(1, len(self.values))
        names = ("growth_rate", "angular_frequency", "confidence")
        return tuple(
            Branch(int(rows[i]["id"]), *(np.array([row[name] for row in rows[i : i + count]], float) for name in names))
            for i in range(0, len(rows), count)
        )

    @cached_property
    def checks(self) -> tuple[dict[str, Any], ...]:
        return tuple(self._rows(CHECKS))

    @cached_property
    def points(self) -> tuple[dict[str, Any], ...]:
        rows = self._rows(STATES)
        return tuple({name: list(v) if isinstance(v, tuple) else v for name, v in row.items()} for row in rows)

    @property
    def certified(self) -> bool:
        """True where all checks held."""
        over = self.record.notes("over")
        return bool(over) and over[-1]["certified"]

    @cached_property
    def verdicts(self) -> tuple[Verdict, ...]:
        """Verdict on each value; none of a sweep that is not over, or was made by an earlier version."""
        over = self.record.notes("over")
        return tuple(map(Verdict.read, over[-1].get("verdicts", ()))) if over else ()

    @property
    def notes(self) -> tuple[str, ...]:
        over = self.record.notes("over")
        return tuple(over[-1]["remarks"]) if over else ()

    @property
    def units(self) -> str:
        """SI unit of the parameter."""
        return PARAMETERS[self.parameter].quantity.si

    def crossings(self) -> tuple[Crossing, ...]:
        """Crossings of zero growth by the branches, interpolated between neighbouring values.

        Two real branches that have merged count once.
        """
        scale = np.log if self.axis.log else np.asarray
        place = scale(self.values)
        found = []
        for branch in self.branches:
            growth = branch.growth_rate
            for i in np.flatnonzero(growth[:-1] * growth[1:] < 0):
                share = growth[i] / (growth[i] - growth[i + 1])
                at = place[i] + share * (place[i + 1] - place[i])
                frequency = branch.frequency[i] + share * (branch.frequency[i + 1] - branch.frequency[i])
                if branch.angular_frequency[i] >= 0:
                    found.append(
                        Crossing(
                            branch.id, float(np.exp(at) if self.axis.log else at), float(frequency), bool(growth[i] < 0)
                        )
                    )
        return tuple(sorted(found, key=lambda c: c.value))

    def summary(self) -> dict[str, Any]:
        return {
            "parameter": self.parameter,
            "symmetry": chosen_symmetries(self.case.sweep.symmetry, self.case.part)[0].name,
            "values": self.values.tolist(),
            "branches": [branch.summary() for branch in self.branches],
            "unstable_count": self.unstable_count.tolist(),
            "verdict": [verdict.summary() for verdict in self.verdicts],
            "crossings": [vars(crossing) for crossing in self.crossings()],
            "certificate": {"certified": self.certified, "checks": list(self.checks)},
            "surroundings": {name: v for name, v in describe_surroundings(self.case).items() if name != self.parameter},
            "states": list(self.points),
            "notes": list(self.notes),
            "warnings": list(self.warnings),
            "failures": list(self.failures),
            "interrupted": not (self.complete or bool(self.failures)),
        }

    def shortfall(self) -> str | None:
        if not self.failures:
            return None
        kept = f"; they are kept in {self.path}" if self.path else ""
        return f"{len(self.values)} of {len(self.axis.values)} values were reached{kept}"

    def remarks(self) -> list[str]:
        return self.lines()[2 + len(self.values) :]

    def drawers(self) -> Iterator[tuple[str, Callable[[], Figure]]]:
        yield from figures.draw(self)

    def lines(self) -> list[str]:
        crossings = [crossing_line(self, crossing) for crossing in self.crossings()]
        places = ", ".join(f"{check['value']:.4g}" for check in self.checks)
        word = "Certified" if self.certified else "Not certified"
        checked = (
            [f"{word}: checked at {self.parameter} {places} {self.units}".rstrip() + "."]
            if self.checks
            else ["Not certified: no value was checked."]
        )
        return [
            *head(self.parameter),
            *rows_of_sweep(self),
            "",
            *crossings,
            *checked,
            *(f"Note: {note}" for note in self.notes),
        ]


def head(parameter: str) -> tuple[str, str]:
    """Names and units above the table."""
    return (
        f"{parameter:>12} {'growth rate':>12} {'frequency':>11} {'unstable':>9}",
        f"{PARAMETERS[parameter].quantity.si:>12} {'1/s':>12} {'Hz':>11}",
    )


def point_row(point: Any) -> str:
    """One line for a value just solved: the leading mode and the number of unstable
    eigenvalues.
    """
    leading = point.eigenvalues[0] if len(point.eigenvalues) else complex(np.nan, np.nan)
    return _row(point.value, leading.real, abs(leading.imag) / (2 * np.pi), point.unstable_count)


def rows_of_sweep(result: SweepResult) -> list[str]:
    """One line for each value: the leading branch."""
    rows = []
    for i, value in enumerate(result.values):
        there = [b for b in result.branches if np.isfinite(b.growth_rate[i])]
        leading = max(there, key=lambda b: b.growth_rate[i], default=None)
        growth, frequency = (leading.growth_rate[i], leading.frequency[i]) if leading else (np.nan, np.nan)
        outcome = result.verdicts[i].outcome if result.verdicts else ""
        rows.append(f"{_row(value, growth, frequency, result.unstable_count[i])}  {outcome}".rstrip())
    return rows


def crossing_line(result: SweepResult, crossing: Crossing) -> str:
    """One sentence on a crossing of zero growth."""
    shown = PARAMETERS[result.parameter]
    becomes = "unstable" if crossing.to_unstable else "stable"
    how = f"at {crossing.frequency:.4g} Hz" if crossing.frequency > 0 else "without oscillation"
    place = f"{crossing.value / shown.scale:.4g} {shown.shown_unit}".rstrip()
    under = f" under {result.case.continuity}" if result.case.continuity else ""
    return f"Branch {crossing.branch} becomes {becomes} near {result.parameter} {place} {how}{under} (interpolated)."


def _row(value: float, growth: float, frequency: float, unstable: int) -> str:
    return f"{value:>12.6g} {growth:>12.4f} {frequency:>11.4f} {unstable:>9d}"
