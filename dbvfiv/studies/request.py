"""Request of a command line to a study."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import typer

from ..case.describe import quantity_of
from ..case.quantity import number_or_text
from ..case.section import BrokenRule, Section
from ..errors import CaseError
from .workers import WORKERS_HELP

#: Suffixes of sheets, tables that are no result files.
SHEETS = (".csv", ".xlsx")


def is_sheet(path: Path | None) -> bool:
    """True for the name of a sheet, by its suffix."""
    return path is not None and path.suffix.lower() in SHEETS


def require_gif(path: Path | None) -> Path | None:
    """Refuse a name of an animation that is none of a GIF. Raises CaseError."""
    if path is not None and path.suffix.lower() != ".gif":
        raise CaseError(f"An animation is given as {str(path)!r}; it must be a .gif file.")
    return path


def with_unit(option: typer.CallbackParam, given: str | list[str] | None) -> str | list[str] | None:
    """Refuse a bare number where a command takes a pressure, or several, or ranges of it. Raises CaseError."""
    for text in given if isinstance(given, list) else [given or ""]:
        for part in text.split(":")[:2]:
            if isinstance(number := number_or_text(part), float) and number != 0:
                raise CaseError(
                    f"{option.opts[0]} is given as {text!r}, without a unit: Pa or m? Give '{part} Pa', '{part} kPa', "
                    f"or '{part} m' for a head of the fluid."
                )
    return given


#: What a command takes in place of fluid.continuity.
LAWS = ("quasi-steady", "storage", "both")


#: Keys of other sections that an option of any study stands for.
_ELSEWHERE = {"pressure": "drive.pressure", "density": "fluid.density", "law": "fluid.continuity"}


def changed_keys(study: str, keys: type[Section], given: Mapping[str, Any]) -> dict[str, Any]:
    """Keys of the case that options of a study change: an option stands for the key of the study's section that has its
    name, or for one `_ELSEWHERE`; what was not given changes none. Raises CaseError for a law that is no choice.
    """
    found: dict[str, Any] = {}
    for name, value in given.items():
        if value is False or value == []:
            value = None
        if name == "law" and "continuity" in keys.model_fields:  # a study that may compare both
            found |= _law_changes(value, study)
        elif name in _ELSEWHERE:
            found[_ELSEWHERE[name]] = value if name == "law" else number_or_text(value)
        elif name in keys.model_fields:
            is_quantity = isinstance(value, str) and quantity_of(keys.model_fields[name]) is not None
            value = str(value) if isinstance(value, Path) else value
            found[f"{study}.{name}"] = number_or_text(value) if is_quantity else value
    return found


def _law_changes(law: str | None, study: str) -> dict[str, str | None]:
    """Keys that a law asked for on the command line changes. Raises CaseError for a word that is no choice."""
    if law is not None and law not in LAWS:
        raise CaseError(f"--law is given as {law!r}; it must be {', '.join(LAWS[:-1])} or {LAWS[-1]}.")
    if law == "both":
        return {f"{study}.continuity": "both"}
    return {"fluid.continuity": law, f"{study}.continuity": "case" if law else None}


def require_start_file(start: str, word: str, path: Path | None) -> None:
    """Refuse a `start_file` of a study without the `start` that is called by a word, and that without a file. Raises
    BrokenRule.
    """
    if (start == word) != (path is not None):
        given = f"none with start = {word!r}" if path is None else f"{str(path)!r} with start = {start!r}"
        raise BrokenRule("start_file", given, f"it goes with start = {word!r} and only with that")


def over_option(words: str, metavar: str = "RANGE") -> Any:
    """Option --over of a study over a range."""
    return typer.Option("--over", metavar=metavar, help=words)


def pressure_option(words: str) -> Any:
    """Option --pressure, of one pressure or several."""
    return typer.Option("--pressure", "-p", metavar="P", callback=with_unit, help=words)


#: What several studies take in place of keys of the case.
PressureOption = Annotated[
    str | None, pressure_option("Pressure in place of drive.pressure: '18 kPa', or a head of the fluid, '2 m'.")
]
DensityOption = Annotated[
    str | None, typer.Option("--density", metavar="RHO", help="Fluid density in place of fluid.density.")
]
AnimationOption = Annotated[
    Path | None,
    typer.Option("--animate", metavar="FILE.gif", callback=require_gif, help="Write an animation of the last cycle."),
]
LawOption = Annotated[
    str | None,
    typer.Option("--law", metavar="LAW", help="Flow model in place of fluid.continuity: quasi-steady or storage."),
]
LawsOption = Annotated[
    str | None,
    typer.Option(
        "--law",
        metavar="LAW",
        help="Flow model in place of fluid.continuity: quasi-steady, storage, or both side by side.",
    ),
]
ClassesOption = Annotated[
    str | None,
    typer.Option(
        "--symmetry",
        metavar="CLASSES",
        help="SS, the class of the model, or all: also sway in y (SA), sideways in x (AS) and twist (AA).",
    ),
]
WorkersOption = Annotated[str | None, typer.Option("--workers", "-w", "--on", metavar="N|ADDRESS", help=WORKERS_HELP)]


@dataclass(frozen=True)
class Request:
    """A study as the command line wants it, besides the keys that its options stand for."""

    #: Keys of the case and what takes their place; those with None are left as they are.
    changes: dict[str, Any] = field(default_factory=dict)
    choices: dict[str, Any] = field(default_factory=dict)  #: What the study takes that is no key of the case; likewise.
    further: Callable[[Any], list[Path]] | None = None  #: From the result to further files, such as an animation.
    #: From results to a table that takes the place of the result file.
    sheet: Callable[[Sequence[Any]], Path] | None = None
    #: Changes of the case with which the study is made again, for the same sheet.
    variants: tuple[dict[str, Any], ...] = ()
