"""State of a run between two steps, and how a first one is made."""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .equations import Weights


@dataclass(frozen=True)
class MotionState:
    """All that the next step depends on.

    Attributes
    ----------
    time : float, s
    q, v, a : (n,) arrays
        Unknowns (m, rad), velocities and accelerations.
    force, force_rate : (n,) arrays
        Internal force F and the scheme's value of its rate.
    speed, speed_rate : float
        Inlet velocity, m/s, and its rate.
    """

    time: float
    q: np.ndarray
    v: np.ndarray
    a: np.ndarray
    force: np.ndarray
    force_rate: np.ndarray
    speed: float
    speed_rate: float

    def pack(self) -> np.ndarray:
        """One vector (5 n + 3,) for a file."""
        return np.concatenate([[self.time, self.speed, self.speed_rate], self.q, self.v, self.a, self.force, self.force_rate])

    @classmethod
    def unpack(cls, packed: np.ndarray) -> "MotionState":
        time, speed, speed_rate = (float(value) for value in packed[:3])
        q, v, a, force, force_rate = np.split(np.array(packed[3:], float), 5)
        return cls(time, q, v, a, force, force_rate, speed, speed_rate)


def consistent_state(motion, time: float, q, v, speed: float, inlet: float) -> MotionState:
    """State at given positions, velocities and inlet velocity with the accelerations that the equations of motion ask for.

    The equations are linear in the accelerations and the rate of the inlet velocity: one solve.
    """
    q, v = np.asarray(q, float), np.asarray(v, float)
    zero = np.zeros(motion.size)
    force, force_rate = motion.internal_force(q), motion.force_rate(q, v)
    start = motion.weighted(q, v, zero, speed, 0.0, inlet)
    motion.linearise(q, q, v, zero, speed, 0.0, inlet, Weights(0.0, 0.0, 1.0, 0.0, 0.0, 1.0))
    unbalanced = force + motion.conditions.beta * force_rate + start.inertia + start.damping - start.load
    a, speed_rate = motion.solve(-unbalanced, -start.outlet)
    if not motion.moving_fluid:
        speed = start.speed
    return MotionState(float(time), q, v, a, force, force_rate, float(speed), float(speed_rate))
