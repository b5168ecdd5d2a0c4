"""``dbvfiv info``, ``plot``, ``compare``, ``export``, ``cfd``, ``verdict``: results of earlier commands; series."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import CaseError
from ..observer import Progress
from ..texts import json_value
from .terminal import (
    AsJson,
    Override,
    PlotFolder,
    ResultFile,
    print_answer,
    print_either,
    print_json,
    print_written,
    refuse_beside,
    save_figures,
)

if TYPE_CHECKING:
    from ..studies.recognition import Recognition
    from ..studies.result import StudyResult
    from ..studies.state import State
    from ..verdict import JudgeOptions
    from ..verdict.reading import JudgedSignal, Reading, Signal

#: Kinds of figure files, of other files, and the surfaces and bodies of a state.
FigureFormat = StrEnum("FigureFormat", ["png", "svg"])
Format = StrEnum("Format", ["vtkhdf", "stl", "step"])
Shape = StrEnum("Shape", ["inner", "middle", "outer", "wall", "fluid"])
#: Kinds of results that can be compared.
_COMPARED = ("transient", "steady", "closure")
#: Half the 95 % interval of computed frequencies, %.
_WITHIN = 10.0


def info(
    file: ResultFile,
    as_json: AsJson = False,
    case: Annotated[bool, typer.Option("--case", help="Print the case it was computed from, as a case file.")] = False,
) -> None:
    """Summarise a result file: what was run, with which versions, and its numbers. Also while the run goes on."""
    from ..case.write import case_toml
    from ..studies.session import load_result

    result = load_result(file)
    header, mesh = result.header, result.mesh
    if as_json:
        names = ("kind", "name", "created", "program", "command", "layout", "versions")
        facts = {name: getattr(header, name) for name in names}
        facts["complete"] = result.complete
        around, along = mesh.shape
        facts["mesh"] = {"around": around, "along": along, "layers": list(mesh.layer_names)}
        asked = {"case": header.case.to_dict()} if case else {}  # of a design its summary has verdicts by that name
        print_json(facts | {"case": None} | result.summary() | asked)
    elif case:
        print(case_toml(header.case, comments=False), end="")
    else:
        print("\n".join(_describe(result)))


def _describe(result: Any) -> list[str]:
    header, (around, along) = result.header, result.mesh.shape
    drive, fluid = header.case.drive, header.case.fluid
    finished = "complete" if result.complete else "not complete: interrupted or still running"
    flow = f"{fluid.density:g} kg/m3, {fluid.continuity}"
    facts = (
        ("result", f"{header.kind} of {header.name}, {finished}"),
        ("written", f"{header.created} by {header.program}"),
        ("command", header.command),
        ("versions", ", ".join(f"{name} {version}" for name, version in header.versions.items() if name != "dbvfiv")),
        ("mesh", f"{around} around x {along} along, {len(result.mesh.nodes)} nodes"),
        ("layers", ", ".join(result.mesh.layer_titles()) + " (inside to outside)"),
        ("load", flow if drive.kind == "flow" else f"uniform pressure {drive.side}, no flow"),
    )
    settled = [result.record.settled] if result.record.settled else []
    said = [header.case.units.say(line) for line in (*result.lines(), *settled)]
    lines = [f"{name:<10}{value}" for name, value in facts] + ["", *said]
    notes = [("Warning", text) for text in result.warnings] + [("Failure", text) for text in result.failures]
    return lines + [""] * bool(notes) + [f"{kind}: {header.case.units.say(text)}" for kind, text in notes]


def plot(
    file: Annotated[
        Path, typer.Argument(metavar="RESULT.h5|CASE.toml", help="Result file of an earlier command, or a case file.")
    ],
    folder: Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="Folder for the figures.")] = Path("."),
    format: Annotated[FigureFormat, typer.Option("--format", help="File format.")] = FigureFormat.png,
    only: Annotated[
        list[str] | None, typer.Option("--only", metavar="NAME", help="Draw this figure; may be repeated.")
    ] = None,
    pressure: Annotated[
        str | None,
        typer.Option(
            "--pressure",
            "-p",
            metavar="P",
            help="Draw 3D view and layer stresses for the state nearest to this pressure.",
        ),
    ] = None,
    mode: Annotated[
        int | None, typer.Option("--mode", metavar="N", help="Draw centre line and shape of this mode only.")
    ] = None,
    animate: Annotated[
        list[int] | None,
        typer.Option(
            "--animate",
            metavar="N",
            help="Also write a GIF: of one cycle of mode N, or of the last N cycles of a transient; may be repeated.",
        ),
    ] = None,
    overrides: Override = None,
    as_json: AsJson = False,
) -> None:
    """Draw the figures of a result file; those of one state show the highest pressure unless --pressure is given.

    Of a case file: the valve with its measures, wall and layers, before anything is solved.
    """
    from ..api import load
    from ..case.axis import read_pressures
    from ..studies.session import load_result

    only, films = only or (), animate or ()
    if file.suffix.lower() == ".toml":
        why = f"goes with a result file; the picture of {str(file)!r} is that of its valve"
        refuse_beside({"--pressure": pressure, "--mode": mode, "--animate": films}, why)
        print_written(load(file, list(overrides or ())).plot(folder, format.value, only=only), as_json)
        return
    if overrides:
        raise CaseError(f"--set goes with a case file; {str(file)!r} is a result, whose case stays as it was.")
    result = load_result(file)
    choices: dict[str, object] = {}
    if pressure is not None:
        choices["pressure"] = read_pressures([pressure], "--pressure", result.case.fluid.density)[0]
    if mode is not None:
        choices["mode"] = mode
    makers = [_film(result, file, folder, number) for number in films]  # misuse shows before anything is drawn
    written = result.plot(folder, format.value, only=only, **choices)
    print_written([*written, *(make() for make in makers)], as_json)


def _film(result, file: Path, folder: Path, number: int) -> Callable[[], Path]:
    """Function that writes the animation that ``--animate`` asks of a result."""
    from ..studies.transient.figures import cycles_to_animate

    if result.kind == "modes":
        result.mode(number)
        return lambda: result.animate(folder / f"mode-{number}.gif", number)
    if result.kind == "transient":
        result.require_steps()
        duration = cycles_to_animate(result, number)
        frames = min(48 * number, 240)
        name = f"last-{number}-cycles.gif" if number > 1 else "last-cycle.gif" if result.cycle else "run.gif"
        return lambda: result.animate(folder / name, frames=frames, duration=duration)
    raise CaseError(
        f"The {result.kind} result {str(file)!r} does not move; --animate takes results of modes and transient."
    )


def compare(
    files: Annotated[
        list[Path],
        typer.Argument(
            metavar="RUN.h5 RUN.h5 ...",
            help="Result files of transient runs, of steady or of closure ones; or a measured record and one result of "
            "modes, cycle or transient.",
        ),
    ],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="FILE.png", help="Figure to write.")] = Path(
        "comparison.png"
    ),
    columns: Annotated[
        list[str] | None,
        typer.Option("--column", "-c", metavar="NAME", help="Of a record: column by name or number; may be repeated."),
    ] = None,
    within: Annotated[
        float,
        typer.Option("--within", metavar="%", help="Of a record: half the 95 % interval of computed frequencies."),
    ] = _WITHIN,
    as_json: AsJson = False,
) -> None:
    """Compare transient runs: their histories in one figure, their verdicts in one table; or steady runs: their head
    and discharge in one figure, the flows at the pressures of the first and what they differ by in one table; or
    closure runs: seal, force, displacement, passage and stiffness over the back pressure. Measured data that they name
    are in the figure, and what each is off by is told. Runs are named by the case keys that tell them apart.

    Or a measured record: which computed mode or cycle it is, with frequency and damping of both side by side.

    dbvfiv compare vibration.csv modes.h5 -c acceleration --within 10
    """
    from h5py import is_hdf5

    from ..studies.comparing import save_figure
    from ..studies.session import find_study, load_result

    if files[0].is_file() and not is_hdf5(files[0]):
        found = _recognise(files, columns or (), within)
        path = save_figure(found.draw, output, found.result.case.units)
        print_answer(found.document() | {"figure": str(path)}, lambda: [*found.lines(), f"Wrote {path}."], as_json)
        return
    within_given = {"--column": columns, "--within": within if within != _WITHIN else None}
    refuse_beside(within_given, "goes with a measured record, which is compared with one result")
    results = [load_result(file) for file in files]
    kind = results[0].kind
    for file, result in zip(files, results):
        if result.kind not in _COMPARED:
            raise CaseError(
                f"{str(file)!r} holds a result of kind {result.kind!r}; {', '.join(_COMPARED[:-1])} "
                f"and {_COMPARED[-1]} runs can be compared."
            )
        if result.kind != kind:
            raise CaseError(
                f"{str(file)!r} holds a result of kind {result.kind!r} and {str(files[0])!r} one of kind "
                f"{kind!r}; runs of one kind can be compared."
            )
    found = find_study(kind).compare(results)
    path = save_figure(found.draw, output, results[0].case.units)
    if as_json:  # summaries read whole files
        runs = [{"file": str(f), "label": n} | r.summary() for f, n, r in zip(files, found.labels, results)]
        print_json({"runs": runs, **found.document(), "figure": str(path)})
        return
    print("\n".join([*found.lines(), f"Wrote {path}."]))


def _recognise(files: list[Path], columns: Sequence[str], within: float) -> Recognition:
    """A measured record beside a result."""
    from ..studies.recognition import Recognition
    from ..studies.session import load_result
    from ..verdict.reading import PLAIN, Reading, judge_file

    if len(files) != 2:
        raise CaseError(
            f"{str(files[0])!r} is a measured record; it is compared with one result, as in "
            "`dbvfiv compare record.csv modes.h5`."
        )
    if not 0 < within < 100:
        raise CaseError(f"--within is {within:g}; it must be greater than 0 and less than 100.")
    measured = judge_file(files[0], Reading(columns, hints=PLAIN))
    return Recognition(measured, load_result(files[1]), 0.01 * within)


def life(
    file: ResultFile,
    value: Annotated[
        float | None,
        typer.Option("--at", metavar="VALUE", help="Of cycle: the cycle nearest to this value, SI; else the last."),
    ] = None,
    since: Annotated[
        float | None,
        typer.Option(
            "--since", metavar="T", help="Of a run: from this time on, s; else its last whole cycles, or all."
        ),
    ] = None,
    per_day: Annotated[
        float | None,
        typer.Option("--per-day", metavar="N", min=1e-6, help="How often it takes place in a day; else without pause."),
    ] = None,
    overrides: Override = None,
    plots: PlotFolder = None,
    as_json: AsJson = False,
) -> None:
    """Hours until a flaw in the rubber is a crack of life.crack under the motion of a result, and where: a limit cycle
    of `cycle`, a run of `transient` (with transient.save_every), or the way through the states of `closure` or
    `steady` and back, N times a day.

    dbvfiv life cycle.h5 --plots figures

    dbvfiv life closure.h5 --per-day 24 --set 'life.rubber="NR"'
    """
    from ..case.load import toml_value
    from ..studies.life import Life, motion_of
    from ..studies.session import load_result

    result, changes = load_result(file), {}
    for override in overrides or ():
        name, _, given = (part.strip() for part in override.partition("="))
        if not name.startswith("life."):
            raise CaseError(f"--set goes with keys of [life] here; {name!r} belongs to the motion, which is computed.")
        changes[name] = toml_value(given)
    case = result.case.replace(changes)
    found = Life(result, motion_of(result, value, since, per_day), case.life)
    figures = save_figures(found.figures(), plots)
    print_answer(found.document(), found.lines, as_json, (figures, plots))


def export(
    file: ResultFile,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            metavar="FILE|DIR",
            help="File ending in .vtkhdf, or a folder; beside the result without it. A folder for STL and STEP.",
        ),
    ] = None,
    quarter: Annotated[
        bool, typer.Option("--quarter", help="Only the part that was computed, not the whole valve.")
    ] = False,
    deformed: Annotated[
        bool, typer.Option("--deformed", help="Move the points; without it use 'Warp By Vector' along displacement.")
    ] = False,
    mode: Annotated[
        int | None,
        typer.Option("--mode", metavar="N", help="Of modes: one cycle of mode N, its phases as time steps in s."),
    ] = None,
    format: Annotated[
        Format, typer.Option("--format", help="Fields for ParaView; or one state as triangles (m), or for CAD (mm).")
    ] = Format.vtkhdf,
    shape: Annotated[
        list[Shape] | None,
        typer.Option("--shape", help="Of STL and STEP: this surface or closed body; may be repeated; all without it."),
    ] = None,
    pressure: Annotated[
        str | None,
        typer.Option(
            "--state", "-p", metavar="P", help="Of STL and STEP: the state nearest to this pressure; else the highest."
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Write a result as VTKHDF for ParaView: displacement, rotation, director; thickness, pressure, von Mises stress
    and stretch of each layer. Or one steady state as STL or STEP: inner face, mid-surface and outer face of the wall,
    the wall and the fluid inside as closed bodies.

    The states are the time steps of the file; the "time" that ParaView shows is the inlet pressure in Pa, of runs and
    cycles the time in s. Of modes it is the number of the mode: mode_real, mode_imag and mode_amplitude come with the
    displacement of the steady state; --mode N writes one cycle of that mode instead.
    """
    from ..studies.session import load_result

    if format is not Format.vtkhdf:
        refuse_beside({"--mode": mode, "--deformed": deformed}, "goes with fields for ParaView, --format vtkhdf")
        folder = file.parent if output is None else output
        state = _choose_state(file, pressure)
        print_written(state.export_shapes(folder, format.value, shape or (), quarter), as_json)
        return
    refuse_beside({"--shape": shape, "--state": pressure}, "goes with --format stl or step")
    result = load_result(file)
    choices = {} if mode is None else {"mode": mode}
    beside = file.with_suffix(".vtkhdf") if mode is None else file.with_name(f"{file.stem}-mode{mode}.vtkhdf")
    print_written(result.export(output if output is not None else beside, quarter, deformed, **choices), as_json)


