"""Words for fields whose type alone does not say what they allow."""

from __future__ import annotations

import typing
from dataclasses import dataclass
from typing import Any

from pydantic.fields import FieldInfo


@dataclass(frozen=True)
class Described:
    """Marks a field of several parts.

    Parameters
    ----------
    type : str
        What it is called in the reference.
    allowed : str
        Completes "it must be ...".
    quantity : object, optional
        `dbvfiv.case.quantity.Quantity` by which its numbers are shown.
    """

    type: str
    allowed: str
    quantity: Any = None


def description_of(field: FieldInfo) -> Described | None:
    """Mark that describes a field, also where it is on an alternative of a union; None without one."""
    found = next((m for m in field.metadata if isinstance(m, Described)), None)
    return found or _inner(field.annotation)


def _inner(annotation: Any) -> Described | None:
    for argument in typing.get_args(annotation):
        found = next((m for m in getattr(argument, "__metadata__", ()) if isinstance(m, Described)), None)
        if found:
            return found
    return None
