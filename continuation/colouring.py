"""Groups of columns of a sparse Jacobian that one directional derivative can serve."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp


def colour_columns(pattern: sp.spmatrix) -> np.ndarray:
    """Greedy distance-2 colouring: columns of one colour share no row.

    Parameters
    ----------
    pattern : sparse matrix, shape (m, n)
        Where entries may be non-zero.

    Returns
    -------
    ndarray of int, shape (n,)
        Colours 0, 1, ...; see Curtis, Powell & Reid, J. Inst. Math. Appl. 13 (1974) 117.
    """
    by_row, by_column = sp.csr_matrix(pattern), sp.csc_matrix(pattern)
    colours = np.full(pattern.shape[1], -1)
    for j in range(pattern.shape[1]):
        rows = by_column.indices[by_column.indptr[j] : by_column.indptr[j + 1]]
        taken = {colours[k] for r in rows for k in by_row.indices[by_row.indptr[r] : by_row.indptr[r + 1]]}
        colour = 0
        while colour in taken:
            colour += 1
        colours[j] = colour
    return colours


class ColouredJacobian:
    """Assembles a sparse matrix from products with the seeds of a colouring.

    Attributes
    ----------
    seeds : ndarray, shape (colours, n)
        Directions whose products with the Jacobian hold all its entries.
    """

    def __init__(self, pattern: sp.spmatrix):
        coo = sp.coo_matrix(pattern)
        coo.sum_duplicates()
        self.shape = coo.shape
        self._rows, self._columns = coo.row, coo.col
        colours = colour_columns(coo)
        self._colour_of_entry = colours[self._columns]
        self.seeds = np.zeros((colours.max(initial=0) + 1, self.shape[1]))
        self.seeds[colours, np.arange(self.shape[1])] = 1.0

    def assemble(self, products: np.ndarray) -> sp.csc_matrix:
        """The matrix whose products with the seeds are ``products``, shape (colours, m)."""
        data = np.asarray(products)[self._colour_of_entry, self._rows]
        return sp.csc_matrix((data, (self._rows, self._columns)), shape=self.shape)
