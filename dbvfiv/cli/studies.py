"""Commands of the studies, each with its own options and what all share; an interrupted run continued."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Annotated, Any, get_type_hints

import typer

from ..errors import CaseError, SolveError
from ..observer import Progress
from ..studies import KINDS
from ..studies.request import AnimationOption, Request, changed_keys, is_sheet
from .terminal import (
    AsJson,
    CaseFile,
    Output,
    Override,
    PlotFolder,
    ResultFile,
    Stopped,
    in_units,
    print_answer,
    print_figures,
)

#: Arguments that the command of a study may take from those that all share.
_SHARED = ("case", "plots", "output")


def study_commands() -> list[tuple[str, Callable[..., None]]]:
    """Names and commands of all studies, in the order of their help."""
    modules = [(kind, import_module(f"..studies.{kind}", __package__)) for kind in KINDS]
    modules.sort(key=lambda found: (getattr(found[1], "ORDER", 100), found[0]))
    return [(kind, _make_command(kind, module)) for kind, module in modules]


def _make_command(kind: str, module: ModuleType) -> Callable[..., None]:
    """A command with the options of a study between the case file and what all studies share."""
    hints = get_type_hints(module.command, include_extras=True)
    asked = inspect.signature(module.command).parameters
    own = [p for name, p in asked.items() if name not in _SHARED]

    def command(
        case_file: Path | None, output: Path | None, plots: Path | None, overrides, as_json: bool, **given: Any
    ) -> None:
        from ..studies.case import load_case

        case = load_case(case_file, overrides or ())
        shared = {"case": case, "plots": plots, "output": output}
        request = module.command(**{name: shared[name] for name in _SHARED if name in asked}, **given) or Request()
        request = replace(request, changes=changed_keys(kind, module.Keys, given) | request.changes)
        ranges = [text for text in map(given.get, ("over", "x", "y")) if text and text.startswith("pressure=")]
        case = _in_units_asked(case, given.get("pressures") or [given.get("pressure")] + ranges)
        perform(kind, case, request, case_file.stem if case_file else "dbv12", output, plots, as_json)

    shared_last = (("output", Output, None), ("plots", PlotFolder, None), ("overrides", Override, None))
    parameters = [
        _parameter("case_file", CaseFile, None),
        *(p.replace(annotation=hints[p.name], kind=p.KEYWORD_ONLY) for p in own),
        *(_parameter(*one) for one in shared_last),
        _parameter("as_json", AsJson, False),
    ]
    command.__signature__ = inspect.Signature(parameters)
    command.__annotations__ = {p.name: p.annotation for p in parameters}
    command.__doc__ = module.command.__doc__
    return command


def _parameter(name: str, annotation: Any, default: Any) -> inspect.Parameter:
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=annotation)


def _in_units_asked(case, pressures):
    """The case, read in the unit in which the command line has its pressure."""
    from ..case.units import unit_of, with_pressure_in

    unit = next(filter(None, map(unit_of, pressures)), "")
    if unit in ("", case.units.name("pressure")):
        return case
    return case.replace({"project.units": with_pressure_in(case.project.units, unit)})


def perform(kind: str, case, request, name: str, output: Path | None, plots: Path | None, as_json: bool) -> None:
    """Run a study on a case with what its command asks for (a `Request`), and report it."""
    from ..case.units import read_units, with_pressure_in
    from ..record.files import refuse_read
    from ..studies.session import Session, find_study

    if is_sheet(output) and request.sheet is None:
        raise CaseError(
            f"{str(output)!r} names a sheet, which `dbvfiv steady` writes alone; -o of {kind} takes a .h5 file."
        )
    changes = dict(request.changes)
    if units := changes.pop("project.units", None):
        pressure, case = case.units.name("pressure"), case.replace({"project.units": units})
        if pressure != "kPa" and not {"head", "pressure"} & read_units(units).keys():
            case = case.replace({"project.units": with_pressure_in(units, pressure)})
    choices = {key: value for key, value in request.choices.items() if value is not None}
    session = Session(case, name).prepared(kind, changes)
    if request.sheet is not None:  # a result is checked by its session
        refuse_read(session.case, output, "The sheet")
    units = session.case.units  # heads are those of the fluid that is asked for
    with in_units(units):
        session.mesh  # a case that gives no model fails before a table begins
        live = None if as_json else find_study(kind).live
        progress = Progress(quiet=as_json, row=live and live(session.case), say=units.say)
        result = session.perform(kind, output if request.sheet is None else None, progress, **choices)
        found = [result]
        if request.sheet is not None:
            try:
                for variant in request.variants:
                    if found[-1].interrupted:
                        break
                    found.append(session.replace(variant).perform(kind, None, progress, **choices))
            finally:  # what was found is kept
                request.sheet(found)
        _report(result, output, plots, as_json, further=request.further, printed=live is not None, others=found[1:])


def resume(
    file: ResultFile,
    duration: Annotated[
        str | None, typer.Option("--duration", metavar="T", help="New end of the run, 2.0 (s) or '500 ms'.")
    ] = None,
    plots: PlotFolder = None,
    animate: AnimationOption = None,
    workers: Annotated[
        str | None,
        typer.Option("--workers", "-w", "--on", metavar="N|ADDRESS", help="Of maps and samples: who shares them."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Continue a run that was interrupted or killed in its file, or a finished transient run with a later --duration.

    The numbers are those of a run that was never interrupted: a transient run goes on from its last restart point, a
    map solves the columns that are missing in it, an onset run the values, steady and closure runs the pressures.
    """
    from ..api import resume
    from ..case.quantity import Quantity, number_or_text
    from ..record.files import kind_of
    from ..studies.session import load_result

    kind = kind_of(file)
    if animate is not None and kind != "transient":
        raise CaseError(f"--animate belongs to transient runs; {str(file)!r} is of kind {kind!r}.")
    end = None
    if duration is not None:
        try:
            end = Quantity("s", "s").parse(number_or_text(duration))
        except ValueError as error:
            raise CaseError(f"--duration is given as {duration!r}, {error}.") from None
    units = load_result(file).case.units
    with in_units(units):
        result = resume(file, duration=end, workers=workers, observer=Progress(quiet=as_json, say=units.say))
        films = animate is not None and result.drawable
        _report(result, file, plots, as_json, further=(lambda run: [run.animate(animate)]) if films else None)


