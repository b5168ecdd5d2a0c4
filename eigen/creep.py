"""Creep: the crowd of real eigenvalues that relaxation brings, and what of a spectrum does not belong to it."""

from __future__ import annotations

import numpy as np

from .coverage import CLEAR
from .pencil import CoupledPencil
from .relaxation import Relaxation

#: Share of the size of an eigenvalue below which its imaginary part is no oscillation: a crowd of creep that rounding
#: has split, or a motion whose damping ratio exceeds 0.995.
OVERDAMPED = 0.1


def creep_edge(pencil: CoupledPencil) -> float:
    """Growth rate right of which a real eigenvalue is clearly no creep, 1/s, negative; minus infinity without.

    A stiffness of which all relaxes creeps at the zeros of 1 + phi_g, the slowest of them left of -1/(tau_max (1 + sum
    of strengths)).
    """
    return edge_of(pencil.relaxation)


def edge_of(relaxation: Relaxation | None) -> float:
    """The same of what relaxes."""
    if relaxation is None:
        return -np.inf
    return float(-CLEAR / (relaxation.times.max() * (1.0 + relaxation.strengths.sum(axis=1).max())))


def apart_from_creep(pencil: CoupledPencil, values: np.ndarray) -> np.ndarray:
    """Which eigenvalues oscillate, or lie clearly right of the creep."""
    values = np.asarray(values)
    return (np.abs(values.imag) > OVERDAMPED * np.abs(values)) | (values.real > creep_edge(pencil))
