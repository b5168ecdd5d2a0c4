"""Records with known truths, as instruments and the valve's own transients make them: 200 of twenty kinds."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np
from scipy.integrate import solve_ivp
from scipy.signal import lfilter

#: Records of each kind.
EACH = 10
#: Least energy of a line over the density of the noise: with less even chance makes peaks as high.
ENERGY = 30.0


@dataclass(frozen=True)
class Record:
    """A record and what is true of it.

    Attributes
    ----------
    kind : str
    time, values : (k,) arrays, s and any unit
    names : tuple of str
        Verdicts that are right.
    truths : mapping
        Numbers that are known, by their names in the JSON of a verdict.
    mains : float, Hz
        Frequency of the mains in it; zero without.
    """

    kind: str
    time: np.ndarray
    values: np.ndarray
    names: tuple[str, ...]
    truths: Mapping[str, float] = field(default_factory=dict)
    mains: float = 0.0


class Bench:
    """Draws of one record: sampling, frequency, amplitude, noise."""

    def __init__(self, rng: np.random.Generator, noise: tuple[float, float] = (0.01, 0.3), cycles: float = 40.0):
        self.rng = rng
        while True:
            self.rate = 10 ** rng.uniform(2, 4)
            self.duration = 10 ** rng.uniform(0, np.log10(60))
            self.frequency = self.rate * 10 ** rng.uniform(-2, np.log10(0.15))
            self.noise = self.log(*noise)
            count = self.rate * self.duration
            if self.frequency * self.duration > cycles and 300 < count < 3e5 and count / (2 * self.noise**2) > ENERGY:
                break
        self.t = np.arange(int(count)) / self.rate
        self.size = 10 ** rng.uniform(-3, 3)
        self.w = 2 * np.pi * self.frequency
        self.phase = rng.uniform(0, 2 * np.pi)

    def log(self, low: float, high: float) -> float:
        return float(np.exp(self.rng.uniform(np.log(low), np.log(high))))

    def sine(self, factor: float = 1.0) -> np.ndarray:
        return np.sin(factor * self.w * self.t + factor * self.phase)

    def white(self) -> np.ndarray:
        """Noise of the strength drawn, over the root mean square of a sine of amplitude 1."""
        return self.noise * np.sqrt(0.5) * self.rng.standard_normal(len(self.t))

    def drift(self) -> np.ndarray:
        """A level that moves by several amplitudes: one way, by warming up or to and fro."""
        u, size = self.t / self.t[-1], self.rng.choice([-1, 1]) * self.log(1, 20)
        way = self.rng.integers(3)
        return size * (u if way == 0 else 1 - np.exp(-3 * u) if way == 1 else np.sin(np.pi * u + self.phase))

    def mains(self) -> tuple[np.ndarray, float]:
        """Pick-up of the mains with multiples, and their frequency."""
        own = float(self.rng.choice([50.0, 60.0]))
        off = 1 + 2e-4 * self.rng.standard_normal()
        picked = sum(
            self.log(0.1, 1) / k * np.sin(2 * np.pi * own * off * k * self.t + self.rng.uniform(0, 6))
            for k in (1, 2, 3)
        )
        return picked, own

    def away_from_mains(self) -> bool:
        """True where neither the line nor its multiples are near those of the mains."""
        off = [abs(self.frequency * k - m * j) for m in (50, 60) for k in (1, 2, 3) for j in range(1, 9)]
        return 320 < self.rate and min(off) > 1.0 + 4.0 / self.duration

    def record(self, kind: str, motion, names, level: float | None = None, mains: float = 0.0, **truths) -> Record:
        level = self.rng.uniform(-5, 5) if level is None else level
        values = self.size * (level + motion + self.white())
        found = {name: value * (self.size if name == "amplitude" else 1.0) for name, value in truths.items()}
        return Record(kind, self.t, values, names if isinstance(names, tuple) else (names,), found, mains)


def _until(make: Callable[[], Bench], good: Callable[[Bench], bool]) -> Bench:
    while not good(found := make()):
        pass
    return found


CYCLE, DIED, SEVERAL, MODULATED, IRREGULAR = (
    "limit cycle",
    ("decayed", "decaying"),
    "several lines",
    "modulated",
    "irregular",
)


def _line(rng):
    b = Bench(rng)
    return b.record("line", b.sine(), CYCLE, frequency=b.frequency, amplitude=1.0)


def _under_noise(rng):
    b = Bench(rng, (0.5, 2.0))
    return b.record("line under noise", b.sine(), CYCLE, frequency=b.frequency, amplitude=1.0)


def _on_drift(rng):
    b = Bench(rng, (0.02, 1.0))
    return b.record("line on drift", b.sine() + b.drift(), CYCLE, frequency=b.frequency, amplitude=1.0)


def _with_gaps(rng):
    b = Bench(rng, (0.02, 0.5), 100)
    made = b.record("line with gaps", b.sine(), CYCLE, frequency=b.frequency, amplitude=1.0)
    count, keep = len(b.t), np.ones(len(b.t), bool)
    for at in rng.uniform(0, 0.9, rng.integers(1, 4)):
        keep[int(at * count) : int((at + rng.uniform(0.01, 0.08)) * count)] = False
    return Record(made.kind, b.t[keep], made.values[keep], made.names, made.truths)


def _clipped(rng):
    b = Bench(rng, (0.02, 0.2))
    made = b.record("clipped line", b.sine(), CYCLE, 0.0, frequency=b.frequency, amplitude=1.0)
    rail = b.size * rng.uniform(0.6, 0.95)
    low = -b.size * rng.choice([rail / b.size, 3.0])
    return Record(made.kind, b.t, np.clip(made.values, low, rail), made.names, made.truths)


def _with_mains(rng):
    b = _until(lambda: Bench(rng, (0.02, 1.0)), Bench.away_from_mains)
    picked, own = b.mains()
    return b.record("line and mains", b.sine() + picked, CYCLE, mains=own, frequency=b.frequency, amplitude=1.0)


def _only_mains(rng):
    b = _until(lambda: Bench(rng, (0.05, 1.0)), lambda b: b.rate > 320)
    picked, own = b.mains()
    return b.record("mains", picked, "mains", mains=own)


def _pair(rng):
    b = _until(lambda: Bench(rng, (0.02, 1.0)), lambda b: 0.02 * b.frequency * b.duration > 2.5)
    motion = b.sine() + rng.uniform(0.3, 0.95) * np.sin(1.02 * b.w * b.t)
    return b.record("two lines 2 % apart", motion, SEVERAL, frequency=b.frequency)


def _several(rng):
    b = _until(lambda: Bench(rng, (0.02, 0.5)), lambda b: b.rate > 12 * b.frequency)
    motion = b.sine() + rng.uniform(0.2, 0.8) * b.sine(np.sqrt(2)) + rng.uniform(0.2, 0.8) * b.sine(np.e)
    return b.record("several lines", motion, SEVERAL, frequency=b.frequency, amplitude=1.0)


def _modulated(rng):
    share = rng.uniform(0.02, 0.1)
    b = _until(lambda: Bench(rng, (0.02, 0.3), 80), lambda b: share * b.frequency * b.duration > 4)
    slow = np.sin(share * b.w * b.t + rng.uniform(0, 6))
    motion = (1 + rng.uniform(0.3, 0.9) * slow) * b.sine()
    truths = {"frequency": b.frequency, "modulation": share * b.frequency, "amplitude": 1.0}
    return b.record("modulated amplitude", motion, MODULATED, **truths)


def _modulated_frequency(rng):
    share = rng.uniform(0.02, 0.1)
    b = _until(lambda: Bench(rng, (0.02, 0.3), 80), lambda b: share * b.frequency * b.duration > 4)
    motion = np.sin(b.w * b.t + rng.uniform(0.4, 0.9) * np.sin(share * b.w * b.t + b.phase))
    return b.record("modulated frequency", motion, MODULATED, frequency=b.frequency, modulation=share * b.frequency)


def _growth(rng):
    b = Bench(rng, (0.02, 1.0))
    rate = rng.uniform(1.5, 6) / b.duration
    return b.record("growth", np.exp(rate * (b.t - b.t[-1])) * b.sine(), "growing", frequency=b.frequency, rate=rate)


def _ring_down(kind, ratios, noise, decades, extra=False):
    def make(rng):
        ratio = np.exp(rng.uniform(*np.log(ratios)))
        rate = -2 * np.pi * ratio / np.sqrt(1 - ratio**2)  # of 1 Hz
        low, high = decades
        # the energy of what rings is that of a line over half its time constant
        b = _until(
            lambda: Bench(rng, noise, 3 if ratio > 0.02 else 20),
            lambda b: (
                low < -rate * b.frequency * b.duration < high
                and b.rate / (4 * -rate * b.frequency * b.noise**2) > 4 * ENERGY
                and b.rate > 8 * b.frequency
                and (not extra or b.away_from_mains())
            ),
        )
        rate *= b.frequency
        start = rng.uniform(0.05, 0.3) * b.duration if extra else 0.0
        after = np.maximum(b.t - start, 0.0)
        motion = (b.t >= start) * np.exp(rate * after) * np.cos(b.w * after + b.phase)
        picked, own = b.mains() if extra else (0.0, 0.0)
        motion = motion + 0.1 * picked + (0.05 * b.drift() if extra else 0.0)
        truths = {"frequency": b.frequency, "rate": rate, "damping_ratio": ratio}
        return b.record(kind, motion, DIED, mains=0.0, **truths)

    return make


def _narrow_band(rng):
    b = _until(lambda: Bench(rng, (0.02, 0.3), 200), lambda b: b.rate > 10 * b.frequency)
    ratio = rng.uniform(8, 40) / (2 * np.pi * b.frequency * b.duration)
    pole = np.exp((-ratio + 1j) * b.w / b.rate)
    motion = lfilter([1], np.poly([pole, pole.conj()]).real, rng.standard_normal(2 * len(b.t)))[len(b.t) :]
    truths = {"frequency": b.frequency, "rate": -ratio * b.w, "damping_ratio": ratio / np.hypot(1.0, ratio)}
    return b.record("a mode driven by noise", motion / motion.std(), IRREGULAR, **truths)


def rossler(_, y):
    return [-y[1] - y[2], y[0] + 0.2 * y[1], 0.2 + y[2] * (y[0] - 5.7)]


def lorenz(_, y):
    return [10 * (y[1] - y[0]), y[0] * (28 - y[2]) - y[1], y[0] * y[1] - 8 / 3 * y[2]]


def _chaos(rng):
    b = _until(lambda: Bench(rng, (0.005, 0.1), 60), lambda b: 2000 < len(b.t) < 60_000)
    if rng.random() < 0.6:
        system, span, names = (lorenz, rng.uniform(40, 120), IRREGULAR)
        start = [1, 1, 1]
        run = solve_ivp(system, (0, span + 21), start, t_eval=20 + span * b.t / b.t[-1], rtol=1e-8)
        motion = run.y[rng.choice([0, 2])]
    else:
        pole = rng.uniform(0.9, 0.999)
        motion, names = lfilter([1], [1, -pole], rng.standard_normal(2 * len(b.t)))[len(b.t) :], IRREGULAR
    return b.record("chaos and broad bands", (motion - motion.mean()) / motion.std(), names)


def _noise(rng):
    b = Bench(rng, (0.1, 2.0))
    return b.record("noise", 0.0, "steady")


def _harmonics(rng):
    b = _until(lambda: Bench(rng, (0.02, 0.5)), lambda b: b.rate > 20 * b.frequency)
    parts = [rng.uniform(0.1, 0.9) * np.sin(k * b.w * b.t + rng.uniform(0, 6)) for k in (2, 3, 4)]
    return b.record("harmonics", b.sine() + sum(parts), CYCLE, frequency=b.frequency)


def _bursts(rng):
    b = _until(lambda: Bench(rng, (0.02, 0.2), 150), lambda b: b.rate > 8 * b.frequency)
    motion, count = np.zeros(len(b.t)), int(rng.integers(5, 12))
    for begin in np.sort(rng.uniform(0, 0.9, count)) * b.duration:
        after = np.maximum(b.t - begin, 0.0)
        motion += rng.uniform(0.4, 1.6) * np.exp(-after * b.frequency / rng.uniform(2, 6)) * np.sin(b.w * after)
    return b.record("bursts", motion, IRREGULAR)


def _opening(rng):
    """The valve opens within some periods and rings about the new level."""
    ratio = np.exp(rng.uniform(*np.log((0.01, 0.1))))
    b = _until(
        lambda: Bench(rng, (0.005, 0.05), 20), lambda b: 4 < ratio * b.w * b.duration < 30 and b.rate > 10 * b.frequency
    )
    ramp = rng.uniform(0.3, 1.5) / b.frequency
    u = np.clip(b.t / ramp, 0, 1)
    after = np.maximum(b.t - ramp, 0.0)
    rate = -ratio / np.sqrt(1 - ratio**2) * b.w
    motion = 4 * u**2 * (3 - 2 * u) + (b.t >= ramp) * np.exp(rate * after) * np.sin(b.w * after)
    return b.record("opening", motion, DIED, 0.0, frequency=b.frequency, damping_ratio=ratio, rate=rate)


def _slams(rng):
    """Lips that shut for a part of each cycle."""
    b = _until(lambda: Bench(rng, (0.01, 0.2)), lambda b: b.rate > 25 * b.frequency)
    return b.record(
        "slams",
        np.maximum(b.sine() + rng.uniform(-0.5, 0.5), 0.0) ** rng.integers(1, 3),
        CYCLE,
        0.0,
        frequency=b.frequency,
    )


KINDS: tuple[Callable[[np.random.Generator], Record], ...] = (
    _line,
    _under_noise,
    _on_drift,
    _with_gaps,
    _clipped,
    _with_mains,
    _only_mains,
    _pair,
    _several,
    _modulated,
    _modulated_frequency,
    _growth,
    _ring_down("ring-down, ratio to 2 %", (0.002, 0.02), (0.01, 0.3), (0.5, 12)),
    _ring_down("ring-down, ratio from 2 %", (0.02, 0.2), (0.005, 0.2), (4, 100)),
    _ring_down("ring-down after a tap, on drift and mains", (0.005, 0.05), (0.01, 0.2), (4, 40), extra=True),
    _narrow_band,
    _chaos,
    _noise,
    _harmonics,
    _bursts,
    _opening,
    _slams,
)


def records(each: int = EACH, seed: int = 0) -> Iterator[Record]:
    """Records of all kinds, `each` of a kind."""
    for number, make in enumerate(KINDS):
        for k in range(each):
            yield make(np.random.default_rng([seed, number, k]))
