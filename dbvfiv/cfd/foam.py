"""OpenFOAM: files of a case (steady, incompressible, k-omega SST, Menter 1994), its mesh, its process, its results."""

from __future__ import annotations

import hashlib
import json
import math
import os
import re
import shutil
import signal
import subprocess
import time
from dataclasses import dataclass
from functools import cached_property
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyvista

from ..errors import CaseError, SolveError
from ..exchange.bodies import WallFaces
from ..observer import Observer
from ..record.mesh import MeshData
from .domain import PATCHES, ROOM, Domain, FlowMesh

if TYPE_CHECKING:
    from ..model.state import SteadyState

#: Turbulence of the stream that comes in: fluctuations over the mean velocity, eddies over the diameter.
INTENSITY, EDDIES = 0.03, 0.07
_C_MU = 0.09


#: Iterations at most between fields that are written.
KEPT = 100
#: Files of a case as they are, and what is put into two of them.
_FILES = ("Allrun", "constant/turbulenceProperties", "system/fvSchemes", "system/fvSolution")


def case_files(case: FlowCase) -> dict[str, str]:
    """All files but the mesh, by their places in the case."""
    texts = files("dbvfiv.cfd").joinpath("case")
    kept = -(-case.iterations // KEPT)  # times that fields are written, the last at the end
    times = kept * (case.iterations // kept), case.iterations // kept
    put_in = {"constant/transportProperties": case.viscosity, "system/controlDict": times}
    found = {f"0/{name}": text for name, text in _fields(case).items()}
    found |= {name: texts.joinpath(name).read_text() for name in _FILES}
    return found | {name: texts.joinpath(name).read_text() % value for name, value in put_in.items()}


#: Fields of an iteration.
_FIELDS = ("p", "U", "k", "omega", "nut")


def _fields(case: FlowCase) -> dict[str, str]:
    """Boundary and initial values of p, U, k, omega and nut."""
    free, velocity = case.pipe is None, case.inlet_velocity
    k = 1.5 * (INTENSITY * velocity) ** 2
    omega = math.sqrt(k) / (_C_MU**0.25 * EDDIES * 2.0 * case.domain.bore)
    wall = "type noSlip;" if not free else "type slip;"
    start = f"uniform (0 0 {-velocity:.8g})"
    quarter = case.state.volume_flow / 4.0
    return {
        "p": _field(
            "p", "volScalarField", "0 2 -2 0 0 0 0", "uniform 0", _OPEN, "type fixedValue; value uniform 0;", _OPEN
        ),
        "U": _field(
            "U",
            "volVectorField",
            "0 1 -1 0 0 0 0",
            start,
            f"type flowRateInletVelocity; volumetricFlowRate {quarter:.10g}; value {start};",
            "type inletOutlet; inletValue uniform (0 0 0); value uniform (0 0 0);",
            "type noSlip;",
            wall,
        ),
        "k": _turbulent("k", "0 2 -2 0 0 0 0", k, "kqRWallFunction", free),
        "omega": _turbulent("omega", "0 0 -1 0 0 0 0", omega, "omegaWallFunction", free),
        "nut": _field(
            "nut",
            "volScalarField",
            "0 2 -1 0 0 0 0",
            "uniform 0",
            "type calculated; value uniform 0;",
            "type calculated; value uniform 0;",
            "type nutUSpaldingWallFunction; value uniform 0;",
            "type calculated; value uniform 0;" if free else None,
        ),
    }


_OPEN = "type zeroGradient;"


def _turbulent(name: str, dimensions: str, value: float, wall: str, free: bool) -> str:
    """A quantity of the turbulence: its conditions at inlet, outlet, walls, and the far side of a room."""
    fixed = f"value uniform {value:.8g};"
    return _field(
        name,
        "volScalarField",
        dimensions,
        f"uniform {value:.8g}",
        f"type fixedValue; {fixed}",
        f"type inletOutlet; inletValue uniform {value:.8g}; {fixed}",
        f"type {wall}; {fixed}",
        _OPEN if free else None,
    )


def _field(name, kind, dimensions, start, inlet, outlet, wall, far=None) -> str:
    lines = [
        f"dimensions [{dimensions}];",
        f"internalField {start};",
        "boundaryField",
        "{",
        f"    inlet {{ {inlet} }}",
        f"    outlet {{ {outlet} }}",
        "    centre { type symmetryPlane; }",
        "    side { type symmetryPlane; }",
        f'    "inner|outer|lip|flange|upstream" {{ {wall} }}',
        f"    downstream {{ {far or wall} }}",
        "}",
    ]
    return _foam(name, kind, "\n".join(lines) + "\n")


def _foam(name: str, kind: str, body: str, more: str = "") -> str:
    """A file under its head, with further entries in that."""
    return f"FoamFile {{ version 2.0; format ascii; class {kind};{more} object {name}; }}\n\n{body}"


#: Faces of a hexahedron, their normals pointing out of it.
_FACES = np.array([[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]])


def write_mesh(mesh: FlowMesh, case: str | Path) -> None:
    """Write ``constant/polyMesh`` of a case; cells keep their numbers. Raises ValueError if faces without a second cell
    are not those of the patches.
    """
    faces, owner, neighbour, patches = faces_of(mesh)
    folder = Path(case) / "constant" / "polyMesh"
    folder.mkdir(parents=True, exist_ok=True)
    note = f"nPoints:{len(mesh.points)} nCells:{len(mesh.cells)} nFaces:{len(faces)} nInternalFaces:{len(neighbour)}"
    _write(folder, "points", "vectorField", _rows(mesh.points, "(%.15g %.15g %.15g)"))
    _write(folder, "faces", "faceList", _rows(faces, "4(%d %d %d %d)"))
    _write(folder, "owner", "labelList", _rows(owner[:, None], "%d"), note)
    _write(folder, "neighbour", "labelList", _rows(neighbour[:, None], "%d"), note)
    entries = "\n".join(
        f"{name} {{ type {PATCHES[name]}; nFaces {count}; startFace {start}; }}" for name, start, count in patches
    )
    _write(folder, "boundary", "polyBoundaryMesh", f"{len(patches)}\n(\n{entries}\n)\n")


def faces_of(mesh: FlowMesh) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[tuple[str, int, int]]]:
    """Faces of a mesh in OpenFOAM's order.

    Returns
    -------
    faces : (nf, 4) int array
        Normals point out of the owner; inner faces first, by owner and neighbour, then patch by patch.
    owner : (nf,) int array
    neighbour : (inner faces,) int array
    patches : list of (name, first face, number of faces)
    """
    every = mesh.cells[:, _FACES].reshape(-1, 4)
    cell = np.repeat(np.arange(len(mesh.cells)), len(_FACES))
    keys = np.sort(every, axis=1)
    order = np.lexsort((cell, *keys.T))  # both sides of a face follow each other, the lower cell first
    sorted_keys = keys[order]
    same = np.all(sorted_keys[1:] == sorted_keys[:-1], axis=1)
    first = np.flatnonzero(same)
    inner, other = order[first], order[first + 1]
    rank = np.lexsort((cell[other], cell[inner]))
    inner, other = inner[rank], other[rank]
    alone = np.ones(len(order), bool)
    alone[first] = alone[first + 1] = False
    outer = order[alone]
    place = {tuple(key): number for number, key in zip(outer, keys[outer].tolist())}
    chosen, patches, begin = [], [], len(inner)
    for name, quads in mesh.patches.items():
        found = [place.pop(tuple(key), -1) for key in np.sort(quads, axis=1).tolist()]
        if -1 in found:
            raise ValueError(f"The patch {name} has faces inside the fluid.")
        chosen.append(np.sort(found))
        patches.append((name, begin, len(found)))
        begin += len(found)
    if place:
        raise ValueError(f"{len(place)} faces at the edge of the fluid belong to no patch.")
    kept = np.concatenate([inner, *chosen])
    return every[kept], cell[kept], cell[other], patches


def _rows(values: np.ndarray, form: str) -> str:
    body = "\n".join([form] * len(values)) % tuple(values.ravel().tolist())
    return f"{len(values)}\n(\n{body}\n)\n"


def _write(folder: Path, name: str, kind: str, body: str, note: str = "") -> None:
    more = ' location "constant/polyMesh";' + (f' note "{note}";' if note else "")
    (folder / name).write_text(_foam(name, kind, body, more))


#: Where Debian's package keeps what the programs read.
_DEBIAN = Path("/usr/share/openfoam")
_STEP = re.compile(r"^Time = (\d+)", re.MULTILINE)


def has_openfoam() -> bool:
    """True where simpleFoam is on the path."""
    return shutil.which("simpleFoam") is not None


def run_openfoam(folder: str | Path, iterations: int, observer: Observer | None = None) -> None:
    """Run the case in a folder, from where it stopped if it did, to its end. Raises SolveError if there is no OpenFOAM,
    or it fails.
    """
    if not has_openfoam():
        raise SolveError(
            f"The case is in {str(folder)!r}, but there is no simpleFoam on the path to run it: 'apt-get install "
            "openfoam' brings it, or run Allrun where it is."
        )
    observer, folder = observer or Observer(), Path(folder).resolve()
    for time_folder in _times(folder):
        if not all((time_folder / name).is_file() for name in _FIELDS):
            shutil.rmtree(time_folder)  # an interruption met it while it was written
    environment = dict(os.environ)
    if "WM_PROJECT_DIR" not in environment and _DEBIAN.exists():
        environment["WM_PROJECT_DIR"] = str(_DEBIAN)
    observer.begin("simpleFoam", iterations)
    process = subprocess.Popen(["./Allrun"], cwd=folder, env=environment, start_new_session=True)
    interrupted, shown = True, 0
    try:
        while process.poll() is None:
            time.sleep(0.5)
            for _ in range(shown, done := _steps(folder)):
                observer.item(None)
            shown = max(shown, done)
        interrupted = False
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGTERM)  # the script and what it runs
            process.wait()
        observer.end(interrupted)
    if process.returncode:
        raise SolveError(f"OpenFOAM failed on the case in {str(folder)!r}: {_reason(folder)}; see its log files.")


