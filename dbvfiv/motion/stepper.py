"""One implicit step: prediction, a candidate for the new state with its equations and iteration matrix, simplified
Newton iterations with a kept factorisation, a natural line search, and the state that it becomes.

PETSc factors and solves; the iteration is our own. TSALPHA2 knows neither a weighted internal force with its rate nor
an inlet velocity of first order, and the convergence test wanted here, on the size of the next correction rather than
on a residual that stiff membrane modes dominate, with factors kept over many steps, would leave nothing of SNES but the
loop.

A one-step scheme of the generalised-alpha family weights accelerations by 1 - alpha_m and forces by 1 - alpha_f, where
the work of a step has their means. With M and a linear force F
the difference, which numerical damping takes, is known (Erlicher, Bonaventura and Bursi
2002 have its like), D what a quantity changes by, v the mean velocity and a without the part of contact's impulses:

    loss = mu h v' M Da + k h Da' M (Dv + h mu Da) + (1/2 - alpha_f) DF' Dq,
    mu = 1 - alpha_m - gamma,     k = beta - gamma/2

It is zero without numerical damping, and no square: over a smooth motion with steps of one kind it adds up to a loss,
but steps that go from damped to not and back leave h v' M a at each turn, with either sign. What is nonlinear in F and
M is left to the balance of energy.

Equation (T.29) of docs/theory.md.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from eigen.factor import SingularShiftError

from ..flow.stepping import SECOND_ORDER, Flow, FluidState
from ..shell.memory import Memory
from .scheme import Scheme
from .scheme import scheme as member


@dataclass(frozen=True)
class MotionState:
    """All that the next step depends on."""

    time: float  #: s.
    #: q, v and a: (n,); unknowns (m, rad), velocities and accelerations; the latter without the part of touching faces,
    #: whose impulses belong to single steps.
    q: np.ndarray
    v: np.ndarray
    a: np.ndarray
    #: force and force_rate: (n,); internal force F and the scheme's value of its rate; of a wall that relaxes the rate
    #: by its slow law.
    force: np.ndarray
    force_rate: np.ndarray
    load: np.ndarray  #: (n,); force G p of the fluid where the equations were last met.
    fluid: FluidState
    memory: Memory | None = None  #: What a wall that relaxes remembers.


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


@dataclass(frozen=True)
class Weights:
    """Weights of the parts of a step's equations: their dependence on the new unknowns."""

    theta: float  #: Point in the step at which the fluid's equations are met: the share of the new state there.
    load: float  #: Factor of G p there.
    inertia: float  #: Factor of M, 1/s2; mass damping included.
    force: float  #: Factor of the tangent of F.
    velocity: float  #: Derivative of the new velocities with respect to the new positions, 1/s.
    outside: float = 0.0  #: Factor of the added mass of fluid outside, 1/s2: no damping acts on it.


