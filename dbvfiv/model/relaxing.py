"""Viscoelasticity of the wall: groups of layers, each with its own Prony series, over common relaxation times."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from eigen.operator import Relaxation

from ..materials.laws import MaterialError
from ..shell.section import RelaxingGroup, Section


@dataclass(frozen=True)
class Branches:
    """Maxwell branches of a wall."""

    groups: tuple[str, ...]  #: Materials of the layers that relax alike.
    strengths: np.ndarray  #: (g, j); of each group over its slow law at each of the times.
    times: np.ndarray  #: (j,); s, increasing.

    def __bool__(self) -> bool:
        return bool(self.times.size)


@dataclass(frozen=True)
class WallRelaxation:
    """Viscoelastic groups of layers of the wall.

    Examples
    --------
    >>> WallRelaxation(()).branches(1.0).times
    array([], dtype=float64)
    """

    groups: tuple[RelaxingGroup, ...]  #: Layers with the same series together; none where the wall is elastic.

    @classmethod
    def of(cls, section: Section) -> WallRelaxation:
        """Groups of the layers of a section."""
        return cls(section.relaxing)

    def branches(self, loss_factor: float) -> Branches:
        """Branches with a factor on the loss factors of all layers; a group has none at the times of others alone.
        Raises MaterialError if the factor is negative or not finite, or a series does not come near it.
        """
        series = [group.series.scaled(loss_factor) for group in self.groups]
        pairs = [(i, g, t) for i, one in enumerate(series) for g, t in zip(one.strengths, one.times) if g > 0]
        times = np.unique([t for _, _, t in pairs])
        strengths = np.zeros((len(self.groups), len(times)))
        for i, g, t in pairs:
            strengths[i, np.searchsorted(times, t)] += g
        return Branches(tuple(group.name for group in self.groups), strengths, times)

    def highest(self, factor: float, wanted: float) -> float:
        """Highest factor on the loss factors that all series meet, from one that they meet up to one that is wanted."""
        while wanted > factor:
            try:
                self.branches(wanted)
                return wanted
            except MaterialError:
                wanted *= 0.9
        return factor

    def stiffness(self, loss_factor: float, matrices: Callable[[], Sequence]) -> Relaxation | None:
        """Viscoelastic part of a stiffness, None for an elastic wall.

        `matrices` gives the stiffness K_g of each group and is called only where it is needed.
        """
        branches = self.branches(loss_factor) if loss_factor else None
        return Relaxation(matrices(), branches.strengths, branches.times) if branches else None
