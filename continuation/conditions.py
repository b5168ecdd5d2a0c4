"""Scalar conditions of minimally augmented systems, with exact derivatives.

Each condition borders a matrix so that it becomes regular and reads off a number that
vanishes exactly when the inner matrix is singular (Griewank & Reddien 1984; Govaerts,
Numerical Methods for Bifurcations of Dynamical Equilibria, SIAM 2000, ch. 4).  If
``[[M, p], [q*, 0]] (v, g) = (0, 1)`` and ``(w*, g)`` solves the adjoint problem, then
``dg = -w* dM v``: only directional second derivatives are needed.
"""

from __future__ import annotations

from copy import copy

import numpy as np

from continuation.linear import Bordered, bordered
from continuation.system import Derivatives


def null_pair(solver, p, q):
    """``g, v, w`` of the bordered matrix; ``w`` is conjugated, so that ``w* M = -g q*``."""
    border = Bordered(solver, p, np.conj(q))
    one = np.eye(1, p.size + 1, p.size)[0]
    right, left = border.solve(one), border.solve_transpose(one)
    return right[-1], right[:-1], np.conj(left[:-1]), border


def null_vectors(solver, p, q, passes=2):
    """Left and right null vectors from vectors near them; the right one stands in for a left one that vanishes."""
    p = q if np.linalg.norm(p) <= 1e-12 * np.linalg.norm(q) else p
    for _ in range(passes):
        _, q, p, _ = null_pair(solver, p / np.linalg.norm(p), q / np.linalg.norm(q))
    return p, q


def generic_borders(size):
    """Two fixed vectors without any symmetry a model might have."""
    i = np.arange(1.0, size + 1.0)
    return np.cos(i * i) / np.sqrt(size), np.sin(i * i) / np.sqrt(size)


class FoldCondition:
    """``g = 0``: ``F_u`` is singular.

    `evaluate` gives a copy at a point, with ``values`` of shape (count,), their derivatives ``d_extra`` by the extra
    unknowns, of shape (count, extra), and ``along`` a change of state and parameters; ``v, w`` are the right and left
    null vectors there.

    Parameters
    ----------
    p, q : ndarray, shape (n,)
        Borders, near the left and right null vectors.
    """

    extra, count = 0, 1
    extra_names: tuple[str, ...] = ()
    d_extra = np.zeros((1, 0))

    def __init__(self, p, q):
        self.p, self.q = p / np.linalg.norm(p), q / np.linalg.norm(q)

    def evaluate(self, system, u, mu, names, linear, extra):
        """Condition at a point; ``linear`` is the linearisation there."""
        at = copy(self)
        at.linear, at._names, at._derivatives = linear, names, Derivatives(system, u, mu)
        at._measure(extra)
        return at

    def _measure(self, extra):
        g, self.v, self.w, self._border = null_pair(self.linear, self.p, self.q)
        self.values = np.array([g])

    def along(self, du, dmu):
        return np.array([-self.w @ self._derivatives.jacobian_along(self.v, du, dmu)])

    def adapt(self, at):
        """Turn the borders to the null vectors at a point, so that they stay near."""
        self.p, self.q = at.w / np.linalg.norm(at.w), at.v / np.linalg.norm(at.v)


def fold_coefficient(system, u, mu, v, w) -> float:
    """``a`` of ``x' = a x^2 + ...`` at a fold, with ``|v| = 1`` and ``w' B v = 1``.

    Zero at a cusp; infinite where ``w' B v`` vanishes (Bogdanov-Takens).
    """
    linear = system.linear(u, mu)
    value = FoldCondition(w, v).evaluate(system, u, mu, (), linear, ())
    v = value.v / np.linalg.norm(value.v)
    scale = value.w @ linear.mass_matvec(v)
    with np.errstate(divide="ignore"):
        return float(0.5 * (value.w @ system.d2(u, mu, v, v)) / scale)


