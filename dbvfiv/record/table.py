"""Tables of a result: columns with units and descriptions, how rows lie in a file and how they are printed."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any

import h5py
import numpy as np

LAYOUT = 2
TEXT = "text"


@dataclass(frozen=True)
class Shown:
    """Format of a quantity in a printed table.

    Attributes
    ----------
    title, unit : str
    width : int
    write : callable
        From a row (any object with the column as attribute) to text.
    """

    title: str
    unit: str
    width: int
    write: Callable[[Any], str]


@dataclass(frozen=True)
class Column:
    """One quantity of a table.

    Attributes
    ----------
    name : str
        May hold a slash for a subgroup.
    units : str
        SI; empty for plain numbers.
    description : str
    dtype : str
        A numpy type, or ``TEXT``.
    shown : Shown, optional
        How it is printed; not at all without.
    earlier : float, optional
        What its rows are in files of earlier versions, which do not have it.
    """

    name: str
    units: str
    description: str
    dtype: str = "f8"
    shown: Shown | None = None
    earlier: float | None = None

    def __reduce__(self) -> tuple:
        """For pickle; how it is printed is no data and stays behind."""
        return Column, (self.name, self.units, self.description, self.dtype, None, self.earlier)

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


#: Dataset that marks whole rows.
MARK = "#"
#: Bytes kept for a text in a row.
TEXT_BYTES = 400


@dataclass(frozen=True)
class TableSpec:
    """Columns that grow together.

    Attributes
    ----------
    name : str
    columns : tuple of Column
    shapes : mapping of str to tuple of int
        Shape of one row of the columns that are not scalars.
    chunk : int
        Rows of scalar columns that are stored together; those with a shape are stored row by row up to 64 kB.
    later : bool
        Files of earlier versions do not have it; they are read as if it had no rows.
    """

    name: str
    columns: tuple[Column, ...]
    shapes: dict[str, tuple[int, ...]] = field(default_factory=dict)
    chunk: int = 64
    later: bool = False

    def create(self, parent: h5py.Group) -> None:
        """Make the empty columns in a file."""
        group = parent.create_group(self.name)
        for column in self.columns:
            shape, dtype = self.shape(column), self.dtype(column)
            size = max(1, int(np.prod(shape)) * dtype.itemsize)
            rows = max(1, min(self.chunk, 65536 // size)) if shape else self.chunk
            dataset = group.create_dataset(
                column.name,
                (0, *shape),
                dtype,
                maxshape=(None, *shape),
                chunks=(rows, *(max(1, n) for n in shape)),
            )
            column.mark(dataset)
        group.create_dataset(MARK, (0,), "u1", maxshape=(None,), chunks=(self.chunk,))

    def shape(self, column: Column) -> tuple[int, ...]:
        """Shape of one row of a column."""
        return tuple(self.shapes.get(column.name, ()))

    @staticmethod
    def dtype(column: Column) -> np.dtype:
        """Numpy type of a column in a file; texts have a fixed length, as single-writer mode knows no other."""
        return np.dtype(f"S{TEXT_BYTES}") if column.dtype == TEXT else np.dtype(column.dtype)

    def stored(self, column: Column, values: np.ndarray) -> np.ndarray:
        """Values of a column as they lie in a file."""
        if column.dtype == TEXT:
            return np.array([str(value).encode()[:TEXT_BYTES] for value in values], self.dtype(column))
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
        return values.decode() if isinstance(values, bytes) else np.array([value.decode() for value in values], object)
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


def printed_head(columns: Iterable[Column]) -> list[str]:
    """Titles and units above a printed table."""
    shown = [c.shown for c in columns if c.shown is not None]
    return [
        " ".join(s.title.rjust(s.width) for s in shown).rstrip(),
        " ".join(s.unit.rjust(s.width) for s in shown).rstrip(),
    ]


def printed_row(columns: Iterable[Column], row: Any) -> str:
    """One line of a printed table."""
    shown = [c.shown for c in columns if c.shown is not None]
    return " ".join(s.write(row).rjust(s.width) for s in shown).rstrip()


def _text(value: bytes) -> str:
    return value.decode(errors="ignore")
