"""A mesh of hexahedra in OpenFOAM's own format: faces with the cells on both sides of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from .hexahedra import PATCHES, FlowMesh

#: Faces of a hexahedron, their normals pointing out of it.
_FACES = np.array([[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]])


def write_mesh(mesh: FlowMesh, case: str | Path) -> None:
    """Write ``constant/polyMesh`` of a case; cells keep their numbers.

    Raises
    ------
    ValueError
        If faces without a second cell are not those of the patches.
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
    note = f' note "{note}";' if note else ""
    head = f'FoamFile {{ version 2.0; format ascii; class {kind}; location "constant/polyMesh";{note} object {name}; }}'
    (folder / name).write_text(f"{head}\n\n{body}")
