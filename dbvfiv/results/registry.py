"""Kinds of result files and the classes that read them.

A study registers here with one line: the kind that its files carry and ``module:class`` of its result, which is
imported when such a file is read. The class derives from `dbvfiv.record.result.Result`. Its figures are registered the
same way in `dbvfiv.plots.catalogue`.
"""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import CaseError
from ..record.files import reading
from ..studies import KINDS
from ..studies.session import read_result

if TYPE_CHECKING:
    from ..record.result import Result

READERS: dict[str, str] = {
    "closure": "dbvfiv.results.closure:ClosureResults",
    "transient": "dbvfiv.transient.result:TransientResults",
}


def load_result(path: str | Path) -> Result:
    """Read a result file of any kind.

    Raises
    ------
    CaseError
        One sentence: what is wrong with the file.

    Examples
    --------
    >>> run = load_result("out/steady.h5")        # doctest: +SKIP
    >>> run.states[-1].mass_flow                  # doctest: +SKIP
    81.8
    """
    with reading(path) as file:
        kind = str(file.attrs["dbvfiv_kind"])
        if kind in KINDS:
            return read_result(path)
        if kind not in READERS:
            raise CaseError(f"{str(path)!r} holds a result of kind {kind!r}, which this version does not know.")
        return reader(kind).read(file, Path(path))


def reader(kind: str) -> type[Result]:
    """The class of a kind of result."""
    module, name = READERS[kind].split(":")
    return getattr(import_module(module), name)
