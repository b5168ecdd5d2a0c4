"""Why a verdict on stability can be trusted: two counts of the unstable eigenvalues, and how far the search reached."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...record.table import Column
from .run import FoundModes

_ATTRIBUTES = (
    "agrees",
    "unstable_count",
    "unstable_count_independent",
    "statement",
    "certain",
    "line",
    "counted_up_to",
    "distance",
    "response_error",
    "status",
    "asked",
    "complete_above",
    "band",
    "rejected",
)
#: The independent count as a curve.
CURVE = (
    Column("frequency", "Hz", "Points on the line at which the determinant was evaluated"),
    Column("phase", "rad", "Continuous phase of the determinant against that of a stable structure"),
)


@dataclass(frozen=True, eq=False)
class Certificate:
    """Eigenvalue count by two routes: the list of modes, and the argument principle.

    Attributes
    ----------
    stable : bool or None
        None where the routes do not agree on it.
    agrees : bool
    unstable_count, unstable_count_independent : int
        From the list of modes, and from the winding of the determinant; both eigenvalues of a conjugate pair count.
    statement : str
        The count and its certainty in a sentence.
    certain : bool
        True where the phase of the determinant could be followed everywhere.
    line : float, 1/s
        Growth rate above which eigenvalues are counted: 0 but for undamped structures.
    counted_up_to : float, Hz
        Frequency at which the independent count ends; infinite but for searches in a band.
    distance : float
        Distance of the winding from a whole number.
    response_error : float
        Error of log det made by the reduced basis behind the count; NaN if no basis was used.
    status : str
        "complete" if no mode was missed among those listed.
    asked : int
    complete_above : float, 1/s
    band : float, Hz
        Every eigenvalue above this growth rate and up to this frequency was found.
    rejected : int
        Pairs thrown away because of their residual.
    frequency, phase : (k,) Hz, rad
        Phase of the determinant on the line.
    """

    stable: bool | None
    agrees: bool
    unstable_count: int
    unstable_count_independent: int
    statement: str
    certain: bool
    line: float
    counted_up_to: float
    distance: float
    response_error: float
    status: str
    asked: int
    complete_above: float
    band: float
    rejected: int
    frequency: np.ndarray
    phase: np.ndarray

    @classmethod
    def of(cls, result: FoundModes) -> Certificate:
        certified, spectrum, count = result.certified, result.spectrum, result.certified.count
        error = certified.response_error
        return cls(
            stable=result.stable,
            agrees=certified.agrees,
            unstable_count=certified.unstable_count,
            unstable_count_independent=certified.unstable_count_independent,
            statement=certified.statement,
            certain=count.certain,
            line=float(count.line),
            counted_up_to=float(count.band),
            distance=count.distance,
            response_error=float("nan") if error is None else float(error),
            status=spectrum.status,
            asked=spectrum.asked,
            complete_above=float(spectrum.complete_above),
            band=float(spectrum.band),
            rejected=spectrum.rejected,
            frequency=count.frequencies,
            phase=count.phase,
        )

    def note(self) -> dict[str, Any]:
        """All but the curve, as a note of a record."""
        curve = [column.name for column in CURVE]
        return {name: value for name, value in vars(self).items() if name not in curve}

    @classmethod
    def read(cls, note: dict[str, Any], frequency: np.ndarray, phase: np.ndarray) -> Certificate:
        """From a note of a record and the curve."""
        names = cls.__dataclass_fields__.keys() - {"frequency", "phase"}
        return cls(**{name: note[name] for name in names}, frequency=frequency, phase=phase)

    @classmethod
    def joined(cls, parts: Mapping[str, Certificate]) -> Certificate:
        """Join the certificates of several symmetry classes, given by their names.

        Counts add up, and what holds for all of them holds. The curve is that of the first.
        """
        each = list(parts.values())
        if len(each) == 1:
            return each[0]
        stable = (
            False if any(c.stable is False for c in each) else None if any(c.stable is None for c in each) else True
        )
        incomplete = [c.status for c in each if c.status != "complete"]
        return cls(
            stable=stable,
            agrees=all(c.agrees for c in each),
            unstable_count=sum(c.unstable_count for c in each),
            unstable_count_independent=sum(c.unstable_count_independent for c in each),
            statement=" ".join(f"In {name}: {c.statement[0].lower()}{c.statement[1:]}" for name, c in parts.items()),
            certain=all(c.certain for c in each),
            line=max(c.line for c in each),
            counted_up_to=min(c.counted_up_to for c in each),
            distance=max(c.distance for c in each),
            response_error=max((c.response_error for c in each if c.response_error >= 0), default=float("nan")),
            status=incomplete[0] if incomplete else "complete",
            asked=sum(c.asked for c in each),
            complete_above=max(c.complete_above for c in each),
            band=min(c.band for c in each),
            rejected=sum(c.rejected for c in each),
            frequency=each[0].frequency,
            phase=each[0].phase,
        )

    def summary(self) -> dict[str, Any]:
        """Plain numbers for JSON, without the curve."""
        names = [name for name in _ATTRIBUTES if name not in ("unstable_count", "unstable_count_independent")]
        return {name: getattr(self, name) for name in names}