class Trial:
    """A candidate for the new state; its unknowns are the accelerations. The inlet velocity follows from them.

    With `robust` the fluid's equations are met at the end of the step, psi by a backward difference: of first order,
    but momentum that is lost within a step, when lips slam, does not come back with the opposite sign. Its force is
    then the weighted mean of this and the last one, as spikes that change their sign from step to step would otherwise
    do work on stops that ring.

    Contact of faces acts as the impulse of its own step (nonsmooth generalised-alpha; Bruls, Acary & Cardona 2014): it
    moves the wall by half the step and changes velocities at once, and what the scheme carries on to later steps as
    accelerations has no part of it. Impacts then keep or lose what the contact's law says for any member of the family.
    """

    def __init__(
        self, motion, scheme: Scheme, old: MotionState, h: float, pressure: Callable[[float], float], robust: bool
    ):
        self.motion, self.scheme, self.old, self.h = motion, scheme, old, h
        s, now = scheme, scheme.now
        self.wall = None if motion.wall is None else motion.wall.step(old.memory, h)
        theta, rate = (1.0, 1.0) if robust else SECOND_ORDER if motion.fluid.compressed else (now, s.rate)
        self.kind = (h, robust, s.gamma)
        self.weights = Weights(
            theta=theta,
            load=now if theta == 1.0 else 1.0,
            inertia=(1.0 - s.alpha_m) / (s.beta * h * h) + motion.mu.alpha * now * s.gamma / (s.beta * h),
            force=now + motion.mu.beta * s.rate / h,
            velocity=s.gamma / (s.beta * h),
            outside=(1.0 - s.alpha_m) / (s.beta * h * h),
        )
        self.contact = motion.contact_step(old.q, h) if motion.contact is not None else None
        self._impulse_weight = (1.0 - s.alpha_m) / (2.0 * s.beta)
        inlet = pressure(old.time + theta * h)
        self.fluid = motion.begin_step(old, h, theta, rate, inlet)

        # stiffness damping is by the slow law, and its force is known apart only where there is some
        rayleigh = self.wall is not None and motion.mu.beta
        self._slow = motion.internal_force(old.q) if rayleigh else None

    def _slow_rate(self) -> np.ndarray:
        return (self.motion.internal_force(self.q) - self._slow) / self.h

    def set(self, a: np.ndarray) -> None:
        """Start from new accelerations."""
        s, h, old = self.scheme, self.h, self.old
        self.a = np.array(a)
        self.v = old.v + h * ((1.0 - s.gamma) * old.a + s.gamma * self.a)
        self.q = old.q + h * old.v + h * h * ((0.5 - s.beta) * old.a + s.beta * self.a)

    def move(self, fraction: float, dq: np.ndarray) -> None:
        """Add a fraction of a correction of q."""
        s, h = self.scheme, self.h
        self.q = self.q + fraction * dq
        self.v = self.v + (fraction * s.gamma / (s.beta * h)) * dq
        self.a = self.a + (fraction / (s.beta * h * h)) * dq

    def evaluate(self) -> float:
        """Set residual and forces; return the norm of the former."""
        s, now, old, motion = self.scheme, self.scheme.now, self.old, self.motion
        self.force = motion.internal_force(self.q, self.wall)
        self.force_rate = (self.force - old.force) / self.h if self._slow is None else self._slow_rate()
        self.q_mid = old.q + now * (self.q - old.q)
        self.v_mid = old.v + now * (self.v - old.v)
        self.a_mid = old.a + (1.0 - s.alpha_m) * (self.a - old.a)
        self.at_load = (self.q, self.v) if self.weights.theta == 1.0 else (self.q_mid, self.v_mid)
        self.load = motion.load(*self.at_load, self.q, self.v, self.fluid)
        alpha, beta = motion.mu.alpha, motion.mu.beta
        self.damping = beta * (old.force_rate + s.rate * (self.force_rate - old.force_rate))
        elastic = old.force + now * (self.force - old.force)
        inertia = motion.inertia(self.q_mid, self.v_mid, self.a_mid + alpha * self.v_mid if alpha else self.a_mid)
        if motion.outside is not None:
            inertia += motion.outside.force(self.q_mid, self.a_mid)
        share = self.weights.load
        self.push = self.load.force if share == 1.0 else old.load + share * (self.load.force - old.load)
        self.residual = inertia + self.damping + elastic - self.push
        if self.contact is not None:
            self.touch = self.contact.force(self.q)
            self.residual += self._impulse_weight * self.touch
        return float(np.linalg.norm(self.residual))

    def linearise(self) -> None:
        moving = (self.q, self.v, self.q_mid, self.v_mid)
        touching = {} if self.contact is None else {"contact": (self.contact, self._impulse_weight)}
        self.motion.linearise(*moving, self.load, self.weights, *self.at_load, self.wall, **touching)

    def allowed(self, tolerance: float, floor: float) -> float:
        """Largest correction that may be left, m; see `dbvfiv.motion.stepper.StepOptions`."""
        motion = self.motion
        moved = self.h**2 * self.scheme.beta * motion.length(self.a_mid)
        floor = max(floor, 1e3 * np.finfo(float).eps)
        return max(tolerance * moved + floor * motion.length(self.q), motion.resolution, np.finfo(float).tiny)

    def state(self) -> MotionState:
        old, load = self.old, self.load
        v, a = self._after_contact()
        return MotionState(
            old.time + self.h,
            self.q,
            v,
            a,
            self.force,
            self.force_rate,
            load.force,
            load.state(),
            None if self.wall is None else self.motion.wall.advance(old.memory, self.q, self.h, self.scheme.now),
        )

    def _after_contact(self) -> tuple[np.ndarray, np.ndarray]:
        """Velocities with the whole impulse of the step's contact, accelerations with none of it."""
        if self.contact is None or not np.any(self.touch):
            return self.v, self.a
        s, pushed = self.scheme, -self.motion.accelerated(self.q_mid, self.touch)
        return self.v + self.h * (1.0 - 0.5 * s.gamma / s.beta) * pushed, self.a - pushed / (2.0 * s.beta)

    @property
    def contact_loss(self) -> float:
        """Energy that contact took from the wall in the step and did not store, J."""
        if self.contact is None:
            return 0.0
        return float(self.touch @ (self.q - self.old.q)) - self.contact.stored(self.q)


