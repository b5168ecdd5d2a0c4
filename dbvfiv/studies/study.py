"""Declaration of a study: name, tables of its file, run and result."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from ..record.mesh import MeshData
from ..record.record import Record
from ..record.table import Column, TableSpec, printed_head, printed_row
from . import KINDS
from .case import Case


@dataclass(frozen=True)
class Study:
    """One analysis that the program offers.

    Attributes
    ----------
    kind : str
        Name of the command, of the section of the case file and of the result.
    tables : callable
        From the mesh of a valve to the tables of a result.
    run : callable
        ``run(session, record, **choices)`` finds what is asked for and keeps it in the record, a `GrowingRecord`. What
        the record holds already, from an interrupted attempt, is not computed again. Ctrl-C may end it at any point.
    result : type
        `StudyResult` of its records.
    rows_to_keep : callable, optional
        From what an earlier attempt kept and the case as it is to go on, to how many rows of each table the run goes on
        from. Without it a run goes on from all rows.
    extends : bool, optional
        A complete run can go on, to a later end; ``rows_to_keep`` refuses one without it by a `CaseError`. Other
        studies that are complete are refused.
    live : callable, optional
        From the case to what writes an item that was found as a line of a table, as soon as it is; the first line has
        the head of the table above it. Without it everything is printed at the end.
    compare : callable, optional
        From results to what tells them apart: ``labels``, ``lines()``, ``document()`` and the figure, ``draw()``.
    """

    kind: str
    tables: Callable[[MeshData], tuple[TableSpec, ...]]
    run: Callable[..., None]
    result: type[Any]
    rows_to_keep: Callable[[Record, Case], Mapping[str, int]] | None = None
    extends: bool = False
    live: Callable[[Case], Callable[[Any], str]] | None = None
    compare: Callable[[Sequence[Any]], Any] | None = None


def print_rows(columns: Iterable[Column]) -> Callable[[Any], str]:
    """Writer of the lines of a table as its rows are found; a text is a title of those that follow."""
    columns = tuple(columns)
    head = [*printed_head(columns)]

    def write(item: Any) -> str:
        if isinstance(item, str):
            head[:] = printed_head(columns)
            return item
        lines = [*head, printed_row(columns, item)]
        head.clear()
        return "\n".join(lines)

    return write


def find_study(kind: str) -> Study:
    """The study of a kind; its folder is imported when it is first asked for.

    Raises
    ------
    KeyError
        If there is none.
    """
    if kind not in KINDS:
        raise KeyError(kind)
    return import_module(f"{__package__}.{kind}.study").STUDY
