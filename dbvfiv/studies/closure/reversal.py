"""The drive turned from flow to back pressure: slowly, over steady states, or in time, with the inertia of wall and
fluid.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np

from ...errors import SolveError
from ...model import ValveModel
from ...model.state import LipCentre
from ...model.supports import FaceContact
from ...motion.control import ControlOptions, FixedSteps
from ...motion.equations import ValveMotion
from ...motion.scheme import scheme
from ...motion.start import steady_fluid, steady_positions
from ...motion.state import consistent_state
from ...motion.stepper import StepFailure, StepOptions, Stepper
from ...observer import Observer
from ...record.record import GrowingRecord
from ...record.states import LIP, OPENING
from ...record.table import Column
from ..case import Case
from ..state import reach_states
from .valve import InnerFace, contact_law, face_plane

#: Tables of the flow before it is turned back, and of the turn in time.
OPENED, REVERSAL = "opened", "reversal"
#: An instant of the turn.
SAMPLE = (
    Column("time", "s", "Time"),
    Column("inlet_pressure", "Pa", "Pressure of the drive"),
    OPENING,
    LIP,
    Column("least_opening", "m^2", "Narrowest passage between the inner faces, whole valve"),
    Column("mass_flow", "kg/s", "Mass flow through the lip, whole valve; negative backwards"),
    Column("lowest_pressure", "Pa", "Lowest pressure of the fluid in the valve"),
    Column("highest_pressure", "Pa", "Highest pressure of the fluid in the valve"),
    Column("contact_force", "N", "Force between the two walls, whole valve"),
    Column("penetration", "m", "Deepest penetration"),
)
#: States of the flow that is turned back slowly, from the open pressure down to a fiftieth of it.
OPEN_STATES = 10
#: Rest before the drive turns, over the time it takes to turn.
LEAD = 0.1
#: Least numerical damping: contact excites what the mesh cannot resolve.
DAMPING = 0.2


def turn_back(case: Case, record: GrowingRecord) -> None:
    """Steady states of the open valve as the inlet pressure falls; at zero pressure it is at rest, where the back
    pressure begins.

    A pressure that is not reached is a failure; the back pressures do not depend on it.
    """
    if record.notes("turned back"):
        for sentence in record.notes("turned back")[-1]["failures"]:
            record.fail(sentence)
        return
    model = ValveModel(case.replace({"drive.kind": "flow", "drive.side": "inside", "downstream.pressure": 0.0}))
    first = case.closure.open_pressure
    pressures = np.geomspace(first, first / 50, OPEN_STATES).tolist()
    record.note("turned back", failures=reach_states(model, model.case, record, OPENED, pressures, []))


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


class ContactValve(ValveModel):
    """Coupled valve that follows the turn of its drive, its inner faces against the closing plane in place of stops.

    The contact is a penalty without multipliers: in motion the penetration is seen and reported, not removed.
    """

    def __init__(self, case: Case):
        pump = {"upstream.pump": None} if case.has_pump else {}  # what reverses the pressure takes its place
        alone = {"supports.contact": "stops", "supports.lip_stop": False, "gravity.direction": "none"}
        super().__init__(case.replace(alone | pump))
        closure = case.closure
        law = contact_law(case, max(*closure.pressures, closure.open_pressure))
        self.faces = FaceContact(self.shell, face_plane(case, self.shell, law))
        self.inner_face = InnerFace(self.mesh, self.shell, self.faces.plane, closure.shut_fraction)

    @property
    def shut_below(self) -> float:
        """Passage of the whole valve, m2, that counts as shut."""
        rest = self.inner_face.passage(np.zeros(self.shell.dofs.free.shape))
        return self.mesh.part.copies * rest.shut_fraction * rest.reference

    def internal_force(self, q, step=None, share=1.0):
        return super().internal_force(q, step, share) + self.faces.force(q)

    def structure(self, q, step=None, share=1.0):
        force, data = super().structure(q, step, share)
        self.faces.add_tangent(q, data)
        return force + self.faces.force(q), data


class ClosingMotion(ValveMotion):
    """Equations of motion of a `ContactValve`."""

    def energies(self, q, v):
        kinetic, strain, _ = super().energies(q, v)
        return kinetic, strain, self.model.faces.energy(q)


def closing_valve(case: Case) -> ContactValve:
    """The valve that follows the turn of its drive."""
    changes = {"drive.kind": "flow", "drive.side": "inside", "fluid.continuity": case.closure.reversal_continuity}
    changes["fluid.sound_speed"] = None  # the fluid of these runs is incompressible
    return ContactValve(case.replace(changes | {"fluid.unsteady": True}))


def run_closing(
    model: ContactValve, keep: Callable[[dict[str, float]], None], observer: Observer | None = None
) -> tuple[int, str]:
    """Turn the drive from `closure.open_pressure` to as much back pressure and follow the valve.

    Parameters
    ----------
    model : ContactValve
        See `closing_valve`.
    keep : callable
        Is given every instant, by the names of `SAMPLE`, as soon as it is found.
    observer : Observer, optional

    Returns
    -------
    halvings : int
        Steps that had to be halved.
    failure : str
        Why the run ended early; empty if it did not.

    Raises
    ------
    SolveError
        If the open state was not found.
    """
    observer = Observer() if observer is None else observer
    motion, turn = ClosingMotion(model), Turn.of(model.case)
    end = turn.start + turn.duration + model.case.closure.reversal_hold
    observer.progress(f"open state at {turn.pressure:.6g} Pa")
    control, state, load = _set_out(model, motion, turn)
    keep(_sample(model, motion, state, load))
    try:
        while state.time < end - 1e-9:
            result = control.advance(state, end)
            state = result.state
            keep(_sample(model, motion, state, result.load))
            observer.progress(f"{state.time:.4f} s of {end:.4g} s")
    except StepFailure as error:
        return control.halvings, f"No step was possible beyond {state.time:.6g} s: {error}"
    return control.halvings, ""


def _set_out(model: ContactValve, motion: ClosingMotion, turn: Turn) -> tuple[FixedSteps, Any, Any]:
    """The steps to take, the open state that they begin with, and its load."""
    transient = model.case.transient
    q = steady_positions(model, turn.pressure)
    inner = steady_fluid(motion, q, turn.pressure)
    state = consistent_state(motion, 0.0, q, np.zeros(model.size), turn.pressure, inner)
    rule = scheme("generalised-alpha", max(DAMPING, transient.numerical_damping))
    control = FixedSteps(Stepper(motion, rule, turn, StepOptions(backward=True)), ControlOptions(transient.step))
    still = motion.instant(state, turn.pressure)
    return control, state, motion.load(state.q, state.v, state.q, state.v, still)


def _sample(model: ContactValve, motion: ClosingMotion, state, load) -> dict[str, float]:
    nodal, contact = model.nodal(state.q), model.faces.state(state.q)
    if not (np.isfinite(state.q).all() and np.isfinite(load.pressure).all()):
        raise SolveError(f"The state at {state.time:.6g} s is not finite.")
    passage = model.inner_face.passage(nodal)
    open_area = model.flow.open_area(load.area)
    lip, part = LipCentre(model.mesh, model.shell), model.mesh.part
    return {
        "time": float(state.time),
        "inlet_pressure": float(load.inlet),
        "lip_opening": lip.opening(state.q),
        "lip_displacement": lip.displacement(state.q),
        "least_opening": float(part.copies * passage.area.min()),
        "mass_flow": float(part.copies * motion.mu.density * load.speed[0] * open_area[0]),
        "lowest_pressure": float(load.pressure.min()),
        "highest_pressure": float(load.pressure.max()),
        "contact_force": float(part.walls * contact.total),
        "penetration": contact.penetration,
    }


@dataclass(frozen=True)
class Closing:
    """History of a valve whose drive turns round.

    Attributes
    ----------
    samples : sequence of objects with the columns `SAMPLE`
    turn : Turn
    shut_below : float, m2
        Passage that counts as shut.
    halvings : int
        Steps that had to be halved.
    failure : str
        Why the run ended early; empty if it did not.
    """

    samples: Sequence[SimpleNamespace]
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

    @property
    def sentence(self) -> str:
        """Sentence on when the valve shut, and on the pressures of the fluid."""
        told, open_pressure = self.summary(), self.turn.pressure / 1e3
        turn = f"Drive turned from {open_pressure:g} to {-open_pressure:g} kPa in {self.turn.duration:g} s:"
        if told["closing_time"] is None:
            return f"{turn} open at the end, {told['duration']:.4g} s."
        return (
            f"{turn} shut for good {told['closing_time']:.4g} s after it began to turn "
            f"({told['closing_time_after_sign_change']:.4g} s after it changed sign), fluid pressure between "
            f"{told['lowest_pressure'] / 1e3:.4g} and {told['highest_pressure'] / 1e3:.4g} kPa."
        )
