"""Coupled eigenvalues of the 12-inch valve: water, mesh."""

import numpy as np
import pytest

from dbvfiv.case.parameters import Mu
from dbvfiv.model import ValveModel, linearise
from dbvfiv.model.equilibria import LoadPath, SteadyOptions
from dbvfiv.studies.case import thesis_case
from eigen import SearchOptions, leading_modes

pytestmark = pytest.mark.slow
LIGHT = Mu(density=10.0, alpha=0.0, beta=0.003)


def model_of(around, along, **changes):
    return ValveModel(thesis_case({"mesh.around": around, "mesh.along": along} | changes))


def linearised(model, pressures):
    path = LoadPath(model, SteadyOptions.of(model.case))
    return [linearise(model, path.go_to(float(p)).q, float(p)) for p in pressures]


def options(beta=0.003, **more):
    return SearchOptions(limit_point=-1 / beta, **more)


def test_water_is_damped_from_2_to_50_kpa():
    print()
    for lin in linearised(model_of(28, 48), [2e3, 6e3, 12e3, 18e3, 29e3, 36e3, 50e3]):
        for storage in (0.0, 1.0):
            found = leading_modes(lin.pencil(Mu(density=1000.0, alpha=5.0, beta=0.003, storage=storage)), 4, options())
            print(
                f"{lin.inlet / 1e3:5.0f} kPa, {'storage' if storage else 'quasi-steady':12s}: leading "
                f"{found.eigenvalues[0]:.3f} 1/s"
            )
            assert found.status == "complete"
            assert found.growth_rate[0] < 0


def test_mesh_convergence_of_the_leading_mode():
    values = []
    for around, along in ((14, 24), (28, 48), (56, 96)):
        lin = linearised(model_of(around, along), [6e3])[0]
        values.append(leading_modes(lin.pencil(LIGHT), 2, options()).eigenvalues[0])
    coarse, middle, fine = values
    order = np.log2(abs(coarse - middle) / abs(middle - fine))
    print(f"\nleading mode {coarse:.3f}, {middle:.3f}, {fine:.3f} 1/s; observed order {order:.2f}")
    assert abs(fine - middle) < 0.01 * abs(fine)
    assert order > 1.8
