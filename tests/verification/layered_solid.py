"""A layered solid of 20-node hexahedra on FElupe: the independent reference of the three-point bending case.

Nearly incompressible Mooney-Rivlin rubber and orthotropic St Venant-Kirchhoff plies, energies differentiated by JAX; 2
x 2 x 2 integration keeps the elements free of shear and volumetric locking.
"""

from __future__ import annotations

from dataclasses import dataclass

import felupe as fem
import jax
import jax.numpy as jnp
import numpy as np
import scipy.sparse as sp

from dbvfiv.materials.laws import MooneyRivlin
from eigen.factor import DirectFactor

BULK_RATIO = 1000.0  # bulk over shear modulus of rubber


def _rubber(parameters, f):
    c10, c01, c11, bulk = parameters[:4]
    j = jnp.linalg.det(f)
    c = f.T @ f
    i1 = jnp.trace(c)
    i2 = 0.5 * (i1**2 - jnp.trace(c @ c))
    a, b = i1 * j ** (-2 / 3) - 3, i2 * j ** (-4 / 3) - 3
    return c10 * a + c01 * b + c11 * a * b + 0.5 * bulk * (j - 1) ** 2


def _ply(parameters, f):
    stiffness, turn = parameters[4:40].reshape(6, 6), parameters[40:49].reshape(3, 3)
    e = turn @ (0.5 * (f.T @ f - jnp.eye(3))) @ turn.T
    v = jnp.stack([e[0, 0], e[1, 1], e[2, 2], 2 * e[1, 2], 2 * e[0, 2], 2 * e[0, 1]])
    return 0.5 * v @ stiffness @ v


def _energy(parameters, f):
    return jnp.where(parameters[3] > 0, _rubber(parameters, f), _ply(parameters, f))


_stress = jax.jit(jax.vmap(jax.grad(_energy, argnums=1)))
_tangent = jax.jit(jax.vmap(jax.hessian(_energy, argnums=1)))


def parameters_of(layer) -> np.ndarray:
    """(49,) constants of a shell layer's law in three dimensions."""
    law, out = layer.law, np.zeros(49)
    if isinstance(law, MooneyRivlin):
        out[:4] = law.c10, law.c01, law.c11, BULK_RATIO * 2 * (law.c10 + law.c01)
        return out
    # transversely isotropic about the fibre: E3 = E2, nu13 = nu12, nu23 from G23
    nu23 = law.e2 / (2 * law.g23) - 1
    s = np.zeros((6, 6))
    s[0, 0], s[1, 1], s[2, 2] = 1 / law.e1, 1 / law.e2, 1 / law.e2
    s[0, 1] = s[1, 0] = s[0, 2] = s[2, 0] = -law.nu12 / law.e1
    s[1, 2] = s[2, 1] = -nu23 / law.e2
    s[3, 3], s[4, 4], s[5, 5] = 1 / law.g23, 1 / law.g13, 1 / law.g12
    out[4:40] = np.linalg.inv(s).ravel()
    c, k = np.cos(np.radians(layer.angle)), np.sin(np.radians(layer.angle))
    out[40:49] = np.array([[c, k, 0], [-k, c, 0], [0, 0, 1.0]]).ravel()
    return out


def body_of(field: fem.FieldContainer, parameters: np.ndarray) -> fem.SolidBody:
    """A body with constants (k, 49), quadrature point first, as FElupe orders its fields."""
    parameters = jnp.asarray(parameters)

    def flat(f):
        return jnp.asarray(np.moveaxis(f, (2, 3), (0, 1)).reshape(-1, 3, 3))

    def stress(x):
        p = np.asarray(_stress(parameters, flat(x[0]))).reshape(*x[0].shape[2:], 3, 3)
        return [np.ascontiguousarray(np.moveaxis(p, (0, 1), (2, 3))), x[-1]]

    def tangent(x):
        a = np.asarray(_tangent(parameters, flat(x[0]))).reshape(*x[0].shape[2:], 3, 3, 3, 3)
        return [np.ascontiguousarray(np.moveaxis(a, (0, 1), (4, 5)))]

    return fem.SolidBody(fem.Material(stress, tangent), field)


