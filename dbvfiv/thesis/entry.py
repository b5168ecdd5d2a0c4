"""Figures and tables of the thesis, and the runs that they share, each computed once and kept in a file."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..observer import Observer
from ..report.parts import Part, Picture, Table
from ..studies.case import thesis_case
from ..studies.session import Session, kept_run
from ..studies.steady.study import SteadyResult

_HEAD = ("", "ours", "thesis", "difference")


@dataclass(frozen=True)
class Number:
    """A number of ours, and the one that the thesis's text gives, if it gives one."""

    what: str
    ours: float
    published: float | None = None
    unit: str = ""

    @property
    def difference(self) -> float | None:
        """Ours over the published one, less one; of what is a percentage already, ours less the published one."""
        if self.published is None:
            return None
        return (self.ours - self.published) / 100 if self.unit == "%" else self.ours / self.published - 1.0

    def summary(self) -> dict[str, Any]:
        """For JSON."""
        return vars(self) | {"difference": self.difference}

    @property
    def row(self) -> tuple[str, str, str, str]:
        """For a table."""
        published = "" if self.published is None else f"{self.published:g}"
        unit = "points" if self.unit == "%" else "%"
        difference = "" if self.difference is None else f"{100 * self.difference:+.1f} {unit}"
        return f"{self.what}{', ' if self.unit else ''}{self.unit}", f"{self.ours:.4g}", published, difference


Found = str | Number | Picture


@dataclass(frozen=True)
class Outcome:
    """Findings of an entry."""

    sentences: tuple[str, ...]  #: Agreements, disagreements, and their reasons as far as these are known.
    numbers: tuple[Number, ...]
    pictures: tuple[Picture, ...]


@dataclass(frozen=True)
class Entry:
    """A figure or table of the thesis and how it is made again."""

    name: str  #: "7-4", or "T3-5" for a table.
    title: str
    tell: Callable[[Workshop], Iterable[Found]]  #: From a `Workshop` to sentences, numbers and pictures, in any order.

    def make(self, workshop: Workshop) -> Outcome:
        """Findings, sorted by what they are."""
        found = list(self.tell(workshop))
        return Outcome(*(tuple(x for x in found if isinstance(x, kind)) for kind in (str, Number, Picture)))

    @property
    def place(self) -> tuple[int, int, int]:
        """Chapter, number; tables before figures of the same number."""
        chapter, number = self.name.removeprefix("T").split("-")
        return int(chapter), int(number), not self.name.startswith("T")

    @property
    def label(self) -> str:
        """Name of the figure or table in the thesis."""
        return f"Table {self.name[1:]}" if self.name.startswith("T") else f"Fig. {self.name}"

    def lines(self, outcome: Outcome) -> list[str]:
        """The outcome for people."""
        lines = ["", f"{self.label}: {self.title}"]
        if outcome.numbers:
            rows = [_HEAD, *(n.row for n in outcome.numbers)]
            widths = [max(len(row[i]) for row in rows) for i in range(4)]
            lines += [
                f"  {row[0]:<{widths[0]}}" + "".join(f"  {row[i]:>{widths[i]}}" for i in (1, 2, 3)) for row in rows
            ]
        return [*lines, *(f"  {sentence}" for sentence in outcome.sentences)]

    def part(self, outcome: Outcome) -> Part:
        """The outcome for a page."""
        tables = (Table(_HEAD, tuple(n.row for n in outcome.numbers)),) if outcome.numbers else ()
        return Part(f"entry-{self.name}", f"{self.label}: {self.title}", outcome.sentences, tables, outcome.pictures)


#: All entries, as they are declared.
DECLARED: list[Entry] = []


def entry(name: str, title: str) -> Callable:
    """Declare what a function tells as the entry of a figure or table."""

    def declare(tell: Callable[[Workshop], Iterable[Found]]) -> Callable[[Workshop], Iterable[Found]]:
        DECLARED.append(Entry(name, title, tell))
        return tell

    return declare


def spread(numbers: Sequence[Number]) -> str:
    """Least and greatest difference of some numbers, in words."""
    found = [100 * n.difference for n in numbers if n.difference is not None]
    if not found:
        return ""
    low, high = min(found), max(found)
    return f"{low:+.1f} %" if abs(high - low) < 0.05 else f"{low:+.1f} to {high:+.1f} %"


#: Meshes of the whole set and of the quick one.
FULL, QUICK = (28, 48), (8, 14)


class Workshop:
    """Source of the runs that entries need: read from a folder, or computed.

    Parameters
    ----------
    folder : path
        Folder of the result files.
    quick : bool
        Coarse mesh, short histories: for a look, not for the numbers.
    observer : Observer, optional
    """

    def __init__(self, folder: Path, quick: bool = False, observer: Observer | None = None):
        self.folder, self.quick, self.observer = folder, quick, observer
        around, along = QUICK if quick else FULL
        self.base = thesis_case({"mesh.around": around, "mesh.along": along})

    @property
    def setting(self) -> str:
        """Valve, mesh and histories of the page, in a sentence or two."""
        mesh = self.base.mesh
        short = " Short histories on a coarse mesh, for a look and not for the numbers." if self.quick else ""
        return f"The 12-inch valve on {mesh.around} x {mesh.along} elements of a quarter, beside the thesis.{short}"

    def steady(self, pressures: Sequence[float], changes: Mapping[str, Any] | None = None) -> SteadyResult:
        """States at pressures, Pa, of the 12-inch valve with some keys changed."""
        return self.run("steady", {"steady.pressures": list(pressures), **(changes or {})})

    def duration(self, full: float, quick: float) -> float:
        """Duration of a history, s: the full or the quick one."""
        return quick if self.quick else full

    def run(self, kind: str, changes: Mapping[str, Any], name: str | None = None) -> Any:
        """Result of a study of the 12-inch valve with some keys changed; `name` is what it is called in comparisons."""
        case = self.base.replace(dict(changes))
        mark = hashlib.sha256(json.dumps([self.quick, changes], sort_keys=True, default=str).encode()).hexdigest()[:10]
        session = Session(case, name or "dbv12")
        return kept_run(kind, session, self.folder / f"{kind}-{mark}.h5", self.observer)
