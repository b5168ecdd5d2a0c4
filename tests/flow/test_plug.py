"""The plug that sways with the wall: centroids of sections, and pipes conveying fluid."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
import scipy.sparse as sp

from dbvfiv.case.part import QUARTER
from dbvfiv.flow.plug import centroid_matrix, centroid_slope, plug_parts
from dbvfiv.model.classes import LinearisedClass
from dbvfiv.model.symmetry import SYMMETRIES
from dbvfiv.shell import Shell, ShellMesh
from eigen import CoupledPencil, SearchOptions, leading_modes
from tests.shell.structures import grid, isotropic_section, observed_order
from tests.systems.beam import beam, fluid_conveying_pipe
from tests.verification.critical import hopf


def swaying(law, z, area, inlet) -> LinearisedClass:
    """A class of sway of which only the fluid is known."""
    model = SimpleNamespace(flow=law, mesh=SimpleNamespace(z=z), seal=lambda area: None)
    return LinearisedClass(model, None, inlet, *[None] * 5, area, symmetry=SYMMETRIES["SA"])


def sections(count=4, nodes=7, seed=3):
    """Quarters of convex sections from x = 0 to y = 0."""
    generator = np.random.default_rng(seed)
    angle = np.linspace(0, np.pi / 2, nodes)
    reach = generator.uniform(0.8, 1.2, (count, nodes))
    points = np.stack([reach * np.sin(angle), reach * np.cos(angle)], axis=-1)
    points[:, 0, 0] = points[:, -1, 1] = 0.0
    return points


def whole_centroid(quarter, moved, axis):
    """Centroid of the whole section, its other quarters mirrored with the signs of a sway along the axis."""
    signs = (-1, 1) if axis == 0 else (1, -1)
    images = []
    for mx, my in ((1, 1), (1, -1), (-1, -1), (-1, 1)):
        parity = (signs[0] if mx < 0 else 1) * (signs[1] if my < 0 else 1)
        points = (quarter + parity * moved) * [mx, my]
        images.append(points if mx * my > 0 else points[::-1])
    x, y = np.concatenate(images).T
    cross = x * np.roll(y, -1) - np.roll(x, -1) * y
    place = (x, y)[axis]
    return np.sum((place + np.roll(place, -1)) * cross) / (3 * np.sum(cross))


@pytest.mark.parametrize("axis", [0, 1])
def test_centroids_are_those_of_the_whole_section(axis):
    points = sections()
    slope = centroid_slope(points, axis)
    generator = np.random.default_rng(5)
    move = generator.standard_normal(points.shape)
    held = {0: (-1, 1), 1: (0, 0)}[axis]  # what the class fixes in its symmetric plane
    move[:, held[0], held[1]] = 0.0
    other = {0: (0, 1), 1: (-1, 0)}[axis]
    move[:, other[0], other[1]] = 0.0
    h = 1e-6
    for section, motion, derivative in zip(points, move, slope):
        difference = whole_centroid(section, h * motion, axis) - whole_centroid(section, -h * motion, axis)
        assert np.sum(derivative * motion) == pytest.approx(difference / (2 * h), rel=1e-8)
    shift = np.zeros(points.shape)
    shift[..., axis] = 1.0
    assert np.sum(slope * shift, axis=(1, 2)) == pytest.approx(1.0, rel=1e-13)


def plug_on_a_beam(velocity, mass_ratio, elements=60):
    """Cantilevered beam with unit mass in all, of which a share flows; z runs from the free end to the clamped one."""
    b = beam(elements)
    z, ones = b.x, np.ones(elements + 1)
    # nodes from the free end on; the clamped one has no unknowns
    numbers = 2 * np.arange(elements - 1, -1, -1)
    J = sp.csr_matrix((np.ones(elements), (np.arange(elements), numbers)), (elements + 1, b.keep.size))
    parts = plug_parts(z, ones, velocity / np.sqrt(mass_ratio) * ones, mass_ratio)
    return CoupledPencil((1 - mass_ratio) * b.mass, 0 * b.mass, b.bending, J.T.tocsr(), J, **parts)


@pytest.mark.slow
@pytest.mark.parametrize("mass_ratio, velocity, omega", [(0.1, 4.7499, 14.2171), (0.2, 5.5914, 13.7147)])
def test_a_cantilevered_pipe_flutters(mass_ratio, velocity, omega):
    """Critical velocities of the Galerkin series; linear w between stations leaves an error of second order."""
    errors = []
    for elements in (16, 32, 64):
        at = lambda u: plug_on_a_beam(u, mass_ratio, elements)  # noqa: E731
        found, frequency = hopf(at, 0.9 * velocity, 1.1 * velocity, band=20.0)
        errors.append(found - velocity)
    assert abs(errors[-1]) < 1e-3 * velocity
    assert frequency == pytest.approx(omega, rel=2e-3)
    assert np.all(np.array(observed_order(errors)) > 1.5)


def test_forces_go_with_powers_of_the_density_at_one_pressure():
    z, area = np.linspace(0, 1, 6), np.linspace(1, 3, 6)
    one, four = (plug_parts(z, area, 2.0 / np.sqrt(rho) / area, rho) for rho in (1.0, 4.0))
    for power, name in enumerate(("A0", "A1", "A2")):
        assert four[name] == pytest.approx(2.0**power * one[name], rel=1e-12)
    assert set(plug_parts(z, area, 1.0 / area, 1.0, unsteady=False)) == {"A0"}


LENGTH, RADIUS, WALL, E, RHO = 1.0, 0.05, 1e-3, 1e7, 1200.0


def tube(name, velocity, density, shape=(6, 40)):
    """Quarter of a cantilevered tube in a class of sway, with fluid."""
    around, along = shape
    turn = 0.5 * np.pi
    place = lambda u, v: (RADIUS * np.sin(turn * u), RADIUS * np.cos(turn * u), LENGTH * v)  # noqa: E731
    patch = grid(around, along, place)
    quads = patch.quads[:, ::-1]
    rows = patch.index.T
    patch.nodes[rows[:, 0], 0] = patch.nodes[rows[:, -1], 1] = 0.0
    mesh = ShellMesh.build(patch.nodes, quads, WALL, planes=[(rows[:, 0], 0), (rows[:, -1], 1)])
    symmetry = SYMMETRIES[name]
    free = symmetry.free_unknowns(SimpleNamespace(nodes=patch.nodes, rows=rows, part=QUARTER))
    shell = Shell(mesh, isotropic_section(E, 0.0, WALL, RHO), free)
    matrix, still = shell.dofs.matrix, np.zeros(shell.size)
    J = centroid_matrix(centroid_slope(patch.nodes[rows][:, :, :2], symmetry.sway_axis), rows, shell.dofs.index)
    area = 0.25 * np.pi * RADIUS**2 * np.ones(along + 1)
    parts = plug_parts(np.linspace(0, LENGTH, along + 1), area, velocity * np.ones(along + 1), density)
    mass = matrix(shell.mass(still))
    return CoupledPencil(mass, 0 * mass, matrix(shell.force_and_tangent(still)[1]), J.T.tocsr(), J, **parts)


def slowest(pencil, band):
    """Of the modes of a tube all that leave the circle are neutral, so that those that sway do not lead."""
    found = leading_modes(pencil, 12, SearchOptions(max_frequency=band)).eigenvalues
    return found[np.argmin(np.abs(found))]


@pytest.mark.slow
def test_a_tube_conveys_fluid_as_a_beam_does():
    """Lowest mode of a slender tube of shell elements: mass of the fluid at rest, damping and frequency of the flow,
    in both directions of sway.
    """
    wall, fluid = 2 * np.pi * RADIUS * WALL * RHO, np.pi * RADIUS**2 * 1000.0
    bending = E * np.pi * RADIUS**3 * WALL
    ratio = fluid / (wall + fluid)
    omega = np.sqrt(bending / (wall + fluid)) / LENGTH**2
    for name in ("SA", "AS"):
        empty = slowest(tube(name, 0.0, 1e-9), 20.0).imag
        full = slowest(tube(name, 0.0, 1000.0), 20.0).imag
        assert full / empty == pytest.approx(np.sqrt(1 - ratio), rel=2e-3)
        assert full == pytest.approx(3.51602 * omega, rel=0.02)  # slenderness and mesh
        u = 1.0
        flowing = slowest(tube(name, u / LENGTH * np.sqrt(bending / fluid), 1000.0), 20.0)
        exact = slowest(fluid_conveying_pipe(u, ratio), 5.0)
        assert flowing.real / full == pytest.approx(exact.real / 3.51602, rel=0.02)
        assert flowing.imag / full == pytest.approx(exact.imag / 3.51602, rel=0.01)
