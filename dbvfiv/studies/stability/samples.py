"""Samples of the parameter space, leading eigenvalues with both counts of the unstable ones, and their storage.

Studies over parameters keep all they find of states in one table of samples. The verdict on a state follows from its
sample.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from eigen.columns import DIRECT, MISSING, Cell
from eigen.spectrum import number_right_of

from ...model.leading import LeadingSearch
from ...record.record import GrowingRecord, Record
from ...record.table import Column, TableSpec
from ...texts import shortly
from .dimensions import CLASS_NAMES, VARIANT
from .verdict import NEUTRAL, OUTCOMES, UNDECIDED, Verdict

#: Modes whose order is watched.
WATCHED = 4
#: Eigenvalues kept of a sample.
KEPT = 8


class SampleKey(NamedTuple):
    """Key of a sample of one run, besides the value of its line's parameter."""

    continuity: float = 0.0
    symmetry: str = ""
    mesh: int = 0
    across: float = np.nan


@shortly
@dataclass(frozen=True, eq=False)
class Sample:
    """Leading eigenvalues at one parameter point, and both counts of the unstable ones."""

    value: float  #: Of the parameter of the line.
    #: (k,), 1/s; sorted by growth rate, a conjugate pair given once.
    eigenvalues: np.ndarray = field(default_factory=lambda: np.zeros(0, complex))
    #: unstable and counted: unstable eigenvalues by the spectrum and by the argument principle, conjugates counted
    #: apart; -1 where nobody asked.
    unstable: int = -1
    counted: int = -1
    certain: bool = False  #: The count followed its phase, and what both rest on is accurate enough.
    #: line and band: 1/s, Hz; growth rate counted from, and frequency up to which the sample is a verdict.
    line: float = 0.0
    band: float = np.inf
    sealed: bool = False  #: The faces of a bill that is moulded shut hold each other, and nothing flows.
    how: int = MISSING  #: `eigen.columns.REDUCED`, `DIRECT` or `MISSING`.
    failure: str = ""  #: Why there is no spectrum; empty if there is one.
    refusal: str = ""  #: Why the constants of the rubber do not hold; empty where they do.
    #: What a count finds above the band up to which the state is stable; empty where it finds nothing.
    left_open: str = ""
    key: SampleKey = SampleKey()

    @classmethod
    def of(cls, value: float, cell: Cell, search: LeadingSearch | None = None, sealed: bool = False) -> Sample:
        """Sample of a cell, which speaks for the state as far as the search for its modes does."""
        own, left_open = cell.certificate, ""
        band = own.band
        if search and own.agrees and number_right_of(cell.leading, own.line, search.claimed) == own.unstable:
            band = min(band, search.claimed)  # none of those counted lies above it
        if search and cell.open_above:
            left_open = search.left_open(band)
        counts = own.unstable, own.counted, own.certain
        leading = np.asarray(cell.leading)[:KEPT]
        return cls(value, leading, *counts, own.line, band, sealed, cell.how, left_open=left_open)

    @cached_property
    def growth(self) -> np.ndarray:
        """(KEPT,) largest growth rates; very negative where there are fewer."""
        found = np.full(KEPT, -1e9)
        kept = self.eigenvalues.real[:KEPT]
        found[: len(kept)] = kept
        return found

    @cached_property
    def moving(self) -> np.ndarray:
        """(KEPT,) bool, whether these growth rates are more than rounding."""
        return np.abs(self.growth) > NEUTRAL * np.pad(np.abs(self.eigenvalues), (0, KEPT))[:KEPT]

    @property
    def growing(self) -> np.ndarray:
        """(k,) bool, modes whose growth is more than rounding."""
        return self.eigenvalues.real > NEUTRAL * np.abs(self.eigenvalues)

    @property
    def pairs(self) -> int:
        """Unstable modes, a pair being one."""
        return int(np.sum(self.growing))

    @property
    def certified(self) -> bool | None:
        """True where both counts agree and leave nothing open; None where nobody counted."""
        agrees = self.certain and self.unstable == self.counted and not self.left_open
        return None if self.counted < 0 else bool(agrees)

    @property
    def is_missing(self) -> bool:
        return bool(self.failure or self.refusal)

    @cached_property
    def verdict(self) -> Verdict:
        """Stability at the parameter point."""
        if self.refusal:
            return Verdict.not_valid(self.refusal)
        if self.failure:
            return Verdict.undecided(self.failure)
        counts, region = (self.unstable, self.counted, self.certain), {"line": self.line, "band": self.band}
        found = Verdict.of(self.eigenvalues, *counts, proven=self.how == DIRECT, sealed=self.sealed, **region)
        return found.open_above(self.left_open) if self.left_open else found

    def number(self, name: str) -> float:
        """A quantity by its name, for tables over several parameters: growth_rate, frequency (of the leading mode),
        unstable, counted, certified, sealed, how or outcome.
        """
        if name == "outcome":
            return OUTCOMES.index(self.verdict.outcome)
        if name in ("growth_rate", "frequency"):
            value = self.eigenvalues[0] if len(self.eigenvalues) else complex(np.nan, np.nan)
            return float(value.imag / (2 * np.pi) if name == "frequency" else value.real)
        return getattr(self, name) or 0


