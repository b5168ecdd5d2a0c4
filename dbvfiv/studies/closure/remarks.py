"""Sentences on what should be known about a model under back pressure and the states that were found."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from ...model.symmetry import EQUILIBRIA
from .model import HELD_LIPS, ClosureModel

#: Overlap of the inner faces over the penetration that is left, from which on the faces count as crossed.
CROSSED = 10.0


@dataclass(frozen=True)
class FoundPlace:
    """Pressure, Pa, overlap, m, and unknowns of a state that warnings look at."""

    pressure: float
    overlap: float
    q: np.ndarray


def start_warnings(model: ClosureModel) -> Iterator[str]:
    """Warnings where the inner face starts beyond the closing plane."""
    mesh, near, beyond = model.mesh, model.folded_start, model.nodes_beyond
    if len(beyond):
        z = mesh.nodes[near, 2]
        deepest = float(-model.face.start.min())
        yield (
            f"The inner face starts beyond the closing plane at {len(beyond)} node{'s' * (len(beyond) > 1)}, by up to "
            f"{deepest * 1e3:.2g} mm, and nearer to it than "
            f"the initial gap at {len(near)} (z {z.min():.3f} to {z.max():.3f} m, of {model.face.count} "
            f"nodes): there half the wall is thicker than "
            "the mid-surface is high, and contact resists further closing by more than the initial gap only."
        )
    if model.supports == HELD_LIPS:
        yield (
            "The duckbill is held shut by its supports, as in Th. 3.6, so that nothing is found out about "
            "whether its lips seal."
        )
        if model.case.closure.symmetry != EQUILIBRIA:
            yield (
                "closure.symmetry asks for all classes of motion, but lips that are held shut cannot move together, so "
                "with these supports only the class of the model is watched for buckling."
            )


def overlap_warnings(model: ClosureModel, states: Iterable[FoundPlace]) -> Iterator[str]:
    """Warning where the inner faces overlap."""
    deep = [state for state in states if state.overlap > CROSSED * model.case.closure.penetration]
    if deep:
        worst = max(deep, key=lambda state: state.overlap)
        yield (
            f"The inner faces overlap by up to {worst.overlap * 1e3:.2g} mm at {worst.pressure:.6g} Pa, "
            f"because these supports stop the mid-surface and "
            "not the faces."
        )
