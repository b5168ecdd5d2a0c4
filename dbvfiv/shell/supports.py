"""Which of the nodal unknowns are free, and the sparsity that follows from it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp

#: Displacements and rotations of the director, which every node has; with drilling rotations one more.
UNKNOWNS_PER_NODE = 5


def free_in_columns(free: np.ndarray, columns: int) -> np.ndarray:
    """(nn, columns) free unknowns of an element with 5 or, with drilling rotations, 6 unknowns of a node, from 5 or 6.

    A drilling rotation that is not given is held wherever the director's second rotation is: along clamped edges and in
    planes of symmetric motion, whose mirror image turns the other way.
    """
    return free[:, :columns] if free.shape[1] >= columns else np.hstack([free, free[:, 4:5]])


@dataclass(frozen=True)
class DofMap:
    """Numbering of the free unknowns.

    Attributes
    ----------
    free : (nn, c) bool array
        Three displacements and two rotations of each node, c = 5; with drilling rotations c = 6.
    quads : (ne, 4) int array
    """

    free: np.ndarray
    quads: np.ndarray

    @cached_property
    def index(self) -> np.ndarray:
        """(nn, c) number of each free unknown, -1 where constrained."""
        index = np.full(self.free.shape, -1, np.int32)
        index[self.free] = np.arange(np.count_nonzero(self.free), dtype=np.int32)
        return index

    @property
    def size(self) -> int:
        return int(np.count_nonzero(self.free))

    def expand(self, q: np.ndarray) -> np.ndarray:
        """Nodal array (nn, c) from free unknowns (n,); zero where constrained."""
        full = np.zeros(self.free.shape, dtype=np.asarray(q).dtype)
        full[self.free] = q
        return full

    def restrict(self, full: np.ndarray) -> np.ndarray:
        """Free unknowns (n,) of a nodal array (nn, c); drilling rotations are zero where it has none."""
        if full.shape[1] < self.columns:
            full = np.hstack([full, np.zeros((len(full), self.columns - full.shape[1]), full.dtype)])
        return full[self.free]

    @property
    def columns(self) -> int:
        """Unknowns of a node that is free."""
        return self.free.shape[1]

    @property
    def drilled(self) -> int:
        """Drilling rotations of an element: 4 or none."""
        return 4 if self.columns > UNKNOWNS_PER_NODE else 0

    @cached_property
    def element_index(self) -> np.ndarray:
        """(ne, 20) numbers of the displacements and rotations of an element."""
        return self.index[self.quads][:, :, :UNKNOWNS_PER_NODE].reshape(len(self.quads), -1)

    def _entries(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Rows and columns of all entries of element matrices, and which of them are kept."""
        e = self.index[self.quads].reshape(len(self.quads), -1)
        rows, columns = np.repeat(e, e.shape[1], axis=1).ravel(), np.tile(e, (1, e.shape[1])).ravel()
        return rows, columns, (rows >= 0) & (columns >= 0)

    @cached_property
    def pattern(self) -> tuple[np.ndarray, np.ndarray]:
        """Row pointers and column indices (int32) of the assembled matrices."""
        rows, columns, keep = self._entries()
        matrix = sp.csr_matrix((np.ones(keep.sum()), (rows[keep], columns[keep])), shape=(self.size, self.size))
        matrix.sort_indices()
        return matrix.indptr.astype(np.int32), matrix.indices.astype(np.int32)

    @cached_property
    def whole_slots(self) -> np.ndarray:
        """(ne, 4, c, 4, c) position of each element matrix entry among the matrix values, -1 where constrained."""
        indptr, indices = self.pattern
        number = sp.csr_matrix((np.arange(1, len(indices) + 1), indices, indptr), shape=(self.size, self.size))
        rows, columns, keep = self._entries()
        slots = np.full(rows.shape, -1, np.int64)
        slots[keep] = np.asarray(number[rows[keep], columns[keep]]).ravel() - 1
        return slots.reshape(len(self.quads), 4, self.columns, 4, self.columns).astype(np.int32)

    @cached_property
    def slots(self) -> np.ndarray:
        """(ne, 400): those of displacements and rotations."""
        own = slice(UNKNOWNS_PER_NODE)
        return np.ascontiguousarray(self.whole_slots[:, :, own, :, own]).reshape(len(self.quads), 400)

    @cached_property
    def drilling_slots(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(ne, 4, 20), (ne, 20, 4) and (ne, 4, 4): those of rows, of columns and of both that are drilling rotations;
        sides of length 0 where there are none.
        """
        count, own = len(self.quads), slice(UNKNOWNS_PER_NODE)
        turn = slice(UNKNOWNS_PER_NODE, None)
        rows = self.whole_slots[:, :, turn, :, own].reshape(count, self.drilled, 20)
        columns = self.whole_slots[:, :, own, :, turn].reshape(count, 20, self.drilled)
        both = self.whole_slots[:, :, turn, :, turn].reshape(count, self.drilled, self.drilled)
        return tuple(np.ascontiguousarray(x) for x in (rows, columns, both))

    @cached_property
    def drilling_diagonal(self) -> np.ndarray:
        """(nn,) position of each drilling rotation's diagonal entry; -1 where it is held or in no element."""
        slots, both = np.full(len(self.free), -1, np.int32), self.drilling_slots[2]
        for a in range(self.drilled):
            slots[self.quads[:, a]] = both[:, a, a]
        return slots

    def matrix(self, data: np.ndarray) -> sp.csr_matrix:
        """Sparse matrix on the common pattern with the given values; shares them."""
        indptr, indices = self.pattern
        return sp.csr_matrix((data, indices, indptr), shape=(self.size, self.size), copy=False)

    @cached_property
    def diagonal_slots(self) -> np.ndarray:
        """(n,) positions of the diagonal among the matrix values."""
        indptr, indices = self.pattern
        rows = np.repeat(np.arange(self.size), np.diff(indptr))
        return np.flatnonzero(rows == indices)
