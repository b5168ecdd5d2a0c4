"""``dbvfiv report``, ``reproduce`` and ``app``: pages for people, of one valve, of the thesis and in the browser."""

from __future__ import annotations

import os
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import typer

from ..errors import CaseError, SolveError
from ..observer import Progress
from .terminal import AsJson, CaseFile, Override, Stopped, in_units, print_either, print_json


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
    pdf: Annotated[bool, typer.Option("--pdf", help="Also print it to a PDF beside the page.")] = False,
    workers: Annotated[
        int | None,
        typer.Option(
            "--workers", min=1, max=64, help="Processes that share the studies; one a processor, at most four."
        ),
    ] = None,
    without: Annotated[
        list[str] | None,
        typer.Option(
            "--without",
            metavar="PART",
            help="Leave out steady, heads, pipe, onset, law, mesh, levels, closure, chance or cycle; may be repeated.",
        ),
    ] = None,
    cycle: Annotated[
        bool, typer.Option("--cycle", help="Also follow the limit cycle where the valve chatters; takes minutes.")
    ] = False,
    overrides: Override = None,
    as_json: AsJson = False,
) -> None:
    """A report on one page: does the valve open, chatter, close and seal at its heads, and how sure is each answer?

    The heads are report.heads of the case, the back pressures go up to 1.5 times closure.rated_pressure.

    dbvfiv report my.toml -o my.html --pdf
    """
    from ..doctor import processors
    from ..studies.case import load_case, require_consistent

    if output is not None and output.suffix.lower() == ".pdf":
        raise CaseError(
            f"-o is given as {str(output)!r}, and the page is HTML; give -o {output.stem}.html --pdf for both."
        )
    if output is not None and (not output.suffix or output.is_dir()):
        raise CaseError(
            f"-o is given as {str(output)!r}, which names a folder; the page is a file, {output.name}.html."
        )
    if output is not None and output.suffix.lower() not in (".html", ".htm"):
        raise CaseError(
            f"-o is given as {str(output)!r}, and the page is HTML; give a name such as {output.stem}.html."
        )
    case = load_case(case_file, overrides or ())
    require_consistent(case)
    from ..report import (
        find_printers,
        gather,
        write_page,
        write_pdf,
    )  # drawing libraries, which a mistake need not wait for
    from ..report.answers import answers
    from ..report.gather import PARTS

    for name in without or ():
        if name not in PARTS:
            raise CaseError(f"--without is given as {name!r}, which is none of {', '.join(PARTS)}.")
    if pdf:
        find_printers()  # before anything is solved
    name = case_file.stem if case_file else "dbv12"
    page = output or Path(f"{name}-report.html")
    leave_out = (*(without or ()), *(() if cycle else ("cycle",)))
    folder = runs or page.with_suffix("")
    with in_units(case.units):
        try:
            found = gather(case, name, folder, leave_out, workers or min(4, processors()), as_json)
        except KeyboardInterrupt:
            raise Stopped(f"the same command goes on with what was found before, in {folder}") from None
    write_page(found, page)
    answered = answers(found)
    if as_json:
        said = [one.summary() for one in answered]
        print_json({"page": str(page), "answers": said, "missing": found.missing})
    else:
        for one in answered:
            print(found.case.units.say(f"{one.question} {one.answer.capitalize()}. {one.text}"))
            if one.margin:
                print(f"  margin: {one.margin}")
        print(f"{found.seconds:.0f} s of processor time. {page} written.")
    if pdf:  # the answers are out, whatever the browser does
        printed = write_pdf(page, page.with_suffix(".pdf"))
        if not as_json:
            print(f"{printed} written.")
    failed = found.failed
    if failed:
        said = "; ".join(f"no result of {name}: {why.rstrip('.')}" for name, why in failed.items()) + "."
        raise SolveError(case.units.say(said))


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
        entries = [{"name": e.name, "label": e.label, "title": e.title} for e in chosen]
        print_either({"entries": entries}, (f"{e.name:>5}  {e.label}: {e.title}" for e in chosen), as_json)
        return
    workshop = Workshop(folder / ("quick" if quick else "full"), quick, Progress(quiet=as_json))
    page = folder / f"thesis{'-quick' if quick else ''}.html"
    done, parts, failures = [], [], []
    for entry in chosen:
        try:
            outcome = entry.make(workshop)
        except SolveError as error:
            failures.append(f"{entry.label}: {error}")
            continue
        parts.append(entry.part(outcome))
        write_parts(page, "The thesis, figure by figure", workshop.setting, parts)
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


def app(
    file: Annotated[
        Path | None,
        typer.Argument(metavar="[CASE|RESULT.h5]", help="Case file to begin with, or a result, whose case it is."),
    ] = None,
    folder: Annotated[
        Path | None,
        typer.Option("--folder", metavar="DIR", help="Folder of valves and runs; the user's data without it."),
    ] = None,
    host: Annotated[
        str, typer.Option("--host", help="Address to serve; others than this machine reach it only with a password.")
    ] = "127.0.0.1",
    port: Annotated[int, typer.Option("--port", min=0, max=65535, help="Port; a free one without it.")] = 0,
    runs: Annotated[int, typer.Option("--runs", min=1, max=16, help="Runs at a time; others wait.")] = 1,
    browse: Annotated[bool, typer.Option("--browse", help="Also open the page in a browser.")] = False,
) -> None:
    """The valve in the browser: describe it, ask it with sliders, see curves and maps, run studies and the report.

    dbvfiv app my.toml

    The password for --host is asked for, or taken from DBVFIV_APP_PASSWORD.
    """
    if find_spec("nicegui") is None:
        raise CaseError("The page needs NiceGUI, which is not installed; `pip install 'dbvfiv[app]'` brings it.")
    import platformdirs

    from ..app.server import Site, is_local, serve
    from ..studies.case import load_case

    if file is not None and file.suffix.lower() != ".h5":
        load_case(file)  # a mistake is told before anything is served
    password = ""
    if not is_local(host):
        password = os.environ.get("DBVFIV_APP_PASSWORD") or typer.prompt("Password for the page", hide_input=True)
    home = folder or Path(platformdirs.user_data_dir("dbvfiv")) / "app"

    def tell(text: str) -> None:
        print(text, flush=True)
        if browse:
            typer.launch(text.split()[4])

    serve(Site(home.resolve(), file and file.resolve(), runs), host, port, password, tell)
