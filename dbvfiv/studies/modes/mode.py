"""Modes of a result and certificate of their eigenvalue count, as a file holds them under one continuity law or two."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...model.symmetry import EQUILIBRIA, symmetry_named
from ...record.table import Column
from ..stability.verdict import Verdict
from ..state import State
from .run import FoundModes

#: One row for each mode in a result file.
MODE = (
    Column("growth_rate", "1/s", "Real part of the eigenvalue"),
    Column("angular_frequency", "rad/s", "Imaginary part of the eigenvalue, not negative"),
    Column("residual", "", "Relative residual of the full pencil"),
    Column("backward_error", "", "The same against matrix norms"),
    Column(
        "shape",
        "1, rad/m",
        "Displacements and rotations of the nodes, the largest displacement being 1 and real",
        "c16",
    ),
    Column(
        "area",
        "m",
        "Change of the flow area of the computed part at each row, m2 for 1 m of largest displacement",
        "c16",
    ),
    Column("pressure", "Pa/m", "Change of the pressure at each row for 1 m of largest displacement", "c16"),
    Column("inlet_velocity", "1/s", "Change of the inlet velocity for 1 m of largest displacement", "c16"),
)
#: Largest displacement at which shapes are drawn, as a fraction of the valve's length, and as one of the opening that
#: must not close.
_DRAWN, _OPEN = 0.035, 0.85


@dataclass(frozen=True, eq=False)
class ModeShape:
    """A mode; a conjugate pair is one mode, with frequency >= 0.

    Motion: Re(shape exp(eigenvalue t)), of undetermined amplitude.

    Attributes
    ----------
    number : int
        From 1, by falling growth rate.
    growth_rate : float, 1/s
    angular_frequency : float, rad/s
    residual, backward_error : float
        See `eigen.Spectrum`.
    shape : (nn, c) complex
        Displacements and rotations of the nodes, c = 5; the largest displacement is 1 and
        real.
    area : (m,) complex, m2 per m
    pressure : (m,) complex, Pa per m
        NaN in vacuo.
    inlet_velocity : complex, m/s per m
    symmetry : str
        Class of motion, see `dbvfiv.model.symmetry`.
    """

    number: int
    growth_rate: float
    angular_frequency: float
    residual: float
    backward_error: float
    shape: np.ndarray = field(repr=False)
    area: np.ndarray = field(repr=False)
    pressure: np.ndarray = field(repr=False)
    inlet_velocity: complex = field(repr=False)
    symmetry: str = EQUILIBRIA

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.number}: growth {self.growth_rate:+.5g} 1/s at {self.frequency:.5g} Hz>"

    @property
    def eigenvalue(self) -> complex:
        """1/s."""
        return complex(self.growth_rate, self.angular_frequency)

    @property
    def frequency(self) -> float:
        """Hz."""
        return self.angular_frequency / (2 * np.pi)

    @property
    def damping_ratio(self) -> float:
        """-growth rate over |eigenvalue|; 1 or -1 where nothing oscillates."""
        size = abs(self.eigenvalue)
        return -self.growth_rate / size if size > 0 else 0.0

    @property
    def amplitude(self) -> np.ndarray:
        """(nn,) largest displacement of each node over a cycle, 1 at most."""
        u = self.shape[:, :3]
        square, turning = np.sum(np.abs(u) ** 2, axis=1), np.sum(u**2, axis=1)
        return np.sqrt(0.5 * (square + np.abs(turning)))

    def at_phase(self, phase: float) -> np.ndarray:
        """(nn, c) displacements and rotations at a phase of the cycle, rad; growth or decay left out."""
        return (self.shape * np.exp(1j * phase)).real

    def drawn_amplitude(self, state: State) -> float:
        """Largest displacement, m, at which the mode shows well and the centre line of the duckbill stays open."""
        mesh = state.results.mesh
        largest = _DRAWN * float(np.ptp(mesh.z))
        if not symmetry_named(self.symmetry).moves_lips_apart:
            return largest
        line = mesh.centre_line
        height = mesh.nodes[line, 1] + state.nodal[line, 1]
        swing = np.abs(self.shape[line, 1])
        moving = swing > 1e-3
        room = float(np.min(_OPEN * height[moving] / swing[moving])) if moving.any() else np.inf
        return min(largest, room) if room > 0.05 * largest else 0.2 * largest

    def summary(self) -> dict[str, Any]:
        """Plain SI numbers for JSON."""
        return {
            "growth_rate": self.growth_rate,
            "frequency": self.frequency,
            "damping_ratio": self.damping_ratio,
            "residual": self.residual,
            "symmetry": self.symmetry,
        }


def rows_of(result: FoundModes) -> list[dict[str, Any]]:
    """Columns of the modes of a run."""
    spectrum = result.spectrum
    stations = result.areas.shape[1:]
    rows = []
    for i, value in enumerate(spectrum.eigenvalues):
        pressure = result.pressures[i] if result.pressures.shape[1:] == stations else np.full(stations, np.nan, complex)
        rows.append(
            {
                "growth_rate": float(value.real),
                "angular_frequency": float(value.imag),
                "residual": float(spectrum.residual[i]),
                "backward_error": float(spectrum.backward_error[i]),
                "shape": result.shapes[i],
                "area": result.areas[i],
                "pressure": pressure,
                "inlet_velocity": complex(result.inlet_velocities[i]),
            }
        )
    return rows


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


_NUMBERS = ("growth_rate", "angular_frequency", "residual")


@dataclass(frozen=True, eq=False)
class OtherLaw:
    """Modes and verdict under the other continuity law.

    Attributes
    ----------
    continuity : str
    modes : tuple of dict
        growth_rate, frequency, damping_ratio, residual, by falling growth rate.
    certificate : Certificate
        Without its curve.
    verdict : Verdict
    outside : str
        Fluid outside the wall, in words.
    """

    continuity: str
    modes: tuple[dict[str, Any], ...]
    certificate: Certificate
    verdict: Verdict
    outside: str = ""

    @property
    def stable(self) -> bool | None:
        return self.verdict.stable

    @property
    def sentence(self) -> str:
        """The verdict in a sentence, which names the law."""
        return self.verdict.sentence(f"under {self.continuity} continuity {self.outside}".rstrip())

    def summary(self) -> dict[str, Any]:
        """Keys as those of the case's own law."""
        return {
            "continuity": self.continuity,
            "modes": list(self.modes),
            "unstable_count": self.certificate.unstable_count,
            "unstable_count_independent": self.certificate.unstable_count_independent,
            "stable": self.stable,
            "verdict": self.verdict.summary(),
            "certificate": self.certificate.summary(),
        }


