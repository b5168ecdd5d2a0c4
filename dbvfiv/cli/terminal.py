"""Arguments that commands share, and how they print: JSON, lines for people, progress."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer

from ..case.units import Units
from ..errors import CaseError, SolveError
from ..studies.request import is_sheet
from ..texts import json_value

#: Suffixes that promise another format than that of result files.
OTHER_FORMATS = (".json", ".toml", ".html", ".pdf", ".png", ".svg", ".vtkhdf")


def _writable(path: Path | None) -> Path | None:
    """Refuse a name that cannot be written, or promises another format, before anything is computed."""
    from ..record.files import check_writable

    if path is not None and path.suffix.lower() in OTHER_FORMATS:
        raise CaseError(
            f"--output {str(path)!r} would be an HDF5 file; name it '{path.stem}.h5', and ask for JSON by --json, for "
            "figures by --plots, for fields by `dbvfiv export`."
        )
    if path is not None and not is_sheet(path):
        check_writable(path)
    return path


def _folder(path: Path | None) -> Path | None:
    """Refuse a name for figures that is taken by a file, or cannot be written, before anything is computed."""
    if path is None:
        return None
    from ..record.files import check_folder

    if path.exists() and not path.is_dir():
        raise CaseError(f"--plots {str(path)!r} is a file and not a folder.")
    try:
        check_folder(path.absolute())
    except OSError as error:
        raise CaseError(f"--plots {str(path)!r} cannot be written ({error.strerror}).") from None
    return path


CaseFile = Annotated[Path | None, typer.Argument(metavar="[CASE]", help="Case file; the 12-inch valve without one.")]
ResultFile = Annotated[Path, typer.Argument(metavar="RESULT.h5", help="Result file of an earlier command.")]
Override = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help='Change a key of the case: --set drive.pressure="18 kPa".'),
]
AsJson = Annotated[bool, typer.Option("--json", help="One JSON document on standard output, nothing else.")]
Output = Annotated[
    Path | None,
    typer.Option("-o", "--output", metavar="RESULT.h5", help="Keep everything in this HDF5 file.", callback=_writable),
]
PlotFolder = Annotated[
    Path | None, typer.Option("--plots", metavar="DIR", help="Draw all figures into this folder.", callback=_folder)
]


class Stopped(Exception):
    """End of a command from outside; the text says what was kept."""


@contextmanager
def in_units(units: Units) -> Iterator[None]:
    """Context whose failures are told in the units of a case."""
    try:
        yield
    except (CaseError, SolveError) as error:
        error.args = (units.say(str(error)),)
        raise


def refuse_beside(given: Mapping[str, object], why: str) -> None:
    """Refuse options, by name, that mean nothing beside others. Raises CaseError for the first one that is given, with
    why.
    """
    for name, value in given.items():
        if value not in (None, False, (), []):
            raise CaseError(f"{name} {why}.")


def print_json(document: Any) -> None:
    """Print one JSON document; arrays become lists, numbers that are not finite become null."""
    json.dump(json_value(document), sys.stdout, indent=1, allow_nan=False)
    sys.stdout.write("\n")


def print_either(document: Any, lines: Iterable[str], as_json: bool) -> None:
    """Print a JSON document, or lines for people."""
    if as_json:
        print_json(document)
    else:
        print("\n".join(lines))


def print_answer(
    document: Mapping[str, Any],
    lines: Callable[[], Sequence[str]],
    as_json: bool,
    drawn: tuple[Sequence[Path], Path | None] = ((), None),
    output: Path | None = None,
) -> None:
    """Print a JSON document with the names of its figures, or lines for people.

    Parameters
    ----------
    lines : callable
        Makes the lines.
    drawn : figures and the folder that they are in
    output : path, optional
        Where the numbers were written.
    """
    figures, folder = drawn
    if as_json:
        print_json({**document, "figures": [str(figure) for figure in figures]})
        return
    shown = lines()
    if shown:
        print("\n".join(shown))
    if output:
        print(f"Kept in {output}.")
    print_figures(figures, folder)


def print_figures(figures: Sequence[Path], folder: Path | None) -> None:
    """Print how many figures are in a folder, or in that of the first where none was asked for; nothing without any."""
    if figures:
        print(f"{len(figures)} figure{'s' * (len(figures) > 1)} in {folder or figures[0].parent}.")


def print_written(written: Path | Sequence[Path], as_json: bool) -> None:
    """Print the names of the files that a command has written."""
    paths = [written] if isinstance(written, Path) else written
    names = str(written) if isinstance(written, Path) else [str(path) for path in paths]
    print_either({"written": names}, (f"Wrote {path}." for path in paths), as_json)


def save_figures(drawers: Mapping[str, Callable[[], Any]], folder: Path | None) -> list[Path]:
    """Draw figures into a folder, none without one."""
    from ..drawing.style import draw_figures, write_figures

    return [] if folder is None else write_figures(draw_figures(drawers, (), "result"), folder)
