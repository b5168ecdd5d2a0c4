"""How result files are laid out: tables of columns that grow by a row, units beside every number.

The numbers of a run stand in tables, one HDF5 dataset per column with its ``units`` and ``description``. A row counts
only once the table's ``rows`` attribute says so, which is written last and followed by a flush: a run that is killed
leaves a file that ends at its last whole row.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import h5py
import numpy as np

LAYOUT = 2
TEXT = "text"


@dataclass(frozen=True)
class Shown:
    """How a quantity stands in a printed table.

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
    """

    name: str
    units: str
    description: str
    dtype: str = "f8"
    shown: Shown | None = None

    def __reduce__(self) -> tuple:
        """For pickle; how it is printed is no data and stays behind."""
        return Column, (self.name, self.units, self.description, self.dtype)

    def mark(self, dataset: h5py.Dataset) -> None:
        """Write units and description beside a dataset."""
        dataset.attrs["units"] = self.units
        dataset.attrs["description"] = self.description


class Table:
    """Columns of one HDF5 group that share their rows.

    Parameters
    ----------
    group : h5py.Group
        Made by `create`.
    columns : iterable of Column
    """

    def __init__(self, group: h5py.Group, columns: Iterable[Column]):
        self.group = group
        self.columns = tuple(columns)

    @classmethod
    def create(
        cls, group: h5py.Group, columns: Iterable[Column], shapes: Mapping[str, tuple[int, ...]], chunk: int = 1
    ) -> Table:
        """Make empty columns.

        Parameters
        ----------
        shapes : mapping
            Shape of one row of the columns that are not scalars.
        chunk : int
            Rows stored together.
        """
        table = cls(group, columns)
        for column in table.columns:
            shape = tuple(shapes.get(column.name, ()))
            dtype = h5py.string_dtype() if column.dtype == TEXT else column.dtype
            dataset = group.create_dataset(
                column.name, (0, *shape), dtype, maxshape=(None, *shape), chunks=(chunk, *(max(1, n) for n in shape))
            )
            column.mark(dataset)
        group.attrs["rows"] = 0
        return table

    @property
    def rows(self) -> int:
        """Number of whole rows."""
        return int(self.group.attrs["rows"])

    def append(self, values: Mapping[str, Any]) -> None:
        """Add a row and flush the file."""
        row = self.rows
        for column in self.columns:
            dataset = self.group[column.name]
            dataset.resize(row + 1, axis=0)
            dataset[row] = values[column.name]
        self.group.attrs["rows"] = row + 1
        self.group.file.flush()

    def read(self, name: str, row: int | None = None) -> Any:
        """A column, or one row of it."""
        dataset = self.group[name]
        if h5py.check_string_dtype(dataset.dtype):
            dataset = dataset.asstr()
        return dataset[: self.rows] if row is None else dataset[row]


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


def replace_texts(group: h5py.Group, name: str, texts: Iterable[str]) -> None:
    """Write a list of texts in place of an earlier one."""
    texts = list(texts)
    if name in group:
        del group[name]
    group.create_dataset(name, data=texts, shape=(len(texts),), dtype=h5py.string_dtype())


def read_texts(group: h5py.Group, name: str) -> tuple[str, ...]:
    return tuple(group[name].asstr()[:])
