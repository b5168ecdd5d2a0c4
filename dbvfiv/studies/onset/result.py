"""Onsets along one parameter: what can be read off a run or its file."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import cached_property
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from ...case.parameters import PARAMETERS
from ...model.symmetry import equilibria_of
from ..result import StudyResult
from ..stability.dimensions import compare_ranges, leading_class, read_classes, read_other_law
from ..stability.place import describe_fixed, fixed_conditions
from ..stability.verdict import DIVERGES, FLUTTERS, NOT_VALID, STABLE, UNDECIDED, lowered
from . import figures
from .line import Interval, StabilityLine, common_stretches, disagreements, joined_stretches, merge_points
from .point import FINE, OnsetSample, read_points, read_samples

CRITICALITY = {"super": "supercritical", "sub": "subcritical"}


class OnsetResult(StudyResult, StabilityLine):
    """Onsets in ascending order of the parameter, and the scan that found them.

    Attributes
    ----------
    parameter : str
    points : tuple of dict
        One for each onset, see `dbvfiv.studies.onset.point.OnsetPoint.summary`; None where something is not known.

    Examples
    --------
    >>> found = dbvfiv.load().onset("density", pressure="6 kPa")            # doctest: +SKIP
    >>> [(point["value"], point["frequency"]) for point in found.points]    # doctest: +SKIP
    """

    kind = "onset"

    @property
    def parameter(self) -> str:
        return self.case.onset.axis.parameter

    @cached_property
    def points(self) -> tuple[dict[str, Any], ...]:
        own = super().unstable_intervals
        return tuple(merge_points(self._own_points, own, self.classes, self._own))

    @cached_property
    def _own_points(self) -> list[dict[str, Any]]:
        """Onsets within the symmetry of the model."""
        return read_points(self.record)

    @property
    def edges(self) -> tuple[float, ...]:
        """Onsets within the symmetry of the model at which its state changes between stable and unstable."""
        return tuple(point["value"] for point in self._own_points if point["edge"])

    @cached_property
    def samples(self) -> tuple[OnsetSample, ...]:
        """Scan on the mesh of the case; values without a state belong to the run and not to its result."""
        samples = read_samples(self.record)
        found = {s.value: s for s in samples if s.mesh == FINE and not (s.failure and s.verdict.holds)}
        return tuple(found[value] for value in sorted(found))

    @cached_property
    def classes(self) -> list[dict[str, Any]]:
        """Onsets in the other symmetry classes, where they were asked for; see `FoundOnsets.note`."""
        return read_classes(self.record)

    @cached_property
    def other_law(self) -> dict[str, Any] | None:
        """Onsets under the other continuity law, where that was asked for; see `FoundOnsets.note`."""
        return read_other_law(self.record)

    @cached_property
    def leading(self) -> dict[str, Any]:
        """Growth rate, frequency and class of the most unstable motion at the values that all classes were asked at."""
        scans = {self._own: self.scan_summary()} | {part["symmetry"]: part["scan"] for part in self.classes}
        values = sorted(set.intersection(*(set(scan["values"]) for scan in scans.values())))
        rows = [[scan["values"].index(value) for value in values] for scan in scans.values()]
        rates, frequencies, certified = (
            np.array([[scan[name][i] for i in at] for scan, at in zip(scans.values(), rows)], kind)
            for name, kind in (("growth_rate", float), ("frequency", float), ("certified", bool))
        )
        found = leading_class(list(scans), rates, frequencies)
        found["symmetry"] = [name or self._own for name in found["symmetry"]]
        return {"values": values} | found | {"certified": certified.all(axis=0).tolist()}

    @property
    def unstable_intervals(self) -> list[Interval]:
        """Intervals of the scanned range in which the state is known to be unstable in a symmetry class asked for."""
        own = super().unstable_intervals
        return joined_stretches([own, *(part["unstable"] for part in self.classes)]) if self.classes else own

    @property
    def stable_intervals(self) -> list[Interval]:
        """Intervals of the scanned range in which the state is known to be stable in all classes asked for."""
        own = super().stable_intervals
        return common_stretches([own, *(part["stable"] for part in self.classes)]) if self.classes else own

    @property
    def uncertain_intervals(self) -> list[Interval]:
        """Intervals of the scanned range in which neither stability nor instability is claimed."""
        own = super().uncertain_intervals
        return joined_stretches([own, *(part["uncertain"] for part in self.classes)]) if self.classes else own

    @property
    def disagreements(self) -> list[tuple[float, float, str]]:
        """Stretches of the range in which the two laws disagree, and the one that is stable there."""
        if self.other_law is None:
            return []
        own = self.case.fluid.continuity
        return disagreements(own, super().stable_intervals, super().unstable_intervals, self.other_law)

    @property
    def comparison(self) -> str | None:
        """One sentence on what both laws say; None where one was asked."""
        if self.other_law is None:
            return None
        row = PARAMETERS[self.parameter]
        return compare_ranges(self.parameter, self.disagreements, row.shown_unit, row.scale)

    def summary(self) -> dict[str, Any]:
        compared = {"other_law": self.other_law, "comparison": self.comparison, "disagreements": self.disagreements}
        return {
            "parameter": self.parameter,
            "points": list(self.points),
            "scan": self.scan_summary(),
            "leading": self.leading,
            "classes": self.classes,
            "fixed": fixed_conditions(self.case, self.parameter),
            "failures": list(self.failures),
            "warnings": list(self.warnings),
            "interrupted": not self.complete,
        } | (compared if self.other_law else {})

    def shortfall(self) -> str | None:
        failed = len(self.failures)
        return f"Parts of the range were not reached: {failed} states failed" if failed else None

    def drawers(self) -> Iterator[tuple[str, Callable[[], Figure]]]:
        yield from figures.draw(self)

    def lines(self) -> list[str]:
        fixed = f"At {describe_fixed(self.case, self.parameter)}:"
        if self.other_law is not None:
            return [*self._table(fixed, self.points), *self._other_lines(), self.comparison]
        return self._table(fixed, self.points)

    def _table(self, fixed: str, points) -> list[str]:
        if not points:
            return [fixed, self._without_onset()]
        unit = PARAMETERS[self.parameter].shown_unit
        head = (
            f"{self.parameter + (f', {unit}' if unit else ''):>16} {'+-':>9} {'Hz':>8}  "
            f"{'':<28}{'below, 1/s':>11}{'above, 1/s':>11}"
        )
        head += "  class" if self.classes else ""
        return [fixed, head, *(self._line(point) for point in points)]

    def _other_lines(self) -> list[str]:
        other = self.other_law
        fixed = f"Under {other['continuity']} continuity:"
        if other["points"]:
            return self._table(fixed, other["points"])
        outcomes = {verdict["outcome"] for verdict in other["scan"].get("verdict", ())}
        sure = outcomes and (outcomes == {STABLE} or outcomes <= {FLUTTERS, DIVERGES})
        said = f"No onset: the valve is {'stable' if outcomes == {STABLE} else 'unstable'} over the range."
        return [fixed, said if sure else "No onset was found, and none is ruled out: some values lack a certificate."]

    @property
    def _own(self) -> str:
        """Class of the equilibria."""
        return equilibria_of(self.case.part).name

    def _without_onset(self) -> str:
        row = PARAMETERS[self.parameter]
        low, high = (self.values[[0, -1]] / row.scale) if len(self.values) else (math.nan, math.nan)
        scanned = f"from {low:.6g} to {high:.6g} {row.shown_unit}".rstrip()
        if not self.complete:
            return f"No onset has been located yet: the search ended early, after {len(self.values)} values {scanned}."
        sure, outcomes = sum(self.leading["certified"]), [verdict.outcome for verdict in self.verdicts]
        invalid = outcomes.count(NOT_VALID)
        if outcomes and invalid == len(outcomes):
            return f"Not valid {scanned}: {lowered(self.verdicts[0].reason)}"
        if not all(self.leading["certified"]) or len(set(outcomes)) != 1 or UNDECIDED in outcomes:
            but = f" {invalid} of them are not valid: the constants of the rubber do not hold." if invalid else ""
            return (
                f"No onset was found, and none is ruled out: {sure} of {len(self.values)} values {scanned} carry a "
                f"certificate.{but}"
            )
        state = "unstable" if self.leading["growth_rate"][0] > 0 else "stable"
        band = min(verdict.band for verdict in self.verdicts)
        scanned += f" for modes up to {band:.4g} Hz" if np.isfinite(band) else ""
        which = f" in classes {', '.join([self._own, *(c['symmetry'] for c in self.classes)])}" if self.classes else ""
        return f"No onset: the valve is {state} {scanned}{which}."

    def _line(self, point: dict[str, Any]) -> str:
        scale = PARAMETERS[self.parameter].scale
        becomes = "unstable above" if point["gains"] else "stable above"
        which = CRITICALITY.get(point["criticality"], point["criticality"])
        words = becomes + (f", {which}" if which else "") if point["edge"] else f"a further mode {becomes}"
        spread = " " * 9 if point["uncertainty"] is None else f"{point['uncertainty'] / scale:9.2g}"
        below, above = (point[side]["growth_rate"] for side in ("below", "above"))
        mark = "" if point["confirmed"] else "  not confirmed"
        return (
            f"{point['value'] / scale:16.8g} {spread} {point['frequency']:8.3f}  "
            f"{words:<28}{below:11.4g}{above:11.4g}{mark}" + (f"  {point['symmetry']}" if self.classes else "")
        )
