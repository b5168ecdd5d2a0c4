"""The coupled valve with flow laws of none, of one unknown with terms and of three: one contract for all."""

from __future__ import annotations

import numpy as np
import pytest

from dbvfiv.case.parameters import Mu
from dbvfiv.flow import Channel
from dbvfiv.model import linearise
from dbvfiv.model.equilibria import LoadPath, SteadyOptions
from dbvfiv.model.newton import NewtonOptions
from dbvfiv.model.residual import ValveResidual
from dbvfiv.motion.equations import ValveMotion
from dbvfiv.motion.scheme import scheme
from dbvfiv.motion.stepper import StepOptions, Stepper, consistent_state
from eigen import leading_modes
from tests.flow.test_adding_a_law import LipLoss, Pipe
from tests.flow.vessel import Vessel

PRESSURE = 5e3
MU = {"inlet": PRESSURE, "density": 20.0, "alpha": 2.0, "beta": 0.001, "storage": 0.6}
LAWS = [pytest.param("uniform", marks=pytest.mark.slow), "terms", pytest.param("vessel", marks=pytest.mark.slow)]


def with_law(make_model, name: str):
    """A small valve whose flow has another law."""
    small = {"mesh__around": 6, "mesh__along": 8}
    if name == "uniform":
        return make_model(drive__kind="uniform", **small)
    model = make_model(fluid__continuity="storage", **small)
    terms = (LipLoss(0.4), Pipe(2.0, 0.3)) if name == "terms" else ()
    law = Channel(model.flow.z, model.flow.floor, 1.0, terms=terms)
    model.flow = Vessel(law, 2e-7, 0.5) if name == "vessel" else law
    return model


@pytest.fixture(scope="module", params=LAWS)
def settled(request, make_model):
    """Model and equilibrium, as exact as rounding allows."""
    model = with_law(make_model, request.param)
    path = LoadPath(model, SteadyOptions(NewtonOptions(1e-13)))
    path.go_to(PRESSURE)
    return model, path.q


def test_the_steady_state_is_one_of_the_equations_of_motion(settled):
    model, q = settled
    zero, inner = np.zeros(model.size), model.flow.steady_inner(model.rows.areas(model.nodal(q)), MU)
    assert np.abs(ValveResidual(model).value((q, zero, zero, inner, np.zeros_like(inner)), MU)).max() < 1e-8 * PRESSURE


def test_modes_satisfy_the_equations_of_motion(settled):
    """The time-dependent residual along Re(shape exp(lambda t)) vanishes to first order in the amplitude."""
    model, q = settled
    conditions = Mu(density=MU["density"], alpha=MU["alpha"], beta=MU["beta"])
    pencil = linearise(model, q, PRESSURE).pencil(conditions)
    assert pencil.b == model.flow.inner
    found = leading_modes(pencil, 2)
    mode = found.mode(int(np.argmax(found.eigenvalues.imag)))
    steady = model.flow.steady_inner(model.rows.areas(model.nodal(q)), MU)
    value, shape, inner = mode.eigenvalue, mode.q / np.abs(mode.q).max(), mode.u / np.abs(mode.q).max()

    residual, given = ValveResidual(model), {"inlet": PRESSURE, **conditions}

    def left(size):
        moved = [size * (value**k * shape).real for k in range(3)]
        motion = q + moved[0], moved[1], moved[2], steady + size * inner.real, size * (value * inner).real
        force, rest = np.split(residual.value(motion, given), [model.size])
        inertia = np.linalg.norm(model.shell.dofs.matrix(model.mass(q)) @ moved[2])
        return np.linalg.norm(force) / inertia, np.abs(rest).max(initial=0.0)

    (force, rest), (half_force, half_rest) = left(1e-5), left(5e-6)
    assert force < 5e-2 and half_force == pytest.approx(force / 2, rel=0.1)
    assert half_rest == pytest.approx(rest / 4, rel=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("settled", ["terms"], indirect=True)
def test_a_small_push_along_a_mode_follows_it_in_time(settled):
    """Growth and frequency of the leading oscillating mode, from half a period of time steps: to the square of the step
    of the motion linear in the push.
    """
    (model, q), conditions = settled, Mu(density=20.0, alpha=0.0, beta=0.0003)
    found = leading_modes(linearise(model, q, PRESSURE).pencil(conditions), 4)
    mode = found.mode(int(np.flatnonzero(found.eigenvalues.imag > 1.0)[0]))
    value, scale = mode.eigenvalue, 1e-6 / np.abs(mode.q).max()
    shape = scale * mode.q
    speed = model.flow.inlet_velocity(model.rows.areas(model.nodal(q)), PRESSURE, conditions.density)
    duration, errors = np.pi / value.imag, []
    for steps in (50, 100):
        motion = ValveMotion(model, conditions)
        pushed = speed + float((scale * mode.u[0]).real)
        state = consistent_state(motion, 0.0, q + shape.real, (value * shape).real, PRESSURE, np.array([pushed]))
        stepper = Stepper(motion, scheme("generalised-alpha"), lambda t: PRESSURE, StepOptions(tolerance=1e-7))
        for _ in range(steps):
            state = stepper.step(state, duration / steps).state
        expected = (np.exp(value * duration) * shape).real
        errors.append(np.linalg.norm(state.q - q - expected) / np.linalg.norm(expected))
    assert errors[0] < 2e-2 and errors[1] < 0.35 * errors[0]
