"""The verdict on series whose answer is known, among them those that mislead simpler rules."""

from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.signal import butter, lfilter

from dbvfiv.verdict import judge, judge_record
from tests.verdict.library import lorenz, rossler

T = np.linspace(0.0, 10.0, 10001)
W = 2 * np.pi * 3.0


def noise(seed=2, count=T.size):
    return np.random.default_rng(seed).standard_normal(count)


def relaxing(rate, start):
    """Cycle whose amplitude goes from `start` to 1 as next to a Hopf point: dA/dt = rate (A - A^3)."""
    return 3 + np.sin(W * T) / np.sqrt(1 + (start**-2 - 1) * np.exp(-2 * rate * T))


def bursts(gap, strength):
    """Rings of 40 Hz that die in 50 ms, `gap` apart on average, as lips do that slam: arrays of times between them and
    of their strengths.
    """
    out = np.zeros_like(T)
    for begin, size in zip(np.cumsum(gap), strength):
        after = np.maximum(T - begin, 0.0)
        out += size * np.exp(-after / 0.05) * np.sin(2 * np.pi * 40 * after)
    return out


def mapped(a):
    """Amplitudes of swings by the logistic map: period 2 at a = 3.2, chaos at 3.9."""
    x = [0.4]
    for _ in range(260):
        x.append(a * x[-1] * (1 - x[-1]))
    return np.array(x[200:])[np.minimum((3 * T).astype(int), 59)] * np.sin(W * T)


def narrow_band():
    return lfilter(*butter(2, [2.7 / 500, 3.3 / 500], "band"), noise(2, 2 * T.size))[T.size :]


STEADY = {
    "constant": 0 * T + 5,
    "zero": 0 * T,
    "negative": 0 * T - 2e5,
    "approached": 5 * (1 - np.exp(-3 * T)),
    "oscillation died": 3 + np.exp(-3 * T) * np.sin(W * T),
    "noise below the tolerance": 5 + 1e-6 * noise(),
}
CYCLES = {
    "sine": (3 + np.sin(W * T), 1 / 3, 1.0),
    "sine, small beside the mean": (80 + 0.05 * np.sin(W * T), 1 / 3, 0.05),
    "spikes": (np.maximum(np.sin(W * T), 0) ** 20, 1 / 3, 0.5),
    "slamming": (np.maximum(np.sin(W * T) - 0.5, 0), 1 / 3, 0.25),
    "doubled period": (np.sin(W * T) + 0.3 * np.sin(W * T / 2), 2 / 3, None),
    "strong second harmonic": (np.sin(W * T) + 0.8 * np.sin(2 * W * T + 1), 1 / 3, None),
    "second harmonic stronger than the first": (0.4 * np.sin(W * T) + np.sin(2 * W * T + 1), 1 / 3, None),
    "reached fast": (3 + np.tanh(2 * T) * np.sin(W * T), 1 / 3, 1.0),
    "mean settled": (np.sin(W * T) + 5 * np.exp(-T), 1 / 3, 1.0),
    "relaxed from above": (relaxing(1.0, 3.0), 1 / 3, 1.0),
    "died down to a small cycle": (3 + (0.05 + np.exp(-1.5 * T)) * np.sin(W * T), 1 / 3, 0.05),
    "two tones, 2:3": (np.sin(W * T) + 0.7 * np.sin(1.5 * W * T), 2 / 3, None),
    "unequal swings in pairs": (mapped(3.2), 2 / 3, None),
    "bursts, all alike": (bursts(np.full(40, 0.5), np.ones(40)), 0.5, None),
    "recorder of four bits": (np.round(7 * np.sin(W * T)) / 7, 1 / 3, None),
    "overshot amplitude": ((1 + np.exp(-1.5 * T) * np.sin(3 * T)) * np.sin(W * T), 1 / 3, 1.0),
}
NOISY_CYCLES = {
    "5 % noise": 5 + np.sin(W * T) + 0.05 * noise(),
    "20 % noise": 5 + np.sin(W * T) + 0.2 * noise(),
    "square wave, jumps between samples": np.sign(np.sin(W * T)),
}
GROWING = {
    "growing": 3 + 1e-3 * np.exp(0.5 * T) * np.sin(W * T),
    "growing, still far below the steady tolerance": 3 + 1e-7 * np.exp(0.5 * T) * np.sin(W * T),
    "growing by a factor 23 a cycle": 3 + 1e-7 * np.exp(1.5 * T) * np.sin(3 * T),
    "0.1 % a cycle": 3 + np.exp(0.003 * T) * np.sin(W * T),
    "0.03 % a cycle": 3 + np.exp(0.001 * T) * np.sin(W * T),
    "0.1 % a cycle under noise": np.exp(0.003 * T) * np.sin(W * T) + 0.05 * noise(),
    "out of noise": 3 + 1e-3 * np.exp(0.6 * T) * np.sin(W * T) + 0.01 * noise(),
    "running away": np.exp(0.5 * T),
    "ramp": T,
}
DECAYING = {
    "decaying": 3 + np.exp(-0.5 * T) * np.sin(W * T),
    "0.1 % a cycle": 3 + np.exp(-0.003 * T) * np.sin(W * T),
    "heavily damped": 3 + np.exp(-T) * np.sin(4 * T),
    "creeping": 5 * (1 - np.exp(-0.3 * T)),
}
IRREGULAR = {
    "beats": np.sin(W * T) + 0.1 * np.sin(1.05 * W * T),
    "strong beats": np.sin(W * T) + 0.5 * np.sin(1.1 * W * T),
    "noise": 5 + noise(),
    "noise in a narrow band": narrow_band(),
    "random walk": np.cumsum(noise(3)),
    "a second frequency of 3 %": np.sin(W * T) + 0.03 * np.sin(np.sqrt(2) * W * T),
    "amplitude that breathes by 1 %": (1 + 0.01 * np.sin(np.pi * T)) * np.sin(W * T),
    "phase that wanders": np.sin(W * T + 0.02 * np.cumsum(noise(4))),
    "frequency that runs away": np.sin(W * T * (1 + 0.05 * T)),
    "bursts at uneven times": bursts(0.5 + 0.1 * noise(3, 40), np.ones(40)),
    "bursts of uneven strength": bursts(np.full(40, 0.5), 1 + 0.3 * noise(5, 40)),
    "chaotic swings": mapped(3.9),
    "outbursts between quiet cycles": np.sin(W * T) * (1 + 0.6 * ((T % 3.7) > 3.3)),
    "amplitude doubled near the end": np.sin(W * T) * (1 + (T > 9)),
}
UNDECIDED = {
    "four cycles": np.sin(2 * np.pi * 0.4 * T),
    "cycle on a ramp": np.sin(W * T) + T,
    "still settling": 3 + np.tanh(0.2 * T) * np.sin(W * T),
    "on the way to a cycle": relaxing(0.3, 0.4),
    "period that creeps": np.sin(W * (T + 5e-4 * T**2)),
    "mean that creeps": 5 + 0.1 * T + np.sin(W * T),
    "2.3 samples a cycle": np.sin(2 * np.pi * 430 * T),
    "less than one beat": np.sin(W * T) + 0.3 * np.sin(1.02 * W * T),
}


