"""Cycles of the valve and their Floquet exponents against runs in time, extrapolated to steps of no length."""

from __future__ import annotations

import numpy as np
import pytest

import dbvfiv
from dbvfiv.model.dynamics import Conditions
from dbvfiv.motion.equations import ValveMotion
from dbvfiv.motion.scheme import scheme
from dbvfiv.motion.state import consistent_state
from dbvfiv.motion.stepper import StepOptions, Stepper
from dbvfiv.studies.session import Session

pytestmark = pytest.mark.slow

CASE = {
    "mesh.around": 8,
    "mesh.along": 14,
    "drive.pressure": 6e3,
    "damping.alpha": 0.0,
    "damping.beta": 3e-3,
    "cycle.over": "density=70:100:4",
}
PERIODS = 8


@pytest.fixture(scope="module")
def branch():
    return Session(dbvfiv.load().case.replace(CASE)).perform("cycle")


def amplitudes(point, steps: int, size: float) -> np.ndarray:
    """Half the swing of the lip in each period of a run that begins on the cycle, its oscillation times `size`."""
    orbit, model = point.orbit, point.orbit.model
    motion, n = ValveMotion(model, Conditions(orbit.mu["density"], 0.0, 3e-3)), model.size
    mean = orbit.motion.coefficients[0]
    x, v = mean + size * (orbit.motion.at([0.0])[0] - mean), size * orbit.motion.rate([0.0])[0]
    state = consistent_state(motion, 0.0, x[:n], v[:n], x[n], orbit.mu["inlet"])
    options = StepOptions(tolerance=1e-6)
    stepper = Stepper(motion, scheme("generalised-alpha"), lambda t: orbit.mu["inlet"], options)
    lip, number = [], model.shell.dofs.index[model.mesh.rows[0, 0], 1]
    for _ in range(steps * PERIODS):
        state = stepper.step(state, orbit.motion.period / steps).state
        lip.append(state.q[number])
    lip = np.array(lip)
    return np.array([_swing(lip, k * steps, (k + 1) * steps) for k in range(1, PERIODS - 1)])


def _swing(lip: np.ndarray, first: int, last: int) -> float:
    """Half the way between extremes of a stretch, by parabolas."""

    def peak(sign):
        k = first + int(np.argmax(sign * lip[first:last]))
        a, b, c = sign * lip[k - 1 : k + 2]
        return b - 0.125 * (c - a) ** 2 / (a - 2 * b + c)

    return 0.5 * (peak(1.0) + peak(-1.0))


@pytest.mark.parametrize("value", [80.0, 70.0])
def test_amplitude_and_exponent(branch, value):
    """Amplitude within 0.1 %; a change of it decays with the leading exponent within 2 %."""
    point = branch.nearest(value)
    assert point.value == value and point.stable
    rates, ends = [], []
    for steps in (60, 120):
        own, other = (amplitudes(point, steps, size) for size in (1.0, 1.02))
        change = np.log(np.abs(other - own))[2:]
        rates.append(np.polyfit(np.arange(len(change)) * point.orbit.motion.period, change, 1)[0])
        # what it settles at, by the geometric series of its changes
        share = np.exp(rates[-1] * point.orbit.motion.period)
        ends.append(own[-1] + (own[-1] - own[-2]) * share / (1 - share))
    amplitude = (4 * ends[1] - ends[0]) / 3
    rate = (4 * rates[1] - rates[0]) / 3
    print(f"{value}: amplitude {1e3 * amplitude:.4f} mm in time, {1e3 * point.amplitude:.4f} as a series; ", end="")
    print(f"leading exponent {rate:.3f} 1/s in time, {point.exponents[0]:.3f} as a series; steps {rates}, {ends}")
    assert abs(amplitude - point.amplitude) < 1e-3 * point.amplitude
    assert abs(rate - point.exponents[0].real) < 0.02 * abs(rate)
