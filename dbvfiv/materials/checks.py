"""Refusal of impossible material constants, in full sentences."""

from __future__ import annotations

import math
from numbers import Real

from dbvfiv.errors import CaseError


class MaterialError(CaseError):
    """A material constant, table or test file that cannot be used; the message says why."""


def require_finite(law: str, **constants: float) -> None:
    """Raise `MaterialError` unless every constant is a finite real number."""
    for name, value in constants.items():
        if isinstance(value, bool) or not isinstance(value, Real) or not math.isfinite(value):
            raise MaterialError(f"{law}: {name} must be a finite number, but {value!r} was given.")


def require_positive(law: str, **constants: float) -> None:
    """Raise `MaterialError` unless every constant is finite and greater than zero."""
    require_finite(law, **constants)
    for name, value in constants.items():
        if value <= 0.0:
            raise MaterialError(f"{law}: {name} must be greater than zero, but {value:g} was given.")
