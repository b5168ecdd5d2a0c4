"""Back pressure: does the valve shut, where and how firmly, and how far is its wall from buckling inwards? (Th. 3.6)"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from ..case.model import Case
from ..errors import SolveError
from ..model import ValveModel
from ..model.equilibria import find_equilibria, model_warnings, state_warnings
from ..model.state import SteadyState
from ..observer import Observer
from .closure_buckling import Buckling
from .closure_model import HELD_LIPS, ClosureModel, closure_model
from .closure_path import ClosureOptions, ClosurePath, PathPoint, PathRestart
from .closure_state import ClosureState

#: States of the flow that is turned back, from the open pressure down to a fiftieth of it.
OPEN_STATES = 10


@dataclass(frozen=True)
class ClosureResult:
    """Back-pressure states in the order asked for.

    Attributes
    ----------
    model : ClosureModel
    states : tuple of ClosureState
        Converged states only.
    path : tuple of PathPoint
        Every equilibrium on the way.
    buckling : tuple of Buckling
        Where the tangent stiffness became singular, in the order met.
    opened : tuple of SteadyState
        With an open start, states of the flow as its pressure falls to nothing.
    failures, warnings : tuple of str
    interrupted : bool
    """

    model: ClosureModel
    states: tuple[ClosureState, ...]
    path: tuple[PathPoint, ...] = ()
    buckling: tuple[Buckling, ...] = ()
    opened: tuple[SteadyState, ...] = ()
    failures: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    interrupted: bool = False

    @property
    def critical_pressure(self) -> float | None:
        """Lowest back pressure at which the wall buckles on the path followed, Pa; None if it does not."""
        return self.buckling[0].pressure if self.buckling else None


class Keeper:
    """What keeps a run while it goes on; does nothing."""

    def turned_back(self, opened: tuple[SteadyState, ...]) -> None:
        """The states of an open start are found."""

    def reached(self, path: ClosurePath, state: ClosureState) -> None:
        """A back pressure is reached, and the path stands there."""


def run_closure(
    case: Case,
    pressures: Iterable[float] | None = None,
    options: ClosureOptions | None = None,
    observer: Observer | None = None,
    model: ClosureModel | None = None,
    keeper: Keeper | None = None,
    restart: PathRestart | None = None,
) -> ClosureResult:
    """Equilibria of a case at a list of back pressures, Pa, each reached from the one before.

    A pressure that is not reached ends the list, for those after it lie beyond it; an interrupt keeps what was found.
    With a `restart` the walk goes on from there and the result holds what came after it.

    Examples
    --------
    >>> result = run_closure(Case(), [7e3, 28e3])                      # doctest: +SKIP
    >>> [(s.closed, s.contact_force) for s in result.states]           # doctest: +SKIP
    """
    options = ClosureOptions.of(case) if options is None else options
    observer = Observer() if observer is None else observer
    pressures = [float(p) for p in (case.closure.pressures if pressures is None else pressures)]
    model = closure_model(case) if model is None else model
    states: list[ClosureState] = []
    opened: tuple[SteadyState, ...] = ()
    failures: list[str] = []
    warnings: list[str] = []

    def warn(sentences: Iterable[str]) -> None:
        for sentence in sentences:
            warnings.append(sentence)
            observer.warn(sentence)

    observer.begin("closure", len(pressures))
    warn([*model_warnings(model), *start_warnings(model)])
    path = ClosurePath(model, options, observer)
    keeper = Keeper() if keeper is None else keeper
    if restart is not None:
        path.resume(restart)
    interrupted = False
    try:
        if case.closure.start == "open" and restart is None:
            opened = _turned_back(case, observer)
            keeper.turned_back(opened)
        for state in _states(path, pressures, failures, observer):
            keeper.reached(path, state)
            observer.item(state)
            states.append(state)
    except KeyboardInterrupt:
        interrupted = True
    warn([*state_warnings(model, states), *result_warnings(path, states)])
    observer.end(interrupted)
    return ClosureResult(
        model,
        tuple(states),
        tuple(path.points),
        tuple(path.buckling),
        opened,
        tuple(failures),
        tuple(warnings),
        interrupted,
    )


def _states(
    path: ClosurePath, pressures: list[float], failures: list[str], observer: Observer
) -> Iterator[ClosureState]:
    for pressure in pressures:
        try:
            yield path.go_to(pressure)
        except SolveError as error:
            failures.append(str(error))
            observer.warn(str(error))
            return


def _turned_back(case: Case, observer: Observer) -> tuple[SteadyState, ...]:
    """Steady states of the open valve as the inlet pressure falls; at zero pressure it is at rest, where the back
    pressure begins.
    """
    flowing = case.replace({"drive.kind": "flow", "drive.side": "inside"})
    pressures = np.geomspace(case.closure.open_pressure, case.closure.open_pressure / 50, OPEN_STATES)
    quiet = _Progress(observer)
    result = find_equilibria(ValveModel(flowing), pressures, observer=quiet)
    if result.failures:
        raise SolveError(result.failures[0])
    return result.states


class _Progress(Observer):
    """Hands on what happens inside a step and nothing else."""

    def __init__(self, to: Observer):
        self._to = to

    def progress(self, text):
        self._to.progress(text)


def start_warnings(model: ClosureModel) -> Iterator[str]:
    """Where the inner face starts too near to the closing plane or beyond it."""
    mesh, near, beyond = model.mesh, model.folded_start, model.nodes_beyond
    if len(near):
        z = mesh.nodes[near, 2]
        deepest = float(-model.face.start.min())
        yield (
            f"The inner face starts beyond the closing plane at {len(beyond)} nodes, by up to "
            f"{max(0.0, deepest) * 1e3:.2g} mm, and nearer to it than "
            f"the initial gap at {len(near)} (z {z.min():.3f} to {z.max():.3f} m, of {model.face.count} "
            f"nodes): there half the wall is thicker than "
            "the mid-surface is high, and contact resists further closing by more than the initial gap only."
        )
    if model.supports == HELD_LIPS:
        yield (
            "The duckbill is held shut by its supports, as in Th. 3.6, so that nothing is found out about "
            "whether its lips seal."
        )


def result_warnings(path: ClosurePath, states: list[ClosureState]) -> Iterator[str]:
    """What the states found should not be trusted for."""
    if path.buckling:
        first = path.buckling[0]
        yield f"The wall buckles at {first.pressure:.6g} Pa ({first.kind}); states at higher pressures lie beyond it."
    deep = [s for s in states if s.overlap > 10 * path.options.penetration]
    if deep:
        worst = max(deep, key=lambda s: s.overlap)
        yield (
            f"The inner faces overlap by up to {worst.overlap * 1e3:.2g} mm at {worst.pressure:.6g} Pa, "
            f"because these supports stop the mid-surface and "
            "not the faces."
        )
