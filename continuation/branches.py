"""Branches of equilibria: start, resume, switch."""

from __future__ import annotations

import numpy as np

from continuation.branch import Branch, SpecialPoint
from continuation.branch_points import BranchPointMonitor
from continuation.checks import (
    events_of,
    numbers_of,
    options_of,
    parameters_of,
    require_names,
    special_of,
    spectrum_of,
    system_of,
)
from continuation.event_location import EventMonitor, FoldMonitor
from continuation.options import ContinuationOptions, NotABifurcation, NotConverged, Reason
from continuation.problem import Problem
from continuation.stability import SpectrumMonitor
from continuation.tracer import SHRINK, Tracer


def branch_tracer(system, mu, parameter, options, events=(), spectrum=None, observers=None):
    """The tracer of a branch with the monitors the options ask for."""
    options, mu, events = options_of(ContinuationOptions, options), parameters_of(mu), events_of(events)
    require_names(options, mu, (parameter,))
    system_of(system)
    problem = Problem(system, mu, (parameter,), None, options.state_scale, options.units([parameter]))
    monitors: list = []
    if options.folds:
        monitors.append(FoldMonitor())
    if options.branch_points:
        monitors.append(BranchPointMonitor())
    if options.eigenvalues:
        monitors.append(SpectrumMonitor(spectrum_of(spectrum)))
    monitors += [EventMonitor(event) for event in events]
    return Tracer(problem, options, monitors, observers)


def continue_branch(
    system, u, mu, parameter: str, options: ContinuationOptions | None = None, events=(), spectrum=None, observers=None
) -> Branch:
    """Follow equilibria in one parameter.

    Parameters
    ----------
    system : System
    u : ndarray, shape (n,)
        Near an equilibrium; corrected first.
    mu : mapping of str to float
    parameter : str
        The parameter to free.
    options : ContinuationOptions
    events : sequence of Event
    spectrum : callable, optional
        ``(u, mu, count, near) -> Spectrum`` in place of the system's own.
    observers : Observer, callable or sequence of them

    Returns
    -------
    Branch
        With all accepted points, whatever ended the run; see its ``reason``.

    Raises
    ------
    NotConverged
        There is no equilibrium near the start.

    Examples
    --------
    >>> from continuation.jax_system import JaxSystem
    >>> system = JaxSystem(lambda u, mu: mu["r"] + u**2, size=1)
    >>> branch = continue_branch(system, [-1.0], {"r": -1.0}, "r",
    ...                          ContinuationOptions(max_points=30))
    >>> abs(branch.of_kind("fold")[0].mu["r"]) < 1e-9
    True
    """
    tracer = branch_tracer(system, mu, parameter, options, events, spectrum, observers)
    u, mu, options = numbers_of(u, "state", (system.size,)), tracer.problem.fixed, tracer.options
    direction = np.zeros(u.size + 1)
    direction[-1] = options.direction
    point = tracer.start(tracer.problem.pack(u, mu), direction)
    branch = Branch("equilibria", system.size, (parameter,), (), mu, [point.record()])
    return tracer.run(branch, point, options.step)


def switch_branch(
    system,
    special: SpecialPoint,
    parameter: str,
    options: ContinuationOptions | None = None,
    side: int = 1,
    events=(),
    spectrum=None,
    observers=None,
) -> Branch:
    """Follow the other branch through a simple branch point, to one side.

    Parameters
    ----------
    special : SpecialPoint
        A located branch point.
    side : {+1, -1}
        Which of the two halves.

    Raises
    ------
    NotABifurcation
        The point is not a located branch point with a second real branch.
    NotConverged
        No point of the other branch was found at any step tried.

    Examples
    --------
    >>> from continuation import JaxSystem
    >>> system = JaxSystem(lambda u, mu: mu["r"] * u - u**3, size=1)
    >>> options = ContinuationOptions(limits={"r": (-1.0, 1.0)})
    >>> pitchfork, = continue_branch(system, [0.0], {"r": -1.0}, "r", options).special
    >>> other = switch_branch(system, pitchfork, "r", options)
    >>> bool(abs(other.states[-1, 0] ** 2 - 1) < 1e-9)
    True
    """
    special_of(special, "Branches are switched at")
    if special.kind != "branch point" or not special.located or "direction" not in special.vectors:
        raise NotABifurcation(f"Branches are switched at located branch points; this is {special!r}.")
    if side not in (1, -1):
        raise ValueError(f"The side is +1 or -1, not {side}.")
    tracer = branch_tracer(system, special.mu, parameter, options, events, spectrum, observers)
    options = tracer.options
    direction = side * special.vectors["direction"]
    problem = tracer.problem
    frame = problem.frame(direction[:, None])
    step = options.step
    reason = Reason.SINGULAR
    while step >= options.min_step:
        try:
            point = tracer.start(special.z + step * direction, direction, frame)
        except NotConverged as error:
            reason = error.reason
        else:
            gap = point.z - special.z
            gap = gap / problem.norm(gap)
            ahead, known = (way / problem.norm(way) for way in (direction, special.tangent))
            if tracer.beyond(point.z) is not None:
                reason = Reason.LOST_AT_LIMIT
            elif abs(problem.dot(gap, ahead)) > abs(problem.dot(gap, known)):
                branch = Branch("equilibria", system.size, (parameter,), (), dict(special.mu), [point.record()])
                return tracer.run(branch, point, step)
            else:
                reason = Reason.KNOWN_BRANCH
        step *= SHRINK
    raise NotConverged(f"The other branch was not found: {reason.value}.", reason)
