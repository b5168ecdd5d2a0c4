"""Surfaces and bodies of a state as files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..drawing.style import kilopascals
from ..errors import CaseError
from ..record.mesh import MeshData
from .bodies import SHAPES, shape_of
from .faces import WallFaces
from .step import write_step
from .stl import write_stl

FORMATS = ("stl", "step")


def state_name(name: str, pressure: float) -> str:
    """Beginning of the names of a state's files: ``dbv12-36kPa``."""
    return f"{name}-{kilopascals(pressure).replace(' ', '')}"


def write_shapes(
    mesh: MeshData,
    nodal: np.ndarray,
    folder: str | Path,
    name: str,
    format: str = "stl",
    shapes: Sequence[str] = (),
    quarter: bool = False,
) -> list[Path]:
    """Write shapes of a deformed valve, each into a file ``NAME-SHAPE.FORMAT``.

    Parameters
    ----------
    mesh : MeshData
    nodal : (nn, c) array
        Displacements, m, and rotations of the nodes.
    folder : path
    name : str
    format : str
        ``stl``: triangles through the nodes, in metres; ``step``: smooth faces, in millimetres.
    shapes : sequence of str
        Of `dbvfiv.exchange.bodies.SHAPES`; all without it.
    quarter : bool
        Only the part that was computed.

    Returns
    -------
    list of Path

    Raises
    ------
    CaseError
        For an unknown shape or format, a state without an open passage, a missing gmsh, or a file that cannot be
        written.
    """
    for given, allowed, what in ((shapes, SHAPES, "shape"), ([format], FORMATS, "format of surfaces")):
        unknown = [value for value in given if value not in allowed]
        if unknown:
            raise CaseError(f"There is no {what} {unknown[0]!r}; there are {', '.join(allowed)}.")
    faces, written = WallFaces.of(mesh, nodal), []
    try:
        Path(folder).mkdir(parents=True, exist_ok=True)
        for one in shapes or SHAPES:
            path = Path(folder) / f"{name}-{one}.{format}"
            shape = shape_of(faces, one, not quarter)
            if format == "step":
                write_step(shape, path, one)
            else:
                write_stl(shape, path)
            written.append(path)
    except OSError as error:
        raise CaseError(f"{str(folder)!r} cannot be written ({error.strerror or error}).") from error
    return written
