"""Layout of quantities in result files: columns with units and descriptions, and their printed form."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
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
