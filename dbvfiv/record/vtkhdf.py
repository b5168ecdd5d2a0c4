"""Results as fields on the valve for ParaView: VTKHDF files of quadrilaterals with point and cell data over steps.

Written to the VTKHDF 2.0 description of temporal unstructured grids. A mesh that does not move is stored once, and
every step points to it.
"""

from __future__ import annotations

import inspect
import os
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from ..errors import CaseError
from ..shell.mesh import nodal_thickness
from .mesh import MeshData, WholeValve

_VTK_QUAD = 9


@dataclass(frozen=True)
class Step:
    """Fields at one value of "time"."""

    value: float
    #: point_data and cell_data: mapping of str to; first axis: points or cells; the same names at every step.
    point_data: Mapping[str, np.ndarray]
    cell_data: Mapping[str, np.ndarray] = field(default_factory=dict)
    points: np.ndarray | None = None  #: (np, 3); positions of the points, where they move.


def write_vtkhdf(
    path: str | Path, points: np.ndarray, quads: np.ndarray, steps: Iterable[Step], units: Mapping[str, str] = {}
) -> None:
    """Write quadrilaterals and their fields.

    Parameters
    ----------
    points : (np, 3) array, m
    quads : (nq, 4) int array
    steps : iterable of Step
    units : mapping
        Units by name of field, written as attributes, which ParaView ignores and people read.
    """
    with h5py.File(path, "w") as file:
        root = file.create_group("VTKHDF")
        root.attrs["Version"] = np.array([2, 0], "i8")
        root.attrs.create("Type", np.bytes_("UnstructuredGrid"))
        root["NumberOfPoints"] = np.array([len(points)], "i8")
        root["NumberOfCells"] = np.array([len(quads)], "i8")
        root["NumberOfConnectivityIds"] = np.array([quads.size], "i8")
        root["Connectivity"] = quads.astype("i8").ravel()
        root["Offsets"] = 4 * np.arange(len(quads) + 1, dtype="i8")
        root["Types"] = np.full(len(quads), _VTK_QUAD, "u1")
        _append(root, "Points", points)
        count, values, moving = 0, [], []
        for step in steps:
            if step.points is not None:
                moving.append(count * len(points))
                if count:
                    _append(root, "Points", step.points)
                else:
                    root["Points"][...] = step.points
            else:
                moving.append(0)
            for kind, data in (("PointData", step.point_data), ("CellData", step.cell_data)):
                group = root.require_group(kind)
                for name, array in data.items():
                    _append(group, name, array).attrs["units"] = units.get(name, "")
            values.append(float(step.value))
            count += 1
        _write_steps(root, values, moving)


def _append(group: h5py.Group, name: str, array: np.ndarray) -> h5py.Dataset:
    """Add an array behind what a dataset holds already."""
    array = np.asarray(array, "f8")
    if name not in group:
        return group.create_dataset(name, data=array, maxshape=(None, *array.shape[1:]), chunks=array.shape)
    dataset = group[name]
    before = len(dataset)
    dataset.resize(before + len(array), axis=0)
    dataset[before:] = array
    return dataset


