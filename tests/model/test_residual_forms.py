"""Forms of the coupled residual for motions that grow at given rates against differences of its value."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from continuation.normal_form import Motion
from dbvfiv.model.forms import ValveForms
from dbvfiv.model.residual import ValveResidual

from .test_flow_laws import LAWS, MU, with_law

STEPS = {1: 1e-3, 2: 1e-3, 3: 1e-2}


@pytest.fixture(scope="module", params=LAWS)
def forms(request, make_model):
    """Away from an equilibrium, open wide, so that no stop is near; lips of even walls."""
    model = with_law(make_model, request.param)
    nodal = np.zeros((len(model.mesh.nodes), 5))
    nodal[:, 1] = 0.02 * np.clip(1 - model.mesh.nodes[:, 2] / 0.49, 0, 1) ** 2
    return ValveForms(model, model.shell.dofs.restrict(nodal), MU)


def joined(forms, motion):
    """Displacements, velocities, accelerations, flow unknowns and their rates of a motion at its first instant."""
    q, inner = np.split(motion.vector, [forms.model.size])
    s = motion.rate
    return q, s * q, s * s * q, inner, s * inner


def at_rest(forms):
    n = forms.model.size
    zero, inner = np.zeros(n), forms.rest[2 * n :]
    return forms.q, zero, zero, inner, np.zeros_like(inner)


def motions(forms, number):
    """Smooth motions that grow at real rates, of sizes that all terms notice."""
    n, inner, random = forms.model.size, forms.rest[2 * forms.model.size :], np.random.default_rng(5)
    for rate in (300.0, -200.0, 500.0)[:number]:
        yield Motion(rate, np.concatenate([1e-3 * random.normal(size=n), 0.1 * inner * random.normal(size=len(inner))]))


def difference(forms, directions, mu=MU):
    """Mixed central difference along all directions."""
    residual, total, step = ValveResidual(forms.model), 0.0, STEPS[len(directions)]
    for signs in itertools.product((-1, 1), repeat=len(directions)):
        place = list(at_rest(forms))
        for sign, direction in zip(signs, directions):
            place = [x + sign * step * d for x, d in zip(place, joined(forms, direction))]
        total = total + np.prod(signs) * residual.value(tuple(place), mu)
    return total / (2 * step) ** len(directions)


def check(forms, found, expected, tolerance):
    n = forms.model.size
    for block in (slice(0, n), slice(n, None)):
        scale = np.abs(expected[block]).max(initial=0.0)
        assert np.abs(found[block] - expected[block]).max(initial=0.0) <= tolerance * scale


@pytest.mark.parametrize("number", [1, *(pytest.param(number, marks=pytest.mark.slow) for number in (2, 3))])
def test_forms_are_derivatives(forms, number):
    directions = list(motions(forms, number))
    first = lambda motion: forms.pencil(motion.rate).matvec(motion.vector)  # noqa: E731
    found = {1: first, 2: forms.second, 3: forms.third}[number](*directions)
    check(forms, found.real, difference(forms, directions), {1: 1e-4, 2: 1e-4, 3: 1e-3}[number])


def test_derivatives_by_parameters_of_the_flow(forms):
    (motion,), residual, here = motions(forms, 1), ValveResidual(forms.model), at_rest(forms)
    for name in forms.model.flow.names:
        known = forms.model.flow.values(MU)[name]
        step = 1e-3 * known
        ends = [MU | {name: known + sign * step} for sign in (-1, 1)]
        low, high = (residual.value(here, mu) for mu in ends)
        slope = (high - low) / (2 * step)
        rounding = 1e-14 * np.abs(forms.model.structure(forms.q)[0]).max() / step  # of forces that some do not move
        found = forms.parameter_slope(name)
        assert found == pytest.approx(slope, rel=1e-6, abs=1e-5 * np.abs(slope).max() + rounding)
        low, high = (difference(forms, [motion], mu) for mu in ends)
        change = (high - low) / (2 * step)
        assert forms.mixed(motion, name).real == pytest.approx(change, abs=1e-3 * np.abs(change).max() + 1e3 * rounding)
