"""Second and third derivatives of the coupled residual against differences of its value, about a steady state with
damping and both continuity laws.
"""

import itertools

import numpy as np
import pytest

from dbvfiv.model import ValveModel
from dbvfiv.model.residual import ValveResidual
from dbvfiv.studies.case import thesis_case
from tests.small_valves import EVEN

STEPS = {2: 1e-3, 3: 1e-2}


@pytest.fixture(scope="module")
def residual():
    return ValveResidual(
        ValveModel(thesis_case(["mesh.around=6", "mesh.along=8", *(f"{key}={value}" for key, value in EVEN.items())]))
    )


@pytest.fixture(scope="module")
def about(residual):
    model = residual.model
    nodal = np.zeros((len(model.mesh.nodes), 5))
    # open wide, so that no stop is near
    nodal[:, 1] = 0.02 * np.clip(1 - model.mesh.nodes[:, 2] / 0.49, 0, 1) ** 2
    zero = np.zeros(model.size)
    return model.shell.dofs.restrict(nodal), zero, zero, 1.3, 0.0


@pytest.fixture(scope="module", params=[0.0, 1.0], ids=["quasi-steady", "storage"])
def parameters(request):
    return {"inlet": 4e3, "density": 10.0, "alpha": 2.0, "beta": 0.003, "storage": request.param}


def motions(residual, number):
    """Smooth motions with displacements, velocities and accelerations, of sizes that all terms notice."""
    n = residual.model.size
    random = np.random.default_rng(5)
    return [
        (random.normal(size=n) * 1e-3, random.normal(size=n), random.normal(size=n), random.normal(), random.normal())
        for _ in range(number)
    ]


def difference(residual, about, parameters, directions):
    """Mixed central difference along all directions."""
    total, step = 0.0, STEPS[len(directions)]
    for signs in itertools.product((-1, 1), repeat=len(directions)):
        place = list(about)
        for sign, direction in zip(signs, directions):
            place = [x + sign * step * d for x, d in zip(place, direction)]
        total = total + np.prod(signs) * residual.value(tuple(place), parameters)
    return total / (2 * step) ** len(directions)


@pytest.mark.parametrize("number, form", [(2, "second"), pytest.param(3, "third", marks=pytest.mark.slow)])
def test_forms_are_derivatives(residual, about, parameters, number, form):
    directions = motions(residual, number)
    exact = getattr(residual, form)(about, parameters, *directions)
    found = difference(residual, about, parameters, directions)
    scale = np.abs(found[:-1]).max()
    assert exact[:-1] == pytest.approx(found[:-1], abs=1e-3 * scale)
    assert exact[-1] == pytest.approx(found[-1], rel=1e-4)


def test_motions_without_displacement_or_velocity(residual, about, parameters):
    """Where parts vanish the shorter evaluation is the same form."""
    a, b = motions(residual, 2)
    still = lambda m: (m[0], np.zeros_like(m[0]), m[2], m[3], m[4])  # noqa: E731
    moving = lambda m: (np.zeros_like(m[0]), m[1], np.zeros_like(m[0]), 0.0, 0.0)  # noqa: E731
    whole = residual.second(about, parameters, a, b)
    parts = sum(residual.second(about, parameters, f(a), g(b)) for f in (still, moving) for g in (still, moving))
    assert parts == pytest.approx(whole, abs=1e-9 * np.abs(whole).max())