@pytest.mark.parametrize("name", STEADY)
def test_steady(name):
    verdict = judge(T, STEADY[name])
    assert (verdict.name, verdict.decided) == ("steady", True), verdict.reason
    assert verdict.mean == pytest.approx(STEADY[name][-1], abs=1e-4 * max(1, abs(STEADY[name][-1])))


@pytest.mark.parametrize("name", CYCLES)
def test_limit_cycles(name):
    values, period, amplitude = CYCLES[name]
    verdict = judge(T, values)
    assert (verdict.name, verdict.decided) == ("limit cycle", True), verdict.reason
    assert verdict.period == pytest.approx(period, rel=2e-4)
    assert verdict.cycles >= 10
    assert verdict.periodicity_error < 0.02
    if amplitude is not None:
        assert verdict.amplitude == pytest.approx(amplitude, rel=2e-3)


@pytest.mark.parametrize("name", NOISY_CYCLES)
def test_cycles_under_noise(name):
    verdict = judge(T, NOISY_CYCLES[name])
    assert verdict.name == "limit cycle", verdict.reason
    assert verdict.period == pytest.approx(1 / 3, rel=1e-3)
    assert "noise" in verdict.reason
    assert verdict.periodicity_error > 0.02


MOVING = {"growing": GROWING, "decaying": DECAYING, "irregular": IRREGULAR}


@cache
def judged(name, series):
    """Every fourth sample: motions as slow as these need no more."""
    return judge(T[::4], MOVING[name][series][::4])


@pytest.mark.parametrize("name, series", [(name, series) for name, known in MOVING.items() for series in known])
def test_growing_decaying_and_irregular(name, series):
    verdict = judged(name, series)
    assert verdict.name == name, verdict.reason
    assert verdict.decided or series not in ("growing", "decaying")


