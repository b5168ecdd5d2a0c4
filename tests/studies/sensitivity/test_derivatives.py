"""Derivatives of an eigenvalue against eigenvalues of changed valves."""

import numpy as np
import pytest

from dbvfiv.case.parameters import Mu
from dbvfiv.model import ValveModel, linearise
from dbvfiv.model.equilibria import find_equilibria
from dbvfiv.studies.case import thesis_case
from dbvfiv.studies.sensitivity import derivatives as sensitivity
from eigen import SearchOptions, leading_modes

CONDITIONS = Mu(density=10.0, alpha=1.0, beta=0.003)


@pytest.fixture(scope="module")
def valve():
    model = ValveModel(thesis_case({"mesh.around": 8, "mesh.along": 16}))
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
        "storage",
        "thickness",
        "angle",
        "layer 3 angle",
        "layer 1 thickness",
        "layer 2 c10",
        "layer 4 e1",
    ],
)
def test_derivative_is_that_of_the_eigenvalue(valve, name):
    model, q, mode = valve
    found = sensitivity.differentiate(model, q, 6e3, CONDITIONS, mode, name)
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


LOSSY = Mu(density=10.0, alpha=1.0, beta=0.0, loss_factor=1.0)


@pytest.fixture(scope="module")
def lossy_valve():
    changes = {"mesh.around": 8, "mesh.along": 14, "damping.model": "loss factor", "materials.constants": "stable"}
    model = ValveModel(thesis_case(changes))
    q = find_equilibria(model, [6e3]).states[0].q
    options = SearchOptions(max_frequency=100.0, left=True)
    return model, q, leading_modes(linearise(model, q, 6e3).pencil(LOSSY), 2, options).mode(0)


@pytest.mark.parametrize("name", ["loss_factor", "pressure", "density", "thickness", "layer 2 mu_0", "layer 3 angle"])
def test_derivative_of_a_wall_that_relaxes_is_that_of_the_eigenvalue(lossy_valve, name):
    """Through the change that the equilibrium makes to what relaxes, too."""
    model, q, mode = lossy_valve
    found = sensitivity.differentiate(model, q, 6e3, LOSSY, mode, name)
    h = 1e-3 * abs(found.value)

    def eigenvalue(value):
        pencil = sensitivity._pencil(model, q, 6e3, LOSSY, name, value)
        values = leading_modes(pencil, 4, SearchOptions(max_frequency=100.0)).eigenvalues
        return values[np.argmin(abs(values - mode.eigenvalue))]

    direct = (eigenvalue(found.value + h) - eigenvalue(found.value - h)) / (2 * h)
    assert found.derivative == pytest.approx(direct, rel=2e-4, abs=2e-5 * abs(mode.eigenvalue) / abs(found.value))
    assert {"loss_factor", "alpha"} <= set(sensitivity.parameters_of(model))
    assert "beta" not in sensitivity.parameters_of(model)


def test_at_the_end_of_its_range_a_parameter_is_stepped_inward(valve):
    """The strain level of 10 %, below which no rubber was tested."""
    model, q, mode = valve
    found = sensitivity.differentiate(model, q, 6e3, CONDITIONS, mode, "strain")
    near = SearchOptions(limit_point=-1 / 0.003)

    def eigenvalue(value):
        values = leading_modes(sensitivity._pencil(model, q, 6e3, CONDITIONS, "strain", value), 4, near).eigenvalues
        return values[np.argmin(abs(values - mode.eigenvalue))]

    h = 1e-3
    inward = (4 * eigenvalue(0.1 + h) - 3 * eigenvalue(0.1) - eigenvalue(0.1 + 2 * h)) / (2 * h)
    assert found.value == 0.1 and found.derivative == pytest.approx(inward, rel=1e-3)


def test_only_what_a_valve_has_is_a_parameter(valve):
    model, _, _ = valve
    assert {"angle", "strain", "storage", "layer 3 angle"} <= set(sensitivity.parameters_of(model))
    own = {"kind": "neo-hookean", "shear_modulus": "1 MPa", "density": 1200}
    case = model.case.replace({"materials.own": own, "layers": [{"material": "own", "thickness": 0.01}]})
    assert not {"angle", "strain"} & set(sensitivity.parameters_of(ValveModel(case)))


def test_an_unknown_parameter_is_named(valve):
    model, q, mode = valve
    with pytest.raises(ValueError, match="'colour'.*layer 1 thickness"):
        sensitivity.differentiate(model, q, 6e3, CONDITIONS, mode, "colour")
