"""Record of a run: tables of rows, and notes; the same while the run goes on, when it has ended, and from a file.

HDF5's single-writer mode keeps a file readable at any moment, whatever ends the process, but allows nothing new in it
but rows. So every dataset exists from the start: the columns of the tables, a mark for each whole row that is written
after the row has reached the file, and a log of one JSON document a line for whatever has no fixed shape.

Layout::

    /                 attributes: kind, layout, name, program, created, command
    /case, /versions  see `dbvfiv.record.files`
    /mesh             see `mesh`
    /tables/NAME/...  one dataset a column, with units and description
    /tables/NAME/#    1 for each whole row
    /log              bytes: JSON documents, each closed by a line feed
"""

from __future__ import annotations

import json
import os
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from ..case.model import Case
from ..errors import CaseError, DiskFull, as_path
from ..observer import Observer
from .files import (
    DeferredSignals,
    Header,
    WriterLock,
    older_program,
    read_header,
    reading,
    refuse_foreign,
    unwritable,
    write_header,
)
from .mesh import MeshData, read_mesh, write_mesh
from .table import MARK, TableSpec, pack_documents, read_column, read_rows

#: Room that is left on a disk besides what is to be written, bytes: for the structure of the file.
_SPARE = 384 * 1024


class Journal(AbstractContextManager):
    """A result file open for writing; a context manager. Raises CaseError if the file cannot be written or is being
    written by another process. Raises DiskFull.

    Parameters
    ----------
    path : path
        A result of that name is left until `take_name`, any other file for good.
    mesh : MeshData, optional
    tables : iterable of TableSpec
    known : Record, optional
        What an earlier attempt found, which is written first; the file takes its name after that only, so that nothing
        is lost whenever the process ends.
    """

    def __init__(
        self,
        path: str | Path,
        header: Header,
        mesh: MeshData | None,
        tables: Iterable[TableSpec],
        known: Record | None = None,
    ):
        self.path = Path(path)
        if self.path.is_symlink():  # the file that it leads to is replaced
            self.path = self.path.resolve()
        self._tables = {table.name: table for table in tables}
        refuse_foreign(self.path)
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise unwritable(self.path, error) from None
        replaces = self.path.exists() and self.path.stat().st_size > 0
        self._lock = WriterLock(self.path)
        self._file: h5py.File | None = None
        self._new: Path | None = self.path.with_name(f".{self.path.name}.{os.getpid()}.new")
        try:
            _remove_left_over(self.path)
            self._require_room(_size_of(mesh))
            file = self._file = h5py.File(self._new, "w", libver="latest", locking=False)
            write_header(file, header)
            if mesh is not None:
                write_mesh(file, mesh)
            for table in self._tables.values():
                table.create(file.require_group("tables"))
            log = file.create_dataset("log", (0,), "u1", maxshape=(None,), chunks=(4096,))
            log.attrs["description"] = "JSON documents, each closed by a line feed"
            if known is not None:
                self._copy(known)
            file.swmr_mode = True  # before it has the name: whoever opens it then sees that it grows
            if not replaces:
                self.take_name()
        except BaseException:
            self.close()
            raise

    def take_name(self) -> None:
        """Let the file take its name: once there is something in it that must not be lost."""
        if self._new is not None:
            self._lock.move(self._new)
            self._new = None

    def extend(self, table: str, columns: Mapping[str, np.ndarray]) -> None:
        """Add rows to a table, column by column, and see them into the file. Raises DiskFull."""
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

    def _copy(self, record: Record) -> None:
        """Add all rows and notes of a record."""
        for name, table in self._tables.items():
            self.extend(name, {c.name: record.column(name, c.name) for c in table.columns})
        self.write_log(pack_documents(record.log))

    def write_log(self, documents: bytes) -> None:
        """Add documents, packed as lines, to the log. Raises DiskFull."""
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
            if self._new is not None:
                self._new.unlink(missing_ok=True)
            self._lock.release()

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


