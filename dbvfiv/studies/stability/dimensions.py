"""Dimensions of a study besides its parameters: symmetry class and continuity law.

A study computes the class of the equilibria under the law of the case first. What it finds in another class or under
the other law is one note of its record each, made by the same search.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np

from ...case.part import Part
from ...errors import CaseError
from ...model.symmetry import Symmetry, chosen_symmetries
from ...record.record import GrowingRecord, Record
from ..case import Case

#: Kinds of the notes that hold what was found: one for each class, one for the other law.
CLASS, LAW = "class", "other law"
QUASI_STEADY, STORAGE = "quasi-steady", "storage"
_WHY = (
    "storage conserves volume under moving walls (what they displace has to go somewhere) and agrees with the water "
    "tunnel of the thesis, in which water was stable from 2 to 50 kPa, so a prediction should rest on it; quasi-steady "
    "reproduces the thesis's own calculations"
)
_WORDS = {True: "stable", False: "unstable", None: "undecided"}


def add_classes(record: GrowingRecord, chosen: str, part: Part, find: Callable[[Symmetry], Any]) -> None:
    """Repeat a search in the other symmetry classes that a study asks for and that its record has not yet.

    Parameters
    ----------
    record : GrowingRecord
    chosen : str
        A class, or "all".
    part : Part
        Computed part of the valve.
    find : callable
        From a class to what is found in it, with `failures`, `warnings`, `interrupted` and ``note()``.
    """
    done = {note["symmetry"] for note in record.notes(CLASS)}
    for symmetry in chosen_symmetries(chosen, part):
        if symmetry.of_equilibria or symmetry.name in done:
            continue
        record.progress(f"class {symmetry.name}: {symmetry.words}")
        found = find(symmetry)
        for sentence in found.failures:
            record.fail(f"In class {symmetry.name}: {sentence}")
        for sentence in found.warnings:
            record.warn(f"In class {symmetry.name}: {sentence}")
        if found.interrupted:
            raise KeyboardInterrupt
        record.note(CLASS, symmetry=symmetry.name, motion=symmetry.words, **found.note())


def read_classes(record: Record) -> list[dict[str, Any]]:
    """Latest note on each of the other symmetry classes."""
    return list({note["symmetry"]: _content(note) for note in record.notes(CLASS)}.values())


def read_other_law(record: Record) -> dict[str, Any] | None:
    """Latest note on the other continuity law; None where that was not asked for."""
    notes = record.notes(LAW)
    return _content(notes[-1]) if notes else None


def _content(note: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in note.items() if name != "what"}


def leading_class(names: Sequence[str], rates: np.ndarray, frequencies: np.ndarray) -> dict[str, Any]:
    """Growth rate, frequency and symmetry class of the most unstable motion at each of several places.

    Parameters
    ----------
    names : sequence of str
        Classes, that of the equilibria first; a place where its growth rate is NaN is a gap, its class None.
    rates, frequencies : (classes, ...) arrays, 1/s, Hz

    Examples
    --------
    >>> leading_class(["SS", "SA"], np.array([[1.0, -1.0], [0.5, 2.0]]), np.zeros((2, 2)))["symmetry"]
    ['SS', 'SA']
    """
    gap = np.isnan(rates[0])
    first = np.argmax(np.where(np.isnan(rates), -np.inf, rates), axis=0)
    found = {
        name: np.where(gap, np.nan, np.take_along_axis(table, first[None], axis=0)[0]).tolist()
        for name, table in (("growth_rate", rates), ("frequency", frequencies))
    }
    return found | {"symmetry": np.where(gap, None, np.array(names, object)[first]).tolist()}


def other_law(case: Case) -> str:
    """The continuity law that a case does not use."""
    return QUASI_STEADY if case.fluid.continuity == STORAGE else STORAGE


def require_two_laws(case: Case, study: str, without: str = "") -> None:
    """Refuse to compare laws where none is at work; `without` says why where the study knows.

    Raises
    ------
    CaseError
    """
    if not without and not case.continuity:
        without = "drive.kind is 'uniform'" if case.drive.kind != "flow" else "fluid.unsteady is false"
    if without:
        raise CaseError(
            f"{study}.continuity is given as 'both', but {without}, so that no continuity law is at work; it must be "
            "'case' then.",
            key=f"{study}.continuity",
        )


def compare_states(own: str, stable: bool | None, other: str, other_stable: bool | None) -> str:
    """Sentence on what two laws say about one state."""
    if stable == other_stable and stable is not None:
        return f"Both continuity laws find the state {_WORDS[stable]}."
    said = f"{_WORDS[stable]} under {own}, {_WORDS[other_stable]} under {other}"
    if None in (stable, other_stable):
        return f"The continuity laws cannot be compared: {said}."
    return f"The continuity laws disagree: {said}. Of the two, {_WHY}."


def compare_ranges(name: str, disagreements: Iterable[tuple[float, float, str]], unit: str, scale: float) -> str:
    """Sentence on the stretches (start, stop, law that is stable) of a parameter in which two laws disagree."""
    found = [
        f"from {low / scale:.4g} to {high / scale:.4g} {unit}".strip() + f" (stable under {law} alone)"
        for low, high, law in disagreements
    ]
    if not found:
        return f"Both continuity laws say the same about stable or not wherever both are certain along {name}."
    return f"The continuity laws disagree over {name} {', '.join(found)}. Of the two, {_WHY}."
