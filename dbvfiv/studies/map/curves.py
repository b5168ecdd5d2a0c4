"""Onset curves of a stability map, made of the onsets of its columns.

Every point of them is an onset of a column, where the steady state is an equilibrium of its own and the eigenvalue was
corrected with the full matrices. Onsets are linked from column to column. A curve can leave the map at an edge, turn
back between two columns (the tip of a tongue), or run so steeply that neighbours of a column are far apart on it. What
is not explained so calls for further columns; where they have to be follows from the onsets around it: near a tip the
square of the distance of its two branches is linear in the parameter across.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...case.axis import Level
from ...case.parameters import PARAMETERS
from ...texts import shortly
from ..stability.line import ACCURATE
from .column import MapColumn, MapPlan

#: Distance in the unit square, frequencies counted relatively, up to which onsets of neighbouring columns are linked.
NEIGHBOURS = 0.7
#: The same, up to which the curve between them is taken as known.
FAR = 0.06
#: Largest relative difference of frequencies of neighbours on a known curve.
TUNED = 0.15
#: Distance of two branches at which their tip, and of an onset from an edge at which its exit, counts as reached.
TIP, EDGE = 0.02, 0.01
#: Smallest distance of columns, in the unit square.
WIDTH = 1e-5


@dataclass(frozen=True)
class Onset:
    """One onset of a column, its place in the unit square."""

    law: int
    along: float
    y: float
    frequency: float
    direction: float
    residual: float
    neutral: bool = True

    def apart(self, other: Onset, expected: float = 0.0) -> float:
        """Distance along the columns, less what is expected, and in frequency; infinite for another law or
        direction.
        """
        if self.law != other.law or self.direction != other.direction:
            return np.inf
        return float(np.hypot(other.y - self.y - expected, self.detuned(other)))

    def detuned(self, other: Onset) -> float:
        """Relative difference of frequencies; of contours none counts, on which one mode hands over to another."""
        if not self.neutral:
            return 0.0
        return abs(self.frequency - other.frequency) / max(self.frequency, other.frequency, 1.0)


@dataclass(frozen=True)
class Tip:
    """Two branches that meet beside a column: on its right for side 1, on its left for side -1."""

    column: int
    side: int
    first: int
    second: int


@dataclass
class Web:
    """Links between the onsets of neighbouring columns under one continuity law."""

    number: int  #: Of the family, see `MapPlan.curves`.
    law: int  #: Number of the law.
    columns: list[MapColumn]  #: Those solved under it, ascending.
    place: list[float]  #: (columns,) list of float; 0..1 across.
    onsets: list[list[Onset]]
    #: ahead and behind: from the number of an onset to that of the one it is linked with in the next, or last, column.
    ahead: list[dict[int, int]] = field(default_factory=list)
    behind: list[dict[int, int]] = field(default_factory=list)
    tips: list[Tip] = field(default_factory=list)
    #: Columns with a gap between them and the next: one without a state, or in which nothing is valid.
    gaps: set[int] = field(default_factory=set)

    @classmethod
    def of(cls, plan: MapPlan, columns, number: int) -> Web:
        """Web of the curves of a family through all columns of a map."""
        law = plan.curves[number][0]
        ordered = sorted(columns, key=lambda column: column.value)
        usable = [column for column in ordered if column.has(law)]
        web = cls(
            number,
            law,
            usable,
            [plan.coordinate(plan.across, column.value) for column in usable],
            [[_onset(plan, row) for row in column.onsets if int(row[0]) == number] for column in usable],
        )
        refused = [column for column in ordered if any(s.refusal for s in column.samples.get(law, ()))]
        lost = [c.value for c in ordered if c.failure] + [c.value for c in refused if not c.has(law)]
        web.gaps = {
            i
            for i, (a, b) in enumerate(zip(usable[:-1], usable[1:]))
            if any(a.value < value < b.value for value in lost)
        }
        web.ahead, web.behind = [{} for _ in usable], [{} for _ in usable]
        for i in range(len(usable) - 1):
            if i not in web.gaps:
                web._link(i)
        for i in range(len(usable)):
            for side in (1, -1):
                web.tips += web._tips_beside(i, side)
        return web

    def links(self, side: int) -> list[dict[int, int]]:
        """Links to the next (1) or last (-1) column."""
        return self.ahead if side > 0 else self.behind

    def _link(self, i: int) -> None:
        here, there = self.onsets[i], self.onsets[i + 1]
        pairs = sorted(
            (a.apart(b, self._expected(i, k)), k, m) for k, a in enumerate(here) for m, b in enumerate(there)
        )
        for distance, k, m in pairs:
            if distance <= NEIGHBOURS and k not in self.ahead[i] and m not in self.behind[i + 1]:
                self.ahead[i][k], self.behind[i + 1][m] = m, k

    def _expected(self, i: int, k: int) -> float:
        """Change of an onset along its column up to the next one, if its curve goes on straight."""
        last = self.behind[i].get(k)
        if last is None:
            return 0.0
        slope = (self.onsets[i][k].y - self.onsets[i - 1][last].y) / (self.place[i] - self.place[i - 1])
        return float(np.clip(slope * (self.place[i + 1] - self.place[i]), -0.3, 0.3))

    def loose(self, i: int, side: int) -> list[int]:
        """Onsets of a column that no link leaves on a side; none at the sides of the map."""
        if not 0 <= i + side < len(self.columns):
            return []
        return [k for k in range(len(self.onsets[i])) if k not in self.links(side)[i]]

    def _tips_beside(self, i: int, side: int) -> list[Tip]:
        loose, rows = self.loose(i, side), self.onsets[i]
        if min(i, i + side) in self.gaps:
            return []
        pairs = sorted(
            (abs(rows[k].y - rows[m].y), k, m)
            for a, k in enumerate(loose)
            for m in loose[a + 1 :]
            if rows[k].law == rows[m].law and rows[k].direction != rows[m].direction and rows[k].detuned(rows[m]) < 0.25
        )
        found, taken = [], set()
        for distance, k, m in pairs:
            if distance < NEIGHBOURS and not {k, m} & taken:
                taken |= {k, m}
                found.append(Tip(i, side, k, m))
        return found

    # -- what is not known yet

    def is_known(self, i: int, k: int, side: int) -> bool:
        """True where the neutral curve beside an onset is known.

        It is linked to an onset nearby, ends at an edge or in a fold (tip), or meets a side of the map.
        """
        if not 0 <= i + side < len(self.columns):
            return True
        other = self.links(side)[i].get(k)
        if other is not None:
            return self._is_near(i, k, side, other)
        for tip in self.tips:
            if (tip.column, tip.side) == (i, side) and k in (tip.first, tip.second):
                return self._opening(tip) <= TIP
        return self._to_edge(i, k)[0] <= EDGE

    def _is_near(self, i: int, k: int, side: int, other: int) -> bool:
        a, b = self.onsets[i][k], self.onsets[i + side][other]
        across = self.place[i + side] - self.place[i]
        return np.hypot(a.y - b.y, across) <= max(FAR, 1.5 * abs(across)) and a.detuned(b) <= TUNED

    def _opening(self, tip: Tip) -> float:
        rows = self.onsets[tip.column]
        return abs(rows[tip.first].y - rows[tip.second].y)

    def _to_edge(self, i: int, k: int) -> tuple[float, float]:
        """Distance of an onset from the nearer edge, and that edge."""
        y = self.onsets[i][k].y
        return (y, 0.0) if y < 0.5 else (1.0 - y, 1.0)

    def wanted(self) -> list[float]:
        """Places across at which further columns would make more of the curves known."""
        found = [place for i in range(len(self.columns) - 1) for place in self._wanted_between(i)]
        return sorted(set(found))

    def _wanted_between(self, i: int) -> Iterator[float]:
        low, high = self.place[i], self.place[i + 1]
        if high - low < 2 * WIDTH or i in self.gaps:
            return
        for column, side in ((i, 1), (i + 1, -1)):
            paired = set()
            for tip in (t for t in self.tips if (t.column, t.side) == (column, side)):
                paired |= {tip.first, tip.second}
                if self._opening(tip) > TIP:
                    yield self._within(column, side, self._towards_tip(tip))
            for k in self.loose(column, side):
                if k not in paired and self._to_edge(column, k)[0] > EDGE:
                    yield self._within(column, side, self._towards_edge(column, side, k))
        far = any(not self._is_near(i, k, 1, m) for k, m in self.ahead[i].items())
        if far or self._is_hidden(i):
            yield 0.5 * (low + high)

    def _within(self, i: int, side: int, reach: float | None) -> float:
        """A place at a distance from a column towards a side, in the middle where that leaves the interval."""
        width = abs(self.place[i + side] - self.place[i])
        share = 0.5 if reach is None else reach / width
        return self.place[i] + side * width * (max(share, 0.04) if share < 0.97 else 0.5)

    def _towards_tip(self, tip: Tip) -> float | None:
        """Distance to the fold where two branches are close, extrapolated from the square of their distance."""
        back = self.links(-tip.side)[tip.column]
        if tip.first not in back or tip.second not in back:
            return None
        rows = self.onsets[tip.column - tip.side]
        now, before = self._opening(tip) ** 2, (rows[back[tip.first]].y - rows[back[tip.second]].y) ** 2
        if before <= now:
            return None
        ahead = abs(self.place[tip.column] - self.place[tip.column - tip.side]) * now / (before - now)
        return ahead * (1.0 - (0.4 * TIP) ** 2 / now)

    def _towards_edge(self, i: int, side: int, k: int) -> float | None:
        """Distance at which a straight curve is close to the edge."""
        back = self.links(-side)[i].get(k)
        if back is None:
            return None
        run = self.onsets[i][k].y - self.onsets[i - side][back].y
        left = self.onsets[i][k].y if run < 0 else 1.0 - self.onsets[i][k].y
        if run == 0 or left <= EDGE:
            return None
        return abs(self.place[i] - self.place[i - side]) * (left - 0.4 * EDGE) / abs(run)

    def _is_hidden(self, i: int) -> bool:
        """True where curves between two columns must have been missed.

        The number of unstable modes at the lower edge then changes otherwise than the ends of onset curves explain.
        """
        if self.number != self.law:
            return False
        modes = [self.columns[j].samples[self.law][0].unstable for j in (i, i + 1)]
        if min(modes) < 0:
            return False
        change = modes[1] - modes[0]
        for column, side, sign in ((i, 1, 1.0), (i + 1, -1, -1.0)):
            for k in self.loose(column, side):
                onset = self.onsets[column][k]
                if onset.y <= EDGE:
                    change -= sign * onset.direction * (2 if onset.frequency > 0 else 1)
        return change != 0


def _onset(plan: MapPlan, row) -> Onset:
    law, along, frequency, direction, residual = map(float, row)
    own = plan.curves[int(law)]
    neutral = own[1] == Level()
    return Onset(own[0], along, plan.coordinate(plan.along, along), frequency, direction, residual, neutral)


@shortly
@dataclass(frozen=True)
class OnsetCurve:
    """A curve in the plane of the map on which a mode is neutral, or has another damping."""

    law: int  #: Number of the continuity law.
    #: x and y: (k,); SI values.
    x: np.ndarray
    y: np.ndarray
    frequency: np.ndarray  #: (k,), Hz.
    #: Every point is neutral by the full matrices, and no piece of the curve between them, nor its ends, is a guess.
    exact: bool = False
    #: Largest growth rate, by the full matrices, over the size of the eigenvalue at its points; NaN if a point was not
    #: corrected.
    mismatch: float = float("nan")
    reason: str = ""  #: Why it is not exact.
    level: str = ""  #: Growth rate or damping ratio of the leading mode along it; empty on an onset curve.

    @property
    def title(self) -> str:
        """Name of its kind."""
        return f"contour of {self.level}" if self.level else "onset curve"

    def points(self) -> list[list[float]]:
        """[[x, y], ...]."""
        return [[float(a), float(b)] for a, b in zip(self.x, self.y)]

    def summary(self) -> dict[str, Any]:
        """Numbers of a contour for JSON."""
        own = {"points": self.points(), "frequencies": self.frequency.tolist(), "exact": bool(self.exact)}
        return {"level": self.level} | own


def linked(plan: MapPlan, columns: tuple[MapColumn, ...]) -> tuple[OnsetCurve, ...]:
    """Curves through the onsets of columns."""
    webs = (Web.of(plan, columns, number) for number in range(len(plan.curves)))
    return tuple(_curve(plan, web, chain) for web in webs for chain in _chains(web))


def doubts(plan: MapPlan, curves) -> Iterator[str]:
    """Sentences about curves that are not exact."""
    for curve in curves:
        if not curve.exact:
            at = plan.told(float(curve.x[0]), float(curve.y[0]))
            yield f"The {curve.title} near {at} is not exact: {curve.reason}."


def _chains(web: Web) -> list[list[tuple[int, int]]]:
    """Onsets, (column, number) each, in the order of the curves they lie on."""
    beside: dict[tuple[int, int], list[tuple[int, int]]] = {
        (i, k): [] for i, rows in enumerate(web.onsets) for k in range(len(rows))
    }
    for i, links in enumerate(web.ahead):
        for k, m in links.items():
            beside[i, k].append((i + 1, m))
            beside[i + 1, m].append((i, k))
    for tip in web.tips:
        first, second = (tip.column, tip.first), (tip.column, tip.second)
        beside[first].append(second)
        beside[second].append(first)
    left = dict.fromkeys(beside)
    ends = [node for node, others in beside.items() if len(others) < 2]
    chains = []
    for start in (*ends, *beside):  # what has no end is closed
        if start not in left:
            continue
        chain, node = [], start
        while node is not None:
            del left[node]
            chain.append(node)
            node = next((other for other in beside[node] if other in left), None)
        if len(chain) > 2 and start in beside[chain[-1]]:
            chain.append(start)
        chains.append(chain)
    return chains


def _curve(plan: MapPlan, web: Web, chain) -> OnsetCurve:
    across = np.array([web.columns[i].value for i, _ in chain])
    onsets = [web.onsets[i][k] for i, k in chain]
    along = np.array([onset.along for onset in onsets])
    x, y = (along, across) if plan.transposed else (across, along)
    mismatch = float(np.max([onset.residual for onset in onsets]))
    reason = _reason(plan, web, chain, mismatch)
    frequency = np.array([onset.frequency for onset in onsets])
    level = plan.curves[web.number][1]
    words = "" if level == Level() else level.words
    return OnsetCurve(web.law, x, y, frequency, not reason, mismatch, reason, words)


def _reason(plan: MapPlan, web: Web, chain, mismatch: float) -> str:
    if not mismatch <= ACCURATE:
        return "not all of its points were corrected with the full matrices"
    for i, k in chain:
        if not (web.is_known(i, k, 1) and web.is_known(i, k, -1)):
            at = PARAMETERS[plan.across.parameter].named(web.columns[i].value)
            return f"it is not known between the columns beside {at}"
    return ""