class Record(ABC):
    """Rows and notes of one run, to be read."""

    header: Header
    mesh: MeshData | None
    path: Path | None  #: Its file.
    _log: list[dict[str, Any]]

    @abstractmethod
    def rows(self, table: str) -> int:
        """Number of rows of a table."""

    @abstractmethod
    def column(self, table: str, name: str) -> np.ndarray:
        """All rows of a column (rows, ...)."""

    @abstractmethod
    def value(self, table: str, name: str, row: int) -> Any:
        """One row of a column."""

    @property
    def log(self) -> list[dict[str, Any]]:
        """All notes in their order; each names its kind as "what"."""
        return self._log

    def notes(self, what: str) -> list[dict[str, Any]]:
        """Notes of one kind."""
        return [note for note in self.log if note["what"] == what]

    def latest(self, what: str) -> list[dict[str, Any]]:
        """Notes of one kind of the last attempt: whoever goes on from an earlier one says again what still holds."""
        log = self.log
        last = max((i for i, note in enumerate(log) if note["what"] == "begin"), default=0)
        return [note for note in log[last:] if note["what"] == what]

    @property
    def warnings(self) -> tuple[str, ...]:
        """Sentences, each once."""
        return self._said("warning")

    @property
    def failures(self) -> tuple[str, ...]:
        """Sentences on states that were not reached."""
        return self._said("failure")

    @property
    def settled(self) -> str:
        """Sentence on strain levels that were settled for this run; empty where the case names them."""
        return next((note["text"] for note in reversed(self.log) if note["what"] == "settled"), "")

    def _said(self, what: str) -> tuple[str, ...]:
        return tuple(dict.fromkeys(note["text"] for note in self.latest(what)))

    @property
    def complete(self) -> bool:
        """True where the run went to its end."""
        marks = [note for note in self.log if note["what"] in ("begin", "end")]
        return bool(marks) and marks[-1]["what"] == "end" and bool(marks[-1]["complete"])

    def table_rows(self, spec: TableSpec, names: Iterable[str] | None = None) -> list[dict[str, Any]]:
        """Rows of a table as dicts of the columns named, all by default."""
        chosen = [c.name for c in spec.columns] if names is None else list(names)
        columns = {name: self.column(spec.name, name) for name in chosen}
        return [{name: plain(values[i]) for name, values in columns.items()} for i in range(self.rows(spec.name))]


class GrowingRecord(Record, Observer, AbstractContextManager):
    """The record of a run that goes on; what it is given it keeps, in its file too if it has one. Raises CaseError if
    the file cannot be written.

    It is also the observer of the run: progress, items and warnings go on to whoever watches.

    Parameters
    ----------
    mesh : MeshData, optional
    tables : iterable of TableSpec
    output : path, optional
        Result file.
    watcher : Observer, optional
    known : Record, optional
        An earlier attempt that this one goes on from; its rows and notes are the first of this one.
    """

    def __init__(
        self,
        header: Header,
        mesh: MeshData | None,
        tables: Iterable[TableSpec],
        output: str | Path | None = None,
        watcher: Observer | None = None,
        known: Record | None = None,
    ):
        self.header, self.mesh, self.watcher = header, mesh, watcher or Observer()
        #: Warnings of a study once it begins: one that refuses what it is asked says nothing else.
        self.first: Sequence[str] = ()
        self.path = None if output is None else as_path(output, "A result file")
        self.tables = {table.name: table for table in tables}
        self._rows = {
            name: {c.name: [table.block(c, ())] for c in table.columns} for name, table in self.tables.items()
        }
        self._log = []
        self._journal: Journal | None = None
        if known is not None:
            for name, table in self.tables.items():
                if known.rows(name):
                    self.extend(name, {c.name: known.column(name, c.name) for c in table.columns})
            self._log.extend(known.log)
        if self.path is not None:
            self._journal = Journal(self.path, header, mesh, self.tables.values(), self)
        self.note("begin")

    # -- reading ----

    def rows(self, table: str) -> int:
        first = next(iter(self._rows[table].values()))
        return sum(len(block) for block in first)

    def column(self, table: str, name: str) -> np.ndarray:
        blocks = self._rows[table][name]
        if len(blocks) > 1:
            blocks[:] = [np.concatenate(blocks)]
        return blocks[0]

    def value(self, table: str, name: str, row: int) -> Any:
        return self.column(table, name)[row]

    # -- growing ----

    def append(self, table: str, row: Mapping[str, Any]) -> None:
        """Keep one row."""
        self.extend(table, {c.name: [row[c.name]] for c in self.tables[table].columns})

    def extend(self, table: str, columns: Mapping[str, Any]) -> None:
        """Keep rows, given column by column."""
        spec = self.tables[table]
        blocks = {c.name: spec.block(c, columns[c.name]) for c in spec.columns}
        with DeferredSignals():
            for name, block in blocks.items():
                self._rows[table][name].append(block)
            if self._journal is not None:
                self._take_name()
                self._journal.extend(table, blocks)

    def note(self, what: str, **data: Any) -> None:
        """Keep a note: plain data, arrays included, under a kind of its own."""
        text = pack_documents([{"what": what} | data])
        with DeferredSignals():
            self._log.append(json.loads(text))  # as a file gives it back
            if self._journal is not None:
                self._journal.write_log(text)

    def _take_name(self) -> None:
        """Replace an earlier result: a run that is refused before it begins leaves that alone."""
        if self._journal is not None:
            self._journal.take_name()

    def fail(self, sentence: str) -> None:
        """Keep what was not reached, and say it."""
        self._take_name()
        self.note("failure", text=sentence)
        self.watcher.warn(sentence)

    def conclude(self, complete: bool) -> None:
        """Note that the run is over."""
        self._take_name()
        self.note("end", complete=complete)

    def close(self) -> None:
        """Close the file."""
        if self._journal is not None:
            self._journal.close()
            self._journal = None

    def __exit__(self, *error: object) -> None:
        self.close()

    def __getstate__(self) -> dict[str, Any]:
        """State without the file and the observer: a copy of the record writes nothing."""
        return vars(self) | {"_journal": None, "watcher": Observer()}

    # -- as an observer ----

    def begin(self, study: str, total: int | None) -> None:
        self._take_name()
        self.watcher.begin(study, total)
        told, self.first = self.first, ()
        self.warn(*told)

    def progress(self, text: str) -> None:
        self.watcher.progress(text)

    def item(self, result: object) -> None:
        self.watcher.item(result)

    def warn(self, *sentences: str) -> None:
        for sentence in sentences:
            if sentence not in self.warnings:
                self.note("warning", text=sentence)
            self.watcher.warn(sentence)

    def end(self, interrupted: bool) -> None:
        self.watcher.end(interrupted)


