"""The equations of a step against the time-dependent residual of the model, and their iteration matrix against
differences.
"""

import numpy as np
import pytest

from dbvfiv.model.residual import ValveResidual
from dbvfiv.motion.equations import ValveMotion
from dbvfiv.motion.scheme import scheme
from dbvfiv.motion.stepper import Trial, consistent_state

LAWS = [
    {"fluid.continuity": "quasi-steady"},
    {"fluid.continuity": "storage"},
    {"fluid.continuity": "storage", "mesh.inertia": "parabolic"},
]


@pytest.mark.parametrize(
    "law", [LAWS[2], {"fluid.unsteady": False}, {"shell.mass": "averaged"}, {"layers.2.begin": 0.3}]
)
def test_consistent_accelerations_meet_the_model(valve, open_state, law):
    """Whatever the mass, and where layers end."""
    model = valve({"fluid.density": 50.0} | law)
    motion, definition = ValveMotion(model), ValveResidual(model)
    v = 0.05 * open_state / np.abs(open_state).max()
    state = consistent_state(motion, 0.0, open_state, v, 9e3, np.array([0.4]))
    given = {"inlet": 9e3, "density": 50.0, "alpha": motion.mu.alpha, "beta": motion.mu.beta}

    def residual(r):
        return definition.value((open_state, v, state.a, state.fluid.velocity, r), given)

    rate = 0.0
    if (
        motion.fluid.moves
    ):  # psi = U times an integral, at the areas' rates; only the outlet's equation fixes the rate of U
        rates = [residual(r)[-1] for r in (0.0, 1.0)]
        rate = -rates[0] / (rates[1] - rates[0])
    force = residual(rate)[: model.size]
    scale = np.abs(state.force).max()
    assert np.abs(force).max() < 1e-9 * scale


@pytest.mark.parametrize("law", LAWS + [{"fluid.unsteady": False}])
@pytest.mark.parametrize("h, robust", [(1e-3, False), (1e-4, False), (5e-4, True)])
def test_iteration_matrix_against_differences(valve, open_state, law, h, robust):
    motion = ValveMotion(valve({"fluid.density": 200.0} | law))
    state = consistent_state(
        motion, 0.0, open_state, 0.02 * open_state / np.abs(open_state).max(), 12e3, np.array([0.3])
    )
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
    back = motion.solve((residuals[0] - residuals[1]) / 2e-2)
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
