"""Faces of the wall of a state as grids: inner face of the passage, mid-surface, outer face."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..case.part import QUARTER, Part
from ..drawing.faces import faces
from ..record.mesh import MeshData
from .passage import passage_grid


@dataclass(frozen=True)
class WallFaces:
    """Grids (rows, columns, 3), m, of the part that is computed: rows from the lip to the flange, columns from x = 0,
    of a half from y = 0, to y = 0.

    Attributes
    ----------
    inner : array
        The inner face that fluid meets, see `dbvfiv.exchange.passage`.
    middle, outer : arrays
    part : Part
        Of the valve.
    """

    inner: np.ndarray
    middle: np.ndarray
    outer: np.ndarray
    part: Part = QUARTER

    @classmethod
    def of(cls, mesh: MeshData, nodal: np.ndarray) -> WallFaces:
        """Faces of the deformed wall from nodal unknowns (nn, c).

        Raises
        ------
        CaseError
            If the passage is shut.
        """
        inner, outer = faces(mesh, nodal)
        grids = [inner[mesh.rows], 0.5 * (inner + outer)[mesh.rows], outer[mesh.rows]]
        for grid in grids:  # the planes of symmetry, to the last digit
            for column, across in mesh.part.edges:
                grid[:, column, across] = 0.0
        if mesh.part.is_quarter:
            grids[0] = passage_grid(grids[0])
        else:
            centre = mesh.part.centre(grids[0].shape[1])
            right, left = grids[0][:, centre:], grids[0][:, centre::-1] * [-1.0, 1.0, 1.0]
            left = passage_grid(left)[:, :0:-1] * [-1.0, 1.0, 1.0]
            grids[0] = np.concatenate([left, passage_grid(right)], axis=1)
        return cls(*grids, mesh.part)

    def section_areas(self) -> np.ndarray:
        """Area (rows,) of the part's passage at each row, m2, as seen along the axis."""
        x, y = self.inner[..., 0], self.inner[..., 1]
        return np.sum(0.5 * (y[:, 1:] + y[:, :-1]) * np.diff(x, axis=1), axis=1)

    @property
    def base(self) -> np.ndarray:
        """Points of the plane y = 0 below those of the inner face: the other side of the part's fluid."""
        return self.inner * [1.0, 0.0, 1.0]
