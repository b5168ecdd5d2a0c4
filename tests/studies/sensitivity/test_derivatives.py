"""Derivatives of an eigenvalue against eigenvalues of changed valves."""

import numpy as np
import pytest

from dbvfiv.case.model import Case
from dbvfiv.model import Conditions, ValveModel, linearise
from dbvfiv.model.equilibria import find_equilibria
from dbvfiv.studies.sensitivity import derivatives as sensitivity
from eigen import SearchOptions, leading_modes

CONDITIONS = Conditions(10.0, 1.0, 0.003)


@pytest.fixture(scope="module")
def valve():
    model = ValveModel(Case().replace({"mesh.around": 8, "mesh.along": 16}))
    q = find_equilibria(model, [6e3]).states[0].q
    options = SearchOptions(limit_point=-1 / 0.003, left=True)
    return model, q, leading_modes(linearise(model, q, 6e3).pencil(CONDITIONS), 2, options).mode(0)


@pytest.mark.parametrize(
    "name",
    [
        "pressure",
        "density",
        "alpha",
        "beta",
        "thickness",
        "layer 3 angle",
        "layer 1 thickness",
        "layer 2 c10",
        "layer 4 e1",
    ],
)
def test_derivative_is_that_of_the_eigenvalue(valve, name):
    model, q, mode = valve
    (found,) = sensitivity.eigenvalue_sensitivities(model, q, 6e3, CONDITIONS, mode, [name])
    h = 1e-3 * (abs(found.value) or 1.0)
    near = SearchOptions(limit_point=-1 / 0.003)

    def eigenvalue(value):
        pencil = sensitivity._pencil(model, q, 6e3, CONDITIONS, name, value)
        values = leading_modes(pencil, 4, near).eigenvalues
        return values[np.argmin(abs(values - mode.eigenvalue))]

    direct = (eigenvalue(found.value + h) - eigenvalue(found.value - h)) / (2 * h)
    assert found.derivative == pytest.approx(
        direct, rel=2e-4, abs=2e-5 * abs(mode.eigenvalue) / (abs(found.value) or 1.0)
    )


def test_an_unknown_parameter_is_named(valve):
    model, q, mode = valve
    with pytest.raises(ValueError, match="'colour'.*layer 1 thickness"):
        sensitivity.eigenvalue_sensitivities(model, q, 6e3, CONDITIONS, mode, ["colour"])