@pytest.mark.parametrize("name", UNDECIDED)
def test_not_decided_too_early(name):
    verdict = judge(T, UNDECIDED[name])
    assert not verdict.decided and verdict.name in ("undecided", "growing"), verdict.reason
    if name == "period that creeps":  # it becomes shorter
        assert "period still changes by -0.03" in verdict.reason


@pytest.mark.parametrize("rate, start, name", [(0.3, 0.05, "growing"), (0.1, 2.0, "decaying")])
def test_slow_ways_to_a_cycle_are_not_certain_growth_or_decay(rate, start, name):
    verdict = judge(T, relaxing(rate, start))
    assert (verdict.name, verdict.decided) == (name, False) and "less and less" in verdict.reason


def test_rates_of_growth_a_cycle():
    assert judged("growing", "0.1 % a cycle").amplitude_trend == pytest.approx(1e-3, rel=0.01)
    assert judged("growing", "growing").amplitude_trend == pytest.approx(np.expm1(0.5 / 3), rel=0.01)
    doubling = judge(T, 2.0 ** (3 * T) * np.sin(W * T))
    assert doubling.amplitude_trend == pytest.approx(1.0, rel=0.01) and "changes by +100 %" in doubling.reason


def test_coarse_samples_of_a_noisy_cycle():
    for seed in range(4):
        values = np.sin(W * T) + 0.05 * noise(seed)
        assert judge(T[::16], values[::16]).name == "limit cycle"


@pytest.mark.parametrize("share, ratio", [(0.4536, 1.45745), (0.4752, 1.52306)])
def test_two_frequencies_near_a_simple_ratio_are_not_growth(share, ratio):
    verdict = judge(T, np.sin(W * T) + share * np.sin(ratio * W * T + 1))
    assert verdict.name == "irregular", verdict.reason


def test_sampling_at_the_period_is_not_steady_while_the_system_moves():
    strobed = 3 + np.sin(2 * np.pi * 1000 * T)
    assert judge(T, strobed).name == "steady"  # a bare series cannot tell
    verdict = judge(T, strobed, residual=0.5)
    assert verdict.name == "undecided" and "sampled at its own period" in verdict.reason
    assert judge(T, 0 * T + 3, residual=1e-6).name == "steady"


@pytest.mark.slow
def test_beats_seen_for_long_are_not_taken_for_growth_at_any_moment():
    t = np.linspace(0, 120, 60001)
    beat = np.sin(W * t) + 0.3 * np.sin(1.01 * W * t)
    for end in range(42, 121, 6):
        verdict = judge(t[: end * 500], beat[: end * 500])
        assert not (
            verdict.name in ("limit cycle", "steady") or (verdict.name in ("growing", "decaying") and verdict.decided)
        ), (end, verdict)


def test_closed():
    values = np.where(T < 4, np.sin(W * T) + 2, 1e-4)
    assert judge(T, values, closed_below=1e-3).name == "closed"
    assert judge(T, CYCLES["slamming"][0], closed_below=1e-3).name == "limit cycle"


@pytest.mark.parametrize(("scatter", "name"), [(0.0, "limit cycle"), (0.3, "chatters")])
def test_a_signal_that_shuts_again_and_again_chatters_until_it_stays_shut(scatter, name):
    """Pulses at a rate of five a second: even ones are a cycle; two are too few, and those long past are over."""
    gaps = 0.2 * (1.0 + scatter * np.random.default_rng(2).uniform(-1, 1, 40))
    starts, time = np.cumsum(gaps), np.arange(0.0, 8.0, 1e-3)
    values = np.zeros_like(time)
    for start in starts:
        values += np.where((time > start) & (time < start + 0.05), np.sin(np.pi * (time - start) / 0.05) ** 2, 0.0)
    found = judge(time, values, closed_below=0.05)
    assert found.name == name and found.decided and found.frequency == pytest.approx(5.0, rel=0.05)
    assert judge(time, values * (time < 0.5), closed_below=0.05).name != "chatters"
    assert judge(time, values * (time < 4.0), closed_below=0.05).name == "closed"
    few = judge(time[:1200], values[:1200], closed_below=0.05)
    assert few.name == "chatters" and not few.decided
    if scatter:
        measured = judge_record(time, values + 2e-3 * noise(2, time.size), closed_below=0.05)
        assert measured.name == "chatters" and measured.frequency == pytest.approx(5.0, rel=0.05)


