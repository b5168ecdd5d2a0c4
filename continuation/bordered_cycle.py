"""The linear equations of a correction to a periodic motion, and their two-level preconditioner."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg as la

from continuation.errors import SingularSystem
from continuation.krylov import gmres
from continuation.left_projection import LeftProjection
from continuation.periodic import PeriodicMotion

#: Name of omega among free unknowns.
FREQUENCY = "frequency"
#: Relative step of differences by omega and by parameters.
_STEP = 1e-6


@dataclass(frozen=True, eq=False)
class Condition:
    """A linear condition <row, X> + extra . e = value on coefficients X and free unknowns e.

    Attributes
    ----------
    row : (2 H + 1, n) array
    extra : (k,) array
    value : float
    """

    row: np.ndarray
    extra: np.ndarray
    value: float

    def miss(self, coefficients: np.ndarray, free: np.ndarray) -> float:
        """What is left of it."""
        return float(np.vdot(self.row, coefficients) + self.extra @ free - self.value)


def values_of(motion: PeriodicMotion, mu: Mapping[str, float], free: Sequence[str]) -> np.ndarray:
    """Values (k,) of the free unknowns."""
    return np.array([motion.omega if name == FREQUENCY else mu[name] for name in free], float)


def moved(motion: PeriodicMotion, mu: Mapping[str, float], free: Sequence[str], change: np.ndarray):
    """Motion and parameters after a change of coefficients and free unknowns, one vector."""
    size = motion.coefficients.size
    step = dict(zip(free, change[size:].tolist()))
    coefficients = motion.coefficients + change[:size].reshape(motion.coefficients.shape)
    omega = motion.omega + step.pop(FREQUENCY, 0.0)
    parameters = dict(mu) | {name: mu[name] + value for name, value in step.items()}
    return PeriodicMotion(motion.harmonics, coefficients, omega), parameters


class CycleLinearisation:
    """Linear equations about one motion: those of the system, bordered by free unknowns and conditions.

    Parameters
    ----------
    system : continuation.periodic.PeriodicSystem
    motion : PeriodicMotion
    mu : mapping
    basis : (n, r) array
        Orthonormal in unknowns over their scales.
    rough : bool
        Whether it is for corrections, which a rough one serves.
    smoother : callable, optional
        That of a motion nearby with as many harmonics.
    """

    def __init__(self, system, motion, mu, basis: np.ndarray, rough: bool = False, smoother=None):
        self.system, self.motion, self.mu = system, motion, dict(mu)
        self.operator = system.linearise(motion, mu, rough)
        self.smoother = system.smoother(self.operator, mu) if smoother is None else smoother
        self._by_rows = rough and self.operator.exact
        self.scale, self.basis = np.asarray(system.scales), basis
        self._known: dict[str, np.ndarray] = {}
        self._coarse = self._rough = None

    def _column(self, name: str, force: np.ndarray) -> np.ndarray:
        """Derivative (2 H + 1, n) of the residual, `force` at the motion, by a free unknown."""
        at = values_of(self.motion, self.mu, (name,))[0]
        step = _STEP * max(abs(at), 1e-6)
        still = np.zeros(self.motion.coefficients.size)
        motion, mu = moved(self.motion, self.mu, (name,), np.append(still, step))
        return (motion.harmonics.project(self.system.residual(motion, mu)) - force) / step

    @property
    def reduced(self):
        """Projection on the basis."""
        if self._coarse is None:
            self._coarse = self.operator.reduced(self.scale[:, None] * self.basis, rough=self._by_rows)
        return self._coarse

    def extend(self, directions: np.ndarray) -> bool:
        """Add directions (n, k) to the basis, the first columns of the one before; whether there was anything new."""
        beyond = directions
        for _ in range(2):
            beyond = beyond - self.basis @ (self.basis.T @ beyond)
        vectors, sizes, _ = la.svd(beyond, full_matrices=False)
        added = vectors[:, sizes > 1e-6 * np.linalg.norm(directions)]
        if not added.shape[1]:
            return False
        known, self.basis = self.reduced, np.hstack([self.basis, added])
        self._coarse, self._rough = self.operator.reduced(self.scale[:, None] * self.basis, known, self._by_rows), None
        return True

    def prepare(self, free: Sequence[str], conditions: Sequence[Condition], force: np.ndarray) -> None:
        """Take free unknowns, as many conditions and the residual (2 H + 1, n) at the motion, and factor the projection
        with them.

        Raises
        ------
        SingularSystem
        """
        self.free, self.conditions = tuple(free), tuple(conditions)
        for name in self.free:
            if name not in self._known:
                self._known[name] = self._column(name, force)
        shape = (len(self.free), *self.motion.coefficients.shape)
        self.columns = np.array([self._known[name] for name in self.free]).reshape(shape)
        self.factor()

    def factor(self) -> None:
        """Factor the projection with the unknowns and conditions it has, as after an extension of the basis.

        Raises
        ------
        SingularSystem
        """
        v = self.scale[:, None] * self.basis
        matrix, free = self.reduced.matrix(), len(self.free)
        whole = np.zeros((len(matrix) + free, len(matrix) + free))
        whole[: len(matrix), : len(matrix)] = matrix
        for j, (column, condition) in enumerate(zip(self.columns, self.conditions)):
            whole[: len(matrix), len(matrix) + j] = (column @ v).ravel()
            whole[len(matrix) + j, : len(matrix)] = (condition.row @ v).ravel()
            whole[len(matrix) + j, len(matrix) :] = condition.extra
        if not np.isfinite(whole).all():
            raise SingularSystem("The linearisation of the periodic motion holds numbers that are not finite.")
        # rows and columns have units of their own
        self._balance = 1.0 / np.maximum(np.abs(whole).max(axis=1), 1e-300)
        self._factor = la.lu_factor(whole * self._balance[:, None], check_finite=False)
        self._v = v

    def apply(self, change: np.ndarray) -> np.ndarray:
        """Change of the unbalance for a change of coefficients and free unknowns."""
        size, shape = self.motion.coefficients.size, self.motion.coefficients.shape
        rows, extra = change[:size].reshape(shape), change[size:]
        force = self.operator.apply(rows) + np.tensordot(extra, self.columns, 1)
        return np.append(force.ravel(), [np.vdot(c.row, rows) + c.extra @ extra for c in self.conditions])

    def _on_basis(self, rows: np.ndarray) -> np.ndarray:
        """What the operator makes of coefficients, on the basis."""
        if not self._by_rows:
            return self.operator.apply(rows) @ self._v
        if self._rough is None:
            self._rough = LeftProjection(self.operator, self.reduced)
        return self._rough.apply(rows)

    def _precondition(self, force: np.ndarray) -> np.ndarray:
        size, shape = self.motion.coefficients.size, self.motion.coefficients.shape
        out, free = np.zeros_like(force), len(self.free)
        small = np.append((force[:size].reshape(shape) @ self._v).ravel(), force[size:])
        if self.smoother is not None:
            rows = self.smoother(force[:size].reshape(shape))
            small -= np.append(self._on_basis(rows).ravel(), [np.vdot(c.row, rows) for c in self.conditions])
            out[:size] = rows.ravel()
        found = la.lu_solve(self._factor, self._balance * small, check_finite=False)
        out[:size] += (found[: len(found) - free].reshape(shape[0], -1) @ self._v.T).ravel()
        out[size:] += found[len(found) - free :]
        return out

    def solve(self, rhs: np.ndarray, tolerance: float, most: int) -> tuple[np.ndarray, int, float]:
        """Change for which `apply` gives `rhs` within a tolerance on preconditioned residuals, iterations, what is
        left.
        """
        units = self.units
        start = self._precondition(rhs) / units
        x, count, missed = gmres(lambda y: self._precondition(self.apply(units * y)) / units, start, tolerance, most)
        return units * x, count, missed

    @property
    def units(self) -> np.ndarray:
        """Sizes that changes of coefficients and free unknowns are measured in."""
        free = np.maximum(np.abs(values_of(self.motion, self.mu, self.free)), 1e-9)
        c = self.motion.coefficients
        whole = max(float(np.abs(c[1:] / self.scale).max()), 1e-300)
        return np.append(np.tile(whole * self.scale, len(c)), free)
