"""Verdicts on a valve under back pressure: safety factor, answer at the rated pressure, buckling by symmetry class."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ...model.supports import HELD_LIPS
from ...model.symmetry import equilibria_of, symmetry_named
from ...record.record import Record
from ...texts import digits
from ..result import StudyResult
from .walk import BUCKLED_CLASS, CROSSED, LOWEST

BUCKLING, SEAL, CROSSING, END = "buckling", "loss of seal", "faces crossing", "end of the path"
MEANING = (
    "Back pressure at the first limit met as it rises (buckling {}, loss of seal, inner faces crossing, end of the "
    "equilibria found) over the rated one"
)
#: Motions among which buckling was looked for: those of the path, or of every symmetry class.
OWN, EVERY = "within the symmetry of the model", "in any symmetry class"


@dataclass(frozen=True)
class SafetyFactor:
    """A factor of safety against the first limit, within what the model can show."""

    #: `limit_pressure` over `rated_pressure`; with no limit met, how far it was looked, over the rated pressure.
    factor: float
    at_least: bool  #: No limit was met, so the factor is a lower bound.
    limit: str | None  #: "buckling", "loss of seal", "faces crossing", "end of the path".
    #: Pa; for a loss of seal the last pressure on the path at which some section was shut; 0 if none ever was. For
    #: faces that cross the last at which they had not.
    limit_pressure: float | None
    rated_pressure: float  #: Pa; that of the case, else the largest one asked for.
    followed_to: float  #: Pa; largest back pressure of an equilibrium before arclength takes over.
    seal_assumed: bool = False  #: The supports hold the lips shut, so that a loss of seal cannot be seen.
    is_rated: bool = False  #: The case names a rated back pressure.
    watched: str = OWN  #: Motions among which buckling was looked for: `OWN` or `EVERY`.

    def summary(self) -> dict[str, Any]:
        """Plain SI numbers for JSON."""
        told = {name: value for name, value in vars(self).items() if name not in ("is_rated", "watched")}
        return told | {"meaning": MEANING.format(self.watched)}

    @property
    def sentence(self) -> str:
        """Sentence on the factor of safety and the limit that it refers to."""
        rated = "rated" if self.is_rated else "largest asked, as none is rated:"
        rated = f"over the {rated} {self.rated_pressure / 1e3:.6g} kPa"
        if self.at_least:
            seal = "its seal is an assumption of the supports," if self.seal_assumed else "does not lose its seal,"
            return (
                f"Safety factor at least {self.factor:.3g}: up to {self.followed_to / 1e3:.6g} kPa, {rated}, it does "
                f"not buckle {self.watched}, {seal} and its faces do not cross; "
                "higher pressures tell more" + (", and so does closure.rated_pressure." if not self.is_rated else ".")
            )
        if self.limit == SEAL and not self.limit_pressure:
            return f"Safety factor 0: no section was shut at any back pressure up to {self.followed_to / 1e3:.6g} kPa."
        return (
            f"Safety factor {self.factor:.3g}: {self.limit} at {self.limit_pressure / 1e3:.6g} kPa, the first limit "
            f"met as the back pressure rises, {rated}."
        )


def find_safety(result: StudyResult) -> SafetyFactor | None:
    """The factor that a result shows; None if no equilibrium was found."""
    rising = rising_points(result)
    if not rising:
        return None
    closure = result.case.closure
    rated, is_rated = closure.rated_pressure or max(closure.pressures), closure.rated_pressure is not None
    followed = rising[-1].pressure
    first, watched = buckles_first(result), watched_by(result)
    limits = [] if first is None else [(first.pressure, BUCKLING)]
    held = result.supports == HELD_LIPS
    if not held:
        limits += [(at, SEAL) for at in _last_before(rising, _lost_seal(rising))]
    else:
        crossed = np.array([point.overlap > CROSSED * result.case.valve.initial_gap for point in rising])
        limits += [(at, CROSSING) for at in _last_before(rising, crossed)]
    lost = () if result.walk_failure is None else closure.pressures[len(result.states) :]
    if lost and lost[0] > followed and not result.buckling:
        limits.append((followed, END))
    if not limits:
        return SafetyFactor(followed / rated, True, None, None, rated, followed, held, is_rated, watched)
    pressure, limit = min(limits, key=lambda found: found[0])
    return SafetyFactor(pressure / rated, False, limit, pressure, rated, followed, held, is_rated, watched)


class FirstBuckling(NamedTuple):
    """Back pressure, Pa, at which a wall buckles first, the kind of that state, "limit point", "bifurcation", or
    "unstable" of a class that was not followed to where it buckles, and the class.
    """

    pressure: float
    kind: str
    symmetry: str


def buckles_first(result: StudyResult) -> FirstBuckling | None:
    """First buckling of a wall in any symmetry class that was watched: on its path the first state met, as the path
    turns back beyond it; None where it does not.
    """
    found = [FirstBuckling(b.pressure, b.kind, equilibria_of(result.case.part).name) for b in result.buckling[:1]]
    for part in result.classes:
        found += [FirstBuckling(b["pressure"], b["kind"], part.symmetry) for b in part.buckling]
        if not part.buckling and part.unstable_from is not None:
            found.append(FirstBuckling(part.unstable_from, "unstable", part.symmetry))
    return min(found, default=None)


def watched_by(result: StudyResult) -> str:
    """Motions among which buckling was looked for, `OWN` or `EVERY`."""
    return EVERY if result.classes else OWN


def rated_verdict(result: StudyResult) -> dict[str, Any] | None:
    """Answer at the rated back pressure, in SI units; None where no rated one is given or nothing was found.

    ``pressure``, whether it is ``examined``, ``shut`` and ``sealed`` there, without any gap left, ``leak`` in m3/s,
    ``buckles_at`` and ``examined_to`` in Pa, the ``margin`` to the first limit as a share of the rated pressure, and
    whether that is a lower bound, ``at_least``.
    """
    rated, safety = result.case.closure.rated_pressure, result.safety
    if rated is None or safety is None:
        return None
    state = next((s for s in result.states if np.isclose(s.pressure, rated) and not s.beyond_limit), None)
    seen = state is not None and not safety.seal_assumed
    return {
        "pressure": rated,
        "examined": state is not None,
        "shut": bool(state.closed) if seen else None,
        "sealed": state.leak == 0.0 if seen else None,
        "leak": state.leak if seen else None,
        "buckles_at": first.pressure if (first := buckles_first(result)) else None,
        "examined_to": safety.followed_to,
        "margin": safety.factor - 1.0,
        "at_least": safety.at_least,
    }


def rated_leak(result: StudyResult) -> str:
    """Leak at the rated back pressure in words, a bound of a fluid without viscosity."""
    told = rated_verdict(result)
    if told is None or told["leak"] is None:
        return "not examined"
    ideal = told["leak"] > 0 and not result.case.fluid.dynamic_viscosity
    return f"{digits(told['leak'] * 3.6e6)} L/h{' at most, as fluid.viscosity is none' if ideal else ''}"


def rated_sentence(result: StudyResult) -> str | None:
    """Answer at the rated back pressure in one sentence; None where no rated one is given."""
    told = rated_verdict(result)
    if told is None:
        return None
    begin = f"Rated back pressure {told['pressure'] / 1e3:.6g} kPa:"
    at = told["buckles_at"]
    if not told["examined"] and result.buckling and at is not None and at < told["pressure"]:
        return (
            f"{begin} not reached, as the wall buckles at {at / 1e3:.6g} kPa, {at / told['pressure']:.2g} times that."
        )
    if not told["examined"]:  # another class that buckles ends no path
        why = result.walk_failure or "it is not among closure.pressures."
        if any(np.isclose(state.pressure, told["pressure"]) for state in result.states):
            why = "its state lies beyond a limit point; ask for it before higher ones."
        return f"{begin} not examined; {why}"
    seal = "sealing not examined, as the supports hold the lips shut"
    if told["sealed"] is not None:
        seal = "sealed" if told["sealed"] else "shut" if told["shut"] else "open"
        seal += f", leak {rated_leak(result)}"
    buckles = f"no buckling {watched_by(result)} up to {told['examined_to'] / 1e3:.6g} kPa"
    buckles = buckles if at is None else f"buckles at {at / 1e3:.6g} kPa"
    least = "at least " if told["at_least"] else ""
    return f"{begin} {seal}; {buckles}; margin {least}{told['margin']:.0%}."


def rising_points(result: StudyResult) -> list[Any]:
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


@dataclass(frozen=True)
class ClassBuckling:
    """Buckling of the wall in one symmetry class."""

    symmetry: str
    #: pressures and lowest: Pa, 1/s2; lowest stiffness eigenvalue along the path.
    pressures: tuple[float, ...]
    lowest: tuple[float, ...]
    buckling: tuple[dict[str, Any], ...]  #: kind, pressure, eigenvalue of the states that buckle, by pressure.

    @property
    def critical_pressure(self) -> float | None:
        """Lowest pressure, Pa, at which the wall buckles in this class."""
        return min((found["pressure"] for found in self.buckling), default=None)

    @property
    def unstable_from(self) -> float | None:
        """Lowest pressure, Pa, of an equilibrium that is unstable to motions of the class."""
        return next((p for p, least in zip(self.pressures, self.lowest) if least <= 0), None)

    @property
    def softest(self) -> int:
        """Number of the state with the lowest eigenvalue."""
        return min(range(len(self.lowest)), key=self.lowest.__getitem__)

    def summary(self) -> dict[str, Any]:
        """Plain numbers for JSON."""
        softest = self.softest
        return {
            "symmetry": self.symmetry,
            "motion": symmetry_named(self.symmetry).words,
            "buckling": list(self.buckling),
            "critical_pressure": self.critical_pressure,
            "softest": {"pressure": self.pressures[softest], "lowest_stiffness_eigenvalue": self.lowest[softest]},
            "path": {"pressure": list(self.pressures), "lowest_eigenvalue": list(self.lowest)},
        }

    @property
    def sentence(self) -> str:
        """Sentence on buckling in the class, or on its least stiffness."""
        motion = f"in class {self.symmetry} ({symmetry_named(self.symmetry).words})"
        if self.buckling:
            return f"Buckling {motion} at {self.critical_pressure / 1e3:.6g} kPa."
        return _unbuckled(motion, self.unstable_from, self.pressures, self.lowest)


def read_classes(record: Record) -> tuple[ClassBuckling, ...]:
    """Classes of a walk; none where they were not asked for."""
    seen = {note["pressure"]: note["lowest"] for note in record.notes(LOWEST)}
    keys = ("kind", "pressure", "eigenvalue")
    buckled = {
        (note["symmetry"], round(note["pressure"], 3)): {key: note[key] for key in keys}
        for note in record.notes(BUCKLED_CLASS)
    }
    found = []
    for name in next(iter(seen.values()), ()):
        pressures = sorted(seen)
        lowest = tuple(seen[p][name] for p in pressures)
        own = sorted((b for (symmetry, _), b in buckled.items() if symmetry == name), key=lambda b: b["pressure"])
        found.append(ClassBuckling(name, tuple(pressures), lowest, tuple(own)))
    return tuple(found)


def sentences(result: StudyResult) -> list[str]:
    """Sentences on the balances, on buckling and on the safety against it."""
    safety = result.safety
    return [
        *_balances(result),
        *_buckling(result),
        *(part.sentence for part in result.classes),
        *([] if safety is None else [safety.sentence]),
        *([answer] if (answer := rated_sentence(result)) else []),
        *result.measured.sentences(),
    ]


def _balances(result: StudyResult) -> list[str]:
    if not result.states:
        return []
    force, energy = (
        max(getattr(state, name) for state in result.states) for name in ("force_balance", "energy_balance")
    )
    return [f"Forces balance to {force:.1g} of their sizes, work and energies to {energy:.1g} of the work."]


def _buckling(result: StudyResult) -> list[str]:
    if result.buckling:
        return [f"Buckling ({b.kind}) at {b.pressure / 1e3:.6g} kPa." for b in result.buckling[:3]]
    softest = result.softest
    if softest is None:
        return []
    unstable = softest.pressure if softest.lowest_eigenvalue <= 0 else None
    pressures, lowest = (
        [getattr(p, name) for p in rising_points(result)] for name in ("pressure", "lowest_eigenvalue")
    )
    return [_unbuckled(OWN, unstable, pressures, lowest)]


def _unbuckled(motion: str, unstable: float | None, pressures: Sequence[float], lowest: Sequence[float]) -> str:
    """Sentence on the least stiffness to motions whose buckling was not located, unstable from a pressure on."""
    if unstable is not None:
        return f"Unstable {motion} at {unstable / 1e3:.6g} kPa; where it buckles was not followed."
    softest = int(np.argmin(lowest))
    return (
        f"No buckling {motion} up to {max(pressures) / 1e3:.4g} kPa; the stiffness is least at "
        f"{pressures[softest] / 1e3:.4g} kPa, {lowest[softest] / lowest[0]:.0%} of that at the start."
    )
