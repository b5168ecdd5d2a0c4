"""Homogeneous states, patch tests and section stiffness against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse.linalg import spsolve

from dbvfiv.materials.laws import IsotropicElastic, MooneyRivlin, OrthotropicPly
from dbvfiv.shell import Layer, Section, Shell, ShellMesh
from dbvfiv.shell.recovery import layer_fields
from tests.shell.structures import (
    dead_load,
    distorted_plate,
    grid,
    isotropic_section,
    mixed_section,
    rectangle,
    solve_path,
)

RUBBER = MooneyRivlin(4e5, 1e5, 2e5, 1300.0)
PLY = OrthotropicPly(25e6, 1e6, 0.25, 0.5e6, 0.4e6, 0.2e6, 1270.0)


def sheet(section) -> Shell:
    """Plate of 1 m by 0.6 m in the x-y plane whose inner nodes stand off the regular places."""
    return Shell(distorted_plate()[0], section)


def homogeneous(shell: Shell, gradient) -> np.ndarray:
    """Unknowns of the plane deformation x -> F x, F given as (2, 2)."""
    nodal = np.zeros((shell.mesh.node_count, 5))
    nodal[:, :2] = shell.mesh.nodes[:, :2] @ (np.asarray(gradient) - np.eye(2)).T
    return shell.dofs.restrict(nodal)


STATES = {"uniaxial": (1.6, 1.6**-0.5), "equibiaxial": (1.4, 1.4), "pure shear": (1.5, 1.0), "compressed": (0.7, 0.9)}


@pytest.mark.parametrize("name", sorted(STATES))
def test_stretched_rubber_sheet(name):
    """Energy, nominal stress and von Mises stress of a Mooney-Rivlin membrane from its principal stretches."""
    a, b = STATES[name]
    c = 1 / (a * b)
    shell = sheet(Section((Layer(RUBBER, 0.01),)))
    q = homogeneous(shell, np.diag([a, b]))
    i1, i2 = a**2 + b**2 + c**2, a**-2 + b**-2 + c**-2
    energy = RUBBER.c10 * (i1 - 3) + RUBBER.c01 * (i2 - 3) + RUBBER.c11 * (i1 - 3) * (i2 - 3)
    assert shell.energy(q) == pytest.approx(energy * 0.6 * 0.01, rel=1e-12)
    w1, w2 = RUBBER.c10 + RUBBER.c11 * (i2 - 3), RUBBER.c01 + RUBBER.c11 * (i1 - 3)
    cauchy = np.array([2 * (s**2 - c**2) * w1 - 2 * (s**-2 - c**-2) * w2 for s in (a, b)])
    fields = layer_fields(shell, q)
    assert fields.stress[:, 0, 0] == pytest.approx(cauchy[0] / a**2, rel=1e-10)
    assert fields.stress[:, 0, 1] == pytest.approx(cauchy[1] / b**2, rel=1e-10, abs=1e-6 * abs(cauchy[0]))
    mises = np.sqrt(cauchy[0] ** 2 - cauchy[0] * cauchy[1] + cauchy[1] ** 2)
    assert fields.von_mises[:, 0] == pytest.approx(mises, rel=1e-10)
    assert fields.stretch[:, 0] == pytest.approx(np.tile(sorted((a, b)), (12, 1)), rel=1e-12)
    # the pull on one edge is the nominal stress times the cross-section
    edge = np.isclose(shell.mesh.nodes[:, 0], 1.0)
    pull = shell.dofs.expand(shell.force(q))[edge, 0].sum()
    assert pull == pytest.approx(cauchy[0] / a * 0.6 * 0.01, rel=1e-10)


def test_simple_shear_of_rubber():
    """Shear stress and normal stress differences of simple shear (Poynting effect) in plane stress."""
    k = 0.6
    shell = sheet(Section((Layer(RUBBER, 0.01),)))
    q = homogeneous(shell, [[1, k], [0, 1]])
    shear = 2 * k * (RUBBER.c10 + RUBBER.c01 + 2 * RUBBER.c11 * k**2)  # I1 - 3 = I2 - 3 = k^2
    edge = np.isclose(shell.mesh.nodes[:, 1], 0.6)
    assert shell.dofs.expand(shell.force(q))[edge, 0].sum() == pytest.approx(shear * 1.0 * 0.01, rel=1e-10)


@pytest.mark.parametrize("angle", [0.0, 30.0, 54.0, -54.0, 90.0])
def test_ply_axes(angle):
    """Strains and stresses of a stretched ply in its own axes; a positive angle turns from the material axis about the
    normal.
    """
    shell = sheet(Section((Layer(PLY, 0.01, angle),)))
    gradient = np.array([[1.05, 0.03], [0.01, 0.97]])
    green = 0.5 * (gradient.T @ gradient - np.eye(2))
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    fibre, across = np.array([c, s]), np.array([-s, c])
    strain = np.array([fibre @ green @ fibre, across @ green @ across, 2 * fibre @ green @ across])
    k = 1 - PLY.nu12**2 * PLY.e2 / PLY.e1
    stress = [
        (PLY.e1 * strain[0] + PLY.nu12 * PLY.e2 * strain[1]) / k,
        (PLY.e2 * strain[1] + PLY.nu12 * PLY.e2 * strain[0]) / k,
        PLY.g12 * strain[2],
    ]
    fields = layer_fields(shell, homogeneous(shell, gradient))
    assert np.allclose(fields.strain[:, 0, :3], strain, atol=1e-14)
    assert np.allclose(fields.stress[:, 0, :3], stress, rtol=1e-11)
    assert np.allclose(fields.strain[:, 0, 3:], 0.0, atol=1e-14)


def test_bent_layers():
    """Rolled to a cylinder of radius R, a layer at height t is strained by t/R and the stresses follow."""
    length, radius = 0.5, 0.25
    patch = rectangle(40, 1, length, 0.1)
    layers = Section((Layer(IsotropicElastic(1e6, 0.0, 1.0), 0.004), Layer(IsotropicElastic(3e6, 0.0, 1.0), 0.006)))
    shell = Shell(ShellMesh.build(patch.nodes, patch.quads, 0.01, material_axis=(1.0, 0, 0)), layers)
    phi = shell.mesh.nodes[:, 0] / radius
    nodal = np.zeros((shell.mesh.node_count, 5))
    nodal[:, 0] = radius * np.sin(phi) - shell.mesh.nodes[:, 0]
    nodal[:, 2] = radius * (1 - np.cos(phi))
    nodal[:, 3] = -phi  # the director leans back as the strip curls up
    fields = layer_fields(shell, shell.dofs.restrict(nodal))
    middle = np.array([-0.003, 0.002])
    chord = -((length / radius / 40) ** 2) / 24  # the nodes lie on the arc, the elements on its chords
    assert np.abs(fields.strain[:, :, 0] - chord + middle / radius).max() < 5e-6
    assert np.abs(fields.stress[:, :, 0] - np.array([1e6, 3e6]) * fields.strain[:, :, 0]).max() < 1e-6


def test_laminate_stiffness():
    """A, B, D and transverse shear of [0/90] and of an angle ply from the textbook sums."""
    h = np.array([0.002, 0.003])
    for angles in ((0.0, 90.0), (30.0, -45.0)):
        section = Section(tuple(Layer(PLY, t, a, 5 / 6) for t, a in zip(h, angles)))
        z = np.concatenate([[0], np.cumsum(h)]) - h.sum() / 2
        k = 1 - PLY.nu12**2 * PLY.e2 / PLY.e1
        q11, q22, q12, q66 = PLY.e1 / k, PLY.e2 / k, PLY.nu12 * PLY.e2 / k, PLY.g12
        a = np.zeros((3, 3)), np.zeros((3, 3)), np.zeros((3, 3))
        shear = np.zeros((2, 2))
        for low, high, angle in zip(z[:-1], z[1:], angles):
            c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
            bar = np.array(
                [
                    [
                        q11 * c**4 + 2 * (q12 + 2 * q66) * s**2 * c**2 + q22 * s**4,
                        (q11 + q22 - 4 * q66) * s**2 * c**2 + q12 * (s**4 + c**4),
                        (q11 - q12 - 2 * q66) * s * c**3 + (q12 - q22 + 2 * q66) * s**3 * c,
                    ],
                    [
                        0.0,
                        q11 * s**4 + 2 * (q12 + 2 * q66) * s**2 * c**2 + q22 * c**4,
                        (q11 - q12 - 2 * q66) * s**3 * c + (q12 - q22 + 2 * q66) * s * c**3,
                    ],
                    [0.0, 0.0, (q11 + q22 - 2 * q12 - 2 * q66) * s**2 * c**2 + q66 * (s**4 + c**4)],
                ]
            )
            bar = np.triu(bar) + np.triu(bar, 1).T
            for power in range(3):
                a[power][:] += bar * (high ** (power + 1) - low ** (power + 1)) / (power + 1)
            g = np.array(
                [[PLY.g13 * c**2 + PLY.g23 * s**2, (PLY.g13 - PLY.g23) * c * s], [0, PLY.g13 * s**2 + PLY.g23 * c**2]]
            )
            shear += 5 / 6 * (high - low) * (np.triu(g) + np.triu(g, 1).T)
        total = h.sum()
        unit = section.linear_stiffness
        assert np.allclose(unit[:3, :3] * total, a[0], rtol=1e-12, atol=1e-9 * a[0].max())
        assert np.allclose(unit[:3, 3:6] * total**2, a[1], rtol=1e-12, atol=1e-9 * np.abs(a[1]).max())
        assert np.allclose(unit[3:6, 3:6] * total**3, a[2], rtol=1e-12, atol=1e-9 * a[2].max())
        assert np.allclose(unit[6:, 6:] * total, shear, rtol=1e-12, atol=1e-9 * shear.max())


FIELDS = {
    "membrane": lambda x, y: (2 * x - y, 0.5 * x + 3 * y, 0 * x, 0 * x, 0 * x),
    # Kirchhoff field of constant curvature: d leans by minus the slope of w
    "bending": lambda x, y: (0 * x, 0 * x, x**2 + 0.5 * x * y - 0.7 * y**2, -(2 * x + 0.5 * y), -(0.5 * x - 1.4 * y)),
    "twist": lambda x, y: (0 * x, 0 * x, x * y, -y, -x),
    "transverse shear": lambda x, y: (0 * x, 0 * x, 0 * x, 1 + 0 * x, 2 + 0 * x),
}


@pytest.mark.parametrize("name", sorted(FIELDS))
def test_patch(name):
    """Boundary values of a field of constant strain give that field inside, whatever the shape of the elements."""
    shell = sheet(isotropic_section(1e6, 0.3, 0.01))
    x, y = shell.mesh.nodes[:, :2].T
    exact = 1e-3 * np.stack(FIELDS[name](x, y), axis=1)
    boundary = np.isclose(x, 0) | np.isclose(x, 1) | np.isclose(y, 0) | np.isclose(y, 0.6)
    held = shell.dofs.index[boundary].ravel()
    inner = np.setdiff1d(np.arange(shell.size), held)
    stiffness = shell.dofs.matrix(shell.force_and_tangent(np.zeros(shell.size))[1])
    full = exact.ravel().copy()
    full[inner] = spsolve(stiffness[inner][:, inner].tocsc(), -stiffness[inner][:, held] @ full[held])
    if (
        name == "transverse shear"
    ):  # the field of constant shear is in equilibrium only with its moments; check the strain alone
        full[inner] = exact.ravel()[inner]
    assert np.abs(full - exact.ravel()).max() < 1e-10 * np.abs(exact).max()
    strains = shell.strains(1e-4 * exact.ravel())  # small enough to be linear
    assert np.ptp(strains[..., 3:], axis=(0, 1, 2)).max() < 1e-9
    if name == "transverse shear":
        assert np.linalg.norm(strains[..., 3:], axis=-1) == pytest.approx(1e-7 * np.sqrt(5), rel=1e-6)


@pytest.mark.slow
def test_energy_is_the_work_of_the_loads():
    """Along a path of equilibria the work of the loads is the stored energy; the trapezoidal rule misses by the square
    of the step.
    """
    patch = grid(6, 3, lambda u, v: (0.4 * u, 0.2 * v, 0.05 * np.sin(2 * u)))
    free = np.ones((patch.nodes.shape[0], 5), bool)
    free[patch.index[0]] = False
    shell = Shell(
        ShellMesh.build(patch.nodes, patch.quads, 0.012, material_axis=(1.0, 0.0, 0.0)), mixed_section(), free
    )
    force = np.zeros((patch.nodes.shape[0], 5))
    force[patch.index[-1], 2] = [0.5, 1.0, 1.0, 0.5]
    force[patch.index[-1], 0] = 0.3
    force = shell.dofs.restrict(force)
    errors = []
    for steps in (8, 16, 32):
        factors = np.arange(1, steps + 1) / steps
        path = [(0.0, np.zeros(shell.size))] + [(e.factor, e.q) for e in solve_path(shell, dead_load(force), factors)]
        work = sum(0.5 * (a + b) * force @ (y - x) for (a, x), (b, y) in zip(path[:-1], path[1:]))
        stored = shell.energy(path[-1][1])
        errors.append(abs(work - stored) / stored)
    tip = shell.dofs.expand(path[-1][1])[patch.index[-1], 2].max()
    assert tip > 0.1  # far outside the linear range
    assert errors[-1] < 1e-3
    for coarse, fine in zip(errors[:-1], errors[1:]):
        assert np.log2(coarse / fine) == pytest.approx(2.0, abs=0.25)


def test_fine_quadrature_of_the_work():
    """With six Gauss points a piece the work along a given path equals the change of energy to ten digits."""
    patch = grid(4, 6, lambda u, v: (0.4 * u, 0.5 * v, 0.4 * (u - 0.3) * (v - 0.6)))
    shell = Shell(ShellMesh.build(patch.nodes, patch.quads, 0.012, material_axis=(1.0, 0, 0)), mixed_section())
    generator = np.random.default_rng(4)
    end = shell.dofs.restrict(generator.standard_normal((35, 5)) * np.array([0.005] * 3 + [0.15] * 2))
    x, w = np.polynomial.legendre.leggauss(6)
    work = 0.0
    for piece in range(4):
        for xi, wi in zip(x, w):
            work += wi / 8 * (shell.force((piece + 0.5 + 0.5 * xi) / 4 * end) @ end)
    assert work == pytest.approx(shell.energy(end), rel=1e-10)
