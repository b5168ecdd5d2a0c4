"""Base class of every table of a case file, and the function that declares a key."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

from pydantic import BaseModel, ConfigDict, Field


class BrokenRule(ValueError):
    """Two or more keys that do not go together.

    Parameters
    ----------
    key : str
        The key to blame, relative to the model that checks the rule.
    given, allowed : str
        Complete the sentence "KEY is GIVEN; ALLOWED".
    """

    def __init__(self, key: str, given: str, allowed: str):
        super().__init__(f"{key} is {given}; {allowed}")
        self.key, self.given, self.allowed = key, given, allowed


class Section(BaseModel):
    """A table of the case file: immutable, and closed to keys it does not know."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=False, allow_inf_nan=False, validate_default=True)

    @classmethod
    def make_way(cls, data: dict[str, Any], changed: Collection[tuple[str, ...]]) -> None:
        """Take out of plain data what a changed key stands in the place of."""


def key(default: Any, description: str, **limits: Any) -> Any:
    """Declare one key: default, description and limits (``gt``, ``ge``, ``lt``, ``le``, ``min_length``).

    Type and unit come from the annotation. A default of ``...`` makes the key mandatory.
    """
    return Field(default, description=description, **limits)
