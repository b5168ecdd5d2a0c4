"""Figures and films of a result file."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from ...case.pressures import read_pressures
from ...errors import CaseError
from ...studies.session import load_result
from ...studies.transient.animation import cycles_to_animate
from .._output import print_json


def plot(
    file: Path,
    folder: Path,
    format: str,
    only: Sequence[str],
    pressure: str | None,
    mode: int | None,
    films: Sequence[int],
    as_json: bool,
) -> None:
    """Draw the figures of a result, those of one state at the `pressure`, and films of modes or cycles.

    Raises
    ------
    CaseError
        If the result has no such figure or does not move.
    """
    choices: dict[str, object] = {}
    if pressure is not None:
        choices["pressure"] = read_pressures([pressure], "--pressure")[0]
    if mode is not None:
        choices["mode"] = mode
    result = load_result(file)
    makers = [_film(result, file, folder, number) for number in films]  # misuse shows before anything is drawn
    written = result.plot(folder, format, only=only, **choices)
    written += [make() for make in makers]
    if as_json:
        print_json({"written": [str(path) for path in written]})
    else:
        print("\n".join(f"Wrote {path}." for path in written))


def _film(result, file: Path, folder: Path, number: int) -> Callable[[], Path]:
    """What writes the film that ``--animate`` asks of a result."""
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
