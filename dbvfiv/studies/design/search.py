"""Search for a design by sequential quadratic programming (Kraft 1988, DFVLR-FB 88-28; SLSQP of scipy).

Spans of heads are asked at few heads first; where the design that is found fails between them, the worst head is added
and the search goes on.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from ...case.statement import Statement
from ...errors import SolveError
from .problem import AtHead, DesignProblem, together

#: Constraint over its bound that still counts as held.
HELD = 1e-5
#: Rounds in which heads are added, or reserves taken anew, and heads of a span that are looked at.
ROUNDS, LOOK = 4, 13
#: Change of a reserve, over the margin, above which it is taken anew.
SETTLED = 5e-3
#: Starts tried between one that cannot be computed and the case, each halfway on: the last is 3 % of the way from it.
BACK = 6
#: Change of the aim, over its size at the start, at which a search ends.
GAIN = 1e-5
#: Aim and constraints, over their sizes, by which a valve that cannot be computed seems worse: the step is cut to a
#: tenth.
FAR = 1e3


class _Enough(Exception):
    """As many valves were tried as may be."""


@dataclass(frozen=True)
class Design:
    """A design that was found."""

    values: tuple[float, ...]  #: Of the variables, SI.
    aim: float
    constraints: tuple[float, ...]  #: Least favourable value of each.
    #: Largest share of a bound, or of the value at the start where that is larger, by which it is missed; 0 where all
    #: hold, infinite of a valve without a state at one of the heads.
    violation: float

    @property
    def holds(self) -> bool:
        return self.violation <= HELD


def best_of(designs: Sequence[Design], aim: Statement) -> Design | None:
    """Design that holds and aims best, or misses least where none holds; None of none."""
    return min(designs, key=lambda one: (0.0, -aim.sign * one.aim) if one.holds else (one.violation, 0.0), default=None)


class Search:
    """Designs of a problem for an aim and constraints with one bound each.

    Parameters
    ----------
    constraints : sequence of Statement
    tried : callable
        Called with each `Design` that was tried, or the sentence why it could not be.
    """

    def __init__(
        self,
        problem: DesignProblem,
        aim: Statement,
        constraints: Sequence[Statement],
        tried: Callable[[Design | str], None],
    ):
        self.problem, self.aim, self.constraints, self._tried = problem, aim, list(constraints), tried
        self._seen: dict[tuple, tuple] = {}
        self._sizes: dict[str, float] = {}  # what constraints are counted in, by their texts
        self.reserves: dict[float, float] = {}  # of margins of constraints at pressures, see `AtHead.reserve`
        self._latest: tuple | None = None  # valve of the last step that was one

    def from_start(self, share: np.ndarray, evaluations: int) -> Design | None:
        """Best design found from a start, given by shares (n,), as it is at all heads and with the reserves that were
        added last; None where no valve could be computed. Each round may try so many valves.
        """
        best, tried = None, [share]
        self.reserves.clear()
        for _ in range(ROUNDS):
            self._seen.clear()
            found = self._held(self._first_that_holds(tried), evaluations)
            if found is None:
                break
            best = found
            if not (self._renew_reserves(best) | self._add_worst_heads(best)):
                return best
            tried = [self.problem.shares_of(found[4].values) for found in self._by_aim()] + [share]
        return None if best is None else self._counted(best)

    def _counted(self, design: Design) -> Design:
        """A design with its aim and constraints at the heads and with the reserves of now."""
        try:
            return self._compute(design.values)[4]
        except SolveError:
            return replace(design, violation=np.inf)

    def _by_aim(self) -> list[tuple]:
        """Evaluations that were tried and held, the best aim first."""
        held = [found for found in self._seen.values() if found is not None and found[4].holds]
        return sorted(held, key=lambda found: found[0])

    def _first_that_holds(self, shares: list[np.ndarray]) -> np.ndarray:
        """First of some designs that holds at the heads asked; the last where none does."""
        for share in shares[:-1]:
            found = self._evaluated(share)
            if found is not None and found[4].holds:
                return share
        return shares[-1]

    def _held(self, share: np.ndarray, evaluations: int) -> Design | None:
        """As `_optimised`; a search that ends where constraints fail begins again halfway from its start to the case,
        and one that holds from its end, where aim and curvature have another size, until that gains nothing.
        """
        best, again = None, len(self._seen)  # designs of the round before, with what was added to it
        for _ in range(BACK):
            left = evaluations - (len(self._seen) - again)
            ends = np.array_equal(share, self.problem.start)
            found = self._optimised(share, left, left if ends else (left + 1) // 2) if left > 0 else None
            if found is None:
                break
            settled = best is not None and best.holds and abs(found.aim - best.aim) <= GAIN * abs(best.aim)
            best = found
            if settled or (not best.holds and ends):
                break
            share = self.problem.shares_of(best.values) if best.holds else 0.5 * (share + self.problem.start)
        return best

    def _optimised(self, share: np.ndarray, evaluations: int, failing: int) -> Design | None:
        """Best design of all that were tried, after a run from a start that may try so many valves, or so many where
        none of all holds (a run on a hill too low for the constraints may never end by itself).
        """
        from scipy.optimize import minimize

        try:
            share, scale = self._begin(share)
        except _Enough:
            return None
        begun = len(self._seen)

        def spent() -> bool:
            holds = any(found is not None and found[4].holds for found in self._seen.values())
            return len(self._seen) - begun >= (evaluations if holds else failing)

        def part(number: int, x: np.ndarray):
            """One of what `_evaluated` gives; of a valve that is none, what makes any step to it too long."""
            if self.problem.values_at(x) not in self._seen and spent():
                raise _Enough
            found = self._evaluated(np.clip(x, 0.0, 1.0))
            if found is not None:
                self._latest = found
                return (found[0] / scale, found[1] / scale, -found[2], -found[3])[number]
            before = self._latest
            return (before[0] / scale + FAR, before[1] / scale, -before[2] - FAR, -before[3])[number]

        held = {"type": "ineq", "fun": lambda x: part(2, x), "jac": lambda x: part(3, x)}
        with suppress(_Enough):
            minimize(
                lambda x: part(0, x),
                np.clip(share, 0.0, 1.0),
                jac=lambda x: part(1, x),
                bounds=[(0.0, 1.0)] * len(share),
                constraints=[held] if self.constraints else [],
                method="SLSQP",
                options={"ftol": GAIN, "maxiter": evaluations},
            )
        designs = [found[4] for found in self._seen.values() if found is not None]
        return best_of(designs, self.aim)

    def _begin(self, share: np.ndarray) -> tuple[np.ndarray, float]:
        """Start and the size of the aim there; one at which no valve can be computed is moved towards the case. Raises
        _Enough if there is no valve to start from.
        """
        for _ in range(BACK):
            self._latest = self._evaluated(share)
            if self._latest is not None:
                return share, abs(self._latest[0]) or 1.0
            share = 0.5 * (share + self.problem.start)
        raise _Enough

    def _rows(self, statements: Sequence[Statement]) -> list[tuple[Statement, float | None]]:
        """Statements at their pressures, one by one."""
        return [(one, p) for one in statements for p in (one.pressures or (None,))]

    def _heads(self) -> dict[float, bool]:
        """Pressures that are asked, and whether modes are."""
        found: dict[float, bool] = {}
        for one in (self.aim, *self.constraints):
            for p in one.pressures:
                found[p] = found.get(p, False) or one.quantity == "margin"
        return found

    def _evaluated(self, x: np.ndarray):
        """Aim and its derivatives by the shares, constraints (c,) and theirs (c, n), and the design; None where a
        valve is none.
        """
        values = self.problem.values_at(x)
        if values not in self._seen:
            try:
                self._seen[values] = self._compute(values)
                self._tried(self._seen[values][4])
            except SolveError as error:
                self._seen[values] = None
                self._tried(str(error))
        return self._seen[values]

    def _compute(self, values: tuple[float, ...]):
        heads = self._heads()
        found = {p: self.problem.at(values, p, margin) for p, margin in heads.items()}
        for p, at in found.items():
            self.reserves.setdefault(p, at.reserve)
        any_head = next(iter(found.values()))
        widths = np.array([one.high - one.low for one in self.problem.variables])
        asked = [found[p] for p in self.aim.pressures] or [any_head]
        if self.aim.quantity == "margin" and self.problem.inputs:
            asked = [self.problem.without_reserve(values, p) for p in self.aim.pressures]
        aim, slope = together(self.aim, asked)
        values_, missed, slopes, worst = [], [], [], []
        for one in self.constraints:
            here = [found[p] for p in one.pressures] or [any_head]
            values_ = np.array([at.values[one.quantity] for at in here])
            if one.quantity == "margin":
                values_ = values_ - np.array([self.reserves[p] for p in one.pressures])
            (bound,) = one.bounds
            size = self._sizes.setdefault(one.text, max(abs(bound), float(np.abs(values_).max())) or 1.0)
            missed += list(one.sign * (bound - values_) / size)
            slopes += [-one.sign * at.slopes[one.quantity] * widths / size for at in here]
            worst.append(float(one.sign * np.min(one.sign * values_)))
        violation = max([0.0, *missed])
        design = Design(values, aim, tuple(worst), float(violation))
        table = np.array(slopes).reshape(len(missed), len(widths))
        return -self.aim.sign * aim, -self.aim.sign * slope * widths, np.array(missed), table, design

    def _add_worst_heads(self, design: Design) -> bool:
        """True where a span fails between its heads: the head where it fails most is added."""
        added = False
        for i, one in enumerate(self.constraints):
            if not one.span:
                continue
            (bound,) = one.bounds
            looked = [p for p in one.between(LOOK) if p not in one.pressures]
            size = self._sizes[one.text]
            missed = {p: one.sign * (bound - self._plain(design.values, p, one)) / size for p in looked}
            worst = max(missed, key=missed.get, default=None)
            if worst is not None and missed[worst] > HELD:
                self.constraints[i] = one.asked_also_at(worst)
                added = True
        return added

    def _renew_reserves(self, design: Design) -> bool:
        """Take the reserves of a design in constraints; True where one of them moved."""
        moved = False
        for p in {p for one in self.constraints if one.quantity == "margin" for p in one.pressures}:
            at = self.problem.at(design.values, p, True)
            moved |= abs(at.reserve - self.reserves[p]) > SETTLED * max(abs(at.values["margin"]), at.reserve)
            self.reserves[p] = at.reserve
        return moved

    def _plain(self, values: tuple[float, ...], pressure: float, statement: Statement) -> float:
        try:
            at: AtHead = self.problem.at(values, pressure, statement.quantity == "margin")
        except SolveError:
            return -statement.sign * np.inf
        return at.values[statement.quantity] - (at.reserve if statement.quantity == "margin" else 0.0)


def starts_of(problem: DesignProblem, count: int) -> list[np.ndarray]:
    """Shares (n,) of designs to start from: the case itself, then a scrambled Sobol sequence between the bounds."""
    found = [problem.start]
    if count > 1:
        from scipy.stats import qmc

        found += list(qmc.Sobol(len(problem.start), seed=1).random_base2((count - 1).bit_length())[: count - 1])
    return found
