"""VTKHDF files: quadrilaterals with point and cell data over steps, as ParaView 5.12 and later read them.

Written to the VTKHDF 2.0 description of temporal unstructured grids. A mesh that does not move is stored once, and
every step points to it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import h5py
import numpy as np

_VTK_QUAD = 9


@dataclass(frozen=True)
class Step:
    """Fields at one value of "time".

    Attributes
    ----------
    value : float
    point_data, cell_data : mapping of str to array
        First axis: points or cells; the same names at every step.
    points : (np, 3) array, optional
        Positions of the points, where they move.
    """

    value: float
    point_data: Mapping[str, np.ndarray]
    cell_data: Mapping[str, np.ndarray] = field(default_factory=dict)
    points: np.ndarray | None = None


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
