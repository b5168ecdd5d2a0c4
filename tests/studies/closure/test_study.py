"""The valve under back pressure on a coarse mesh: what is found is an equilibrium, is told honestly, and does not
depend on how it was found.
"""

from __future__ import annotations

import numpy as np
import pytest

from dbvfiv.model.load_steps import LoadStepOptions, LoadSteps
from dbvfiv.studies.case import Case, thesis_case
from dbvfiv.studies.closure import walk
from dbvfiv.studies.closure.energy import EnergyLedger
from dbvfiv.studies.closure.valve import Passage, closure_model
from dbvfiv.studies.session import Session
from tests.observers import Stop
from tests.small_valves import EVEN

COARSE = EVEN | {
    "mesh.around": 8,
    "mesh.along": 14,
    "closure.max_step": "4 kPa",
    "closure.pressures": ["7 kPa", "28 kPa"],
}


@pytest.fixture(scope="module")
def case() -> Case:
    return thesis_case(COARSE)


def closure(case, pressures=None, observer=None):
    if pressures is not None:
        case = case.replace({"closure.pressures": pressures})
    return Session(case).perform("closure", observer=observer)


def reach(case, pressure, **options):
    """State at one back pressure, with the penalty for the largest pressure of the case."""
    depth = options.pop("contact_depth", case.closure.contact_depth) * pressure / max(case.closure.pressures)
    keys = {f"closure.{key}": value for key, value in (options | {"contact_depth": depth}).items()}
    return closure(case.replace(keys), [pressure]).states[0]


@pytest.fixture(scope="module")
def pressed(case):
    """Result with contact of the inner faces."""
    return closure(case)


@pytest.fixture(scope="module")
def held(case):
    """Result with the supports of Th. 3.6."""
    return closure(case.replace({"closure.supports": "held-lips"}))


def test_states_are_equilibria_without_penetration(pressed):
    assert not pressed.failures and len(pressed.states) == 2
    model = pressed.model.pressed
    for state in pressed.states:
        assert state.converged and state.residual <= 1e-8
        assert state.penetration <= pressed.model.case.closure.penetration
        assert state.force_balance < 1e-8
        assert state.stable and not state.beyond_limit
        assert state.contact_pressure.min() >= 0.0
        assert state.contact_force == pytest.approx(
            2 * np.sum(model.contact.area * state.contact_pressure[model.contact.nodes])
        )


def test_another_element_stays_whatever_is_held(case):
    """Held lips and the balance of forces took the default element."""
    plain = case.replace({"mesh.element": "MITC4"})
    models = [closure_model(plain, supports) for supports in ("contact", "held-lips")]
    assert [model.shell.element for model in models] == ["MITC4", "MITC4"]
    state = closure(plain, [1e3]).states[0]
    assert state.residual <= 1e-8 and state.force_balance < 1e-8


def test_the_contact_carries_the_pressure_on_the_lips(pressed):
    """In the middle of the duckbill's faces, away from its ends, the mean contact pressure is the pressure outside."""
    model, state = pressed.model, pressed.states[-1]
    rows = model.mesh.rows[(model.mesh.z > 0.02) & (model.mesh.z < 0.1), :5]
    assert len(rows) >= 2
    assert state.contact_pressure[rows].mean() == pytest.approx(state.pressure, rel=0.05)


def test_the_valve_shuts_more_firmly_under_more_pressure(pressed):
    low, high = pressed.states
    assert low.closed and high.closed
    assert high.contact_force > 3 * low.contact_force > 0
    assert high.sealed_area > low.sealed_area
    assert high.contact_front > low.contact_front
    # the displacement, until now called opening: half of the 0.38 mm between the faces at rest
    assert low.lip_displacement == pytest.approx(-(0.00619 - 0.006), abs=2e-6)
    assert 0.0 <= low.lip_opening < 4e-6
    assert high.least_opening < 0.2 * 4 * pressed.model.passage(pressed.model.pressed.rest()).reference


def test_the_thesis_supports_hold_the_lips_and_say_so(held):
    for state in held.states:
        assert state.closed and state.sealed_length >= 0.21
        assert np.abs(state.nodal[held.model.mesh.rows[held.model.held], 1]).max() == 0.0
    assert held.states[-1].overlap > 1e-4
    assert any("held shut by its supports" in text for text in held.warnings)
    assert any("overlap" in text for text in held.warnings)


def test_both_supports_agree_before_the_saddle_touches(pressed, held):
    assert pressed.states[0].max_displacement == pytest.approx(held.states[0].max_displacement, rel=0.1)


def test_nodes_that_start_beyond_the_plane_are_counted_and_told(pressed):
    model = pressed.model
    assert len(model.nodes_beyond) > 0
    z = model.mesh.nodes[model.nodes_beyond, 2]
    assert np.all((z > 0.2) & (z < 0.3))
    assert any(f"beyond the closing plane at {len(model.nodes_beyond)} nodes" in text for text in pressed.warnings)


def test_nothing_is_said_of_faces_that_do_not_start_beyond_the_plane(case):
    """A wall of half the thickness clears the plane everywhere."""
    thin = closure_model(case.replace({"valve.thickness_factor": 0.5}))
    assert len(thin.nodes_beyond) == 0
    assert list(thin.start_warnings()) == []


def test_the_answer_does_not_depend_on_the_penalty(case, pressed):
    """Three times softer: the multipliers bring the same forces, but for the wider rounding of the law's kink."""
    state, reference = reach(case, 7e3, contact_depth=1e-5), pressed.states[0]
    assert state.multiplier_updates > 0
    assert state.contact_force == pytest.approx(reference.contact_force, rel=1e-3)
    assert state.max_displacement == pytest.approx(reference.max_displacement, rel=1e-3)