def numerical_loss(motion, trial: Trial, new: MotionState) -> float:
    """Energy that the numerical damping of a step takes, J.

    Parameters
    ----------
    motion : ValveMotion or anything with its methods
    trial : Trial
        The step's equations, met.
    new : MotionState
        What the step ends with.
    """
    s, old, h = trial.scheme, trial.old, trial.h
    mu, shift, forward = 1.0 - s.alpha_m - s.gamma, s.beta - 0.5 * s.gamma, 0.5 - s.alpha_f
    if not (mu or shift or forward):
        return 0.0
    change, faster = new.a - old.a, new.v - old.v
    momentum = motion.momentum(trial.q_mid, change)
    if motion.outside is not None:
        momentum = momentum + motion.outside.force(trial.q_mid, change)
    inertia = mu * (0.5 * (old.v + new.v)) + shift * (faster + h * mu * change)
    return float(h * (inertia @ momentum) + forward * (_force_change(motion, old, new) @ (new.q - old.q)))


def _force_change(motion, old: MotionState, new: MotionState) -> np.ndarray:
    """Change (n,) of the force that has a potential: that of branches is in the books of their own."""
    if motion.wall is None:
        return new.force - old.force
    return motion.internal_force(new.q) - motion.internal_force(old.q)


#: Speed inwards, relative to the largest speed, that is none.
INWARD = 1e-6
#: Least numerical damping of steps that start with fluid drawn in: without any, the kicks that walls get then alternate
#: from step to step for good. A fluid that is `quiet_inward` takes no such steps.
DAMPING = 0.2


@dataclass(frozen=True)
class StepOptions:
    """Options of the iteration within a step."""

    tolerance: float = 1e-4  #: Largest correction left, relative to what the accelerations move the wall in a step.
    floor: float = 1e-10  #: Largest correction left relative to the deflection, where nothing moves.
    max_iterations: int = 20  #: Corrections of one attempt.
    refactor_at: float = 0.5  #: Contraction of the corrections above which the matrix is factored anew.
    diverged: float = 100.0  #: Growth of the corrections that ends an attempt.
    smallest_fraction: float = 1.0 / 16.0  #: Of a Newton correction in the line search.
    #: Largest change of a rotation in a step, rad. Directors that turn further between two instants can gain energy
    #: from stiffness damping.
    largest_turn: float = 0.3


@dataclass(frozen=True)
class StepResult:
    """A finished step."""

    state: MotionState
    load: Flow  #: Fluid at the end of the step.
    work: float  #: Of the pressure on the wall during the step, J of the part.
    dissipation: float  #: By Rayleigh damping, J.
    #: residuals, solves and factorisations: work done.
    residuals: int
    solves: int
    factorisations: int
    error: float  #: Estimated local error of the displacements, m; not a number without a step before.
    contact_loss: float = 0.0  #: Energy that touching faces took and did not store, J.
    numerical_loss: float = 0.0  #: Energy that the numerical damping took, J; see `dbvfiv.motion.stepper`.


class StepFailure(ArithmeticError):
    """The iteration of a step did not converge."""


