"""The wall of the valve as a solid of 20-node hexahedra on FElupe: what the shell is held against in three dimensions.

The solid fills the wall of a shell: nodes on the shell's mid-surface, moved along its directors. 2 x 2 x 2 integration
keeps the elements free of shear and volumetric locking; energies are differentiated by JAX (`layered_solid`). It exists
only where half the wall is below the radius of the mid-surface.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property

import felupe as fem
import jax
import jax.numpy as jnp
import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import eigsh

from dbvfiv.geometry.divisions import grading
from dbvfiv.geometry.surface import surface_of
from dbvfiv.materials.laws import IsotropicElastic
from dbvfiv.model import ValveModel
from dbvfiv.studies.case import thesis_case
from tests.verification import layered_solid
from tests.verification.test_modal_valve import ISOTROPIC

#: Corner and mid-edge nodes of a hexahedron in the grid of half elements.
_NODES = np.array(
    [(0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0), (0, 0, 2), (2, 0, 2), (2, 2, 2), (0, 2, 2)]
    + [(1, 0, 0), (2, 1, 0), (1, 2, 0), (0, 1, 0), (1, 0, 2), (2, 1, 2), (1, 2, 2), (0, 1, 2)]
    + [(0, 0, 1), (2, 0, 1), (2, 2, 1), (0, 2, 1)]
)
#: Corners at the ends of the edges of nodes 8 to 19.
_EDGES = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)]
#: Nodes of the faces inside and outside; both turn the same way.
_INSIDE, _OUTSIDE = [0, 1, 2, 3, 8, 9, 10, 11], [4, 5, 6, 7, 12, 13, 14, 15]


class FoldedWallError(ValueError):
    """The faces of the wall fold over themselves, so no solid has this shape."""


def valve_model(around: int, along: int, factor: float, changes=ISOTROPIC, **more) -> ValveModel:
    """The 12-inch valve with a wall of `factor` times the uniform 14.38 mm."""
    wall = {"valve.wall": "uniform", "valve.thickness_factor": factor, "drive.unloaded_edge": 0.0}
    return ValveModel(thesis_case({"mesh.around": around, "mesh.along": along} | wall | changes | more))


@dataclass
class SolidWall:
    """A wall filled with hexahedra.

    Parameters
    ----------
    model : ValveModel
        On twice the elements in both directions: its nodes are corners and mid-edges of the solid's.
    through : int
        Elements through each layer.
    """

    model: ValveModel
    through: int = 1

    def __post_init__(self):
        surface, rows = self.model.shell.mesh, self.model.mesh.rows
        section = self.model.shell.section
        self.thickness = float(surface.thickness[0])
        ends = np.concatenate([[0.0], np.cumsum(section.fractions)]) - 0.5
        cuts = np.concatenate([np.linspace(a, b, 2 * self.through + 1)[:-1] for a, b in zip(ends[:-1], ends[1:])])
        self.levels = np.append(cuts, 0.5) * self.thickness
        self.normals = _normals(self.model)
        place = surface.nodes[rows][:, :, None] + self.levels[:, None] * self.normals[rows][:, :, None]
        grid = np.arange(place[..., 0].size).reshape(place.shape[:3])
        # along z, around, through the wall: right-handed
        starts = [np.arange(0, n - 1, 2) for n in grid.shape]
        base = np.stack(np.meshgrid(*starts, indexing="ij"), axis=-1).reshape(-1, 3)
        index = base[:, None] + _NODES
        cells = grid[tuple(np.moveaxis(index, -1, 0))]
        used, numbers = np.unique(cells, return_inverse=True)
        cells = numbers.reshape(cells.shape)
        self._grid, self._used = grid, used
        self.points = place.reshape(-1, 3)[used]
        self._level = np.tile(np.arange(len(self.levels)), grid.shape[0] * grid.shape[1])[used]
        self._node = np.repeat(rows.ravel(), len(self.levels))[used]
        mesh = fem.Mesh(self.points, cells, cell_type="hexahedron20")
        self.region = fem.RegionQuadraticHexahedron(mesh, quadrature=fem.GaussLegendre(order=1, dim=3))
        corners = _corner_volumes(self.points[cells])
        if not np.all(corners > 0):
            bad = np.flatnonzero((corners <= 0).any(axis=1))
            where = 1e3 * self.points[cells[bad]].mean(axis=1)
            raise FoldedWallError(
                f"the wall folds over itself in {len(bad)} of {len(cells)} elements, z {where[:, 2].min():.0f} to "
                f"{where[:, 2].max():.0f} mm, x from {where[:, 0].min():.0f} mm"
            )
        self.field = fem.FieldContainer([fem.Field(self.region, dim=3)])
        self.cells = cells
        layer = base[:, 2] // (2 * self.through)
        self.density = np.array([item.law.density for item in section.layers])[layer]
        self.body = layered_solid.body_of(self.field, np.tile(self._parameters(layer, base), (8, 1)))
        self._solved = layered_solid.Solver()

    def _parameters(self, layer, base):
        """(ne, 49) constants; material axes follow the surface."""
        table = np.array([_constants(item) for item in self.model.shell.section.layers])[layer]
        rows = self.model.mesh.rows
        node = rows[base[:, 0] + 1, base[:, 1] + 1]
        normal = self.normals[node]
        along = np.array([0.0, 0.0, 1.0]) - normal[:, 2:] * normal
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        axes = np.stack([along, np.cross(normal, along), normal], axis=1)
        turn = np.einsum("eij,ejk->eik", table[:, 40:].reshape(-1, 3, 3), axes)
        return np.concatenate([table[:, :40], turn.reshape(-1, 9)], axis=1)

    @cached_property
    def free(self) -> np.ndarray:
        """Numbers of the unknowns that are free: clamped at the flange, symmetric about x = 0 and y = 0."""
        held = np.zeros((len(self.points), 3), bool)
        rows = self.model.mesh.rows
        held[np.isin(self._node, rows[-1])] = True
        held[np.isin(self._node, rows[:, 0]), 0] = True
        held[np.isin(self._node, rows[:, -1]), 1] = True
        return np.flatnonzero(~held.ravel())

    def frequencies(self, count: int = 4) -> np.ndarray:
        """Lowest frequencies at rest in vacuo, of motions symmetric about both planes, Hz."""
        stiffness = sp.csc_matrix(self.body.assemble.matrix(self.field))[self.free][:, self.free]
        region = fem.RegionQuadraticHexahedron(self.region.mesh, quadrature=fem.GaussLegendre(order=2, dim=3))
        weight = self.density * region.dV  # (points, cells)
        shape = region.h[..., 0] if region.h.ndim == 3 else region.h  # (nodes, points)
        block = np.einsum("aq,bq,qc->cab", shape, shape, weight)
        rows, columns = (
            np.broadcast_to(self.cells[:, i, j], block.shape) for i, j in (((slice(None)), None), (None, slice(None)))
        )
        scalar = sp.coo_matrix((block.ravel(), (rows.ravel(), columns.ravel()))).tocsr()
        mass = sp.kron(scalar, sp.eye(3)).tocsc()[self.free][:, self.free]
        values = eigsh(stiffness, count, mass, sigma=0, return_eigenvectors=False)
        return np.sqrt(np.sort(values)) / (2 * np.pi)

    def middle(self, u: np.ndarray) -> np.ndarray:
        """Displacements (rows, columns, 3) halfway through the wall at the corners of the elements, the mean of both
        faces.
        """
        full = np.full((self._grid.size, 3), np.nan)
        full[self._used] = u
        field = full[self._grid][::2, ::2]
        return 0.5 * (field[:, :, 0] + field[:, :, -1])

    def solve(self, z: np.ndarray, pressure: np.ndarray, inside: float = 1.0) -> np.ndarray:
        """Displacements (points, 3) under pressures (m,) at places z (m,) at rest, the share `inside` of them on the
        inner face and the rest pulling at the outer one; from rest by load steps that halve where Newton fails.
        """
        faces = self._faces(inside)
        u = self.field[0].values
        u[:] = 0.0
        reached, step, known, before = 0.0, 0.1, u.copy(), np.zeros_like(u)
        while reached < 1.0:
            share = min(1.0, reached + step)
            u[:] = known + before * (share - reached)
            if self._equilibrium(faces, z, share * pressure, u):
                before = (u - known) / (share - reached)
                known, reached, step = u.copy(), share, 1.5 * step
            else:
                step *= 0.5
                if step < 1e-3:
                    raise RuntimeError(f"the solid wall found no equilibrium beyond {reached:.3f} of the pressure")
        return known

    def respond(self, pressure: float, inside: float = 1.0) -> np.ndarray:
        """Displacements (points, 3) under a small uniform pressure, the share `inside` of it on the inner face and the
        rest pulling at the outer one: one linear step from rest.
        """
        u = self.field[0].values
        u[:] = 0.0
        z = self.model.mesh.z[[0, -1]]
        force, _ = self._pressed(self._faces(inside), z, np.full(2, pressure), u)
        matrix = sp.csr_matrix(self.body.assemble.matrix(self.field))[self.free][:, self.free]
        u.reshape(-1)[self.free] = self._solved(matrix, force[self.free])
        return u.copy()

    def _faces(self, inside: float):
        """Nodes (k, 8) of both faces and their shares of the pressure."""
        count = len(self.levels) // 2  # elements through
        layer = np.arange(len(self.cells)) % count
        return [
            (self.cells[layer == 0][:, _INSIDE], inside),
            (self.cells[layer == count - 1][:, _OUTSIDE], 1.0 - inside),
        ]

    def _equilibrium(self, faces, z, pressure, u) -> bool:
        """Newton from `u`, which it changes; whether it converged."""
        for _ in range(12):
            force, stiffness = self._pressed(faces, z, pressure, u)
            residual = self.body.assemble.vector(self.field).toarray().ravel() - force
            size = np.linalg.norm(residual[self.free])
            if not np.isfinite(size) or size > 1e4 * np.linalg.norm(force):
                return False
            if size < 1e-7 * np.linalg.norm(force):
                return True
            matrix = sp.csr_matrix(self.body.assemble.matrix(self.field) - stiffness)[self.free][:, self.free]
            step = np.zeros(u.size)
            step[self.free] = self._solved(matrix, residual[self.free])
            u -= step.reshape(u.shape)
        return False

    def _pressed(self, faces, z, pressure, u):
        """Forces (n,) of the pressures and their stiffness (n, n)."""
        force, size = np.zeros(u.size), u.size
        rows, columns, values = [], [], []
        for nodes, share in faces:
            if share == 0.0:
                continue
            index = (3 * nodes[..., None] + np.arange(3)).reshape(len(nodes), -1)
            at = np.interp(self.points[nodes][..., 2] @ _serendipity()[0].T, z, pressure) * share
            here = jnp.asarray((self.points + u)[nodes])
            np.add.at(force, index, np.asarray(_push(here, at)).reshape(len(nodes), -1))
            slope = np.asarray(_push_slope(here, at)).reshape(len(nodes), 24, 24)
            rows.append(np.broadcast_to(index[:, :, None], slope.shape).ravel())
            columns.append(np.broadcast_to(index[:, None, :], slope.shape).ravel())
            values.append(slope.ravel())
        entries = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
        return force, sp.coo_matrix(entries, shape=(size, size)).tocsr()


def _normals(model: ValveModel) -> np.ndarray:
    """(nn, 3) normals of the true mid-surface at the nodes, at joints the mean of both sides; those averaged over
    elements, which are the shell's directors, are off by a quarter of the turn of an element where a bend begins.
    """
    surface, mesh = surface_of(model.case.valve), model.mesh
    s = grading(mesh.columns, model.case.mesh.grading)
    step, low, high = 1e-6, mesh.z[0], mesh.z[-1]
    total = np.zeros((*mesh.rows.shape, 3))
    for k, z in enumerate(mesh.z):
        wide = step * (high - low)
        for a, b in ((z - wide, z), (z, z + wide)):
            if a < low or b > high:
                continue
            along = surface.section(b, s) - surface.section(a, s)
            for left, right in ((np.maximum(s - step, 0.0), s), (s, np.minimum(s + step, 1.0))):
                across = surface.section(z, right) - surface.section(z, left)
                normal = np.cross(along, across)
                size = np.linalg.norm(normal, axis=1, keepdims=True)
                total[k] += np.where(size > 0, normal / np.where(size > 0, size, 1.0), 0.0)
    total[:, 0, 0] = 0.0
    total[:, -1, 1] = 0.0
    total /= np.linalg.norm(total, axis=2, keepdims=True)
    normals = np.empty((mesh.rows.size, 3))
    normals[mesh.rows] = total
    return normals


def _corner_volumes(x: np.ndarray) -> np.ndarray:
    """(ne, 8) Jacobians at the corners of hexahedra with nodes (ne, 20, 3), from their 20 nodes."""
    corner = np.array(
        [(-1, -1, -1), (1, -1, -1), (1, 1, -1), (-1, 1, -1), (-1, -1, 1), (1, -1, 1), (1, 1, 1), (-1, 1, 1)]
    )
    ends = {(a, b): 8 + k for k, (a, b) in enumerate(_EDGES)}
    found = []
    for i in range(8):
        slopes = []
        for axis in range(3):
            j = int(np.flatnonzero((corner == corner[i] * np.where(np.arange(3) == axis, -1, 1)).all(axis=1))[0])
            middle = ends.get((i, j), ends.get((j, i)))
            slopes.append((-1.5 * x[:, i] + 2.0 * x[:, middle] - 0.5 * x[:, j]) * -corner[i, axis])
        found.append(np.einsum("ei,ei->e", np.cross(slopes[0], slopes[1]), slopes[2]))
    return np.stack(found, axis=1)


def _constants(layer) -> np.ndarray:
    """`layered_solid.parameters_of`, and those of an isotropic St Venant-Kirchhoff material."""
    law = layer.law
    if not isinstance(law, IsotropicElastic):
        return layered_solid.parameters_of(layer)
    e, nu, out = law.youngs_modulus, law.poisson_ratio, np.zeros(49)
    s = np.diag([1 / e] * 3 + [2 * (1 + nu) / e] * 3)
    s[:3, :3] -= nu / e * (1 - np.eye(3))
    out[4:40] = np.linalg.inv(s).ravel()
    out[40:] = np.eye(3).ravel()
    return out


@cache
def _serendipity():
    """Shape functions (9, 8) and slopes (9, 8, 2) of the 8-node face at 3 x 3 Gauss points, and their weights."""
    g, w = np.polynomial.legendre.leggauss(3)
    corner = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], float)
    edge = np.array([[0, -1], [1, 0], [0, 1], [-1, 0]], float)

    def functions(x):
        a, b = x
        c = 0.25 * (1 + corner[:, 0] * a) * (1 + corner[:, 1] * b) * (corner[:, 0] * a + corner[:, 1] * b - 1)
        m = jnp.where(edge[:, 0] == 0, 0.5 * (1 - a**2) * (1 + edge[:, 1] * b), 0.5 * (1 - b**2) * (1 + edge[:, 0] * a))
        return jnp.concatenate([jnp.asarray(c), m])

    with jax.ensure_compile_time_eval():
        points = jnp.asarray([(a, b) for a in g for b in g])
        return jax.vmap(functions)(points), jax.vmap(jax.jacfwd(functions))(points), np.outer(w, w).ravel()


def _push_one(x, pressure):
    """Forces (8, 3) of pressures (9,) on a face with nodes (8, 3); towards the outside of the valve."""
    shape, slope, weight = _serendipity()
    first, second = jnp.einsum("qa,ai->qi", slope[..., 0], x), jnp.einsum("qa,ai->qi", slope[..., 1], x)
    return jnp.einsum("q,q,qa,qi->ai", weight, pressure, shape, jnp.cross(first, second))


_push = jax.jit(jax.vmap(_push_one))
_push_slope = jax.jit(jax.vmap(jax.jacfwd(_push_one)))
