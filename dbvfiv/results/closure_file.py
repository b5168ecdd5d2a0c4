"""The result file of a back-pressure run, written state by state while the run goes on."""
from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Mapping, Sequence

from ..studies.observer import Observer
from .closure import buckling_rows, opened_rows, path_rows, reference_opening, row_from
from .closure_table import BUCKLING, FIELDS, OPENED, PATH, REVERSAL, SUMMARY
from .files import create
from .header import Header, write_header
from .layout import Table, replace_texts
from .mesh import MeshData, write_mesh
from .state import LAYERS, LayerData, layers_of

if TYPE_CHECKING:
    from ..studies.closing import ClosingResult
    from ..studies.closure import ClosureResult
    from ..studies.closure_model import ClosureModel


class ClosureFile(Observer):
    """Observer that keeps every state as soon as it is found; a context manager.

    Raises
    ------
    CaseError
        If the file cannot be written.
    """

    def __init__(self, path: str | Path, model: "ClosureModel", header: Header | None = None):
        self.model = model
        self.path = Path(path)
        self._warnings: list[str] = []
        self._file = create(path)
        write_header(self._file, header or Header.of("closure", model.case))
        self._file.attrs["complete"] = False
        self._file.attrs["supports"] = model.supports
        self._file.attrs["reference_opening"] = reference_opening(model)
        self._mesh = mesh = MeshData.of(model)
        write_mesh(self._file, mesh)
        self._messages = self._file.create_group("messages")
        replace_texts(self._messages, "warnings", ())
        replace_texts(self._messages, "failures", ())
        self._states: Table | None = None
        nodes = len(mesh.nodes)
        shapes = {"nodal": (nodes, 5), "shape": (nodes, 5)}
        self._tables = [
            Table.create(self._file.create_group(name), columns, shapes)
            for name, columns in (("path", PATH), ("buckling", BUCKLING), ("opened", OPENED))
        ]
        self._new_states(self.model.case.closure.eigenvalues)
        self._file.flush()

    def item(self, result: Any) -> None:
        """Keep a state (`dbvfiv.studies.closure_state.ClosureState`)."""
        self.keep(row_from(self.model, result), layers_of(self.model, result.q))

    def keep(self, row: Mapping[str, Any], layers: LayerData) -> None:
        """Keep a state from its columns and layers."""
        count = len(row["stiffness_eigenvalues"])
        if count != self._file["states/stiffness_eigenvalues"].shape[1] and not self._states.rows:
            del self._file["states"]
            self._new_states(count)
        self._states.append(dict(row) | {c.name: getattr(layers, c.name.split("/")[1]) for c in LAYERS})

    def warn(self, sentence: str) -> None:
        self._warnings.append(sentence)
        replace_texts(self._messages, "warnings", self._warnings)
        self._file.flush()

    def conclude(self, result: "ClosureResult") -> None:
        """Note the path and how the run ended."""
        self.finish(
            path_rows(result), buckling_rows(result), opened_rows(result), result.warnings, result.failures, not result.interrupted
        )

    def finish(self, path, buckling, opened, warnings: Sequence[str], failures: Sequence[str], complete: bool) -> None:
        """Write path, buckling and opened states from their columns, the messages, and whether the run went to its end."""
        for table, rows in zip(self._tables, (path, buckling, opened)):
            for row in rows:
                table.append(row)
        replace_texts(self._messages, "warnings", [w for w in warnings if w not in failures])
        replace_texts(self._messages, "failures", failures)
        self._file.attrs["complete"] = bool(complete)
        self._file.flush()

    def keep_closing(self, closing: "ClosingResult") -> None:
        """Write the history of the valve while its drive turned round."""
        group = self._file.create_group("reversal")
        table = Table.create(group, REVERSAL, {}, chunk=256)
        for sample in closing.samples:
            table.append(vars(sample))
        turn = closing.turn
        facts = {"open_pressure": turn.pressure, "turn_start": turn.start, "turn_duration": turn.duration, "shut_below": closing.shut_below}
        facts |= {"halvings": closing.halvings, "failure": closing.failure, "interrupted": closing.interrupted}
        for name, value in facts.items():
            group.attrs[name] = value
        self._file.flush()

    def close(self) -> None:
        self._file.close()

    def __enter__(self) -> "ClosureFile":
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def _new_states(self, eigenvalues: int) -> None:
        mesh = self._mesh
        elements, layers, nodes = len(mesh.quads), len(mesh.layer_names), len(mesh.nodes)
        shapes = {
            "max_displacement_position": (3,),
            "nodal": (nodes, 5),
            "opening": (len(mesh.z),),
            "contact_pressure": (nodes,),
            "gap": (nodes,),
            "stiffness_eigenvalues": (eigenvalues,),
            "layers/strain": (elements, layers, 5),
            "layers/stress": (elements, layers, 5),
            "layers/von_mises": (elements, layers),
            "layers/stretch": (elements, layers, 2),
        }
        self._states = Table.create(self._file.create_group("states"), (*SUMMARY, *FIELDS, *LAYERS), shapes)
