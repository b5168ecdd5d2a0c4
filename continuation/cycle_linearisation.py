"""Linear equations of a correction to a periodic motion, and their two-level preconditioner.

On a small basis V the linearisation is projected and solved as one dense matrix, with free unknowns and conditions as
borders; a smoother answers in all other directions; GMRES does the rest.  The preconditioner needs V^T A x of full
vectors x: matrices at the samples are sums of a few, A_i = sum w_ik A_k, so that V^T A_k, held in single precision,
serve all samples in one dense product.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg as la
from scipy.sparse.linalg import LinearOperator, gmres

from continuation.options import SingularSystem
from continuation.periodic import PeriodicMotion, PeriodicOperator, ReducedOperator, Term, by_parts

#: Name of omega among free unknowns.
FREQUENCY = "frequency"
#: Relative step of differences by omega and by parameters.
_STEP = 1e-6


@dataclass(frozen=True, eq=False)
class Condition:
    """A linear condition <row, X> + extra . e = value on coefficients X and free unknowns e."""

    row: np.ndarray  #: (2 H + 1, n).
    extra: np.ndarray  #: (k,).
    value: float

    def miss(self, coefficients: np.ndarray, free: np.ndarray) -> float:
        """Residual of the condition."""
        return float(np.vdot(self.row, coefficients) + self.extra @ free - self.value)


def free_values(motion: PeriodicMotion, mu: Mapping[str, float], free: Sequence[str]) -> np.ndarray:
    """Values (k,) of the free unknowns."""
    return np.array([motion.omega if name == FREQUENCY else mu[name] for name in free], float)


def apply_change(motion: PeriodicMotion, mu: Mapping[str, float], free: Sequence[str], change: np.ndarray):
    """Motion and parameters after a change of coefficients and free unknowns, one vector."""
    size = motion.coefficients.size
    step = dict(zip(free, change[size:].tolist()))
    coefficients = motion.coefficients + change[:size].reshape(motion.coefficients.shape)
    omega = motion.omega + step.pop(FREQUENCY, 0.0)
    parameters = dict(mu) | {name: mu[name] + value for name, value in step.items()}
    return PeriodicMotion(motion.harmonics, coefficients, omega), parameters


def units_of(motion: PeriodicMotion, mu: Mapping[str, float], free: Sequence[str], scales: np.ndarray) -> np.ndarray:
    """Sizes that changes of coefficients and free unknowns are measured in."""
    c = motion.coefficients
    whole = max(float(np.abs(c[1:] / scales).max()), 1e-300)
    return np.append(np.tile(whole * scales, len(c)), np.maximum(np.abs(free_values(motion, mu, free)), 1e-9))


class CycleLinearisation:
    """Linear equations about one motion: those of the system, bordered by free unknowns and conditions.

    Parameters
    ----------
    system : object
        As in `continuation.cycles.CycleSolver`.
    motion : PeriodicMotion
    mu : mapping
    basis : (n, r) array
        Orthonormal in unknowns over their scales.
    rough : bool
        True for corrections, which a rough linearisation serves.
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
        at = free_values(self.motion, self.mu, (name,))[0]
        step = _STEP * max(abs(at), 1e-6)
        still = np.zeros(self.motion.coefficients.size)
        motion, mu = apply_change(self.motion, self.mu, (name,), np.append(still, step))
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
        with them. Raises SingularSystem.
        """
        self.free, self.conditions = tuple(free), tuple(conditions)
        for name in self.free:
            if name not in self._known:
                self._known[name] = self._column(name, force)
        shape = (len(self.free), *self.motion.coefficients.shape)
        self.columns = np.array([self._known[name] for name in self.free]).reshape(shape)
        self.factor()

    def factor(self) -> None:
        """Factor the projection with the unknowns and conditions it has, as after an extension of the basis. Raises
        SingularSystem.
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
        """Operator applied to coefficients, projected on the basis."""
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
        units, left = self.units, [1.0]
        start = self._precondition(rhs) / units
        preconditioned = LinearOperator(
            (len(rhs), len(rhs)), lambda y: self._precondition(self.apply(units * y)) / units, dtype=float
        )
        x, _ = gmres(
            preconditioned,
            start,
            rtol=tolerance,
            restart=most,
            maxiter=1,
            callback=left.append,
            callback_type="pr_norm",
        )
        return units * x, len(left) - 1, float(left[-1])

    @property
    def units(self) -> np.ndarray:
        """Sizes that changes of coefficients and free unknowns are measured in."""
        return units_of(self.motion, self.mu, self.free, self.scale)

    def lift(self, coefficients: np.ndarray) -> np.ndarray:
        """Coefficients (S, n) of unknowns from those (S, r) on the basis."""
        return by_parts(lambda part: part @ (self.scale[:, None] * self.basis).T, coefficients)

    @property
    def exact(self) -> bool:
        """True where the projection is that of the operator itself."""
        return self.operator.exact


class LeftProjection:
    """V^T A of an operator whose terms are all blocks.

    Parameters
    ----------
    reduced : ReducedOperator
        Projection on the basis, with its rough rows.
    """

    def __init__(self, operator: PeriodicOperator, reduced: ReducedOperator):
        self._motion, self._rates = operator.motion, operator.rates()
        # terms through few numbers are cheap as they are
        self._narrow = [
            Term([(f, small.left @ blocks) for f, blocks in t.middle], right=t.right, outer=t.outer)
            for t, small in zip(operator.terms, reduced.terms)
            if t.narrow
        ]
        rates, size = self._rates, self._motion.harmonics.size
        self._parts = []
        for (outer, function, blocks), between in zip(reduced.parts, reduced.between_harmonics):
            if blocks.rows is not None:
                weights = rates.matrix(outer) @ between[: len(blocks.rows)] @ rates.matrix(function)
                self._parts.append((weights.transpose(1, 0, 2).reshape(size, -1), blocks.rows))

    def apply(self, coefficients: np.ndarray) -> np.ndarray:
        """Coefficients (2 H + 1, r) for real ones (2 H + 1, n) of a change of the motion."""
        size = np.abs(coefficients).max() or 1.0  # single precision has a short range
        columns = np.ascontiguousarray((coefficients / size).T, np.float32)
        total = 0.0
        for weights, rows in self._parts:
            products = (rows.reshape(-1, rows.shape[2]) @ columns).reshape(*rows.shape[:2], -1)
            products = products.transpose(0, 2, 1).reshape(-1, rows.shape[1]).astype(float)
            total = total + weights @ products
        total = size * total
        if self._narrow:
            h = self._motion.harmonics
            samples = h.evaluate(coefficients)
            total = total + h.project(sum(term.apply(samples, self._rates) for term in self._narrow))
        return total
