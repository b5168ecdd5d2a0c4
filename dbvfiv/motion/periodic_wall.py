"""Matrices of the wall at samples of a periodic motion: how its forces change with positions, rates, accelerations.

Those of the structure and of its inertia are dear and change with the shape alone, whose higher harmonics are small.
They are taken at fewer phases than there are samples and interpolated by a trigonometric polynomial; what pressure
makes is taken at each sample.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numba
import numpy as np

from continuation.blocks import BlockRows, SparseBlocks
from continuation.harmonics import Harmonics
from continuation.periodic import PeriodicMotion, Term

from ..model import ValveModel
from ..shell import Shell

#: Weight of all but the structure's tangent in what is left out of sums: soft shapes are what is left of large
#: stiffnesses, of which little may be missing. With a hundredth exponents move by 1e-6 of themselves.
REST = 0.02
#: The same of all of a rough linearisation.
ROUGH = 0.1
#: The same where something touches, over the ratio of stiffnesses of stops and of the wall.
HARD = 100.0
#: Phases that the structure's tangent is taken at if the motion has harmonics for them, at least.
LEAST = 13


@dataclass(frozen=True)
class StiffnessDamping:
    """1 + beta d/dt, what stiffness damping makes of the internal force."""

    beta: float
    polynomial: bool = True

    def __call__(self, s):
        return 1.0 + self.beta * s


@dataclass(frozen=True)
class MassDamping:
    """d2/dt2 + alpha d/dt, what damping by the mass makes of accelerations."""

    alpha: float
    polynomial: bool = True

    def __call__(self, s):
        return s * (s + self.alpha)


class WallSlopes:
    """Matrices of a wall at the samples of motions.

    Parameters
    ----------
    size : int
        Unknowns, those of the flow behind the wall's.
    scales : (n,) array
        Sizes of the wall's unknowns.
    """

    def __init__(self, size: int, scales: np.ndarray):
        self._size, self._scales = size, scales
        self._used: dict[str, np.ndarray] = {}
        self._sizes: np.ndarray | None = None

    def terms(
        self,
        model: ValveModel,
        motion: PeriodicMotion,
        mu: Mapping[str, float],
        pressures: np.ndarray,
        rough: bool = False,
        geometric: Callable[[int], np.ndarray] | None = None,
    ) -> tuple[list[Term], tuple[np.ndarray, ...]]:
        """Terms of a linearisation, and means (nnz,) of the tangent of the structure, of the rest of the stiffness, of
        damping but for that by stiffness, and of the mass.

        Parameters
        ----------
        model : ValveModel
        motion : PeriodicMotion
        mu : mapping
        pressures : (N, m) array
            Pa, at the samples.
        rough : bool
            Whether to take the harmonics of the structure's tangent up to half those of the motion alone, instead of
            all but the last, and to leave out how inertia changes with the motion.
        geometric : callable, optional
            What else there is of the stiffness, values (nnz,), from the number of a sample.
        """
        h, alpha = motion.harmonics, mu["alpha"]
        samples = motion.samples[:, : model.size]
        few = min(h.count + 3 | 1 if rough else max(2 * h.count - 1, LEAST), h.size)
        weight, none = ROUGH if rough else 1.0, np.zeros(len(model.shell.dofs.pattern[1]))
        if any(model.touching(q) for q in samples):  # stops and contacts come and go at once, and outweigh the wall
            few, rough, weight = h.samples, False, HARD
        spread = between_phases(few, h.samples) if few < h.samples else None
        own, mass, inertia = self._of_shape(model, motion, few, alpha, rough)
        pressed = self._rows("pressed", h.samples)
        for i, q in enumerate(samples):
            values = model.follower_stiffness(model.nodal(q), pressures[i], none)
            model.add_contact(q, values)
            pressed.put(values if geometric is None else values + geometric(i))
        self._used |= {"own": own.used, "mass": mass.used, "pressed": pressed.used}
        stiffness, rest = own.mean, pressed.mean
        damping, masses = alpha * mass.mean, mass.mean
        inert = self.blocks(model, mass, REST * weight, spread if len(mass.values) > 1 else np.ones((h.samples, 1)))
        middle = [(0, self.blocks(model, pressed, REST * weight)), (MassDamping(alpha) if alpha else 2, inert)]
        if inertia:
            whole = self._norm(model, rest)
            for power, (name, rows) in enumerate(inertia.items()):
                self._used[name], mean = rows.used, rows.mean
                size = motion.omega**power * self._norm(model, mean)
                share = min(size / whole, 1.0) if whole else 1.0
                middle.append((power, self.blocks(model, rows, REST * weight * share, spread)))
                rest, damping = (rest + mean, damping) if power == 0 else (rest, damping + mean)
        structure = Term([(0, self.blocks(model, own, weight, spread))], outer=StiffnessDamping(mu["beta"]))
        return [structure, Term(middle)], (stiffness, rest, damping, masses)

    def _rows(self, name: str, count: int) -> BlockRows:
        return BlockRows(count, self._used.get(name))

    def _of_shape(self, model: ValveModel, motion: PeriodicMotion, few: int, alpha: float, rough: bool):
        """Tangents of the structure and masses at as many phases, and derivatives of the inertia forces by positions
        and by rates, those of the turning of the wall's sections alone; none of these, and one mass, in a rough one.
        """
        phases = 2 * np.pi * np.arange(few) / few
        own, mass = self._rows("own", few), self._rows("mass", 1 if rough else few)
        inertia = {} if rough else {name: self._rows(name, few) for name in ("by position", "by rate")}
        for q, v, a in zip(*(x[:, : model.size] for x in motion.with_rates(phases))):
            own.put(model.structure(q)[1])
            if not rough:
                mass.put(model.mass(q))
                slopes = inertia_slopes(model.shell, model.nodal(q), model.nodal(v), model.nodal(a + alpha * v))
                for rows, values in zip(inertia.values(), slopes):
                    rows.put(values)
        if rough:
            mass.put(model.mass(motion.coefficients[0, : model.size]))
        return own, mass, inertia

    def blocks(self, model: ValveModel, values, share: float = 1.0, spread: np.ndarray | None = None) -> SparseBlocks:
        """Matrices (n + l, n + l), nothing on the flow's unknowns, of values on the structure's pattern."""
        indptr, indices = model.shell.dofs.pattern
        inner = self._size - model.size
        indptr = np.append(indptr, np.full(inner, indptr[-1], indptr.dtype))
        return SparseBlocks(values, indices, indptr, (self._size, self._size), share, spread)

    def _norm(self, model: ValveModel, values: np.ndarray) -> float:
        """Frobenius norm of a matrix on the structure's pattern, with its unknowns scaled by their sizes."""
        indptr, indices = model.shell.dofs.pattern
        if self._sizes is None:
            self._sizes = np.repeat(self._scales, np.diff(indptr)) * self._scales[indices]
        return float(np.linalg.norm(values * self._sizes))


