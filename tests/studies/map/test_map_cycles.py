"""Limit cycles over a map: those of branches, cell by cell; kept, resumed, drawn, and where there are none."""

from __future__ import annotations

import json
from types import SimpleNamespace

import numpy as np
import pytest

from dbvfiv.studies.map import cycles
from dbvfiv.studies.map.cycles import CELLS
from dbvfiv.studies.orbits import Follower
from dbvfiv.studies.session import load_result, resume_result
from tests.observers import Stop
from tests.studies.test_cycle import session_of as branch_of

MAP = {
    "map.x": "pressure=5.5 kPa:6 kPa:2",
    "map.y": "density=225:255:3",
    "map.curve": False,
    "map.refine": 0,
    "map.checks": 0,
    "map.cycles": True,
}


def session_of(**changes):
    return branch_of(**MAP | {key.replace("__", "."): v for key, v in changes.items()})


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    return tmp_path_factory.mktemp("cycles") / "map.h5"


@pytest.fixture(scope="module")
def found(file):
    return session_of().perform("map", file)


@pytest.mark.parametrize("transposed", [False, True])
def test_lines_on_which_lips_touch_go_to_the_nearest_point(monkeypatch, transposed):
    """A tongue along a column is touched twice; a line ends where the next column has no partner for it."""
    touching = {1.0: [2.0, 4.0], 2.0: [1.8, 4.3], 3.0: [4.8], 4.0: [], 5.0: [3.0]}
    known = {(value, 0): SimpleNamespace(touching=points) for value, points in touching.items()}
    monkeypatch.setattr(cycles, "read_cycles", lambda *_: known)
    plan = SimpleNamespace(across=SimpleNamespace(values=tuple(touching)), transposed=transposed)
    lines = [line[:, ::-1] if transposed else line for line in cycles.touching_curves(None, plan, 0)]
    assert [line.tolist() for line in lines] == [
        [[1.0, 2.0], [2.0, 1.8]],
        [[1.0, 4.0], [2.0, 4.3], [3.0, 4.8]],
        [[5.0, 3.0]],
    ]


def test_cells_have_the_cycles_of_branches(found):
    """Unstable cells have one, that of `cycle`; stable ones have none."""
    amplitude, frequency, growing = (found.cycle_grid(name)[0] for name in ("amplitude", "frequency", "growing"))
    unstable = found.grid("unstable")[0] > 0
    assert unstable.any() and not unstable.all()
    assert (np.isfinite(amplitude) == unstable).all() and (growing[unstable] == 0).all()
    assert (growing[~unstable] == -1).all()
    change = {"drive.pressure": 6e3, "cycle.over": "density=225:255:3", "cycle.exponents": 0}
    branch = session_of().replace(change).perform("cycle")
    (point,) = (p for p in branch.points if p.value == 225.0)
    assert np.isclose(amplitude[0, 1], point.amplitude, rtol=1e-3)
    assert np.isclose(frequency[0, 1], point.frequency, rtol=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize(
    "law, pressure, density",
    [("quasi-steady", "5.5 kPa:6 kPa:2", "200:250:11"), ("storage", "6 kPa:6.5 kPa:2", "15:26:11")],
)
def test_amplitudes_of_the_reduced_manifold(law, pressure, density):
    """Within 2 % of the cycles up to half the amplitude at which lips touch, and closer than the residual."""
    asked = {"fluid__continuity": law, "map__x": f"pressure={pressure}", "map__y": f"density={density}"}
    branch, near = (
        session_of(map__cycles=not reduced, map__amplitude=reduced, cycle__exponents=0, **asked).perform("map")
        for reduced in (False, True)
    )
    cycle, found = ({name: x.cycle_grid(name)[0] for name in CELLS} for x in (branch, near))
    reduced = np.isfinite(found["residual"]) & np.isfinite(cycle["amplitude"])  # a branch may lack a cell
    error = np.abs(found["amplitude"] / cycle["amplitude"] - 1)
    rest = near.cycle_grid("least")[0] + found["amplitude"]  # about the displacement at rest
    half = reduced & (found["amplitude"] <= 0.5 * rest)
    assert half.sum() >= 8
    assert (error[half] <= 0.02).all() and (error[reduced] <= found["residual"][reduced] + 1e-3).all()
    assert np.allclose(found["frequency"][half], cycle["frequency"][half], rtol=1e-3)
    assert (found["growing"][half] == 0).all()
    beyond = np.isfinite(cycle["amplitude"]) & ~np.isfinite(found["residual"])
    assert np.allclose(found["amplitude"][beyond], cycle["amplitude"][beyond], rtol=2e-3)


def test_amplitudes_near_onset_need_no_branch(found, monkeypatch):
    """Cells are those that branches give, without one; the branch is not asked for."""
    monkeypatch.setattr(Follower, "begin", None)
    again = session_of(map__cycles=False, map__amplitude=True, map__y="density=225:255:3").perform("map")
    assert (np.isfinite(again.cycle_grid("residual")) == np.isfinite(found.cycle_grid("amplitude"))).all()
    for name, tolerance in (("amplitude", 2e-2), ("frequency", 1e-3), ("growing", 0), ("least", 2e-2)):
        assert np.allclose(again.cycle_grid(name), found.cycle_grid(name), rtol=tolerance, equal_nan=True), name
    assert np.isnan(found.cycle_grid("residual")).all() and again.summary()["touching_curves"] == []


def test_in_file_tables_and_figures(found, file):
    again = load_result(file)
    assert json.dumps(again.summary()) == json.dumps(found.summary())
    assert np.shape(again.summary()["cycle_amplitude"]) == (3, 2)
    assert any("limit cycles in" in line and "mm" in line for line in again.lines())
    assert "cycle-amplitude" in again.figures()


@pytest.mark.slow
def test_interrupted_and_resumed(found, tmp_path):
    second = Stop(0, "cycles at pressure = 6000")
    part = session_of(cycle__exponents=0).perform("map", tmp_path / "part.h5", second)
    assert part.interrupted and np.isnan(part.cycle_grid("amplitude")[0, :, 1]).all()
    assert np.isfinite(part.cycle_grid("amplitude")[0, 0, 0])
    whole = resume_result(tmp_path / "part.h5")
    assert whole.complete
    assert np.allclose(whole.cycle_grid("amplitude"), found.cycle_grid("amplitude"), rtol=1e-4, equal_nan=True)


def test_cells_without_a_cycle_say_why():
    result = session_of(map__x="pressure=5.9 kPa:6 kPa:2", cycle__amplitude=0.09).perform("map")
    assert np.isnan(result.cycle_grid("amplitude")).all()
    said = [line for line in result.lines() if "without a cycle" in line]
    assert len(said) == 2 and "5.9 kPa" in said[0] and "cycle.amplitude" in said[0]
    assert "cycle-amplitude" not in result.figures()


def test_without_being_asked_there_are_none():
    result = session_of(map__x="pressure=5.9 kPa:6 kPa:2", map__cycles=False).perform("map")
    assert "cycle_amplitude" not in result.summary() and np.isnan(result.cycle_grid("amplitude")).all()
