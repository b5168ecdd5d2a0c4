"""The thesis, figure by figure: what this model gives beside what was published.

`entry` says what one figure or table is, and runs what several of them share and keeps it in files; the entries
stand by subject in `materials`, `openings` and `histories`.
"""

from collections.abc import Sequence

from ..errors import CaseError
from . import histories, materials, openings  # noqa: F401  declare their entries
from .entry import DECLARED, Entry, Number, Workshop

#: All entries, in the order of the thesis.
ENTRIES: tuple[Entry, ...] = tuple(sorted(DECLARED, key=lambda entry: entry.place))

__all__ = ["ENTRIES", "Entry", "Number", "Workshop", "choose_entries"]


def choose_entries(names: Sequence[str]) -> list[Entry]:
    """Entries by their names, all without names. Raises CaseError for a name that there is no entry of."""
    known = {entry.name: entry for entry in ENTRIES}
    for name in names:
        if name not in known:
            raise CaseError(f"There is no entry {name!r}; there are {', '.join(known)}.")
    return [known[name] for name in dict.fromkeys(names)] if names else list(ENTRIES)
