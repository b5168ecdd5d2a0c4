"""Meshes and a small static solver for shells that are not valves; shared by the tests of the shell and the
verification cases.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.sparse.linalg import eigsh

from dbvfiv.materials.laws import IsotropicElastic, OrthotropicPly
from dbvfiv.materials.shipped import published_rubber
from dbvfiv.shell import Layer, Section, Shell, ShellMesh
from dbvfiv.shell.pressure import pressure_force, pressure_stiffness
from eigen.factor import DirectFactor


@dataclass(frozen=True)
class Grid:
    """A structured patch of nx by ny elements.

    Attributes
    ----------
    nodes : (nn, 3) array
    quads : (ne, 4) array
    index : (nx + 1, ny + 1) array
        Node numbers.
    """

    nodes: np.ndarray
    quads: np.ndarray
    index: np.ndarray


def grid(nx: int, ny: int, place: Callable[[np.ndarray, np.ndarray], tuple] | None = None) -> Grid:
    """Patch over the unit square, placed in space by `place(u, v) -> x, y, z`."""
    u, v = np.meshgrid(np.linspace(0, 1, nx + 1), np.linspace(0, 1, ny + 1), indexing="ij")
    xyz = (u, v, np.zeros_like(u)) if place is None else place(u, v)
    nodes = np.stack([np.broadcast_to(c, u.shape) for c in xyz], axis=-1).reshape(-1, 3).astype(float)
    index = np.arange(nodes.shape[0]).reshape(nx + 1, ny + 1)
    quads = np.stack([index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]], axis=-1).reshape(-1, 4)
    return Grid(nodes, quads, index)


def rectangle(nx: int, ny: int, length: float, width: float) -> Grid:
    return grid(nx, ny, lambda u, v: (length * u, width * v, 0 * u))


#: A quadrilateral without any symmetry.
CORNERS = np.array([[0.0, 0.0], [1.1, 0.1], [1.3, 0.9], [0.2, 0.7]])


def single_element(corners=CORNERS) -> ShellMesh:
    """One flat element."""
    nodes = np.column_stack([corners, np.zeros(4)])
    return ShellMesh.build(nodes, np.array([[0, 1, 2, 3]]), 0.01, material_axis=(1.0, 0.3, 0.0))


def distorted_plate() -> tuple[ShellMesh, np.ndarray]:
    """Flat patch of 4 x 3 distorted elements and the nodes that lie inside."""
    patch = rectangle(4, 3, 1.0, 0.6)
    inner = patch.index[1:-1, 1:-1].ravel()
    patch.nodes[inner, :2] += np.random.default_rng(3).uniform(-0.06, 0.06, (len(inner), 2))
    return ShellMesh.build(patch.nodes, patch.quads, 0.01, material_axis=(1.0, 0, 0)), inner


def isotropic_section(e: float, nu: float, h: float, density: float = 1.0, shear: float = 5 / 6) -> Section:
    """One isotropic layer; two Gauss points integrate the linear law exactly."""
    return Section((Layer(IsotropicElastic(e, nu, density), h, shear_correction=shear),))


def mixed_section() -> Section:
    """Wall of the 12-inch valve: three rubbers and two fibre plies, the rubbers with different constants at every
    layer.
    """
    ply = OrthotropicPly(1.5e9, 8e6, 0.287, 5.57e6, 5.57e6, 2.94e6, 1270.0)
    return Section(
        (
            Layer(published_rubber("CR", 0.1), 6.35e-3, name="CR"),
            Layer(published_rubber("SBR", 0.2), 3.175e-3, name="SBR"),
            Layer(ply, 0.8382e-3, 54.0, 5 / 6, "ply +54"),
            Layer(ply, 0.8382e-3, -54.0, 5 / 6, "ply -54"),
            Layer(published_rubber("EPDM", 0.4), 3.175e-3, 0.0, 0.9, "EPDM"),
        )
    )


def rotation_about(axis, angle: float) -> np.ndarray:
    """Rotation matrix by Rodrigues' formula."""
    axis = np.asarray(axis, float) / np.linalg.norm(axis)
    cross = np.cross(np.eye(3), -axis)
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def rotations_to(mesh: ShellMesh, directors: np.ndarray) -> np.ndarray:
    """Rotation unknowns (nn, 2) that turn the reference directors to the given ones by the shortest way."""
    cosine = np.einsum("ni,ni->n", mesh.directors, directors)
    plane = np.einsum("nri,ni->nr", mesh.frames, directors)
    sine = np.linalg.norm(plane, axis=1)
    angle = np.arctan2(sine, cosine)
    return plane * (angle / np.where(sine > 0, sine, 1.0))[:, None]


