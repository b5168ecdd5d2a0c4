"""Measured numbers over the pressure, or over pressure and place, beside computed ones."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

#: How near, of the pressure, a state must be to be that of a measured point.
_SAME = 1e-9


class MeasuredParts:
    """Measurements beside a result: a dataclass of measured curves, taps and sections, None for what was not measured.

    Attributes
    ----------
    keys : dict of str
        Keys of the JSON document by the names of these attributes.
    """

    keys: ClassVar[dict[str, str]]

    def __iter__(self) -> Iterator[Any]:
        return (part for name in self.keys if (part := getattr(self, name)) is not None)

    def sentences(self) -> list[str]:
        """Sentences that compare each measured quantity with the computed one."""
        return [part.sentence() for part in self]

    def summary(self) -> dict[str, Any]:
        """Plain SI numbers for JSON; empty lists of what was not measured."""
        parts = {key: getattr(self, name) for name, key in self.keys.items()}
        return {key: [] if part is None else part.summary() for key, part in parts.items()}


@dataclass(frozen=True)
class MeasuredCurve:
    """Points of a measured curve, and what was computed there.

    Attributes
    ----------
    what : str
        For people, "flow" or "lip area".
    column : str
        Its name in the states and in JSON.
    pressure, measured : (k,) arrays, Pa, SI
        The pressure as the case has it.
    computed : (k,) array
        Between the states; NaN beyond them.
    unit : (str, float)
        In which people are told what was measured, and the factor from SI.
    """

    what: str
    column: str
    pressure: np.ndarray
    measured: np.ndarray
    computed: np.ndarray
    unit: tuple[str, float] = ("kg/s", 1.0)

    @property
    def excess(self) -> np.ndarray:
        """Computed less measured; NaN where there is nothing to compare."""
        return self.computed - self.measured

    @property
    def difference(self) -> np.ndarray:
        """Computed over measured less 1; NaN where there is nothing to compare."""
        return self.computed / np.where(self.measured > 0, self.measured, np.nan) - 1.0

    @property
    def off(self) -> tuple[str, dict[str, float]]:
        """Deviations for a table of several runs: its title, and the deviation, %, at each measured point."""
        unit, factor = self.unit
        points = enumerate(zip(self.pressure, factor * self.measured), 1)
        names = [f"{number}: {p / 1e3:.6g} kPa, {value:.5g} {unit}" for number, (p, value) in points]
        return f"Computed over measured {self.what}, %", dict(zip(names, 100 * self.difference))

    def summary(self) -> list[dict[str, Any]]:
        """Plain SI numbers, None where there is nothing to compare."""
        rows = zip(self.pressure, self.measured, self.computed, self.difference)
        names = ("pressure", self.column, f"computed_{self.column}", "difference")
        return plain_rows(names, rows)

    def sentence(self) -> str:
        """Sentence on the deviation of the computed from the measured points."""
        known = self.difference[np.isfinite(self.difference)]
        begin = f"Measured: {len(self.pressure)} point{'s' * (len(self.pressure) > 1)} of {self.what}"
        if not len(known):
            return f"{begin}, none within the pressures computed."
        spread = _spread(100 * known.min(), 100 * known.max())
        return (
            f"{begin}; computed {self.what} over measured {spread} % at the {len(known)} within the pressures computed."
        )


@dataclass(frozen=True)
class MeasuredTaps:
    """Static pressures measured along the axis, and those computed there.

    Attributes
    ----------
    pressure : (k,) array, Pa
        As drive.pressure has it.
    z : (k,) array, m
        From the lip, where the valve is at rest.
    measured, computed : (k,) arrays, Pa
        Over that of the surroundings; NaN where there is no state of that pressure, and beyond the valve.
    without : str
        What to add about pressures that were not computed.
    """

    pressure: np.ndarray
    z: np.ndarray
    measured: np.ndarray
    computed: np.ndarray
    without: str = ""

    @property
    def excess(self) -> np.ndarray:
        """Computed less measured, Pa; NaN where there is nothing to compare."""
        return self.computed - self.measured

    @property
    def share(self) -> np.ndarray:
        """Computed less measured pressure over the pressure that drives the flow; NaN where that is not positive."""
        return self.excess / np.where(self.pressure > 0, self.pressure, np.nan)

    @property
    def off(self) -> tuple[str, dict[str, float]]:
        """Deviations for a table of several runs: its title, and the deviation, kPa, at each measured point."""
        places = enumerate(zip(self.pressure / 1e3, 1e3 * self.z, self.measured / 1e3), 1)
        names = [f"{number}: {p:.6g} kPa, z = {z:.4g} mm, {tap:.5g} kPa" for number, (p, z, tap) in places]
        return "Pressure along the axis, computed less measured, kPa", dict(zip(names, self.excess / 1e3))

    def summary(self) -> list[dict[str, Any]]:
        """Plain SI numbers, None where there is nothing to compare."""
        rows = zip(self.pressure, self.z, self.measured, self.computed, self.excess)
        return plain_rows(("pressure", "z", "tap", "computed_tap", "difference"), rows)

    def sentence(self) -> str:
        """Sentence on the deviation of the computed from the measured pressures along the axis."""
        known = np.isfinite(self.share)
        begin = f"Measured: {len(self.z)} pressure{'s' * (len(self.z) > 1)} along the axis"
        if not known.any():
            return f"{begin}, none at a pressure computed and within the valve{self.without}."
        kilopascals, shares = self.excess[known] / 1e3, 100 * self.share[known]
        return (
            f"{begin}; computed less measured {_spread(kilopascals.min(), kilopascals.max())} kPa, "
            f"{_spread(shares.min(), shares.max())} % of the pressure that drives the flow, at the {known.sum()} at "
            f"pressures computed and within the valve{self.without}."
        )


def state_at(states: Sequence[Any], pressure: float) -> Any:
    """The state of a pressure, Pa; None if there is none."""
    return next((state for state in states if abs(state.pressure - pressure) <= _SAME * pressure), None)


def lacking(states: Sequence[Any], pressures: Sequence[float]) -> str:
    """A clause on the pressures, Pa, of which there is no state; empty if there are all."""
    missing = sorted({pressure for pressure in pressures if state_at(states, pressure) is None})
    told = ", ".join(f"{pressure / 1e3:.6g}" for pressure in missing[:5]) + (", ..." if len(missing) > 5 else "")
    return f"; states at {told} kPa would have to be computed for the others" if missing else ""


def plain_rows(names: tuple[str, ...], rows: Any) -> list[dict[str, Any]]:
    """Rows for JSON: words as they are, None for what is not finite."""
    return [{name: _plain(value) for name, value in zip(names, row)} for row in rows]


def _plain(value: Any) -> Any:
    if value is None or isinstance(value, str):
        return value
    return float(value) if np.isfinite(value) else None


def _spread(low: float, high: float) -> str:
    texts = f"{low:+.3g}", f"{high:+.3g}"
    return texts[0] if texts[0] == texts[1] else " to ".join(texts)