def _report(
    result: Any,
    output: Path | None,
    plots: Path | None,
    as_json: bool,
    further: Callable[[Any], list[Path]] | None = None,
    printed: bool = False,
    others: Sequence[Any] = (),
) -> None:
    """Print a result, draw it, and leave with the exit status that it and others of its sheet deserve. Raises Stopped
    if a run was interrupted. Raises SolveError if something was not reached.

    Parameters
    ----------
    further : callable, optional
        Writes further files.
    printed : bool
        True where its table was printed row by row already.
    others : sequence of StudyResult
    """

    def draw() -> list[Path]:
        figures = result.plot(plots) if plots is not None and result.drawable else []
        return figures + (further(result) if further else [])

    def lines() -> list[str]:
        lines = [*(result.remarks() if printed else result.lines()), *filter(None, [result.record.settled])]
        return [result.case.units.say(line) for line in lines]

    document = result.summary() | {"output": str(output) if output else None} if as_json else {}
    figures: list[Path] = []
    try:  # what was found is told where a figure fails
        figures = draw() if as_json else []
    finally:
        print_answer(document, lines, as_json, (figures, plots), output)
    if not as_json:
        print_figures(draw(), plots)
    results = [result, *others]
    if any(each.interrupted for each in results):
        kept = f"what was finished before has been kept in {output}"
        raise Stopped(kept if output else "nothing was kept, as no -o was given")
    missed = [clause for each in results if (clause := each.shortfall()) is not None]
    if missed:
        raise SolveError(f"{'; '.join(missed)}.")  # why was said when it happened
