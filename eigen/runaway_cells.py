"""What runs away of a structure by itself, under the conditions of many cells: the small pencils of its motions and of
the modes of a column.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from .family import Condition
from .mass_basis import orthonormal
from .rational import SAME, refined, started
from .reduced import Pairs, ReducedFamily
from .reduction import FamilyReduction
from .runaway import NEAR, Runaway

#: Length over that of a motion above which what it has outside the modes is taken in.
DISTINCT = 1e-6
#: Inverse iterations at the rates of the structure alone.
STARTED = 3
#: Size, over that of the largest, of what motions under several dampings differ by up to which they are one.
APART = 0.2


@dataclass(frozen=True, eq=False)
class RunawayCells:
    """Unstable eigenvalues of cells that are those of the structure alone, moved a little by what couples it.

    Attributes
    ----------
    modes : ReducedFamily
        Modes and motions that run away, for eigenvalues of the modes: without those motions it may hold them by halves.
    space : ReducedFamily
        That or a wider one, for eigenvalues of what runs away.
    core : (n, k) array
        The same with as few motions as have as many eigenvalues.
    alone : mapping
        From a damping to what runs away then.
    """

    modes: ReducedFamily
    space: ReducedFamily
    core: np.ndarray
    alone: Mapping[tuple[float, float, float], Runaway]

    @classmethod
    def beside(cls, modes: ReducedFamily, alone: Mapping[tuple[float, float, float], Runaway]) -> RunawayCells:
        """With the modes of a column."""
        motions = np.hstack([found.motions for found in alone.values()])
        if not motions.shape[1]:
            return cls(modes, modes, modes.V, alone)
        core, _ = orthonormal(modes.family.mass, np.hstack([found.core for found in alone.values()]), APART)
        rates = {damping: found.rates for damping, found in alone.items()}
        # what a motion's two vectors differ by swings, and belongs to the modes
        base = ReducedFamily(modes.family, core, DISTINCT)
        both = ReducedFamily(modes.family, np.hstack([motions, modes.V]), DISTINCT, base=base, rates=rates)
        return cls(both, both, np.hstack([modes.V, core]), alone)

    def wider(self, vectors: np.ndarray) -> RunawayCells:
        """The same on a space with further vectors."""
        return replace(self, space=ReducedFamily(self.space.family, vectors, DISTINCT, base=self.space))

    def eigenvalues(self, conditions: list[Condition]) -> list[np.ndarray]:
        """Of each cell, the fastest first, a conjugate pair given once; (r,) complex each."""
        rows: list[list[complex]] = [[] for _ in conditions]
        rates = [self.alone[c.damping].rates for c in conditions]
        cells = np.repeat(np.arange(len(conditions)), [own.size for own in rates])
        if cells.size:
            problem, starts = self.space.small.problem(conditions), np.concatenate(rates)
            found = refined(problem, cells, started(problem, None, cells, starts, steps=STARTED))
            near = found.settled & (np.abs(found.values - starts) <= NEAR * starts)
            for i, value in zip(cells[near], found.values[near]):
                value = complex(value.real, abs(value.imag))
                if all(abs(value - other) > SAME * abs(other) for other in rows[i]):
                    rows[i].append(value)
        return [np.array(sorted(row, key=lambda value: -value.real), complex) for row in rows]

    def pairs(self, condition: Condition) -> Pairs:
        """Eigenpairs of one cell, lifted to the full unknowns."""
        return self.space.of_rational(self.space.small.pairs(condition, self.eigenvalues([condition])[0]))


def corrected_cells(
    reduction: FamilyReduction, own: RunawayCells, conditions, tolerance: float
) -> tuple[RunawayCells, float]:
    """What runs away in cells, and the relative error of its eigenvalues: under the heaviest coupling; where that is
    above a tolerance, under one of the middle once vectors corrected under the heaviest have been taken in.

    Parameters
    ----------
    reduction : FamilyReduction
    own : RunawayCells
    conditions : sequence of Condition
    tolerance : float
    """
    worst, further = 0.0, []
    for damping, found in own.alone.items():
        if not found.rates.size:
            continue
        cells = sorted((c for c in conditions if c.damping == damping), key=lambda c: c.inertia)
        change, vectors = reduction.runaway_correction(own.pairs(cells[-1]), cells[-1])
        if change > tolerance:
            further.append((cells[len(cells) // 2], vectors))
        else:
            worst = max(worst, change)
    if further:
        own = own.wider(np.hstack([vectors for _, vectors in further]))
        changes = [reduction.runaway_correction(own.pairs(cell), cell)[0] for cell, _ in further]
        worst = max(worst, *changes)
    return own, worst
