"""The result file of a back-pressure run, written state by state while the run goes on, and read again to go on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..observer import Observer
from ..record.files import KeptFile, create, reopen
from ..record.header import Header, write_header
from ..record.layout import Table, read_texts, replace_texts
from ..record.mesh import MeshData, write_mesh
from ..record.states import LAYERS
from ..shell.recovery import LayerFields, layer_fields
from ..studies.closure_buckling import Buckling
from ..studies.closure_path import PathRestart
from .closure import buckling_rows, opened_rows, path_rows, reference_opening, row_from
from .closure_table import BUCKLING, FIELDS, OPENED, PATH, RESTART, REVERSAL, SUMMARY

if TYPE_CHECKING:
    from ..studies.closing import ClosingResult
    from ..studies.closure import ClosureResult
    from ..studies.closure_model import ClosureModel


_TABLES = {"path": PATH, "buckling": BUCKLING, "opened": OPENED, "restart": RESTART}


class ClosureFile(KeptFile, Observer):
    """Keeps every state as soon as it is found, with the path to it and what it takes to go on from there; a context
    manager.

    It is the `Keeper` of a run and, for warnings, an observer.

    Parameters
    ----------
    path : path
    model : ClosureModel
    header : Header, optional
    in_time : bool
        The drive is to be turned in time as well.
    again : bool
        Open the file of an interrupted run and go on.

    Raises
    ------
    CaseError
        If the file cannot be written.
    """

    def __init__(
        self,
        path: str | Path,
        model: ClosureModel,
        header: Header | None = None,
        in_time: bool = False,
        again: bool = False,
    ):
        self.model = model
        self.path = Path(path)
        self._mesh = MeshData.of(model)
        self._kept = {"path": 0, "buckling": 0}  # of what the run has found so far
        if again:
            self._reopen()
            return
        self._warnings: list[str] = []
        self._file = create(path)
        write_header(self._file, header or Header.of("closure", model.case))
        self._file.attrs["complete"] = False
        self._file.attrs["in_time"] = bool(in_time)
        self._file.attrs["supports"] = model.supports
        self._file.attrs["reference_opening"] = reference_opening(model)
        write_mesh(self._file, self._mesh)
        self._messages = self._file.create_group("messages")
        replace_texts(self._messages, "warnings", ())
        replace_texts(self._messages, "failures", ())
        nodes = len(self._mesh.nodes)
        shapes = {
            "nodal": (nodes, 5),
            "shape": (nodes, 5),
            "slope": (model.size,),
            "multiplier": (model.pressed.contact.count,),
            "energy": (6,),
        }
        self._tables = {
            name: Table.create(self._file.create_group(name), columns, shapes) for name, columns in _TABLES.items()
        }
        self._new_states(self.model.case.closure.eigenvalues)
        self._file.flush()

    def _reopen(self) -> None:
        self._file = reopen(self.path)
        self._messages = self._file["messages"]
        self._warnings = list(read_texts(self._messages, "warnings"))
        self._tables = {name: Table(self._file[name], columns) for name, columns in _TABLES.items()}
        self._states = Table(self._file["states"], (*SUMMARY, *FIELDS, *LAYERS))
        last = self._states.rows - 1
        for name in self._kept:  # what was found on the way to a state that was not reached
            self._file[name].attrs["rows"] = int(self._tables["restart"].read(f"{name}_rows", last))
        if "reversal" in self._file:
            del self._file["reversal"]

    def restart(self) -> PathRestart:
        """Where the run stood at its last state."""
        table, last = self._tables["restart"], self._states.rows - 1
        restrict = self.model.shell.dofs.restrict
        found = self._tables["buckling"]
        buckling = [
            Buckling(
                str(found.read("kind", i)),
                float(found.read("pressure", i)),
                restrict(found.read("nodal", i)),
                restrict(found.read("shape", i)),
                float(found.read("eigenvalue", i)),
            )
            for i in range(found.rows)
        ]
        self._kept["buckling"] = len(buckling)
        return PathRestart(
            float(self._states.read("pressure", last)),
            restrict(self._states.read("nodal", last)),
            table.read("slope", last),
            table.read("multiplier", last),
            float(table.read("step", last)),
            bool(self._states.read("beyond_limit", last)),
            float(self._states.read("lowest_stiffness_eigenvalue", last)),
            tuple(table.read("energy", last)),
            tuple(buckling),
        )

    # -- while the run goes on
    # ----

    def turned_back(self, opened) -> None:
        """Keep the states of an open start."""
        for row in opened_rows(opened):
            self._tables["opened"].append(row)

    def reached(self, path, state: Any) -> None:
        """Keep a state (`dbvfiv.studies.closure_state.ClosureState`); what led to it goes first, so that the state
        vouches for it.
        """
        self._follow(path.points, path.buckling)
        at = path.restart(state.lowest_stiffness_eigenvalue)
        counts = {f"{name}_rows": self._tables[name].rows for name in self._kept}
        table = self._tables["restart"]
        table.group.attrs["rows"] = self._states.rows
        table.append({"step": at.step, "slope": at.slope, "multiplier": at.multiplier, "energy": at.energy} | counts)
        self.keep(row_from(self.model, state), layer_fields(self.model.shell, state.q))

    def _follow(self, points, buckling) -> None:
        """Keep what is new on the path."""
        new = {
            "path": path_rows(points[self._kept["path"] :]),
            "buckling": buckling_rows(self.model, buckling[self._kept["buckling"] :]),
        }
        for name, rows in new.items():
            for row in rows:
                self._tables[name].append(row)
            self._kept[name] += len(rows)

    def keep(self, row: Mapping[str, Any], layers: LayerFields) -> None:
        """Keep a state from its columns and layers."""
        count = len(row["stiffness_eigenvalues"])
        if count != self._file["states/stiffness_eigenvalues"].shape[1] and not self._states.rows:
            del self._file["states"]
            self._new_states(count)
        self._states.append(dict(row) | {c.name: getattr(layers, c.name.split("/")[1]) for c in LAYERS})

    def warn(self, sentence: str) -> None:
        if sentence not in self._warnings:
            self._warnings.append(sentence)
            replace_texts(self._messages, "warnings", self._warnings)
            self._file.flush()

    def conclude(self, result: ClosureResult, complete: bool) -> None:
        """Note the rest of the path, the messages, and whether nothing is left to do."""
        self._follow(result.path, result.buckling)
        self._close_messages(result.warnings, result.failures, complete)

    def finish(self, path, buckling, opened, warnings: Sequence[str], failures: Sequence[str], complete: bool) -> None:
        """Write path, buckling and opened states from their columns, messages, and whether the run went to its end."""
        for name, rows in (("path", path), ("buckling", buckling), ("opened", opened)):
            for row in rows:
                self._tables[name].append(row)
        self._close_messages(warnings, failures, complete)

    def _close_messages(self, warnings: Sequence[str], failures: Sequence[str], complete: bool) -> None:
        self._warnings += [w for w in warnings if w not in self._warnings]
        replace_texts(self._messages, "warnings", [w for w in self._warnings if w not in failures])
        replace_texts(self._messages, "failures", failures)
        self._file.attrs["complete"] = bool(complete)
        self._file.flush()

    def keep_closing(self, closing: ClosingResult) -> None:
        """Write the history of the valve while its drive turned round."""
        group = self._file.create_group("reversal")
        table = Table.create(group, REVERSAL, {}, chunk=256)
        for sample in closing.samples:
            table.append(vars(sample))
        turn = closing.turn
        facts = {
            "open_pressure": turn.pressure,
            "turn_start": turn.start,
            "turn_duration": turn.duration,
            "shut_below": closing.shut_below,
        }
        facts |= {"halvings": closing.halvings, "failure": closing.failure, "interrupted": closing.interrupted}
        for name, value in facts.items():
            group.attrs[name] = value
        self._file.attrs["complete"] = not closing.interrupted
        self._file.flush()

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
