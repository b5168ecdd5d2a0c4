"""One HTML file that needs no network, and the same as a PDF."""

from __future__ import annotations

import contextlib
import shutil
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from jinja2 import Environment, StrictUndefined
from plotly.offline import get_plotlyjs

from .. import __version__
from ..case.parameters import OUTSIDE, PARAMETERS
from ..case.write import case_toml
from ..errors import CaseError
from ..studies.stability.place import fixed_conditions
from .answers import UNKNOWN, Answer, answers, trade
from .gather import Gathered
from .parts import MAKERS, Part, first_pictures


def write_page(found: Gathered, path: Path) -> Path:
    """Write the report of a valve. Raises CaseError if the file cannot be written."""
    told = answers(found)
    first = {
        "sheet": sheet(found),
        "answers": told,
        "trade": trade(found),
        "open": unanswered(found, told),
        "pictures": first_pictures(found),
    }
    parts = _told_once([part for part in (make(found) for make in MAKERS) if part is not None])
    return write_parts(path, found.name, setting(found), _in_units(found, parts), case_toml(found.case), first)


def _in_units(found: Gathered, parts: list[Part]) -> list[Part]:
    """Parts with the sentences of studies in the units of the case."""

    def said(lines: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(map(found.case.units.say, lines))

    return [replace(part, sentences=said(part.sentences), trust=said(part.trust)) for part in parts]


def write_parts(
    path: Path, title: str, setting: str, parts: Sequence[Part], case: str = "", first: Mapping[str, Any] | None = None
) -> Path:
    """Write a page of parts. Raises CaseError if the file cannot be written.

    Parameters
    ----------
    title, setting : str
        Its heading, and what it is about, in a line.
    parts : sequence of Part
    case : str
        Text of a case file that stands at the end.
    first : mapping, optional
        The first page: its sheet, answers, trade and pictures, and what is open, each with its reason.
    """
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    template = environment.from_string(files(__package__).joinpath("page.html").read_text(encoding="utf-8"))
    pictures = [*(first["pictures"] if first else ()), *(picture for part in parts for picture in part.pictures)]
    text = template.render(
        name=title,
        setting=setting,
        first=first,
        parts=parts,
        figures={picture.name: number for number, picture in enumerate(pictures, start=1)},
        case=case,
        library=get_plotlyjs() if any(picture.live for picture in pictures) else "",
        version=__version__,
    )
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise CaseError(f"The page {str(path)!r} cannot be written ({error.strerror or error}).") from error
    return path


def sheet(found: Gathered) -> tuple[tuple[str, str], ...]:
    """Project, customer, tag, revision, author and date, those that are given; the date of today else."""
    project = found.case.project
    names = ("project", "customer", "tag", "revision", "author")
    given = [(name, getattr(project, name)) for name in names if getattr(project, name)]
    return (*given, ("date", project.date or f"{datetime.now().astimezone():%Y-%m-%d}"))


def unanswered(found: Gathered, told: Sequence[Answer]) -> tuple[str, ...]:
    """Questions without an answer and studies that failed, each with its reason."""
    say = found.case.units.say
    questions = [f"{a.question} {a.text}" for a in told if a.answer == UNKNOWN]
    return (*questions, *(f"The study {name} failed: {say(why)}" for name, why in found.failed.items()))


def setting(found: Gathered) -> str:
    """Conditions that the report's answers hold for, in a line."""
    case, mesh = found.case, found.case.mesh
    given = fixed_conditions(case, "pressure")
    flow, outside = (given.pop(name, "") for name in ("storage", OUTSIDE))
    own = given.get("loss_factor") == 1.0 and given.pop("loss_factor")
    rows = [(PARAMETERS[name], value) for name, value in given.items() if value]
    words = [f"{row.title.lower()} {row.amount(value)}" for row, value in rows]
    words += [
        *(["loss factors of its materials"] if own else []),
        f"flow model {flow}",
        *([outside] if outside else []),
    ]
    words += [f"{mesh.around * case.part.quarters} x {mesh.along} elements on a {case.part.name} of the valve"]
    said = ", ".join(words)
    return f"{said[0].upper()}{said[1:]}."


def _told_once(parts: list[Part]) -> list[Part]:
    """Parts without the remarks that an earlier part made already."""
    said: set[str] = set()
    kept = []
    for part in parts:
        kept.append(replace(part, trust=tuple(line for line in part.trust if line not in said)))
        said.update(part.trust)
    return kept


#: Browsers that print, by the names they have on Debian and elsewhere.
_BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")


def find_printers() -> tuple[str | None, bool]:
    """Path of a browser, and whether WeasyPrint is there. Raises CaseError if neither is."""
    browser, weasyprint = next(filter(None, map(shutil.which, _BROWSERS)), None), find_spec("weasyprint") is not None
    if browser is None and not weasyprint:
        raise CaseError(
            "--pdf needs the browser chromium (apt-get install chromium) or the package weasyprint (pip install "
            "dbvfiv[report]), and neither is there; without --pdf the page prints from any browser."
        )
    return browser, weasyprint


def write_pdf(page: Path, path: Path) -> Path:
    """Print a page on A4. Raises CaseError if neither a browser nor WeasyPrint is there, or neither wrote the file."""
    browser, weasyprint = find_printers()
    draft = path.with_name(f"{path.stem}.partial.pdf")  # an earlier one is not taken for what this run has printed
    draft.unlink(missing_ok=True)
    if browser is not None:
        options = ("--headless", "--no-sandbox", "--disable-gpu", "--no-pdf-header-footer", f"--print-to-pdf={draft}")
        with contextlib.suppress(subprocess.TimeoutExpired):
            subprocess.run([browser, *options, page.absolute().as_uri()], capture_output=True, timeout=300, check=False)
    if weasyprint and not draft.is_file():
        from weasyprint import HTML  # optional

        HTML(str(page)).write_pdf(str(draft))
    if not draft.is_file():
        raise CaseError(f"{str(path)!r} was not written: {browser or 'weasyprint'} gave no file.")
    return draft.replace(path)
