"""The result file of a stability map, written column by column, and read again to go on."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np

from ..errors import CaseError
from ..observer import Observer
from ..record.files import KeptFile, create, reading, reopen
from ..record.header import Header, write_header
from ..record.layout import Table, read_texts, replace_texts
from ..record.mesh import MeshData, write_mesh
from ..studies.map_column import CELLS, MapColumn, MapPlan
from .stability_tables import CHECKS, CURVE_POINTS, MAP, MAP_ONSETS

if TYPE_CHECKING:
    from ..studies.map import MapResult

#: Tables that belong to the end of a run and are written anew by each.
_LAST = {"curves": CURVE_POINTS, "checks": CHECKS}


class MapFile(KeptFile, Observer):
    """Observer that keeps every column as soon as it is finished; a context manager.

    Parameters
    ----------
    path : path
    plan : MapPlan
    header : Header
    mesh : MeshData
    again : bool
        Open the file of an interrupted run and go on.

    Raises
    ------
    CaseError
        If the file cannot be written.
    """

    def __init__(self, path: str | Path, plan: MapPlan, header: Header, mesh: MeshData, again: bool = False):
        self.path = Path(path)
        self._warnings: list[str] = []
        if again:
            self._file = reopen(self.path)
            self._columns, self._onsets = Table(self._file["columns"], MAP), Table(self._file["onsets"], MAP_ONSETS)
            self._messages = self._file["messages"]
            return
        self._file = create(path)
        write_header(self._file, header)
        self._file.attrs["complete"] = False
        write_mesh(self._file, mesh)
        self._messages = self._file.create_group("messages")
        replace_texts(self._messages, "warnings", ())
        replace_texts(self._messages, "failures", ())
        shape = (len(plan.laws), len(plan.along.values))
        self._columns = Table.create(self._file.create_group("columns"), MAP, dict.fromkeys(CELLS, shape))
        self._onsets = Table.create(self._file.create_group("onsets"), MAP_ONSETS, {}, chunk=64)
        self._file.flush()

    def item(self, result: Any) -> None:
        """Keep a finished `MapColumn`; its onsets go first, so that a row of the table vouches for them."""
        column: MapColumn = result
        for law, along, frequency, direction, residual in column.onsets:
            self._onsets.append(
                {
                    "across": column.value,
                    "law": int(law),
                    "along": along,
                    "frequency": frequency,
                    "direction": int(direction),
                    "residual": residual,
                }
            )
        row = {name: column.cells[name] for name in CELLS}
        row |= {"value": column.value, "level": column.level, "onset_count": len(column.onsets), "error": column.error}
        self._columns.append(row | {"failure": column.failure, "seconds": column.seconds})

    def warn(self, sentence: str) -> None:
        self._warnings.append(sentence)
        replace_texts(self._messages, "warnings", self._warnings)
        self._file.flush()

    def conclude(self, result: MapResult) -> None:
        """Write curves, checks and messages, and whether the run went to its end."""
        for name, columns in _LAST.items():
            if name in self._file:
                del self._file[name]
            Table.create(self._file.create_group(name), columns, {}, chunk=64)
        points = Table(self._file["curves"], CURVE_POINTS)
        for number, curve in enumerate(result.curves):
            for x, y, frequency in zip(curve.x, curve.y, curve.frequency):
                points.append(
                    {
                        "curve": number,
                        "law": curve.law,
                        "x": x,
                        "y": y,
                        "frequency": frequency,
                        "exact": curve.exact,
                        "mismatch": curve.mismatch,
                    }
                )
        checks = Table(self._file["checks"], CHECKS)
        for check in result.checks:
            checks.append({c.name: getattr(check, c.name) for c in CHECKS})
        replace_texts(self._messages, "warnings", [w for w in self._warnings if not w.startswith("No column at")])
        replace_texts(self._messages, "failures", result.failures)
        self._file.attrs["complete"] = not result.interrupted
        self._file.flush()


def read_columns(file: h5py.File) -> list[MapColumn]:
    """Finished columns of an open file."""
    table, onsets = Table(file["columns"], MAP), Table(file["onsets"], MAP_ONSETS)
    data = {c.name: table.read(c.name) for c in MAP}
    found = {c.name: onsets.read(c.name) for c in MAP_ONSETS if c.name in file["onsets"]}
    found.setdefault("residual", np.full(onsets.rows, np.nan))  # files of an earlier layout lack it
    columns = []
    for i in range(table.rows):
        mine = np.flatnonzero(found["across"] == data["value"][i])
        # a run killed between the onsets of a column and its row has written them twice
        mine = mine[len(mine) - int(data["onset_count"][i]) :] if len(mine) else mine
        rows = (
            np.column_stack([found[name][mine] for name in ("law", "along", "frequency", "direction", "residual")])
            .astype(float)
            .reshape(-1, 5)
        )
        cells = {name: data[name][i] for name in CELLS}
        columns.append(
            MapColumn(
                float(data["value"][i]),
                int(data["level"][i]),
                cells,
                rows,
                float(data["error"][i]),
                str(data["failure"][i]),
                float(data["seconds"][i]),
            )
        )
    return columns


def known_columns(path: str | Path) -> tuple[list[MapColumn], Any, bool]:
    """Columns of the file of a map, its header, and whether the run had gone to its end.

    Raises
    ------
    CaseError
        If it is no map.
    """
    from ..record.header import read_header

    with reading(path) as file:
        kind = str(file.attrs["dbvfiv_kind"])
        if kind != "map":
            raise CaseError(f"{str(path)!r} holds a result of kind {kind!r} and no map.")
        header = read_header(file)
        return read_columns(file), header, bool(file.attrs["complete"])


def read_messages(file: h5py.File) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Warnings and failures."""
    return read_texts(file, "messages/warnings"), read_texts(file, "messages/failures")
