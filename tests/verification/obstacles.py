"""The obstacle course of linear shell problems: deflection over the published or exact one, for any mesh and element.

Sources: MacNeal & Harder (1985), Finite Elem. Anal. Des. 1, 3-20 (beams, roof, hemisphere); Cook (1974), J. Struct.
Div. ASCE 100, 1851-1863 (tapered panel; limit 23.965 of fine meshes); Belytschko et al. (1985), Comput. Methods Appl.
Mech. Eng. 51, 221-258 (cylinder with diaphragms, twisted beam thin); Simo, Fox & Rifai (1989), same journal 73, 53-92
(hemisphere, 0.0930).
"""

from __future__ import annotations

import numpy as np
from scipy.sparse.linalg import spsolve

from dbvfiv.shell import Shell, ShellMesh
from dbvfiv.shell.reference import SHAPE
from tests.shell.structures import Grid, grid, isotropic_section


def skewed(n: int):
    """Map of the unit square to itself: spacings 1:2:...:n along each side, in turn about the square."""
    grow = np.concatenate([[0.0], np.cumsum(np.arange(1.0, n + 1))]) / (n * (n + 1) / 2)

    def place(u, v):
        t = np.linspace(0, 1, n + 1)
        up, down = (lambda w: np.interp(w, t, grow)), (lambda w: np.interp(w, t, 1 - grow[::-1]))
        return (1 - v) * up(u) + v * down(u), (1 - u) * down(v) + u * up(v)

    return place


def regular(u, v):
    return u, v


def build(patch: Grid, wall, free, element, **options) -> Shell:
    mesh = ShellMesh.build(patch.nodes, patch.quads, options.pop("h"), **options)
    return Shell(mesh, wall, free, element=element)


def solved(shell: Shell, load: np.ndarray) -> np.ndarray:
    """Nodal unknowns (nn, c) of the linear answer to nodal forces (nn, 5)."""
    data = shell.force_and_tangent(np.zeros(shell.size))[1]
    return shell.dofs.expand(spsolve(shell.dofs.matrix(data).tocsc(), shell.dofs.restrict(load)))


def all_free(patch: Grid) -> np.ndarray:
    return np.ones((len(patch.nodes), 5), bool)


def edge_load(patch: Grid, line: np.ndarray, direction: int, total: float) -> np.ndarray:
    """Consistent forces (nn, 5) of an even load on a line of nodes."""
    load = np.zeros((len(patch.nodes), 5))
    length = np.linalg.norm(np.diff(patch.nodes[line], axis=0), axis=1)
    share = total * length / length.sum()
    np.add.at(load[:, direction], line[:-1], 0.5 * share)
    np.add.at(load[:, direction], line[1:], 0.5 * share)
    return load


def beam_patch(shape: str, nx: int = 6, ny: int = 1) -> Grid:
    """6 x 0.2 strip of rectangles, trapezoids or parallelograms of 45 degrees between upright ends."""

    def place(u, v):
        x, y = 6.0 * u, 0.2 * v
        inner = (u > 1e-9) & (u < 1 - 1e-9)
        lean = {"rectangles": 0 * u, "parallelograms": 0 * u + 1, "trapezoids": (-1.0) ** np.round(u * nx)}[shape]
        return x + np.where(inner, lean * (y - 0.1), 0.0), y, 0 * u

    return grid(nx, ny, place)


#: Young's modulus, Poisson's ratio and thickness of the straight beam, and its deflection in its plane and across.
BEAM, BEAM_DEFLECTION = (1e7, 0.3, 0.1), {1: 0.1081, 2: 0.4321}


def straight_beam(element: str, shape: str, nx: int = 6, ny: int = 1, load: int = 1) -> float:
    """6 x 0.2 x 0.1 cantilever, end force in its plane (load 1) or across (2)."""
    patch = beam_patch(shape, nx, ny)
    free = all_free(patch)
    free[patch.index[0]] = False
    shell = build(patch, isotropic_section(*BEAM), free, element, h=BEAM[2], material_axis=(1.0, 0, 0))
    tip = solved(shell, edge_load(patch, patch.index[-1], load, 1.0))[patch.index[-1], load].mean()
    return tip / BEAM_DEFLECTION[load]


def bending_energy(element: str, lean: tuple[float, float]) -> float:
    """Energy of one element 1 x 0.2, its sides leaning by x over y, bent to a circle in its plane at its nodes, over
    that of beam theory.
    """
    width, e, nu, h = 0.2, 1e7, 0.3, 0.1

    def place(u, v):
        y = width * (v - 0.5)
        return u + (lean[0] * (1 - u) + lean[1] * u) * y, y, 0 * u

    patch = grid(1, 1, place)
    shell = build(patch, isotropic_section(e, nu, h), all_free(patch), element, h=h, material_axis=(1.0, 0, 0))
    x, y = patch.nodes[:, 0], patch.nodes[:, 1]
    bent = np.zeros((4, 5))
    bent[:, 0], bent[:, 1] = x * y, -0.5 * (x**2 + nu * y**2)
    q = shell.dofs.restrict(bent)
    energy = 0.5 * q @ shell.dofs.matrix(shell.force_and_tangent(np.zeros(shell.size))[1]) @ q
    return energy / (0.5 * e * h * width**3 / 12)


