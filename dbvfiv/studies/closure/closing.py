"""From open to shut in time: the drive turns from flow to back pressure, and the valve follows with its inertia and
that of the fluid.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...errors import SolveError
from ...model.state import LipCentre
from ...motion.control import ControlOptions, FixedSteps
from ...motion.scheme import scheme
from ...motion.start import steady_positions
from ...motion.state import consistent_state
from ...motion.stepper import StepFailure, StepOptions, Stepper
from ...observer import Observer
from ..case import Case
from .closing_motion import ClosingMotion, ContactValve
from .opening import measure

#: Rest before the drive turns, over the time it takes to turn.
LEAD = 0.1
#: Least numerical damping: contact excites what the mesh cannot resolve.
DAMPING = 0.2


@dataclass(frozen=True)
class Turn:
    """Drive that falls linearly from a pressure to its negative, Pa.

    Attributes
    ----------
    pressure : float, Pa
    start, duration : float, s
    """

    pressure: float
    start: float
    duration: float

    @classmethod
    def of(cls, case: Case) -> Turn:
        """The turn that a case asks for."""
        closure = case.closure
        return cls(closure.open_pressure, LEAD * closure.reversal_time, closure.reversal_time)

    def __call__(self, time: float) -> float:
        return self.pressure * float(np.interp(time, (self.start, self.start + self.duration), (1.0, -1.0)))

    @property
    def zero(self) -> float:
        """Time at which the drive changes sign, s."""
        return self.start + 0.5 * self.duration


@dataclass(frozen=True)
class ClosingSample:
    """One instant; areas, flow and forces of the whole valve.

    Attributes
    ----------
    time : float, s
    inlet_pressure : float, Pa
    lip_opening : float, m
        Full clear opening between the inner faces of both lips at x = z = 0; never below zero, see
        `dbvfiv.model.state.LipCentre.opening`.
    lip_displacement : float, m
        Displacement in y of the mid-surface of one lip there.
    least_opening : float, m2
        Narrowest passage between the inner faces.
    mass_flow : float, kg/s
        Through the lip; negative when it runs backwards.
    lowest_pressure, highest_pressure : float, Pa
        Of the fluid in the valve.
    contact_force : float, N
    penetration : float, m
    """

    time: float
    inlet_pressure: float
    lip_opening: float
    lip_displacement: float
    least_opening: float
    mass_flow: float
    lowest_pressure: float
    highest_pressure: float
    contact_force: float
    penetration: float


@dataclass(frozen=True)
class ClosingResult:
    """History of a valve whose drive turns round.

    Attributes
    ----------
    samples : tuple of ClosingSample
    turn : Turn
    shut_below : float, m2
        Passage that counts as shut.
    halvings : int
        Steps that had to be halved.
    failure : str
        Why the run ended early; empty if it did not.
    """

    samples: tuple[ClosingSample, ...]
    turn: Turn
    shut_below: float
    halvings: int = 0
    failure: str = ""

    @property
    def first_shut(self) -> float | None:
        """Time from the start of the turn to the first shut instant, s; None if there is none."""
        shut = [s.time for s in self.samples if s.least_opening <= self.shut_below]
        return shut[0] - self.turn.start if shut else None

    @property
    def closing_time(self) -> float | None:
        """Time from the start of the turn to the first instant from which on it is shut to the end of the run, s; None
        if it ends open.
        """
        since = None
        for sample in reversed(self.samples):
            if sample.least_opening > self.shut_below:
                break
            since = sample.time
        return None if since is None else max(0.0, since - self.turn.start)

    def summary(self) -> dict:
        """Plain SI numbers for JSON."""
        first, closing = self.first_shut, self.closing_time
        samples = self.samples
        return {
            "open_pressure": self.turn.pressure,
            "reversal_time": self.turn.duration,
            "duration": samples[-1].time if samples else 0.0,
            "first_shut": first,
            "closing_time": closing,
            "closing_time_after_sign_change": None if closing is None else closing - 0.5 * self.turn.duration,
            "stays_shut": closing is not None and not self.failure,
            "lowest_pressure": min((s.lowest_pressure for s in samples), default=None),
            "highest_pressure": max((s.highest_pressure for s in samples), default=None),
            "largest_backflow": max(0.0, -min((s.mass_flow for s in samples), default=0.0)),
            "largest_penetration": max((s.penetration for s in samples), default=0.0),
            "steps": max(0, len(samples) - 1),
            "halvings": self.halvings,
            "failure": self.failure,
        }


def closing_valve(case: Case) -> ContactValve:
    """The valve that follows the turn of its drive."""
    changes = {"drive.kind": "flow", "drive.side": "inside", "fluid.continuity": case.closure.reversal_continuity}
    changes["fluid.sound_speed"] = None  # the fluid of these runs is incompressible
    return ContactValve(case.replace(changes | {"fluid.unsteady": True}))


def shut_below(model: ContactValve) -> float:
    """Passage of the whole valve, m2, that counts as shut."""
    rest = measure(model.mesh, model.shell, model.face, np.zeros(model.shell.dofs.free.shape))
    return model.mesh.part.copies * model.case.closure.shut_fraction * rest.reference


def run_closing(
    model: ContactValve, observer: Observer | None = None, keep: Callable[[ClosingSample], None] | None = None
) -> ClosingResult:
    """Turn the drive from `closure.open_pressure` to as much back pressure and follow the valve.

    Parameters
    ----------
    model : ContactValve
        See `closing_valve`.
    observer : Observer, optional
    keep : callable, optional
        Is given every sample as soon as it is found.

    Raises
    ------
    SolveError
        If the open state was not found. A step that fails ends the run and is told in the result.
    """
    observer = Observer() if observer is None else observer
    motion, turn = ClosingMotion(model), Turn.of(model.case)
    end = turn.start + turn.duration + model.case.closure.reversal_hold
    samples: list[ClosingSample] = []
    failure = ""

    def look(state, load) -> None:
        samples.append(_sample(model, motion, state, load))
        if keep is not None:
            keep(samples[-1])

    observer.progress(f"open state at {turn.pressure:.6g} Pa")
    control, state, load = _set_out(model, motion, turn)
    look(state, load)
    try:
        while state.time < end - 1e-9:
            result = control.advance(state, end)
            state = result.state
            look(state, result.load)
            observer.progress(f"{state.time:.4f} s of {end:.4g} s")
    except StepFailure as error:
        failure = f"No step was possible beyond {state.time:.6g} s: {error}"
    return ClosingResult(tuple(samples), turn, shut_below(model), control.halvings, failure)


def _set_out(model: ContactValve, motion: ClosingMotion, turn: Turn) -> tuple[FixedSteps, Any, Any]:
    """The steps to take, the open state that they begin with, and its load."""
    transient = model.case.transient
    q = steady_positions(model, turn.pressure)
    area = model.rows.areas(model.nodal(q))
    speed = model.flow.inlet_velocity(area, turn.pressure, motion.mu.density)
    state = consistent_state(motion, 0.0, q, np.zeros(model.size), speed, turn.pressure)
    rule = scheme("generalised-alpha", max(DAMPING, transient.numerical_damping))
    control = FixedSteps(Stepper(motion, rule, turn, StepOptions(backward=True)), ControlOptions(transient.step))
    still = motion.instant(state, turn.pressure)
    return control, state, motion.load(state.q, state.v, state.q, state.v, still, state.speed)


def _sample(model: ContactValve, motion: ClosingMotion, state, load) -> ClosingSample:
    nodal, contact = model.nodal(state.q), model.contact_state(state.q)
    if not (np.isfinite(state.q).all() and np.isfinite(load.pressure).all()):
        raise SolveError(f"The state at {state.time:.6g} s is not finite.")
    passage = measure(model.mesh, model.shell, model.face, nodal)
    open_area = motion.fluid.open_area(load.area)
    lip, part = LipCentre(model.mesh, model.shell), model.mesh.part
    return ClosingSample(
        time=float(state.time),
        inlet_pressure=float(load.inlet),
        lip_opening=lip.opening(state.q),
        lip_displacement=lip.displacement(state.q),
        least_opening=float(part.copies * passage.area.min()),
        mass_flow=float(part.copies * motion.mu.density * load.speed[0] * open_area[0]),
        lowest_pressure=float(load.pressure.min()),
        highest_pressure=float(load.pressure.max()),
        contact_force=float(part.walls * contact.total),
        penetration=contact.penetration,
    )