def test_the_answer_does_not_depend_on_the_steps(case, pressed):
    one = reach(case, 28e3, max_step=1.5e3)
    assert one.contact_force == pytest.approx(pressed.states[-1].contact_force, rel=1e-4)
    assert one.max_displacement == pytest.approx(pressed.states[-1].max_displacement, rel=1e-4)


def test_stiffness_is_followed_at_every_step(pressed):
    assert len(pressed.walk) > 5
    lowest = [point.lowest_eigenvalue for point in pressed.walk]
    assert min(lowest) > 0 and pressed.critical_pressure is None
    assert min(lowest) < 0.8 * lowest[0]
    state = pressed.states[-1]
    assert state.lowest_symmetric_eigenvalue <= state.lowest_stiffness_eigenvalue * (1 + 1e-9)
    assert state.asymmetry < 1e-3


@pytest.mark.slow
def test_without_arclength_a_walk_ends_at_its_limit_point(case):
    """A thin wall ends where arclength finds its first limit point, and says where."""
    thin = case.replace({"valve.thickness_factor": 0.25, "closure.max_step": "0.5 kPa"})
    result = closure(thin.replace({"closure.arclength": False}), [200.0, 28e3, 29e3])
    limit, last = result.buckling[0], result.before_limit
    assert len(result.failures) == 1 and "limit point" in result.failures[0]
    assert [state.pressure for state in result.states] == [200.0]
    assert "1 of 3 back pressures were reached" in result.shortfall()
    assert result.walk[-1].pressure == last.pressure and 200.0 < last.pressure < limit.pressure and last.converged
    assert limit.kind == "limit point" and limit.pressure - last.pressure < 0.01 * limit.pressure
    assert any(line.endswith("last before the limit") for line in result.lines())
    assert (result.safety.limit, result.safety.limit_pressure) == ("buckling", limit.pressure)
    assert abs(limit.eigenvalue) < 1e-3 * result.walk[0].lowest_eigenvalue


def test_an_interrupt_keeps_what_was_found(case):
    result = closure(case, [1e3, 2e3], observer=Stop(1))
    assert not result.complete and not result.failures
    assert [state.pressure for state in result.states] == [1e3]


def test_a_penetration_out_of_reach_is_a_failure(case, monkeypatch):
    monkeypatch.setattr(walk, "MOST_UPDATES", 0)
    found = closure(case.replace({"closure.contact_depth": 1e-4}), [14e3])
    assert not found.states and "penetration" in found.failures[0]


def test_shut_intervals_are_cut_between_rows_where_roots_of_areas_are_linear():
    z = np.array([0.0, 1.0, 2.0, 3.0, 4.0])
    passage = Passage(z, np.array([0.0, 0.0, 2.0, 0.0, 2.0]), 1.0, 0.5)
    assert np.ravel(passage.shut_intervals) == pytest.approx([0.0, 1.5, 2.5, 3.5])
    assert passage.shut_length == pytest.approx(2.5) and passage.lip_seal == pytest.approx(1.5)
    assert Passage(z, np.maximum(z - 0.5, 0.0) ** 2, 1.0, 0.81).lip_seal == pytest.approx(1.4)
    assert Passage(z, np.array([2.0, 0.0, 0.0, 2.0, 2.0]), 1.0, 0.5).lip_seal == 0.0


def test_the_opening_at_rest_is_the_gap_over_the_lips_width():
    case = thesis_case({"mesh.around": 56, "mesh.along": 16})
    model = closure_model(case)
    passage = model.passage(model.pressed.rest())
    assert passage.reference == pytest.approx(0.00019 * 0.125, rel=0.05)
    # the flange is a circle of the inner radius
    inner = case.valve.flange_radius - 0.008
    assert passage.area[-1] == pytest.approx(0.25 * np.pi * inner**2, rel=0.02)


@pytest.mark.slow
def test_energy_balances_to_1e_8_on_request_from_the_first_touch_on(case):
    """Work of the pressure, work of renewing multipliers, strain energy and contact potential, with load steps as they
    are.
    """
    case = case.replace({"mesh.around": 6, "mesh.along": 10})
    rough = reach(case, 7e3)
    fine = reach(case, 7e3, balance_tolerance=1e-8)
    assert fine.multiplier_updates > 0
    assert fine.energy_balance < 1e-8 < 1e-5 < rough.energy_balance < 1e-2
    # for the balance alone: the state is the same
    assert fine.load_steps == rough.load_steps and np.array_equal(fine.nodal, rough.nodal)


@pytest.mark.parametrize("share", [1.0, 1.01])
def test_no_refinement_hides_a_force_that_is_no_derivative_of_the_energy(case, monkeypatch, share):
    model = closure_model(case)
    steps = LoadSteps(model.pressed, LoadStepOptions(first_step=50.0))
    steps.reach(2e3)
    for _ in range(3):
        model.pressed.renew_multipliers(steps.q)
        steps.settle()
    energy = model.pressed.contact.energy
    monkeypatch.setattr(model.pressed.contact, "energy", lambda *state: share * energy(*state))
    ledger = EnergyLedger(model.pressed, 1e-7)
    ledger.begin(steps.q, 2e3)
    model.pressed.renew_multipliers(steps.q)
    steps.settle()
    ledger.add(steps.q, 2e3)
    steps.reach(2.05e3)
    ledger.add(steps.q, steps.pressure)
    ledger.settle()
    assert ledger.renewal > 0.0
    assert ledger.error < 1e-7 if share == 1.0 else ledger.error > 1e-6