# -- storage

SAMPLES, _TEXT = "samples", "no sample"
_MISSING, _OPEN = ("failure", "refusal"), ("left_open",)
#: Of these a sample is read; what follows from it stands besides for whoever reads the table.
_OWN = (
    *VARIANT,
    Column("mesh", "", "0 for the mesh of the case, 1 for the coarser one", "i8"),
    Column("across", "SI", "Value of the parameter across in a map; NaN along a single line"),
    Column("value", "SI", "Value of the parameter"),
    Column("unstable", "", "Unstable eigenvalues listed, conjugates counted apart; -1 where there is no list", "i8"),
    Column("counted", "", "The same by the argument principle; -1 where nobody asked", "i8"),
    Column("certain", "", "Whether that count, and what both rest on, can be relied on", "bool"),
    Column("line", "1/s", "Growth rate counted from"),
    Column("band", "Hz", "Frequency up to which the sample is a verdict; infinite for all"),
    Column("sealed", "", "Whether the faces of a bill that is moulded shut hold each other, and nothing flows", "bool"),
    Column("how", "", "0 on the reduced-order model, 1 with the full matrices, 2 none; a note says why", "i8"),
)
_FURTHER = (
    Column("growth_rate", "1/s", "Of the leading mode"),
    Column("frequency", "Hz", "Of the leading mode"),
    Column("outcome", "", f"Verdict: {', '.join(f'{i} {name}' for i, name in enumerate(OUTCOMES))}", "i8"),
)
_MODES = (
    Column("growth_rates", "1/s", "Of the leading modes; NaN where there are fewer", shape=(KEPT,)),
    Column("angular_frequencies", "rad/s", "Of the leading modes", shape=(KEPT,)),
)
SAMPLE_TABLE = TableSpec(SAMPLES, (*_OWN, *_MODES, *_FURTHER), chunk=512)


def keep_samples(record: GrowingRecord, samples: Sequence[Sample]) -> None:
    """Keep samples as rows; why one is missing or open is noted before its row, which vouches for it. A row in the
    place of one that was cut off takes back what was noted of that.
    """
    rows, noted = [], {note["row"] for note in record.notes(_TEXT)}
    for number, sample in enumerate(samples, record.rows(SAMPLES)):
        texts = {name: text for name in _MISSING + _OPEN if (text := getattr(sample, name))}
        if texts or number in noted:
            record.note(_TEXT, row=number, **texts)
        modes = np.full(KEPT, complex(np.nan, np.nan))
        modes[: len(sample.eigenvalues)] = sample.eigenvalues[:KEPT]
        row = vars(sample) | sample.key._asdict() | {column.name: sample.number(column.name) for column in _FURTHER}
        row |= {"symmetry": CLASS_NAMES.index(sample.key.symmetry)}
        rows.append(row | {"growth_rates": modes.real, "angular_frequencies": modes.imag})
    record.extend(SAMPLES, {column.name: [row[column.name] for row in rows] for column in SAMPLE_TABLE.columns})


def read_samples(record: Record) -> list[Sample]:
    """Samples in the order they were found in."""
    texts = {note["row"]: note for note in record.notes(_TEXT)}
    modes = 1j * record.column(SAMPLES, "angular_frequencies")
    modes += record.column(SAMPLES, "growth_rates")
    found = []
    for i, row in enumerate(record.table_rows(SAMPLE_TABLE, [*(column.name for column in _OWN), "outcome"])):
        row["symmetry"] = CLASS_NAMES[row["symmetry"]]
        key = SampleKey(**{name: row.pop(name) for name in SampleKey._fields})
        undecided = row.pop("outcome") == OUTCOMES.index(UNDECIDED)
        vouched = _MISSING if row["how"] == MISSING else _OPEN if undecided else ()
        text = {name: texts.get(i, {}).get(name, "") for name in vouched}
        found.append(Sample(eigenvalues=modes[i][np.isfinite(modes[i])], key=key, **row, **text))
    return found
