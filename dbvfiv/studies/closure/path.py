"""The walk along back-pressure equilibria: load steps, multiplier updates, the watch for buckling, arclength past limit
points.
"""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, field, replace

import numpy as np

from continuation import NotConverged

from ...errors import SolveError
from ...model.load_steps import LoadStepOptions, LoadSteps
from ...model.newton import NewtonOptions
from ...model.symmetry import ALL
from ...observer import Observer
from .arclength import arclength_path
from .buckling import Buckling, BucklingWatch
from .classes import ClassWatch
from .energy import EnergyLedger
from .model import ClosureModel
from .opening import opening
from .path_point import PathPoint, PathRestart
from .state import ClosureState, contact_front, describe_closure, face_overlap
from .stiffness import stiffness_spectrum

#: Farthest that an equilibrium may lie from its prediction, over the mean wall thickness.
LARGEST_JUMP = 0.15
#: Renewals of the multipliers before giving up.
MOST_UPDATES = 40


@dataclass(frozen=True)
class ClosureOptions:
    """Options of a walk along back pressures.

    Attributes
    ----------
    newton : NewtonOptions
    max_step : float, Pa
        Largest load step.
    first_step : float, Pa
        Load step from rest, where the lips meet.
    min_step : float
        Smallest load step over the target pressure.
    penetration : float, m
        Largest penetration that is left.
    eigenvalues : int
        How many stiffness eigenvalues to follow.
    arclength : bool
        Go on past limit points.
    classes : bool
        Watch for buckling into the classes of motion that the model's symmetry leaves out.
    """

    newton: NewtonOptions = NewtonOptions()
    max_step: float = 1e3
    first_step: float = 50.0
    min_step: float = 1e-5
    penetration: float = 1e-6
    eigenvalues: int = 4
    arclength: bool = True
    balance_tolerance: float = 0.0
    classes: bool = False

    @classmethod
    def of(cls, case) -> ClosureOptions:
        """Options of a case file."""
        steady, closure = case.steady, case.closure
        return cls(
            NewtonOptions(steady.tolerance, steady.max_iterations),
            closure.max_step,
            closure.max_step / 20,
            penetration=closure.penetration,
            eigenvalues=closure.eigenvalues,
            arclength=closure.arclength,
            balance_tolerance=closure.balance_tolerance,
            classes=closure.symmetry == ALL,
        )


