"""Limit cycles over a map: those of branches, cell by cell; kept, resumed, drawn, and where there are none."""

from __future__ import annotations

import json

import numpy as np
import pytest

from dbvfiv.observer import Observer
from dbvfiv.studies.case import thesis_case
from dbvfiv.studies.session import Session, load_result, resume_result

CASE = {
    "mesh.around": 6,
    "mesh.along": 8,
    "damping.alpha": 0.0,
    "damping.beta": 3e-3,
    "map.x": "pressure=5.5 kPa:6 kPa:2",
    "map.y": "density=225:255:3",
    "map.curve": False,
    "map.refine": 0,
    "map.checks": 0,
    "map.cycles": True,
}


def session_of(**changes):
    return Session(thesis_case(CASE | {key.replace("__", "."): v for key, v in changes.items()}))


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    return tmp_path_factory.mktemp("cycles") / "map.h5"


@pytest.fixture(scope="module")
def found(file):
    return session_of().perform("map", file)


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


def test_in_file_tables_and_figures(found, file):
    again = load_result(file)
    assert json.dumps(again.summary()) == json.dumps(found.summary())
    assert np.shape(again.summary()["cycle_amplitude"]) == (3, 2)
    assert any("limit cycles in" in line and "mm" in line for line in again.lines())
    assert "cycle-amplitude" in again.figures()


class _Stopper(Observer):
    """Interrupts when the cycles of the second column begin."""

    def progress(self, text):
        if text == "cycles at pressure = 6000":
            raise KeyboardInterrupt


@pytest.mark.slow
def test_interrupted_and_resumed(found, tmp_path):
    part = session_of(cycle__exponents=0).perform("map", tmp_path / "part.h5", _Stopper())
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
