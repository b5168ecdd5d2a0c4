"""Added mass by panels against closed forms, and what images, open panels and frozen rules do.

Lamb, Hydrodynamics (1932): a sphere carries half the mass of the fluid it displaces; a ring that moves outwards with
cos(n t) carries rho R/n per area in unbounded fluid. Waves cos(n t) cos(k z) on a tube in a rigid pipe of radius Ro
carry -rho phi/phi' at R with phi = I_n(k r) - K_n(k r) I_n'(k Ro)/K_n'(k Ro), for long ones
(rho R/n)(Ro^2n + R^2n)/(Ro^2n - R^2n).
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import iv, ivp, kv, kvp

from dbvfiv.flow.outside.influence import REFLECTIONS, influence
from dbvfiv.flow.outside.panels import Panels, arc, end_face, extruded, pipe, ring_face, stretched, strip
from dbvfiv.flow.outside.potential_flow import BODY, ROOM, PotentialFlow, Surroundings, panel_strength
from tests.small_valves import make_valve


def quads(grid):
    return np.stack([grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]], axis=2).reshape(-1, 4, 3)


def sphere(n: int) -> Panels:
    """A quarter of the unit sphere: faces of a cube, n by n panels to an octant's face, blown up."""
    t = np.tan(np.linspace(0.0, 0.25 * np.pi, n + 1))
    a, b = np.meshgrid(t, t, indexing="ij")
    corners = []
    for axis in range(3):
        face = np.empty((n + 1, n + 1, 3))
        face[..., axis], face[..., (axis + 1) % 3], face[..., (axis + 2) % 3] = 1.0, a, b
        ball = quads(face / np.linalg.norm(face, axis=2, keepdims=True))
        corners += [ball, ball[:, ::-1] * [1.0, 1.0, -1.0]]
    corners = np.concatenate(corners)
    return Panels.of(corners, corners)


def heaving(n: int, symmetry: str, axis: int) -> float:
    panels = sphere(n)
    flux = panels.normals[:, axis] * panels.areas
    return 4.0 * float(flux @ (PotentialFlow(symmetry=symmetry, closed=BODY).impedance(panels) @ flux))


@pytest.mark.parametrize("symmetry, axis", [("AS", 0), ("SA", 1)])
def test_a_heaving_sphere_carries_half_the_fluid_it_displaces(symmetry, axis):
    errors = [heaving(n, symmetry, axis) / (2.0 * np.pi / 3.0) - 1.0 for n in (3, 6, 12)]
    assert abs(errors[-1]) < 0.001  # 864 panels
    orders = np.log2(np.abs(np.array(errors[:-1]) / errors[1:]))
    assert orders.min() > 1.8, (errors, orders)


def ring(around: int, mode: int, symmetry: str, length: float) -> float:
    """Added mass per area of a mode, midway along a shut tube of unit radius, over the closed form."""
    contour = arc(1.0, np.linspace(0.5 * np.pi, 0.0, around + 1))
    half = stretched(0.0, 1.5 / around, length, 1.15)  # fine in the middle
    z = np.concatenate([-half[:0:-1], half])
    tube = extruded(contour, z)
    ends = Panels.joined(end_face(contour, z[0], False), end_face(contour, z[-1], True))
    wave = np.cos(mode * np.arctan2(tube.centres[:, 1], tube.centres[:, 0]))
    potential = PotentialFlow(Surroundings(ends), symmetry, BODY).impedance(tube) @ (wave * tube.areas)
    middle = np.abs(tube.centres[:, 2]) < 0.35
    weight = (tube.areas * wave)[middle]
    return mode * float(weight @ potential[middle]) / float(weight @ wave[middle])


@pytest.mark.parametrize("mode, symmetry", [(2, "SS"), (3, "AS")])
def test_ring_modes_in_unbounded_fluid(mode, symmetry):
    errors = [abs(ring(around, mode, symmetry, 8.0) - 1.0) for around in (6, 12)]
    assert errors[0] < 0.01 and errors[1] < 0.006, errors


def annulus(mode: int, k: float, radius: float) -> float:
    """Added mass per area and density of a wave on a tube of unit radius in a pipe."""
    share = ivp(mode, k * radius) / kvp(mode, k * radius)
    return -(iv(mode, k) - share * kv(mode, k)) / (k * (ivp(mode, k) - share * kvp(mode, k)))


