"""``dbvfiv report`` and ``reproduce``: pages for people, of one valve and of the thesis."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from ..errors import CaseError, SolveError
from ..observer import Progress
from .terminal import AsJson, CaseFile, Override, print_json


def report(
    case_file: CaseFile = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="PAGE.html", help="The page; CASE-report.html without it.")
    ] = None,
    runs: Annotated[
        Path | None,
        typer.Option(
            "--runs", metavar="DIR", help="Folder for the results that it rests on; beside the page without it."
        ),
    ] = None,
    cells: Annotated[int, typer.Option("--cells", min=4, max=200, help="Values along each axis of the map.")] = 20,
    workers: Annotated[int, typer.Option("--workers", min=1, max=1024, help="Processes that share the map.")] = 1,
    without: Annotated[
        list[str] | None,
        typer.Option(
            "--without",
            metavar="RUN",
            help="Leave out steady, modes, classes, onset, map, cycle or closure; may be repeated.",
        ),
    ] = None,
    overrides: Override = None,
    as_json: AsJson = False,
) -> None:
    """One HTML page: how far the valve opens, whether it vibrates, whether it shuts, and how far to trust each answer.

    dbvfiv report my.toml -o my.html
    """
    from ..report import Runs, gather, write_page
    from ..report.gather import RUNS
    from ..report.page import answers
    from ..studies.case import load_case

    for name in without or ():
        if name not in RUNS:
            raise CaseError(f"--without is given as {name!r}, which is none of {', '.join(RUNS)}.")
    case = load_case(case_file, overrides or ())
    name = case_file.stem if case_file else "dbv12"
    page = output or Path(f"{name}-report.html")

    def observe(kind: str) -> Progress:
        if not as_json:
            print(f"{kind} ...", file=sys.stderr, flush=True)
        return Progress(quiet=as_json)

    wanted = Runs(cells=cells, workers=workers, leave_out=tuple(without or ()))
    found = gather(case, name, runs or page.with_suffix(""), wanted, observe)
    write_page(found, page)
    answered = answers(found)
    if as_json:
        said = [{"question": question, "sentences": sentences} for question, sentences in answered]
        print_json({"page": str(page), "answers": said, "missing": found.missing})
    else:
        for question, sentences in answered:
            print("\n".join([question, *(f"  {line}" for line in sentences if line)]))
        print(f"Page in {page}.")
    failed = [f"no result of {kind}: {why}" for kind, why in found.missing.items() if kind not in found.not_asked]
    if failed:
        raise SolveError("; ".join(failed))


def reproduce(
    figures: Annotated[
        list[str] | None, typer.Argument(metavar="[FIGURE ...]", help="Figures and tables, 7-4 or T3-5; all without.")
    ] = None,
    folder: Annotated[
        Path, typer.Option("-o", "--output", metavar="DIR", help="Folder for the page and the runs.")
    ] = Path("out/thesis"),
    quick: Annotated[
        bool, typer.Option("--quick", help="Coarse mesh and short histories: for a look, not for the numbers.")
    ] = False,
    listing: Annotated[bool, typer.Option("--list", help="Only say which there are.")] = False,
    as_json: AsJson = False,
) -> None:
    """The thesis's figures and tables made again: ours, the published number, the difference, and what it means.

    dbvfiv reproduce 7-4 7-11 -o out/thesis
    """
    from ..report import write_parts
    from ..thesis import Workshop, choose_entries

    chosen = choose_entries(figures or ())
    if listing:
        if as_json:
            print_json({"entries": [{"name": e.name, "label": e.label, "title": e.title} for e in chosen]})
        else:
            print("\n".join(f"{e.name:>5}  {e.label}: {e.title}" for e in chosen))
        return
    workshop = Workshop(folder / ("quick" if quick else "full"), quick, Progress(quiet=as_json))
    page = folder / "thesis.html"
    done, parts, failures = [], [], []
    for entry in chosen:
        try:
            outcome = entry.make(workshop)
        except SolveError as error:
            failures.append(f"{entry.label}: {error}")
            continue
        parts.append(entry.part(outcome))
        write_parts(page, "The thesis, figure by figure", workshop.setting, (), parts)
        numbers = [number.summary() for number in outcome.numbers]
        done.append({"name": entry.name, "title": entry.title, "numbers": numbers, "sentences": outcome.sentences})
        if not as_json:
            print("\n".join(entry.lines(outcome)), flush=True)
    if as_json:
        print_json({"page": str(page), "quick": quick, "entries": done, "failures": failures})
    elif parts:
        print(f"Page in {page}.")
    if failures:
        raise SolveError(" ".join(failures))
