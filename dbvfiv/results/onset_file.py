"""The result file of an onset run: a journal of samples and points, written as they come and read again to go on.

Nothing in it is ever changed. Of a point that more became known about, the last row counts; they share bracket and
`ahead`.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np

from ..errors import CaseError
from ..observer import Observer
from ..record.files import KeptFile, create, reading, reopen
from ..record.header import Header, read_header, write_header
from ..record.layout import TEXT, Column, Table, replace_texts
from ..record.mesh import MeshData, write_mesh
from ..studies.onset_point import OnsetPoint, OnsetSample, Side
from ..studies.parameters import Place
from .stability_tables import ONSETS, SCAN

if TYPE_CHECKING:
    from ..case.model import Case
    from ..studies.onset import OnsetResult

#: Leading modes kept of a sample.
MODES = 4


class OnsetFile(KeptFile, Observer):
    """Observer that keeps every sample and every onset as soon as it is found; a context manager.

    Parameters
    ----------
    path : path
    header : Header
    mesh : MeshData
    again : bool
        Open the file of an interrupted run and go on.

    Raises
    ------
    CaseError
        If the file cannot be written.
    """

    def __init__(self, path: str | Path, header: Header, mesh: MeshData, again: bool = False):
        self.path = Path(path)
        if again:
            self._file = reopen(path)
            self._messages = self._file["messages"]
            self._points, self._scan = Table(self._file["onsets"], ONSETS), Table(self._file["scan"], SCAN)
            return
        self._file = create(path)
        write_header(self._file, header)
        self._file.attrs["complete"] = False
        write_mesh(self._file, mesh)
        self._messages = self._file.create_group("messages")
        replace_texts(self._messages, "warnings", ())
        replace_texts(self._messages, "failures", ())
        sides = {c.name: (2,) for c in ONSETS if c.name.startswith("sides/")}
        self._points = Table.create(self._file.create_group("onsets"), ONSETS, {"bracket": (2,)} | sides)
        self._scan = Table.create(
            self._file.create_group("scan"), SCAN, {"growth_rates": (MODES,), "frequencies": (MODES,)}, chunk=64
        )
        self._file.flush()

    def item(self, result: Any) -> None:
        """Keep an `OnsetSample` or `OnsetPoint`."""
        if isinstance(result, OnsetSample):
            self._scan.append(row_of_sample(result))
        elif isinstance(result, OnsetPoint):
            self._points.append(row_of_point(result))

    def conclude(self, result: OnsetResult) -> None:
        """Write the messages, and whether the run went to its end."""
        self.finish(result.warnings, result.failures, not result.interrupted)

    def finish(self, warnings, failures, complete: bool, points=(), scan=()) -> None:
        """Rows of points and scan that are not there yet, messages, and whether the run went to its end."""
        for row in points:
            self._points.append(row)
        for row in scan:
            self._scan.append(row)
        replace_texts(self._messages, "warnings", warnings)
        replace_texts(self._messages, "failures", failures)
        self._file.attrs["complete"] = bool(complete)
        self._file.flush()


def row_of_point(point: OnsetPoint) -> dict[str, Any]:
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


def row_of_sample(sample: OnsetSample) -> dict[str, Any]:
    """Columns of a sample."""
    modes = np.full(MODES, np.nan + 0j)
    kept = sample.eigenvalues[:MODES]
    modes[: len(kept)] = kept
    return {
        "value": sample.value,
        "growth_rates": modes.real,
        "frequencies": modes.imag / (2 * np.pi),
        "mesh": sample.mesh,
        "failure": sample.failure,
        "certified": sample.certified,
    }


def read_rows(group: h5py.Group, columns: tuple[Column, ...]) -> list[dict[str, Any]]:
    """Rows of a table, each a dict."""
    table = Table(group, columns)
    # files of an earlier layout lack some
    data = {c.name: table.read(c.name) for c in columns if c.name in group}
    return [{name: values[i] for name, values in data.items()} for i in range(table.rows)]


def latest_points(file: h5py.File) -> list[dict[str, Any]]:
    """Rows of points in ascending order, the last of each."""
    rows = {(*map(float, row["bracket"]), int(row["ahead"])): row for row in read_rows(file["onsets"], ONSETS)}
    return sorted(rows.values(), key=lambda row: row["value"])


def known_items(path: str | Path) -> tuple[list[OnsetSample | OnsetPoint], Header, bool]:
    """What the file of an onset run holds for `run_onset`, its header, and whether the run had gone to its end.

    Raises
    ------
    CaseError
        If it is no onset run.
    """
    with reading(path) as file:
        kind = str(file.attrs["dbvfiv_kind"])
        if kind != "onset":
            raise CaseError(f"{str(path)!r} holds a result of kind {kind!r} and no onsets.")
        header = read_header(file)
        samples = [_sample(row) for row in read_rows(file["scan"], SCAN)]
        points = [_point(row, header.case) for row in latest_points(file)]
        return [*samples, *points], header, bool(file.attrs["complete"])


def _sample(row: Mapping[str, Any]) -> OnsetSample:
    modes = row["growth_rates"] + 2j * np.pi * row["frequencies"]
    modes = modes[np.isfinite(modes)]
    return OnsetSample(float(row["value"]), modes, int(row["mesh"]), str(row["failure"]), bool(row.get("certified")))


def _point(row: Mapping[str, Any], case: Case) -> OnsetPoint:
    parameter, value = case.onset.axis.parameter, float(row["value"])
    names = [name for name in row if name.startswith("sides/")]
    below, above = (Side.of({name.split("/")[1]: row[name][i] for name in names}) for i in (0, 1))
    maybe = {
        name: float(row[name])
        for name in ("first_lyapunov_coefficient", "crossing_speed", "uncertainty", "coarse_value")
        if np.isfinite(row[name])
    }
    flags = {name: bool(row[name]) for name in ("gains", "edge", "confirmed")}
    plain = {name: float(row[name]) for name in ("frequency", "growth_rate")}
    return OnsetPoint(
        parameter,
        value,
        below=below,
        above=above,
        place=Place.of(case).at(**{parameter: value}),
        bracket=tuple(map(float, row["bracket"])),
        ahead=int(row["ahead"]),
        criticality=str(row["criticality"]) or None,
        note=str(row["note"]),
        **plain,
        **flags,
        **maybe,
    )
