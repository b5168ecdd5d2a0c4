"""A result for ParaView, surfaces and bodies of a state for CAD."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ...studies.session import load_result
from .._output import print_json
from .states import chosen_state


def export(file: Path, output: Path | None, quarter: bool, deformed: bool, mode: int | None, as_json: bool) -> None:
    """Write a result as VTKHDF, beside it unless an output is named."""
    result = load_result(file)
    choices = {} if mode is None else {"mode": mode}
    beside = file.with_suffix(".vtkhdf") if mode is None else file.with_name(f"{file.stem}-mode{mode}.vtkhdf")
    written = result.export(output if output is not None else beside, quarter, deformed, **choices)
    if as_json:
        print_json({"written": str(written)})
    else:
        print(f"Wrote {written}.")


def export_shapes(
    file: Path,
    output: Path | None,
    format: str,
    shapes: Sequence[str],
    pressure: str | None,
    quarter: bool,
    as_json: bool,
) -> None:
    """Write shapes of one state into a folder, beside the result unless one is named."""
    folder = file.parent if output is None else output
    written = chosen_state(file, pressure).export_shapes(folder, format, shapes, quarter)
    if as_json:
        print_json({"written": [str(path) for path in written]})
    else:
        print("\n".join(f"Wrote {path}." for path in written))
