"""Products with a sparse matrix of which a few rows are full."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from .pencil import real_apply

#: Share of entries from which on a row counts as full.
FULL = 0.3


class FullRows:
    """A real sparse matrix (m, n) whose full rows are kept as such: dense products read no indices.

    Parameters
    ----------
    matrix : sparse, shape (m, n)

    Examples
    --------
    >>> import numpy as np
    >>> import scipy.sparse as sp
    >>> split = FullRows(sp.csr_matrix([[0.0, 0.0, 0.0, 1.0], [1.0, 2.0, 3.0, 4.0]]))
    >>> split @ np.ones(4)
    array([ 1., 10.])
    >>> split.transposed(np.ones(2))
    array([1., 2., 3., 5.])
    """

    def __init__(self, matrix: sp.spmatrix):
        matrix = matrix.tocsr()
        self.shape = matrix.shape
        full = np.diff(matrix.indptr) > FULL * matrix.shape[1]
        self._full, self._rest = np.flatnonzero(full), np.flatnonzero(~full)
        self._dense = matrix[self._full].toarray()
        self._sparse = matrix[self._rest] if full.any() else matrix
        self._sparse_transposed = self._sparse.T.tocsr()

    def __matmul__(self, x: np.ndarray) -> np.ndarray:
        """Product with an array (n,) or (n, k), real or complex."""
        if not self._full.size:
            return real_apply(self._sparse, x)
        out = np.empty((self.shape[0], *x.shape[1:]), np.result_type(x, float))
        out[self._rest] = real_apply(self._sparse, x)
        out[self._full] = _real_times(self._dense, x)
        return out

    def transposed(self, x: np.ndarray) -> np.ndarray:
        """Product of the transpose with an array (m,) or (m, k)."""
        if not self._full.size:
            return real_apply(self._sparse_transposed, x)
        return real_apply(self._sparse_transposed, x[self._rest]) + _real_times(self._dense.T, x[self._full])


def _real_times(matrix, x):
    return matrix @ x.real + 1j * (matrix @ x.imag) if np.iscomplexobj(x) else matrix @ x
