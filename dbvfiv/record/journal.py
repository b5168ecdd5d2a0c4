"""The file of a run while it grows: tables of rows and a log, whole or not at all.

HDF5's single-writer mode keeps a file readable at any moment, whatever ends the process, but allows nothing new in it
but rows. So every dataset exists from the start: the columns of the tables, a mark for each whole row that is written
after the row has reached the file, and a log of one JSON document a line for whatever has no fixed shape.

Layout::

    /                 attributes: kind, layout, name, program, created, command
    /case, /versions  see `header`
    /mesh             see `mesh`
    /tables/NAME/...  one dataset a column, with units and description
    /tables/NAME/#    1 for each whole row
    /log              bytes: JSON documents, each closed by a line feed
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from ..errors import CaseError, DiskFull
from .files import WriterLock, refuse_foreign
from .header import Header, write_header
from .mesh import MeshData, write_mesh
from .table import MARK, TableSpec

#: Room that is left on a disk besides what is to be written, bytes: for the structure of the file.
_SPARE = 384 * 1024


class Journal:
    """A result file open for writing; a context manager.

    Parameters
    ----------
    path : path
        A result of that name is replaced when the new one has its first contents; any other file is left alone.
    header : Header
    mesh : MeshData, optional
    tables : iterable of TableSpec
    first : callable, optional
        Given the journal, writes what an earlier attempt found; the file takes its name after that only, so that
        nothing is lost whenever the process ends.

    Raises
    ------
    CaseError
        If the file cannot be written or is being written by another process.
    DiskFull
    """

    def __init__(
        self,
        path: str | Path,
        header: Header,
        mesh: MeshData | None,
        tables: Iterable[TableSpec],
        first: Callable[[Journal], None] | None = None,
    ):
        self.path = Path(path)
        self._tables = {table.name: table for table in tables}
        refuse_foreign(self.path)
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise CaseError(f"The result file {str(self.path)!r} cannot be written ({error.strerror}).") from None
        self._lock = WriterLock(self.path)
        self._file: h5py.File | None = None
        new = self.path.with_name(f".{self.path.name}.{os.getpid()}.new")
        try:
            _remove_left_over(self.path)
            self._require_room(_size_of(mesh))
            file = self._file = h5py.File(new, "w", libver="latest", locking=False)
            write_header(file, header)
            if mesh is not None:
                write_mesh(file, mesh)
            for table in self._tables.values():
                table.create(file.require_group("tables"))
            log = file.create_dataset("log", (0,), "u1", maxshape=(None,), chunks=(4096,))
            log.attrs["description"] = "JSON documents, each closed by a line feed"
            if first is not None:
                first(self)
            file.swmr_mode = True  # before it has the name: whoever opens it then sees that it grows
            self._lock.move(new)
        except BaseException:
            self.close()
            raise
        finally:
            new.unlink(missing_ok=True)

    def extend(self, table: str, columns: Mapping[str, np.ndarray]) -> None:
        """Add rows to a table, column by column, and see them into the file.

        Raises
        ------
        DiskFull
        """
        spec, group = self._tables[table], self._file[f"tables/{table}"]
        arrays = {c.name: np.asarray(columns[c.name]) for c in spec.columns}
        count = {len(values) for values in arrays.values()}
        if len(count) != 1:
            raise ValueError(f"The columns of {table!r} have {sorted(count)} rows; they must have as many.")
        (added,) = count
        if not added:
            return
        self._require_room(sum(spec.stored(c, v).nbytes for c, v in zip(spec.columns, arrays.values())))
        before = len(group[MARK])
        for column in spec.columns:
            dataset = group[column.name]
            dataset.resize(before + added, axis=0)
            dataset[before:] = spec.stored(column, arrays[column.name])
        self._file.flush()
        marks = group[MARK]
        marks.resize(before + added, axis=0)
        marks[before:] = 1
        self._file.flush()

    def write_log(self, documents: bytes) -> None:
        """Add documents, packed as lines, to the log.

        Raises
        ------
        DiskFull
        """
        text = np.frombuffer(documents, "u1")
        self._require_room(len(text))
        log = self._file["log"]
        before = len(log)
        log.resize(before + len(text), axis=0)
        log[before:] = text
        self._file.flush()

    def close(self) -> None:
        """Close the file and let others write it."""
        try:
            if self._file:
                self._file.close()
        finally:
            self._file = None
            self._lock.release()

    def __enter__(self) -> Journal:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def _require_room(self, wanted: int) -> None:
        """HDF5 does not survive a disk that fills up under it, so there must be room before anything is written."""
        disk = os.statvfs(self.path.parent)
        free = disk.f_bavail * disk.f_frsize
        if free < wanted + _SPARE:
            raise DiskFull(
                f"The disk has no room for {str(self.path)!r}: {free / 2**20:.1f} MiB are free and "
                f"{(wanted + _SPARE) / 2**20:.1f} MiB are needed; what was found before is kept."
            )


def _size_of(mesh: MeshData | None) -> int:
    if mesh is None:
        return 0
    return sum(value.nbytes for value in vars(mesh).values() if isinstance(value, np.ndarray))


def _remove_left_over(path: Path) -> None:
    """Take away beginnings of files whose writers were killed."""
    for left in path.parent.glob(f".{path.name}.*.new"):
        writer = left.name.removesuffix(".new").rpartition(".")[2]
        if writer.isdigit() and not Path(f"/proc/{writer}").exists():
            left.unlink(missing_ok=True)


def read_log(file: h5py.File) -> list[Any]:
    """Documents of the log of an open file, as far as they are whole."""
    text = file["log"][:].tobytes()
    return [json.loads(line) for line in text[: text.rfind(b"\n") + 1].splitlines()]