@dataclass
class ClosurePath:
    """Walks a model from one back pressure to the next.

    Parameters
    ----------
    model : ClosureModel
    options : ClosureOptions
    observer : Observer
    followed : callable, optional
        Called as followed(path) whenever there is more on the path.

    Attributes
    ----------
    points : list of PathPoint
    before_limit : ClosureState or None
        Last state before the first limit that this walk met: a buckling state, or the end of what was found.
    """

    model: ClosureModel
    options: ClosureOptions = ClosureOptions()
    observer: Observer = field(default_factory=Observer)
    followed: Callable[[ClosurePath], None] | None = None

    def __post_init__(self):
        options, pressed = self.options, self.model.pressed
        jump = LARGEST_JUMP * float(np.mean(self.model.mesh.thickness))
        steps = LoadStepOptions(options.newton, options.min_step, options.first_step, options.max_step, jump)
        self.steps = LoadSteps(pressed, steps, observer=self.observer, accepted=self._accepted)
        self.points: list[PathPoint] = []
        self.before_limit: ClosureState | None = None
        self.watch = BucklingWatch(pressed, steps, options.eigenvalues)
        self.classes = ClassWatch.of(self.model, steps, options.eigenvalues, options.classes)
        self.beyond_limit = self._met = False
        self.energy = EnergyLedger(pressed, options.balance_tolerance)
        self.energy.begin(self.steps.q, 0.0)

    @property
    def buckling(self) -> list[Buckling]:
        """States at which the tangent stiffness became singular, in the order met."""
        return self.watch.found

    def restart(self, eigenvalue: float) -> PathRestart:
        """Restart data of the path; `eigenvalue` is the lowest stiffness eigenvalue, 1/s2, of the last state."""
        steps = self.steps
        return PathRestart(
            steps.pressure,
            steps.q,
            steps.slope,
            self.model.pressed.multiplier,
            steps.step,
            self.beyond_limit,
            eigenvalue,
            self.energy.totals,
            tuple(self.buckling),
        )

    def resume(self, at: PathRestart) -> None:
        """Stand where another walk stood."""
        steps = self.steps
        steps.pressure, steps.q, steps.slope, steps.step = at.pressure, at.q, at.slope, at.step
        self.model.pressed.multiplier = at.multiplier
        self.beyond_limit = at.beyond_limit
        self.watch.resume(at.pressure, at.q, at.eigenvalue, at.buckling)
        self.classes.resume(at.pressure, at.q)
        self._met = bool(at.buckling)
        self.energy.begin(at.q, at.pressure, at.slope)
        self.energy.totals = at.energy

    def go_to(self, target: float) -> ClosureState:
        """Equilibrium at a back pressure, Pa, with the penetration asked for.

        Raises
        ------
        SolveError
        """
        iterations, count = 0, 0
        try:
            way = self.steps.reach(target)
            last, iterations, count = way.result, way.iterations, way.steps
        except SolveError as error:
            if not self.options.arclength:
                self._meet_limit(self.steps.pressure, self.steps.q)
                raise
            self._past_limit(target, error)
            last = self.steps.settle()
        updates = 0
        pressed = self.model.pressed
        while pressed.contact_state(self.steps.q).penetration > self.options.penetration:
            if updates == MOST_UPDATES:
                raise SolveError(
                    f"At {target:.6g} Pa {updates} renewals of the contact multipliers left a penetration of "
                    f"{pressed.contact_state(self.steps.q).penetration:.2g} m; a larger closure.contact_depth may help."
                )
            pressed.renew_multipliers(self.steps.q)
            last = self.steps.settle()
            self.energy.add(self.steps.q, target, self.steps.slope)
            iterations, updates = iterations + last.iterations, updates + 1
        self.energy.settle()
        spectrum = self.watch.see(target, self.steps.q)
        self.classes.see(target, self.steps.q)
        self._tell()
        return describe_closure(
            self.model,
            self.steps.q,
            target,
            spectrum,
            beyond_limit=self.beyond_limit,
            energy_balance=self.energy.error,
            converged=True,
            iterations=iterations,
            load_steps=count,
            multiplier_updates=updates,
            residual=last.residual,
            rounding=last.rounding,
            reason=last.reason,
        )

    # -- on the way
    # ----

    def _accepted(self, pressure: float, q: np.ndarray) -> None:
        self.energy.add(q, pressure, self.steps.slope)
        self.points.append(self._point(pressure, q, float(self.watch.see(pressure, q).values.real[0])))
        self.classes.see(pressure, q)
        self._tell()

    def _tell(self) -> None:
        if self.watch.before is not None:
            self._meet_limit(*self.watch.before)
        if self.followed is not None:
            self.followed(self)

    def _past_limit(self, target: float, error: SolveError) -> None:
        """Arclength from the last equilibrium to the target pressure."""
        start, q = self.steps.pressure, self.steps.q
        self.observer.progress(f"arclength from {start:.6g} Pa")
        try:
            path = arclength_path(
                self.model.pressed, q, start, target, self.options.newton.tolerance, observer=self.observer
            )
        except NotConverged as reason:
            self._meet_limit(start, q)
            raise SolveError(f"{error} Arclength did not get under way either: {reason}") from reason
        for point in path.branch.points[1:]:
            self.points.append(self._point(float(point.z[-1]), point.z[:-1], np.nan, arclength=True))
            self.energy.add(point.z[:-1], float(point.z[-1]), refine=False)
        if path.limits or not path.reached:
            self._meet_limit(start, q)
        for limit in path.limits:
            self.buckling.append(Buckling("limit point", limit.pressure, limit.q, limit.shape, limit.eigenvalue))
        self.beyond_limit = self.beyond_limit or bool(path.limits)
        self.watch.forget()
        self.classes.forget()
        self._tell()
        self.steps.q, self.steps.pressure, self.steps.slope = path.q, path.pressure, None
        if not path.reached:
            raise SolveError(
                f"{error} Arclength ended at {path.pressure:.6g} Pa after {len(path.branch)} points "
                f"({path.branch.reason})."
            )

    def _meet_limit(self, pressure: float, q: np.ndarray) -> None:
        """Describe the last equilibrium before the first limit."""
        if self._met or pressure <= 0:
            return
        self._met = True
        try:
            self.before_limit = self._describe_before_limit(pressure, q)
        except SolveError as error:
            self.observer.warn(f"The last state before a limit, at {pressure:.6g} Pa, was not described: {error}")

    def _describe_before_limit(self, pressure: float, q: np.ndarray) -> ClosureState:
        """With the penetration asked for, on a model of its own: the walk is left as it is."""
        model = replace(self.model, pressed=copy(self.model.pressed))
        steps, updates = LoadSteps(model.pressed, self.steps.options, pressure, q), 0
        last = steps.settle()
        found = model.pressed.multiplier, steps.q
        try:
            while (
                model.pressed.contact_state(steps.q).penetration > self.options.penetration and updates < MOST_UPDATES
            ):
                model.pressed.renew_multipliers(steps.q)
                last, updates = steps.settle(), updates + 1
        except SolveError:  # the limit lies nearer than what renewed multipliers change
            model.pressed.multiplier, steps.q = found
            last, updates = steps.settle(), 0
        spectrum = stiffness_spectrum(model.pressed, steps.q, pressure, self.options.eigenvalues)
        return describe_closure(
            model,
            steps.q,
            pressure,
            spectrum,
            beyond_limit=False,
            energy_balance=self.energy.error,
            converged=True,
            iterations=last.iterations,
            load_steps=0,
            multiplier_updates=updates,
            residual=last.residual,
            rounding=last.rounding,
            reason=last.reason,
            before_limit=True,
        )

    def _point(self, pressure: float, q: np.ndarray, lowest: float, arclength: bool = False) -> PathPoint:
        model = self.model
        passage, contact, nodal = opening(model, q), model.pressed.contact_state(q), model.pressed.nodal(q)
        return PathPoint(
            pressure=float(pressure),
            max_displacement=float(np.linalg.norm(nodal[:, :3], axis=1).max()),
            contact_force=model.mesh.part.walls * contact.total,
            least_opening=float(model.mesh.part.copies * passage.area.min()),
            sealed_length=passage.shut_length(model.case.closure.shut_fraction),
            lip_seal=passage.lip_seal(model.case.closure.shut_fraction),
            contact_front=contact_front(passage, model),
            overlap=face_overlap(model, nodal),
            lowest_eigenvalue=lowest,
            arclength=arclength,
        )