def _steps(folder: Path) -> int:
    """Iterations that the solver's log tells of."""
    try:
        with open(folder / "log.simpleFoam", "rb") as log:
            log.seek(max(0, (folder / "log.simpleFoam").stat().st_size - 4000))
            found = _STEP.findall(log.read().decode(errors="ignore"))
    except OSError:
        return 0
    return int(found[-1]) if found else 0


def _reason(folder: Path) -> str:
    """The line of a log that tells most."""
    for name in ("log.simpleFoam", "log.checkMesh"):
        path = folder / name
        lines = path.read_text(errors="ignore").splitlines() if path.exists() else []
        for number, line in enumerate(lines):
            if "FATAL" in line:
                return " ".join(" ".join(lines[number : number + 3]).split())[:200].rstrip(".")
            if "Floating point exception" in line or "sigFpe" in line:
                return "the iteration grew without bound"
    return "it gives no reason"


#: Last share of the iterations over which the inlet pressure is watched.
WATCHED = 0.2


@dataclass(frozen=True)
class FlowFields:
    """Fields of the last iteration that was written."""

    pressure: np.ndarray  #: (nc,), m2/s2; over the density.
    velocity: np.ndarray  #: (nc, 3), m/s.
    iterations: int
    history: np.ndarray  #: (n, 2); iteration and pressure over density at the inlet.

    @property
    def unrest(self) -> float:
        """Span of the inlet pressure over the last fifth of the iterations, relative."""
        last = self.history[int((1.0 - WATCHED) * len(self.history)) :, 1]
        return float(np.ptp(last) / abs(last[-1])) if len(last) > 1 else np.inf


