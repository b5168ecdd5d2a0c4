"""Contact over a step: what is done on closing faces is stored exactly, parting faces get back their share."""

from __future__ import annotations

import numpy as np
import pytest

from dbvfiv.contact import ContactLaw, ContactStep, PlaneContact, Rebound, mean_pressure, tributary_area
from dbvfiv.shell.mesh import nodal_thickness
from tests.contact.test_contact import _shell, _state

LAWS = [ContactLaw(1e9), ContactLaw(1e9, 2e-4)]
GAPS = np.array([2e-3, 1e-4, 3e-5, 0.0, -1e-6, -8e-5, -1e-3])


@pytest.mark.parametrize("law", LAWS, ids=["kink", "rounded"])
def test_the_mean_pressure_does_the_work_that_is_stored(law):
    old, new = (grid.ravel() for grid in np.meshgrid(GAPS, GAPS + 3e-9))
    mean, _ = mean_pressure(law, old, new)
    gained = law.respond(new)[0] - law.respond(old)[0]
    assert mean * (old - new) == pytest.approx(gained, rel=1e-9, abs=1e-12 * np.abs(gained).max())
    assert mean.min() >= 0.0


@pytest.mark.parametrize("law", LAWS, ids=["kink", "rounded"])
def test_its_slope_is_its_derivative(law):
    old, new = (grid.ravel() for grid in np.meshgrid(GAPS, GAPS + 7e-6))
    h = 1e-9
    _, slope = mean_pressure(law, old, new)
    change = (mean_pressure(law, old, new + h)[0] - mean_pressure(law, old, new - h)[0]) / (2 * h)
    assert slope == pytest.approx(change, rel=1e-4, abs=1e-5 * law.penalty)


def test_faces_that_part_get_back_their_share():
    rebound = Rebound(0.3, 1e-3)
    rate = np.array([-1.0, -1e-9, 0.0, 1e-3, 10.0])
    factor, slope = rebound.factor(rate)
    assert factor == pytest.approx([1.0, 1.0, 1.0, 0.65, 0.3], abs=1e-6)
    assert slope[:3] == pytest.approx(0.0)  # at rest neither force nor damping is changed
    h = 1e-9
    change = (rebound.factor(rate + h)[0] - rebound.factor(rate - h)[0]) / (2 * h)
    assert slope == pytest.approx(change, abs=1e-3)


def _plane(law) -> PlaneContact:
    free = np.ones((30, 5), bool)
    free[:5] = False
    free[10:14, 4] = False
    shell = _shell(free)
    return PlaneContact(shell, np.arange(30), 0.5 * nodal_thickness(shell.mesh), tributary_area(shell), law, axis=1)


def _ends(plane, size=1.0):
    """Two states with faces that close and faces that part; the way between them `size` millimetres."""
    pressed = type("Pressed", (), {"shell": plane.shell})
    old = _state(pressed)
    new = old + size * (_state(pressed, seed=8) - old)
    return old, new


@pytest.mark.parametrize("law", LAWS, ids=["kink", "rounded"])
def test_force_does_its_work_but_for_the_third_power_of_turns(law):
    plane = _plane(law)
    missing = []
    for size in (0.1, 0.05):
        old, new = _ends(plane, size)
        step = ContactStep(plane, old, 1e-3)
        missing.append(abs(step.force(new) @ (new - old) - step.stored(new)))
    assert missing[0] < 1e-3 * abs(step.stored(new))
    assert missing[1] < 0.25 * missing[0]


@pytest.mark.parametrize("law", LAWS, ids=["kink", "rounded"])
def test_tangent_is_the_derivative_of_the_force(law):
    plane = _plane(law)
    old, new = _ends(plane, 0.2)
    dofs = plane.shell.dofs
    step = ContactStep(plane, old, 1e-3, Rebound(0.4, 0.05))
    data = np.zeros(len(dofs.pattern[1]))
    step.add_tangent(new, data, 2.0)
    direction = np.random.default_rng(2).standard_normal(dofs.size)
    h = 1e-9
    ahead, behind = (step.force(new + sign * h * direction) for sign in (1, -1))
    change = (ahead - behind) / (2 * h)
    assert dofs.matrix(data) @ direction == pytest.approx(2.0 * change, rel=1e-4, abs=1e-5 * np.abs(change).max())


def test_without_contact_nothing_is_done():
    plane = _plane(LAWS[0])
    nodal = plane.shell.dofs.expand(np.zeros(plane.shell.dofs.size))
    nodal[5:, 1] += 0.05
    q = plane.shell.dofs.restrict(nodal)
    step = ContactStep(plane, q, 1e-3)
    assert not step.force(q).any() and step.stored(q) == 0.0