def law_note(found: FoundModes, continuity: str) -> dict[str, Any]:
    """Note that a record keeps of the modes under the other continuity law."""
    modes = [{name: row[name] for name in _NUMBERS} for row in rows_of(found)]
    certificate = Certificate.of(found).note()
    return {"continuity": continuity, "modes": modes, "certificate": certificate, "verdict": found.verdict.summary()}


def read_law(note: dict[str, Any], outside: str = "") -> OtherLaw:
    """From a note of a record; `outside` says in words what is outside the wall."""
    nothing = np.zeros(0)
    shapeless = {"backward_error": np.nan, "shape": nothing, "area": nothing, "pressure": nothing, "inlet_velocity": 0j}
    modes = (ModeShape(number=i + 1, **row, **shapeless).summary() for i, row in enumerate(note["modes"]))
    certificate = Certificate.read(note["certificate"], nothing, nothing)
    return OtherLaw(note["continuity"], tuple(modes), certificate, Verdict.read(note["verdict"]), outside)


def side_by_side(own: str, modes: Sequence[dict[str, Any]], other: OtherLaw) -> list[str]:
    """Table of the modes under both laws, each by falling growth rate."""
    lines = [
        f"{'':6}{own:>40}{other.continuity:>40}",
        f"{'mode':>6}" + 2 * f"{'1/s':>14}{'Hz':>13}{'damping':>13}",
    ]
    for i in range(max(len(modes), len(other.modes))):
        lines.append(
            f"{i + 1:6d}" + "".join(_cells(found[i] if i < len(found) else None) for found in (modes, other.modes))
        )
    return lines


def _cells(mode: dict[str, Any] | None) -> str:
    if mode is None:
        return " " * 40
    return f"{mode['growth_rate']:14.4f}{mode['frequency']:13.4f}{mode['damping_ratio']:13.4f}"
