"""First states of motions: at rest, steady, kicked along a mode."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from eigen.basis import lowest_frequencies
from eigen.factor import SingularShiftError
from eigen.operator import CoupledPencil
from eigen.search import leading_modes
from eigen.spectrum import SearchOptions, Spectrum

from ..case.model import Case
from ..case.parameters import Mu
from ..errors import SolveError
from ..model.dynamics import LinearisedState, linearise
from ..model.equilibria import LoadPath, SteadyOptions
from ..model.leading import LEAST_MODES, select_search
from ..model.valve import ValveModel
from ..observer import Observer
from .equations import ValveMotion
from .stepper import MotionState, consistent_state


def first_state(
    motion: ValveMotion, case: Case, inlet: float, observer: Observer
) -> tuple[MotionState, np.ndarray, complex | None]:
    """State that a case starts from, with inlet pressure (Pa) of the first instant; positions (n,) at rest or of the
    steady state; and the eigenvalue, 1/s, of the mode that it was kicked along, if it was. Raises SolveError if the
    steady state or the mode was not found.

    Parameters
    ----------
    case : Case
        Its transient.start is "rest", "steady" or "kick".
    """
    model, transient = motion.model, case.transient
    if transient.start == "rest":
        return consistent_state(motion, 0.0, model.rest(), np.zeros(model.size), inlet), model.rest(), None
    observer.progress(f"steady state at {inlet:.6g} Pa")
    q = steady_positions(model, inlet, SteadyOptions.of(case))
    inner = steady_fluid(motion, q, inlet)
    if transient.start == "steady":
        return consistent_state(motion, 0.0, q, np.zeros(model.size), inlet, inner), q, None
    observer.progress("mode to follow")
    state, eigenvalue = kicked(motion, q, inner, inlet, case)
    return state, q, eigenvalue


def steady_fluid(motion: ValveMotion, q: np.ndarray, inlet: float, velocity: float | None = None) -> np.ndarray | None:
    """The fluid's unknowns (l,) of the steady flow at positions (n,) and an inlet pressure, Pa, with another velocity
    at the inlet, m/s, if one is given; None where nothing flows and no seal holds the pressure.
    """
    model = motion.model
    area = model.rows.areas(model.nodal(q))
    sealed = model.seal(area) is not None
    at_rest = velocity == 0.0 and not sealed
    if at_rest or (not velocity and inlet <= model.flow.back):
        return None
    inner = motion.fluid.steady_inner(area, inlet)
    if velocity is None and sealed:
        velocity = 0.0
    return inner if velocity is None else model.flow.with_velocity(inner, velocity)


def steady_positions(model: ValveModel, inlet: float, options: SteadyOptions | None = None) -> np.ndarray:
    """Equilibrium (n,) at an inlet pressure, Pa.

    It is as exact as rounding allows: what is left of a residual would shake light parts of the wall. Without a flow
    the valve is at rest; with gravity it hangs, the fluid in it still.
    """
    if inlet <= model.flow.back and model.weight is None:
        return model.rest()
    options = SteadyOptions.of(model.case) if options is None else options
    path = LoadPath(model, replace(options, newton=replace(options.newton, tolerance=1e-13)))
    path.go_to(max(inlet, model.flow.back))
    return path.q


def kicked(
    motion: ValveMotion, q: np.ndarray, inner: np.ndarray | None, inlet: float, case: Case
) -> tuple[MotionState, complex]:
    """Steady state pushed along one of its leading modes, and the eigenvalue of that, 1/s. Raises SolveError if there
    is no such mode, or it does not move the lip. Where a seal holds the lips the push is measured where the wall moves
    most.

    Parameters
    ----------
    q : (n,) array
        The steady state.
    inner : (l,) array or None
        The fluid's unknowns in it.
    inlet : float
        Its inlet pressure, Pa.
    case : Case
        Its `transient.kick_mode` and `transient.kick_opening` are taken, and `modes` for the search.
    """
    model = motion.model
    linear = linearise(model, q, max(inlet, model.flow.back))  # below that nothing flows either
    try:
        found, index = _find_mode(linear, motion.mu, case)
    except (SingularShiftError, np.linalg.LinAlgError) as error:
        said = str(error).rstrip(".")
        raise SolveError(f"The mode to push along at {inlet:.6g} Pa was not found: {said}.") from error
    mode, opening = found.mode(index), case.transient.kick_opening
    nodal = model.nodal(mode.q)
    most = nodal[:, :3].ravel()[np.argmax(np.abs(nodal[:, :3]))]
    lip = most if linear.seal is not None else nodal[model.mesh.centre_line[0], 1]
    if abs(lip) < 1e-6 * abs(most):
        raise SolveError(
            f"Mode {case.transient.kick_mode} does not move the middle of the lip, so no push can be measured there."
        )
    shape = opening / lip * mode.q
    flow = (opening / lip * mode.u).real if motion.fluid.moves and len(mode.u) else 0.0
    eigenvalue = complex(mode.eigenvalue)
    return on_mode(motion, q, inner, inlet, shape, eigenvalue, flow), eigenvalue


def on_mode(
    motion: ValveMotion,
    q: np.ndarray,
    inner: np.ndarray | None,
    inlet: float,
    shape: np.ndarray,
    eigenvalue: complex,
    flow: np.ndarray | float,
) -> MotionState:
    """State that moves on a mode from its first instant; a wall that relaxes remembers having done so all along.

    Parameters
    ----------
    q : (n,) array
        The steady state.
    inner : (l,) array or None
        The fluid's unknowns in it.
    inlet : float
        Its inlet pressure, Pa.
    shape : (n,) complex array
        The mode, of the size it has at this instant.
    eigenvalue : complex, 1/s
    flow : (l,) array
        Change of the fluid's own unknowns with it.
    """
    moved = q + shape.real
    memory = None if motion.wall is None else motion.wall.on_mode(q, shape, eigenvalue, moved)
    v, still = (eigenvalue * shape).real, motion.still_fluid() if inner is None else inner
    return consistent_state(motion, 0.0, moved, v, inlet, still + flow, memory)


def _find_mode(linear: LinearisedState, mu: Mu, case: Case) -> tuple[Spectrum, int]:
    """Leading modes, by the rule of all studies, and the place of the one to push along among them; more are searched
    for than the case lists where these hold too few that oscillate.
    """
    wanted, asked = case.transient.kick_mode, SearchOptions(case.modes.max_frequency, tolerance=case.modes.tolerance)
    count, pencil = max(case.modes.count, wanted), linear.pencil(mu)
    structure = CoupledPencil(linear.mass, 0.0 * linear.mass, linear.stiffness)
    while True:
        listed = max(count, LEAST_MODES)
        search = select_search(asked, mu, lambda n: lowest_frequencies(structure, n), listed, linear.resolved(mu))
        found = leading_modes(pencil, count, search.options)
        oscillating = [i for i in range(len(found)) if found.eigenvalues[i].imag > 1e-6 * abs(found.eigenvalues[i])]
        if len(oscillating) >= wanted:
            return found, oscillating[wanted - 1]
        if len(found) < count or count > 100:
            raise SolveError(
                f"Only {len(oscillating)} oscillating modes were found, so there is no mode {wanted} to push the "
                f"valve along."
            )
        count *= 2
