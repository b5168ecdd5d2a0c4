"""The valve under back pressure on a coarse mesh: what is found is an equilibrium, is told honestly, and does not
depend on how it was found.
"""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.sparse import diags

from dbvfiv.errors import SolveError
from dbvfiv.model.closed import ClosedValve, Passage, load_steps
from dbvfiv.model.load_curve import LoadCurve
from dbvfiv.model.load_steps import LoadStepOptions, LoadSteps
from dbvfiv.model.newton import NewtonResult
from dbvfiv.observer import Observer
from dbvfiv.studies.case import Case, load_case, thesis_case
from dbvfiv.studies.closure.buckling import BucklingWatch, _Known, follow_past_limits, spectrum_of
from dbvfiv.studies.closure.walk import ClosureWalk
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


def reach(case, pressure, **keys):
    """State at one back pressure."""
    return closure(case.replace({name.replace("__", "."): value for name, value in keys.items()}), [pressure]).states[0]


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
    plane = pressed.model.contact
    for state in pressed.states:
        assert state.converged and state.residual <= 1e-8
        assert state.penetration < 2 * state.largest_contact_pressure / plane.law.penalty
        assert state.force_balance < 1e-8
        assert state.stable and not state.beyond_limit
        assert state.contact_pressure.min() >= 0.0
        assert state.contact_force == pytest.approx(2 * np.sum(plane.area * state.contact_pressure[plane.nodes]))


def test_another_element_stays_whatever_is_held(case):
    """Held lips and the balance of forces took the default element."""
    plain = case.replace({"mesh.element": "MITC4"})
    models = [ClosedValve(plain.replace({"closure.supports": name})) for name in ("contact", "held-lips")]
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
    assert high.least_opening < 0.2 * 4 * pressed.model.passage(pressed.model.rest()).reference


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
    thin = ClosedValve(case.replace({"valve.thickness_factor": 0.5}))
    assert len(thin.nodes_beyond) == 0
    assert list(thin.start_warnings()) == []


@pytest.mark.slow
def test_the_answer_does_not_depend_on_the_penalty(case, pressed):
    """Three times softer faces carry the same forces."""
    state, reference = reach(case, 7e3, supports__contact_stiffness=3e9), pressed.states[0]
    assert state.penetration > 2 * reference.penetration
    assert state.contact_force == pytest.approx(reference.contact_force, rel=1e-3)
    assert state.max_displacement == pytest.approx(reference.max_displacement, rel=1e-3)


@pytest.mark.slow
def test_the_answer_does_not_depend_on_the_steps(case, pressed):
    one = reach(case, 28e3, closure__max_step=2.5e3)
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


@pytest.mark.parametrize("beyond", [(400.0, 500.0, 900.0, 2e3), (40.0, 50.0, 60.0, 70.0)])
@pytest.mark.parametrize("count", [1, 2, 4])
@pytest.mark.parametrize("least", [-500.0, -50.0, 10.0])
def test_the_lowest_eigenvalue_is_found_behind_nearer_ones(least, count, beyond):
    values = np.array([least, 30.0, 32.0, 35.0, *beyond])
    found = spectrum_of(diags(values).tocsr(), diags(np.ones(8)).tocsr(), 1e3, count)
    assert found.values.real == pytest.approx(values[:count]) == found.symmetric_values
    assert found.lowest == pytest.approx(least) and abs(found.shape[0]) == 1.0


def test_the_eigenvalue_of_a_limit_point_is_the_one_that_vanishes():
    """And not a lower one of bifurcations before it."""
    stiffness = diags([-500.0, -30.0, 1e-9, 40.0, 50.0, 60.0, 70.0, 80.0]).tocsr()
    shell = SimpleNamespace(dofs=SimpleNamespace(matrix=lambda part: part))
    tangent = SimpleNamespace(stiffness=stiffness)
    model = SimpleNamespace(shell=shell, tangent=lambda q, p: tangent, mass=lambda q: diags(np.ones(8)).tocsr())
    at = 3e3, np.zeros(8), np.eye(8)[2], 0
    curve = SimpleNamespace(model=model, limit_states=lambda: [at], pressures=[0.0, 4e3], states=[at[1]] * 2, reason="")
    curve.stops_at_limit = False
    curve.extend = lambda target: None
    (limit,) = follow_past_limits(curve, 4e3).limits
    assert limit.eigenvalue == pytest.approx(1e-9, rel=1e-3)


