"""Periodic orbits as zeros of a larger system: orthogonal collocation.

On each mesh interval the orbit is a polynomial of degree ``m`` that satisfies the equation
at the ``m`` Gauss points (de Boor & Swartz 1973; as in AUTO).  Time is scaled by the period,
the last node of one interval is the first of the next, the last of all is the first.  An
integral phase condition against a reference orbit removes the freedom of time shift.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg as sla
import scipy.sparse as sp

from continuation.linear import MatrixLinearisation
from continuation.options import require
from continuation.system import SystemBase


def lagrange(nodes, points) -> tuple[np.ndarray, np.ndarray]:
    """Lagrange basis and its derivative at ``points``, both of shape (points, nodes)."""
    nodes, points = np.asarray(nodes, float), np.asarray(points, float)
    value = np.empty((points.size, nodes.size))
    slope = np.zeros_like(value)
    # Products of differences; expanded coefficients would lose digits at degree 6.
    for i, node in enumerate(nodes):
        others = np.delete(nodes, i)
        factors = (points[:, None] - others) / (node - others)
        value[:, i] = factors.prod(axis=1)
        for k, other in enumerate(others):
            slope[:, i] += np.delete(factors, k, axis=1).prod(axis=1) / (node - other)
    return value, slope


class OrbitSystem(SystemBase):
    """The collocation equations of a periodic orbit, as a `System` to be solved and continued.

    Unknowns: the states at the nodes, shape (intervals * degree, n), flattened, and the
    period.

    Parameters
    ----------
    system : System
        Its linearisation must offer ``to_dense``.
    mesh : ndarray, shape (intervals + 1,)
        From 0 to 1, increasing.
    degree : int
        Gauss points per interval.
    reference : ndarray, shape (intervals * degree, n)
        Nodes of the orbit that fixes the phase.
    period_scale : float
        Unit of the period in the arclength.
    """

    def __init__(self, system, mesh, degree, reference, period_scale=1.0):
        self.inner = system
        self.mesh = np.asarray(mesh, float)
        require(
            np.all(np.diff(self.mesh) > 0) and self.mesh[0] == 0 and self.mesh[-1] == 1,
            "The mesh of an orbit must increase from 0 to 1.",
        )
        require(2 <= degree <= 7, f"The degree of the collocation is 2 to 7, not {degree}.")
        self.degree, self.intervals = int(degree), self.mesh.size - 1
        self.n = system.size
        self.nodes = self.intervals * self.degree
        self.size = self.nodes * self.n + 1
        gauss, weights = np.polynomial.legendre.leggauss(self.degree)
        self._local = np.linspace(0.0, 1.0, self.degree + 1)
        self._value, self._slope = lagrange(self._local, 0.5 * (gauss + 1.0))
        self._quadrature = 0.5 * weights
        self._period_scale = float(period_scale)
        own = getattr(system, "state_weights", None)
        each = np.full(self.n, 1.0 / self.n) if own is None else np.asarray(own, float)
        self.state_weights = np.append(np.tile(each / self.nodes, self.nodes), period_scale**-2)
        self._each = each
        self.set_reference(reference)

    def set_reference(self, nodes) -> None:
        """Fix the phase against this orbit from now on."""
        nodes = np.asarray(nodes, float).reshape(self.nodes, self.n)
        self._reference = nodes
        row = np.zeros((self.nodes, self.n))
        for j in range(self.intervals):
            index = self._index(j)
            velocity = self._slope @ nodes[index]  # times h / h of the integral
            row_local = self._value.T @ (self._quadrature[:, None] * velocity) * self._each
            np.add.at(row, index, row_local)
        self._phase = row.ravel()

    def restart_data(self) -> dict:
        """What a file needs to build this system again."""
        return {
            "mesh": self.mesh,
            "degree": np.array(self.degree),
            "reference": self._reference,
            "period_scale": np.array(self._period_scale),
        }

    def _index(self, j):
        return (j * self.degree + np.arange(self.degree + 1)) % self.nodes

    def split(self, u):
        """Nodes, shape (nodes, n), and period."""
        return u[:-1].reshape(self.nodes, self.n), float(u[-1])

    def _points(self, nodes):
        """Interval, state and velocity (per scaled time) at each collocation point."""
        for j in range(self.intervals):
            local = nodes[self._index(j)]
            h = self.mesh[j + 1] - self.mesh[j]
            for k in range(self.degree):
                yield j, k, h, self._value[k] @ local, self._slope[k] @ local / h

    def residual(self, u, mu):
        nodes, period = self.split(u)
        result = np.empty(self.size)
        row = 0
        for _, _, _, x, velocity in self._points(nodes):
            f = self.inner.residual(x, mu)
            result[row : row + self.n] = period * f - self._mass(x, mu, velocity)
            row += self.n
        result[-1] = self._phase @ nodes.ravel()
        return result

    def _mass(self, x, mu, velocity):
        return self.inner.linear(x, mu).mass_matvec(velocity) if self._massive else velocity

    @property
    def _massive(self):
        return not getattr(self.inner, "identity_mass", False)

    def d_parameter(self, u, mu, name):
        nodes, period = self.split(u)
        result = np.zeros(self.size)
        row = 0
        for _, _, _, x, velocity in self._points(nodes):
            part = period * self.inner.d_parameter(x, mu, name)
            if self._massive:
                part = part - self.inner.mass_parameter(x, mu, name, velocity)
            result[row : row + self.n] = part
            row += self.n
        return result

    def blocks(self, u, mu):
        """Per interval: derivative of its equations by its nodes, and by the period.

        Returns
        -------
        list of (ndarray (m n, (m + 1) n), ndarray (m n,))
        """
        nodes, period = self.split(u)
        m, n = self.degree, self.n
        result = []
        for _j, k, h, x, velocity in self._points(nodes):
            if k == 0:
                block, by_period = np.zeros((m * n, (m + 1) * n)), np.zeros(m * n)
                result.append((block, by_period))
            jacobian, mass = self.inner.linear(x, mu).to_dense()
            slope = period * jacobian
            if not getattr(self.inner, "constant_mass", True):
                slope = slope - np.stack([self.inner.mass_d(x, mu, velocity, e) for e in np.eye(n)], axis=1)
            rows = slice(k * n, (k + 1) * n)
            for i in range(m + 1):
                block[rows, i * n : (i + 1) * n] = self._value[k, i] * slope - self._slope[k, i] / h * mass
            by_period[rows] = self.inner.residual(x, mu)
        return result

    def linear(self, u, mu):
        m, n = self.degree, self.n
        rows, columns, data = [], [], []
        for j, (block, by_period) in enumerate(self.blocks(u, mu)):
            row = j * m * n + np.arange(m * n)
            column = (self._index(j)[:, None] * n + np.arange(n)).ravel()
            rows.append(np.repeat(row, column.size))
            columns.append(np.tile(column, row.size))
            data.append(block.ravel())
            rows.append(row)
            columns.append(np.full(row.size, self.size - 1))
            data.append(by_period)
        rows.append(np.full(self.size - 1, self.size - 1))
        columns.append(np.arange(self.size - 1))
        data.append(self._phase)
        matrix = sp.csc_matrix(
            (np.concatenate(data), (np.concatenate(rows), np.concatenate(columns))),
            shape=(self.size, self.size),
        )
        return MatrixLinearisation(matrix)

    def monodromy(self, u, mu) -> np.ndarray:
        """Monodromy matrix over one period from node 0, shape (n, n)."""
        n = self.n
        product = np.eye(n)
        for block, _ in self.blocks(u, mu):
            inner = sla.solve(block[:, n:], -block[:, :n] @ product)
            product = inner[-n:]
        return product

    def evaluate(self, nodes, times) -> np.ndarray:
        """States at scaled times, shape (times, n)."""
        times = np.mod(np.asarray(times, float), 1.0)
        interval = np.clip(np.searchsorted(self.mesh, times, side="right") - 1, 0, self.intervals - 1)
        result = np.empty((times.size, self.n))
        for j in np.unique(interval):
            here = interval == j
            h = self.mesh[j + 1] - self.mesh[j]
            basis, _ = lagrange(self._local, (times[here] - self.mesh[j]) / h)
            result[here] = basis @ nodes[self._index(j)]
        return result

    def node_times(self) -> np.ndarray:
        """Scaled times of the nodes, shape (nodes,)."""
        h = np.diff(self.mesh)
        return (self.mesh[:-1, None] + h[:, None] * self._local[:-1]).ravel()

    def adapted_mesh(self, nodes) -> np.ndarray:
        """A mesh of as many intervals that equidistributes the local error (de Boor 1973)."""
        m, h = self.degree, np.diff(self.mesh)
        top = np.stack(
            [
                np.polynomial.polynomial.polyfit(self._local, nodes[self._index(j)], m)[-1] / h[j] ** m
                for j in range(self.intervals)
            ]
        )
        # The next derivative, from jumps of the highest one between interval middles.
        gap = 0.5 * (h + np.roll(h, -1))
        jump = np.abs(np.roll(top, -1, axis=0) - top).max(axis=1) / gap
        next_derivative = 0.5 * (jump + np.roll(jump, 1))
        density = next_derivative ** (1.0 / (m + 1))
        density = density + 0.1 * (density @ h) + 1e-12
        cumulative = np.concatenate([[0.0], np.cumsum(density * h)])
        share = np.linspace(0.0, cumulative[-1], self.intervals + 1)
        mesh = np.interp(share, cumulative, self.mesh)
        mesh[0], mesh[-1] = 0.0, 1.0
        return mesh
