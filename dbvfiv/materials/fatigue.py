"""Growth of a small crack in rubber under repeated loads: the energy behind it, its law, the cycles of a history.

A crack of length c in the material plane of normal N has the energy release rate (Mars, Rubber Chem. Technol. 75, 2002)

    T = 2 pi c W,    W = int (sigma n) . (D n) dt

with n the normal in space, sigma the Cauchy stress and D the stretching. W is the cracking energy density: in tension
across the plane the strain energy, in simple shear and in equibiaxial tension half of it. Where the plane is pressed
shut, n . sigma n < 0, the crack slides and does not open: the part (n . sigma n)(n . D n) is left out. The integral
runs along the straight path of logarithmic strain from the unstrained sheet, on which D stays the same and has the axes
of sigma; so W belongs to the state, as the energy release rate of an elastic body does. With h_i = ln l_i, s = 0 to 1,

    W = int sum_i sigma_i h_i n_i^2 ds,    n_i^2 = l_i^(-2 s) N_i^2 / sum_j l_j^(-2 s) N_j^2

A cycle between T_min = R T_max and T_max lets the crack grow by (Lake and Lindley 1964, Lindley 1974; Mars and Fatemi
2003 for rubbers that crystallise, k > 0)

    dc/dN = B min{ [(T_max - T_min)/T_1]^F,  (T_max/T_1)^F (T_max/T_c)^(F (e^(k R) - 1)) },    0 where T_max < T_0

with T_1 = 1 kJ/m2 and T_c = 10 kJ/m2. The blocks of cycles from c_0 to c are the integral of 1 over dc/dN, summed over
the cycles of a block and taken as a power of c between nearby lengths: exact where one F governs,

    N = c_0/((F - 1) dc/dN(c_0)) [1 - (c_0/c)^(F - 1)]
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numba
import numpy as np

from dbvfiv.materials.shipped import read_toml

#: Energy release rates, J/m2, at which the rate B is given, and at which the minimum load does not count.
UNIT, CRITICAL = 1e3, 10e3
#: Energy release rate over crack length and cracking energy density at small strains.
SHAPE = 2.0 * np.pi
#: Pieces of the way from the precursor to the crack, even in its logarithm.
PANELS = 40
#: Rubbers whose constants are shipped.
RUBBERS = ("NR", "SBR", "CR", "EPDM")
#: Constants whose spread is normal; that of the others is log-normal.
_NORMAL = ("exponent", "crystallisation")
#: Standard deviations between the ends of the middle 80 %.
_WIDTH = 2.5631


@dataclass(frozen=True)
class CrackGrowth:
    """Constants of a rubber: numbers, or arrays (n, 1) of samples."""

    rate: Any  #: m/cycle at T = 1 kJ/m2.
    exponent: Any
    threshold: Any  #: J/m2.
    crystallisation: Any  #: 0 of a rubber that does not crystallise.
    precursor: Any  #: m.

    @classmethod
    def middle(cls, spread: Mapping[str, Sequence[float]]) -> CrackGrowth:
        """Middles of spreads, see `draw`."""
        return cls(**{f.name: _middle(f.name, spread[f.name])[0] for f in fields(cls)})

    @classmethod
    def draw(cls, spread: Mapping[str, Sequence[float]], count: int = 2000) -> CrackGrowth:
        """Samples, always the same: a pair is the middle 80 % of a log-normal distribution, of exponent and
        crystallisation of a normal one; a single number has no spread.
        """
        generator, found = np.random.default_rng(1), {}
        for name in (f.name for f in fields(cls)):
            middle, width = _middle(name, spread[name])
            normal = width * generator.standard_normal((count, 1))
            found[name] = np.maximum(middle + normal, 0.0) if name in _NORMAL else middle * np.exp(normal)
        return cls(**found)

    def speed(self, largest: np.ndarray, least: np.ndarray) -> np.ndarray:
        """Growth dc/dN, m, by cycles between two energy release rates, J/m2."""
        with np.errstate(divide="ignore", invalid="ignore"):
            share = np.where(largest > 0, least / largest, 1.0)
            by_range = ((largest - least) / UNIT) ** self.exponent
            held = self.exponent * np.expm1(self.crystallisation * share)
            by_largest = (largest / UNIT) ** self.exponent * (largest / CRITICAL) ** held
        grows = (largest >= self.threshold) & (largest > least)
        return np.where(grows, self.rate * np.minimum(by_range, by_largest), 0.0)

    def blocks(self, cycles: np.ndarray, crack: float) -> np.ndarray:
        """Blocks of cycles until the precursor is a crack of a length, m.

        Parameters
        ----------
        cycles : (..., k, 2) array, J/m3
            Largest and least cracking energy density of each cycle of a block; (k, 2) for samples.
        crack : float, m

        Returns
        -------
        (...) array, (n,) of samples
            Infinite where nothing grows.
        """
        step = np.log(crack / self.precursor) / PANELS
        total, before, start = 0.0, np.nan, np.nan
        for panel in range(PANELS + 1):
            length = self.precursor * np.exp(panel * step)
            release = SHAPE * length
            speed = self.speed(release * cycles[..., 0], release * cycles[..., 1]).sum(axis=-1)
            length, width = (x[:, 0] if np.ndim(x) else x for x in (length, step))
            if panel:
                with np.errstate(divide="ignore", invalid="ignore"):
                    power = np.log(speed / before) - width  # of (dc/dN)/c from end to end
                    mean = np.where(np.abs(power) > 1e-9, -np.expm1(-power) / power, 1.0)
                    total = total + np.where(before > 0, start / before * width * mean, np.inf)
            before, start = speed, length
        return total


def _middle(name: str, pair: Sequence[float]) -> tuple[float, float]:
    """Middle of a spread and its standard deviation, of the logarithm where the distribution is log-normal."""
    low, high = pair[0], pair[-1]
    if name in _NORMAL:
        return 0.5 * (low + high), (high - low) / _WIDTH
    return float(np.sqrt(low * high)), float(np.log(high / low)) / _WIDTH


def shipped_growth(rubber: str) -> dict[str, Any]:
    """Spreads of the constants of one of `RUBBERS`, with a note; see crack_growth.toml for their sources."""
    return read_toml("crack_growth")[rubber]


def count_cycles(histories: np.ndarray) -> np.ndarray:
    """Cycles of histories (m, t) that repeat, by rainflow counting: (m, k, 2), largest and least value of each.

    Counted from the largest value on, so that every range closes (ASTM E1049, simplified counting for repeating
    histories); rows with fewer cycles than others end in zeros.
    """
    found = np.zeros((len(histories), histories.shape[1] // 2 + 1, 2))
    most = _count(np.ascontiguousarray(histories, float), found)
    return found[:, : max(most, 1)]


@numba.njit(cache=True)
def _count(histories, found):
    most, length = 0, histories.shape[1]
    stack = np.empty(length + 1)
    for row in range(len(histories)):
        start, top, count = np.argmax(histories[row]), 0, 0
        for i in range(length + 1):
            value = histories[row, (start + i) % length]
            if top >= 2 and (stack[top - 1] - stack[top - 2]) * (value - stack[top - 1]) >= 0:
                top -= 1  # not a reversal
            stack[top] = value
            top += 1
            while top >= 3 and abs(stack[top - 1] - stack[top - 2]) >= abs(stack[top - 2] - stack[top - 3]):
                a, b = stack[top - 3], stack[top - 2]
                if a != b:
                    found[row, count, 0], found[row, count, 1] = max(a, b), min(a, b)
                    count += 1
                stack[top - 3] = stack[top - 1]
                top -= 2
        most = max(most, count)
    return most


def plane_normals() -> np.ndarray:
    """(k, 3) normals of planes on which cracks are looked for: upright in the sheet every 10 degrees, and at 45
    degrees to it every 30 degrees.
    """
    upright, tilted = np.radians(np.arange(0.0, 180.0, 10.0)), np.radians(np.arange(0.0, 360.0, 30.0))
    low = np.stack([np.cos(tilted), np.sin(tilted), np.ones_like(tilted)], axis=1) / np.sqrt(2.0)
    return np.concatenate([np.stack([np.cos(upright), np.sin(upright), 0 * upright], axis=1), low])


#: Gauss points along the way from the unstrained sheet, and their weights.
_SHARES, _WEIGHTS = (0.5 * x for x in (np.polynomial.legendre.leggauss(6) + np.array([[1.0], [0.0]])))


def cracking_energy(strain: np.ndarray, stress: Callable[[np.ndarray], np.ndarray], normals: np.ndarray) -> np.ndarray:
    """Cracking energy density W on planes of an isotropic, incompressible sheet with S33 = 0.

    Parameters
    ----------
    strain : (m, 5) array
        Green-Lagrange strains [E11, E22, 2 E12, 2 E13, 2 E23].
    stress : callable
        Second Piola-Kirchhoff stresses [S11, S22, S12, S13, S23], Pa, of such strains.
    normals : (k, 3) array, or (m, k, 3) for planes of each point

    Returns
    -------
    (m, k) array, J/m3
    """
    e11, e22, g12, g13, g23 = strain.T
    c11, c22 = 1.0 + 2.0 * e11, 1.0 + 2.0 * e22
    c33 = (1.0 + c22 * g13**2 - 2.0 * g12 * g13 * g23 + c11 * g23**2) / (c11 * c22 - g12**2)
    c = np.stack([c11, g12, g13, g12, c22, g23, g13, g23, c33], axis=1).reshape(-1, 3, 3)
    squares, axes = np.linalg.eigh(c)
    log, found = 0.5 * np.log(squares), 0.0
    parts = np.einsum("mai,mka->mki", axes, np.broadcast_to(normals, (len(c), *normals.shape[-2:]))) ** 2
    stretches = np.exp(2.0 * _SHARES[:, None, None] * log)
    on_way = np.einsum("mai,gmi,mbi->abgm", axes, stretches, axes)
    e = np.stack([0.5 * (on_way[0, 0] - 1), 0.5 * (on_way[1, 1] - 1), on_way[0, 1], on_way[0, 2], on_way[1, 2]], -1)
    s11, s22, s12, s13, s23 = stress(e.reshape(-1, 5)).T
    s = np.stack([s11, s12, s13, s12, s22, s23, s13, s23, 0.0 * s11], axis=1).reshape(*e.shape[:2], 3, 3)
    principals = stretches * np.einsum("mai,gmab,mbi->gmi", axes, s, axes, optimize=True)
    for weight, stretch, principal in zip(_WEIGHTS, stretches, principals):
        normal = parts / stretch[:, None]
        normal /= normal.sum(axis=-1, keepdims=True)
        pull, opening = normal @ principal[..., None], normal @ log[..., None]
        work = normal @ (principal * log)[..., None] - np.minimum(pull, 0.0) * opening
        found = found + weight * work[..., 0]
    return np.maximum(found, 0.0)