def read_fields(folder: str | Path, cells: int) -> FlowFields:
    """Read what a run left in a folder. Raises SolveError if it left nothing, or fields of another mesh.

    Parameters
    ----------
    cells : int
        How many there are in the mesh.
    """
    folder = Path(folder)
    times = [int(p.name) for p in _times(folder)]
    if not times:
        raise SolveError(f"No flow was computed in {str(folder)!r} yet.")
    (folder / "case.foam").touch()
    reader = pyvista.POpenFOAMReader(str(folder / "case.foam"))
    reader.case_type = "reconstructed"
    reader.cell_to_point_creation = False
    reader.set_active_time_value(float(times[-1]))
    data = reader.read()["internalMesh"].cell_data
    pressure, velocity = (np.array(data[name], float) for name in ("p", "U"))
    if len(pressure) != cells:
        raise SolveError(f"The flow in {str(folder)!r} has {len(pressure)} cells and the mesh of this state {cells}.")
    return FlowFields(pressure, velocity, times[-1], _history(folder))


def _times(folder: Path) -> list[Path]:
    """Folders of the iterations whose fields were written, ascending."""
    found = [p for p in folder.iterdir() if p.name.isdigit() and int(p.name) > 0]
    return sorted(found, key=lambda p: int(p.name))


def _history(folder: Path) -> np.ndarray:
    """Inlet pressure over the iterations of all runs in the folder, later ones in place of earlier ones."""
    found: dict[int, float] = {}
    for path in sorted(folder.glob("postProcessing/inletPressure/*/*.dat"), key=lambda p: int(p.parent.name)):
        rows = (line.split() for line in path.read_text().splitlines() if not line.startswith("#"))
        found |= {int(row[0]): float(row[1]) for row in rows if len(row) == 2}  # the last may be cut
    return np.array(sorted(found.items())).reshape(-1, 2)


