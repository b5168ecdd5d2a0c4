"""Cycles along one parameter: run, storage and restart, ranges of strain for fatigue, what can be read off a run."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from types import SimpleNamespace
from typing import Any

import numpy as np

from continuation.cycle_branch import CycleTracer
from continuation.cycle_points import CyclePoint, SpecialCycle
from continuation.cycles import Cycle
from continuation.harmonics import Harmonics
from continuation.hill import Exponents
from continuation.options import Reason, Said
from continuation.periodic import PeriodicMotion

from ...case.parameters import PARAMETERS, Mu
from ...errors import CaseError, SolveError
from ...model.valve import ValveModel
from ...motion.periodic import check_periodic
from ...record.mesh import MeshData, WholeValve
from ...record.record import GrowingRecord, Record
from ...record.table import Column, Shown, TableSpec, printed_head, printed_row
from ...record.vtkhdf import Step, motion
from ...shell.recovery import face_strains, layer_fields, point_stresses
from ..case import Case
from ..orbits import MODES, Follower, Orbit
from ..result import RangeResult
from ..session import Session, Study, print_rows, show_parameter
from ..stability.place import check_range, describe_fixed, fixed_conditions, models_of
from ..stability.verdict import Verdict
from ..stability.walk import StabilityWalk
from .start import find_onset, given_motion

CYCLES, SERIES, SPECIAL, ENDED, VERDICT = "cycles", "series", "special", "ended", "verdict"
#: Notes on cycles beside an onset that were not found, and on the step to take behind a number of cycles.
MISSED, STEP = "missed", "step"
#: Floquet exponents kept of each cycle.
KEPT = 20

_PERTURBED = "Dimension in which perturbations grow; -1 where it was not asked for"
_LEG = "1 on the way up from a start within the range, after the way down from there; 0 elsewhere"
COLUMNS = (
    Column("value", "SI", "Value of the parameter"),
    Column("amplitude", "m", "Half the swing in y of one lip at x = z = 0", shown=Shown("amplitude", "mm", 10, ".4f")),
    Column("frequency", "Hz", "Frequency", shown=Shown("frequency", "Hz", 10, ".4f")),
    Column("lip_least", "m", "Least displacement", shown=Shown("lip from", "mm", 9, ".3f")),
    Column("lip_largest", "m", "Largest displacement", shown=Shown("to", "mm", 9, ".3f")),
    Column("lip_mean", "m", "Mean displacement"),
    Column("flow_mean", "kg/s", "Mean mass flow at the lip", shown=Shown("flow", "kg/s", 9, ".4f")),
    Column("flow_amplitude", "kg/s", "Half the swing of the mass flow at the lip"),
    Column("least_speed", "m/s", "Least speed of the fluid at any row; below zero where it is drawn in"),
    Column(
        "unstable", "", _PERTURBED, "i8", Shown("stable", "", 7, lambda r: {0: "yes", -1: "?"}.get(r.unstable, "no"))
    ),
    Column("growth_rates", "1/s", "Of the leading Floquet exponents; NaN where there are fewer", shape=(KEPT,)),
    Column("leading", "1/s", "Growth rate of the leading one", shown=Shown("leading", "1/s", 9, ".3g")),
    Column("angular_frequencies", "rad/s", "Of the exponents, from 0 to half that of the cycle", shape=(KEPT,)),
    Column("errors", "", "Share of each perturbation that the full equations miss", shape=(KEPT,)),
    Column("trivial", "1/s", "Size of the exponent of a shift in time, zero but for errors"),
    Column("harmonics", "", "Harmonics of the series", "i8", Shown("harm.", "", 6, "")),
    Column("tail", "", "Share of the motion that the last two hold", shown=Shown("tail", "", 8, ".1g")),
    Column("correction", "", "Last correction over the motion"),
    Column("iterations", "", "Corrections", "i8"),
    Column("krylov", "", "Krylov iterations", "i8"),
    Column("arclength", "", "Along the branch"),
    Column("asked", "", "Whether the value is one of those asked for", "bool"),
    Column("leg", "", _LEG, "i8"),
)
_SERIES = (
    Column("cycle", "", "Number of the cycle, from 0", "i8"),
    Column("q", "m, rad", "Coefficients of 1, sqrt(2) cos, sqrt(2) sin of each harmonic: free unknowns"),
    Column("inner", "m/s", "The same of the flow's unknowns"),
)


def tables_of(mesh: MeshData) -> tuple[TableSpec, ...]:
    """Tables of a cycle result on a mesh."""
    waves = len(mesh.line_places)
    inner = int(mesh.gas_unknowns[0]) if len(mesh.gas_unknowns) else 2 * waves - 1 if waves else 1
    series = {"q": (int(mesh.free.sum()),), "inner": (inner,)}
    return TableSpec(CYCLES, COLUMNS), TableSpec(SERIES, _SERIES, series)


def cycle_row(point: CyclePoint, orbit: Orbit, leg: int) -> dict[str, Any]:
    """A cycle of a leg of the branch as a row of its table."""
    flow, speeds = orbit.flow
    (low, high), (least_flow, largest_flow) = orbit.lip_extremes, orbit.flow_extremes
    exponents, wide = point.exponents, np.full((3, KEPT), np.nan)
    if exponents is not None:
        count = min(len(exponents.values), KEPT)
        wide[:, :count] = exponents.values.real[:count], exponents.values.imag[:count], exponents.errors[:count]
    return {
        "value": point.value,
        "amplitude": 0.5 * (high - low),
        "frequency": point.motion.omega / (2 * np.pi),
        "lip_least": low,
        "lip_largest": high,
        "lip_mean": float(orbit.lip.mean()),
        "flow_mean": float(flow.mean()),
        "flow_amplitude": 0.5 * (largest_flow - least_flow),
        "least_speed": float(speeds.min()),
        "unstable": -1 if exponents is None else exponents.unstable,
        "growth_rates": wide[0],
        "leading": wide[0, 0],
        "angular_frequencies": wide[1],
        "errors": wide[2],
        "trivial": np.nan if exponents is None else exponents.trivial,
        "harmonics": point.motion.harmonics.count,
        "tail": point.motion.tail,
        "correction": point.cycle.correction,
        "iterations": point.cycle.iterations,
        "krylov": point.cycle.krylov,
        "arclength": point.arclength,
        "asked": point.asked,
        "leg": leg,
    }


def series_rows(number: int, motion: PeriodicMotion, size: int) -> dict[str, np.ndarray]:
    """The series of a cycle as rows of its table."""
    c = motion.coefficients
    return {"cycle": np.full(len(c), number), "q": c[:, :size], "inner": c[:, size:]}


def special_note(special: SpecialCycle, parameter: str, orbit: Orbit) -> dict[str, Any]:
    """Note that a record keeps of a bifurcation of the branch of cycles."""
    low, high = orbit.lip_extremes
    return {
        "kind": special.kind,
        "parameter": parameter,
        "value": special.value,
        "amplitude": 0.5 * (high - low),
        "frequency": special.point.motion.omega / (2 * np.pi),
        "perturbation_frequency": special.frequency,
        "located": special.located,
    }


def read_motion(record: Record, number: int) -> PeriodicMotion:
    """The motion of a cycle."""
    first = np.searchsorted(record.column(SERIES, "cycle"), number)
    count = int(record.value(CYCLES, "harmonics", number))
    rows = slice(first, first + 2 * count + 1)
    c = np.hstack([record.column(SERIES, "q")[rows], record.column(SERIES, "inner")[rows]])
    return PeriodicMotion(Harmonics(count), c, 2 * np.pi * float(record.value(CYCLES, "frequency", number)))


def read_points(record: Record, mu: dict, name: str, leg: int = 0) -> list[CyclePoint]:
    """Cycles of a leg that a record holds, that at which all start among them, for a branch to go on from; `name` is
    the parameter's among `mu`.
    """
    found = []
    for number in range(record.rows(CYCLES)):
        if number and record.value(CYCLES, "leg", number) != leg:
            continue
        value = {c.name: record.value(CYCLES, c.name, number) for c in COLUMNS}
        motion = read_motion(record, number)
        exponents = None
        if value["unstable"] >= 0:
            kept = np.isfinite(value["growth_rates"])
            numbers = (value["growth_rates"] + 1j * value["angular_frequencies"])[kept]
            exponents = Exponents(numbers, [], value["errors"][kept], float(value["trivial"]), motion.omega)
        spent = int(value["iterations"]), int(value["krylov"])
        cycle = Cycle(motion, mu | {name: float(value["value"])}, float(value["correction"]), *spent)
        length, asked = float(value["arclength"]), bool(value["asked"])
        found.append(CyclePoint(cycle, float(value["value"]), length, exponents, asked))
    return found


@dataclass(frozen=True, eq=False)
class LayerRanges:
    """Ranges over a period, means over each element."""

    names: tuple[str, ...]  #: Layers, inside to outside.
    strain: np.ndarray  #: (ne, nl); largest range of the five strains in the layer's axes, at its inner or outer face.
    stress: np.ndarray  #: (ne, nl), Pa; largest range of the five stresses there.
    #: (ne, nl), Pa; largest von Mises stress of the period, as `dbvfiv.shell.recovery.LayerFields` has it.
    von_mises: np.ndarray
    place: np.ndarray  #: (ne, 3), m; middles of the elements, at rest.

    def largest(self) -> list[dict[str, Any]]:
        """Largest ranges of strain and of stress of each layer, and their positions."""
        found = []
        for number, name in enumerate(self.names):
            strain, stress = self.strain[:, number], self.stress[:, number]
            at_strain, at_stress = int(np.argmax(strain)), int(np.argmax(stress))
            found.append(
                {
                    "layer": name,
                    "strain_range": float(strain[at_strain]),
                    "strain_position": self.place[at_strain].tolist(),
                    "stress_range": float(stress[at_stress]),
                    "stress_position": self.place[at_stress].tolist(),
                    "largest_von_mises": float(self.von_mises[:, number].max()),
                }
            )
        return found


def layer_ranges(orbit: Orbit) -> LayerRanges:
    """Ranges of strain and stress of a cycle."""
    shell = orbit.model.shell
    fields = [layer_fields(shell, q) for q in orbit.states]
    strain = np.stack([face_strains(shell, q) for q in orbit.states]).swapaxes(2, 3)  # faces before layers
    stress = point_stresses(shell.section, strain, shell.section.points_per_layer)
    return LayerRanges(
        fields[0].names,
        np.ptp(strain, axis=0).max(axis=(1, 3)),
        np.ptp(stress, axis=0).max(axis=(1, 3)),
        np.max([field.von_mises for field in fields], axis=0),
        shell.mesh.nodes[shell.mesh.quads].mean(axis=1),
    )


def rows_to_keep(known: Record, _case: Case) -> dict[str, int]:
    """Rows that a run goes on from: the series of the cycles whose rows vouch for them."""
    count = known.rows(CYCLES)
    return {CYCLES: count, SERIES: int((known.column(SERIES, "cycle") < count).sum())}


#: Distance of the second cycle from one of a file, over the range.
AWAY = 0.02


def run(session: Session, record: GrowingRecord) -> None:
    """Cycles along `cycle.over` of the case; every one is kept as it is found."""
    case = session.case
    check_periodic(session.model)
    record.begin("cycle", None)
    _say_again(record)
    walk = StabilityWalk(case, record, session.model)
    if case.cycle.start == "file":
        _from_file(case, walk, record)
    else:
        _from_onset(case, walk, record)
    record.progress("verdict on the steady state")
    try:
        verdict = walk.verdict(Mu.of(case))
    except SolveError as error:
        verdict = Verdict.undecided(str(error))
    record.note(VERDICT, **verdict.summary())
    record.warn(*walk.about_rubbers())


def _say_again(record: GrowingRecord) -> None:
    """Warn again of what an earlier attempt found and still holds."""
    for note in record.notes(MISSED):
        record.warn(note["text"])
    for note in record.notes(ENDED):
        if note.get("failure"):
            record.fail(note["failure"])
    if (record.column(CYCLES, "least_speed") < 0).any():
        record.warn(DRAWN_IN)


def _from_onset(case: Case, walk: StabilityWalk, record: GrowingRecord) -> None:
    axis = case.cycle.axis
    onset = find_onset(case, walk, record)
    if not record.notes("onset"):
        record.note("onset", value=onset.value, frequency=onset.eigenvalue.imag / (2 * np.pi))
    if record.notes(ENDED):
        return
    follower = Follower(case, walk, onset.place, axis.parameter, onset.spectrum)
    keeper = _Keeper(record, follower)
    known = read_points(record, onset.place.for_system(), follower.name)
    if record.notes(STEP):
        first = next((point for point in known if not point.asked), known[0])
        tracer = follower.tracer(axis.values, first.motion, keeper.keep)
        tracer.restore(known, follower.at_rest(onset))
    else:
        record.progress(f"first cycles, beside {axis.parameter} = {onset.value:.6g}")
        keeper.known = len(known)
        tracer, missed = follower.begin(onset, axis.values, keeper.keep, keeper.special())
        for sentence in missed:
            if sentence not in [note["text"] for note in record.notes(MISSED)]:
                record.note(MISSED, text=sentence)
            record.warn(sentence)
    keeper.follow(tracer)


def _from_file(case: Case, walk: StabilityWalk, record: GrowingRecord) -> None:
    """Down from the motion of the file, then up from there."""
    axis = case.cycle.axis
    given = given_motion(case, walk)
    record.progress(f"the cycle at {axis.parameter} = {given.value:.6g}")
    follower = Follower(case, walk, given.place, axis.parameter, walk.spectrum(given.place, MODES))
    ended = {note["leg"] for note in record.notes(ENDED)}
    low, high = axis.values[0], axis.values[-1]
    for leg, end in enumerate((low, high)):
        if leg in ended or given.value == end:
            continue
        keeper = _Keeper(record, follower, leg)
        known = read_points(record, given.place.for_system(), follower.name, leg)
        if not known:
            cycle = follower.near(given.motion, given.value)
            tracer = follower.tracer(axis.values, cycle.motion, keeper.keep)
            tracer.extend(cycle)
        else:
            tracer = follower.tracer(axis.values, known[0].motion, keeper.keep)
            tracer.restore(known)
        if len(tracer.points) < 2:
            step = np.clip(end - given.value, -AWAY * (high - low), AWAY * (high - low))
            try:
                second = follower.near(tracer.points[0].motion, float(given.value + step))
            except SolveError as error:
                keeper.end(tracer, Reason.NO_CYCLE(why=error))
                continue
            tracer.known = keeper.special()
            tracer.extend(second)
        keeper.follow(tracer)


DRAWN_IN = (
    "Fluid is drawn in during some cycles. Their flow has the law of outward flow, so they are not to be relied on; "
    "runs in time have a law for either way."
)


class _Keeper:
    """Keeps the cycles of a branch in a record as they are found."""

    def __init__(self, record: GrowingRecord, follower: Follower, leg: int = 0):
        self.record, self.follower, self.leg = record, follower, leg
        #: Of the cycles to come, how many the record holds already.
        self.known = 0
        self._tracer: CycleTracer | None = None

    def follow(self, tracer: CycleTracer) -> None:
        """Follow a leg to its end."""
        self._tracer, now = tracer, {"leg": self.leg, "cycles": self.record.rows(CYCLES)}
        steps = [note["step"] for note in self.record.notes(STEP) if now.items() <= note.items()]
        tracer.known = self.special()
        self.end(tracer, tracer.run(steps[-1] if steps else None))

    def special(self) -> list[tuple[str, float]]:
        """Kinds and values of the special points that the record holds."""
        return [(note["kind"], note["value"]) for note in self.record.notes(SPECIAL)]

    def end(self, tracer: CycleTracer, reason: Said) -> None:
        """Note why a leg ended."""
        failure = ""
        if reason.kind is Reason.NO_CYCLE:
            at = f"{self.follower.parameter} = {tracer.points[-1].value:.6g}"
            failure = f"At {at} the branch {reason.rstrip('.')}."
        self.record.note(ENDED, reason=reason, leg=self.leg, failure=failure)
        if failure:
            self.record.fail(failure)

    def keep(self, item: CyclePoint | SpecialCycle) -> None:
        """Keep a cycle, or a special point."""
        record, follower = self.record, self.follower
        if isinstance(item, SpecialCycle):
            record.note(SPECIAL, **special_note(item, follower.parameter, follower.orbit(item.point.cycle)))
            record.progress(f"{item.kind} at {follower.parameter} = {item.value:.6g}")
            return
        if self.known:
            self.known -= 1
            return
        orbit = follower.orbit(item.cycle)
        row = cycle_row(item, orbit, self.leg)
        # the series and the step first: the row vouches for them
        record.extend(SERIES, series_rows(record.rows(CYCLES), item.motion, orbit.model.size))
        if self._tracer is not None:
            record.note(STEP, leg=self.leg, cycles=record.rows(CYCLES) + 1, step=self._tracer.next_step)
        record.append(CYCLES, row)
        if row["least_speed"] < 0:
            record.warn(DRAWN_IN)
        record.item(SimpleNamespace(**row))


#: Steps of a period for ParaView.
STEPS = 24


class Point:
    """A cycle of a result.

    Attributes
    ----------
    The columns of `dbvfiv.studies.cycle.study.COLUMNS` by their names.
    """

    def __init__(self, result: CycleResult, number: int):
        self.result, self.number = result, number
        self.numbers = {c.name: result.record.value(CYCLES, c.name, number) for c in COLUMNS}
        vars(self).update(self.numbers)

    @property
    def stable(self) -> bool | None:
        """True where all perturbations of the model's symmetry decay; None where stability was not asked for."""
        return None if self.unstable < 0 else bool(self.unstable == 0)

    @property
    def exponents(self) -> np.ndarray:
        """Leading Floquet exponents, complex, 1/s."""
        kept = np.isfinite(self.growth_rates)
        return (self.growth_rates + 1j * self.angular_frequencies)[kept]

    @cached_property
    def orbit(self) -> Orbit:
        """The motion, over one period."""
        name = PARAMETERS[self.result.parameter].system_name or self.result.parameter
        mu = Mu.of(self.result.case).for_system() | {name: float(self.value)}
        return Orbit(self.result.models(mu), mu, read_motion(self.result.record, self.number))

    @cached_property
    def ranges(self) -> LayerRanges:
        """Ranges of strain and stress in the layers over a period."""
        return layer_ranges(self.orbit)

    def summary(self) -> dict[str, Any]:
        """Plain SI numbers for JSON."""
        names = (
            "value amplitude frequency lip_least lip_largest lip_mean flow_mean flow_amplitude least_speed harmonics "
            "tail correction trivial asked"
        ).split()
        plain = {name: np.asarray(self.numbers[name]).item() for name in names}
        found = [
            {"growth_rate": float(s.real), "angular_frequency": float(s.imag), "multiplier": [m.real, m.imag]}
            for s, m in zip(self.exponents, np.exp(self.exponents / self.frequency))
        ]
        return plain | {"stable": self.stable, "unstable_dimension": int(self.unstable), "exponents": found}


