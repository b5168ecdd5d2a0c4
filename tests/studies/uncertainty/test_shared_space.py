"""Samples on a space that they share: outcomes are those of the full matrices for the same draws, growth rates theirs
within the errors that are allowed for; whoever works and however often the run is interrupted.
"""

import numpy as np
import pytest

import dbvfiv
from dbvfiv.observer import Observer
from dbvfiv.studies.stability.verdict import OUTCOMES
from dbvfiv.studies.uncertainty.study import PAYS

MESH = {"mesh.around": 6, "mesh.along": 8}
LINE = "cases/dbv12-in-line.toml"
SINGLY = PAYS - 8

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module", params=["quasi-steady", "storage"])
def valve(request):
    return dbvfiv.load(LINE, {**MESH, "drive.pressure": "2 m", "fluid.continuity": request.param})


def test_outcomes_are_those_of_the_full_matrices(valve):
    """The first samples of a longer run are those of a shorter one, which makes no space."""
    shared, singly = valve.uncertainty(samples=PAYS), valve.uncertainty(samples=SINGLY)
    (point,), (before,) = shared.points, singly.points
    assert before["shared"] == 0 and 0.5 * PAYS < point["shared"] <= PAYS
    value = shared.plan.values[0]
    found, known = shared.at(value), singly.at(value)
    assert np.array_equal(found["inputs"][:SINGLY], known["inputs"])
    assert [OUTCOMES[i] for i in found["outcome"][:SINGLY]] == [OUTCOMES[i] for i in known["outcome"]]
    assert np.allclose(found["opening"][:SINGLY], known["opening"], rtol=1e-8)
    apart = np.abs(found["growth_rate"][:SINGLY] - known["growth_rate"])
    assert (apart <= 0.2 * np.abs(known["growth_rate"])).all()
    assert np.median(apart / np.abs(known["growth_rate"])) < 0.01


def test_workers_and_interruptions_change_no_digit(valve, tmp_path):
    class Interrupt(Observer):
        def item(self, result):
            if result == 9:
                raise KeyboardInterrupt

    path = tmp_path / "samples.h5"
    assert valve.uncertainty(samples=PAYS, output=path, observer=Interrupt()).interrupted
    assert dbvfiv.resume(path, workers=2).summary() == valve.uncertainty(samples=PAYS).summary()