class Solver:
    """Solutions of systems, one after another, most of which have the pattern of the one before."""

    factor: DirectFactor | None = None

    def __call__(self, matrix: sp.csr_matrix, right: np.ndarray) -> np.ndarray:
        matrix.sort_indices()
        if self.factor is None or len(self.factor.values) != matrix.nnz:
            self.factor = DirectFactor(matrix.indptr.astype(np.int32), matrix.indices.astype(np.int32))
        self.factor.values[:] = matrix.data
        self.factor.refactor()
        return self.factor.solve(right)


@dataclass
class LayeredSolid:
    """Box of layers, bottom to top.

    Parameters
    ----------
    layers : sequence of shell layers
    x, y : arrays
        Element boundaries.
    per_layer : int
        Elements through each layer.
    """

    layers: tuple
    x: np.ndarray
    y: np.ndarray
    per_layer: int = 1

    def __post_init__(self):
        faces = np.concatenate([[0.0], np.cumsum([layer.thickness for layer in self.layers])])
        z = np.concatenate(
            [np.linspace(a, b, self.per_layer + 1)[:-1] for a, b in zip(faces[:-1], faces[1:])] + [faces[-1:]]
        )
        shape = (len(self.x), len(self.y), len(z))
        box = fem.Cube(n=shape)
        box.points[:] = np.stack(
            [g[i] for g, i in zip((self.x, self.y, z), np.rint(box.points * (np.array(shape) - 1)).astype(int).T)],
            axis=1,
        )
        mesh = box.convert(order=2, calc_points=True)
        quadrature = fem.GaussLegendre(order=1, dim=3)
        self.region = fem.RegionQuadraticHexahedron(mesh, quadrature=quadrature)
        self.field = fem.FieldContainer([fem.Field(self.region, dim=3)])
        self.points = mesh.points
        middle = mesh.points[mesh.cells].mean(axis=1)[:, 2]
        layer = np.searchsorted(faces, middle) - 1
        count = quadrature.npoints
        table = np.array([parameters_of(item) for item in self.layers])
        self.body = body_of(self.field, np.tile(table[layer], (count, 1)))
        self._solved = Solver()

    def column_weights(self, x: float) -> np.ndarray:
        """Weights (points,), summing to one, that spread a force evenly over the section at x."""
        weights = np.zeros(len(self.points))
        cells, points = self.region.mesh.cells, self.points
        ahead = cells[np.isclose(points[cells][:, :, 0].min(axis=1), x)]
        for cell in ahead:
            face = cell[np.isclose(points[cell][:, 0], x)]
            place = points[face]
            centre = place.mean(axis=0)
            area = np.ptp(place[:, 1]) * np.ptp(place[:, 2])
            corner = np.isclose(np.abs(place - centre)[:, 1:], np.ptp(place, axis=0)[1:] / 2).all(axis=1)
            weights[face] += area * np.where(corner, -1 / 12, 1 / 3)
        return weights / weights.sum()

    def solve(self, force: np.ndarray, fixed: np.ndarray, tolerance: float = 1e-8) -> np.ndarray:
        """Displacements (points, 3) under dead forces (points, 3), from the present state on; `fixed` (points, 3) is
        true where held.
        """
        free = np.flatnonzero(~fixed.ravel())
        u = self.field[0].values
        for _ in range(30):
            residual = self.body.assemble.vector(self.field).toarray().ravel() - force.ravel()
            norm = np.linalg.norm(residual[free])
            if norm < tolerance * np.linalg.norm(force):
                return u.copy()
            matrix = sp.csr_matrix(self.body.assemble.matrix(self.field))[free][:, free]
            step = np.zeros(u.size)
            step[free] = self._solved(matrix, residual[free])
            u -= step.reshape(u.shape)
        raise RuntimeError("the layered solid found no equilibrium")
