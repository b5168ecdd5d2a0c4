"""Commands of the studies: each brings its own options, and here is what they share."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any, get_type_hints

from ..studies import KINDS
from ._later import action
from ._options import AsJson, CaseFile, Output, Override, PlotFolder

#: What a command of a study may take from what all share.
_SHARED = ("case", "plots")


def study_commands() -> list[tuple[str, ModuleType]]:
    """Names and command modules of all studies."""
    return [(kind, import_module(f"..studies.{kind}.command", __package__)) for kind in KINDS]


def make_command(kind: str, module: ModuleType) -> Callable[..., None]:
    """A command with the options of a study between the case file and what all studies share."""
    hints = get_type_hints(module.command, include_extras=True)
    own = [p for name, p in inspect.signature(module.command).parameters.items() if name not in _SHARED]

    taken = [name for name in inspect.signature(module.command).parameters if name in _SHARED]

    def command(
        case_file: Path | None, output: Path | None, plots: Path | None, overrides, as_json: bool, **given: Any
    ) -> None:
        act = action("study")
        case = act.read_case(case_file, overrides)
        shared = {"case": case, "plots": plots}
        request = module.command(**{name: shared[name] for name in taken}, **given)
        act.perform(kind, case, request, case_file.stem if case_file else "dbv12", output, plots, as_json)

    shared_last = (("output", Output, None), ("plots", PlotFolder, None), ("overrides", Override, None))
    parameters = [
        _parameter("case_file", CaseFile, None),
        *(p.replace(annotation=hints[p.name], kind=p.KEYWORD_ONLY) for p in own),
        *(_parameter(*one) for one in shared_last),
        _parameter("as_json", AsJson, False),
    ]
    command.__signature__ = inspect.Signature(parameters)
    command.__annotations__ = {p.name: p.annotation for p in parameters}
    command.__doc__ = module.command.__doc__
    return command


def _parameter(name: str, annotation: Any, default: Any) -> inspect.Parameter:
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=annotation)
