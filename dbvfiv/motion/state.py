"""State of a run between two steps, and how a first one is made."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..flow.stepping import FluidState
from ..shell import Memory


@dataclass(frozen=True)
class MotionState:
    """All that the next step depends on.

    Attributes
    ----------
    time : float, s
    q, v, a : (n,) arrays
        Unknowns (m, rad), velocities and accelerations; the latter without the part of touching faces, whose impulses
        belong to single steps.
    force, force_rate : (n,) arrays
        Internal force F and the scheme's value of its rate; of a wall that relaxes the rate by its slow law.
    load : (n,) array
        Force G p of the fluid where the equations were last met.
    fluid : FluidState
    memory : Memory or None
        What a wall that relaxes remembers.
    """

    time: float
    q: np.ndarray
    v: np.ndarray
    a: np.ndarray
    force: np.ndarray
    force_rate: np.ndarray
    load: np.ndarray
    fluid: FluidState
    memory: Memory | None = None


def consistent_state(
    motion, time: float, q, v, inlet: float, inner: np.ndarray | None = None, memory: Memory | None = None
) -> MotionState:
    """State at given positions and velocities with the accelerations that the equations of motion ask for.

    The fluid is at rest without pressure unless its unknowns (l,) are given; a wall that relaxes has done so unless
    its memory is.
    """
    q, v = np.asarray(q, float), np.asarray(v, float)
    held = None
    if motion.wall is not None:
        memory = motion.wall.at(q) if memory is None else memory
        held = motion.wall.held(memory)
    a, load = motion.accelerations(q, v, inlet, inner, memory)
    if motion.contact is not None and motion.contact.touching(q):
        a = a + motion.accelerated(q, motion.contact.force(q))
    force = motion.internal_force(q, held), motion.force_rate(q, v)
    return MotionState(float(time), q, v, a, *force, load.force, load.state(), memory)
