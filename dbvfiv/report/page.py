"""One HTML file that needs no network."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from datetime import datetime
from importlib.resources import files
from pathlib import Path

from jinja2 import Environment, StrictUndefined

from .. import __version__
from ..case.write import case_toml
from ..errors import CaseError
from ..studies.stability.place import describe_fixed
from . import live
from .content import Part
from .gather import Gathered
from .parts import PARTS, cycles, onsets, opening, shutting, stability


def write_page(found: Gathered, path: Path) -> Path:
    """Write the report of a valve.

    Raises
    ------
    CaseError
        If the file cannot be written.
    """
    parts = _told_once([part for part in (make(found) for make in PARTS) if part is not None])
    return write_parts(path, found.name, setting(found), answers(found), parts, case_toml(found.case))


def write_parts(
    path: Path,
    title: str,
    setting: str,
    answers: Sequence[tuple[str, Sequence[str]]],
    parts: Sequence[Part],
    case: str = "",
) -> Path:
    """Write a page of parts.

    Parameters
    ----------
    path : path
    title, setting : str
        Its heading, and what it is about, in a line.
    answers : sequence of (str, sequence of str)
        Questions and the sentences that answer them, which stand on top.
    parts : sequence of Part
    case : str
        Text of a case file that stands at the end.

    Raises
    ------
    CaseError
        If the file cannot be written.
    """
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    template = environment.from_string(files(__package__).joinpath("page.html").read_text(encoding="utf-8"))
    text = template.render(
        name=title,
        setting=setting,
        answers=answers,
        parts=parts,
        figures=_numbers(parts),
        case=case,
        library=live.library() if any(picture.live for part in parts for picture in part.pictures) else "",
        version=__version__,
    )
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise CaseError(f"The page {str(path)!r} cannot be written ({error.strerror or error}).") from error
    return path


def answers(found: Gathered) -> list[tuple[str, tuple[str, ...]]]:
    """The questions a reader comes with, each with its sentences."""
    asked = (
        ("How far does it open, what flows?", opening(found)),
        ("Does it vibrate?", stability(found)),
        ("Where does that begin?", onsets(found)),
        ("What does it grow into?", cycles(found)),
        ("Does it shut?", shutting(found)),
    )
    return [(question, told) for question, told in asked if any(told)]


def setting(found: Gathered) -> str:
    """Conditions that the report's answers hold for, in a line."""
    case, mesh = found.case, found.case.mesh
    words = [
        describe_fixed(case),
        f"{mesh.around * case.part.quarters} x {mesh.along} elements on a {case.part.name} of the valve",
    ]
    return f"At {', '.join(words)}. Made {datetime.now().astimezone():%Y-%m-%d %H:%M}."


def _told_once(parts: list[Part]) -> list[Part]:
    """Parts without the remarks that an earlier part made already."""
    said: set[str] = set()
    kept = []
    for part in parts:
        kept.append(replace(part, trust=tuple(line for line in part.trust if line not in said)))
        said.update(part.trust)
    return kept


def _numbers(parts: Sequence[Part]) -> dict[str, int]:
    """Numbers of the figures by their names."""
    names = [picture.name for part in parts for picture in part.pictures]
    return {name: number for number, name in enumerate(names, start=1)}
