"""The classes of motion that a study has still to look at."""

from __future__ import annotations

from collections.abc import Iterator

from ...case.part import Part
from ...model.symmetry import Symmetry, chosen_symmetries
from ...record.record import GrowingRecord

#: Kind of the notes that hold what was found, one for each class.
NOTE = "class"


def classes_to_look_at(record: GrowingRecord, chosen: str, part: Part) -> Iterator[Symmetry]:
    """Symmetry classes still to be computed for a choice, "all" or one, on a part of the valve.

    The class of the equilibria and classes that the record holds already are left out.
    """
    done = {note["symmetry"] for note in record.notes(NOTE)}
    for symmetry in chosen_symmetries(chosen, part):
        if not symmetry.of_equilibria and symmetry.name not in done:
            record.progress(f"class {symmetry.name}: {symmetry.words}")
            yield symmetry
