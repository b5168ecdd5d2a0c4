import pytest

from dbvfiv.studies.case import thesis_case
from dbvfiv.studies.stability.walk import StabilityWalk

COARSE = [
    "mesh.around=8",
    "mesh.along=16",
    "damping.alpha=0",
    "damping.beta=0.003",
    "fluid.density=10",
    "drive.pressure=6000",
]


@pytest.fixture(scope="session")
def coarse_case():
    return thesis_case(COARSE)


@pytest.fixture(scope="session")
def walk(coarse_case):
    return StabilityWalk(coarse_case)
