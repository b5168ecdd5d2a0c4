"""Onsets along one parameter: run, storage, what can be read off a run or its file, and the figure."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from ...case.parameters import PARAMETERS
from ...drawing.style import ACCENT, COMPUTED, HALO, PUBLISHED, REST, limits, log_axis, new_figure, parameter_label
from ...observer import Observer
from ...record.record import GrowingRecord, Record
from ...texts import digits
from ..case import Case
from ..result import RangeResult
from ..session import Session, Study
from ..stability.dimensions import Variant, certified_in_all, compare_ranges, leading_class, own_variant, variants
from ..stability.place import check_range, describe_fixed, fixed_conditions
from ..stability.samples import SAMPLE_TABLE, Sample, keep_samples, read_samples
from ..stability.verdict import NOT_VALID, Verdict, lowered
from ..stability.walk import StabilityWalk
from .line import FoundOnsets, Interval, OnsetPoint, joined_stretches
from .search import FINE, run_onset

CRITICALITY = {"super": "supercritical", "sub": "subcritical"}
#: Kinds of notes: on a point, and on a variant that was searched to its end.
_POINT, _DONE = "point", "searched"


class _Keeper(Observer):
    """Keeps every sample and point of a variant as soon as it is found."""

    def __init__(self, record: GrowingRecord, variant: Variant):
        self.record, self.variant = record, variant

    def item(self, result: Sample | OnsetPoint) -> None:
        if isinstance(result, Sample):
            keep_samples(self.record, [result])
        else:
            self.record.note(_POINT, variant=list(self.variant), **result.summary())
        self.record.item(result)

    def progress(self, text: str) -> None:
        self.record.progress(text)


def check(case: Case) -> None:
    """Refuse a range of what the case does not have, and flow models that do not differ."""
    check_range(case, case.onset.axis.parameter)
    variants(case, "onset")


def run(session: Session, record: GrowingRecord) -> None:
    """Onsets along `onset.over` of the case in every variant; each sample and point is kept as it is found."""
    case, asked = session.case, variants(session.case, "onset")
    record.begin("onset", None)
    walk = StabilityWalk(case, record, session.model)
    for variant in asked:
        found = read_onsets(record, variant)
        if found is None:
            prefix = variant.prefix(asked[0])
            record.progress(f"{prefix}{variant.motion.words}" if prefix else "scan")
            known = [*read_samples(record), *_points(record, variant)]
            found = run_onset(case, variant, _Keeper(record, variant), known, walk.in_class(variant.motion))
            record.note(_DONE, variant=list(variant), failures=list(found.failures), warnings=list(found.warnings))
        for sentence in found.failures:
            record.fail(f"{variant.prefix(asked[0])}{sentence}")
        for sentence in found.warnings:
            record.warn(f"{variant.prefix(asked[0])}{sentence}")
    record.warn(*walk.about_rubbers())


def _points(record: Record, variant: Variant) -> list[OnsetPoint]:
    """Latest state of each onset of a variant, in ascending order of the parameter."""
    notes = [note for note in record.notes(_POINT) if Variant(*note["variant"]) == variant]
    latest = {(*note["bracket"], note["ahead"]): OnsetPoint.read(note) for note in notes}
    return sorted(latest.values(), key=lambda point: point.value)


def read_onsets(record: Record, variant: Variant, partly: bool = False) -> FoundOnsets | None:
    """Onsets of a variant; None where it was not searched to its end, unless they are wanted `partly` too."""
    done = [note for note in record.notes(_DONE) if Variant(*note["variant"]) == variant]
    if not (done or partly):
        return None
    key = (variant.storage, variant.symmetry, FINE)
    samples = {s.value: s for s in read_samples(record) if s.key[:3] == key}
    said = [tuple(done[-1][name]) if done else () for name in ("failures", "warnings")]
    found = tuple(samples[v] for v in sorted(samples) if not samples[v].failure)
    missed = tuple(v for v in sorted(samples) if samples[v].failure)
    return FoundOnsets(variant, found, tuple(_points(record, variant)), *said, missed)


class OnsetResult(RangeResult):
    """Onsets in ascending order of the parameter, and the scan that found them.

    Attributes
    ----------
    parameter : str
    points : tuple of dict
        One for each onset, see `dbvfiv.studies.onset.search.OnsetPoint.summary`; None where something is not known.

    Examples
    --------
    >>> found = dbvfiv.load().onset("density", pressure="6 kPa")            # doctest: +SKIP
    >>> [(point["value"], point["frequency"]) for point in found.points]    # doctest: +SKIP
    """

    kind = "onset"
    missed = "Parts of the range were not reached: {} states failed"

    @cached_property
    def variants(self) -> dict[Variant, FoundOnsets]:
        """Onsets of each variant, that of the case first; of the others those that were searched to their end."""
        own = own_variant(self.case)
        found = {own: read_onsets(self.record, own, partly=True)}
        others = (variant for variant in variants(self.case, "onset") if variant != own)
        return found | {v: onsets for v in others if (onsets := read_onsets(self.record, v)) is not None}

    @property
    def own(self) -> FoundOnsets:
        """Onsets of the variant of the case."""
        return next(iter(self.variants.values()))

    @cached_property
    def _classes(self) -> list[FoundOnsets]:
        return [found for variant, found in self.variants.items() if not variant.motion.of_equilibria]

    @property
    def classes(self) -> list[dict[str, Any]]:
        """Onsets in the other symmetry classes, where they were asked for; see `FoundOnsets.summary`."""
        return [{k: v for k, v in found.summary().items() if k != "continuity"} for found in self._classes]

    @cached_property
    def other_law(self) -> dict[str, Any] | None:
        """Onsets under the other continuity law, where that was asked for; see `FoundOnsets.summary`."""
        law = self.case.fluid.continuity
        return next((found.summary() for variant, found in self.variants.items() if variant.continuity != law), None)

    @cached_property
    def points(self) -> tuple[dict[str, Any], ...]:
        parts = (self.own, *self._classes)
        points = {part.variant.symmetry: [point.summary() for point in part.points] for part in parts}
        return tuple(merge_points(points, {part.variant.symmetry: part.unstable_intervals for part in parts}))

    @property
    def values(self) -> np.ndarray:
        """(s,) values of the scan, SI."""
        return self.own.values

    @property
    def growth_rates(self) -> np.ndarray:
        """(s, 4) growth rates of the leading modes there, 1/s; NaN where there are fewer."""
        return self.own.growth_rates

    @property
    def frequencies(self) -> np.ndarray:
        """(s, 4) frequencies of the leading modes there, Hz."""
        return self.own.frequencies

    @property
    def certified(self) -> np.ndarray:
        """(s,) bool, whether an independent count agrees."""
        return self.own.certified

    @property
    def verdicts(self) -> tuple[Verdict, ...]:
        """Verdicts on the values of the scan in the class of the equilibria."""
        return self.own.verdicts

    @cached_property
    def leading(self) -> dict[str, Any]:
        """Growth rate, frequency and class of the most unstable motion at the values that all classes were asked at;
        where others than that of the equilibria were, the verdict on them all too.
        """
        scans = {found.variant.symmetry: found.scan() for found in (self.own, *self._classes)}
        values = sorted(set.intersection(*(set(scan["values"]) for scan in scans.values())))
        rows = [[scan["values"].index(value) for value in values] for scan in scans.values()]
        rates, frequencies, certified = (
            np.array([[scan[name][i] for i in at] for scan, at in zip(scans.values(), rows)], kind)
            for name, kind in (("growth_rate", float), ("frequency", float), ("certified", bool))
        )
        found = leading_class(list(scans), rates, frequencies)
        found["symmetry"] = [name or self._own for name in found["symmetry"]]
        verdicts = [[Verdict.read(scan["verdict"][i]) for i in at] for scan, at in zip(scans.values(), rows)]
        if self._classes:
            found["verdict"] = [Verdict.joined(dict(zip(scans, own))).summary() for own in zip(*verdicts)]
        grows = np.array([[each.stable is False for each in own] for own in verdicts], bool)
        return {"values": values} | found | {"certified": certified_in_all(certified, grows).tolist()}

    def _intervals(self, join: Callable, name: str) -> list[Interval]:
        parts = [getattr(found, name) for found in (self.own, *self._classes)]
        return join(parts) if self._classes else parts[0]

    @property
    def unstable_intervals(self) -> list[Interval]:
        """Intervals of the scanned range in which the state is known to be unstable in a symmetry class asked for."""
        return self._intervals(joined_stretches, "unstable_intervals")

    @property
    def stable_intervals(self) -> list[Interval]:
        """Intervals of the scanned range in which the state is known to be stable in all classes asked for."""
        return self._intervals(common_stretches, "stable_intervals")

    @property
    def uncertain_intervals(self) -> list[Interval]:
        """Intervals of the scanned range in which neither stability nor instability is claimed."""
        return stretches_without(self._intervals(joined_stretches, "uncertain_intervals"), self.unstable_intervals)

    @property
    def disagreements(self) -> list[tuple[float, float, str]]:
        """Stretches of the range in which the two laws disagree, and the one that is stable there."""
        if self.other_law is None:
            return []
        own, law = self.own, self.case.fluid.continuity
        return disagreements(law, own.stable_intervals, own.unstable_intervals, self.other_law)

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
            "scan": self.own.scan(),
            "leading": self.leading,
            "classes": self.classes,
            "fixed": fixed_conditions(self.case, self.parameter),
            **self.ending(),
        } | (compared if self.other_law else {})

    def lines(self) -> list[str]:
        fixed, alone = f"At {describe_fixed(self.case, self.parameter)}", f"; {self.own.variant.motion.alone}"
        lines = self._table(f"{fixed}{'' if self.classes else alone}:", self.points, [self.own, *self._classes])
        if self.other_law is None:
            return lines
        law, points = self.other_law["continuity"], self.other_law["points"]
        other = [found for variant, found in self.variants.items() if variant.continuity == law]
        return [*lines, *self._table(f"Under {law} continuity{alone}:", points, other), self.comparison]

    def _table(self, fixed: str, points, parts: Sequence[FoundOnsets]) -> list[str]:
        """Lines on the points of some classes under one flow model."""
        if not points:
            return [fixed, self._without_onset(parts)]
        unit = self._row.shown_unit
        head = (
            f"{self.parameter + (f', {unit}' if unit else ''):>16} {'+-':>9} {'Hz':>8}  "
            f"{'':<28}{'below, 1/s':>11}{'above, 1/s':>11}"
        )
        head += "  class" if self.classes else ""
        return [fixed, head, *(self._line(point) for point in points)]

    @property
    def _own(self) -> str:
        """Class of the equilibria."""
        return self.own.variant.symmetry

    def _without_onset(self, parts: Sequence[FoundOnsets]) -> str:
        values, verdicts = parts[0].values.tolist(), parts[0].verdicts
        scanned = f"from {self._row.span(*(values[:1] + values[-1:] or (math.nan, math.nan)))}"
        if not self.complete:
            return f"No onset has been located yet: the search ended early, after {len(values)} values {scanned}."
        invalid = [verdict.outcome for verdict in verdicts].count(NOT_VALID)
        if values and invalid == len(values):
            return f"Not valid {scanned}: {lowered(verdicts[0].reason)}"
        sure = set.intersection(*(set(part.values[part.certified].tolist()) for part in parts))
        states = [{verdict.stable for verdict in part.verdicts} for part in parts]
        unclear = any(part.uncertain_intervals or not part.certified.all() for part in parts)
        if unclear or any(known not in ({True}, {False}) for known in states):
            but = f" {invalid} of them are not valid: the constants of the rubber do not hold." if invalid else ""
            return (
                f"No onset was found, and none is ruled out: {len(sure)} of {len(values)} values {scanned} carry "
                f"two counts that agree.{but}"
            )
        band = min(verdict.band for part in parts for verdict in part.verdicts)
        scanned += f" for modes up to {digits(band, 4)} Hz" if np.isfinite(band) else ""
        which = ("class " if len(parts) == 1 else "classes ") + ", ".join(part.variant.symmetry for part in parts)
        return f"No onset: the valve is {'unstable' if {False} in states else 'stable'} {scanned} in {which}."

    def _line(self, point: dict[str, Any]) -> str:
        scale = self._row.scale
        becomes = "unstable above" if point["gains"] else "stable above"
        which = CRITICALITY.get(point["criticality"], point["criticality"])
        words = becomes + (f", {which}" if which else "") if point["edge"] else f"a further mode {becomes}"
        spread = " " * 9 if point["uncertainty"] is None else f"{point['uncertainty'] / scale:9.2g}"
        below, above = (point[side]["growth_rate"] for side in ("below", "above"))
        mark = "" if point["confirmed"] else "  not confirmed"
        mark += f"  {point.get('symmetry', self._own)}" if self.classes else ""
        return (
            f"{point['value'] / scale:16.8g} {spread} {point['frequency']:8.3f}  "
            f"{words:<28}{below:11.4g}{above:11.4g}{mark}"
        )


#: Stretches narrower than this part of their place are what is left of the search for an onset.
_SLIVER = 1e-6


def common_stretches(parts: Sequence[Sequence[Interval]]) -> list[Interval]:
    """Stretches that lie in all of some lists."""
    found = list(map(tuple, parts[0]))
    for part in parts[1:]:
        pairs = ((max(a, c), min(b, d)) for a, b in found for c, d in part)
        found = [(low, high) for low, high in pairs if low < high]
    return sorted(found)


def stretches_without(parts: Sequence[Interval], taken: Sequence[Interval]) -> list[Interval]:
    """Stretches without what others take of them."""
    for low, high in taken:
        pieces = (piece for a, b in parts for piece in ((a, min(b, low)), (max(a, high), b)))
        parts = [piece for piece in pieces if piece[0] < piece[1]]
    return list(parts)


def disagreements(
    own: str, stable: Sequence[Interval], unstable: Sequence[Interval], other: dict[str, Any]
) -> list[tuple[float, float, str]]:
    """Stretches (start, stop, law that is stable) in which one law is stable and the other is not.

    Parameters
    ----------
    own : str
        The case's law, with its `stable` and `unstable` stretches.
    other : dict
        Summary of the other law, see `FoundOnsets.summary`.
    """
    found = [(*part, own) for part in common_stretches([stable, other["unstable"]])]
    found += [(*part, other["continuity"]) for part in common_stretches([unstable, other["stable"]])]
    found = [part for part in found if part[1] - part[0] > _SLIVER * abs(part[1])]
    joined: list[tuple[float, float, str]] = []
    for low, high, law in sorted(found):
        if joined and joined[-1][2] == law and low - joined[-1][1] <= _SLIVER * abs(low):
            joined[-1] = (joined[-1][0], high, law)
        else:
            joined.append((low, high, law))
    return joined


def merge_points(
    points: Mapping[str, Sequence[dict[str, Any]]], unstable: Mapping[str, Sequence[Interval]]
) -> list[dict[str, Any]]:
    """Points of all classes, by their names, in ascending order. Where another class is unstable, in the stretches that
    it has, a crossing is no edge of stability.
    """
    merged = []
    for name, own in points.items():
        elsewhere = [stretch for other, found in unstable.items() if other != name for stretch in found]
        for point in own:
            covered = any(low <= point["value"] <= high for low, high in elsewhere)
            merged.append(point | {"symmetry": name, "edge": point["edge"] and not covered})
    return sorted(merged, key=lambda point: point["value"])


_UNSTABLE = "#f6ddcf"


def draw(result: RangeResult) -> Iterator[tuple[str, Callable[[], Figure]]]:
    """Figures of an onset result, each with its name."""
    if len(result.values):
        yield "onset", lambda: onset(result)


def onset(result: RangeResult) -> Figure:
    """Growth rate and frequency of the leading modes, unstable ranges shaded, uncertain ones hatched, onsets marked."""
    axis = result.axis
    scale = PARAMETERS[axis.parameter].scale
    values = result.values / scale
    figure = new_figure(7.2, 5.8)
    top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    _shade(result, scale, top, bottom)
    low = _draw_scan(result, values, top, bottom)
    for row in result.points:
        _mark(row, scale, axis.parameter, top, bottom)
    # room for the words at the marks
    rates = [result.growth_rates.ravel(), *(part["scan"]["growth_rate"] for part in result.classes)]
    top.set_ylim(low, max(1.1 * np.nanmax(np.concatenate(rates), initial=0.0), -0.3 * low))
    top.set_ylabel("Growth rate, 1/s")
    bottom.set_ylabel("Frequency, Hz")
    bottom.set_ylim(bottom=0)
    bottom.set_xlabel(parameter_label(result.case, axis.parameter))
    top.set_title(_title(result), loc="left", fontweight="bold")
    figure.legend(loc="outside lower center", ncols=3)
    for axes in (top, bottom):
        if axis.log:
            log_axis(axes.xaxis, *limits(values, True))
        axes.set_xlim(*limits(values, axis.log))
        axes.tick_params(labelbottom=True)
    return figure


def _shade(result: RangeResult, scale: float, *panels) -> None:
    """Unstable ranges in a tint; hatched where nothing is certified, and so nothing claimed."""
    unsure = {"facecolor": "#ececec", "edgecolor": "#9a9a9a", "hatch": "////"}
    for label, look in (("unstable", {"facecolor": _UNSTABLE}), ("uncertain", unsure)):
        for number, (a, b) in enumerate(getattr(result, f"{label}_intervals")):
            for axes in panels:
                named = label if axes is panels[0] and not number else None
                axes.axvspan(a / scale, b / scale, lw=0, zorder=0, label=named, **look)


def _draw_scan(result: RangeResult, values: np.ndarray, top, bottom) -> float:
    """Curves of the scan; the growth rate down to which they are shown."""
    growth, frequency = result.growth_rates, result.frequencies
    low = _floor(growth)
    for k in range(1, growth.shape[1]):
        shown = growth[:, k] > low
        label = "further modes" if k == 1 else None
        top.plot(values, np.where(shown, growth[:, k], np.nan), "s", color=REST, ms=3.5, label=label)
        bottom.plot(values, np.where(shown, frequency[:, k], np.nan), "s", color=REST, ms=3.5)
    top.plot(values, growth[:, 0], ".-", color=COMPUTED, label="leading mode")
    changes = np.flatnonzero(_jumps(frequency[:, 0]))
    bottom.plot(np.insert(values, changes, np.nan), np.insert(frequency[:, 0], changes, np.nan), ".-", color=COMPUTED)
    for part, style in zip(result.classes, ("--", "-.", ":")):
        scan, scale = part["scan"], PARAMETERS[result.parameter].scale
        places, rates = np.array(scan["values"]) / scale, np.array(scan["growth_rate"])
        look = {"ls": style, "color": ACCENT, "lw": 1.2}
        top.plot(places, np.where(rates > low, rates, np.nan), label=f"class {part['symmetry']}", **look)
        bottom.plot(places, scan["frequency"], **look)
    top.axhline(0.0, color="0.25", lw=1.0)
    return low


def _mark(row: dict, scale: float, parameter: str, top, bottom) -> None:
    """An onset with its uncertainty and numbers: full where supercritical, hollow where subcritical, else grey."""
    x = row["value"] / scale
    inside = {"super": PUBLISHED, "sub": "white"}.get(row["criticality"], "0.75")
    look = {"marker": "o", "ms": 7, "color": PUBLISHED, "mfc": inside, "ls": "none", "zorder": 5}
    top.plot(x, 0.0, **look)
    bottom.plot(x, row["frequency"], **look)
    if row["uncertainty"] is not None:
        reach = row["uncertainty"] / scale
        top.plot([x - reach, x + reach], [0, 0], color=ACCENT, lw=3.5, alpha=0.75, zorder=4, solid_capstyle="butt")
    kind, doubt = CRITICALITY.get(row["criticality"], ""), "" if row["confirmed"] else "not confirmed"
    told = (PARAMETERS[parameter].amount(row["value"], 4), f"{digits(row['frequency'])} Hz", kind, doubt)
    words = "\n".join(filter(None, told))
    # on the side of the mark that the curve leaves free
    place = {"xytext": (9, -8), "va": "top"} if row["gains"] else {"xytext": (9, 8), "va": "bottom"}
    look = {"textcoords": "offset points", "fontsize": 8.5, "color": PUBLISHED, "path_effects": HALO}
    top.annotate(words, (x, 0.0), **look, **place)


def _floor(growth: np.ndarray) -> float:
    leading = growth[:, 0]  # not numbers where no mode was found
    return float(min(-5.0, 1.25 * np.nanmin(leading, initial=0.0), -0.6 * np.nanmax(np.abs(leading), initial=0.0)))


def _jumps(frequency: np.ndarray) -> np.ndarray:
    """Mask of values where another mode has become the leading one."""
    step = np.abs(np.diff(frequency, prepend=frequency[:1]))
    return step > 0.25 * np.maximum(frequency, 1.0)


def _title(result: RangeResult) -> str:
    return f"{result.header.name}, {describe_fixed(result.case, result.parameter)}"


# points are notes: what more is known about one is noted again
STUDY = Study("onset", lambda _mesh: (SAMPLE_TABLE,), run, OnsetResult, check)
