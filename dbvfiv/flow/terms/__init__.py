"""Losses and inertances that a case may add to the streamline, one a file.

A module in this folder defines a `FlowTerm` and a function `from_case(case)` that returns it, or None where the case
has none. Every module here takes part; nothing else need be told of it. See docs/adding-a-flow-law.md.
"""

from __future__ import annotations

import pkgutil
from importlib import import_module

from ..term import FlowTerm

_MODULES = tuple(import_module(f"{__name__}.{found.name}") for found in pkgutil.iter_modules(__path__))


def terms_of(case) -> tuple[FlowTerm, ...]:
    """Terms of a case, in the order of the names of their files."""
    found = (module.from_case(case) for module in _MODULES)
    return tuple(term for term in found if term is not None)
