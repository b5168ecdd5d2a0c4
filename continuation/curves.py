"""Fold and Hopf curves in two parameters, and the points of codimension two on them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from continuation.branch import Branch, SpecialPoint
from continuation.conditions import FoldCondition, HopfCondition
from continuation.curve_monitors import FoldCurveMonitor, HopfCurveMonitor
from continuation.errors import NotABifurcation
from continuation.options import ContinuationOptions
from continuation.problem import Problem
from continuation.stability import CountMonitor
from continuation.tracer import Tracer

_KINDS = {"fold curve": FoldCondition, "hopf curve": HopfCondition}


def _tracer(kind, system, mu, parameters, condition, options, observers, lyapunov=True, spectrum=None):
    if len(set(parameters)) != 2:
        raise ValueError(f"A {kind} needs two different parameters, not {parameters}.")
    problem = Problem(system, mu, parameters, condition, options.state_scale, options.parameter_scales)
    monitor = FoldCurveMonitor() if kind == "fold curve" else HopfCurveMonitor(lyapunov)
    monitors = [monitor, CountMonitor(spectrum)] if options.eigenvalues else [monitor]
    return Tracer(problem, options, monitors, observers)


def continue_fold(
    system,
    special: SpecialPoint,
    parameters: tuple[str, str],
    options: ContinuationOptions | None = None,
    observers=None,
    spectrum=None,
) -> Branch:
    """Follow a fold in two parameters; cusps and Bogdanov-Takens points are noted.

    Parameters
    ----------
    special : SpecialPoint
        A fold, or a Bogdanov-Takens point.
    parameters : (str, str)
        ``options.direction`` is the sign of the first step in the second one.
    spectrum : callable, optional
        In place of the system's own.  With ``options.eigenvalues`` the count of unstable
        eigenvalues besides the critical one is recorded: 0 on the edge of stability.

    Returns
    -------
    Branch
        Of kind ``"fold curve"``.
    """
    return _continue(
        "fold curve",
        ("fold", "bogdanov-takens", "cusp"),
        system,
        special,
        parameters,
        options,
        observers,
        spectrum=spectrum,
    )


def continue_hopf(
    system,
    special: SpecialPoint,
    parameters: tuple[str, str],
    options: ContinuationOptions | None = None,
    observers=None,
    lyapunov: bool = True,
    spectrum=None,
) -> Branch:
    """Follow a Hopf point in two parameters.

    The extra unknown is ``omega``.  The curve ends at a Bogdanov-Takens point
    (``omega = 0``); generalised Hopf points (``l1 = 0``) and zero-Hopf points are noted.

    Parameters
    ----------
    lyapunov : bool
        Compute the first Lyapunov coefficient at every point (third derivatives).
    spectrum : callable, optional
        As in `continue_fold`.

    Returns
    -------
    Branch
        Of kind ``"hopf curve"``; ``values("omega")`` is the angular frequency along it,
        ``values("l1")`` the first Lyapunov coefficient.
    """
    return _continue(
        "hopf curve",
        ("hopf", "generalised hopf", "zero-hopf"),
        system,
        special,
        parameters,
        options,
        observers,
        lyapunov,
        spectrum,
    )


def _continue(kind, accepted, system, special, parameters, options, observers, lyapunov=True, spectrum=None):
    options = options or ContinuationOptions()
    if special.kind not in accepted or "right" not in special.vectors:
        raise NotABifurcation(
            f"A {kind} starts at a located point of kind {', '.join(accepted)}; this is a "
            f"{special.kind}{'' if special.located else ' that was only bracketed'}."
        )
    condition = _KINDS[kind](special.vectors["left"], special.vectors["right"])
    tracer = _tracer(kind, system, special.mu, parameters, condition, options, observers, lyapunov, spectrum)
    problem = tracer.problem
    extra = [special.values["omega"]] if problem.e else []
    n = problem.n
    z = problem.pack(special.u, special.mu, extra)
    # The branch the point was found on gives one direction, the second parameter the other.
    along = np.zeros(n + 2)
    along[:n] = special.tangent[:n]
    if special.tangent.size > n and special.kind == "hopf":
        along[n] = special.tangent[n]
    second = np.zeros(n + 2)
    second[n + 1] = 1.0
    frame = problem.frame(np.stack([along, second], axis=1))
    direction = np.zeros(z.size)
    direction[n + 1] = options.direction
    here = tracer.start(z, direction, frame)
    branch = Branch(kind, n, tuple(parameters), problem.condition.extra_names, dict(special.mu), [here.point()])
    return tracer.run(branch, here, options.step)


def resume_curve(
    system,
    branch: Branch,
    options: ContinuationOptions | None = None,
    observers=None,
    lyapunov: bool = True,
    spectrum=None,
) -> Branch:
    """Go on from the last point of a fold or Hopf curve, e.g. one loaded from a file."""
    if branch.kind not in _KINDS:
        raise ValueError(f"This resumes fold and Hopf curves, not {branch.kind}.")
    options = options or ContinuationOptions()
    condition = _KINDS[branch.kind](branch.restart["p"], branch.restart["q"])
    tracer = _tracer(branch.kind, system, branch.fixed, branch.names, condition, options, observers, lyapunov, spectrum)
    last = branch.points[-1]
    here = tracer.start(last.z, last.tangent, branch.restart["frame"])
    longer = replace(
        branch, points=list(branch.points), special=list(branch.special), reason="running", restart=dict(branch.restart)
    )
    step = float(np.clip(branch.next_step or options.step, options.min_step, options.max_step))
    return tracer.run(longer, here, step)