def _choose_state(file: Path, pressure: str | None) -> State:
    """The steady state of a file nearest to a pressure ("36 kPa", "36kPa"), that of the highest without one."""
    from ..case.axis import read_pressures
    from ..studies.session import load_result

    result = load_result(file)
    if result.kind != "steady":
        raise CaseError(
            f"{str(file)!r} holds a result of kind {result.kind!r}; one of `dbvfiv steady` is needed, which has states."
        )
    if not result.states:
        raise CaseError(f"{str(file)!r} holds no state.")
    if pressure is None:
        return max(result.states, key=lambda state: state.pressure)
    return result.nearest(read_pressures([pressure], "--state", result.case.fluid.density)[0])


def cfd(
    file: ResultFile,
    folder: Annotated[
        Path,
        typer.Option("-o", "--output", metavar="DIR", help="Folder of the OpenFOAM case: new, or one to go on with."),
    ],
    pressure: Annotated[
        str | None,
        typer.Option("--state", "-p", metavar="P", help="The state nearest to this pressure; else the highest."),
    ] = None,
    pipe: Annotated[
        str | None,
        typer.Option(
            "--pipe",
            metavar="D|free",
            help="Inner diameter of the pipe that the valve stands in, such as '330 mm', or free; else as in the case.",
        ),
    ] = None,
    fineness: Annotated[
        float,
        typer.Option(
            "--fineness", min=0.3, max=3.0, help="Cells in each direction: 0.5 for 26 thousand, 1 for 207 thousand."
        ),
    ] = 0.5,
    iterations: Annotated[int, typer.Option("--iterations", min=1, help="At most this many, over all runs.")] = 400,
    run: Annotated[bool, typer.Option("--run/--no-run", help="Run OpenFOAM, or only write its case.")] = True,
    plots: PlotFolder = None,
    as_json: AsJson = False,
) -> None:
    """Viscous flow through the shape of a steady state, with its flow: a mesh of hexahedra of a quarter, 5 diameters of
    pipe before it and 12 behind, an OpenFOAM case (simpleFoam, k-omega SST), its run where OpenFOAM is installed, and
    pressures, recovery and force on the wall beside the one-dimensional law.

    dbvfiv cfd my.h5 --state "36 kPa" --pipe "330 mm" -o flow36 --plots figures
    """
    from ..cfd.comparison import FlowComparison, draw
    from ..cfd.foam import FlowCase, read_fields, run_openfoam
    from ..studies.steady.figures import is_published

    state = _choose_state(file, pressure)
    result = state.results
    if not state.volume_flow > 0:
        raise CaseError(f"Nothing flows in the state at {state.pressure:g} Pa of {str(file)!r}.")
    if result.case.gravity.is_there:
        raise CaseError(
            f"gravity.direction is {result.case.gravity.direction!r}, and the flow in three dimensions has no levels; "
            "take a state of the case with 'none'.",
            key="gravity.direction",
        )
    width = result.case.downstream.pipe_diameter if pipe is None else _read_diameter(pipe)
    density = state.mass_flow / state.volume_flow
    viscosity = _viscosity(result.case.fluid.dynamic_viscosity, density)
    case = FlowCase(result.header.name, result.mesh, state, density, width, fineness, iterations, viscosity)
    case.write(folder)
    if not run:
        count = len(case.cells.cells)
        told = f"Wrote {folder}: {count} cells; run Allrun in it."
        print_either({"written": str(folder), "cells": count}, [told], as_json)
        return
    run_openfoam(folder, iterations, Progress(quiet=as_json))
    published = is_published(result.case)
    found = FlowComparison(case, read_fields(folder, len(case.cells.cells)), published)
    (folder / "comparison.json").write_text(json.dumps(json_value(found.document()), indent=1) + "\n")
    figures = save_figures(dict(draw(found)), plots)
    print_answer(found.document(), found.lines, as_json, (figures, plots), folder)


