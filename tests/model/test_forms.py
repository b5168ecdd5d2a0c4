"""Forms of the valve at given rates, against those of the elastic wall and against stresses that remember."""

from __future__ import annotations

import numpy as np
import pytest

from continuation.normal_form import Motion
from continuation.system import expand
from dbvfiv.model.dynamics import linearise
from dbvfiv.model.forms import PencilAt, ValveForms

from .test_relaxing_wall import relaxing_valve

RATES = (3.0 + 40j, -1.0 + 90j, 2.0 - 25j)


@pytest.fixture(scope="module")
def valve():
    return relaxing_valve(mesh__along=8)


@pytest.fixture(scope="module")
def steady(valve, make_state):
    return make_state(valve, 0.01)


@pytest.fixture(scope="module")
def parameters():
    return {"inlet": 6e3, "density": 10.0, "storage": 0.3, "alpha": 2.0, "beta": 0.002, "loss_factor": 1.0}


@pytest.fixture(scope="module")
def directions(valve):
    random = np.random.default_rng(3)
    size = valve.size + valve.flow.inner
    return [1e-3 * (random.normal(size=size) + 1j * random.normal(size=size)) for _ in range(3)]


def test_pencil_and_its_slope(valve, steady, parameters, directions):
    """Products, transposed products and solves belong together, and the slope is that of the products."""
    forms = ValveForms(valve, steady, parameters)
    s, (x, y, _) = RATES[0], directions
    pencil = forms.pencil(s)
    assert isinstance(pencil, PencilAt) and pencil.pencil.branches == 3
    product = pencil.matvec(x)
    assert pencil.rmatvec(y) @ x == pytest.approx(y @ product, rel=1e-9)
    assert pencil.solve(product) == pytest.approx(x, abs=1e-6 * np.abs(x).max())
    assert pencil.solve_transpose(pencil.rmatvec(y)) == pytest.approx(y, abs=1e-6 * np.abs(y).max())
    step = 1e-4 * abs(s)
    difference = (forms.pencil(s + step).matvec(x) - forms.pencil(s - step).matvec(x)) / (2 * step)
    slope = forms.slope(Motion(s, x))
    assert slope == pytest.approx(difference, abs=1e-6 * np.abs(slope).max())


@pytest.mark.parametrize("name", ["density", "alpha", "inlet", "loss_factor"])
def test_change_of_the_pencil_with_a_parameter(valve, steady, parameters, directions, name):
    """At a fixed state, flow unknowns included."""
    forms = ValveForms(valve, steady, parameters)
    inner, step = forms.rest[2 * valve.size :], 1e-3 * parameters[name]

    def product(value):
        mu = parameters | {name: value}
        pencil = linearise(valve, steady, mu["inlet"], mu, inner).pencil(mu)
        return PencilAt(pencil, RATES[0]).matvec(directions[0])

    difference = (product(parameters[name] + step) - product(parameters[name] - step)) / (2 * step)
    found = forms.mixed(Motion(RATES[0], directions[0]), name)
    assert found == pytest.approx(difference, abs=1e-5 * np.abs(difference).max())


@pytest.mark.slow
def test_forms_of_stresses_that_remember(valve, steady, parameters, directions):
    """Against the wall's relaxing tangent: what strains change of the stress of a group has the group's factor.

    The form along (a, b) differs from the elastic one by sums over groups of (r(s) - 1) times the derivatives of
    B(u)' S_g(v) along a in u and b in v and so on; where b comes with rate zero alone those are differences of the
    material tangents at displaced states.
    """
    shell, n = valve.shell, valve.size
    a, b = directions[0][:n], directions[1][:n].real
    layers, groups = len(shell.section.layers), shell.section.relaxing
    factor = np.array([0.3 + 0.2j, 0.1 + 0.4j])
    relaxed = np.ones(layers, complex)
    for group, x in zip(groups, factor):
        relaxed[list(group.layers)] += x
    ones = np.ones(layers)
    # a grows (bit 0), b stands still (bit 1): the stress of b alone and of the state are steady
    found = shell.relaxed_form(steady, [a, b], np.array([ones, relaxed, ones, relaxed]))
    elastic = expand(lambda *x: shell.second(steady, *x), a, b)
    step, change = 1e-3, np.zeros(n, complex)
    for i, x in enumerate(factor):
        above, below = (shell.dofs.matrix(shell.relaxing_tangents(steady + sign * step * b)[i]) for sign in (1, -1))
        change += x * ((above - below) @ a) / (2 * step)
    assert np.abs(change).max() > 0.05 * np.abs(elastic).max()
    assert found - elastic == pytest.approx(change, abs=1e-5 * np.abs(change).max())
