"""Columns of a map shared by MPI processes."""

import numpy as np
import pytest

from dbvfiv.studies.session import load_result
from tests.small_valves import settings
from tests.studies.map.axes import run_map
from tests.studies.work import run_under_mpi

SETTINGS = {
    "map.x": "pressure=3 kPa:8 kPa:4",
    "map.y": "density=1:1000:6:log",
    "map.curve": False,
    "map.refine": 0,
    "map.checks": 1,
}
MESH = {"mesh.around": 8, "mesh.along": 16, "damping.alpha": 0.0, "damping.beta": 0.003}


@pytest.mark.slow
def test_two_mpi_processes_find_the_same_map(coarse_case, tmp_path):
    path = tmp_path / "map.h5"
    done = run_under_mpi(2, "dbvfiv", "map", *settings(SETTINGS | MESH), "-o", str(path))
    assert done.returncode == 0, done.stderr
    shared, alone = load_result(path), run_map(coarse_case.replace(SETTINGS | MESH))
    assert shared.complete and len(shared.columns) == 4
    assert (shared.grid("unstable") == alone.grid("unstable")).all() and shared.grid("certified").all()
    assert shared.grid("growth_rate") == pytest.approx(alone.grid("growth_rate"), rel=1e-6, abs=1e-6)
    for a, b in zip(shared.columns, alone.columns):
        assert np.array(a.onsets) == pytest.approx(np.array(b.onsets), rel=1e-8)