def test_harmonics():
    values = np.sin(W * T) + 0.8 * np.sin(2 * W * T + 1) + 0.5 * np.cos(3 * W * T)
    found = judge(T, values).harmonics
    assert found[:4, 0] == pytest.approx([1, 0.8, 0.5, 0], abs=1e-6)
    assert found[:3, 1] == pytest.approx([-np.pi / 2, 1 - np.pi / 2, 0], abs=1e-5)


def test_units_and_offset_of_time_do_not_matter():
    for name in ("reached fast", "doubled period"):
        t, values = T[::4], CYCLES[name][0][::4]
        one, other = judge(t, values), judge(1e3 + 1e-3 * t, 1e-6 * values)
        assert other.name == one.name
        assert other.period == pytest.approx(1e-3 * one.period, rel=1e-5)
        assert other.amplitude == pytest.approx(1e-6 * one.amplitude, rel=1e-6)


def _van_der_pol(_, y):
    return [y[1], (1 - y[0] ** 2) * y[1] - y[0]]


def test_van_der_pol():
    """With mu = 1; period and amplitude to the digits given."""
    t, tolerances = np.linspace(0, 200, 8001), {"rtol": 1e-11, "atol": 1e-12}
    run = solve_ivp(_van_der_pol, (0, 200), [0.1, 0], "DOP853", t, **tolerances)
    verdict = judge(t, run.y[0])
    assert verdict.name == "limit cycle" and verdict.decided
    assert verdict.period == pytest.approx(6.663287, abs=6e-7)
    assert verdict.amplitude == pytest.approx(2.008620, abs=6e-7)
    early = judge(t[:400], run.y[0][:400])
    assert early.name in ("growing", "undecided")


@pytest.mark.parametrize("system, span, components", [(rossler, (100, 400), [0]), (lorenz, (10, 60), [0, 2])])
def test_chaos_is_irregular(system, span, components):
    t = np.linspace(*span, 5001)
    motion = solve_ivp(system, (0, span[1]), [1, 1, 1], t_eval=t, rtol=1e-7).y[components]
    assert [judge(t, values).name for values in motion] == ["irregular"] * len(components)


@pytest.mark.parametrize(
    "time, values, words",
    [
        ([0, 1, 1], [1, 2, 3], "do not increase"),
        ([0, 1, 2], [1, np.nan, 3], "not a finite number"),
        ([0, 1], [1, 2, 3], "same length"),
        ([0], [1], "at least two"),
    ],
)
def test_what_is_no_series_is_refused(time, values, words):
    with pytest.raises(ValueError, match=words):
        judge(time, values)


def test_few_samples_are_no_verdict():
    assert judge(range(10), range(10)).name == "undecided"


@pytest.mark.parametrize("count", range(16, 32))
def test_few_uneven_samples_can_be_too_few(count):
    """Interpolation at their typical distance leaves fewer, down to one."""
    rng = np.random.default_rng(count)
    for spread in (0.3, 1.0, 3.0):
        time, values = np.cumsum(rng.lognormal(0.0, spread, count)), rng.standard_normal(count)
        for gaps in (False, True):
            assert np.isfinite(judge(time, values, gaps=gaps).mean)
    time = np.append(0.01 * np.arange(8), 1.0 + np.arange(10))
    found = judge(time, np.ones(18), gaps=False)
    assert found.name == "undecided" and found.reason == "There are fewer than 16 samples."


@pytest.mark.parametrize("sign", [1, -1])
def test_a_weaker_motion_does_not_lengthen_the_period_of_growth(sign):
    """A quarter of such sums was told with the frequency and the change of two, three or four cycles."""
    rng = np.random.default_rng(2)
    for _ in range(40):
        end = rng.uniform(1.5, 4)
        time, frequency, rate = np.arange(0, end, 1e-3), rng.uniform(8, 20), sign * rng.uniform(0.3, 1.5)
        other, share, size = frequency * rng.uniform(1.5, 3.5), rng.uniform(0.02, 0.2), rng.uniform(0.1, 1)
        second = size * np.exp((rate + np.log(share / size) / end) * time) * np.sin(2 * np.pi * other * time + 1)
        found = judge(time, np.exp(rate * time) * np.sin(2 * np.pi * frequency * time) + second)
        assert found.frequency == pytest.approx(frequency, rel=0.02)
        if found.name != "irregular":
            assert found.name == ("growing" if sign > 0 else "decaying")
            assert found.amplitude_trend == pytest.approx(np.expm1(rate / frequency), abs=0.02)
