"""Storage of an onset run's samples and points in a record, and their restart."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...observer import Observer
from ...record.mesh import MeshData
from ...record.record import GrowingRecord, Record
from ...record.table import Column, TableSpec
from ..case import Case
from ..stability.crossings import WATCHED
from ..stability.verdict import Verdict
from .point import OnsetPoint, OnsetSample

SCAN = "scan"
_COLUMNS = (
    Column("value", "SI", "Values of the scan, those of narrow tongues and of the search for onsets included"),
    Column("growth_rates", "1/s", "Of the leading modes; NaN where there are fewer"),
    Column("angular_frequencies", "rad/s", "Of the leading modes"),
    Column("mesh", "", "0 for the mesh of the case, 1 for the coarser one", "i8"),
    Column("solved", "", "Whether a state was found; a note says why not", "bool"),
    Column("certified", "", "Whether an independent count agrees with the unstable modes there", "bool"),
)
_POINT, _GAP, _VERDICT = "point", "gap", "verdict"


def tables_of(_mesh: MeshData) -> tuple[TableSpec]:
    """Tables of an onset result. Points are notes: what more is known about one is noted again."""
    shape = (WATCHED,)
    return (TableSpec(SCAN, _COLUMNS, {"growth_rates": shape, "angular_frequencies": shape}),)


class KeepItems(Observer):
    """Keeps every sample and point as soon as it is found.

    Parameters
    ----------
    record : GrowingRecord
    """

    def __init__(self, record: GrowingRecord):
        self.record = record

    def item(self, result: object) -> None:
        if isinstance(result, OnsetSample):
            self.record.note(_VERDICT, value=result.value, mesh=result.mesh, **result.verdict.summary())
            if result.failure:  # before the row, which vouches for it
                self.record.note(_GAP, value=result.value, mesh=result.mesh, text=result.failure)
            self.record.append(SCAN, _row(result))
        elif isinstance(result, OnsetPoint):
            self.record.note(_POINT, **result.summary())


def read_samples(record: Record) -> list[OnsetSample]:
    """Samples in the order they were found in."""
    reasons = {(note["value"], note["mesh"]): note["text"] for note in record.notes(_GAP)}
    verdicts = {(note["value"], note["mesh"]): Verdict.read(note) for note in record.notes(_VERDICT)}
    names = ("value", "mesh", "solved", "certified")
    rows = zip(*(record.column(SCAN, name).tolist() for name in names))
    modes = 1j * record.column(SCAN, "angular_frequencies")
    modes += record.column(SCAN, "growth_rates")
    found = []
    for (value, mesh, solved, certified), eigenvalues in zip(rows, modes):
        kept = eigenvalues[np.isfinite(eigenvalues)]
        verdict = verdicts.get((value, mesh)) or _earlier(kept, certified)
        found.append(OnsetSample(value, kept, mesh, "" if solved else reasons[value, mesh], certified, verdict))
    return found


def _earlier(eigenvalues: np.ndarray, certified: bool) -> Verdict:
    """Verdict on a sample of a file of an earlier version, which has no counts."""
    unstable = int(np.sum(np.where(eigenvalues.imag > 0, 2, 1)[eigenvalues.real > 0]))
    return Verdict.of(eigenvalues, unstable, unstable, certified, proven=False)


def read_points(record: Record) -> list[dict[str, Any]]:
    """Latest note on each onset point, in ascending order of the parameter."""
    latest = {(*note["bracket"], note["ahead"]): note for note in record.notes(_POINT)}
    points = [{name: value for name, value in note.items() if name != "what"} for note in latest.values()]
    return sorted(points, key=lambda point: point["value"])


def known_items(record: Record, case: Case) -> list[OnsetSample | OnsetPoint]:
    """Samples and points that an interrupted run had found, for `run_onset`."""
    return [*read_samples(record), *(OnsetPoint.of(point, case) for point in read_points(record))]


def _row(sample: OnsetSample) -> dict[str, Any]:
    modes = np.full(WATCHED, complex(np.nan, np.nan))
    kept = sample.eigenvalues[:WATCHED]
    modes[: len(kept)] = kept
    return {
        "value": sample.value,
        "growth_rates": modes.real,
        "angular_frequencies": modes.imag,
        "mesh": sample.mesh,
        "solved": not sample.failure,
        "certified": sample.certified,
    }
