"""Energies of a wall that moves."""

from __future__ import annotations

import numpy as np

from ..model import ValveModel
from .kernels import strain_energy


def wall_energies(model: ValveModel, q: np.ndarray, v: np.ndarray) -> tuple[float, float]:
    """Kinetic energy and strain energy at positions and velocities (n,), J of the part."""
    shell = model.shell
    nodal = model.nodal(q)
    d = shell.directors(nodal)[0]
    if shell.metric == "first-order":
        parts = zip(shell.parts, shell.wall)
        strain = sum(strain_energy(p.quads, shell.mesh.nodes, nodal, d, p.reference, wall) for p, wall in parts)
    else:
        strain = shell.energy(q)
    return shell.kinetic_energy(q, v), float(strain)