@pytest.mark.parametrize("at", [1.123, 1.5, 1.9])
def test_few_spectra_locate_buckling_where_the_eigenvalue_drops_as_faces_part(at):
    """By 4e4 over 1e-10 of the way; the secant rule alone took 206 to 381."""
    watch, seen = BucklingWatch(None, None, None), []

    def known(pressure):
        seen.append(pressure)
        return _Known(pressure, None, np.interp(pressure, (1.0, at, at + 1e-10, 2.0), (5e4, 4e4, -1.0, -2.0)), None)

    watch._on_path = lambda low, high, pressure: known(pressure)
    assert watch._locate(known(1.0), known(2.0)).pressure == pytest.approx(at, rel=1e-8) and len(seen) < 90


@pytest.mark.parametrize("back", [0.0, 100.0, -1.0])
@pytest.mark.parametrize(("lower", "number"), [(1.0003, 0), (0.8, 2)])
def test_limit_points_that_are_put_down_to_the_mesh_are_no_limit_states(lower, number, back):
    """Whatever the pressure behind the valve, by which pairs of limit points with 6 % between them were left out."""
    curve, along = object.__new__(LoadCurve), zip((0.0, 1.0, 1.0005, lower, 2.0), (1.0, 0.5, 0.01, -0.01, 1.0))
    points = [SimpleNamespace(z=np.array([0.0, back + p]), tangent=np.array([1.0, slope])) for p, slope in along]
    curve.model = SimpleNamespace(flow=SimpleNamespace(back=back))
    curve._branch, curve._tracer = SimpleNamespace(points=points), lambda: SimpleNamespace(root=lambda *_: None)
    assert [state.pressure - back for state in curve.limit_states()] == pytest.approx([1.0005, lower][:number])


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


def test_shut_intervals_are_cut_between_rows_where_roots_of_areas_are_linear():
    z = np.array([0.0, 1.0, 2.0, 3.0, 4.0])
    passage = Passage(z, np.array([0.0, 0.0, 2.0, 0.0, 2.0]), 1.0, 0.5)
    assert np.ravel(passage.shut_intervals) == pytest.approx([0.0, 1.5, 2.5, 3.5])
    assert passage.shut_length == pytest.approx(2.5) and passage.lip_seal == pytest.approx(1.5)
    assert Passage(z, np.maximum(z - 0.5, 0.0) ** 2, 1.0, 0.81).lip_seal == pytest.approx(1.4)
    assert Passage(z, np.array([2.0, 0.0, 0.0, 2.0, 2.0]), 1.0, 0.5).lip_seal == 0.0


def test_the_opening_at_rest_is_the_gap_over_the_lips_width():
    case = thesis_case({"mesh.around": 56, "mesh.along": 16})
    model = ClosedValve(case)
    passage = model.passage(model.rest())
    assert passage.reference == pytest.approx(0.00019 * 0.125, rel=0.05)
    # the flange is a circle of the inner radius
    inner = case.valve.flange_radius - 0.008
    assert passage.area[-1] == pytest.approx(0.25 * np.pi * inner**2, rel=0.02)


@pytest.mark.slow
def test_the_first_load_step_stays_on_the_path_from_rest_which_is_stable():
    """At 50 Pa a step from rest ended with the lip curled up by 18 mm, and the walk went on from there."""
    coarse = {"mesh.around": 6, "mesh.along": 10, "closure.max_step": "1 kPa"}
    walk = ClosureWalk(ClosedValve(thesis_case(coarse)), SimpleNamespace(rows=lambda table: 0))
    assert walk._resume() == 0 and walk.own._stable.pressure == 0.0 < walk.own._stable.lowest
    steps = LoadSteps(walk.model, load_steps(walk.model))
    steps.reach(50.0)
    assert np.abs(walk.model.nodal(steps.q)[:, :3]).max() < 3e-4


