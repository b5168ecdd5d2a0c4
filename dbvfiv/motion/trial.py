"""A candidate for the new state of a step: its equations, their iteration matrix, and the state that it becomes.

A one-step scheme of the generalised-alpha family weights accelerations by 1 - alpha_m and forces by 1 - alpha_f, where
the work of a step has their means. With M and a linear force F
the difference, which numerical damping takes, is known (Erlicher, Bonaventura and Bursi
2002 have its like), D what a quantity changes by, v the mean velocity and a without the part of contact's impulses:

    loss = mu h v' M Da + k h Da' M (Dv + h mu Da) + (1/2 - alpha_f) DF' Dq,
    mu = 1 - alpha_m - gamma,     k = beta - gamma/2

It is zero without numerical damping, and no square: over a smooth motion with steps of one kind it adds up to a loss,
but steps that go from damped to not and back leave h v' M a at each turn, with either sign. What is nonlinear in F and
M is left to the balance of energy.

Equation (T.29) of docs/theory.md.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..flow.stepping import SECOND_ORDER
from .scheme import Scheme
from .state import MotionState


@dataclass(frozen=True)
class Weights:
    """Weights of the parts of a step's equations: their dependence on the new unknowns.

    Attributes
    ----------
    theta : float
        Point in the step at which the fluid's equations are met: the share of the new state there.
    load : float
        Factor of G p there.
    inertia : float
        Factor of M, 1/s2; mass damping included.
    force : float
        Factor of the tangent of F.
    velocity : float
        Derivative of the new velocities with respect to the new positions, 1/s.
    outside : float
        Factor of the added mass of fluid outside, 1/s2: no damping acts on it.
    """

    theta: float
    load: float
    inertia: float
    force: float
    velocity: float
    outside: float = 0.0


class Trial:
    """A candidate for the new state; its unknowns are the accelerations. The inlet velocity follows from them.

    With `robust` the fluid's equations are met at the end of the step, psi by a backward difference: of first order,
    but momentum that is lost within a step, when lips slam, does not come back with the opposite sign. Its force is
    then the weighted mean of this and the last one, as spikes that change their sign from step to step would otherwise
    do work on stops that ring.

    Contact of faces acts as the impulse of its own step (nonsmooth generalised-alpha; Bruls, Acary & Cardona 2014): it
    moves the wall by half the step and changes velocities at once, and what the scheme carries on to later steps as
    accelerations has no part of it. Impacts then keep or lose what the contact's law says for any member of the family.
    """

    def __init__(
        self, motion, scheme: Scheme, old: MotionState, h: float, pressure: Callable[[float], float], robust: bool
    ):
        self.motion, self.scheme, self.old, self.h = motion, scheme, old, h
        s, now = scheme, scheme.now
        self.wall = None if motion.wall is None else motion.wall.step(old.memory, h)
        theta, rate = (1.0, 1.0) if robust else SECOND_ORDER if motion.fluid.compressed else (now, s.rate)
        self.kind = (h, robust, s.gamma)
        self.weights = Weights(
            theta=theta,
            load=now if theta == 1.0 else 1.0,
            inertia=(1.0 - s.alpha_m) / (s.beta * h * h) + motion.mu.alpha * now * s.gamma / (s.beta * h),
            force=now + motion.mu.beta * s.rate / h,
            velocity=s.gamma / (s.beta * h),
            outside=(1.0 - s.alpha_m) / (s.beta * h * h),
        )
        self.contact = motion.contact_step(old.q, h) if motion.contact is not None else None
        self._impulse_weight = (1.0 - s.alpha_m) / (2.0 * s.beta)
        inlet = pressure(old.time + theta * h)
        self.fluid = motion.begin_step(old, h, theta, rate, inlet)

        # stiffness damping is by the slow law, and its force is known apart only where there is some
        rayleigh = self.wall is not None and motion.mu.beta
        self._slow = motion.internal_force(old.q) if rayleigh else None

    def _slow_rate(self) -> np.ndarray:
        return (self.motion.internal_force(self.q) - self._slow) / self.h

    def set(self, a: np.ndarray) -> None:
        """Start from new accelerations."""
        s, h, old = self.scheme, self.h, self.old
        self.a = np.array(a)
        self.v = old.v + h * ((1.0 - s.gamma) * old.a + s.gamma * self.a)
        self.q = old.q + h * old.v + h * h * ((0.5 - s.beta) * old.a + s.beta * self.a)

    def move(self, fraction: float, dq: np.ndarray) -> None:
        """Add a fraction of a correction of q."""
        s, h = self.scheme, self.h
        self.q = self.q + fraction * dq
        self.v = self.v + (fraction * s.gamma / (s.beta * h)) * dq
        self.a = self.a + (fraction / (s.beta * h * h)) * dq

    def evaluate(self) -> float:
        """Set residual and forces; return the norm of the former."""
        s, now, old, motion = self.scheme, self.scheme.now, self.old, self.motion
        self.force = motion.internal_force(self.q, self.wall)
        self.force_rate = (self.force - old.force) / self.h if self._slow is None else self._slow_rate()
        self.q_mid = old.q + now * (self.q - old.q)
        self.v_mid = old.v + now * (self.v - old.v)
        self.a_mid = old.a + (1.0 - s.alpha_m) * (self.a - old.a)
        self.at_load = (self.q, self.v) if self.weights.theta == 1.0 else (self.q_mid, self.v_mid)
        self.load = motion.load(*self.at_load, self.q, self.v, self.fluid)
        alpha, beta = motion.mu.alpha, motion.mu.beta
        self.damping = beta * (old.force_rate + s.rate * (self.force_rate - old.force_rate))
        elastic = old.force + now * (self.force - old.force)
        inertia = motion.inertia(self.q_mid, self.v_mid, self.a_mid + alpha * self.v_mid if alpha else self.a_mid)
        if motion.outside is not None:
            inertia += motion.outside.force(self.q_mid, self.a_mid)
        share = self.weights.load
        self.push = self.load.force if share == 1.0 else old.load + share * (self.load.force - old.load)
        self.residual = inertia + self.damping + elastic - self.push
        if self.contact is not None:
            self.touch = self.contact.force(self.q)
            self.residual += self._impulse_weight * self.touch
        return float(np.linalg.norm(self.residual))

    def linearise(self) -> None:
        moving = (self.q, self.v, self.q_mid, self.v_mid)
        touching = {} if self.contact is None else {"contact": (self.contact, self._impulse_weight)}
        self.motion.linearise(*moving, self.load, self.weights, *self.at_load, self.wall, **touching)

    def allowed(self, tolerance: float, floor: float) -> float:
        """Largest correction that may be left, m; see `dbvfiv.motion.stepper.StepOptions`."""
        motion = self.motion
        moved = self.h**2 * self.scheme.beta * motion.length(self.a_mid)
        floor = max(floor, 1e3 * np.finfo(float).eps)
        return max(tolerance * moved + floor * motion.length(self.q), motion.resolution, np.finfo(float).tiny)

    def state(self) -> MotionState:
        old, load = self.old, self.load
        v, a = self._after_contact()
        return MotionState(
            old.time + self.h,
            self.q,
            v,
            a,
            self.force,
            self.force_rate,
            load.force,
            load.state(),
            None if self.wall is None else self.motion.wall.advance(old.memory, self.q, self.h, self.scheme.now),
        )

    def _after_contact(self) -> tuple[np.ndarray, np.ndarray]:
        """Velocities with the whole impulse of the step's contact, accelerations with none of it."""
        if self.contact is None or not np.any(self.touch):
            return self.v, self.a
        s, pushed = self.scheme, -self.motion.accelerated(self.q_mid, self.touch)
        return self.v + self.h * (1.0 - 0.5 * s.gamma / s.beta) * pushed, self.a - pushed / (2.0 * s.beta)

    @property
    def contact_loss(self) -> float:
        """Energy that contact took from the wall in the step and did not store, J."""
        if self.contact is None:
            return 0.0
        return float(self.touch @ (self.q - self.old.q)) - self.contact.stored(self.q)


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
