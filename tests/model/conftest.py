"""Small valves and states that the coupled model is tried on."""

from __future__ import annotations

import numpy as np
import pytest

from dbvfiv.model import ValveModel
from dbvfiv.studies.case import thesis_case
from tests.small_valves import EVEN

SMALL = {"mesh.around": 6, "mesh.along": 12, **EVEN}  # noise at the nodes would turn narrow columns inside out


def build(**changes) -> ValveModel:
    return ValveModel(thesis_case(SMALL | {key.replace("__", "."): value for key, value in changes.items()}))


@pytest.fixture(scope="session")
def model() -> ValveModel:
    """The 12-inch valve on 6 by 12 elements."""
    return build()


@pytest.fixture(scope="session")
def make_model():
    """Builder of small valves with some keys of the case changed, dots written as two underscores."""
    return build


def opened(model: ValveModel, lift: float, seed: int = 0, noise: float = 2e-4) -> np.ndarray:
    """Free unknowns of a duckbill lifted by `lift` (m) at the lip, less towards the flange, with noise on every
    unknown.
    """
    mesh = model.mesh
    generator = np.random.default_rng(seed)
    nodal = noise * generator.standard_normal((len(mesh.nodes), 5)) * np.array([1, 1, 1, 30, 30])
    shape = np.clip(1 - mesh.nodes[:, 2] / 0.49, 0, 1) ** 2 * np.clip(1 - (mesh.nodes[:, 0] / 0.13119) ** 2, 0, 1)
    nodal[:, 1] += lift * shape
    return model.shell.dofs.restrict(nodal)


@pytest.fixture(scope="session")
def make_state():
    """See `opened`."""
    return opened
