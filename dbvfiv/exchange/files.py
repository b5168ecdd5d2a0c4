"""Surfaces and bodies of a state as files: triangles (STL), smooth faces (STEP)."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.interpolate import PchipInterpolator

from ..errors import CaseError
from ..record.mesh import MeshData
from .bodies import SHAPES, Piece, Shape, WallFaces, shape_of

if TYPE_CHECKING:
    import pyvista

#: STEP files are in millimetres.
MILLIMETRES = 1e3


@contextmanager
def open_gmsh(name: str) -> Iterator[Any]:
    """A quiet gmsh with an empty model. Raises CaseError if gmsh is not there or cannot be loaded."""
    try:
        import gmsh
    except (ImportError, OSError) as error:
        raise CaseError(
            f"STEP files and meshes of the fluid need gmsh, which cannot be loaded here ({error}); "
            "'pip install gmsh' brings it, and on a machine without a desktop 'apt-get install libglu1-mesa libxft2 "
            "libxcursor1 libxinerama1' what it is linked to."
        ) from None
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("General.Verbosity", 1)
        gmsh.model.add(name)
        yield gmsh
    finally:
        gmsh.finalize()


def write_step(shape: Shape, path: str | Path, name: str) -> dict[str, float]:
    """Write a shape as STEP in millimetres. Raises CaseError if gmsh is missing, or a body does not close.

    Along rows and columns the faces are cubic with a continuous tangent and without overshoot (Fritsch and Carlson
    1980), and go through all points.

    Returns
    -------
    dict
        ``area`` of its faces, m2, and ``volume``, m3, as the kernel measures them.
    """
    with open_gmsh(name) as gmsh:
        kernel = gmsh.model.occ
        faces = [_add_face(kernel, piece) for piece in shape.images()]
        solids = []
        if shape.closed:
            solids = [(3, _sewn(kernel, faces, name))]
            kernel.remove([(2, face) for face in faces], recursive=True)
        kernel.synchronize()
        volume = sum(kernel.getMass(*solid) for solid in solids) / MILLIMETRES**3
        area = sum(kernel.getMass(*face) for face in kernel.getEntities(2)) / MILLIMETRES**2
        with _silent():  # the kernel reports on standard output, which may be one JSON document
            gmsh.write(str(path))
    return {"area": area, "volume": volume}


@contextmanager
def _silent() -> Iterator[None]:
    """Nothing from compiled code on standard output."""
    sys.stdout.flush()
    kept, nowhere = os.dup(1), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    try:
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)
        os.close(nowhere)


def _sewn(kernel: Any, faces: list[int], name: str) -> int:
    """The body that faces bound. Raises CaseError if they do not close."""
    try:
        return kernel.addVolume([kernel.addSurfaceLoop(faces, sewing=True)])
    except Exception as error:  # gmsh raises no other kind
        raise CaseError(f"The {name} does not close to a body ({error}); STL may still serve.") from error


def _add_face(kernel: Any, piece: Piece) -> int:
    """A face through the points of a piece."""
    poles = MILLIMETRES * piece.points
    first, second = piece.places
    poles = _poles(_poles(poles, first).swapaxes(0, 1), second)  # the first direction runs fastest
    tags = [kernel.addPoint(*point) for point in poles.reshape(-1, 3)]
    (often_u, degree_u), (often_v, degree_v) = _spline(first), _spline(second)
    face = kernel.addBSplineSurface(
        tags,
        poles.shape[1],
        degreeU=degree_u,
        degreeV=degree_v,
        knotsU=first,
        knotsV=second,
        multiplicitiesU=often_u,
        multiplicitiesV=often_v,
    )
    kernel.remove([(0, tag) for tag in tags])
    return face


def _spline(places: np.ndarray) -> tuple[list[int], int]:
    """Multiplicities of the knots and degree along a direction."""
    return ([2, 2], 1) if len(places) == 2 else ([4, *[2] * (len(places) - 2), 4], 3)


def _poles(values: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Poles along the first axis of points (m, n, 3); two of them stay a line."""
    if len(places) == 2:
        return values
    slope = PchipInterpolator(places, values, axis=0).derivative()(places)
    third = (np.diff(places) / 3.0)[:, None, None]
    poles = np.empty((2 * len(values), *values.shape[1:]))
    poles[0], poles[-1] = values[0], values[-1]
    poles[1:-1:2] = values[:-1] + third * slope[:-1]
    poles[2:-1:2] = values[1:] - third * slope[1:]
    return poles


