"""State of a run between two steps, and how a first one is made."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..flow.gas_stepping import GasState
from ..flow.line_stepping import LineState
from ..shell import Memory


@dataclass(frozen=True)
class MotionState:
    """All that the next step depends on.

    Attributes
    ----------
    time : float, s
    speed : float
        Inlet velocity, m/s.
    q, v, a : (n,) arrays
        Unknowns (m, rad), velocities and accelerations; the latter without the part of touching faces, whose impulses
        belong to single steps.
    force, force_rate : (n,) arrays
        Internal force F and the scheme's value of its rate; of a wall that relaxes the rate by its slow law.
    load : (n,) array
        Force G p of the fluid where the equations were last met.
    psi, psi_rate : (m,) arrays
        Integral of the flow's speed from the inlet, m2/s, and the scheme's value of its rate.
    memory : Memory or None
        What a wall that relaxes remembers.
    line : LineState or None
        Waves in an elastic line.
    gas : GasState or None
        A fluid that is compressed.
    """

    time: float
    speed: float
    q: np.ndarray
    v: np.ndarray
    a: np.ndarray
    force: np.ndarray
    force_rate: np.ndarray
    load: np.ndarray
    psi: np.ndarray
    psi_rate: np.ndarray
    memory: Memory | None = None
    line: LineState | None = None
    gas: GasState | None = None


def consistent_state(
    motion,
    time: float,
    q,
    v,
    speed: float,
    inlet: float,
    memory: Memory | None = None,
    line: LineState | None = None,
    gas: GasState | None = None,
) -> MotionState:
    """State at given positions, velocities and inlet velocity with the accelerations that the equations of motion ask
    for; a wall that relaxes has done so unless its memory is given, and an elastic line and a fluid that is compressed
    flow steadily unless their states are.
    """
    q, v = np.asarray(q, float), np.asarray(v, float)
    held = None
    if motion.wall is not None:
        memory = motion.wall.at(q) if memory is None else memory
        held = motion.wall.held(memory)
    waves = {name: given for name, given in (("line", line), ("gas", gas)) if given is not None}
    a, load = motion.accelerations(q, v, speed, inlet, memory, **waves)
    if motion.contact is not None and motion.contact.touching(q):
        a = a + motion.accelerated(q, motion.contact.force(q))
    return MotionState(
        float(time),
        float(load.speed[-1]),
        q,
        v,
        a,
        motion.internal_force(q, held),
        motion.force_rate(q, v),
        load.force,
        load.psi,
        load.psi_rate,
        memory,
        load.line,
        None if load.gas is None else load.gas.state(),
    )
