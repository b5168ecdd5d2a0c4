"""Storage of cycles in a record, and their restart."""

from __future__ import annotations

from typing import Any

import numpy as np

from continuation.cycle_points import CyclePoint, SpecialCycle
from continuation.cycles import Cycle
from continuation.harmonics import Harmonics
from continuation.hill import Exponents
from continuation.periodic import PeriodicMotion

from ...record.mesh import MeshData
from ...record.record import Record
from ...record.table import Column, Shown, TableSpec
from ..orbits.orbit import Orbit

CYCLES, SERIES, SPECIAL, ENDED, VERDICT = "cycles", "series", "special", "ended", "verdict"
#: Floquet exponents kept of each cycle.
KEPT = 20

COLUMNS = (
    Column("value", "SI", "Value of the parameter", shown=Shown("value", "SI", 12, lambda r: f"{r.value:.6g}")),
    Column(
        "amplitude",
        "m",
        "Half the swing of the displacement in y of one lip at x = z = 0",
        shown=Shown("amplitude", "mm", 10, lambda r: f"{1e3 * r.amplitude:.4f}"),
    ),
    Column("frequency", "Hz", "Frequency", shown=Shown("frequency", "Hz", 10, lambda r: f"{r.frequency:.4f}")),
    Column(
        "lip_least", "m", "Least displacement", shown=Shown("lip from", "mm", 9, lambda r: f"{1e3 * r.lip_least:.3f}")
    ),
    Column(
        "lip_largest", "m", "Largest displacement", shown=Shown("to", "mm", 9, lambda r: f"{1e3 * r.lip_largest:.3f}")
    ),
    Column("lip_mean", "m", "Mean displacement"),
    Column(
        "flow_mean", "kg/s", "Mean mass flow at the lip", shown=Shown("flow", "kg/s", 9, lambda r: f"{r.flow_mean:.4f}")
    ),
    Column("flow_amplitude", "kg/s", "Half the swing of the mass flow at the lip"),
    Column("least_speed", "m/s", "Least speed of the fluid at any row; below zero where it is drawn in"),
    Column(
        "unstable",
        "",
        "Dimension in which perturbations grow; -1 where it was not asked for",
        "i8",
        Shown("stable", "", 7, lambda r: {0: "yes", -1: "?"}.get(int(r.unstable), "no")),
    ),
    Column("growth_rates", "1/s", "Of the leading Floquet exponents; NaN where there are fewer"),
    Column(
        "leading",
        "1/s",
        "Growth rate of the leading one",
        shown=Shown("leading", "1/s", 9, lambda r: f"{r.leading:.3g}"),
    ),
    Column("angular_frequencies", "rad/s", "Of the leading Floquet exponents, from 0 to half that of the cycle"),
    Column("errors", "", "Share of each perturbation that the full equations miss"),
    Column("trivial", "1/s", "Size of the exponent of a shift in time, zero but for errors"),
    Column("harmonics", "", "Harmonics of the series", "i8", Shown("harm.", "", 6, lambda r: str(int(r.harmonics)))),
    Column(
        "tail", "", "Share of the motion that the last two hold", shown=Shown("tail", "", 8, lambda r: f"{r.tail:.1g}")
    ),
    Column("correction", "", "Last correction over the motion"),
    Column("iterations", "", "Corrections", "i8"),
    Column("krylov", "", "Krylov iterations", "i8"),
    Column("arclength", "", "Along the branch"),
    Column("asked", "", "Whether the value is one of those asked for", "bool"),
    Column(
        "leg", "", "1 on the way up from a start within the range, after the way down from there; 0 elsewhere", "i8"
    ),
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
    wide = dict.fromkeys(("growth_rates", "angular_frequencies", "errors"), (KEPT,))
    return TableSpec(CYCLES, COLUMNS, wide), TableSpec(SERIES, _SERIES, series)


def cycle_row(point: CyclePoint, orbit: Orbit, leg: int) -> dict[str, Any]:
    """A cycle of a leg of the branch as a row of its table."""
    flow, speeds = orbit.flow
    low, high = orbit.lip_extremes
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
        "flow_amplitude": 0.5 * float(np.ptp(flow)),
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
