"""The step from a command that has been parsed to what it does."""

from __future__ import annotations

from importlib import import_module
from types import ModuleType


def action(name: str) -> ModuleType:
    """A module of ``_actions``, loaded when a command runs: the list of commands and their help do without JAX."""
    return import_module(f"._actions.{name}", __package__)
