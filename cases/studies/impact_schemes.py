"""How a contact should act in time steps: candidates on one mass that hits a stiff spring.

A mass of 15 kg/m2, as 12 mm of rubber, meets a spring of 10 MPa/mm at 1 m/s; it touches for 0.12 ms, less than a step
of most runs. Printed are, for each candidate, step and numerical damping, the least and the largest speed of the
rebound over all ways in which steps can fall (1 is right), the largest pull of the contact over its largest push, and
the energy that an oscillator of 40 Hz, pressed on the spring, has after a million steps over that at its start.

    python cases/studies/impact_schemes.py
"""

from __future__ import annotations

import argparse

import numpy as np
from numba import njit

from dbvfiv.motion.scheme import scheme

MASS, PENALTY, ROUNDING, BETA, CREEP = 15.0, 1e10, 1e-6, 3e-3, 1e-3
#: The candidates by their numbers in `push`.
WEIGHTED, DAMPED, END, GRADIENT, BLENDED, IMPULSE, REBOUND = range(7)
NAMES = {
    WEIGHTED: "part of the wall's force (as stops are, without stiffness damping)",
    DAMPED: "the same with stiffness damping, beta 3 ms",
    END: "pressure at the end of the step",
    GRADIENT: "discrete gradient",
    BLENDED: "discrete gradient, shifted to the instant of the scheme",
    IMPULSE: "discrete gradient as an impulse of its step",
    REBOUND: "the same with a rebound of 0.5",
}


@njit
def stored(gap):
    x = -gap
    if x <= -ROUNDING:
        return 0.0
    if x < ROUNDING:
        return PENALTY * (x + ROUNDING) ** 3 / (12 * ROUNDING)
    return PENALTY * (0.5 * x * x + ROUNDING**2 / 6)


@njit
def pressure(gap):
    x = -gap
    if x <= -ROUNDING:
        return 0.0
    return PENALTY * (x + ROUNDING) ** 2 / (4 * ROUNDING) if x < ROUNDING else PENALTY * x


@njit
def push(law, old, new, now, h, rate):
    """Contact pressure of a step; `rate` is that of the pressure before."""
    if law <= DAMPED:
        change = pressure(new) - pressure(old)
        mean = pressure(old) + now * change
        return mean if law == WEIGHTED else mean + BETA * (rate + (now + 0.5) * (change / h - rate))
    if law == END:
        return pressure(new)
    change = new - old
    if abs(change) < 1e-5 * (abs(old) + ROUNDING):
        mean = pressure(0.5 * (old + new))
    else:
        mean = (stored(old) - stored(new)) / change
    if law == BLENDED:
        return mean + (2 * now - 1) * (pressure(new) - mean)
    if law == REBOUND and change > 0:
        return mean * (0.5 + 0.5 / (1 + (change / h / CREEP) ** 2))
    return mean


@njit
def follow(law, q, v, spring, load, h, steps, alpha_m, alpha_f, beta, gamma):
    """Position, speed, energy over that at the start (now and largest), largest push and pull."""
    now, apart = 1 - alpha_f, law >= IMPULSE
    weight = (1 - alpha_m) / (2 * beta) if apart else 1.0
    a = (load - spring * q + (0.0 if apart else pressure(q))) / MASS
    first = 0.5 * MASS * v * v + 0.5 * spring * q * q - load * q + stored(q)
    energy, largest, rate, high, low = first, first, 0.0, 0.0, 0.0
    for _ in range(steps):
        known = q + h * v + h * h * (0.5 - beta) * a
        size = max(abs(h * v), 1e-9)
        bottom, top = q + h * v - size, q + h * v + size
        for side in range(2):
            reach = size
            for _ in range(100):
                x = top if side else bottom
                mid = alpha_m * a + (1 - alpha_m) * (x - known) / (beta * h * h)
                left = MASS * mid + spring * (q + now * (x - q)) - load - weight * push(law, q, x, now, h, rate)
                if (left > 0) == (side == 1):
                    break
                reach *= 2
                if side:
                    top += reach
                else:
                    bottom -= reach
        for _ in range(70):
            x = 0.5 * (bottom + top)
            mid = alpha_m * a + (1 - alpha_m) * (x - known) / (beta * h * h)
            left = MASS * mid + spring * (q + now * (x - q)) - load - weight * push(law, q, x, now, h, rate)
            if left > 0:
                top = x
            else:
                bottom = x
        pushed = push(law, q, x, now, h, rate)
        high, low = max(high, pushed), min(low, pushed)
        rate = (pressure(x) - pressure(q)) / h
        new = (x - known) / (beta * h * h)
        v = v + h * ((1 - gamma) * a + gamma * new)
        if apart:
            v += h * (1 - gamma / (2 * beta)) * pushed / MASS
            new -= pushed / (2 * beta * MASS)
        q, a = x, new
        energy = 0.5 * MASS * v * v + 0.5 * spring * q * q - load * q + stored(q)
        largest = max(largest, energy)
    return q, v, energy / first, largest / first, high, low


def rebounds(law: int, h: float, nd: float) -> tuple[float, float, float]:
    """Least and largest speed of rebound over phases of the step, and the pull over the push."""
    rule = scheme("generalised-alpha", nd)
    members = rule.alpha_m, rule.alpha_f, rule.beta, rule.gamma
    found = [
        follow(law, 2e-6 + h * (2 + phase), -1.0, 0.0, 0.0, h, max(60, int(2e-3 / h)), *members)
        for phase in np.linspace(0, 1, 50, endpoint=False)
    ]
    speeds = [one[1] for one in found]
    return min(speeds), max(speeds), min(one[5] / one[4] for one in found)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--steps", type=int, default=1_000_000, help="of the oscillator")
    given = parser.parse_args()
    spring = MASS * (2 * np.pi * 40) ** 2
    print(f"contact lasts {1e3 * np.pi * np.sqrt(MASS / PENALTY):.3g} ms")
    for law, name in NAMES.items():
        print(name)
        for nd in (0.0, 0.2):
            rule = scheme("generalised-alpha", nd)
            for h in (1e-5, 5e-5, 5e-4):
                least, largest, pull = rebounds(law, h, nd)
                members = rule.alpha_m, rule.alpha_f, rule.beta, rule.gamma
                end = follow(law, 5e-3, 0.0, spring, -1e-3 * spring, h, given.steps, *members)
                print(
                    f"    numerical damping {nd:g}, step {1e3 * h:g} ms: rebound {least:.2f} to {largest:.2f}, "
                    f"pull {-pull:.2g}, energy after {given.steps} steps {end[2]:.3g}, largest {end[3]:.3g}",
                    flush=True,
                )


if __name__ == "__main__":
    main()
