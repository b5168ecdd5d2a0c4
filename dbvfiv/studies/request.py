"""What a command line asks of a study."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Request:
    """A study as the command line wants it.

    Attributes
    ----------
    changes : dict
        Keys of the case and what takes their place; those with None are left as they are.
    choices : dict
        What the study takes that is no key of the case; likewise.
    further : callable, optional
        From the result to further files, such as an animation.
    """

    changes: dict[str, Any] = field(default_factory=dict)
    choices: dict[str, Any] = field(default_factory=dict)
    further: Callable[[Any], list[Path]] | None = None


def number_or_text(value: str | None) -> float | str | None:
    """A number where an option is one; texts with units as they are."""
    try:
        return None if value is None else float(value)
    except ValueError:
        return value
