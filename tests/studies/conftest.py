import pytest

from dbvfiv.model import ValveModel
from dbvfiv.model.equilibria import LoadPath
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


@pytest.fixture(scope="session")
def coarse_model():
    """The 12-inch valve of the thesis on 8 x 16 elements."""
    return ValveModel(thesis_case({"mesh.around": 8, "mesh.along": 16}))


@pytest.fixture(scope="session")
def opened(coarse_model):
    """Its steady state at 6 kPa."""
    return LoadPath(coarse_model).go_to(6e3)
