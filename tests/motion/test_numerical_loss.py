"""What numerical damping takes, by its own formula: books of linear systems close to rounding with it."""

from __future__ import annotations

import numpy as np
import pytest

from dbvfiv.contact import ContactLaw, Rebound
from dbvfiv.motion.scheme import scheme
from dbvfiv.motion.stepper import StepOptions, Stepper, consistent_state
from tests.systems.bouncing import BouncingMotion, Planes

TIGHT = StepOptions(tolerance=1e-12, floor=1e-15, largest_turn=np.inf)
RULES = [("generalised-alpha", 0.2), ("generalised-alpha", 0.5), ("hht", 0.1), ("newmark", 0.3)]


def pair(contact: bool, beta: float = 0.0) -> BouncingMotion:
    """Two masses on springs; the second may meet a plane that keeps a half of what it is given."""
    planes = Planes(np.array([1]), np.array([0.1]), ContactLaw(300.0), Rebound(0.5)) if contact else None
    return BouncingMotion(np.diag([1.0, 2.0]), [[5.0, -3.0], [-3.0, 40.0]], planes, load=[0.3, -0.1], beta=beta)


def books(motion, rules, h, steps):
    """Energy gained beyond what the books of the steps say, and what numerical damping took, step by step."""
    steppers = [Stepper(motion, scheme(*rule), lambda t: 0.0, TIGHT) for rule in rules]
    state, left, taken = consistent_state(motion, 0.0, np.array([1.0, 0.2]), np.array([0.0, -2.0]), 0.0), [], []
    for i in range(steps):
        old, result = state, steppers[i % len(rules)].step(state, h)
        state = result.state
        gained = motion.energy(state.q, state.v) - motion.energy(old.q, old.v)
        left.append(gained + result.dissipation + result.contact_loss + result.numerical_loss)
        taken.append(result.numerical_loss)
    return np.array(left), np.array(taken)


@pytest.mark.parametrize("contact", [False, True])
@pytest.mark.parametrize("rule", RULES)
def test_books_close_with_numerical_damping(rule, contact):
    """Each step, with stiffness damping and through impacts; steps of damped and undamped members in turn too."""
    for rules in ([rule], [rule, ("generalised-alpha", 0.0)]):
        left, taken = books(pair(contact, beta=0.01), rules, 0.15, 60)
        assert np.abs(left).max() < 1e-10 and np.abs(taken).max() > 1e-3


def test_steps_without_it_take_nothing():
    left, taken = books(pair(True), [("generalised-alpha", 0.0)], 0.15, 60)
    assert np.abs(left).max() < 1e-10 and not taken.any()


def test_members_in_turn_change_the_energy_where_one_alone_loses_it():
    """Of a smooth motion a damped member takes little and takes it always; in turn with another it gives and takes."""
    alone, turns = (
        books(pair(False), rules, 0.05, 200)[1]
        for rules in ([("generalised-alpha", 0.2)], [("generalised-alpha", 0.2), ("generalised-alpha", 0.0)])
    )
    assert alone[20:].sum() > 0.0
    assert turns.min() < 0.0 < turns.max()
