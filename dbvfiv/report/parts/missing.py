"""Replacement for the part of a study that gave no result."""

from __future__ import annotations

from ..content import Part
from ..gather import Gathered


def not_there(found: Gathered, kind: str, title: str) -> Part:
    """A part that says why there is no result."""
    return Part(kind, title, (f"There is no result. {found.missing.get(kind, '')}".strip(),))


def said_by(result) -> tuple[str, ...]:
    """Warnings and failures of a result."""
    return (*(f"Warning: {w}" for w in result.warnings), *result.failures)
