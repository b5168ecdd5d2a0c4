"""Standard output: one JSON document, or lines for people."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Sequence
from dataclasses import asdict, is_dataclass
from pathlib import Path
from typing import Any


def print_json(document: Any) -> None:
    """Print one JSON document; arrays become lists, numbers that are not finite become null."""
    json.dump(_plain(document), sys.stdout, indent=1, allow_nan=False)
    sys.stdout.write("\n")


def print_places(output: Path | None, figures: Sequence[Path], folder: Path | None) -> None:
    """Say where the result and the figures are."""
    if output:
        print(f"Kept in {output}.")
    if figures:
        print(f"{len(figures)} figure{'s' * (len(figures) > 1)} in {folder}.")


def _plain(value: Any) -> Any:
    if hasattr(value, "tolist"):  # numpy and JAX arrays and scalars
        value = value.tolist()
    if isinstance(value, complex):
        return {"re": _plain(value.real), "im": _plain(value.imag)}
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(v) for v in value]
    if value is None or isinstance(value, (bool, int, str)):
        return value
    if is_dataclass(value):
        return _plain(asdict(value))
    if hasattr(value, "to_dict"):
        return _plain(value.to_dict())
    return str(value)
