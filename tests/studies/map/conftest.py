"""One map that is looked at from several sides."""

import pytest

from dbvfiv.studies.map.study import run_map
from tests.studies.map.axes import AXES


@pytest.fixture(scope="session")
def case(coarse_case):
    return coarse_case.replace(AXES)


@pytest.fixture(scope="session")
def whole(case):
    return run_map(case)
