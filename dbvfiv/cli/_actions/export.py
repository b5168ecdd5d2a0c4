"""A result for ParaView."""

from __future__ import annotations

from pathlib import Path

from ...studies.session import load_result
from .._output import print_json


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
