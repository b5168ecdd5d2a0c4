"""Contact of the inner faces as a support of the coupled valve: where it begins, and its derivatives."""

from __future__ import annotations

import numpy as np
import pytest

from dbvfiv.errors import SolveError
from dbvfiv.model.classes import linearise_class
from dbvfiv.model.equilibria import LoadPath, SteadyOptions
from dbvfiv.model.newton import NewtonOptions
from dbvfiv.model.symmetry import SYMMETRIES
from tests.differences import difference
from tests.model.conftest import opened
from tests.systems.pressed import ShellOnPlane

FACES = {"supports__contact": "faces"}


@pytest.fixture(scope="module")
def model(make_model):
    return make_model(**FACES)


@pytest.fixture(scope="module")
def pressed_state(model):
    """Lips pressed onto each other, uneven, some faces apart."""
    return opened(model, -3e-4, 1, 1e-5)


def _flat(model) -> np.ndarray:
    """Nodes of the straight part of the lips, the joint left out."""
    valve, nodes = model.case.valve, model.mesh.nodes
    inner = (nodes[:, 0] < 0.9 * valve.lip_half_width) & (nodes[:, 2] < 0.9 * valve.duckbill_length)
    return np.flatnonzero(inner)


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"fluid__area_floor": 0.2},
        {"valve__lip_radius": 8e-3, "valve__initial_gap": 3e-4},
        {"valve__thickness_factor": 0.5},
        {"valve__scale": 2.0},
    ],
)
def test_faces_meet_where_the_passage_is_used_up(make_model, changes):
    model = make_model(**FACES, **changes)
    valve = model.case.valve
    left = valve.lip_radius - valve.duckbill_wall_deduction + (1 - model.case.fluid.area_floor) * valve.initial_gap
    at_rest = dict(zip(model.contact.nodes, model.contact.state(model.rest()).gap))
    assert np.array([at_rest[node] for node in _flat(model)]) == pytest.approx(left, rel=1e-6)
    assert min(at_rest.values()) > 0 and model.touching(model.rest()) == 0


def test_lips_that_lie_on_each_other_leave_the_area_of_a_shut_valve(model):
    nodal = np.zeros((len(model.mesh.nodes), 5))
    gap = (1 - model.case.fluid.area_floor) * model.case.valve.initial_gap
    lips = model.mesh.nodes[:, 2] < 0.9 * model.case.valve.duckbill_length
    nodal[lips, 1] = -gap
    nodal[model.mesh.rows[:, -1], 1] = 0.0
    rows = model.mesh.z < 0.9 * model.case.valve.duckbill_length
    rest, shut = (model.rows.areas(x)[rows] for x in (np.zeros_like(nodal), nodal))
    assert np.all(shut > 0) and np.all(shut < 0.1 * rest)
    assert model.touching(model.shell.dofs.restrict(nodal * 1.02)) >= len(_flat(model))


def test_the_gap_of_a_bowed_lip_is_its_lens(make_model):
    model = make_model(**FACES, valve__lip_rise=5e-3)
    plane, valve = model.contact, model.case.valve
    middle = np.flatnonzero(plane.nodes == model.mesh.rows[0, 0])[0]
    gap = model.contact.state(model.rest()).gap[middle]
    inside = valve.duckbill_wall_deduction - (1 - model.case.fluid.area_floor) * valve.initial_gap
    assert gap == pytest.approx(valve.lip.height - inside, rel=1e-3)
    assert model.lens == pytest.approx(valve.lip.height - valve.duckbill_wall_deduction, rel=1e-3)
    assert make_model(**FACES).lens == make_model(valve__lip_radius=8e-3).lens == 0.0
    assert model.flow.floor == pytest.approx(0.05 * 1e-4 * 0.125, rel=1e-2)


@pytest.mark.slow
def test_bowed_lips_close_where_they_are_pressed_from_outside(make_model):
    """The lens shrinks from the first pascal on, and its faces come to lie on each other row by row."""
    soft = {
        "valve__wall": "uniform",
        "valve__wall_thickness": 5e-3,
        "layers": ({"material": "SBR", "thickness": 5e-3},),
    }
    small = {"mesh__around": 6, "mesh__along": 8, "drive__kind": "uniform", "drive__side": "outside"}
    model = make_model(valve__lip_rise=0.04, **soft, **small)
    path = LoadPath(model, SteadyOptions.of(model.case))
    states = [path.go_to(pressure) for pressure in (0.0, 50.0, 200.0, 500.0, 1000.0)]
    area, touching = np.array([state.outlet_area for state in states]), [state.stops for state in states]
    assert np.all(np.diff(area) < 0) and area[1] > 0.95 * area[0] and 0 < area[4] < 0.02 * area[0]
    assert touching[:3] == [0, 0, 0] and 0 < touching[3] < touching[4]
    with pytest.raises(SolveError, match="came down to no load again, from 74.* Pa at most"):
        path.go_to(18e3)


def test_open_states_do_not_know_of_it(make_model, model):
    """With nothing in touch, residual and tangent are those of the valve with stops to the last digit."""
    stops = make_model()
    q = opened(model, 0.02)
    assert model.touching(q) == 0
    assert np.array_equal(model.residual(q, 18e3), stops.residual(q, 18e3))
    assert np.array_equal(model.tangent(q, 18e3).stiffness, stops.tangent(q, 18e3).stiffness)
    assert len(model.stops.unknowns) == 0


