"""Start of a branch of cycles: from an onset (Hopf bifurcation) of a scan, or from a motion in a result file."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from continuation.periodic import PeriodicMotion

from ...case.parameters import DESIGN, PARAMETERS, PIPES, Mu
from ...errors import CaseError, SolveError
from ...model.equilibria import operating_pressure
from ...model.valve import ValveModel
from ...motion.control import Drive
from ...motion.equations import ValveMotion
from ...motion.scheme import scheme
from ...motion.stepper import StepFailure, Stepper, consistent_state
from ...observer import Observer
from ..case import Case
from ..orbits import Onset, onset_at
from ..session import load_result
from ..stability.line import ParameterLine
from ..stability.place import design_value
from ..stability.scan import Scan
from ..stability.walk import StabilityWalk

#: Values of the range that are asked whether the steady state is stable.
SCANNED = 13
#: Relative accuracy of an onset.
LOCATED = 1e-5


def find_onset(case: Case, walk: StabilityWalk, observer: Observer) -> Onset:
    """The onset of `cycle.over` that the branch starts at. Raises SolveError if the range holds none with an
    oscillation.
    """
    axis = case.cycle.axis
    values = [axis.values[i] for i in np.unique(np.linspace(0, len(axis.values) - 1, SCANNED).astype(int))]
    asked = axis.parameter, values, axis.log
    observer.progress(f"steady states over {axis.parameter}")
    line = ParameterLine(walk, Mu.of(case), *asked, snapshots=len(values), counts="none")
    crossings = line.scan.run(values)
    failures = []
    for crossing in crossings[::-1] if case.cycle.start == "last" else crossings:
        try:
            found = line.locate(crossing, LOCATED)
            onset = onset_at(walk, line.place(found.value), found.value, found.eigenvalue)
        except SolveError as error:  # where the state jumps, for instance; another crossing may be an onset
            failures.append(error)
            continue
        if onset is not None:
            return onset
    raise failures[0] if failures else SolveError(_without(case, line.scan))


def _without(case: Case, scan: Scan) -> str:
    axis = case.cycle.axis
    if not scan.samples:
        return f"No steady state was found over {axis.parameter}: {next(iter(scan.failures.values()), 'empty range')}"
    row = PARAMETERS[axis.parameter]
    first, last = axis.values[0], axis.values[-1]
    unstable = {sample.pairs > 0 for sample in scan.samples.values()}
    state = "stable" if unstable == {False} else "unstable" if unstable == {True} else "never neutral with a frequency"
    return (
        f"No oscillation starts between {axis.parameter} = {first / row.scale:.6g} and {row.amount(last)}: the steady "
        f"state is {state} there, and a branch of cycles starts where it loses stability. `dbvfiv onset` looks over a "
        "wider range."
    )


#: Steps of the period that is run from the last state of a run in time.
STEPS = 96
#: Harmonics of its motion.
HARMONICS = 8


@dataclass(frozen=True, eq=False)
class Given:
    """A motion to start from."""

    value: float  #: Of the parameter.
    place: Mu
    motion: PeriodicMotion  #: Near a cycle.


def given_motion(case: Case, walk: StabilityWalk) -> Given:
    """The motion of `cycle.start_file`: a cycle, or the last period of a run in time that has settled on one. Raises
    CaseError if the file holds no such motion, or one of another mesh or beyond the range. Raises SolveError if the run
    does not go on.

    Only the value of the parameter is that of the file; all else is that of the case.
    """
    path, axis = case.cycle.start_file, case.cycle.axis
    result = load_result(path)
    if result.kind not in ("transient", "cycle"):
        raise CaseError(
            f"{str(path)!r} holds a result of kind {result.kind!r}; a branch starts from a cycle or from a run in "
            "time.",
            key="cycle.start_file",
        )
    model, name = walk.built(Mu.of(case)).model, axis.parameter
    if other := result.mesh.differs_from(model):
        raise CaseError(f"The motion of {str(path)!r} belongs to {other}.", key="cycle.start_file")
    value = _value_of(result.case, case, name)
    if value is None:
        raise CaseError(f"The valve of {str(path)!r} has no one {name} to start from.", key="cycle.start_file")
    if result.kind == "transient" and name == "pressure":
        value = Drive.of(result.case)(float(result.history["time"][-1]))
        if model.pump is not None:  # whatever pressure it began at, a run moves about the operating point
            value = operating_pressure(model)
    point = _cycle_of(case, result) if result.kind == "cycle" else None
    if point is not None and result.parameter == name:
        value = float(point.value) * (value if name == "thickness" else 1.0)
    low, high = axis.values[0], axis.values[-1]
    if not low <= value <= high:
        row = PARAMETERS[name]
        raise CaseError(
            f"The motion of {str(path)!r} is at {row.text(value)}, beyond the range from {row.text(low)} to "
            f"{row.text(high)}.",
            key="cycle.start_file",
        )
    place = Mu.of(case).at(**{name: value})
    if point is not None:
        return Given(value, place, point.orbit.motion)
    model = walk.built(place).model
    if name in ("storage", *PIPES) and value != Mu.of(model.case).get(name):  # steps take them from a model's case
        given = result.case.fluid.continuity if name == "storage" else value
        model = ValveModel(model.case.replace({PARAMETERS[name].key: given}))
    return Given(value, place, _last_period(model, case, place, result))


def _value_of(other: Case, case: Case, name: str) -> float | None:
    """Value that another case has of a parameter, as a case counts it; None where it has no one value."""
    if name == "thickness":  # a factor on the wall of the case
        return other.valve.thickness_factor / case.valve.thickness_factor
    return design_value(other, name) if name in DESIGN else Mu.of(other).get(name)


def _cycle_of(case: Case, result):
    """Cycle `cycle.start_cycle` of a result, counted in the order in which cycles lie on its branch."""
    number, points = case.cycle.start_cycle, result.points
    if number is None and result.parameter != case.cycle.axis.parameter and points:
        value = _value_of(case, result.case, result.parameter)
        if value is None:
            raise CaseError(
                f"{str(case.cycle.start_file)!r} holds cycles over {result.parameter}, of which this valve has no one "
                "value; give cycle.start_cycle.",
                key="cycle.start_cycle",
            )
        return result.nearest(value)
    number = -1 if number is None else number
    if not -len(points) <= number < len(points):
        raise CaseError(
            f"{str(case.cycle.start_file)!r} holds {len(points)} cycles, so there is no cycle {number}.",
            key="cycle.start_cycle",
        )
    return points[number]


def _last_period(model: ValveModel, case: Case, place: Mu, result) -> PeriodicMotion:
    """One period, in steps, from the last state of a run."""
    verdict = result.verdict
    # the lip may be in a limit cycle beside a steady flow, and the other way round
    signals = [verdict.get(name, {}) for name in ("lip_displacement", "mass_flow")]
    frequency = next((one["frequency"] for one in signals if one.get("verdict") == "limit cycle"), None)
    if verdict["verdict"] != "limit cycle" or not frequency:
        raise CaseError(
            f"The run in {str(case.cycle.start_file)!r} has not settled on a cycle; its verdict is "
            f"{verdict['verdict']}.",
            key="cycle.start_file",
        )
    if model.flow.inner != 1:
        raise CaseError(
            "A branch of a valve with an elastic line, or a compressed fluid, does not start from a run in time, whose "
            "states do not hold the waves; start it from an onset, or from a cycle.",
            key="cycle.start_file",
        )
    state, period = result.states[-1], 1.0 / frequency
    inlet = place.pressure if model.pump is None else case.drive.pressure  # at which a pump has no lift on top
    motion = ValveMotion(model, place)
    dofs = model.shell.dofs
    speed = float(state.station_velocity[-1])
    q, v = dofs.restrict(state.nodal), dofs.restrict(state.nodal_rate)
    now = consistent_state(motion, 0.0, q, v, inlet, np.array([speed]))
    stepper = Stepper(motion, scheme("generalised-alpha"), lambda _: inlet)
    samples = []
    for _ in range(STEPS):
        samples.append(np.append(now.q, now.fluid.velocity))
        try:
            now = stepper.step(now, period / STEPS).state
        except StepFailure as failure:
            raise SolveError(f"The run in {str(case.cycle.start_file)!r} does not go on: {failure}") from failure
    # what is not periodic yet is spread over the period
    drift = np.append(now.q, now.fluid.velocity) - samples[0]
    rows = np.array(samples) - np.linspace(0.0, 1.0, STEPS, endpoint=False)[:, None] * drift
    return PeriodicMotion.of_samples(rows, min(HARMONICS, case.cycle.max_harmonics), 2 * np.pi / period)
