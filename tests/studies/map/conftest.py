"""One map that is looked at from several sides."""

import pytest

from tests.studies.map.axes import AXES, run_map


@pytest.fixture(scope="session")
def case(coarse_case):
    return coarse_case.replace(AXES)


@pytest.fixture(scope="session")
def whole(case):
    return run_map(case)