def _viscosity(dynamic: float, density: float) -> float:
    """Kinematic viscosity, m2/s, of a fluid of a density, kg/m3; of a liquid without one, 0 Pa s, that of water."""
    from ..case.physics import LIQUID
    from ..cfd.foam import WATER_VISCOSITY

    if not dynamic and density < LIQUID:
        raise CaseError(
            f"fluid.viscosity is 'none' in a fluid of {density:.4g} kg/m3, a gas, whose flow in three dimensions needs "
            "one; take a state of the case with 'air', or with that of the gas.",
            key="fluid.viscosity",
        )
    return dynamic / density or WATER_VISCOSITY


def _read_diameter(text: str) -> float | None:
    """Diameter of a pipe, m; None for a free jet."""
    from ..case.pipes import Downstream
    from ..case.quantity import number_or_text

    if text.strip().lower() == "free":
        return None
    try:
        return Downstream(pipe_diameter=number_or_text(text)).pipe_diameter
    except ValueError:
        raise CaseError(
            f"--pipe is given as {text!r}; it must be a length greater than 0 and at most 100 m, such as '330 mm', or "
            "free."
        ) from None


def verdict(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE", help="CSV with a column of times and others of values, or the result of a transient run."
        ),
    ],
    columns: Annotated[
        list[str] | None,
        typer.Option(
            "--column", "-c", metavar="NAME", help="Column by name or number from 1; may be repeated; all by default."
        ),
    ] = None,
    time: Annotated[
        str | None,
        typer.Option("--time", metavar="NAME", help="Column of the times, by name or number; the first without it."),
    ] = None,
    rate: Annotated[
        float | None, typer.Option("--rate", metavar="HZ", help="Sampling rate, where no column holds times.")
    ] = None,
    time_unit: Annotated[
        str | None,
        typer.Option(
            "--time-unit", metavar="U", help="Unit of the times: s, ms, us, ns, min, h; else as the header says."
        ),
    ] = None,
    skip_bad: Annotated[
        bool, typer.Option("--skip-bad", help="Leave out rows that hold no number, and say how many.")
    ] = False,
    since: Annotated[
        float | None, typer.Option("--since", metavar="T", help="Leave out what comes before this time, s.")
    ] = None,
    until: Annotated[
        float | None, typer.Option("--until", metavar="T", help="Leave out what comes after this time, s.")
    ] = None,
    detrend: Annotated[
        bool, typer.Option("--detrend/--no-detrend", help="Take a drifting level off a measured record.")
    ] = True,
    steady: Annotated[
        float, typer.Option("--steady", metavar="X", help="Relative change below which a signal is steady.")
    ] = 1e-4,
    closed_below: Annotated[
        float | None, typer.Option("--closed-below", metavar="X", help="Level below which a signal counts as closed.")
    ] = None,
    plots: Annotated[
        Path | None, typer.Option("--plots", metavar="DIR", help="Draw each signal and its spectrum into this folder.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Judge any time series: steady, decaying, limit cycle, growing, closed or irregular, with period, amplitude,
    harmonics, RMS, extremes, spectrum. Times are seconds unless the header says otherwise, as in "time [ms]", or dates.

    Of a measured record oscillations are told from noise, drift and mains: rings that decayed, several lines,
    modulation; frequency, amplitude and damping ratio with 95 % intervals.

    dbvfiv verdict pressure.csv --column 2 --plots figures
    """
    import h5py

    from ..drawing.signal import save_signals
    from ..verdict import JudgeOptions
    from ..verdict.reading import Reading, judge_file

    reading = Reading(columns or (), time or "", rate, time_unit, skip_bad, since, until, detrend)
    if not 0 < steady < 1:
        raise CaseError(f"--steady is {steady:g}; it must be greater than 0 and less than 1.")
    if closed_below is not None and not math.isfinite(closed_below):
        raise CaseError(f"--closed-below is {closed_below:g}; it must be finite.")
    options = JudgeOptions(steady=steady)
    refuse_beside({"--time": time, "--time-unit": time_unit} if rate else {}, "says what --rate says too")
    if file.is_file() and h5py.is_hdf5(file):
        of_table = {"--time": time, "--rate": rate, "--time-unit": time_unit, "--skip-bad": skip_bad}
        refuse_beside(of_table | {"--no-detrend": not detrend}, "goes with a measured record")
        judged = _judged_run(file, reading, options, closed_below)
    else:
        judged = judge_file(file, reading, options, closed_below)
    figures = [] if plots is None else save_signals(plots, judged)
    lines = [line for each in judged for line in each.lines()] + [f"Wrote {figure}." for figure in figures]
    print_either({"signals": [each.summary() for each in judged]}, lines, as_json)


def _judged_run(file: Path, reading: Reading, options: JudgeOptions, closed_below: float | None) -> list[JudgedSignal]:
    """Signals of a transient run, where nothing else is asked for as the run itself is judged."""
    from ..studies.session import load_result
    from ..verdict import JudgeOptions
    from ..verdict.reading import judge_signals

    result = load_result(file)
    if result.kind != "transient":
        raise CaseError(f"{str(file)!r} holds a result of kind {result.kind!r} and no time series.")
    signals, own = _signals_of_run(result, reading.columns), {}
    if (reading.since, reading.until, closed_below, options) == (None, None, None, JudgeOptions()):
        signals = [signal.between(result.judged_from, float("inf")) for signal in signals]
        own = {name: told for name, told in result.verdict.items() if isinstance(told, dict) and "verdict" in told}
    judged = judge_signals(file, signals, reading, options, closed_below)
    return [each.named_by(own[each.signal.name]) if each.signal.name in own else each for each in judged]


def _signals_of_run(result: StudyResult, columns: Sequence[str]) -> list[Signal]:
    """Signals of a transient run."""
    from ..verdict.reading import Signal

    known = [name for name, values in result.history.items() if values.ndim == 1]
    names = list(columns) or ["mass_flow", "lip_opening"]
    names = [known[int(name) - 1] if name.isdigit() and 0 < int(name) <= len(known) else name for name in names]
    for name in names:
        if name not in known:
            raise CaseError(f"The run has no column {name!r}; it has {', '.join(known)}.")
    return [Signal(name, result.history["time"], result.history[name], measured=False) for name in names]
