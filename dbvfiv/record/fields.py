"""Results as fields on the valve for ParaView."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import CaseError
from .mesh import MeshData
from .vtkhdf import Step, write_vtkhdf
from .whole_valve import WholeValve

if TYPE_CHECKING:
    from .result import Result

_UNITS = {"displacement": "m", "rotation": "rad", "thickness": "m", "pressure": "Pa", "velocity": "m/s"}


def export_result(
    result: Result, path: str | Path, quarter: bool = False, deformed: bool = False, **choices: Any
) -> Path:
    """Write a result as one VTKHDF file with a step for each state.

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

    Raises
    ------
    CaseError
        If the result has nothing to show in space, cannot be told a choice, or the file cannot be written.
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
        path = path / f"{result.header.name}-{result.kind}{_suffix(choices)}.vtkhdf"
    units = _UNITS | {name: "Pa" for name in steps[0].cell_data if name.startswith("von_mises")}
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_vtkhdf(path, valve.points, valve.quads, _moved(steps, valve, deformed), units)
    except OSError as error:
        raise CaseError(
            f"{str(path)!r} cannot be written ({error.strerror or 'the folder may not be written'})."
        ) from error
    return path


def _suffix(choices: dict[str, Any]) -> str:
    return "".join(f"-{name}{value}" for name, value in choices.items())


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


def layer_field_names(mesh: MeshData, quantity: str) -> list[str]:
    """Names of a field in each layer, inside to outside: von_mises_1_CR, von_mises_3_fibre, ..."""
    return [f"{quantity}_{i + 1}_{re.sub(r'[^A-Za-z0-9_-]+', '_', name)}" for i, name in enumerate(mesh.layer_names)]