class Stepper:
    """Steps a motion.

    Parameters
    ----------
    motion : ValveMotion or anything with its methods
    pressure : callable
        Inlet pressure, Pa, from time, s.
    """

    def __init__(
        self, motion, scheme: Scheme, pressure: Callable[[float], float], options: StepOptions = StepOptions()
    ):
        self.motion, self.scheme, self.pressure, self.options = motion, scheme, pressure, options
        quiet = motion.fluid.quiet_inward
        self._inward = scheme if quiet else member("generalised-alpha", max(DAMPING, scheme.gamma - 0.5))
        self.residuals = self.solves = self.factorisations = 0
        self.forget()

    def forget(self, all: bool = True) -> None:
        """Drop factors and predictor, with `all` the factorisation's analysis too: steps depend on the state alone."""
        if all:
            self.motion.drop_factors()
        self._factored: tuple[float, bool, float] | None = None
        self._past = Predictor()

    def retry(self) -> None:
        """Drop factors and what the predictor knows but the last step, by which the error of the next is told."""
        self._factored = None
        self._past.shorten()

    def take_back(self) -> None:
        """Forget the last step, which its caller does not go on from."""
        self._past.drop()

    # -- the step

    def step(self, state: MotionState, h: float) -> StepResult:
        """Advance a state by h, s. Raises StepFailure."""
        before = (self.residuals, self.solves, self.factorisations)
        speeds = self.motion.fluid.jets(state.fluid)
        outward, momenta = _outward(speeds), self.motion.fluid.momenta(speeds)
        scheme = self.scheme if outward else self._inward
        for robust in (not (outward and self._smooth(state, momenta, h)), True):
            trial = Trial(self.motion, scheme, state, h, self.pressure, robust)
            try:
                self._iterate(trial)
            except SingularShiftError as error:
                raise StepFailure(str(error)) from error
            if robust or self._kept_momentum(trial, momenta):
                break
            self._factored = None
        turn = self.motion.turn(trial.q - state.q)
        if turn > self.options.largest_turn:
            self._past.shorten()
            raise StepFailure(f"A director turned by {turn:.2g} rad.")
        new = trial.state()
        past, here = self._past.last, (state.time + (1.0 - scheme.alpha_m) * h, trial.a_mid)
        self._past.add(*here)
        work = [now - then for now, then in zip((self.residuals, self.solves, self.factorisations), before)]
        jump = np.nan if past is None else self.motion.length(here[1] - past[1]) * h / (here[0] - past[0])
        error = scheme.error_constant * h * h * jump
        taken = trial.contact_loss, numerical_loss(self.motion, trial, new)
        return StepResult(new, trial.load, *self._works(trial), *work, error, *taken)

    @staticmethod
    def _smooth(state: MotionState, momenta: np.ndarray, h: float) -> bool:
        """True where the fluid flowed outwards before the last step, and its momentum changed little in that step.

        Sections are compared one by one, since one section may gain what another loses. The time before counts too,
        since flow that has just turned round rings.
        """
        change = h * state.fluid.turning
        return bool(np.abs(change).sum() <= 0.34 * np.abs(momenta).sum()) and _outward(momenta - change)

    def _kept_momentum(self, trial: Trial, old: np.ndarray) -> bool:
        """True where the fluid's sections kept most of their momentum in a step and none turned round.

        Otherwise the fluid's equations are better met at the end of the step.
        """
        speeds = self.motion.fluid.jets(trial.load)
        new = self.motion.fluid.momenta(speeds)
        return bool(np.clip(old - new, 0.0, old).sum() <= 0.5 * old.sum()) and _outward(speeds)

    def _works(self, trial: Trial) -> tuple[float, float]:
        """Work of the pressure and dissipation of a step, by the scheme's own weights."""
        way = trial.q - trial.old.q
        alpha = self.motion.mu.alpha
        lost = trial.damping @ way
        if alpha:
            lost += alpha * (self.motion.momentum(trial.q_mid, trial.v_mid) @ way)
        return float(trial.push @ way), float(lost)

    # -- the iteration

    def _iterate(self, trial: Trial) -> None:
        """Correct a trial until the next correction would be below what is allowed.

        Three attempts, each for what defeats the one before: kept factors as long as they contract; full corrections
        with factors renewed, which serve shells best, as membrane forces that follow bending make residuals rise before
        they fall; and from the prediction again, a line search.
        """
        norm = self._start(trial)
        if self._factored == trial.kind and self._full(trial, norm, renew=False):
            return
        if self._full(trial, self._start(trial), renew=True):
            return
        if self._searched(trial, self._start(trial)):
            return
        raise StepFailure("Newton's corrections did not converge, neither whole nor with a line search.")

    def _full(self, trial: Trial, norm: float, renew: bool) -> bool:
        """Whole corrections. Factors that contract too slowly are renewed, or end the attempt."""
        options = self.options
        if renew:
            self._factor(trial)
        correction = self._solve(trial)
        size = first = self.motion.length(correction)
        for _ in range(options.max_iterations):
            allowed = trial.allowed(options.tolerance, options.floor)
            if size <= 1e-2 * allowed:
                return True
            trial.move(1.0, correction)
            norm, norm_old = self._residual(trial), norm
            if norm < norm_old and size * norm / norm_old <= allowed:
                return True
            if not np.isfinite(norm):
                trial.move(-1.0, correction)
                return False
            correction = self._solve(trial)
            size, size_old = self.motion.length(correction), size
            if size <= allowed:
                return True
            if not size <= options.refactor_at * size_old:
                if not renew:
                    return False
                self._factor(trial)
                correction = self._solve(trial)
                size = self.motion.length(correction)
                if not size <= options.diverged * first:
                    return False
        return False

    def _searched(self, trial: Trial, norm: float) -> bool:
        """Parts of corrections such that the next one by the same factors is smaller: the natural monotonicity test
        (Deuflhard 2011).
        """
        options = self.options
        for _ in range(options.max_iterations):
            self._factor(trial)
            correction = self._solve(trial)
            size, fraction = self.motion.length(correction), 1.0
            if size <= 1e-2 * trial.allowed(options.tolerance, options.floor):
                return True
            while True:
                trial.move(fraction, correction)
                finite = np.isfinite(self._residual(trial))
                left = self.motion.length(self._solve(trial)) if finite else np.inf
                if left <= (1.0 - 0.25 * fraction) * size:
                    break
                trial.move(-fraction, correction)
                fraction *= 0.5
                if not fraction >= options.smallest_fraction:
                    return False
            if left <= trial.allowed(options.tolerance, options.floor):
                return True
        return False

    def _start(self, trial: Trial) -> float:
        """Predict the accelerations at the instant where they are taken.

        Those at the ends of steps would not do: without numerical damping they alternate about the true ones. From a
        state without a past, the step goes on at its velocities.
        """
        state, s, h = trial.old, trial.scheme, trial.h
        if self._past.last is not None:
            a = self._past.accelerations(state.time + (1.0 - s.alpha_m) * h)
            trial.set((a - s.alpha_m * state.a) / (1.0 - s.alpha_m))
            norm = self._residual(trial)
            if np.isfinite(norm):
                return norm
        trial.set((1.0 - 0.5 / s.beta) * state.a)
        norm = self._residual(trial)
        if not np.isfinite(norm):
            raise StepFailure("The equations cannot be evaluated at the start of the step.")
        return norm

    def _residual(self, trial: Trial) -> float:
        self.residuals += 1
        return trial.evaluate()

    def _factor(self, trial: Trial) -> None:
        self.factorisations += 1
        self._factored = None
        trial.linearise()
        self._factored = trial.kind

    def _solve(self, trial: Trial) -> np.ndarray:
        self.solves += 1
        return self.motion.solve(-trial.residual)


