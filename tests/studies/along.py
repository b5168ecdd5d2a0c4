"""Checks of studies over a parameter against valves that are given each of its values."""

from __future__ import annotations

import numpy as np
import pytest

from dbvfiv.case.parameters import Mu
from dbvfiv.studies.stability.walk import StabilityWalk
from tests.small_valves import load_small


def leading(*keys) -> float:
    """Growth rate of the leading mode, 1/s, of a small valve with tables of keys changed."""
    return load_small(*keys).modes(count=4).modes[0].growth_rate


def check_sweep(keys, over: str, key: str, at=None):
    """Modes along `over`, at some or all of its values, are those of a valve with that value of `key`."""
    found = load_small(*keys).sweep(over)
    assert found.certified
    for i in range(len(found.values)) if at is None else at:
        growth = max(b.growth_rate[i] for b in found.branches if np.isfinite(b.growth_rate[i]))
        assert growth == pytest.approx(leading(*keys, {key: float(found.values[i])}), rel=1e-6)
    return found


def check_walk(keys, found, key: str, at):
    """States and spectra of a walk along a sweep that moves the steady state."""
    case = load_small(*keys).case
    walk, place = StabilityWalk(case), Mu.of(case)
    for i in at:
        there = place.at(**{found.parameter: float(found.values[i])})
        valve = load_small(*keys, {key: float(found.values[i])})
        state = valve.steady(pressure=case.drive.pressure)
        assert walk.equilibrium(there) == pytest.approx(state.q, rel=1e-6, abs=1e-9)
        own = valve.modes(count=4).modes[0].growth_rate
        assert walk.spectrum(there, 4).eigenvalues[0].real == pytest.approx(own, rel=1e-6)


def check_sensitivity(keys, parameter: str, key: str, step: float):
    """A slope of the leading growth rate is that between valves a step on either side."""
    valve = load_small(*keys)
    (found,) = valve.steady(pressure=valve.case.drive.pressure).sensitivity(parameter).sensitivities
    low, high = (leading(*keys, {key: found.value + change}) for change in (-step, step))
    assert found.growth_rate == pytest.approx((high - low) / (2 * step), rel=1e-3)


def check_map(keys, axes, cells):
    """All cells of a map are certified, and `cells` have the leading growth rates of valves with other keys."""
    found = load_small(*keys, axes).map()
    assert not found.failures and found.grid("certified").all()
    (growth,) = found.grid("growth_rate")
    for place, own in cells.items():
        assert growth[place] == pytest.approx(leading(*keys, own), rel=1e-6)


def check_neutral(keys, key: str, value: float, tolerance: float):
    """A mode of a valve at an onset neither grows nor decays by more than a tolerance, 1/s."""
    modes = load_small(*keys, {key: value}).modes(count=4).modes
    assert min(abs(mode.growth_rate) for mode in modes) < tolerance