def wave_in_a_pipe(around: int, radius: float, mode: int, length: float) -> float:
    """Added mass of a wave over the closed form: a quarter of its length, from a rigid face to an open one."""
    step = 0.5 * np.pi / around
    z = np.linspace(0.0, 0.25 * length, max(4, round(0.25 * length / step)) + 1)
    contour = arc(1.0, np.linspace(0.5 * np.pi, 0.0, around + 1))
    rings = max(2, round((radius - 1.0) / z[1]))
    rigid, opening = (ring_face(contour, radius * contour, z[i], i == 0, rings) for i in (0, -1))
    around_it = Surroundings(Panels.joined(pipe(radius, z, np.linspace(0.5 * np.pi, 0.0, around + 1)), rigid), opening)
    tube = extruded(contour, z)
    x, y, height = tube.centres.T
    k = 2.0 * np.pi / length
    wave = np.cos(mode * np.arctan2(y, x)) * np.cos(k * height)
    potential = PotentialFlow(around_it, "AS" if mode % 2 else "SS", ROOM).impedance(tube) @ (wave * tube.areas)
    return float((wave * tube.areas) @ potential / ((wave * tube.areas) @ wave)) / annulus(mode, k, radius)


@pytest.mark.parametrize("radius", [1.2, 2.0])
def test_waves_on_a_tube_in_a_pipe(radius):
    """Eight panels around a quarter; the modes are those of a column, of sway and of two to four waves around."""
    lengths, modes = (1.5, 6.0, 25.0), range(5)
    errors = np.array([[wave_in_a_pipe(8, radius, mode, length) - 1.0 for mode in modes] for length in lengths])
    assert np.abs(errors).max() < 0.0085, errors  # with strengths that do not vary over a panel: 0.054
    for mode in (1, 2, 3, 4):  # the closed form has the limit of long waves
        power = radius ** (2 * mode)
        assert annulus(mode, 1e-3, radius) == pytest.approx((power + 1.0) / (power - 1.0) / mode, rel=1e-5)


def test_waves_in_a_pipe_converge():
    errors = [wave_in_a_pipe(16, radius, mode, 3.0) - 1.0 for radius in (1.2, 2.0) for mode in range(5)]
    assert np.abs(errors).max() < 0.0025, errors


def test_images_are_the_mirrored_panels():
    panels = sphere(2)
    rng = np.random.default_rng(1)
    for symmetry, signs in (
        ("SS", (1, 1, 1, 1)),
        ("SA", (1, 1, -1, -1)),
        ("AS", (1, -1, 1, -1)),
        ("AA", (1, -1, -1, 1)),
    ):
        potential, velocity = influence(panels, panels, PotentialFlow(symmetry=symmetry).signs, 0)
        whole, moving = np.zeros_like(potential), np.zeros_like(velocity)
        for k, sign in enumerate(signs):
            corners = panels.corners * REFLECTIONS[k]
            turned = corners if REFLECTIONS[k].prod() > 0 else corners[:, ::-1]
            alone = influence(panels, Panels.of(turned), np.array([1.0, 0, 0, 0]), 0 if k == 0 else None)
            whole += sign * alone[0]
            moving += sign * alone[1]
        source = rng.standard_normal(len(panels))
        np.testing.assert_allclose(potential @ source, whole @ source, atol=2e-5)
        np.testing.assert_allclose(velocity @ source, moving @ source, atol=2e-4)


def test_near_and_far_integrals_meet():
    """A panel cut into sixteen, each small enough to be far, against its exact integral."""
    corner = np.array([[0.0, 0.0, 0.0], [1.0, 0.1, 0.0], [0.9, 1.2, 0.0], [0.0, 0.8, 0.0]]) + [2.0, 2.0, 0.0]
    t = np.linspace(0.0, 1.0, 17)
    u, v = np.meshgrid(t, t, indexing="ij")
    grid = sum(
        w[..., None] * c for w, c in zip(((1 - u) * (1 - v), u * (1 - v), u * v, (1 - u) * v), corner, strict=True)
    )
    whole, parts = Panels.of(corner[None]), Panels.of(quads(grid))
    alone = np.array([1.0, 0.0, 0.0, 0.0])
    for place in ([2.4, 2.5, 0.3], [3.5, 3.4, 1.0], [2.5, 2.4, 6.0], [2.5, 9.0, 9.0]):
        target = Panels.of((np.array([[0, 0, 0], [0.1, 0, 0], [0.1, 0.1, 0.02], [0, 0.1, 0]]) + place)[None])
        one, many = influence(target, whole, alone), influence(target, parts, alone)
        assert one[0][0, 0] == pytest.approx(many[0].sum(), rel=2e-4)
        assert one[1][0, 0] == pytest.approx(many[1].sum(), rel=2e-3, abs=1e-8)


