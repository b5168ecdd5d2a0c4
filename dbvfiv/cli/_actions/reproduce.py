"""Entries of the thesis are made, and a page of them."""

from __future__ import annotations

from pathlib import Path

from ...errors import CaseError, SolveError
from ...report import write_parts
from ...thesis import ENTRIES, Entry, Workshop
from .._output import print_json
from .._progress import Progress


def reproduce(names: tuple[str, ...], folder: Path, quick: bool, listing: bool, as_json: bool) -> None:
    """Make the entries named, all without names; the page is written anew after each.

    Raises
    ------
    CaseError
        For a name that there is no entry of.
    SolveError
        If an entry could not be made; the others are.
    """
    chosen = choose(names)
    if listing:
        if as_json:
            print_json({"entries": [{"name": e.name, "label": e.label, "title": e.title} for e in chosen]})
        else:
            print("\n".join(f"{e.name:>5}  {e.label}: {e.title}" for e in chosen))
        return
    workshop = Workshop(folder / ("quick" if quick else "full"), quick, Progress(quiet=as_json))
    page = folder / "thesis.html"
    done, parts, failures = [], [], []
    for entry in chosen:
        try:
            outcome = entry.make(workshop)
        except SolveError as error:
            failures.append(f"{entry.label}: {error}")
            continue
        parts.append(entry.part(outcome))
        write_parts(page, "The thesis, figure by figure", _setting(workshop), (), parts)
        numbers = [number.summary() for number in outcome.numbers]
        done.append({"name": entry.name, "title": entry.title, "numbers": numbers, "sentences": outcome.sentences})
        if not as_json:
            print("\n".join(_lines(entry, outcome)), flush=True)
    if as_json:
        print_json({"page": str(page), "quick": quick, "entries": done, "failures": failures})
    elif parts:
        print(f"Page in {page}.")
    if failures:
        raise SolveError(" ".join(failures))


def choose(names: tuple[str, ...]) -> list[Entry]:
    """Entries by their names.

    Raises
    ------
    CaseError
    """
    known = {entry.name: entry for entry in ENTRIES}
    for name in names:
        if name not in known:
            raise CaseError(f"There is no entry {name!r}; there are {', '.join(known)}.")
    return [known[name] for name in dict.fromkeys(names)] if names else list(ENTRIES)


def _setting(workshop: Workshop) -> str:
    mesh = workshop.base.mesh
    short = " Short histories on a coarse mesh, for a look and not for the numbers." if workshop.quick else ""
    return f"The 12-inch valve on {mesh.around} x {mesh.along} elements of a quarter, beside the thesis.{short}"


def _lines(entry: Entry, outcome) -> list[str]:
    lines = ["", f"{entry.label}: {entry.title}"]
    if outcome.numbers:
        rows = [("", "ours", "thesis", "difference"), *(n.row for n in outcome.numbers)]
        widths = [max(len(row[i]) for row in rows) for i in range(4)]
        lines += [f"  {row[0]:<{widths[0]}}" + "".join(f"  {row[i]:>{widths[i]}}" for i in (1, 2, 3)) for row in rows]
    return [*lines, *(f"  {sentence}" for sentence in outcome.sentences)]
