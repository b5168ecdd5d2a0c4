"""The result file of an onset run, written point by point."""
from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Mapping

import numpy as np

from ..studies.observer import Observer
from .files import create
from .header import Header, write_header
from .layout import TEXT, Table, replace_texts
from .mesh import MeshData, write_mesh
from .stability_tables import ONSETS, SCAN

if TYPE_CHECKING:
    from ..studies.onset import OnsetPoint, OnsetResult


class OnsetFile(Observer):
    """Observer that keeps every onset as soon as it is found; a context manager.

    Raises
    ------
    CaseError
        If the file cannot be written.
    """

    def __init__(self, path: str | Path, header: Header, mesh: MeshData):
        self.path = Path(path)
        self._file = create(path)
        write_header(self._file, header)
        self._file.attrs["complete"] = False
        write_mesh(self._file, mesh)
        self._messages = self._file.create_group("messages")
        replace_texts(self._messages, "warnings", ())
        replace_texts(self._messages, "failures", ())
        self._new()
        self._file.flush()

    def _new(self) -> None:
        for name in ("onsets", "scan"):
            if name in self._file:
                del self._file[name]
        sides = {c.name: (2,) for c in ONSETS if c.name.startswith("sides/")}
        self._points = Table.create(self._file.create_group("onsets"), ONSETS, sides)
        self._scan = Table.create(self._file.create_group("scan"), SCAN, {"growth_rates": (4,), "frequencies": (4,)}, chunk=64)

    def item(self, result: Any) -> None:
        """Keep a point (`dbvfiv.studies.onset.OnsetPoint`)."""
        self._points.append(row_of_point(result))

    def conclude(self, result: "OnsetResult") -> None:
        """Write what the whole run knows: the points with their uncertainty, and the scan."""
        self.finish([row_of_point(p) for p in result.points], scan_rows(result), result.warnings, result.failures, not result.interrupted)

    def finish(self, points, scan, warnings, failures, complete: bool) -> None:
        """Write points and scan from their columns, the messages, and whether the run went to its end."""
        self._new()
        for row in points:
            self._points.append(row)
        for row in scan:
            self._scan.append(row)
        replace_texts(self._messages, "warnings", warnings)
        replace_texts(self._messages, "failures", failures)
        self._file.attrs["complete"] = bool(complete)
        self._file.flush()

    def close(self) -> None:
        self._file.close()

    def __enter__(self) -> "OnsetFile":
        return self

    def __exit__(self, *error: object) -> None:
        self.close()


def row_of_point(point: "OnsetPoint") -> dict[str, Any]:
    """Columns of a point."""
    summary = point.summary()
    row: dict[str, Any] = {}
    for column in ONSETS:
        if column.name.startswith("sides/"):
            name = column.name.split("/")[1]
            row[column.name] = np.array([summary["below"][name], summary["above"][name]])
            continue
        value = summary[column.name]
        row[column.name] = ("" if column.dtype == TEXT else np.nan) if value is None else value
    return row


def scan_rows(result: "OnsetResult") -> list[Mapping[str, Any]]:
    """Columns of the scan."""
    rows = zip(result.values, result.growth_rates, result.frequencies)
    return [{"value": float(v), "growth_rates": g, "frequencies": f} for v, g, f in rows]