class StoredRecord(Record):
    """A record in a file; its columns are read when they are asked for. Raises CaseError if the file cannot be read.

    Parameters
    ----------
    tables : callable
        From the mesh to the tables that are read.
    case_model : type
        Sections that its case may hold.
    """

    def __init__(
        self, path: str | Path, tables: Callable[[MeshData | None], Iterable[TableSpec]], case_model: type[Case]
    ):
        self.path = Path(path)
        self._columns: dict[tuple[str, str], np.ndarray] = {}
        with reading(self.path) as file:
            self.mesh = read_mesh(file) if "mesh" in file else None
            self.tables = {table.name: table for table in tables(self.mesh)}
            self._log = read_log(file)
            for table in self.tables.values():
                group = file["tables"].get(table.name, ())
                if any(column.name not in group for column in table.columns):
                    raise older_program(self.path, file)
            self._count = {name: read_rows(file["tables"][name]) for name in self.tables}
            self.header = replace(read_header(file, case_model), complete=self.complete)

    def __getstate__(self) -> dict[str, Any]:
        """State with all columns read from the file: a copy can be asked where there is no such file."""
        for name, table in self.tables.items():
            for column in table.columns:
                self.column(name, column.name)
        return vars(self)

    def rows(self, table: str) -> int:
        return self._count[table]

    def column(self, table: str, name: str) -> np.ndarray:
        if (table, name) not in self._columns:
            self._columns[table, name] = self._read(table, name, slice(self._count[table]))
        return self._columns[table, name]

    def value(self, table: str, name: str, row: int) -> Any:
        if (table, name) in self._columns:
            return self._columns[table, name][row]
        return self._read(table, name, range(self._count[table])[row])

    def _read(self, table: str, name: str, rows: slice | int) -> Any:
        column = next(c for c in self.tables[table].columns if c.name == name)
        with reading(self.path) as file:
            return read_column(file["tables"][table], column, rows)

    def cut(self, rows: Mapping[str, int]) -> StoredRecord:
        """Leave out the last rows of tables: those beyond so many, by the names of the tables."""
        self._columns.clear()
        self._count |= {name: min(count, self._count[name]) for name, count in rows.items()}
        return self


def copy_record(record: Record, tables: Iterable[TableSpec], path: str | Path) -> None:
    """Write a record into a file of its own. Raises CaseError if it cannot be written."""
    with Journal(path, record.header, record.mesh, tables, record) as journal:
        journal.take_name()


def plain(value: Any) -> Any:
    """Numbers of Python for those of numpy, tuples for points in space; anything else as it is."""
    if isinstance(value, np.ndarray):
        return tuple(value.tolist()) if value.shape == (3,) else value
    return value.item() if isinstance(value, np.generic) else value


def tabulate(record: Record, spec: TableSpec, form: str) -> Any:
    """Table of a record as a pandas DataFrame (columns with one value a row) or an xarray Dataset (all columns). Raises
    CaseError for another form, or where the package is not installed.
    """
    if form not in ("pandas", "xarray"):
        raise CaseError(f"form is given as {form!r}; it must be 'pandas' or 'xarray'.")
    try:
        library = import_module(form)
    except ImportError:
        raise CaseError(f"Tables of {form} need the package {form}: pip install {form}.") from None
    columns = [column for column in spec.columns if form == "xarray" or not spec.shape(column)]
    values = {column.name: record.column(spec.name, column.name) for column in columns}
    if form == "pandas":
        table = library.DataFrame(values)
        table.attrs["units"] = {column.name: column.units for column in columns}
        table.attrs["descriptions"] = {column.name: column.description for column in columns}
        return table
    table = library.Dataset()
    for column in columns:
        dims = ("row", *(f"{column.name}_{axis}" for axis in range(len(spec.shape(column)))))
        attrs = {"units": column.units, "long_name": column.description}
        table[column.name] = library.Variable(dims, values[column.name], attrs)
    return table
