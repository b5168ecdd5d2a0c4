"""First states of runs: at rest, steady, kicked along a mode, or taken from a result file."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..case.model import Case
from ..errors import CaseError, SolveError
from ..model.dynamics import linearise
from ..model.equilibria import LoadPath, SteadyOptions
from ..model.newton import NewtonOptions
from ..observer import Observer
from .equations import ValveMotion
from .state import MotionState, consistent_state


@dataclass(frozen=True)
class Kick:
    """The mode that a push followed.

    Attributes
    ----------
    eigenvalue : complex, 1/s
    """

    eigenvalue: complex


def first_state(motion: ValveMotion, case: Case, inlet: float, observer: Observer) -> tuple[MotionState, Kick | None]:
    """State that a case starts from, with inlet pressure (Pa) of the first instant.

    Raises
    ------
    SolveError
        If the steady state or the mode was not found.
    CaseError
        If the stored state cannot be used.
    """
    model, transient = motion.model, case.transient
    if transient.start == "rest":
        return consistent_state(motion, 0.0, model.rest(), model.rest(), 0.0, inlet), None
    if transient.start == "state":
        return stored_state(motion, case, inlet), None
    observer.progress(f"steady state at {inlet:.6g} Pa")
    q = steady_positions(model, inlet)
    speed = (
        model.flow.inlet_velocity(model.rows.areas(model.nodal(q)), inlet, motion.conditions.density)
        if inlet > 0
        else 0.0
    )
    still = np.zeros(model.size)
    if transient.start == "steady":
        return consistent_state(motion, 0.0, q, still, speed, inlet), None
    observer.progress("mode to follow")
    return kicked(motion, q, speed, inlet, transient.kick_mode, transient.kick_opening)


def steady_positions(model, inlet: float) -> np.ndarray:
    """Equilibrium (n,), as exact as rounding allows: what is left of a residual would shake light parts of the wall."""
    if inlet <= 0:
        return model.rest()
    options = SteadyOptions.of(model.case)
    path = LoadPath(model, SteadyOptions(NewtonOptions(1e-13, options.newton.max_iterations), options.min_step))
    path.go_to(inlet)
    return path.q


def kicked(
    motion: ValveMotion, q: np.ndarray, speed: float, inlet: float, number: int, opening: float
) -> tuple[MotionState, Kick]:
    """Steady state pushed along its oscillating mode of a number, counted by growth rate from 1.

    The push moves the lip by `opening` in y, m, half of what the clear opening changes by.
    """
    from eigen import leading_modes

    model = motion.model
    pencil = linearise(model, q, inlet).pencil(motion.conditions)
    count = number + 6
    while True:
        found = leading_modes(pencil, count)
        oscillating = [i for i in range(len(found)) if found.eigenvalues[i].imag > 1e-6 * abs(found.eigenvalues[i])]
        if len(oscillating) >= number:
            break
        if len(found) < count or count > 100:
            raise SolveError(
                f"Only {len(oscillating)} oscillating modes were found, so there is no mode {number} to "
                f"push the valve along."
            )
        count *= 2
    mode = found.mode(oscillating[number - 1])
    nodal = model.nodal(mode.q)
    lip = nodal[model.mesh.rows[0, 0], 1]
    if abs(lip) < 1e-6 * np.abs(nodal[:, :3]).max():
        raise SolveError(f"Mode {number} does not move the middle of the lip, so no push can be measured there.")
    shape = opening / lip * mode.q
    flow = float((opening / lip * mode.u[0]).real) if motion.moving_fluid and len(mode.u) else 0.0
    state = consistent_state(motion, 0.0, q + shape.real, (mode.eigenvalue * shape).real, speed + flow, inlet)
    return state, Kick(complex(mode.eigenvalue))


def stored_state(motion: ValveMotion, case: Case, inlet: float) -> MotionState:
    """State from a result file of a steady or a transient run on the same mesh.

    Raises
    ------
    CaseError
    """
    from ..results import load_result

    path, index = case.transient.start_file, case.transient.start_state
    result = load_result(path)
    states = getattr(result, "states", ())
    if not states:
        raise CaseError(f"{str(path)!r} holds no states to start from.")
    if not -len(states) <= index < len(states):
        raise CaseError(f"{str(path)!r} holds {len(states)} states, so there is no state {index}.")
    state, model = states[index], motion.model
    nodal = np.asarray(state.nodal, float)
    if nodal.shape != (len(model.mesh.nodes), 5):
        raise CaseError(
            f"The states of {str(path)!r} belong to a mesh of {len(nodal)} nodes and this case's has "
            f"{len(model.mesh.nodes)}."
        )
    q = model.shell.dofs.restrict(nodal)
    rate = getattr(state, "nodal_rate", None)
    v = np.zeros(model.size) if rate is None else model.shell.dofs.restrict(np.asarray(rate, float))
    speed = float(np.asarray(state.station_velocity)[-1])
    return consistent_state(motion, 0.0, q, v, speed, inlet)
