"""Energy that the numerical damping of a scheme takes in a step.

A one-step scheme of the generalised-alpha family weights accelerations by 1 - alpha_m and forces by 1 - alpha_f, where
the work of a step has their means. With M and a linear force F the difference is known (Erlicher, Bonaventura and Bursi
2002 have its like), D what a quantity changes by, v the mean velocity and a without the part of contact's impulses:

    loss = mu h v' M Da + k h Da' M (Dv + h mu Da) + (1/2 - alpha_f) DF' Dq,
    mu = 1 - alpha_m - gamma,     k = beta - gamma/2

It is zero without numerical damping, and no square: over a smooth motion with steps of one kind it adds up to a loss,
but steps that go from damped to not and back leave h v' M a at each turn, with either sign. What is nonlinear in F and
M is left to the balance of energy.

Equation (T.29) of docs/theory.md.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from .state import MotionState
    from .trial import Trial


def numerical_loss(motion, trial: Trial, new: MotionState) -> float:
    """Energy that the numerical damping of a step takes, J.

    Parameters
    ----------
    motion : ValveMotion or anything with its methods
    trial : Trial
        The step's equations, met.
    new : MotionState
        What the step ends with.
    """
    s, old, h = trial.scheme, trial.old, trial.h
    mu, shift, forward = 1.0 - s.alpha_m - s.gamma, s.beta - 0.5 * s.gamma, 0.5 - s.alpha_f
    if not (mu or shift or forward):
        return 0.0
    change, faster = new.a - old.a, new.v - old.v
    momentum = motion.momentum(trial.q_mid, change)
    if motion.outside is not None:
        momentum = momentum + motion.outside.force(trial.q_mid, change)
    inertia = mu * (0.5 * (old.v + new.v)) + shift * (faster + h * mu * change)
    return float(h * (inertia @ momentum) + forward * (_force_change(motion, old, new) @ (new.q - old.q)))


def _force_change(motion, old: MotionState, new: MotionState) -> np.ndarray:
    """Change (n,) of the force that has a potential: that of branches is in the books of their own."""
    if motion.wall is None:
        return new.force - old.force
    return motion.internal_force(new.q) - motion.internal_force(old.q)
