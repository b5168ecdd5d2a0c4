"""Periodic orbits with known period, amplitude and multipliers; criticality by integration."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from continuation import ContinuationOptions, orbit_at, orbits_from_hopf, special_orbit
from tests.systems.brusselator import brusselator
from tests.systems.following import follow, normal_form_of
from tests.systems.langford import langford
from tests.systems.lorenz import lorenz


def test_langford():
    """Circular orbit from mu = 5 - sqrt(11); torus bifurcation at exactly 2."""
    system = langford()
    (hopf,) = follow(system, [0, 0, 1.5], {"mu": 1.5}, "mu", (1.2, 2.5)).of_kind("hopf")
    # On the axis z = mu the growth is 2 mu - 3 + 0.2 (1 - mu^2).
    assert np.isclose(hopf.mu["mu"], 5 - np.sqrt(11), rtol=1e-10)
    assert abs(hopf.mu["mu"] - 1.683) < 5e-4 and np.isclose(hopf.values["omega"], 0.25)
    branch = orbits_from_hopf(system, hopf, "mu", ContinuationOptions(limits={"mu": (1.6, 2.05)}))
    (torus,) = branch.of_kind("torus")
    assert abs(torus.mu["mu"] - 2.0) < 1e-9
    assert branch.unstable[0] == 0 and branch.unstable[-1] == 2
    orbit = special_orbit(system, branch, torus)
    assert np.isclose(orbit.period, 8 * np.pi, rtol=1e-9)
    # Exponents are known up to whole turns per period, that is multiples of i/4.
    exponent = orbit.exponents[np.argmax(orbit.exponents.imag)]
    assert abs(exponent.real) < 1e-9
    turns = (np.sqrt(1.2) - exponent.imag) / 0.25
    assert abs(turns - round(turns)) < 1e-7
    radius = np.linalg.norm(orbit(np.linspace(0, 25, 9))[:, :2], axis=1)
    assert np.allclose(radius, 1.0, rtol=1e-7)


def hopf_form(system, u, mu, parameter, low, high):
    (point,) = follow(system, u, mu, parameter, (low, high), step=0.2, max_step=2.0).of_kind("hopf")
    return point, normal_form_of(system, point, parameter)


def swing(rates, start, time, functional):
    """Half of peak to peak over the first and the last few turns."""
    solution = solve_ivp(
        lambda t, u: rates(*u), (0, time), start, method="LSODA", rtol=1e-9, atol=1e-11, dense_output=True
    )
    first = functional @ solution.sol(np.linspace(0, 0.06 * time, 600))
    last = functional @ solution.sol(np.linspace(0.94 * time, time, 600))
    return 0.5 * np.ptp(first), 0.5 * np.ptp(last)


def test_supercritical_brusselator_by_integration():
    """Above: from inside and from outside to the predicted cycle. Below: everything decays."""
    system = brusselator()
    point, form = hopf_form(system, [1.0, 1.5], {"A": 1.0, "B": 1.5}, "B", 0.5, 3.0)
    assert form.criticality == "super" and form.side() == 1
    x = np.array([1.0, 0.0])
    change = 0.02
    # The leading order is off by a relative O(change), here less than 3 %.
    predicted = form.amplitude_coefficient(x) * np.sqrt(change)

    def rates(b):
        return lambda x, y: [1.0 - (b + 1) * x + x**2 * y, b * x - x**2 * y]

    for factor in (0.3, 2.0):
        start = [1.0, 2.0 + change] + form.orbit(factor * form.radius(change), np.zeros(1))[0] - point.u
        _, final = swing(rates(2.0 + change), start, 600.0, x)
        assert np.isclose(final, predicted, rtol=0.03)
    first, final = swing(rates(2.0 - change), [1.3, 2.0 - change], 600.0, x)
    assert final < 0.02 * first


@pytest.mark.slow
def test_subcritical_lorenz_by_integration():
    """Below: inside the unstable cycle motion decays, outside it grows. Above: all grows."""
    system = lorenz()
    x = np.sqrt(8 / 3 * 19)
    point, form = hopf_form(system, [x, x, 19.0], {"sigma": 10.0, "b": 8 / 3, "r": 20.0}, "r", 15, 28)
    assert form.criticality == "sub" and form.side() == -1
    observed = np.array([0.0, 0.0, 1.0])

    def run(change, factor, time):
        r = point.mu["r"] + change
        e = np.sqrt(8 / 3 * (r - 1))
        radius = form.radius(-abs(change))
        start = np.array([e, e, r - 1]) + form.orbit(factor * radius, np.zeros(1))[0] - point.u
        return swing(lambda x, y, z: [10 * (y - x), x * (r - z) - y, x * y - 8 / 3 * z], start, time, observed)

    # The unstable cycle is where predicted within 20 % (leading order, change 0.1 in 24.7).
    first, last = run(-0.1, 0.8, 250.0)
    assert last < 0.8 * first
    first, last = run(-0.1, 1.2, 250.0)
    assert last > 1.2 * first
    for factor in (0.2, 0.8):
        first, last = run(0.1, factor, 250.0)
        assert last > 1.5 * first


def test_cycles_of_the_brusselator_agree_with_the_normal_form_to_first_order():
    """Ratio of computed to predicted squared amplitude tends to 1 linearly in the distance."""
    system = brusselator()
    point, form = hopf_form(system, [1.0, 1.5], {"A": 1.0, "B": 1.5}, "B", 0.5, 3.0)
    branch = orbits_from_hopf(
        system, point, "B", ContinuationOptions(limits={"B": (1.9, 2.06)}, step=0.02, max_step=0.5)
    )
    change = branch.values() - 2.0
    x = np.array([1.0, 0.0])
    ratios = []
    for i in (0, len(branch) // 2, len(branch) - 1):
        amplitude = orbit_at(system, branch, i).amplitude()[0]
        ratios.append(amplitude**2 / (form.amplitude_coefficient(x) ** 2 * change[i]) - 1)
        period = branch.points[i].tests["period"]
        assert np.isclose(2 * np.pi / period, form.frequency(change[i]), atol=2 * change[i] ** 2)
    slopes = np.array(ratios) / change[[0, len(branch) // 2, len(branch) - 1]]
    assert np.ptp(slopes) < 0.15 * abs(slopes[0])
    assert set(branch.unstable) == {0}