def rigid_motion(mesh: ShellMesh, turn: np.ndarray, shift=(0.0, 0.0, 0.0)) -> np.ndarray:
    """Nodal unknowns (nn, 5) of a rigid-body motion by the rotation matrix `turn` and a translation."""
    nodal = np.zeros((mesh.node_count, 5))
    nodal[:, :3] = mesh.nodes @ turn.T - mesh.nodes + np.asarray(shift)
    nodal[:, 3:] = rotations_to(mesh, mesh.directors @ turn.T)
    return nodal


def random_state(mesh: ShellMesh, seed: int, stretch: float = 0.1, turn: float = 0.4, rigid: float = 1.2) -> np.ndarray:
    """Nodal unknowns (nn, 5): a rigid motion, and on top of it displacements and rotations random at every node.

    `stretch` is measured in the mean element size, `turn` and the `rigid` rotation in rad; nodes that are held need
    `rigid = 0`.
    """
    generator = np.random.default_rng(seed)
    size = np.sqrt(
        np.mean(np.linalg.norm(mesh.nodes[mesh.quads[:, 2]] - mesh.nodes[mesh.quads[:, 0]], axis=1) ** 2) / 2
    )
    axis = generator.standard_normal(3)
    nodal = rigid_motion(mesh, rotation_about(axis, rigid), rigid * size * generator.standard_normal(3))
    nodal[:, :3] += stretch * size * generator.uniform(-1, 1, (mesh.node_count, 3))
    nodal[:, 3:] += turn * generator.uniform(-1, 1, (mesh.node_count, 2))
    return nodal


def random_unknowns(shell: Shell, seed: int, stretch: float, turn: float) -> np.ndarray:
    """(n,) unknowns of a `random_state`."""
    return shell.dofs.restrict(random_state(shell.mesh, seed, stretch, turn))


def quarter_ring(elements: int, radius: float, width: float) -> tuple[Grid, list, np.ndarray]:
    """Quarter of a ring about z from y = 0 to x = 0, the planes that it ends on, and its free unknowns (nn, 5) where
    nothing moves along the axis, along which the first frame vector lies.
    """
    turn = 0.5 * np.pi
    patch = grid(elements, 1, lambda u, v: (radius * np.cos(turn * u), radius * np.sin(turn * u), width * v))
    front, back = patch.index[0], patch.index[-1]
    patch.nodes[front, 1] = 0.0
    patch.nodes[back, 0] = 0.0
    free = np.ones((len(patch.nodes), 5), bool)
    free[:, [2, 3]] = False  # plane strain
    free[front, 1], free[back, 0] = False, False
    free[np.concatenate([front, back]), 4] = False  # no turn of the director out of the symmetry planes
    return patch, [(front, 1), (back, 0)], free


def lowest_frequencies(shell: Shell, stiffness: np.ndarray, mass: np.ndarray, count: int, below: float = 0.0):
    """Lowest frequencies (count,), Hz, by values on a shell's pattern; squares of angular ones are above `below`."""
    stiffness, mass = (shell.dofs.matrix(values).tocsc() for values in (stiffness, mass))
    return np.sqrt(np.sort(eigsh(stiffness, count, mass, sigma=below, return_eigenvectors=False))) / (2 * np.pi)