def _direction(model, seed):
    generator = np.random.default_rng(seed)
    return model.shell.dofs.restrict(generator.standard_normal((len(model.mesh.nodes), 5)) * [1, 1, 1, 30, 30])


def _safe_step(model, q, direction) -> float:
    """Step within which no face leaves its piece of the contact's law."""
    plane, nodal = model.contact, model.nodal(q)
    gap = plane.gap(nodal, model.shell.directors(nodal)[0])
    distance = np.minimum(np.abs(gap - plane.law.rounding), np.abs(gap + plane.law.rounding))
    there = model.nodal(q + 1e-9 * direction)
    move = 1e9 * np.abs(plane.gap(there, model.shell.directors(there)[0]) - gap)
    return float(0.2 * (distance / move).min())


def test_tangent_against_differences(model, pressed_state):
    q = pressed_state
    assert 3 < model.touching(q) < model.contact.count
    tangent = model.tangent(q, 18e3)
    assert np.allclose(tangent.residual, model.residual(q, 18e3), rtol=0, atol=1e-12 * np.abs(tangent.residual).max())
    direction = _direction(model, 2)
    slope = difference(lambda x: model.residual(x, 18e3), q, direction, _safe_step(model, q, direction))
    assert np.linalg.norm(model.apply(tangent, direction) - slope) < 1e-7 * np.linalg.norm(slope)


def test_it_is_no_part_of_what_is_damped(model, pressed_state):
    """Stiffness damping acts on the structure alone."""
    tangent = model.tangent(pressed_state, 18e3)
    bare = model.shell.force_and_tangent(pressed_state)[1]
    assert np.array_equal(tangent.structure, bare)
    assert np.abs(tangent.stiffness - tangent.structure).max() > np.abs(bare).max()


def test_force_is_the_derivative_of_the_energy(model, pressed_state):
    q, direction = pressed_state, _direction(model, 3)
    slope = difference(model.support_energy, q, direction, _safe_step(model, q, direction))
    assert model.contact_force(q) @ direction == pytest.approx(slope, rel=1e-7)


@pytest.mark.slow
def test_higher_derivatives_against_differences(model, pressed_state):
    q = pressed_state
    a, b, c = (_direction(model, seed) for seed in (4, 5, 6))

    def slope(x):
        data = np.zeros(len(model.shell.dofs.pattern[1]))
        model.add_contact(x, data)
        return model.shell.dofs.matrix(data) @ a

    found = model.contact.form(q, a, b)
    expected = difference(slope, q, b, _safe_step(model, q, b))
    assert np.linalg.norm(found - expected) < 1e-6 * np.linalg.norm(expected)
    found = model.contact.form(q, a, b, c)
    expected = difference(lambda x: model.contact.form(x, a, b), q, c, _safe_step(model, q, c))
    assert np.linalg.norm(found - expected) < 1e-6 * np.linalg.norm(expected)


@pytest.mark.slow
def test_a_valve_under_outside_pressure_is_the_pressed_shell(make_model):
    """The equilibrium by load steps of the coupled model is one of the shell pressed on a plane."""
    model = make_model(**FACES, drive__kind="uniform", drive__side="outside")
    path = LoadPath(model, SteadyOptions(NewtonOptions(1e-11), 1e-3))
    path.go_to(2e3)
    pressed = ShellOnPlane(model.shell, model.contact)
    pressed.loaded = model.loaded
    left = np.linalg.norm(pressed.residual(path.q, 2e3)) / pressed.force_scale(path.q, 2e3)
    state = model.contact.state(path.q)
    assert left < 1e-9 and state.touching.sum() > 5
    duckbill = model.mesh.z < 0.9 * model.case.valve.duckbill_length
    area = model.rows.areas(model.nodal(path.q))
    assert np.all(area[duckbill] > 0) and area[0] < 0.2 * model.rows.areas(model.nodal(model.rest()))[0]


def test_faces_resist_in_the_classes_that_move_lips_apart(make_model, model, pressed_state):
    """In the class of the equilibria it is the tangent of the model; lips that sway together are not held apart."""
    q, free = pressed_state, make_model(supports__lip_stop=False)
    data = np.zeros(len(model.shell.dofs.pattern[1]))
    model.add_contact(q, data)
    own = model.shell.dofs.matrix(data)
    again = model.contact.stiffness_of_class(q, model.shell, True)
    assert abs(own - again).max() < 1e-12 * abs(own).max()
    largest = {}
    for name in ("SA", "AS", "AA"):
        linear = linearise_class(model, q, 12e3, SYMMETRIES[name])
        bare = linearise_class(free, q, 12e3, SYMMETRIES[name])
        contact = model.contact.stiffness_of_class(q, linear.shell, SYMMETRIES[name].moves_lips_apart)
        assert abs(contact - contact.T).max() < 1e-9 * abs(contact).max()
        assert abs(linear.stiffness - bare.stiffness - contact).max() < 1e-9 * abs(contact).max()
        assert abs(linear.structure - bare.structure).max() == 0
        largest[name] = abs(contact).max()
    assert largest["AS"] > 1e3 * max(largest["SA"], largest["AA"]) > 0


def test_faces_have_room_to_close_before_they_touch(make_model):
    """Straight lips too: cycles that just close them were told a tenth of a millimetre early."""
    model = make_model(**FACES)
    middle = np.flatnonzero(model.contact.nodes == model.mesh.rows[0, 0])[0]
    assert model.room == pytest.approx(model.contact.gaps(model.rest())[middle]) and model.room > 5e-5
    assert make_model(valve__lip_radius=8e-3).room == 0.0
