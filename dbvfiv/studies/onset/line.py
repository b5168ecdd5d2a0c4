"""Onsets found along a parameter line, and the stretches between them that are known to be stable or unstable."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from ...texts import shortly
from ..stability.dimensions import Variant
from ..stability.samples import WATCHED, Sample
from ..stability.verdict import Verdict

Interval = tuple[float, float]

#: Relative distance from an onset within which values of a scan say nothing of the state.
BESIDE = 1e-7


@dataclass(frozen=True)
class Side:
    """Stability at a parameter value a little beside an onset, by the full model."""

    value: float
    #: growth_rate and frequency: 1/s, Hz; of the crossing mode.
    growth_rate: float
    frequency: float
    leading_growth_rate: float  #: 1/s; of the leading mode.
    #: unstable_count and unstable_count_independent: unstable eigenvalues by the spectrum and by the argument
    #: principle.
    unstable_count: int
    unstable_count_independent: int

    @classmethod
    def of(cls, sample: Sample, near: complex) -> Side:
        """From a sample, with the mode next to an eigenvalue."""
        values = sample.eigenvalues
        mode = complex(values[int(np.argmin(np.abs(values - near)))])
        counts = sample.unstable, sample.counted
        return cls(sample.value, mode.real, mode.imag / (2 * np.pi), float(values[0].real), *counts)

    @property
    def eigenvalue(self) -> complex:
        """Eigenvalue of the crossing mode, 1/s."""
        return complex(self.growth_rate, 2 * np.pi * self.frequency)


@dataclass(frozen=True)
class OnsetPoint:
    """One crossing of the imaginary axis."""

    parameter: str
    value: float
    frequency: float  #: Hz; 0 for a real eigenvalue (divergence).
    growth_rate: float  #: 1/s; left over at the value: how well it is located.
    gains: bool  #: True if the mode becomes unstable as the parameter grows.
    #: True if no other mode is unstable there, so that the state itself changes between stable and unstable.
    edge: bool
    #: below and above: direct eigenvalues on both sides.
    below: Side
    above: Side
    confirmed: bool  #: Both sides agree with the crossing, and both counts agree on each side.
    bracket: tuple[float, float]  #: (2,) tuple of float; neighbouring values of the scan that it lies between.
    ahead: int = 0  #: Modes that grow faster there.
    #: "super", "sub" or "degenerate"; None for a real eigenvalue or where it was not asked for.
    criticality: str | None = None
    #: Scaled for eigenvectors of unit norm in (q, v, U), 1/s; only its sign carries over to other scalings.
    first_lyapunov_coefficient: float | None = None
    crossing_speed: float | None = None  #: Derivative of the growth rate with respect to the parameter.
    uncertainty: float | None = None  #: By Richardson's rule from a second mesh, in units of the parameter.
    coarse_value: float | None = None  #: The onset on the second mesh.
    note: str = ""

    @property
    def key(self) -> tuple[float, float, int]:
        """Key that identifies the crossing among those of the same scan."""
        return (*self.bracket, self.ahead)

    def summary(self) -> dict[str, Any]:
        """Plain SI numbers for JSON; its kind is "Hopf" or "divergence"."""
        own = asdict(self) | {"bracket": list(self.bracket), "note": self.note or None}
        return own | {"kind": "Hopf" if self.frequency > 0 else "divergence"}

    @classmethod
    def read(cls, summary: Mapping[str, Any]) -> OnsetPoint:
        """The point that `summary` gave."""
        given = {field.name: summary[field.name] for field in fields(cls)}
        sides = {name: Side(**summary[name]) for name in ("below", "above")}
        return cls(**given | sides | {"bracket": tuple(summary["bracket"]), "note": summary["note"] or ""})


@shortly
@dataclass(frozen=True)
class FoundOnsets:
    """Onsets along one parameter in one variant, and the scan that found them."""

    variant: Variant  #: Flow model and symmetry class.
    samples: tuple[Sample, ...]  #: In ascending order of the parameter, those of narrow tongues included.
    points: tuple[OnsetPoint, ...]  #: In ascending order of the parameter.
    failures: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    missed: tuple[float, ...] = ()  #: Values at which no state was found.

    @cached_property
    def values(self) -> np.ndarray:
        """(s,) values of the parameter, SI."""
        return np.array([sample.value for sample in self.samples])

    @cached_property
    def _modes(self) -> np.ndarray:
        table = np.full((len(self.samples), WATCHED), complex(np.nan, np.nan))
        for row, sample in zip(table, self.samples):
            kept = sample.eigenvalues[:WATCHED]
            row[: len(kept)] = kept
        return table

    @property
    def growth_rates(self) -> np.ndarray:
        """(s, 4) growth rates of the leading modes, 1/s; NaN where there are fewer."""
        return self._modes.real

    @property
    def frequencies(self) -> np.ndarray:
        """(s, 4) frequencies of the leading modes, Hz."""
        return self._modes.imag / (2 * np.pi)

    @cached_property
    def certified(self) -> np.ndarray:
        """(s,) bool, whether an independent count of the unstable modes agrees; nothing is claimed beside others."""
        return np.array([sample.certified or False for sample in self.samples], bool)

    @property
    def verdicts(self) -> tuple[Verdict, ...]:
        """Verdicts on the values of the scan."""
        return tuple(sample.verdict for sample in self.samples)

    @cached_property
    def _states(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[float]]:
        """Values, whether the state is unstable there and whether that is sure, and the edges between such states."""
        found = [
            (s.value, s.verdict.stable is False, s.certified and s.verdict.stable is not None) for s in self.samples
        ]
        rows = sorted([*found, *((value, False, False) for value in self.missed)])
        edges = [point.value for point in self.points if point.edge]
        values, grows, sure = np.array(rows, float).reshape(-1, 3).T
        return values, grows > 0, sure > 0, edges

    @property
    def unstable_intervals(self) -> list[Interval]:
        """Intervals of the scanned range in which the state is known to be unstable."""
        return intervals_of(*self._states, True)

    @property
    def stable_intervals(self) -> list[Interval]:
        """Intervals of the scanned range in which the state is known to be stable."""
        return intervals_of(*self._states, False)

    @property
    def uncertain_intervals(self) -> list[Interval]:
        """Intervals of the scanned range in which neither stability nor instability is claimed."""
        return intervals_of(*self._states, None)

    def scan(self) -> dict[str, Any]:
        """Plain numbers of the scan for JSON."""
        return {
            "values": self.values.tolist(),
            "growth_rate": self.growth_rates[:, 0].tolist(),
            "frequency": self.frequencies[:, 0].tolist(),
            "certified": self.certified.tolist(),
            "verdict": [verdict.summary() for verdict in self.verdicts],
        }

    def summary(self) -> dict[str, Any]:
        """Plain numbers of a variant besides that of the case, for JSON."""
        motion, own = self.variant.motion, {"continuity": self.variant.continuity}
        named = {} if motion.of_equilibria else {"symmetry": motion.name}
        if named:
            own = named | {"motion": motion.words}
        return own | {
            "uncertain": [list(part) for part in self.uncertain_intervals],
            "points": [point.summary() | named for point in self.points],
            "scan": self.scan(),
            "stable": [list(stretch) for stretch in self.stable_intervals],
            "unstable": [list(stretch) for stretch in self.unstable_intervals],
            "failures": list(self.failures),
            "warnings": list(self.warnings),
        }


def intervals_of(
    values: np.ndarray, grows: np.ndarray, sure: np.ndarray, edges: Iterable[float], unstable: bool | None
) -> list[Interval]:
    """Intervals in which a state is known to be unstable, or stable, or in which neither is claimed.

    Parameters
    ----------
    values : (s,) array
        Values of the scan, ascending.
    grows : (s,) bool array
        True where the state is unstable.
    sure : (s,) bool array
        Nothing is claimed beside a value that is not.
    edges : iterable of float
        Onsets at which the state changes between stable and unstable. Nothing is claimed between two values whose
        states these do not make of each other, as where the state jumps.
    unstable : bool or None
        True for the unstable intervals, False for the stable ones, None for those without a claim.
    """
    edges, found = sorted(edges), []
    # right at an onset the sign of the growth rate is that of rounding
    away = [all(abs(v - e) > BESIDE * abs(e) for e in edges) or v in (values[0], values[-1]) for v in values]
    rows = zip(*(np.asarray(part)[np.array(away, bool)].tolist() for part in (values, grows, sure)))
    for (a, state, first), (b, other, second) in pairwise(rows):
        between = [e for e in edges if a < e < b]
        known = first and second and (state != other) == (len(between) % 2 == 1)
        if not known and unstable is None:
            found.append((a, b))
        elif known and unstable is not None:  # the state changes at each edge
            found += list(pairwise([a, *between, b]))[int(state != unstable) :: 2]
    return joined_stretches([found])


def joined_stretches(parts: Sequence[Sequence[Interval]]) -> list[Interval]:
    """Stretches that lie in any of some lists, those that touch joined."""
    found: list[Interval] = []
    for low, high in sorted(tuple(stretch) for part in parts for stretch in part):
        if found and low <= found[-1][1]:
            found[-1] = (found[-1][0], max(found[-1][1], high))
        else:
            found.append((low, high))
    return found
