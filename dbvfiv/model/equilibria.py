"""Equilibria at inlet pressures, by load steps from rest or from a given state."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from ..case.model import Case
from ..case.quantity import GRAVITY
from ..errors import SolveError
from ..geometry.divisions import grading
from ..observer import Observer
from .load_curve import LoadCurve, curve_of
from .load_steps import Loading, LoadStepOptions, LoadStepResult, LoadSteps
from .material_stability import beyond_levels, material_stability
from .newton import NewtonOptions
from .state import SteadyState, describe_state
from .valve import ValveModel

#: Unbalanced force over pressure force above which a state is no equilibrium of its model.
_UNBALANCED = 1e-4
#: Iterations within which a wide load step ends where many short ones do: of 200 steps of odd valves from rest none of
#: fewer went astray, and 7 of 20 with more.
STRAIGHT = 10


@dataclass(frozen=True)
class SteadyOptions(LoadStepOptions):
    """Options of a path of equilibria."""

    @classmethod
    def of(cls, case) -> SteadyOptions:
        """Options of a case file."""
        steady = case.steady
        newton = NewtonOptions(steady.tolerance, steady.max_iterations)
        return cls(newton, steady.min_step, straight=STRAIGHT)


#: Passage at the lips over that of the flange from which on a lost equilibrium is put down to it.
_NEARLY_AS_WIDE = 0.9


@dataclass
class LoadPath(LoadSteps):
    """Walks a valve from one steady state to the next in pressure; at rest the inlet pressure is that downstream."""

    def __post_init__(self):
        if self.q is None:
            self.pressure = self.model.flow.back
        super().__post_init__()

    def go_to(self, target: float) -> SteadyState:
        """Equilibrium at a pressure, Pa. Raises SolveError if the load steps became smaller than allowed;
        `self.pressure` and `self.q` then hold the last equilibrium. If the pressure downstream is not overcome.
        """
        self._check_drive(target)
        try:
            if self.follows_curve:
                way = self._along_curve(target)
            else:
                way = self._loaded(target) if self._at_rest else self.reach(target)
        except SolveError as error:
            raise SolveError(f"{str(error).removesuffix('.')}{self._too_wide()}.") from None
        return self._described(way)

    def settled(self) -> SteadyState:
        """Equilibrium at the present pressure, found from displacements next to it. Raises SolveError."""
        result = self.settle()
        return self._described(LoadStepResult(result.iterations, 0, result))

    def _described(self, way: LoadStepResult) -> SteadyState:
        last = way.result
        return describe_state(
            self.model,
            self.q,
            self.pressure,
            converged=True,
            iterations=way.iterations,
            load_steps=way.steps,
            residual=last.residual,
            rounding=last.rounding,
            reason=last.reason,
        )

    def _check_drive(self, target: float) -> None:
        """Refuse a pressure that drives no flow, but that of a valve which hangs with still fluid in it, and the begin
        of a curve of equilibria, at rest.
        """
        back, level = self.model.flow.back, self.model.flow.level
        if target > back or (target == back and (self.model.weight is not None or self.follows_curve)):
            return
        if not self.model.flow.has_fluid:
            raise SolveError(f"{target:.6g} Pa is no load: nothing presses on the wall.")
        by_level = f", {level:.6g} Pa of it by the level of the lips," if level else ""
        raise SolveError(
            f"At {target:.6g} Pa nothing flows: the pressure downstream is {back:.6g} Pa{by_level} and the drive must "
            "be greater; `dbvfiv closure` says what a back pressure does to the valve."
        )

    @property
    def _at_rest(self) -> bool:
        """True for a wall with weight at a state without load or without a flow, where the path starts again from rest.

        The state without load is no equilibrium of such a wall. From the wall that hangs without a flow, lips that all
        but touch open less surely than from rest.
        """
        still = self.pressure == self.model.flow.back
        return self.model.weight is not None and (still or not np.any(self.q))

    def _loaded(self, target: float) -> LoadStepResult:
        """Put on pressure, levels and weight together, and step on from there."""
        ramp = LoadSteps(Loading(self.model, target), self.options)
        try:
            way = ramp.reach(1.0)
        except SolveError as error:
            raise SolveError(
                f"No equilibrium was found on the way from rest to {target:.6g} Pa and the weight of wall and fluid, "
                f"put on together, beyond {100 * ramp.pressure:.3g} % of both"
            ) from error
        self.q, self.pressure = ramp.q, target
        settled = self.settle()
        return LoadStepResult(way.iterations + settled.iterations, way.steps, settled)

    @property
    def follows_curve(self) -> bool:
        """True where one pressure may have several equilibria: of a bill that is moulded shut, whose faces part, and
        of a wall that is pressed from outside, which may snap, unless load steps refuse its jumps.
        """
        drive = self.model.case.drive
        outside = drive.kind == "uniform" and drive.side == "outside" and self.model.weight is None
        return self.model.case.valve.is_preset or (outside and not np.isfinite(self.options.largest_jump))

    @property
    def curve(self) -> LoadCurve:
        """Equilibria from rest on, the same for all paths of the model."""
        return curve_of(self.model, self.options.newton, self.observer)

    def _along_curve(self, target: float) -> LoadStepResult:
        result, points = self.curve.reach(target)
        self.q, self.pressure = result.q, target
        self.slope = None
        return LoadStepResult(result.iterations, points, result)

    def _too_wide(self) -> str:
        """Clause on a passage that leaves no finite flow, of the last equilibrium; empty for other causes."""
        area = self.model.rows.areas(self.model.nodal(self.q))
        share = area[0] / area[-1]
        if self.model.case.drive.kind != "flow" or share < _NEARLY_AS_WIDE:
            return ""
        return (
            f"; the passage at the lips had widened to {100 * share:.0f} % of that of the flange, and none as wide as "
            "the flange has a finite steady flow"
        )


def find_equilibrium(model: ValveModel, pressure: float, observer: Observer | None = None) -> SteadyState:
    """Equilibrium at one inlet pressure, Pa, by load steps from rest. Raises SolveError if it is not reached."""
    observer = Observer() if observer is None else observer
    state = LoadPath(model, SteadyOptions.of(model.case), observer=observer).go_to(pressure)
    for sentence in state_warnings(model, [state]):
        observer.warn(sentence)
    return state


def redescribe(model: ValveModel, state: SteadyState) -> SteadyState:
    """An equilibrium as a model with other surroundings of the same structure sees it."""
    kept = ("converged", "iterations", "load_steps", "residual", "rounding", "reason")
    return describe_state(model, state.q, state.pressure, **{name: getattr(state, name) for name in kept})


def rest_state(model: ValveModel) -> SteadyState:
    """The valve at rest without pressure difference, as a state; with gravity it hangs, the fluid in it still. Raises
    SolveError if a valve that hangs has no equilibrium.
    """
    if model.weight is not None:
        return LoadPath(model, SteadyOptions.of(model.case)).go_to(model.flow.back)
    return describe_state(
        model,
        model.rest(),
        model.flow.back,
        converged=True,
        iterations=0,
        load_steps=0,
        residual=0.0,
        rounding=0.0,
        reason="at rest without pressure",
    )


def require_equilibrium(model: ValveModel, state: SteadyState) -> None:
    """Refuse a state that is no equilibrium of a model. Raises SolveError."""
    if not state.converged:
        raise SolveError(
            f"The steady state at {state.pressure:.6g} Pa has not converged (residual "
            f"{state.residual:.1e}), so it has no modes; find the equilibrium first."
        )
    if len(state.q) != model.size:
        raise SolveError(
            f"The steady state at {state.pressure:.6g} Pa belongs to another mesh, so it has no modes in this model."
        )
    scale = model.force_scale(state.q, state.pressure)
    unbalanced = float(np.linalg.norm(model.residual(state.q, state.pressure)))
    share = max(_UNBALANCED, model.case.steady.tolerance)
    allowed = max(share * scale, 1e3 * model.rounding(state.q, model.tangent(state.q, state.pressure)))
    if not unbalanced <= allowed:
        raise SolveError(
            f"The state at {state.pressure:.6g} Pa is no equilibrium of this model: its unbalanced force is "
            f"{unbalanced:.2g} N against "
            f"{scale:.2g} N of pressure, so it has no modes; find the equilibrium first."
        )


def model_warnings(model: ValveModel) -> Iterator[str]:
    """Sentences about the model that hold whatever the load."""
    mesh = model.case.mesh
    folded = model.shell.folded_places()
    if len(folded):
        (xa, _ya, za), (xb, _yb, zb) = folded.min(axis=0), folded.max(axis=0)
        yield (
            f"Half the wall exceeds the radius of the mid-surface at {len(folded)} points (x {xa:.3f} to "
            f"{xb:.3f} m, z {za:.3f} to {zb:.3f} m): "
            "the inner face folds over itself there and first-order shell theory is only an approximation."
        )
    if len(model.mesh.missed_rows):
        places = ", ".join(f"{z:g}" for z in np.sort(model.mesh.missed_rows))
        yield (
            f"{model.mesh.shape[1]} elements along are too few for a row on every step of the wall and every break "
            f"asked for: those at z = {places} m fall inside elements; raise mesh.along."
        )
    edges = {s for part in (*model.case.valve.patches, *model.case.layers) for s in part.section_edges}
    missed = [s for s in sorted(edges) if np.isclose(grading(model.mesh.missed_columns, mesh.grading), s).any()]
    if missed:
        places = ", ".join(f"{s:g}" for s in missed)
        yield (
            f"{model.mesh.shape[0]} elements around are too few for a column on every edge of a patch or layer: those "
            f"at {places} of the section fall inside elements; raise mesh.around."
        )


def state_warnings(model: ValveModel, states: list[SteadyState]) -> Iterator[str]:
    """Sentences about the states found: strains beyond settled levels, and where a rubber is not stable."""
    yield from beyond_levels(model, states)
    lost = [found for state in states if not (found := material_stability(model, state.q, state.pressure)).holds]
    if lost:
        yield min(lost, key=lambda found: found.margin).sentence
    if len(lost) > 1:
        pressures = [found.pressure for found in lost]
        yield (
            f"The rubber's constants are unstable in {len(lost)} of {len(states)} states, from {min(pressures):.6g} to "
            f"{max(pressures):.6g} Pa."
        )


#: Cracking over sealing pressure of the first bill that is tried for a cracking head; how far over the head the curves
#: are followed; accuracy of the head, and most bills that are tried.
_CRACKS_AT, _BEYOND, _HEAD_ACCURACY, _BILLS = 1.15, (1.1, 1.5, 2.5), 1e-3, 12


def first_opening(model: ValveModel, area_ratio: float) -> float | None:
    """Pressure, Pa, up to which the load has to rise from rest until the passage at the lips of a bill that is moulded
    shut has grown to a multiple of that at rest; None where it has not as far as its curve is known.
    """
    curve = LoadPath(model, SteadyOptions.of(model.case)).curve
    wanted = np.log(area_ratio * model.rows.areas(model.nodal(model.rest()))[0])
    found = curve.first(lambda q: float(np.log(max(model.rows.areas(model.nodal(q))[0], 1e-300)) - wanted))
    return None if found is None else found[0]


def sealing_for_cracking(case: Case, area_ratio: float, observer: Observer | None = None) -> float:
    """Sealing pressure, Pa, with which the bill of a case cracks at its valve.cracking_head. Raises SolveError if there
    is none, or an equilibrium on the way is not found.
    """
    observer = Observer() if observer is None else observer
    head = case.valve.cracking_head
    drive = case.fluid.density * GRAVITY * head
    sealing, known, why = drive / _CRACKS_AT, [], ""
    for _ in range(_BILLS):
        observer.progress(f"looking for a cracking head of {head:.4g} m with a sealing pressure of {sealing:.6g} Pa")
        try:
            model = ValveModel(case.replace({"valve.cracking_head": None, "valve.sealing_pressure": sealing}))
        except SolveError as error:  # no wall presses so hard
            why, sealing = f" {error}", np.sqrt(sealing * (np.exp(known[-1][0]) if known else 0.5 * sealing))
            continue
        path, cracks = LoadPath(model, SteadyOptions.of(case), observer=observer), None
        for factor in _BEYOND:
            path.go_to(model.flow.back + factor * drive)
            cracks = first_opening(model, area_ratio)
            if cracks is not None:
                break
        off = np.log((cracks - model.flow.back) / drive) if cracks is not None else np.log(_BEYOND[-1])
        if abs(off) <= _HEAD_ACCURACY:
            return sealing
        known.append((np.log(sealing), off))
        if off > 0.0 and sealing < _HEAD_ACCURACY * drive:
            break  # a lower one changes nothing
        slope = 1.0
        if len(known) > 1 and known[-1][0] != known[-2][0]:
            (a, at_a), (b, at_b) = known[-2:]
            slope = np.clip((at_b - at_a) / (b - a), 0.3, 3.0)
        sealing = float(np.exp(known[-1][0] - off / slope))
    if known and (least := min(known))[1] > 0.0:
        above = f"{'' if least[1] < np.log(_BEYOND[-1]) else 'more than '}{np.exp(least[1]) * head:.4g} m"
        why = f" Pressed by no more than {np.exp(least[0]):.3g} Pa it takes {above}, which a thinner wall lowers."
    raise SolveError(f"No sealing pressure was found with which the bill cracks at a head of {head:.4g} m.{why}")


#: Where the search begins: this part of the pump's largest head over that behind it; and how far it goes up at once.
_START, _UP = 1 / 64, 2.0
#: Relative accuracy of the pressure.
_TOLERANCE = 1e-12
#: Difference of the pressures of valve and pump, over the largest, that is a jump of the flow and no root.
_JUMP = 1e-6


def operating_pressure(model: ValveModel, observer: Observer | None = None) -> float:
    """Pressure, Pa, at the far end of the line at which the pump delivers what the valve takes: the lowest one. Raises
    SolveError if an equilibrium is not reached on the way, or the curves meet outside of the pump's table.
    """
    observer = Observer() if observer is None else observer
    pump, density = model.pump, model.case.fluid.density
    path = LoadPath(model, SteadyOptions.of(model.case), observer=observer)
    known: dict[float, float] = {}

    def beyond(pressure: float) -> float:
        """Excess of a pressure, Pa, over that of the pump at the flow that it drives."""
        if pressure not in known:
            observer.progress(f"looking for the operating point at {pressure:.6g} Pa")
            known[pressure] = path.go_to(pressure).volume_flow
        return pressure - density * GRAVITY * float(pump.curve(known[pressure]))

    unit = density * GRAVITY
    back, top = model.flow.back, unit * float(pump.heads.max())
    if top <= back:
        raise SolveError(
            f"The pump's largest head, {top / unit:.4g} m, does not overcome the {back / unit:.4g} m that stand behind "
            "it: nothing flows."
        )
    low = back + _START * (top - back)
    if beyond(low) > 0:
        raise _outside(known[low], pump, "at the least of its heads that are tried")
    high = low
    while beyond(high) <= 0:
        low, high = high, min(back + _UP * (high - back), top)
        if low == top:
            if beyond(top) == 0:  # a bill that stays sealed
                return top
            raise _outside(known[low], pump, "at all of its heads")
    pressure = float(brentq(beyond, low, high, xtol=_TOLERANCE * top, rtol=4 * _TOLERANCE))
    if abs(beyond(pressure)) > _JUMP * top:
        below, above = (max(p for p in known if beyond(p) <= 0), min(p for p in known if beyond(p) > 0))
        raise SolveError(
            f"There is no operating point: at {pressure:.6g} Pa the valve's flow jumps from {1e3 * known[below]:.4g} "
            f"to {1e3 * known[above]:.4g} L/s, and the pump delivers a flow between them at that head. A run in time "
            "says what the valve does."
        )
    if not pump.holds(known[pressure]):
        raise _outside(known[pressure], pump, f"where the curves would meet, at {pressure / unit:.4g} m")
    return pressure


def _outside(flow: float, pump, where: str) -> SolveError:
    return SolveError(
        f"The valve takes {1e3 * flow:.4g} L/s {where}, and the pump's table goes from {1e3 * pump.flow[0]:.4g} to "
        f"{1e3 * pump.flow[-1]:.4g} L/s: there is no operating point within it."
    )