#: Points closer than this share of the size of the shape are one.
SAME = 1e-9


def triangulated(shape: Shape) -> pyvista.PolyData:
    """Triangles of a shape, m: the diagonals of each image are mirror images of those of the part itself. Raises
    ValueError if a body is not watertight.
    """
    points, triangles, count = [], [], 0
    for sx, sy in shape.signs:
        for piece in shape.pieces:
            number = count + np.arange(piece.points[..., 0].size).reshape(piece.points.shape[:2])
            a, b, c, d = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
            found = np.concatenate([np.stack(t, axis=-1).reshape(-1, 3) for t in ((a, b, c), (a, c, d))])
            triangles.append(found if sx * sy > 0 else found[:, ::-1])
            points.append(piece.points.reshape(-1, 3) * [sx, sy, 1.0] + 0.0)
            count += len(points[-1])
    import pyvista

    joined, triangles = _joined(np.concatenate(points), np.concatenate(triangles))
    surface = pyvista.PolyData.from_regular_faces(joined, triangles)
    if shape.closed and not surface.is_manifold:
        raise ValueError("The body is not watertight.")
    return surface


def _joined(points: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points that fall together made one, triangles that vanish with that left out."""
    size = SAME * np.ptp(points, axis=0).max()
    _, first, number = np.unique(np.round(points / size), axis=0, return_index=True, return_inverse=True)
    triangles = number.reshape(-1)[triangles]
    a, b, c = triangles.T
    return points[first], triangles[(a != b) & (b != c) & (c != a)]


def write_stl(shape: Shape, path: str | Path) -> pyvista.PolyData:
    """Write a shape as binary STL in metres, and return its triangles."""
    surface = triangulated(shape)
    surface.save(path)
    return surface


FORMATS = ("stl", "step")


def state_name(name: str, pressure: float) -> str:
    """Beginning of the names of a state's files: ``dbv12-36kPa``; pressures that differ have names that do."""
    return f"{name}-{pressure / 1e3:.10g}kPa"


def write_shapes(
    mesh: MeshData,
    nodal: np.ndarray,
    folder: str | Path,
    name: str,
    format: str = "stl",
    shapes: Sequence[str] = (),
    quarter: bool = False,
) -> list[Path]:
    """Write shapes of a deformed valve, each into a file ``NAME-SHAPE.FORMAT``. Raises CaseError for an unknown shape
    or format, a state without an open passage, a missing gmsh, or a file that cannot be written.

    Parameters
    ----------
    nodal : (nn, c) array
        Displacements, m, and rotations of the nodes.
    format : str
        ``stl``: triangles through the nodes, in metres; ``step``: smooth faces, in millimetres.
    shapes : sequence of str
        Of `dbvfiv.exchange.bodies.SHAPES`; all without it.
    quarter : bool
        Only the part that was computed.

    Returns
    -------
    list of Path
    """
    for given, allowed, what in ((shapes, SHAPES, "shape"), ([format], FORMATS, "format of surfaces")):
        unknown = [value for value in given if value not in allowed]
        if unknown:
            raise CaseError(f"There is no {what} {unknown[0]!r}; there are {', '.join(allowed)}.")
    faces, written = WallFaces.of(mesh, nodal, bool({"inner", "wall", "fluid"} & {*(shapes or SHAPES)})), []
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
