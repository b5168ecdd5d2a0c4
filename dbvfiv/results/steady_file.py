"""The result file of a steady run, written state by state while the run goes on."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..observer import Observer
from ..record.files import KeptFile, create
from ..record.header import Header, write_header
from ..record.layout import Table, replace_texts
from ..record.mesh import MeshData, write_mesh
from .state import FIELDS, LAYERS, SUMMARY, layers_of
from .steady import row_from

if TYPE_CHECKING:
    from ..model import ValveModel


class SteadyFile(KeptFile, Observer):
    """Observer that keeps every state as soon as it is found; a context manager.

    Parameters
    ----------
    path : path
    model : ValveModel
    header : Header, optional

    Raises
    ------
    CaseError
        If the file cannot be written.
    """

    def __init__(self, path: str | Path, model: ValveModel, header: Header | None = None):
        self.model = model
        self.path = Path(path)
        self._warnings: list[str] = []
        self._file = create(path)
        write_header(self._file, header or Header.of("steady", model.case))
        self._file.attrs["complete"] = False
        mesh = MeshData.of(model)
        write_mesh(self._file, mesh)
        self._messages = self._file.create_group("messages")
        replace_texts(self._messages, "warnings", ())
        replace_texts(self._messages, "failures", ())
        self._states = Table.create(self._file.create_group("states"), (*SUMMARY, *FIELDS, *LAYERS), _shapes(mesh))
        self._file.flush()

    def item(self, result: Any) -> None:
        """Keep a state (`dbvfiv.model.state.SteadyState`)."""
        layers = layers_of(self.model, result.q)
        fields = {c.name: getattr(layers, c.name.split("/")[1]) for c in LAYERS}
        self._states.append(row_from(self.model, result) | fields)

    def warn(self, sentence: str) -> None:
        self._warnings.append(sentence)
        replace_texts(self._messages, "warnings", self._warnings)
        self._file.flush()

    def conclude(self, failures: Sequence[str] = (), complete: bool = True) -> None:
        """Note how the run ended: the pressures that were not reached, and whether the list was gone through."""
        # while the run goes on failures are warnings like any other
        replace_texts(self._messages, "warnings", [w for w in self._warnings if w not in failures])
        replace_texts(self._messages, "failures", failures)
        self._file.attrs["complete"] = bool(complete)
        self._file.flush()


def _shapes(mesh: MeshData) -> dict[str, tuple[int, ...]]:
    """Shape of one row of each column that is not a scalar."""
    elements, layers = len(mesh.quads), len(mesh.layer_names)
    stations = dict.fromkeys((c.name for c in FIELDS), (len(mesh.z),))
    return stations | {
        "max_displacement_position": (3,),
        "nodal": (len(mesh.nodes), 5),
        "layers/strain": (elements, layers, 5),
        "layers/stress": (elements, layers, 5),
        "layers/von_mises": (elements, layers),
        "layers/stretch": (elements, layers, 2),
    }
