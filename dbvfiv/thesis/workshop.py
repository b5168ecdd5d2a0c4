"""Runs that entries share, each computed once and kept in a file."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ..observer import Observer
from ..studies.case import thesis_case
from ..studies.closure.result import ClosureResult
from ..studies.kept import kept_run
from ..studies.session import Session
from ..studies.steady.result import SteadyResult
from ..studies.transient.result import TransientResult

#: Meshes of the whole set and of the quick one.
FULL, QUICK = (28, 48), (8, 14)


class Workshop:
    """Source of the runs that entries need: read from a folder, or computed.

    Parameters
    ----------
    folder : path
        Folder of the result files.
    quick : bool
        Coarse mesh, short histories: for a look, not for the numbers.
    observer : Observer, optional
    """

    def __init__(self, folder: Path, quick: bool = False, observer: Observer | None = None):
        self.folder, self.quick, self.observer = folder, quick, observer
        around, along = QUICK if quick else FULL
        self.base = thesis_case({"mesh.around": around, "mesh.along": along})

    @property
    def setting(self) -> str:
        """Valve, mesh and histories of the page, in a sentence or two."""
        mesh = self.base.mesh
        short = " Short histories on a coarse mesh, for a look and not for the numbers." if self.quick else ""
        return f"The 12-inch valve on {mesh.around} x {mesh.along} elements of a quarter, beside the thesis.{short}"

    def steady(self, pressures: Sequence[float], changes: Mapping[str, Any] | None = None) -> SteadyResult:
        """States at pressures, Pa, of the 12-inch valve with some keys changed."""
        return self._run("steady", {"steady.pressures": list(pressures), **(changes or {})})

    def transient(self, changes: Mapping[str, Any], name: str | None = None) -> TransientResult:
        """A time history; `name` is what it is called in comparisons."""
        return self._run("transient", changes, name)

    def closure(self, changes: Mapping[str, Any]) -> ClosureResult:
        """States under back pressure."""
        return self._run("closure", changes)

    def duration(self, full: float, quick: float) -> float:
        """Duration of a history, s: the full or the quick one."""
        return quick if self.quick else full

    def _run(self, kind: str, changes: Mapping[str, Any], name: str | None = None) -> Any:
        case = self.base.replace(dict(changes))
        mark = hashlib.sha256(json.dumps([self.quick, changes], sort_keys=True, default=str).encode()).hexdigest()[:10]
        session = Session(case, name or "dbv12")
        return kept_run(kind, session, self.folder / f"{kind}-{mark}.h5", self.observer)
