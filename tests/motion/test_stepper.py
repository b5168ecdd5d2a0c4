"""Steps of the coupled valve: order, energy, contact, slamming, step control."""

from types import SimpleNamespace

import numpy as np
import pytest

from dbvfiv.motion.control import AdaptiveSteps, ControlOptions, FixedSteps, RunOptions, step_control
from dbvfiv.motion.equations import ValveMotion
from dbvfiv.motion.scheme import scheme
from dbvfiv.motion.start import steady_positions
from dbvfiv.motion.stepper import StepFailure, StepOptions, Stepper, consistent_state
from tests.small_valves import FORMER

TIGHT = StepOptions(tolerance=1e-9, floor=1e-13)


def advance(motion, state, h, steps, pressure, name="generalised-alpha", nd=0.0, options=TIGHT, adaptive=False):
    stepper = Stepper(motion, scheme(name, nd), pressure if callable(pressure) else lambda t: pressure, options)
    control = step_control(stepper, ControlOptions(h, adaptive))
    results = []
    for _ in range(steps):
        results.append(control.advance(state, 1e9))
        state = results[-1].state
    return state, results, stepper, control


def flowing(motion, q, start=None):
    """State at rest in the steady flow at 12 kPa through a shape, or elsewhere with the velocity of that flow."""
    model = motion.model
    speed = model.flow.inlet_velocity(model.rows.areas(model.nodal(q)), 12e3, motion.mu.density)
    return consistent_state(motion, 0.0, q if start is None else start, 0 * q, 12e3, np.array([speed]))


@pytest.mark.parametrize(
    "law, name, nd, order",
    [
        ("quasi-steady", "generalised-alpha", 0.0, 2),
        ("storage", "generalised-alpha", 0.0, 2),
        ("quasi-steady", "generalised-alpha", 0.2, 2),
        ("storage", "hht", 0.1, 2),
        ("quasi-steady", "newmark", 0.2, 1),
    ],
)
def test_order_of_accuracy(valve, open_state, law, name, nd, order):
    """Step refinement of a smooth motion: the open valve after the pressure has changed gently."""
    model = valve({"fluid.density": 300.0, "fluid.continuity": law})
    motion = ValveMotion(model)
    state = flowing(motion, open_state)
    pressure = lambda t: 12e3 + 4e3 * (1 - np.cos(60 * t))  # noqa: E731
    lip = model.shell.dofs.index[model.mesh.rows[0, 0], 1]
    ends = []
    for steps in (10, 20, 40):
        end, *_ = advance(motion, state, 0.02 / steps, steps, pressure, name, nd)
        ends.append(np.array([end.q[lip], end.v[lip] * 0.01, end.fluid.velocity * 0.01]))
    first, second = np.abs(ends[0] - ends[1]), np.abs(ends[1] - ends[2])
    assert np.log2(first.max() / second.max()) > order - 0.35


@pytest.mark.slow
def test_work_and_damping_account_for_the_energy(valve):
    motion = ValveMotion(valve({"fluid.density": 300.0}))
    rest = np.zeros(motion.size)
    state = consistent_state(motion, 0.0, rest, rest, 6e3)
    defects = []
    for h in (1e-3, 5e-4):
        end, results, *_ = advance(motion, state, h, int(0.03 / h), lambda t: 6e3 * min(1.0, t / 0.01))
        work, lost = sum(r.work for r in results), sum(r.dissipation for r in results)
        assert lost > 0
        defects.append(abs(sum(motion.energies(end.q, end.v)) - work + lost) / work)
    assert defects[0] < 5e-3 and defects[1] < 0.5 * defects[0]


@pytest.mark.slow
def test_a_free_swing_keeps_its_energy(valve, open_state):
    start = steady_positions(valve(), 2e3)
    free = {"drive.kind": "uniform", "drive.pressure": 0.0, "supports.lip_stop": False}
    model = valve(free | {"damping.alpha": 0.0, "damping.beta": 0.0})
    motion = ValveMotion(model)
    state = consistent_state(motion, 0.0, start, 0 * start, 0.0)
    energy = sum(motion.energies(state.q, state.v))
    swings = []
    for _ in range(2):
        state, results, *_ = advance(motion, state, 5e-4, 50, 0.0)
        swings.append(sum(motion.energies(state.q, state.v)) / energy - 1.0)
        assert sum(r.work for r in results) == 0.0
    assert np.abs(swings).max() < 1e-3
    damped, *_ = advance(motion, consistent_state(motion, 0.0, start, 0 * start, 0.0), 2e-3, 50, 0.0, nd=0.3)
    assert sum(motion.energies(damped.q, damped.v)) < 0.97 * energy


def test_slamming_lips_are_survived(valve):
    """Light fluid at 6 kPa, suddenly applied: lips shut and pressures spike within steps."""
    motion = ValveMotion(valve({"fluid.density": 1.2, "damping.alpha": 0.0, **FORMER}))
    rest = np.zeros(motion.size)
    state = consistent_state(motion, 0.0, rest, rest, 6e3)
    state, results, stepper, control = advance(motion, state, 5e-4, 200, 6e3, nd=0.1, options=StepOptions())
    assert state.time > 0.05
    touching = [motion.model.stops.touching(r.state.q) for r in results]
    assert max(touching) > 0
    assert min(r.load.speed[-1] for r in results) > 0, "the flow must not reverse"
    assert np.abs(state.q).max() < 1.0