#: Holds the inputs of the run, beside the files of OpenFOAM, once all of them are written; its name until then.
NOTE = "question.json"
DRAFT = f"{NOTE}.part"
#: Of water at 20 degrees, m2/s.
WATER_VISCOSITY = 1.0e-6


@dataclass(frozen=True)
class FlowCase:
    """Viscous flow through the shape of one steady state, with the volume flow of that state."""

    name: str  #: Of the valve, for titles.
    mesh: MeshData  #: Of the shell.
    state: SteadyState
    density: float  #: kg/m3.
    #: Diameter of the pipe in which the valve stands, m; the jet goes into a room without it.
    pipe: float | None = None
    fineness: float = 0.5  #: Cells in each direction over the usual number.
    iterations: int = 400  #: At most.
    viscosity: float = WATER_VISCOSITY  #: m2/s.

    @cached_property
    def faces(self) -> WallFaces:
        """Faces of the deformed wall."""
        return WallFaces.of(self.mesh, self.state.nodal)

    @cached_property
    def domain(self) -> Domain:
        """Region of fluid that is meshed. Raises CaseError if the valve does not go into the pipe, or more than a
        quarter of it is computed.
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
        """The mesh. Raises CaseError if it does not come out sound."""
        try:
            return FlowMesh.of(self.domain)
        except ValueError as error:
            raise CaseError(f"No sound mesh of this state: {error}") from error

    @property
    def inlet_velocity(self) -> float:
        """Mean velocity of the stream that comes in, m/s."""
        return self.state.volume_flow / (0.25 * math.pi * (2.0 * self.domain.bore) ** 2)

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
        """Write the case, unless the folder holds it already; returns whether it did not. Raises CaseError if the
        folder holds another case, or cannot be written.
        """
        folder = Path(folder)
        try:
            known = (folder / NOTE).exists()
            if known and json.loads((folder / NOTE).read_text()) != self.inputs:
                raise CaseError(
                    f"{str(folder)!r} holds the flow through another shape or on another mesh; name a new one."
                )
            begun = (folder / DRAFT).exists()
            if not (known or begun) and folder.exists() and any(folder.iterdir()):
                raise CaseError(f"{str(folder)!r} is not empty and holds no flow of this program; name a new folder.")
            if not known:
                mesh = self.cells
                folder.mkdir(parents=True, exist_ok=True)
                (folder / DRAFT).write_text(json.dumps(self.inputs, indent=1) + "\n")
            for name, text in case_files(self).items():
                path = folder / name
                if known and name.startswith("0/"):
                    continue
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_text(text)
            (folder / "Allrun").chmod(0o755)
            if not known:
                write_mesh(mesh, folder)
                (folder / DRAFT).replace(folder / NOTE)
        except OSError as error:
            raise CaseError(f"{str(folder)!r} cannot be written ({error.strerror or error}).") from error
        return not known