def between_phases(few: int, count: int) -> np.ndarray:
    """(count, few) weights of values at an odd number of equally spaced phases in those at more, by the trigonometric
    polynomial through them.

    Examples
    --------
    >>> values = 2.0 + np.cos(2 * np.pi * np.arange(3) / 3)
    >>> (between_phases(3, 4) @ values).round(12).tolist()
    [3.0, 2.0, 1.0, 2.0]
    """
    series = Harmonics((few - 1) // 2, few)
    return series.basis_at(2 * np.pi * np.arange(count) / count) @ series.basis.T / few


#: Step of the central difference that stands for third derivatives of directors, rad.
_STEP = 1e-4


def inertia_slopes(shell: Shell, nodal: np.ndarray, rate: np.ndarray, acceleration: np.ndarray):
    """Values (nnz,) of the derivatives by positions and by velocities on the pattern of the shell's matrices.

    Parameters
    ----------
    shell : Shell
    nodal, rate, acceleration : (nn, c) arrays
    """
    _, d1, d2 = shell.directors(nodal)
    r, a = rate[:, 3:5], acceleration[:, 3:5]
    mixed = np.stack([d2[:, [0, 2]], d2[:, [2, 1]]], axis=1)  # (nn, 2, 2, 3)
    turn = np.einsum("nri,nr->ni", d1, a) + _twice(d2, r)
    by_rate = 2.0 * np.einsum("nrsi,ns->nri", mixed, r)
    by_angle = np.einsum("nrsi,ns->nri", mixed, a)
    for s in range(2):
        ahead, behind = nodal.copy(), nodal.copy()
        ahead[:, 3 + s] += _STEP
        behind[:, 3 + s] -= _STEP
        by_angle[:, s] += (_twice(shell.directors(ahead)[2], r) - _twice(shell.directors(behind)[2], r)) / (2 * _STEP)
    size = len(shell.dofs.pattern[1])
    position, velocity = np.zeros(size), np.zeros(size)
    fixed = (shell.mesh.quads, shell.inertia_integrals, d1, mixed, turn, acceleration, by_angle, by_rate)
    _assemble(*fixed, shell.dofs.slots, position, velocity)
    return position, velocity


def _twice(d2: np.ndarray, r: np.ndarray) -> np.ndarray:
    """Second derivatives of directors (nn, 3, 3) along rates (nn, 2) twice, (nn, 3)."""
    x, y = r[:, :1], r[:, 1:]
    return d2[:, 0] * x * x + d2[:, 1] * y * y + 2.0 * d2[:, 2] * x * y


@numba.njit(cache=True)
def _assemble(quads, integrals, d1, mixed, turn, acceleration, by_angle, by_rate, slots, position, velocity):
    kq = np.empty((20, 20))
    kv = np.empty((20, 20))
    moment = np.empty(3)
    for el in range(quads.shape[0]):
        kq[:] = 0.0
        kv[:] = 0.0
        for a in range(4):
            na = quads[el, a]
            moment[:] = 0.0
            for b in range(4):
                nb = quads[el, b]
                m1 = integrals[el, 1, a, b]
                m2 = integrals[el, 2, a, b]
                for i in range(3):
                    moment[i] += m1 * acceleration[nb, i] + m2 * turn[nb, i]
                for s in range(2):
                    for i in range(3):
                        kq[5 * a + i, 5 * b + 3 + s] += m1 * by_angle[nb, s, i]
                        kv[5 * a + i, 5 * b + 3 + s] += m1 * by_rate[nb, s, i]
                    for r in range(2):
                        for i in range(3):
                            kq[5 * a + 3 + r, 5 * b + 3 + s] += m2 * d1[na, r, i] * by_angle[nb, s, i]
                            kv[5 * a + 3 + r, 5 * b + 3 + s] += m2 * d1[na, r, i] * by_rate[nb, s, i]
            for r in range(2):
                for s in range(2):
                    for i in range(3):
                        kq[5 * a + 3 + r, 5 * a + 3 + s] += mixed[na, r, s, i] * moment[i]
        for i in range(20):
            for j in range(20):
                where = slots[el, 20 * i + j]
                if where >= 0:
                    position[where] += kq[i, j]
                    velocity[where] += kv[i, j]
