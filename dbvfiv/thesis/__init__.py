"""The thesis, figure by figure: what this model gives beside what was published.

`entry` says what one figure or table is, `workshop` runs what several of them share and keeps it in files; the entries
stand by subject in `materials`, `strip`, `openings`, `shutting`, `histories` and `flutter`.
"""

from . import flutter, histories, materials, openings, shutting, strip
from .entry import Entry, Number
from .workshop import Workshop

_SUBJECTS = (materials, strip, openings, shutting, histories, flutter)
#: All entries, in the order of the thesis.
ENTRIES: tuple[Entry, ...] = tuple(
    sorted((entry for subject in _SUBJECTS for entry in subject.ENTRIES), key=lambda entry: entry.place)
)

__all__ = ["ENTRIES", "Entry", "Number", "Workshop"]