class CycleResult(RangeResult):
    """A branch of limit cycles, in the order in which they lie on it.

    Attributes
    ----------
    parameter : str
    points : tuple of Point
    special_points : list of dict
        Kind, value of the parameter, amplitude, frequencies of the cycle and of the perturbation, whether located.

    Examples
    --------
    >>> found = dbvfiv.load("cases/light-fluid.toml").cycle("density=25:60:8")      # doctest: +SKIP
    >>> [(p.value, p.amplitude, p.frequency, p.stable) for p in found.points]      # doctest: +SKIP
    """

    kind = "cycle"
    missed = "The branch could not be followed to the end of the range"

    @cached_property
    def points(self) -> tuple[Point, ...]:
        found = [Point(self, number) for number in range(self.record.rows(CYCLES))]
        return tuple([p for p in found if p.leg == 1][::-1] + [p for p in found if p.leg == 0])

    @cached_property
    def special_points(self) -> list[dict[str, Any]]:
        notes = self.record.notes(SPECIAL)
        return [{name: value for name, value in note.items() if name != "what"} for note in notes]

    @property
    def onset(self) -> dict[str, float] | None:
        """Value and frequency of the onset that the branch starts at."""
        notes = self.record.notes("onset")
        return {name: notes[-1][name] for name in ("value", "frequency")} if notes else None

    @property
    def verdict(self) -> Verdict:
        """Stability of the steady state of the case itself."""
        notes = self.record.notes(VERDICT)
        return Verdict.read(notes[-1]) if notes else Verdict.undecided("The run ended before it was looked at.")

    @property
    def reason(self) -> str:
        """Why the branch ended."""
        reasons = [note["reason"] for note in self.record.notes(ENDED)]
        return "; ".join(dict.fromkeys(reasons)) or "had not ended when the run did"

    @cached_property
    def models(self) -> Callable[[Mapping[str, float]], ValveModel]:
        """Models for parameters."""
        return models_of(self.case, self.model)

    def nearest(self, value: float | None = None) -> Point:
        """The cycle at the value nearest to one of the parameter; the last one without.

        Raises
        ------
        CaseError
            If there is no cycle.
        """
        if not self.points:
            raise CaseError("The run ended before the first cycle was found.")
        if value is None:
            return self.points[-1]
        return min(self.points, key=lambda point: abs(point.value - value))

    def summary(self) -> dict[str, Any]:
        return {
            "parameter": self.parameter,
            "points": [point.summary() for point in self.points],
            "special_points": self.special_points,
            "onset": self.onset,
            "verdict": self.verdict.summary(),
            "reason": self.reason,
            "fixed": fixed_conditions(self.case, self.parameter),
            **self.ending(),
        }

    def lines(self) -> list[str]:
        columns = _shown_columns(self.case)
        rows = [printed_row(columns, point) for point in self.points]
        return [f"At {describe_fixed(self.case, self.parameter)}:", *printed_head(columns), *rows, *self.remarks()]

    def remarks(self) -> list[str]:
        row, said = self._row, []
        if self.onset:
            at = row.text(self.onset["value"])
            said.append(f"The branch starts at the onset at {at}, {self.onset['frequency']:.4g} Hz.")
        for special in self.special_points:
            words = f"{special['kind']} at {row.text(special['value'])}, amplitude {1e3 * special['amplitude']:.4g} mm"
            if special["perturbation_frequency"]:
                words += f", perturbation at {special['perturbation_frequency']:.4g} Hz"
            said.append(words[0].upper() + words[1:] + ("." if special["located"] else ", not located closely."))
        said.append(f"The branch {self.reason.rstrip('.')}.")
        if self.points:
            said.append("Stable means: against perturbations that are symmetric as the model is.")
        return said

    def steps(self, valve: WholeValve, value: float | None = None) -> Sequence[Step]:
        """One period of the cycle nearest to a value of the parameter, or of the last one."""
        orbit = self.nearest(value).orbit if self.points else None
        if orbit is None:
            return ()
        found = []
        for k in range(STEPS + 1):
            q = orbit.motion.at([2 * np.pi * k / STEPS])[0, : orbit.model.size]
            points = motion(self.mesh, valve, orbit.model.nodal(q))
            found.append(Step(k / STEPS * orbit.motion.period, points, {"thickness": valve.cells(self.mesh.thickness)}))
        return found


def check(case: Case) -> None:
    """Refuse a range of what the case does not have."""
    check_range(case, case.cycle.axis.parameter)


def _shown_columns(case: Case) -> tuple[Column, ...]:
    """`COLUMNS` as they are printed, in the units of a case."""
    value = replace(COLUMNS[0], shown=show_parameter(case.units.parameter(case.cycle.axis.parameter)))
    return (value, *case.units.columns(COLUMNS[1:]))


STUDY = Study(
    "cycle", tables_of, run, CycleResult, check, rows_to_keep, live=lambda case: print_rows(_shown_columns(case))
)
