"""``dbvfiv plot``: figures of a result."""

from __future__ import annotations

from collections.abc import Callable
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from ._options import AsJson, ResultFile
from ._output import print_json

ORDER = 50


class Format(StrEnum):
    """Kinds of figure files."""

    png = "png"
    svg = "svg"


def command(
    file: ResultFile,
    folder: Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="Folder for the figures.")] = Path("."),
    format: Annotated[Format, typer.Option("--format", help="File format.")] = Format.png,
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
    as_json: AsJson = False,
) -> None:
    """Draw the figures of a result file; those of one state show the highest pressure unless --pressure is given."""
    from ..studies.session import load_result

    choices = {}
    if pressure is not None:
        from ..case.pressures import read_pressures

        choices["pressure"] = read_pressures([pressure], "--pressure")[0]
    if mode is not None:
        choices["mode"] = mode
    result = load_result(file)
    films = [_film(result, file, folder, number) for number in animate or ()]  # misuse shows before anything is drawn
    written = result.plot(folder, format.value, only=only or (), **choices)
    written += [make() for make in films]
    if as_json:
        print_json({"written": [str(path) for path in written]})
    else:
        print("\n".join(f"Wrote {path}." for path in written))


def _film(result, file: Path, folder: Path, number: int) -> Callable[[], Path]:
    """What writes the film that ``--animate`` asks of a result."""
    from ..errors import CaseError
    from ..studies.transient.animation import cycles_to_animate

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