def test_a_seventh_of_a_lens_is_open(case):
    """Lips bowed apart by 40 mm are shut where they leave a fifth of their gap, and not before."""
    model = ClosedValve(case.replace({"valve.lip_rise": "40 mm"}))
    nodes, down = model.mesh.nodes, np.zeros((len(model.mesh.nodes), 5))
    down[:, 1] = -6.0 / 7.0 * np.maximum(nodes[:, 1] - 6e-3, 0.0) * (nodes[:, 2] < 0.9 * case.valve.duckbill_length)
    passage = model.passage(model.shell.dofs.restrict(down))
    assert model.reference_opening == pytest.approx(4 * 1e-4 * 0.125, rel=0.05)
    assert passage.left > 10 and not passage.shut_intervals


@pytest.mark.slow
def test_work_and_energies_balance_the_better_the_smaller_the_steps(case):
    """Work of the pressure against strain energy and energy of the contact, from the first touch on."""
    case = case.replace({"mesh.around": 6, "mesh.along": 10})
    errors = [reach(case, 7e3, closure__max_step=step).energy_balance for step in (2e3, 250.0, 30.0)]
    assert errors[1] < errors[0] < 1e-2 and errors[2] < 1e-5, errors


@pytest.mark.slow
def test_a_pair_of_limit_points_of_the_mesh_ends_no_path_without_arclength():
    """At 50 872 Pa such a pair ended it with no buckling, next to where the wall snaps."""
    keys = {"mesh.around": 6, "mesh.along": 8, "materials.strain_level": 0.2, "closure.max_step": "10 kPa"}
    model = ClosedValve(load_case("cases/dbv12.toml").replace(keys))
    steps = LoadSteps(model, load_steps(model))
    steps.reach(50793.75)
    at = steps.pressure, steps.q
    path = follow_past_limits(LoadCurve(model, steps.options.newton, Observer(), at, stops_at_limit=True), 6e4)
    assert [limit.pressure for limit in path.limits] == pytest.approx([50880.3], abs=0.5) and not path.reached
    pressures = [pressure for pressure, _ in path.points]
    assert pressures == sorted(pressures) and 50870.0 < pressures[-1] < path.limits[0].pressure


class Ends(LoadSteps):
    """Load steps along a path that ends at a pressure, `model`."""

    def __post_init__(self):
        self.origin, self.step, self.slope, self.refused = self.pressure, self.options.first_step, None, 0

    def _attempt(self, aim, straight):
        self.refused += aim > self.model
        return NewtonResult(np.zeros(1), aim <= self.model, 1, 0.0, 0.0, "past the end"), None


@pytest.mark.parametrize("back", [0.0, 1e5, -2e4])
def test_load_steps_come_to_the_end_of_a_path_whatever_the_pressure_it_starts_from(back):
    """Behind 10 m of water they ended half a pascal short of it; elsewhere 12 of them were refused on the way."""
    steps = Ends(back + 276.03, LoadStepOptions(min_step=1e-4, first_step=0.5, max_step=10.0), back)
    with pytest.raises(SolveError):
        steps.reach(back + 280.0)
    assert steps.pressure == pytest.approx(back + 276.03, abs=0.06)
    assert steps.refused <= 10


def test_no_load_step_crosses_a_limit_point():
    """At 52 046.7 Pa the wall snaps by 5 mm, a third of its thickness; just below it a step of 31 Pa ended behind it,
    no farther from its prediction than steps may, and the valve was sealed at 58 kPa with no buckling.
    """
    rated = 58249.24460623593
    wall = {"valve.thickness_factor": 1.0712172422384652, "valve.lip_rise": 0.009851514154606056}
    changes = {"mesh.around": 6, "mesh.along": 8, "materials.strain_level": "40 %", "closure.rated_pressure": rated}
    model = ClosedValve(thesis_case(wall | changes))
    steps = LoadSteps(model, load_steps(model))
    with pytest.raises(SolveError):
        for pressure in (rated / 7, rated / 2, rated):
            steps.reach(pressure)
    assert steps.pressure == pytest.approx(52046.7, abs=1.0)
    last = steps.slope.copy()  # and not that of the attempt that failed
    assert steps.reach(steps.pressure).iterations == 0 and np.array_equal(steps.slope, last)
