"""Contact against solutions that know nothing of the shell: a strip pressed on a plane, a ring squeezed between plates,
energies.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_bvp
from scipy.optimize import brentq

from dbvfiv.contact import ContactLaw, ContactState, PlaneContact, tributary_area
from dbvfiv.model.load_steps import LoadStepOptions, LoadSteps
from dbvfiv.model.newton import NewtonOptions
from dbvfiv.shell import Shell, ShellMesh
from dbvfiv.studies.closure.walk import EnergyLedger, force_imbalance
from eigen.factor import DirectFactor
from tests.shell.structures import grid, isotropic_section
from tests.systems.pressed import ShellOnPlane

E, WIDTH = 5e6, 0.02


def _strip(elements: int, half=0.5, h=4e-3, gap=1e-3, depth=0.7e-3, penalty=1e9) -> ShellOnPlane:
    """Half of a strip whose clamp can slide along it, its face a small gap above the plane; nu = 0, so a beam of
    stiffness E h^3 / 12.

    The face lies at a depth of its own, other than half the wall: only the gap may matter to a strip.
    """
    patch = grid(elements, 1, lambda u, v: (half * u, gap + depth + 0 * u, -WIDTH * v))
    mesh = ShellMesh.build(patch.nodes, patch.quads, h, material_axis=(1.0, 0.0, 0.0))
    assert mesh.directors[0] == pytest.approx([0, 1, 0])
    free = np.ones((mesh.node_count, 5), bool)
    free[:, [2, 4]] = False  # the first rotation turns the director along the strip
    free[np.ix_(patch.index[0], [1, 3])] = False
    free[np.ix_(patch.index[-1], [0, 3])] = False
    shell = Shell(mesh, isotropic_section(E, 0.0, h), free)
    contact = PlaneContact(shell, np.arange(mesh.node_count), depth, tributary_area(shell), ContactLaw(penalty))
    return ShellOnPlane(shell, contact)


def _beam(q: float, half=0.5, h=4e-3, gap=1e-3) -> tuple[float, float]:
    """Free length from the clamp and contact force of half a strip of unit width, by beam theory.

    With w = w' = 0 at the clamp and w = gap, w' = w'' = 0 where contact begins, EI w'''' = q gives s^4 = 72 EI gap / q;
    the clamp carries 2 q s / 3.
    """
    s = (72 * E * h**3 / 12 * gap / q) ** 0.25
    return s, q * half - 2 * q * s / 3


def _pressed_strip(elements: int, q: float):
    model = _strip(elements)
    steps = LoadSteps(model, LoadStepOptions(NewtonOptions(1e-10, 40), 1e-6, first_step=q / 50, max_step=q / 5))
    steps.reach(q)
    return model, steps.q


@pytest.mark.slow
def test_a_strip_pressed_on_a_plane_lifts_off_where_beam_theory_says():
    q = 10.0
    free, force = _beam(q)
    assert 0.1 < free < 0.35
    errors, fronts = [], []
    for elements in (40, 160):
        model, u = _pressed_strip(elements, q)
        state = model.contact.state(u)
        assert state.penetration < 1e-7
        errors.append(abs(state.total / WIDTH - force) / force)
        x = model.mesh.nodes[model.contact.nodes, 0]
        fronts.append(abs(x[state.touching].min() - free))
        inner = state.touching & (x > free + (0.2 if elements == 40 else 0.1))  # behind the force at the front
        assert state.pressure[inner] == pytest.approx(q, rel=2e-3)
    assert errors[-1] < 2e-3, errors
    assert fronts[-1] <= 1.5 * 0.5 / 160 + 2e-3 * free, fronts


def _ring(elements: int, radius=0.1, h=1e-3, squeeze=0.0, penalty=1e8) -> ShellOnPlane:
    """Lower right quarter of a ring; its outer face touches a plane that has been raised by `squeeze`."""

    def place(u, v):
        a = -0.5 * np.pi * (1 - u)
        return radius * np.cos(a), radius + 0.5 * h + radius * np.sin(a), WIDTH * v

    patch = grid(elements, 1, place)
    mesh = ShellMesh.build(
        patch.nodes, patch.quads, h, planes=[(patch.index[0], 0), (patch.index[-1], 1)], material_axis=(0.0, 0.0, 1.0)
    )
    outward = np.einsum("ni,ni->n", mesh.directors, mesh.nodes - [0, radius + 0.5 * h, 0])
    side = np.sign(outward[len(outward) // 2])
    free = np.ones((mesh.node_count, 5), bool)
    free[:, [2, 3]] = False  # the first rotation turns the director along the axis
    free[np.ix_(patch.index[0], [0, 4])] = False
    free[np.ix_(patch.index[-1], [1, 4])] = False
    shell = Shell(mesh, isotropic_section(E, 0.0, h), free)
    contact = PlaneContact(
        shell, np.arange(mesh.node_count), -side * 0.5 * h, tributary_area(shell), ContactLaw(penalty)
    )
    contact.lift[:] = -squeeze
    return ShellOnPlane(shell, contact)


def _squeezed(elements: int, distances) -> list[ContactState]:
    """Equilibria without pressure, by Newton's method with halved steps of the plane."""
    model = _ring(elements)
    factor, q, found, at = DirectFactor(*model.shell.dofs.pattern), model.rest(), [], 0.0
    for target in distances:
        step = (target - at) / 4
        while at < target - 1e-15:
            aim = min(at + step, target)
            model.contact.lift[:] = -aim
            trial = _newton(model, factor, q)
            if trial is None:
                step /= 2
                assert step > 1e-7
                continue
            q, at = trial, aim
        found.append(model.contact.state(q))
    return found


def _newton(model, factor, q):
    for _ in range(60):
        tangent = model.tangent(q, 0.0)
        # rounding of the membrane forces leaves about 1e-8 of the contact force of so thin a ring
        scale = max(float(np.linalg.norm(model.contact.state(q).force)), 1e-12)
        if np.linalg.norm(tangent.residual) <= 1e-6 * scale:
            return q
        model.refactor(factor, tangent)
        step = factor.solve(tangent.residual)
        if not np.isfinite(step).all() or np.abs(step).max() > 10:
            return None
        q = q - step
    return None


def _elastica(force: float, radius=0.1, h=1e-3) -> tuple[float, float]:
    """Half height of a ring squeezed by `force` per unit width between smooth plates, and half the flat contact length.

    An inextensible ring without shear: EI theta'' = (F/2) cos(theta) along the quarter, theta = 0 at the plate, pi/2 at
    the side, where the normal force is F/2 and the shear vanishes; the ring was a circle, and lies flat once its
    curvature at the plate has fallen to zero.
    """
    ei, quarter = E * h**3 / 12, 0.5 * np.pi * radius

    def quarter_arc(length):
        def rate(s, y):  # theta, curvature, height
            return np.stack([length * y[1], length * 0.5 * force / ei * np.cos(y[0]), length * np.sin(y[0])])

        s = np.linspace(0, 1, 81)
        guess = np.stack([0.5 * np.pi * s, np.full(81, 0.5 * np.pi / length), radius * (1 - np.cos(0.5 * np.pi * s))])
        found = solve_bvp(
            rate, lambda a, b: np.array([a[0], b[0] - 0.5 * np.pi, a[2]]), s, guess, tol=1e-9, max_nodes=20000
        )
        assert found.success
        return found.sol

    def curvature(length):
        return float(quarter_arc(length)(0.0)[1])

    length = quarter
    if curvature(quarter) < 0:
        length = brentq(curvature, 0.4 * quarter, quarter, xtol=1e-10)
    return float(quarter_arc(length)(1.0)[2]), quarter - length


@pytest.mark.slow
def test_a_squeezed_ring_follows_the_elastica_before_and_after_it_lies_flat():
    ei, radius = E * (1e-3) ** 3 / 12, 0.1
    forces = np.array([1.0, 6.0]) * ei / radius**2
    expected = [_elastica(force) for force in forces]
    # for a little force the formula of strength of materials: half the change of the diameter is (pi/4 - 2/pi)/2 F
    # R^3/EI
    small = _elastica(1e-3 * ei / radius**2)[0]
    assert radius - small == pytest.approx(0.5 * (np.pi / 4 - 2 / np.pi) * 1e-3 * radius, rel=1e-3)
    assert expected[0][1] == 0.0 and expected[1][1] > 0.02 * radius
    states = _squeezed(80, [radius - height for height, _ in expected])
    for state, force, tolerance in zip(states, forces, (2e-5, 5e-4)):
        # half of the ring's lower half rests on the plane
        assert 2 * state.total / WIDTH == pytest.approx(force, rel=tolerance)


@pytest.mark.slow
def test_forces_and_energies_of_a_pressed_strip_balance():
    model = _strip(40)
    ledger = EnergyLedger(model)
    steps = LoadSteps(model, LoadStepOptions(NewtonOptions(1e-12, 40), 1e-7))
    steps.reach(10.0)
    assert force_imbalance(model, steps.q, model.nodal_pressure_force(model.nodal(steps.q), 10.0)) < 1e-8
    ledger.begin(steps.q, 10.0, steps.slope)
    for p in np.linspace(10.0, 10.5, 129)[1:]:
        steps.reach(p)
        ledger.add(steps.q, p, steps.slope)
    assert ledger.error < 1e-8
