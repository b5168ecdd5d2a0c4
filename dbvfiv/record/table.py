"""Tables of a result: each column declared once, with the way it is read, kept in a file and printed."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from operator import attrgetter
from typing import Any

import h5py
import numpy as np

from ..texts import shortly

LAYOUT = 4
TEXT = "text"
#: SI value of the units in which numbers are printed, where it is not 1.
PRINTED = {"kPa": 1e3, "static kPa": 1e3, "mm": 1e-3, "cm2": 1e-4, "mm2": 1e-6, "L/s": 1e-3, "%": 1e-2}


@dataclass(frozen=True)
class Shown:
    """Print format of a column."""

    title: str
    unit: str
    width: int
    #: Format of the number in that unit, such as ".3f"; or a function from a row to a text.
    write: str | Callable[[Any], str]


@dataclass(frozen=True)
class Column:
    """One quantity of a table."""

    name: str  #: May hold a slash for a subgroup.
    units: str  #: SI; empty for plain numbers.
    description: str
    dtype: str = "f8"  #: A numpy type, or ``TEXT``.
    shown: Shown | None = None  #: How it is printed; not at all without.
    #: Its value, from the object that a row is made of; the item or attribute of its name without.
    read: Callable[[Any], Any] | None = None
    #: or callable; shape of one row, or a function from the mesh to that; None where a result on the mesh has no such
    #: column.
    shape: tuple[int, ...] | Callable[[Any], tuple[int, ...] | None] = ()

    def __reduce__(self) -> tuple:
        """For pickle; functions that print and read it are no data and stay behind."""
        return Column, (self.name, self.units, self.description, self.dtype)

    def of(self, source: Any) -> Any:
        """Value of the column in a mapping or an object; a slash in its name leads to an attribute of an attribute."""
        if self.read is not None:
            return self.read(source)
        return source[self.name] if isinstance(source, Mapping) else attrgetter(self.name.replace("/", "."))(source)

    def text(self, row: Any) -> str:
        """Printed value in a row."""
        if callable(self.shown.write):
            return self.shown.write(row)
        value = row[self.name] if isinstance(row, Mapping) else getattr(row, self.name)
        scale = PRINTED.get(self.shown.unit)
        return f"{value / scale if scale else value:{self.shown.write}}"

    def mark(self, dataset: h5py.Dataset) -> None:
        """Write units and description beside a dataset."""
        dataset.attrs["units"] = self.units
        dataset.attrs["description"] = self.description


def write_array(group: h5py.Group, column: Column, values: Any) -> None:
    """Write one array with its units and description."""
    if column.dtype == TEXT:
        dataset = group.create_dataset(column.name, data=list(map(str, values)), dtype=h5py.string_dtype())
    else:
        dataset = group.create_dataset(column.name, data=np.asarray(values, column.dtype))
    column.mark(dataset)


def read_array(group: h5py.Group, column: Column) -> Any:
    """Read what `write_array` wrote; texts as a tuple of str."""
    dataset = group[column.name]
    return tuple(dataset.asstr()[:]) if column.dtype == TEXT else dataset[...].astype(column.dtype)


#: Dataset that marks whole rows, and bytes kept for a text in a row.
MARK, TEXT_BYTES = "#", 400


@shortly
@dataclass(frozen=True)
class TableSpec:
    """Columns that grow together."""

    name: str
    columns: tuple[Column, ...]
    #: Shape of one row of the columns that are not scalars, where these do not say it.
    shapes: dict[str, tuple[int, ...]] = field(default_factory=dict)
    #: Rows of scalar columns that are stored together; those with a shape are stored row by row up to 64 kB.
    chunk: int = 64

    @classmethod
    def on(cls, mesh: Any, name: str, columns: Iterable[Column], chunk: int = 64) -> TableSpec:
        """Table with those of some columns that a result on a mesh has."""
        shapes = {c: c.shape(mesh) if callable(c.shape) else c.shape for c in columns}
        kept = {c: shape for c, shape in shapes.items() if shape is not None}
        return cls(name, tuple(kept), {c.name: shape for c, shape in kept.items()}, chunk)

    def row(self, source: Any) -> dict[str, Any]:
        """Row of an object."""
        return {c.name: c.of(source) for c in self.columns}

    @property
    def row_bytes(self) -> int:
        """Bytes of one row in a file."""
        return sum(int(np.prod(self.shape(c))) * self.dtype(c).itemsize for c in self.columns)

    def block(self, column: Column, values: Sequence[Any]) -> np.ndarray:
        """Values of some rows of a column in memory (rows, ...)."""
        dtype = object if column.dtype == TEXT else column.dtype
        return np.asarray(values, dtype).reshape(len(values), *self.shape(column))

    def create(self, parent: h5py.Group) -> None:
        """Make the empty columns in a file."""
        group = parent.create_group(self.name)
        for column in self.columns:
            shape, dtype = self.shape(column), self.dtype(column)
            size = max(1, int(np.prod(shape)) * dtype.itemsize)
            rows = max(1, min(self.chunk, 65536 // size)) if shape else self.chunk
            chunks = (rows, *(max(1, n) for n in shape))
            column.mark(group.create_dataset(column.name, (0, *shape), dtype, maxshape=(None, *shape), chunks=chunks))
        group.create_dataset(MARK, (0,), "u1", maxshape=(None,), chunks=(self.chunk,))

    def shape(self, column: Column) -> tuple[int, ...]:
        """Shape of one row of a column."""
        return tuple(self.shapes.get(column.name, () if callable(column.shape) else column.shape))

    @staticmethod
    def dtype(column: Column) -> np.dtype:
        """Numpy type of a column in a file; texts have a fixed length, as single-writer mode knows no other."""
        return np.dtype(f"S{TEXT_BYTES}") if column.dtype == TEXT else np.dtype(column.dtype)

    def stored(self, column: Column, values: np.ndarray) -> np.ndarray:
        """Values of a column as they lie in a file."""
        if column.dtype == TEXT:
            cut = (str(value).encode()[:TEXT_BYTES] for value in values)
            whole = [text.decode(errors="ignore").encode() for text in cut]  # no part of a letter
            return np.array(whole, self.dtype(column))
        return np.asarray(values, self.dtype(column))


def read_rows(group: h5py.Group) -> int:
    """Whole rows of a table in an open file."""
    marks = group[MARK][:]
    whole = int(np.argmin(marks)) if len(marks) and not marks.all() else len(marks)
    return min([whole, *(len(dataset) for name, dataset in walk(group) if name != MARK)])


def read_column(group: h5py.Group, column: Column, rows: slice | int) -> Any:
    """Rows of a column of an open file; texts as str."""
    values = group[column.name][rows]
    if column.dtype == TEXT:
        if isinstance(values, bytes):
            return values.decode(errors="ignore")
        return np.array([value.decode(errors="ignore") for value in values], object)
    return values


def walk(group: h5py.Group, prefix: str = "") -> Iterable[tuple[str, h5py.Dataset]]:
    """Datasets of a group with their names, subgroups gone through."""
    for name, item in group.items():
        if isinstance(item, h5py.Group):
            yield from walk(item, f"{prefix}{name}/")
        else:
            yield prefix + name, item


def pack_documents(documents: Iterable[Any]) -> bytes:
    """JSON documents as lines; arrays become lists and complex numbers pairs."""
    return b"".join(json.dumps(_plain(document)).encode() + b"\n" for document in documents)


def _plain(value: Any) -> Any:
    if isinstance(value, (np.ndarray, np.generic)):
        value = value.tolist()
    if isinstance(value, complex):
        return [value.real, value.imag]
    if isinstance(value, dict):
        return {str(name): _plain(item) for name, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    return value


def document_of(columns: Iterable[Column], row: Any) -> dict[str, Any]:
    """Plain SI numbers of a row for JSON, by the names of the columns."""
    values = {c.name: getattr(row, c.name) for c in columns}
    return {name: list(value) if isinstance(value, tuple) else value for name, value in values.items()}


def printed_head(columns: Iterable[Column]) -> list[str]:
    """Titles and units above a printed table."""
    shown = [c.shown for c in columns if c.shown is not None]
    return [" ".join(getattr(s, part).rjust(s.width) for s in shown).rstrip() for part in ("title", "unit")]


def printed_row(columns: Iterable[Column], row: Any) -> str:
    """One line of a printed table."""
    return " ".join(c.text(row).rjust(c.shown.width) for c in columns if c.shown is not None).rstrip()