@dataclass(frozen=True)
class Equilibrium:
    """A point of a static load path: load factor, free unknowns and Newton iterations."""

    factor: float
    q: np.ndarray
    iterations: int


def dead_load(force: np.ndarray):
    """Load of a fixed force vector (n,) times the factor."""
    return lambda q, factor: (factor * force, None)


def pressure_load(shell: Shell, pressure: float = 1.0):
    """Load of a pressure on the inside that follows the wall, times the factor."""
    mesh, loaded = shell.mesh, np.ones(shell.mesh.element_count)

    def load(q, factor):
        nodal, inside = shell.dofs.expand(q), np.full(mesh.node_count, factor * pressure)
        force, slope = np.zeros_like(nodal), np.zeros(len(shell.dofs.pattern[1]))
        pressure_force(mesh.quads, mesh.nodes, nodal, inside, loaded, force)
        pressure_stiffness(mesh.quads, mesh.nodes, nodal, inside, loaded, shell.dofs.slots, 1.0, slope)
        return shell.dofs.restrict(force), slope

    return load


def solve_path(
    shell: Shell, load, factors, start=None, tolerance: float = 1e-9, smallest: float = 1e-5, iterations: int = 25
):
    """Equilibria (list) at increasing load factors by full Newton steps, halving a load step that fails.

    Parameters
    ----------
    load : callable
        `load(q, factor)` returns the external force (n,) and, or None, the values of its derivative on the pattern of
        the shell.
    """
    solver = DirectFactor(*shell.dofs.pattern)
    q = np.zeros(shell.size) if start is None else start.copy()
    done, rate, found = 0.0, None, []
    for target in factors:
        step = target - done
        while done < target - 1e-14:
            aim = min(done + step, target)
            trial = q.copy() if rate is None else q + (aim - done) * rate
            count = _newton(shell, load, solver, trial, aim, tolerance, iterations)
            if count is None:
                step /= 2
                if step < smallest:
                    raise RuntimeError(f"no equilibrium beyond the load factor {done:g}")
                continue
            rate = (trial - q) / (aim - done)
            q, done, step = trial, aim, 2 * step
        found.append(Equilibrium(target, q.copy(), count))
    return found


def _newton(shell, load, solver, q, factor, tolerance, iterations):
    rounding = 0.0
    for iteration in range(iterations):
        force, data = shell.force_and_tangent(q)
        if not rounding:  # what rounding of the positions alone leaves
            place = shell.dofs.expand(np.abs(q))
            place[:, :3] += np.abs(shell.mesh.nodes)
            rounding = np.finfo(float).eps * np.linalg.norm(
                shell.dofs.matrix(np.abs(data)) @ shell.dofs.restrict(place)
            )
        external, slope = load(q, factor)
        residual = force - external
        norm = np.linalg.norm(residual)
        if not np.isfinite(norm) or norm > 1e12 * np.linalg.norm(external):
            return None
        if norm <= max(tolerance * np.linalg.norm(external), rounding):
            return iteration
        solver.values[:] = data if slope is None else data - slope
        solver.refactor()
        step = solver.solve(residual)
        if not np.isfinite(step).all():
            return None
        q -= step
    return None


def observed_order(errors, ratio: float = 2.0) -> list[float]:
    """Orders of convergence between neighbours in a list of errors on meshes refined by `ratio`."""
    errors = np.abs(errors)
    return [float(np.log(a / b) / np.log(ratio)) for a, b in zip(errors[:-1], errors[1:])]


def richardson(values, ratio: float = 2.0) -> tuple[float, float]:
    """Observed order and extrapolated limit of three values on meshes refined by `ratio`."""
    a, b, c = values[-3:]
    order = float(np.log(abs((a - b) / (b - c))) / np.log(ratio))
    return order, float(c + (c - b) / (ratio**order - 1))
