"""The equations of a step against the time-dependent residual of the model, and their iteration matrix against
differences.
"""

import numpy as np
import pytest

from dbvfiv.flow import FlowMotion
from dbvfiv.flow.stepping import MovingFluid
from dbvfiv.model.residual import ValveResidual
from dbvfiv.motion.equations import ValveMotion
from dbvfiv.motion.scheme import scheme
from dbvfiv.motion.state import consistent_state
from dbvfiv.motion.trial import Trial

LAWS = [
    {"fluid.continuity": "quasi-steady"},
    {"fluid.continuity": "storage"},
    {"fluid.continuity": "storage", "mesh.inertia": "parabolic"},
]


@pytest.mark.parametrize("law", LAWS + [{"fluid.unsteady": False}, {"shell.mass": "averaged"}, {"layers.2.begin": 0.3}])
def test_consistent_accelerations_meet_the_model(valve, open_state, law):
    """Whatever the mass, and where layers end."""
    model = valve({"fluid.density": 50.0} | law)
    motion, definition = ValveMotion(model), ValveResidual(model)
    v = 0.05 * open_state / np.abs(open_state).max()
    state = consistent_state(motion, 0.0, open_state, v, 0.4, 9e3)
    given = {"inlet": 9e3, "density": 50.0, "alpha": motion.mu.alpha, "beta": motion.mu.beta}

    def residual(r):
        return definition.value((open_state, v, state.a, state.speed, r), given)

    rate = 0.0
    if (
        motion.moving_fluid
    ):  # psi = U times an integral, at the areas' rates; only the outlet's equation fixes the rate of U
        rates = [residual(r)[-1] for r in (0.0, 1.0)]
        rate = -rates[0] / (rates[1] - rates[0])
    force, outlet = np.split(residual(rate), [model.size])
    scale = np.abs(state.force).max()
    assert np.abs(force).max() < 1e-9 * scale
    if motion.moving_fluid:
        assert abs(outlet) < 1e-6


@pytest.mark.parametrize("law", LAWS)
def test_flow_is_that_of_the_channel(valve, law):
    model = valve({"fluid.density": 50.0} | law)
    channel, fluid = model.flow, MovingFluid(model.flow, 50.0)
    rng = np.random.default_rng(0)
    area = model.rows.areas(model.nodal(model.rest())) + 1e-3 * rng.random(model.stations)
    rate, acceleration, h = 1e-2 * rng.standard_normal(model.stations), rng.standard_normal(model.stations), 1e-6
    psi_rate = (
        fluid.state(area + h * rate, rate + h * acceleration, 0.3 + 2 * h).psi
        - fluid.state(area - h * rate, rate - h * acceleration, 0.3 - 2 * h).psi
    ) / (2 * h)
    p = fluid.pressure(fluid.state(area, rate, 0.3), psi_rate, 6e3)
    motion = FlowMotion(area, rate, acceleration, 0.3, 2.0)
    expected, outlet = channel.evaluate(motion, {"inlet": 6e3, "density": 50.0})
    expected[0] = outlet[0]
    assert p == pytest.approx(expected, rel=1e-6, abs=1e-3)


@pytest.mark.parametrize("law", LAWS)
def test_slopes_of_the_flow(valve, law):
    model = valve({"fluid.density": 50.0} | law)
    fluid = MovingFluid(model.flow, 50.0)
    rng = np.random.default_rng(1)
    area = model.rows.areas(model.nodal(model.rest())) + 1e-5 * rng.random(model.stations)
    rate = 1e-2 * rng.standard_normal(model.stations)
    found = fluid.slopes(area, rate, 0.3)
    steps = [
        (1e-9 * rng.standard_normal(model.stations), 0, 0),
        (0, 1e-6 * rng.standard_normal(model.stations), 0),
        (0, 0, 1e-4),
    ]
    for slope, (da, dr, du) in zip(found, steps):
        change = fluid.state(area + da, rate + dr, 0.3 + du).speed - fluid.state(area - da, rate - dr, 0.3 - du).speed
        direction = da if np.ndim(da) else dr if np.ndim(dr) else du
        expected = slope @ direction if np.ndim(direction) else slope * direction
        assert 0.5 * change == pytest.approx(expected, rel=2e-4, abs=1e-6 * np.abs(change).max())


@pytest.mark.parametrize("theta", [0.5, 1.0])
@pytest.mark.parametrize("law", LAWS)
def test_the_inlet_velocity_is_the_root_without_reversal(valve, law, theta):
    fluid = MovingFluid(valve({"fluid.density": 1.2} | law).flow, 1.2)
    area, rate = np.linspace(1e-4, 0.0135, fluid.channel.count), np.full(fluid.channel.count, -1e-3)
    old = 10.0
    psi = fluid.state(area, rate, old).psi
    # a passage that closes a hundredfold within a step
    shut = area.copy()
    shut[0] = 1e-6
    mid = (area + theta * (shut - area), rate)
    weight, known = 1e4, -1e4 * psi
    u = fluid.velocity(mid, (shut, rate), 6e3, old, theta, weight, float(known[0]))
    flow = fluid.state(*mid, old + theta * (u - old))
    assert old + theta * (u - old) > 0
    assert fluid.pressure(flow, weight * fluid.state(shut, rate, u).psi + known, 6e3)[0] == pytest.approx(0.0, abs=1e-4)


@pytest.mark.parametrize("law", LAWS + [{"fluid.unsteady": False}])
@pytest.mark.parametrize("h, robust", [(1e-3, False), (1e-4, False), (5e-4, True)])
def test_iteration_matrix_against_differences(valve, open_state, law, h, robust):
    motion = ValveMotion(valve({"fluid.density": 200.0} | law))
    state = consistent_state(motion, 0.0, open_state, 0.02 * open_state / np.abs(open_state).max(), 0.3, 12e3)
    trial = Trial(motion, scheme("generalised-alpha", 0.1), state, h, lambda t: 12e3, robust)
    trial.set(0.5 * state.a)
    trial.evaluate()
    trial.linearise()
    direction = 1e-6 * np.random.default_rng(3).standard_normal(motion.size) * motion._scale
    residuals = []
    for sign in (1, -2):
        trial.move(sign * 1e-2, direction)
        trial.evaluate()
        residuals.append(trial.residual.copy())
    back, _ = motion.solve((residuals[0] - residuals[1]) / 2e-2, 0.0)
    # what is left out: rotary inertia's change, the second derivative of areas times the rates
    assert np.abs(back - direction).max() < 5e-3 * np.abs(direction).max()


def test_energies_against_their_definition(valve, open_state):
    model = valve()
    motion = ValveMotion(model)
    v = np.random.default_rng(4).standard_normal(model.size)
    kinetic, strain, stop = motion.energies(open_state, v)
    assert kinetic == pytest.approx(0.5 * v @ (model.shell.dofs.matrix(model.mass(open_state)) @ v), rel=1e-12)
    assert strain == pytest.approx(model.shell.energy(open_state), rel=1e-12)
    assert stop == model.stops.energy(open_state)
