"""Equilibria over a list of pressures: the result, in memory or in a file."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np

from ..record.files import reading
from ..record.header import Header, read_header
from ..record.layout import Table, read_texts
from ..record.mesh import MeshData, read_mesh
from ..record.result import Result
from .state import FIELDS, LAYERS, SUMMARY, LayerData, State, layers_of
from .steady_table import HEAD, row_of

if TYPE_CHECKING:
    from ..model import ValveModel
    from ..model.equilibria import SteadyResult
    from ..record.vtkhdf import Step
    from ..record.whole_valve import WholeValve


class SteadyResults(Result):
    """Equilibria in the order they were found.

    Attributes
    ----------
    states : tuple of State
    """

    kind = "steady"

    def __init__(
        self,
        header: Header,
        mesh: MeshData,
        rows: Sequence[Mapping[str, Any]],
        read_layers: Callable[[int], LayerData],
        **common: Any,
    ):
        super().__init__(header, mesh, **common)
        self.states = tuple(
            State(results=self, _read_layers=(lambda i=i: read_layers(i)), **row) for i, row in enumerate(rows)
        )

    @classmethod
    def of(cls, result: SteadyResult, header: Header | None = None) -> SteadyResults:
        """From a run that has just ended.

        Parameters
        ----------
        result : dbvfiv.model.equilibria.SteadyResult
        header : Header, optional
            Where it comes from; made from the model's case without one.
        """
        model = result.model
        header = header or Header.of("steady", model.case)
        return cls(
            replace(header, complete=not result.interrupted),
            MeshData.of(model),
            [row_from(model, state) for state in result.states],
            lambda i: layers_of(model, result.states[i].q),
            warnings=result.warnings,
            failures=result.failures,
            model=model,
        )

    @classmethod
    def read(cls, file: h5py.File, path: Path) -> SteadyResults:
        table = Table(file["states"], (*SUMMARY, *FIELDS))
        columns = {c.name: table.read(c.name) for c in table.columns}
        rows = [{name: _scalar(values[i]) for name, values in columns.items()} for i in range(table.rows)]
        names = tuple(file["mesh/layer_names"].asstr()[:])

        def read_layers(row: int) -> LayerData:
            with reading(path) as again:
                layers = Table(again["states"], LAYERS)
                return LayerData(names, **{c.name.split("/")[1]: layers.read(c.name, row) for c in LAYERS})

        return cls(
            read_header(file),
            read_mesh(file),
            rows,
            read_layers,
            warnings=read_texts(file, "messages/warnings"),
            failures=read_texts(file, "messages/failures"),
            path=path,
        )

    def save(self, path: str | Path) -> Path:
        from .steady_file import SteadyFile

        with SteadyFile(path, self.model, self.header) as file:
            for sentence in self.warnings:
                file.warn(sentence)
            for state in self.states:
                file.item(state.solution())
            file.conclude(self.failures, complete=self.complete)
        return Path(path)

    def only(self, *states: State) -> SteadyResults:
        """A result with some of its states."""
        chosen = [{c.name: getattr(state, c.name) for c in (*SUMMARY, *FIELDS)} for state in states]
        return SteadyResults(
            replace(self.header),
            self.mesh,
            chosen,
            lambda i: states[i].layers,
            warnings=self.warnings,
            path=self.path,
            model=self.__dict__.get("model"),
        )

    def nearest(self, pressure: float) -> State:
        """State at the pressure closest to a given one, Pa."""
        return min(self.states, key=lambda state: abs(state.pressure - pressure))

    def summary(self) -> dict[str, Any]:
        return {
            "points": [state.summary() for state in self.states],
            "failures": list(self.failures),
            "warnings": list(self.warnings),
            "interrupted": not self.complete,
        }

    def lines(self) -> list[str]:
        return [*HEAD, *(row_of(state) for state in self.states)]

    def steps(self, valve: WholeValve) -> Sequence[Step]:
        from ..record.fields import steady_steps

        return steady_steps(self, valve)


def row_from(model: ValveModel, state: Any) -> dict[str, Any]:
    """Columns of a state (`dbvfiv.model.state.SteadyState`) of a model."""
    row = {c.name: getattr(state, c.name) for c in (*SUMMARY, *FIELDS) if c.name != "nodal"}
    return row | {"nodal": model.nodal(state.q)}


def _scalar(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return tuple(value.tolist()) if value.shape == (3,) else value
    return value.item() if isinstance(value, np.generic) else value