def test_factors_are_kept(valve, open_state):
    motion = ValveMotion(valve({"fluid.density": 300.0}))
    state = flowing(motion, open_state)
    _, results, stepper, _ = advance(
        motion, state, 1e-4, 100, lambda t: 12e3 + 50 * np.sin(200 * t), options=StepOptions()
    )
    assert stepper.factorisations < 10
    assert stepper.residuals < 350


class Fails:
    """A stepper that refuses steps over a stretch of time longer than a limit."""

    def __init__(self, bad, limit):
        self.bad, self.limit, self.taken = bad, limit, []

    def step(self, state, h):
        if state.time + h > self.bad[0] and state.time < self.bad[1] and h > self.limit:
            raise StepFailure("no")
        self.taken.append(h)
        return SimpleNamespace(state=SimpleNamespace(time=state.time + h), error=0.0)

    def forget(self, all=True):
        self.known = False

    def retry(self):
        pass

    def take_back(self):
        self.taken.pop()


class Misses(Fails):
    """A stepper whose error, the cube of its step over 0.1 ms, is known where it has not forgotten its past."""

    known = True

    def step(self, state, h):
        result = super().step(state, h)
        result.error = (h / 1e-4) ** 3 if self.known else np.nan
        return result


def test_a_step_behind_a_failure_is_judged():
    stepper = Misses((0.0, 1.0), 6e-4)
    result = AdaptiveSteps(stepper, ControlOptions(1e-3, True, 1.0)).advance(SimpleNamespace(time=0.0), 1.0)
    assert result.error < 3.0 and stepper.taken == [result.state.time] and stepper.taken[0] < 1.5e-4


def test_few_adaptive_steps_go_without_a_judgement(valve):
    for adaptive, every in ((True, 20), (False, 3)):
        changes = {"transient.adaptive": adaptive, "transient.restart_every": 3}
        assert RunOptions.of(valve(changes).case).restart_every == every


@pytest.mark.parametrize("drop, known", [("retry", True), ("forget", False)])
def test_a_stepper_remembers_the_last_step_for_a_retry(valve, open_state, drop, known):
    motion = ValveMotion(valve({"fluid.density": 300.0}))
    stepper = Stepper(motion, scheme("generalised-alpha", 0.1), lambda t: 12e3)
    first = stepper.step(flowing(motion, open_state), 1e-3)
    getattr(stepper, drop)()
    assert np.isfinite(stepper.step(first.state, 5e-4).error) == known


def test_halved_steps_come_back_to_the_grid():
    stepper = Fails((0.0101, 0.0125), 1.3e-4)
    control = FixedSteps(stepper, ControlOptions(1e-3))
    state = SimpleNamespace(time=0.0)
    while state.time < 0.02 - 1e-12:
        state = control.advance(state, 1.0).state
    assert state.time == pytest.approx(0.02, abs=1e-15)
    assert min(stepper.taken) == pytest.approx(1.25e-4)
    assert control.level == 0 and stepper.taken[-1] == 1e-3
    assert control.halvings >= 3


def test_steps_are_not_halved_for_ever():
    control = FixedSteps(Fails((0.0, 1.0), 0.0), ControlOptions(1e-3, smallest=1 / 64))
    with pytest.raises(StepFailure):
        control.advance(SimpleNamespace(time=0.0), 1.0)
    assert control.level == 6
    stepper, state = Misses((2.0, 2.0), 1.0), SimpleNamespace(time=0.0)
    control = AdaptiveSteps(stepper, ControlOptions(1e-3, True, 1e-9, smallest=0.1))
    for _ in range(6):
        state = control.advance(state, 1.0).state
    assert min(stepper.taken) == control.h == pytest.approx(1e-4)
    assert control.coarse >= 5 and control.largest_error == pytest.approx(1.0)


def test_adaptive_steps_follow_the_error(valve, open_state):
    motion = ValveMotion(valve({"fluid.density": 300.0}))
    state = flowing(motion, open_state)
    pressure = lambda t: 12e3 + 2e3 * np.exp(-(((t - 0.05) / 0.002) ** 2))  # noqa: E731
    stepper = Stepper(motion, scheme("generalised-alpha", 0.1), pressure)
    control = step_control(stepper, ControlOptions(2e-3, True, 2e-8))
    lengths, errors = [], []
    while state.time < 0.1:
        result = control.advance(state, 0.1 if state.time < 0.1 - 1e-9 else 1.0)
        old, state = state, result.state
        lengths.append((old.time, state.time - old.time))
        errors.append(result.error)
    assert np.isnan(errors[0]) and 0.0 <= min(errors[1:]) and max(errors[1:]) < 2e-8 / 0.7**3
    during = [h for t, h in lengths if 0.047 < t < 0.053]
    assert max(during) < 0.6 * max(h for t, h in lengths)