def test_an_open_end_lets_a_column_go():
    """A piston in a tube of length L that is open at the far end moves the column: rho L per area."""
    length, z = 2.0, np.linspace(0.0, 2.0, 17)
    errors = []
    for n in (4, 8):
        contour = arc(1.0, np.linspace(0.5 * np.pi, 0.0, n + 1))
        piston = end_face(contour, 0.0, True)
        flow = PotentialFlow(
            Surroundings(pipe(1.0, z, np.linspace(0.5 * np.pi, 0.0, n + 1)), end_face(contour, length, False)),
            closed=ROOM,
        )
        pressure = flow.impedance(piston) @ piston.areas
        errors.append(float(piston.areas @ pressure / piston.areas.sum()) / length - 1.0)
    assert max(map(abs, errors)) < 0.0025, errors  # without closing the balance: 0.15


def test_the_matrix_is_symmetric_and_positive_also_beside_rigid_and_open_panels():
    contour = arc(1.0, np.linspace(0.5 * np.pi, 0.0, 7))
    tube = extruded(contour, np.linspace(0.0, 2.0, 7))
    edge = np.column_stack([contour, np.zeros(len(contour))])
    for open_count in (0, 12):
        moving = Panels.joined(tube, strip(edge, edge * [1.0, 0.0, 1.0]))
        found = PotentialFlow(Surroundings(end_face(contour, 2.0, True))).impedance(moving, len(tube), open_count)
        some = np.random.default_rng(3).standard_normal((len(tube), 4))
        products, found = found @ some, found.matrix()
        assert np.array_equal(found, found.T)
        np.testing.assert_allclose(products, found @ some, rtol=1e-10, atol=1e-12 * np.abs(products).max())
        assert np.linalg.eigvalsh(found)[0] > 0.0


def test_a_panel_without_area_is_named():
    with pytest.raises(ValueError, match="Panel 0 has no area"):
        Panels.of(np.zeros((1, 4, 3)))


def test_varying_strengths_add_up():
    """A wave around a tube acts as one that is stronger by (k h)^2/24; the whole strength of any stays what it is."""
    tube = extruded(arc(1.0, np.linspace(0.5 * np.pi, 0.0, 17)), np.array([0.0, 0.5, 0.8, 1.8]))
    for mode, symmetry in ((2, "SS"), (3, "AS")):
        wave = np.cos(mode * np.arctan2(tube.centres[:, 1], tube.centres[:, 0]))
        found = panel_strength(tube, PotentialFlow(symmetry=symmetry).signs) @ wave / wave
        np.testing.assert_allclose(found, 1.0 + (mode * np.pi / 32) ** 2 / 24.0, rtol=5e-5)
    whole = tube.areas @ panel_strength(tube, PotentialFlow(symmetry="SS").signs)
    np.testing.assert_allclose(whole, tube.areas, rtol=1e-12)


@pytest.mark.parametrize("lips", ["closed", "open"])
def test_derivative_by_the_shape_is_that_of_changed_shapes(lips):
    """Derivatives of a valve in a pipe, summed over complex fluxes, where the wall bends, against extrapolated
    differences.
    """
    outside = make_valve({"outside.fluid": "same", "outside.pipe_diameter": "330 mm", "outside.lips": lips}).outside
    mesh, dofs, rng = outside.shell.mesh, outside.shell.dofs, np.random.default_rng(3)
    bent = np.sin(20 * mesh.nodes[:, 2:] + 5 * mesh.nodes[:, :1]) * np.sin(np.arange(5))
    way, rest = dofs.restrict(np.where(dofs.free, bent, 0.0)), np.zeros(dofs.size)
    left, right = rng.standard_normal((2, dofs.size, 3)) + 1j * rng.standard_normal((2, dofs.size, 3))
    found, here = outside.shape_derivative(rest, left, right), outside.panels(rest)
    a, b = (outside.face.fluxes(dofs.expand(rest)) @ motions for motions in (left, right))

    def product(h):
        impedance = outside.impedance(h * way, here)
        return (a * (impedance @ b.real + 1j * (impedance @ b.imag))).sum()

    near, far = ((product(h) - product(-h)) / (2 * h) for h in (2e-6, 4e-6))
    slope = found.between(*(outside.all_panels(h * way) for h in (-1e-7, 1e-7))) / 2e-7
    assert found.pressures[1] == pytest.approx(outside.impedance(rest).matrix() @ b, rel=1e-10)
    assert slope == pytest.approx((4 * near - far) / 3, rel=1e-6)
