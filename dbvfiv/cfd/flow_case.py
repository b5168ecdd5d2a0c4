"""Inputs of a run and its case on disk."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import CaseError
from ..exchange.bodies import WallFaces
from ..record.mesh import MeshData
from .domain import ROOM, Domain, FlowMesh
from .foam import Stream, case_files, write_mesh

if TYPE_CHECKING:
    from ..model.state import SteadyState

#: Holds the inputs of the run, beside the files of OpenFOAM.
NOTE = "question.json"
#: Of water at 20 degrees, m2/s.
WATER_VISCOSITY = 1.0e-6


@dataclass(frozen=True)
class FlowCase:
    """Viscous flow through the shape of one steady state, with the volume flow of that state.

    Attributes
    ----------
    name : str
        Of the valve, for titles.
    mesh : MeshData
        Of the shell.
    state : SteadyState
    density : float, kg/m3
    pipe : float, optional
        Diameter of the pipe in which the valve stands, m; the jet goes into a room without it.
    fineness : float
        Cells in each direction over the usual number.
    iterations : int
        At most.
    viscosity : float, m2/s
    """

    name: str
    mesh: MeshData
    state: SteadyState
    density: float
    pipe: float | None = None
    fineness: float = 0.5
    iterations: int = 400
    viscosity: float = WATER_VISCOSITY

    @cached_property
    def faces(self) -> WallFaces:
        """Faces of the deformed wall."""
        return WallFaces.of(self.mesh, self.state.nodal)

    @cached_property
    def domain(self) -> Domain:
        """Region of fluid that is meshed.

        Raises
        ------
        CaseError
            If the valve does not go into the pipe, or more than a quarter of it is computed.
        """
        if not self.mesh.part.is_quarter:
            raise CaseError(
                "The flow in three dimensions is meshed in a quarter between two planes of symmetry; this state is "
                f"that of a {self.mesh.part.name} of the valve."
            )
        widest = float(np.hypot(self.faces.outer[..., 0], self.faces.outer[..., 1]).max())
        if self.pipe is None:
            return Domain(self.faces, ROOM * float(self.faces.outer[-1, 0, 1]), True, self.fineness)
        if self.pipe <= 2.02 * widest:
            raise CaseError(
                f"The pipe is {1e3 * self.pipe:g} mm wide and the wall of this state {2e3 * widest:.4g} mm; it must be "
                f"at least {2.02e3 * widest:.4g} mm."
            )
        return Domain(self.faces, 0.5 * self.pipe, False, self.fineness)

    @cached_property
    def cells(self) -> FlowMesh:
        """The mesh.

        Raises
        ------
        CaseError
            If it does not come out sound.
        """
        try:
            return FlowMesh.of(self.domain)
        except ValueError as error:
            raise CaseError(f"No sound mesh of this state: {error}") from error

    @property
    def stream(self) -> Stream:
        """The flow that is asked for."""
        return Stream(
            self.state.volume_flow,
            2.0 * self.domain.bore,
            self.density,
            self.viscosity,
            self.pipe is None,
            self.iterations,
        )

    @property
    def inputs(self) -> dict[str, Any]:
        """Quantities in which two runs must agree for one to continue the other."""
        shape = hashlib.sha256(np.round(self.state.nodal, 9).tobytes() + self.mesh.nodes.tobytes()).hexdigest()[:16]
        return {
            "shape": shape,
            "volume_flow": self.state.volume_flow,
            "pipe": self.pipe,
            "fineness": self.fineness,
            "viscosity": self.viscosity,
        }

    def write(self, folder: str | Path) -> bool:
        """Write the case, unless the folder holds it already; returns whether it did not.

        Raises
        ------
        CaseError
            If the folder holds another case, or cannot be written.
        """
        folder = Path(folder)
        try:
            known = (folder / NOTE).exists()
            if known and json.loads((folder / NOTE).read_text()) != self.inputs:
                raise CaseError(
                    f"{str(folder)!r} holds the flow through another shape or on another mesh; name a new one."
                )
            if not known and folder.exists() and any(folder.iterdir()):
                raise CaseError(f"{str(folder)!r} is not empty and holds no flow of this program; name a new folder.")
            for name, text in case_files(self.stream).items():
                path = folder / name
                if known and name.startswith("0/"):
                    continue
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_text(text)
            (folder / "Allrun").chmod(0o755)
            if not known:
                write_mesh(self.cells, folder)
                (folder / NOTE).write_text(json.dumps(self.inputs, indent=1) + "\n")
        except OSError as error:
            raise CaseError(f"{str(folder)!r} cannot be written ({error.strerror or error}).") from error
        return not known
