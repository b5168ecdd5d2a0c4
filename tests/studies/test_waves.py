"""Sweeps, onsets, maps and sensitivities of a valve behind an elastic line."""

from __future__ import annotations

import numpy as np
import pytest

import dbvfiv
from dbvfiv.studies.case import load_case, thesis_case

MESH = {"mesh.around": 8, "mesh.along": 12}
LINE = {"upstream.length": 6.0, "upstream.wave_speed": 600.0, "upstream.loss": 1.5, "upstream.elements": 3}
LIGHT = {"fluid.density": 10.0, "drive.pressure": "6 kPa", "damping.alpha": 0.0, "fluid.continuity": "storage"}


def load(*keys):
    changes = MESH | LINE | LIGHT
    for some in keys:
        changes = changes | some
    return dbvfiv.load(thesis_case(), changes)


def leading(*keys):
    return load(*keys).modes(count=4).modes[0].growth_rate


@pytest.mark.slow
@pytest.mark.parametrize("over", ["wave_speed=150:1200:3:log", "pipe_length=2:18:3:log", "density=2:50:3:log"])
def test_modes_along_a_parameter_are_those_of_each_value(over):
    found = load({"sweep.checks": 2}).sweep(over, count=4)
    assert found.certified
    name = {"wave_speed": "upstream.wave_speed", "pipe_length": "upstream.length", "density": "fluid.density"}
    growth = max(b.growth_rate[1] for b in found.branches if np.isfinite(b.growth_rate[1]))
    assert growth == pytest.approx(leading({name[over.split("=")[0]]: float(found.values[1])}), rel=1e-6)


def test_no_door_calls_a_valve_stable_whose_line_is_too_coarse_for_its_modes():
    """Two elements resolve waves up to 3 Hz; the wall flutters at 46 Hz, as with sixty."""
    line = {"upstream.length": 120.0, "upstream.diameter": 0.3, "upstream.wave_speed": 400.0, "upstream.elements": 2}
    state = {"fluid.density": 30.0, "drive.pressure": 1500.0, "fluid.continuity": "quasi-steady", "damping.beta": 4e-4}
    valve = load({"mesh.around": 6, "mesh.along": 8, "upstream.loss": 0.0} | line | state)
    told = [valve.modes().verdict.outcome]
    told += [verdict["outcome"] for verdict in valve.sweep("beta=4e-4,5e-4").summary()["verdict"]]
    told += [verdict["outcome"] for verdict in valve.sweep("pressure=1500,1600").summary()["verdict"]]
    told += [verdict["outcome"] for verdict in valve.onset("beta=4e-4:5e-4:3").summary()["scan"]["verdict"]]
    assert set(told) == {"undecided"}


@pytest.mark.parametrize(
    "case, keys",
    [
        (thesis_case(), {"modes.symmetry": "SA", "drive.pressure": "6 kPa"}),
        (load_case("cases/dbv12-moulded.toml"), {"drive.pressure": "300 Pa"}),
    ],
)
def test_motions_that_meet_no_waves_are_searched_beyond_those_that_are_resolved(case, keys):
    """Lips that sway together, and a bill that is sealed under the quasi-steady flow model, where the wall displaces
    nothing: the same modes behind a rigid line.
    """
    line = {"upstream.length": 40.0, "upstream.diameter": 0.3, "fluid.continuity": "quasi-steady"}
    waves = {"upstream.wave_speed": 400.0, "upstream.elements": 2}
    shared = MESH | line | keys | {"modes.count": 3, "damping.model": "rayleigh", "damping.alpha": 2.0}
    elastic, rigid = (dbvfiv.load(case, shared | changes).modes() for changes in (waves, {}))
    assert elastic.verdict.outcome == "stable" and elastic.modes[2].frequency > 20.0
    rates = [[(mode.growth_rate, mode.angular_frequency) for mode in found.modes] for found in (elastic, rigid)]
    assert rates[0] == [pytest.approx(pair, rel=1e-7) for pair in rates[1]]


@pytest.mark.slow
def test_maps_keep_the_wave_speed_over_the_density():
    """In every cell the compressibility is that of its own density."""
    found = load({"map.x": "pressure=3 kPa:6 kPa:2", "map.y": "density=2:50:4:log"}).map()
    assert not found.failures and found.grid("certified").all()
    (growth,) = found.grid("growth_rate")
    for i, density in ((1, 2.0 * 25 ** (1 / 3)), (3, 50.0)):
        own = leading({"fluid.density": density, "drive.pressure": 6e3})
        assert growth[i, 1] == pytest.approx(own, rel=1e-6)


@pytest.mark.slow
def test_onset_behind_an_elastic_line():
    found = load({"onset.coarse_mesh": 0}).onset("density=10:60:3:log")
    point = found.points[-1]
    assert point["confirmed"] and point["criticality"] in ("super", "sub")
    modes = load({"fluid.density": point["value"]}).modes(count=4).modes
    assert min(abs(mode.growth_rate) for mode in modes) < 1e-5


def test_sensitivity_to_the_wave_speed():
    (found,) = load().steady(pressure="6 kPa").sensitivity("wave_speed").sensitivities
    low, high = (leading({"upstream.wave_speed": 600.0 + step}) for step in (-0.6, 0.6))
    assert found.growth_rate == pytest.approx((high - low) / 1.2, rel=1e-3)


def test_a_search_ends_where_waves_are_resolved():
    modes = load().modes(count=4)
    assert any("resolve waves up to 150 Hz" in note for note in modes.notes)
