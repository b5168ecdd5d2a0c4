"""The steady branch of the 12-inch valve over inlet pressure, by pseudo-arclength: folds would be met and passed, and
there are none.
"""

import numpy as np
import pytest

from continuation import ContinuationOptions, NewtonOptions, continue_branch
from dbvfiv.case.parameters import Mu
from dbvfiv.studies.case import thesis_case
from dbvfiv.studies.onset.normal_form import system_of
from dbvfiv.studies.stability.walk import StabilityWalk

HIGHEST = 60e3


@pytest.fixture(scope="module")
def walk():
    return StabilityWalk(thesis_case(["mesh.around=10", "mesh.along=20", "drive.pressure=300 Pa"]))


@pytest.fixture(scope="module")
def branch(walk):
    place = Mu.of(walk.case)
    system = system_of(walk.case, walk, place)
    options = ContinuationOptions(
        step=0.02,
        min_step=1e-5,
        max_step=0.2,
        max_points=400,
        limits={"inlet": (0.0, HIGHEST)},
        parameter_scales={"inlet": 2e4},
        state_scale=10.0,
        newton=NewtonOptions(tolerance=1e-4, max_iterations=12),
        branch_points=False,
    )
    return continue_branch(
        system, system.state(walk.equilibrium(place), place.for_system()), place.for_system(), "inlet", options
    )


def test_the_branch_reaches_its_end_without_folds(branch):
    assert "limit inlet" in branch.reason and branch.points[-1].z[-1] == pytest.approx(HIGHEST)
    assert not branch.special
    assert np.all(np.diff(branch.values("inlet")) > 0)


def test_the_opening_is_softest_near_six_kilopascal(branch):
    """The rate of pressure along the branch, zero at a fold, has one minimum, well above zero."""
    rate = np.array([point.tests["fold"] for point in branch.points[1:]])
    low = int(np.argmin(rate))
    assert 5e3 < branch.values("inlet")[1:][low] < 8e3
    assert rate[low] > 0.3 * rate[0]
    assert np.all(np.diff(rate[: low + 1]) < 0) and np.all(np.diff(rate[low:]) > 0)


def test_load_steps_find_the_same_state(branch, walk):
    last = branch.points[-1]
    q = walk.equilibrium(Mu.of(walk.case).at(pressure=float(last.z[-1])))
    assert last.z[: q.size] == pytest.approx(q, abs=1e-6 * np.abs(q).max())
