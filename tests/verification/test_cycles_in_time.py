"""Cycles of the valve and their Floquet exponents against runs in time, extrapolated to steps of no length.

On a coarse mesh; amplitudes and periods on the mesh of the cases too.
"""

from __future__ import annotations

import numpy as np
import pytest

from dbvfiv.case.parameters import Mu
from dbvfiv.motion.equations import ValveMotion
from dbvfiv.motion.scheme import scheme
from dbvfiv.motion.stepper import StepOptions, Stepper, consistent_state
from dbvfiv.studies.case import thesis_case
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
    return Session(thesis_case(CASE)).perform("cycle")


def run(point, steps: int, size: float = 1.0, periods: int = PERIODS) -> np.ndarray:
    """Displacements of the lip at each step of a run that begins on the cycle, its oscillation times `size`."""
    orbit, model = point.orbit, point.orbit.model
    motion, n = ValveMotion(model, Mu(density=orbit.mu["density"], alpha=0.0, beta=3e-3)), model.size
    mean = orbit.motion.coefficients[0]
    x, v, _ = (part[0] for part in orbit.motion.with_rates([0.0]))
    x, v = mean + size * (x - mean), size * v
    state = consistent_state(motion, 0.0, x[:n], v[:n], orbit.mu["inlet"], np.array([x[n]]))
    options = StepOptions(tolerance=1e-6)
    stepper = Stepper(motion, scheme("generalised-alpha"), lambda t: orbit.mu["inlet"], options)
    lip, number = [], model.shell.dofs.index[model.mesh.rows[0, 0], 1]
    for _ in range(steps * periods):
        state = stepper.step(state, orbit.motion.period / steps).state
        lip.append(state.q[number])
    return np.array(lip)


def amplitudes(lip: np.ndarray, steps: int) -> np.ndarray:
    """Half the swing of the lip in each period but the first and the last."""
    return np.array([_swing(lip, k * steps, (k + 1) * steps) for k in range(1, len(lip) // steps - 1)])


def settled(swings: np.ndarray, share: float) -> float:
    """What swings settle at that approach it by a share in each period."""
    return swings[-1] + (swings[-1] - swings[-2]) * share / (1 - share)


def periods_between_rises(lip: np.ndarray) -> np.ndarray:
    """Steps between upward crossings of the mean, these placed by cubics through four values."""
    off = lip - 0.5 * (lip.max() + lip.min())
    places = []
    for k in np.flatnonzero((off[1:-2] < 0) & (off[2:-1] >= 0)) + 1:
        cubic = np.polynomial.Polynomial.fit(np.arange(4) - 1.0, off[k - 1 : k + 3], 3)
        roots = cubic.roots()
        places.append(k + next(r.real for r in roots if abs(r.imag) < 1e-9 and 0 <= r.real <= 1))
    return np.diff(places)


def _swing(lip: np.ndarray, first: int, last: int) -> float:
    """Half the way between extremes of a stretch, by parabolas."""

    def peak(sign):
        k = first + int(np.argmax(sign * lip[first:last]))
        a, b, c = sign * lip[k - 1 : k + 2]
        return b - 0.125 * (c - a) ** 2 / (a - 2 * b + c)

    return 0.5 * (peak(1.0) + peak(-1.0))


@pytest.mark.long
@pytest.mark.parametrize("densities", [(45.0, 25.0), pytest.param((50.0, 40.0, 35.0, 30.0), marks=pytest.mark.random)])
def test_the_branch_on_the_mesh_of_the_cases(densities):
    """28 x 48 elements: amplitude within 0.5 %, period within 0.1 %."""
    mesh = {"mesh.around": 28, "mesh.along": 48, "cycle.over": "density=25:60:8"}
    branch = Session(thesis_case(CASE | mesh)).perform("cycle")
    wrong = []
    for value in densities:
        point = branch.nearest(value)
        assert point.value == value and point.stable
        period, share = point.orbit.motion.period, np.exp(point.exponents[0].real * point.orbit.motion.period)
        ends, lengths = [], []
        for steps in (50, 100):
            lip = run(point, steps, periods=10)
            ends.append(settled(amplitudes(lip, steps), share))
            lengths.append(period / steps * periods_between_rises(lip)[-3:].mean())
        amplitude, length = ((4 * b - a) / 3 for a, b in (ends, lengths))
        off = amplitude / point.amplitude - 1, length / period - 1
        print(
            f"{value:g} kg/m3: {1e3 * amplitude:.4f} mm, {1e3 * length:.4f} ms in time (50 and 100 steps a period "
            f"{np.round(1e3 * np.array(ends), 4)} mm, {np.round(1e3 * np.array(lengths), 4)} ms); as a series "
            f"{1e3 * point.amplitude:.4f} mm, {1e3 * period:.4f} ms; off {off[0]:.1e}, {off[1]:.1e}"
        )
        if abs(off[0]) > 5e-3 or abs(off[1]) > 1e-3:
            wrong.append((value, off))
    assert not wrong


@pytest.mark.parametrize("value, printed, share", [(80.0, (4.6004, -6.78), 0.003), (70.0, (6.7151, -15.67), 0.013)])
def test_amplitude_and_exponent(branch, value, printed, share):
    """Those that docs/evidence/cycles.md prints, mm and 1/s: in time an amplitude within 0.005 %, a change of which
    decays with the leading exponent within a share.
    """
    point = branch.nearest(value)
    assert point.value == value and point.stable
    rates, ends = [], []
    for steps in (60, 120):
        own, other = (amplitudes(run(point, steps, size), steps) for size in (1.0, 1.02))
        change = np.log(np.abs(other - own))[2:]
        rates.append(np.polyfit(np.arange(len(change)) * point.orbit.motion.period, change, 1)[0])
        ends.append(settled(own, np.exp(rates[-1] * point.orbit.motion.period)))
    amplitude = (4 * ends[1] - ends[0]) / 3
    rate = (4 * rates[1] - rates[0]) / 3
    print(f"{value}: amplitude {1e3 * amplitude:.4f} mm in time, {1e3 * point.amplitude:.4f} as a series; ", end="")
    print(f"leading exponent {rate:.3f} 1/s in time, {point.exponents[0]:.3f} as a series; steps {rates}, {ends}")
    assert 1e3 * point.amplitude == pytest.approx(printed[0], abs=1e-4)
    assert point.exponents[0].real == pytest.approx(printed[1], abs=0.01)
    assert abs(amplitude - point.amplitude) < 5e-5 * point.amplitude
    assert abs(rate - point.exponents[0].real) < share * abs(rate)
