"""Figures and films of a result file, and the picture of the valve of a case file."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from ...api import load
from ...case.pressures import read_pressures
from ...errors import CaseError
from ...studies.session import load_result
from ...studies.transient.figures import cycles_to_animate
from .._output import print_json


def plot(
    file: Path,
    folder: Path,
    format: str,
    only: Sequence[str],
    pressure: str | None,
    mode: int | None,
    films: Sequence[int],
    overrides: Sequence[str],
    as_json: bool,
) -> None:
    """Draw the figures of a result, those of one state at the `pressure`, and films of modes or cycles; or the valve
    of a case.

    Raises
    ------
    CaseError
        If the result has no such figure or does not move, or an option does not go with a case or a result.
    """
    if file.suffix.lower() == ".toml":
        choices = {"--pressure": pressure, "--mode": mode, "--animate": films or None}
        for name, value in choices.items():
            if value is not None:
                raise CaseError(f"{name} goes with a result file; the picture of {str(file)!r} is that of its valve.")
        valve = load(file, list(overrides))
        _say(valve.plot(folder, format, only=only), as_json)
        return
    if overrides:
        raise CaseError(f"--set goes with a case file; {str(file)!r} is a result, whose case stays as it was.")
    choices: dict[str, object] = {}
    if pressure is not None:
        choices["pressure"] = read_pressures([pressure], "--pressure")[0]
    if mode is not None:
        choices["mode"] = mode
    result = load_result(file)
    makers = [_film(result, file, folder, number) for number in films]  # misuse shows before anything is drawn
    written = result.plot(folder, format, only=only, **choices)
    written += [make() for make in makers]
    _say(written, as_json)


def _say(written: Sequence[Path], as_json: bool) -> None:
    if as_json:
        print_json({"written": [str(path) for path in written]})
    else:
        print("\n".join(f"Wrote {path}." for path in written))


def _film(result, file: Path, folder: Path, number: int) -> Callable[[], Path]:
    """Function that writes the animation that ``--animate`` asks of a result."""
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
