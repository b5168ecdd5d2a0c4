"""Cycles of a test: first loading against stabilised cycles (Mullins), and what a loop loses.

A rubber that was stretched before is softer up to the strain it has seen (Mullins 1969, Rubber Chem. Technol. 42, 339);
after a few cycles to the same strain the curve repeats. A valve works on that stabilised curve: the thesis fits the
fifth loading (Th. 3.2.1). What the cycles leave as permanent set is taken off: strains count from the length at which
the cycle carries no stress, stresses from the area there.

The loss factor of a loop is that of the linear material with the same loop area A, strain amplitude e0 and stress
between the ends of strain: tan delta = A / (pi E' e0^2), E' = (stress at the largest strain less that at the least)
/ (2 e0).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dbvfiv.materials.checks import MaterialError
from dbvfiv.materials.rubber_forms import MODES
from dbvfiv.materials.tension_test import Curve, TensionTest, read_curves

CYCLES = ("first", "last")
#: Share of the range of strain that a way back must cover for a loop.
_CLOSED = 0.9
_FEWEST = 3
#: Work over stiffness and amplitude squared that is rounding alone.
_NOISE = 1e-9


@dataclass(frozen=True)
class CycleReport:
    """One cycle of a test.

    Attributes
    ----------
    mode : str
    cycle : int
    peak_strain : float
        Largest engineering strain.
    peak_stress : float
        Nominal stress there, Pa.
    set_strain : float
        Strain at which its loading begins to carry stress; 0 where it does so from the first row.
    lost : float
        Work lost in the loop over the volume, J/m3; NaN without a way back.
    loss_factor : float
        tan delta; NaN without a way back.
    """

    mode: str
    cycle: int
    peak_strain: float
    peak_stress: float
    set_strain: float
    lost: float
    loss_factor: float


def read_tests(path: str | Path, planar: str | Path | None = None, biaxial: str | Path | None = None) -> list[Curve]:
    """Tests of one rubber from one file or several; see `tension_test.read_curves`.

    Raises
    ------
    MaterialError
        Also if two files hold the same kind of test.
    """
    curves = read_curves(path)
    for name, mode in ((planar, "planar"), (biaxial, "biaxial")):
        if name is not None:
            if any(curve.test.mode == mode for curve in curves):
                raise MaterialError(
                    f"Tension test {path} holds a {mode} test already, so {name} cannot be a second one."
                )
            curves += read_curves(name, mode)
    return curves


def loading_tests(curves: list[Curve], cycle: str = "last") -> tuple[TensionTest, ...]:
    """The loading branch of one cycle of each test; curves without cycles as they are.

    Parameters
    ----------
    curves : list of Curve
        Of `tension_test.read_curves`.
    cycle : {"first", "last"}

    Raises
    ------
    MaterialError
        For another word, or a loading branch without rows.
    """
    if cycle not in CYCLES:
        raise MaterialError(f"The cycle must be one of {', '.join(CYCLES)}, but {cycle!r} was given.")
    tests = []
    for mode in MODES:
        found = sorted((c for c in curves if c.test.mode == mode), key=lambda c: c.cycle or 0)
        if found:
            tests.append(_loading(found[0 if cycle == "first" else -1]))
    return tuple(tests)


def describe_cycles(curves: list[Curve]) -> list[CycleReport]:
    """Every cycle that a table tells apart."""
    return [_described(curve) for curve in curves if curve.cycle is not None]


def hysteresis_loss(strain, stress) -> tuple[float, float]:
    """Work lost in a loop over the volume, J/m3, and its loss factor.

    Parameters
    ----------
    strain, stress : array_like, shape (n,)
        Engineering strain and nominal stress in the order of time; the loop is closed by a straight line.

    Raises
    ------
    MaterialError
        For a loop without range, without stiffness, or run through the wrong way about.
    """
    strain, stress = np.asarray(strain, float), np.asarray(stress, float)
    middle = strain - strain.mean()
    lost = float(0.5 * np.sum((stress + np.roll(stress, -1)) * (np.roll(middle, -1) - middle)))
    amplitude = 0.5 * float(np.ptp(strain))
    if amplitude <= 0.0:
        raise MaterialError("A loop needs strains that differ.")
    top, bottom = (float(stress[strain == end].mean()) for end in (strain.max(), strain.min()))
    stiffness = (top - bottom) / (2.0 * amplitude)
    if stiffness <= 0.0:
        raise MaterialError("The stress of a loop must be greater at its largest strain than at its least one.")
    if lost < -_NOISE * stiffness * amplitude**2:
        raise MaterialError("The loop gives energy away: its way back lies above its loading; are the rows in order?")
    lost = max(lost, 0.0)
    return lost, lost / (np.pi * stiffness * amplitude**2)


def _loading(curve: Curve) -> TensionTest:
    """Up to the largest strain, counted from the permanent set."""
    if curve.cycle is None:
        return curve.test
    last = int(np.argmax(curve.test.strain))
    strain, stress = curve.test.strain[: last + 1], curve.test.stress[: last + 1]
    residual, kept = _set_of(strain, stress)
    if np.count_nonzero(kept) < _FEWEST:
        raise MaterialError(
            f"Cycle {curve.cycle} of the {curve.test.mode} test has {np.count_nonzero(kept)} rows of loading under "
            f"stress; at least {_FEWEST} are needed."
        )
    return TensionTest((1 + strain[kept]) / (1 + residual) - 1, stress[kept] * (1 + residual), curve.test.mode)


def _set_of(strain: np.ndarray, stress: np.ndarray) -> tuple[float, np.ndarray]:
    """Strain at which a loading branch begins to carry stress, and which of its rows lie beyond."""
    slack = np.flatnonzero(stress <= 0.0)
    if not slack.size:
        return 0.0, np.ones(stress.size, bool)
    i = int(slack[-1])
    beyond = np.arange(stress.size) > i
    if i + 1 == stress.size:
        return float(strain[i]), beyond
    if stress[i] < 0.0 or i + 2 >= stress.size:
        share = -stress[i] / (stress[i + 1] - stress[i])
        return float(strain[i] + share * (strain[i + 1] - strain[i])), beyond
    # slack: the first rows that carry stress say where it begins
    slope = (stress[i + 2] - stress[i + 1]) / (strain[i + 2] - strain[i + 1] or np.inf)
    begins = strain[i + 1] - stress[i + 1] / slope if slope > 0.0 else strain[i]
    return float(np.clip(begins, strain[i], strain[i + 1])), beyond


def _described(curve: Curve) -> CycleReport:
    strain, stress = curve.test.strain, curve.test.stress
    top = int(np.argmax(strain))
    back = strain[top] - strain[top:].min()
    closed = strain.size - top > _FEWEST and back >= _CLOSED * np.ptp(strain) > 0.0
    try:
        lost, factor = hysteresis_loss(strain, stress) if closed else (float("nan"), float("nan"))
    except MaterialError as error:
        raise MaterialError(f"Cycle {curve.cycle} of the {curve.test.mode} test: {error}") from None
    residual = _set_of(strain[: top + 1], stress[: top + 1])[0]
    return CycleReport(curve.test.mode, curve.cycle, float(strain[top]), float(stress[top]), residual, lost, factor)