def _outward(speed: np.ndarray) -> bool:
    """True where no speed (m,), or momentum of a section, points inwards."""
    return not np.any(speed < -INWARD * np.abs(speed).max(initial=0.0))


class Predictor:
    """Accelerations (n,) at the last instants, four at most, and what follows from them."""

    def __init__(self) -> None:
        self._points: list[tuple[float, np.ndarray]] = []

    @property
    def last(self) -> tuple[float, np.ndarray] | None:
        """Time, s, and accelerations of the last step; None without any."""
        return self._points[-1] if self._points else None

    def add(self, time: float, accelerations: np.ndarray) -> None:
        """Remember a step."""
        self._points = [*self._points[-3:], (time, accelerations)]

    def drop(self) -> None:
        """Forget the last step."""
        self._points.pop()

    def shorten(self) -> None:
        """Forget all but the last step."""
        self._points = self._points[-1:]

    def accelerations(self, time: float) -> np.ndarray:
        """Accelerations (n,) at a later instant, s; at least one step must be known.

        On even steps by formulas that are exact for a parabola (or a straight line) plus a part of alternating sign:
        without numerical damping, stiff modes with much stiffness damping alternate, and a parabola alone would throw
        that part up sevenfold.
        """
        points = self._points
        gaps = np.diff([t for t, _ in points] + [time])
        if len(points) >= 3 and np.ptp(gaps) <= 1e-6 * gaps[-1]:
            values = [value for _, value in points]
            if len(values) >= 4:
                return 2.0 * (values[-1] - values[-3]) + values[-4]
            return values[-1] + values[-2] - values[-3]
        (before, old), (here, new) = points[-2:] if len(points) > 1 else (points[0], (points[0][0] + 1.0, points[0][1]))
        return new + (time - here) / (here - before) * (new - old)
