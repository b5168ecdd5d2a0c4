"""What results of all studies have in common."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import h5py

from ..case.model import Case
from .header import Header
from .mesh import MeshData

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ..model import ValveModel
    from .vtkhdf import Step
    from .whole_valve import WholeValve


class Result:
    """A finished or interrupted run, in memory or read from a file; nothing is computed again.

    Derived classes set `kind` and define `read`, `summary`, `lines` and `save`, and `steps` if they have something to
    show in space.

    Parameters
    ----------
    header : Header
    mesh : MeshData
    warnings, failures : sequences of str
        Sentences.
    path : Path, optional
        File it was read from.
    model : ValveModel, optional
        Where it is at hand; rebuilt from the case otherwise, when asked for.
    """

    kind: ClassVar[str]

    def __init__(
        self,
        header: Header,
        mesh: MeshData,
        warnings: Sequence[str] = (),
        failures: Sequence[str] = (),
        path: Path | None = None,
        model: ValveModel | None = None,
    ):
        self.header = header
        self.mesh = mesh
        self.warnings = tuple(warnings)
        self.failures = tuple(failures)
        self.path = path
        if model is not None:
            self.model = model

    @property
    def case(self) -> Case:
        return self.header.case

    @property
    def complete(self) -> bool:
        """Whether the run went to its end."""
        return self.header.complete

    @cached_property
    def model(self) -> ValveModel:
        """The coupled model of the case; rebuilt on first use if the result comes from a file."""
        from ..model import ValveModel

        return ValveModel(self.header.rebuildable_case())

    @classmethod
    def read(cls, file: h5py.File, path: Path) -> Result:
        """Read an open result file."""
        raise NotImplementedError

    def save(self, path: str | Path) -> Path:
        """Write a result file."""
        raise NotImplementedError

    def summary(self) -> dict[str, Any]:
        """Plain SI numbers for JSON."""
        raise NotImplementedError

    def lines(self) -> list[str]:
        """The numbers as a table for people."""
        raise NotImplementedError

    def steps(self, valve: WholeValve) -> Sequence[Step]:
        """Fields on the valve for ParaView; empty if the result has none."""
        return ()

    def figures(self, **choices: Any) -> dict[str, Figure]:
        """Figures by name."""
        from ..plots import figures_of

        return figures_of(self, **choices)

    def plot(self, folder: str | Path = ".", format: str = "png", **choices: Any) -> list[Path]:
        """Write the figures as PNG or SVG files and return their names."""
        from ..plots import save_figures

        return save_figures(self, folder, format, **choices)

    def export(self, path: str | Path, quarter: bool = False, deformed: bool = False, **choices: Any) -> Path:
        """Write a VTKHDF file for ParaView; see `dbvfiv.record.fields`."""
        from .fields import export_result

        return export_result(self, path, quarter, deformed, **choices)