class HopfCondition(FoldCondition):
    """Real and imaginary part of ``g``: ``F_u - i omega B`` is singular, with eigenvectors ``v, w``.

    Parameters
    ----------
    p, q : ndarray, complex, shape (n,)
        Borders, near the left and right eigenvectors.
    """

    extra, count = 1, 2
    extra_names = ("omega",)

    def _measure(self, extra):
        self.omega = float(extra[0])
        g, self.v, self.w, _ = null_pair(self.linear.shifted(1j * self.omega), self.p, self.q)
        self.values = np.array([g.real, g.imag])
        slope = 1j * np.vdot(self.w, self.linear.mass_matvec(self.v))
        self.d_extra = np.array([[slope.real], [slope.imag]])

    def along(self, du, dmu):
        change = self._derivatives.jacobian_along(self.v, du, dmu)
        change = change - 1j * self.omega * self._derivatives.mass_along(self.v, du, dmu)
        dg = -np.vdot(self.w, change)
        return np.array([dg.real, dg.imag])


class BogdanovTakensCondition(FoldCondition):
    """``F_u v = 0`` and ``w' B v = 0``: a double zero eigenvalue with one eigenvector."""

    count = 2
    d_extra = np.zeros((2, 0))

    def _measure(self, extra):
        super()._measure(extra)
        self._bv, self._bw = self.linear.mass_matvec(self.v), self.linear.mass_rmatvec(self.w)
        self.values = np.array([self.values[0], self.w @ self._bv])

    def along(self, du, dmu):
        d = self._derivatives
        av = d.jacobian_along(self.v, du, dmu)
        # dv solves the differentiated bordered system; w' B dv = (B'w)' dv.  dw enters
        # through a transposed solve with B v, which needs no gradient of w' F_u.
        zero = np.zeros(1)
        dv = self._border.solve(np.concatenate([-av, zero]))[:-1]
        x = self._border.solve(np.concatenate([self._bv, zero]))[:-1]
        dw_bv = -(self.w @ d.jacobian_along(x, du, dmu))
        second = self._bw @ dv + dw_bv + self.w @ d.mass_along(self.v, du, dmu)
        return np.array([-self.w @ av, second])


class BranchPointCondition(FoldCondition):
    """``[F_u, F_p]`` loses rank, for the system unfolded by ``F + beta * p``.

    The freed parameters are the branch's and ``beta``; at the solution ``beta = 0``
    (Moore 1980; Allgower & Schwetlick 1997).  At a point ``null`` are two vectors of shape (n + 1,) that span the
    kernel where ``values = 0``.

    Parameters
    ----------
    p : ndarray, shape (n,)
        Border and unfolding direction, near the left null vector.
    rows : ndarray, shape (2, n + 1)
        Near the two null vectors of ``[F_u, F_p]``.
    """

    count = 2
    d_extra = np.zeros((2, 0))

    def __init__(self, p, rows):
        self.p, self.rows = p / np.linalg.norm(p), rows

    def _measure(self, extra):
        at, n = self._derivatives, self.p.size
        columns = [at.system.d_parameter(at.u, at.mu, self._names[0]), self.p]
        rows = np.hstack([self.rows, np.zeros((2, 1))])
        # The first border must not be singular with its row alone, so the rows are ordered
        # by the caller: the tangent of the branch first.
        solver = bordered(self.linear, columns, rows)
        units = np.eye(2, n + 2, n)
        right = [solver.solve(unit) for unit in units]
        self.null = [x[: n + 1] for x in right]
        self.w = solver.solve_transpose(units[-1])[:n]
        self.values = np.array([x[-1] for x in right])

    def extended_along(self, x, du, dmu):
        """``d([F_u, F_p] x)`` for a change of state and parameters."""
        v, s, at = x[:-1], x[-1], self._derivatives
        change = at.jacobian_along(v, du, dmu)
        if s != 0.0:
            change = change + s * at.d2_parameter(self._names[0], du)
            for name, amount in dmu.items():
                if amount != 0.0:
                    change = change + s * amount * at.system.d_parameters2(at.u, at.mu, self._names[0], name)
        return change

    def along(self, du, dmu):
        return np.array([-self.w @ self.extended_along(x, du, dmu) for x in self.null])
