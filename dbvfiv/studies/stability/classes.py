"""The classes of motion that a study has still to look at."""

from __future__ import annotations

from collections.abc import Iterator

from ...model.symmetry import EQUILIBRIA, Symmetry, chosen_symmetries
from ...record.record import GrowingRecord

#: Kind of the notes that hold what was found, one for each class.
NOTE = "class"


def classes_to_look_at(record: GrowingRecord, chosen: str) -> Iterator[Symmetry]:
    """Those of a choice, "all" or one, that are neither that of the equilibria nor in the record yet."""
    done = {EQUILIBRIA, *(note["symmetry"] for note in record.notes(NOTE))}
    for symmetry in chosen_symmetries(chosen):
        if symmetry.name not in done:
            record.progress(f"class {symmetry.name}: {symmetry.words}")
            yield symmetry