def _write_steps(root: h5py.Group, values: list[float], moving: list[int]) -> None:
    count = len(values)
    zero = np.zeros(count, "i8")
    steps = root.create_group("Steps")
    steps.attrs["NSteps"] = np.int64(count)
    steps["Values"] = np.array(values)
    steps["PartOffsets"] = zero
    steps["NumberOfParts"] = np.ones(count, "i8")
    steps["PointOffsets"] = np.array(moving, "i8")
    steps["CellOffsets"] = zero[:, None]
    steps["ConnectivityIdOffsets"] = zero[:, None]
    for kind in ("PointData", "CellData"):
        offsets = steps.create_group(f"{kind}Offsets")
        for name, dataset in root.get(kind, {}).items():
            offsets[name] = np.arange(count, dtype="i8") * (len(dataset) // max(count, 1))


_UNITS = {"displacement": "m", "rotation": "rad", "thickness": "m", "pressure": "Pa", "velocity": "m/s"}


def export_result(result: Any, path: str | Path, quarter: bool = False, deformed: bool = False, **choices: Any) -> Path:
    """Write a result as one VTKHDF file with a step for each state. Raises CaseError if the result has nothing to show
    in space, cannot be told a choice, the file cannot be written, or its name is taken by a file of another kind.

    Parameters
    ----------
    path : path
        Name of the file, or a folder in which it gets the name of the case.
    quarter : bool
        Only the part that was computed.
    deformed : bool
        Points move with the states; otherwise they stay at rest, for ParaView's "Warp By Vector" along
        ``displacement``.
    choices
        What results of some kinds may be told, such as ``mode`` for one cycle of a mode.

    Returns
    -------
    Path
    """
    valve = WholeValve.of(result.mesh, quarter)
    for name in choices:
        if name not in inspect.signature(result.steps).parameters:
            raise CaseError(f"The {result.kind} result of {result.header.name!r} has no {name} to choose.")
    steps = result.steps(valve, **choices)
    if not len(steps):
        raise CaseError(f"The {result.kind} result of {result.header.name!r} holds no state that could be exported.")
    path = Path(path)
    if path.suffix.lower() not in (".vtkhdf", ".hdf"):
        chosen = "".join(f"-{name}{value}" for name, value in choices.items())
        path = path / f"{result.header.name}-{result.kind}{chosen}.vtkhdf"
    units = _UNITS | {name: "Pa" for name in steps[0].cell_data if name.startswith("von_mises")}
    draft = path.with_name(f".{path.name}.{os.getpid()}.new")
    try:
        _refuse_other(path)
        path.parent.mkdir(parents=True, exist_ok=True)
        write_vtkhdf(draft, valve.points, valve.quads, _moved(steps, valve, deformed), units)
        return draft.replace(path)
    except OSError as error:
        raise CaseError(
            f"{str(path)!r} cannot be written ({error.strerror or 'the folder may not be written'})."
        ) from error
    finally:
        with suppress(OSError):
            draft.unlink(missing_ok=True)


def _refuse_other(path: Path) -> None:
    """Refuse the name of anything but an earlier export, such as of the result itself."""
    if not path.exists() or not path.stat().st_size:
        return
    if h5py.is_hdf5(path):
        with h5py.File(path) as file:
            if "VTKHDF" in file:
                return
    raise CaseError(f"{str(path)!r} exists and is no VTKHDF file, so it is not overwritten; choose another name.")


def _moved(steps: Sequence[Step], valve: WholeValve, deformed: bool) -> Iterator[Step]:
    for step in steps:
        yield replace(step, points=valve.points + step.point_data["displacement"]) if deformed else step


def motion(mesh: MeshData, valve: WholeValve, nodal: np.ndarray) -> dict[str, np.ndarray]:
    """Displacement, rotation vector and director at the points from nodal unknowns (nn, c)."""
    directors, towards = (
        valve.vectors(mesh.directors),
        valve.vectors(np.einsum("na,nai->ni", nodal[:, 3:5], mesh.frames)),
    )
    angle = np.linalg.norm(towards, axis=1, keepdims=True)
    return {
        "displacement": valve.vectors(nodal[:, :3]),
        "rotation": np.cross(directors, towards),
        "director": np.cos(angle) * directors + np.sinc(angle / np.pi) * towards,
    }


def faces(mesh: MeshData, nodal: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Inner and outer face of the part that is computed.

    Parameters
    ----------
    nodal : (nn, c) array, optional
        Displacements, m, and rotations of the nodes; at rest without it.

    Returns
    -------
    inner, outer : (nn, 3) arrays, m
    """
    half = 0.5 * nodal_thickness(mesh)[:, None]
    if nodal is None:
        return mesh.nodes - half * mesh.directors, mesh.nodes + half * mesh.directors
    moved = motion(mesh, WholeValve.of(mesh, quarter=True), nodal)
    middle = mesh.nodes + moved["displacement"]
    return middle - half * moved["director"], middle + half * moved["director"]


def layer_field_names(mesh: MeshData, quantity: str) -> list[str]:
    """Names of a field in each layer, inside to outside: von_mises_1_CR, von_mises_3_fibre, ..."""
    return [f"{quantity}_{i + 1}_{re.sub(r'[^A-Za-z0-9_-]+', '_', name)}" for i, name in enumerate(mesh.layer_names)]