def cook(element: str, n: int, angle: float = 0.0) -> float:
    """Tapered panel under an end shear: deflection of the loaded edge's middle; n even."""

    def place(u, v):
        low, high = 44.0 * u, 44.0 + 16.0 * u
        return 48.0 * u, low + v * (high - low), 0 * u

    patch = grid(n, n, place)
    free = all_free(patch)
    free[patch.index[0]] = False
    free[:, 2:5] = False
    shell = build(patch, isotropic_section(1.0, 1 / 3, 1.0), free, element, h=1.0, material_axis=(1.0, angle, 0))
    return solved(shell, edge_load(patch, patch.index[-1], 1, 1.0))[patch.index[-1, n // 2], 1] / 23.965


def pinched_cylinder(element: str, n: int, distort=regular) -> float:
    """Octant of a cylinder on end diaphragms, R 300, L 600, h 3, under two opposed forces 1."""

    def place(u, v):
        u, v = distort(u, v)
        return 300 * np.sin(0.5 * np.pi * u), 300 * v, 300 * np.cos(0.5 * np.pi * u)

    patch = grid(n, n, place)
    top, side, middle, end = patch.index[0], patch.index[-1], patch.index[:, 0], patch.index[:, -1]
    directors = patch.nodes * [1, 0, 1] / 300.0
    patch.quads[:] = patch.quads[:, ::-1]
    free = all_free(patch)
    mesh = {"h": 3.0, "material_axis": (0.0, 1.0, 0.0), "directors": directors}
    # frames: first along the axis, second around
    free[np.ix_(end, [0, 2])] = False
    free[np.ix_(top, [0, 4])] = False
    free[np.ix_(side, [2, 4])] = False
    free[np.ix_(middle, [1, 3])] = False
    shell = build(patch, isotropic_section(3e6, 0.3, 3.0), free, element, **mesh)
    load = np.zeros((len(patch.nodes), 5))
    load[patch.index[0, 0], 2] = -0.25
    return -solved(shell, load)[patch.index[0, 0], 2] / 1.82488e-5


def quarter_hemisphere(element: str, n: int, distort=regular) -> tuple[Shell, Grid]:
    """Quarter of a hemisphere with an 18 degree hole, R 10, h 0.04, between the planes y = 0 and x = 0."""

    def place(u, v):
        u, v = distort(u, v)
        height, turn = np.radians(72.0) * v, 0.5 * np.pi * u
        return 10 * np.cos(height) * np.cos(turn), 10 * np.cos(height) * np.sin(turn), 10 * np.sin(height)

    patch = grid(n, n, place)
    front, back = patch.index[0], patch.index[-1]
    free = all_free(patch)
    free[np.ix_(front, [1, 4])] = False
    free[np.ix_(back, [0, 4])] = False
    free[patch.index[0, 0], 2] = False  # one height, against the rigid motion that is left
    section = isotropic_section(6.825e7, 0.3, 0.04)
    return build(patch, section, free, element, h=0.04, directors=patch.nodes / 10.0), patch


def hemisphere(element: str, n: int, distort=regular) -> float:
    """The quarter under forces 1 in and out at the equator."""
    shell, patch = quarter_hemisphere(element, n, distort)
    load = np.zeros((len(patch.nodes), 5))
    load[patch.index[0, 0], 0], load[patch.index[-1, 0], 1] = 1.0, -1.0
    return solved(shell, load)[patch.index[0, 0], 0] / 0.0930


def roof(element: str, n: int, distort=regular) -> float:
    """Quarter of the Scordelis-Lo roof under its weight: deflection of the free edge's middle."""

    def place(u, v):
        u, v = distort(u, v)
        angle = np.radians(40.0) * u
        return 25 * np.sin(angle), 25 * v, 25 * np.cos(angle)

    patch = grid(n, n, place)
    crown, middle, end = patch.index[0], patch.index[:, 0], patch.index[:, -1]
    directors = patch.nodes * [1, 0, 1] / 25.0
    patch.quads[:] = patch.quads[:, ::-1]
    free = all_free(patch)
    free[np.ix_(end, [0, 2])] = False
    free[np.ix_(crown, [0, 4])] = False
    free[np.ix_(middle, [1, 3])] = False
    section = isotropic_section(4.32e8, 0.0, 0.25)
    shell = build(patch, section, free, element, h=0.25, material_axis=(0.0, 1.0, 0.0), directors=directors)
    load = np.zeros((len(patch.nodes), 5))
    np.add.at(load[:, 2], patch.quads, -90.0 * shell.geometry.area @ SHAPE)
    return -solved(shell, load)[patch.index[-1, 0], 2] / 0.3024


def twisted_beam(element: str, nx: int, ny: int, h: float = 0.32, load: int = 1) -> float:
    """Beam 12 x 1.1 twisted by 90 degrees under an end force 1 along its width (load 1) or across (2) at the end."""

    def place(u, v):
        angle, y = 0.5 * np.pi * u, 1.1 * (v - 0.5)
        return 12.0 * u, y * np.cos(angle), y * np.sin(angle)

    patch = grid(nx, ny, place)
    free = all_free(patch)
    free[patch.index[0]] = False
    shell = build(patch, isotropic_section(29e6, 0.22, h), free, element, h=h, material_axis=(1.0, 0, 0))
    direction = {1: 2, 2: 1}[load]  # the end has turned: its width lies along z
    force = 1.0 if h > 0.1 else 1e-6
    tip = solved(shell, edge_load(patch, patch.index[-1], direction, force))[patch.index[-1], direction].mean()
    return tip / {(0.32, 1): 0.005424, (0.32, 2): 0.001754, (0.0032, 1): 0.005256, (0.0032, 2): 0.001294}[(h, load)]
