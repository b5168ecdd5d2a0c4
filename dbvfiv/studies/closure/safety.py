"""Safety factor of a valve under back pressure: margin to its first limit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from .model import HELD_LIPS
from .remarks import CROSSED

if TYPE_CHECKING:
    from .result import ClosureResult

BUCKLING, SEAL, CROSSING, END = "buckling", "loss of seal", "faces crossing", "end of the path"
MEANING = (
    "Back pressure at the first limit met as it rises (buckling within the symmetry of the model, loss of seal, inner "
    "faces crossing, end of the equilibria found) over the rated one"
)


@dataclass(frozen=True)
class SafetyFactor:
    """A factor of safety against the first limit, within what the model can show.

    Attributes
    ----------
    factor : float
        `limit_pressure` over `rated_pressure`; with no limit met, how far it was looked, over the rated pressure.
    at_least : bool
        No limit was met, so the factor is a lower bound.
    limit : str or None
        "buckling", "loss of seal", "faces crossing", "end of the path".
    limit_pressure : float or None, Pa
        For a loss of seal the last pressure on the path at which some section was shut; 0 if none ever was. For faces
        that cross the last at which they had not.
    rated_pressure : float, Pa
    followed_to : float, Pa
        Largest back pressure of an equilibrium before arclength takes over.
    seal_assumed : bool
        The supports hold the lips shut, so that a loss of seal cannot be seen.
    """

    factor: float
    at_least: bool
    limit: str | None
    limit_pressure: float | None
    rated_pressure: float
    followed_to: float
    seal_assumed: bool = False

    def summary(self) -> dict[str, Any]:
        """Plain SI numbers for JSON."""
        return vars(self) | {"meaning": MEANING}

    @property
    def sentence(self) -> str:
        """Sentence on the factor of safety and the limit that it refers to."""
        rated = f"over the rated {self.rated_pressure / 1e3:.6g} kPa"
        if self.at_least:
            seal = "its seal is an assumption of the supports," if self.seal_assumed else "does not lose its seal,"
            return (
                f"Safety factor at least {self.factor:.3g}: up to {self.followed_to / 1e3:.6g} kPa, {rated}, it does "
                f"not buckle within the symmetry of the model, {seal} and its faces do not cross; "
                "higher pressures tell more, with closure.rated_pressure for the rated one."
            )
        if self.limit == SEAL and not self.limit_pressure:
            return f"Safety factor 0: no section was shut at any back pressure up to {self.followed_to / 1e3:.6g} kPa."
        return (
            f"Safety factor {self.factor:.3g}: {self.limit} at {self.limit_pressure / 1e3:.6g} kPa, the first limit "
            f"met as the back pressure rises, {rated}."
        )


def find_safety(result: ClosureResult) -> SafetyFactor | None:
    """The factor that a result shows; None if no equilibrium was found."""
    rising = _rising(result)
    if not rising:
        return None
    closure = result.case.closure
    rated = closure.rated_pressure or max(closure.pressures)
    followed = rising[-1].pressure
    limits = [(b.pressure, BUCKLING) for b in result.buckling[:1]]
    held = result.supports == HELD_LIPS
    if not held:
        limits += [(at, SEAL) for at in _last_before(rising, _lost_seal(rising))]
    else:
        crossed = np.array([point.overlap > CROSSED * closure.penetration for point in rising])
        limits += [(at, CROSSING) for at in _last_before(rising, crossed)]
    if result.walk_failure is not None:
        limits.append((followed, END))
    if not limits:
        return SafetyFactor(followed / rated, True, None, None, rated, followed, held)
    pressure, limit = min(limits, key=lambda found: found[0])
    return SafetyFactor(pressure / rated, False, limit, pressure, rated, followed, held)


def _rising(result: ClosureResult) -> list[Any]:
    """Points of the path as the pressure rises, up to where arclength takes over."""
    rising: list[Any] = []
    for point in result.walk:
        if point.arclength:
            break
        if not rising or point.pressure > rising[-1].pressure:
            rising.append(point)
    return rising


def _lost_seal(rising: list[Any]) -> np.ndarray:
    """Mask of points where no section is shut although one was before; True everywhere if none ever was."""
    shut = np.array([point.sealed_length > 0 for point in rising])
    return ~shut & np.maximum.accumulate(shut) if shut.any() else np.ones(len(shut), bool)


def _last_before(rising: list[Any], reached: np.ndarray) -> list[float]:
    """Pressure of the last point before a limit is reached, as a list; empty if it is not."""
    if not reached.any():
        return []
    first = int(np.argmax(reached))
    return [rising[first - 1].pressure if first else 0.0]
