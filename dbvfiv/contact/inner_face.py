"""Wall thickness and area that belong to the nodes of a shell."""

from __future__ import annotations

import numpy as np

from ..shell import Shell
from ..shell.reference import SHAPE


def nodal_thickness(shell: Shell) -> np.ndarray:
    """Mean thickness (nn,) of the elements that meet at each node, m."""
    mesh = shell.mesh
    total, count = np.zeros(mesh.node_count), np.zeros(mesh.node_count)
    np.add.at(total, mesh.quads, np.broadcast_to(mesh.thickness[:, None], mesh.quads.shape))
    np.add.at(count, mesh.quads, 1.0)
    return total / count


def tributary_area(shell: Shell) -> np.ndarray:
    """Integrals (nn,) of the shape functions over the mid-surface at rest, m2; they sum to its area."""
    mesh = shell.mesh
    out = np.zeros(mesh.node_count)
    np.add.at(out, mesh.quads, shell.geometry.area @ SHAPE)
    return out
