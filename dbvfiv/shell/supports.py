"""Free nodal unknowns, their numbering, and the sparsity that follows from them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp

#: Displacements and rotations of the director.
UNKNOWNS_PER_NODE = 5


@dataclass(frozen=True)
class DofMap:
    """Numbering of the free unknowns.

    Attributes
    ----------
    free : (nn, 5) bool array
        Three displacements and two rotations of each node.
    quads : (ne, 4) int array
    """

    free: np.ndarray
    quads: np.ndarray

    @cached_property
    def index(self) -> np.ndarray:
        """(nn, 5) number of each free unknown, -1 where constrained."""
        index = np.full(self.free.shape, -1, np.int32)
        index[self.free] = np.arange(np.count_nonzero(self.free), dtype=np.int32)
        return index

    @property
    def size(self) -> int:
        return int(np.count_nonzero(self.free))

    def expand(self, q: np.ndarray) -> np.ndarray:
        """Nodal array (nn, 5) from free unknowns (n,); zero where constrained."""
        full = np.zeros(self.free.shape, dtype=np.asarray(q).dtype)
        full[self.free] = q
        return full

    def restrict(self, full: np.ndarray) -> np.ndarray:
        """Free unknowns (n,) of a nodal array (nn, 5)."""
        return full[self.free]

    @cached_property
    def element_index(self) -> np.ndarray:
        """(ne, 20) numbers of the displacements and rotations of an element."""
        return self.index[self.quads].reshape(len(self.quads), -1)

    def _entries(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Rows and columns of all entries of element matrices, and which of them are kept."""
        e = self.element_index
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
    def slots(self) -> np.ndarray:
        """(ne, 400) position of each element matrix entry among the matrix values, -1 where constrained."""
        indptr, indices = self.pattern
        number = sp.csr_matrix((np.arange(1, len(indices) + 1), indices, indptr), shape=(self.size, self.size))
        rows, columns, keep = self._entries()
        slots = np.full(rows.shape, -1, np.int32)
        slots[keep] = np.asarray(number[rows[keep], columns[keep]]).ravel() - 1
        return slots.reshape(len(self.quads), -1)

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
