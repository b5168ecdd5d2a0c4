"""Bases that are orthonormal in a mass: the reduced basis of structural modes and static corrections, Krylov blocks."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from .factor import Workspace, first_regular, negative_directions
from .operator import CoupledPencil

#: Squares of lengths that rounding leaves, relative to one; negative ones beyond its root are more than that.
ROUNDING = 4 * np.finfo(float).eps


class NotPositiveError(ArithmeticError):
    """A mass is not positive definite."""

    def __init__(self):
        super().__init__("The matrix is not positive definite.")


def _unit(mass, X: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Columns of length one in the mass, and mass times them; those of no length left out."""
    MX = mass @ X
    square = np.einsum("ij,ij->j", X, MX)
    if np.any(square < 0.0):
        raise NotPositiveError
    size = np.sqrt(square)
    return X[:, size > 0] / size[size > 0], MX[:, size > 0] / size[size > 0]


def orthonormal(
    mass, X: np.ndarray, compression: float, passes: int = 2, alike: bool = True
) -> tuple[np.ndarray, np.ndarray]:
    """Basis of the span of columns, and mass times it; directions weaker than `compression` left out.

    Each column counts alike, or as long as it is: then real and imaginary parts of a vector count for the same whatever
    its phase.
    """
    X, MX = _unit(mass, X) if alike else (X, mass @ X)
    # a second pass removes what rounding left in the first; the mass goes along, which spares a product
    for threshold in (max(compression**2, 1e-14), 1e-14)[:passes]:
        gram = X.T @ MX
        weight, turn = np.linalg.eigh(0.5 * (gram + gram.T))
        keep = weight > threshold * weight.max(initial=0.0)
        turn = turn[:, keep][:, ::-1] / np.sqrt(weight[keep][::-1])
        X, MX = X @ turn, MX @ turn
    return X, MX


def outside(V: np.ndarray, mass, X: np.ndarray, least: float) -> np.ndarray:
    """Basis of what columns of length one have outside an orthonormal space; what is shorter than `least` left out."""
    X, MX = _unit(mass, X)
    for threshold in (max(least**2, ROUNDING), 0.5):  # the second pass removes what rounding left in the first
        X = X - V @ (V.T @ MX)
        MX = mass @ X
        gram = X.T @ MX
        weight, turn = np.linalg.eigh(0.5 * (gram + gram.T))
        if weight.min(initial=0.0) < -(ROUNDING**0.5):
            raise NotPositiveError
        keep = weight > threshold
        turn = turn[:, keep][:, ::-1] / np.sqrt(weight[keep][::-1])
        X, MX = X @ turn, MX @ turn
    return X


#: Blocks after which a search for the largest pairs is given up.
MOST_BLOCKS = 60


class NotConvergedError(ArithmeticError):
    """Fewer pairs converged than were asked for."""


@dataclass(frozen=True)
class LargestPairs:
    """Eigenpairs of largest mu first.

    Attributes
    ----------
    values : (k,) array
    vectors : (n, k) array
        Orthonormal in K.
    images : (n, k) array
        A times the vectors.
    """

    values: np.ndarray
    vectors: np.ndarray
    images: np.ndarray

    def __repr__(self) -> str:
        return f"<LargestPairs: {len(self.values)} pairs of order {len(self.vectors)}>"


def largest_pairs(
    apply: Callable[[np.ndarray], np.ndarray],
    stiffness,
    solve: Callable[[np.ndarray], np.ndarray],
    start: np.ndarray,
    count: int,
    tolerance: float = 1e-6,
) -> LargestPairs:
    """Largest eigenpairs of a symmetric A relative to a positive K, A x = mu K x, in a block Krylov space of K^-1 A.

    A block of vectors is worth more steps than a single one saves, since factors and dense products take several
    vectors in a fraction of the time (Golub and Underwood 1977; Musco and Musco 2015).

    Parameters
    ----------
    apply : callable
        Products of A with blocks (n, b).
    stiffness : sparse or dense, shape (n, n)
        K.
    solve : callable
        Products of its inverse.
    start : (n, b) array
        In the range of A. As many vectors at most can share an eigenvalue.
    count : int
        Number of pairs; fewer are given where the whole range of A holds no more.
    tolerance : float
        Norm of the residual A x - mu K x in K^-1, relative to mu.

    Raises
    ------
    NotPositiveError
        If a vector of negative length in K is met.
    NotConvergedError
        After `MOST_BLOCKS` blocks.

    Examples
    --------
    >>> import numpy as np
    >>> a, k = np.diag([9.0, 4.0, 1.0]), np.diag([1.0, 2.0, 1.0])
    >>> found = largest_pairs(lambda x: a @ x, k, lambda x: np.linalg.solve(k, x), np.ones((3, 1)), 2)
    >>> np.round(found.values, 12)
    array([9., 2.])
    """
    n = len(start)
    V, images, moved = np.zeros((n, 0)), np.zeros((n, 0)), np.zeros((n, 0))
    projected, newest, values, turns = np.zeros((0, 0)), solve(start), np.zeros(0), np.zeros((0, 0))
    for _ in range(MOST_BLOCKS):
        fresh = outside(V, stiffness, newest, ROUNDING**0.5)
        if not fresh.shape[1]:
            return LargestPairs(values, V @ turns, images @ turns)
        forces = apply(fresh)
        share = V.T @ forces
        projected = np.block([[projected, share], [share.T, fresh.T @ forces]])
        newest = solve(forces)
        V, images, moved = np.hstack([V, fresh]), np.hstack([images, forces]), np.hstack([moved, newest])
        values, turns = np.linalg.eigh(0.5 * (projected + projected.T))
        values, turns = values[::-1][:count], np.ascontiguousarray(turns[:, ::-1][:, :count])
        if len(values) == count:
            missed = moved @ turns - V @ (turns * values)
            length = np.sqrt(np.maximum(np.einsum("ij,ij->j", missed, stiffness @ missed), 0.0))
            if np.all(length <= tolerance * np.abs(values)):
                return LargestPairs(values, V @ turns, images @ turns)
    raise NotConvergedError(f"Fewer than {count} eigenpairs converged in a Krylov space of {V.shape[1]} vectors.")


#: Frequency at which a stiffness that relaxes is taken for a basis, over the lowest one.
TYPICAL = 3.0
#: Vectors that a search for the very lowest mode works with.
FEW = 12
#: Length outside a basis, over the whole, of vectors that are left out of it.
COMPRESSION = 1e-7


class TransferBasis:
    r"""Structural modes and static corrections of one state.

    The space V holds the lowest modes of (K + K^T)/2 and M, and what they leave out
    statically: K^-1 G for the forces and K^-T J^T for the motions, compressed. The pencil
    projected on V (`CoupledPencil.projected`) keeps its form, with k in place of n unknowns. Modes and corrections are
    those of the stiffness at a typical frequency.

    Parameters
    ----------
    pencil : CoupledPencil
        Any pencil of the family; only M, K, G, J are used.
    modes : int
        Number of structural modes.
    workspace : Workspace, optional
        Keeps the symbolic factorisation between pencils of one pattern.

    Attributes
    ----------
    V : ndarray, shape (n, k)
        M-orthonormal.
    structural_frequencies : ndarray
        Hz, of the undamped symmetric structure in vacuo (an unstable one counts as zero), as stiff as it is there.

    Examples
    --------
    >>> import numpy as np
    >>> G = np.array([[1.0], [0.0]])
    >>> pencil = CoupledPencil(M=np.eye(2), C=0.1 * np.eye(2), K=np.diag([1.0, 4.0]),
    ...                        G=G, J=G.T, A0=[[0.5]])
    >>> basis = TransferBasis(pencil, modes=1)
    >>> pencil.projected(basis.V).n
    1
    """

    def __init__(self, pencil: CoupledPencil, *, modes: int = 24, workspace: Workspace | None = None):
        workspace = workspace or Workspace()
        typical = _at_typical_frequency(pencil, workspace)
        values, vectors = lowest_modes(typical, modes, workspace)
        self.structural_frequencies = _frequencies(pencil, values, vectors)
        self.V = np.zeros((pencil.n, 0))
        self._extend(pencil.M, vectors, ROUNDING**0.5)
        if pencil.m and self.V.shape[1] < pencil.n:
            factor = workspace.factor_stiffness(typical.replace(C=0.0 * pencil.M))
            parts = [factor.solve(pencil.G.toarray()).real, factor.solve_transposed(pencil.J.toarray().T).real]
            self._extend(pencil.M, np.hstack([p / (np.linalg.norm(p) or 1.0) for p in parts]))

    @property
    def size(self) -> int:
        """Number k of basis vectors."""
        return self.V.shape[1]

    def enlarged(self, pencil: CoupledPencil, *vectors, compression: float = COMPRESSION) -> TransferBasis:
        """Larger basis with vectors (n, j) of its pencil besides, real or complex; this one stays as it is."""
        other = copy(self)
        columns = [part for v in vectors for part in ((v.real, v.imag) if np.iscomplexobj(v) else (v,))]
        other._extend(pencil.M, np.hstack(columns), compression)
        return other

    def holds_what_grows(self, pencil: CoupledPencil) -> bool:
        """True where all motions with negative stiffness or damping of a pencil are in the space, skew parts aside."""
        inside = (np.linalg.eigvalsh(self.V.T @ ((A + A.T) @ self.V)) for A in (pencil.K, pencil.C))
        return all(negative_directions(A) <= np.sum(x < 0) for A, x in zip((pencil.K, pencil.C), inside))

    def _extend(self, mass, X, compression: float = COMPRESSION):
        """Append what vectors have outside the space, as far as it matters."""
        room = self.V.shape[0] - self.V.shape[1]
        self.V = np.hstack([self.V, outside(self.V, mass, X, compression)[:, :room]])


def lowest_frequencies(pencil: CoupledPencil, count: int, workspace: Workspace | None = None) -> np.ndarray:
    """Lowest frequencies of the undamped symmetric structure in vacuo, (K + K^T)/2 and M; what relaxes of the stiffness
    counts as stiff as it is at each.

    Parameters
    ----------
    pencil : CoupledPencil
    count : int
    workspace : Workspace, optional
        Keeps the symbolic factorisation between pencils of one pattern.

    Returns
    -------
    ndarray, shape (min(count, n),)
        Hz, ascending; an unstable one counts as zero.

    Examples
    --------
    >>> pencil = CoupledPencil(M=np.eye(2), C=np.zeros((2, 2)), K=(2 * np.pi) ** 2 * np.diag([1.0, 4.0]))
    >>> np.round(lowest_frequencies(pencil, 2), 6)
    array([1., 2.])
    """
    return _frequencies(pencil, *lowest_modes(_at_typical_frequency(pencil, workspace), count, workspace))


def _at_typical_frequency(pencil, workspace=None):
    """The elastic pencil as stiff as one that relaxes is at some frequency of its lower modes; others as they are."""
    relaxation = pencil.relaxation
    if relaxation is None:
        return pencil
    elastic = pencil.replace(relaxation=None)
    square = float(lowest_modes(elastic, 1, workspace)[0][0])
    omega = TYPICAL * np.sqrt(square) if square > 0 else float(np.exp(-np.log(relaxation.times).mean()))
    stiffer = sum(x * m for x, m in zip(relaxation.factors(1j * omega).real, relaxation.matrices))
    return elastic.replace(K=(pencil.K + stiffer).tocsr())


def _frequencies(pencil, squares, vectors, steps: int = 4):
    """Hz, from squares and modes; each with its own stiffness where that relaxes."""
    omega = np.sqrt(np.maximum(squares, 0.0))
    if pencil.relaxation is not None:
        slow, *parts = (np.einsum("ik,ik->k", vectors, m @ vectors) for m in (pencil.K, *pencil.relaxing))
        for _ in range(steps):
            stiffer = slow + (pencil.relaxation.factors(1j * omega).real * np.array(parts)).sum(axis=0)
            omega = np.sqrt(np.maximum(stiffer, 0.0))
        omega = np.sort(omega)
    return omega / (2 * np.pi)


def lowest_modes(pencil, count, workspace=None):
    """Squares of the lowest angular frequencies of the symmetric structure, ascending, and its modes; of a large one
    those nearest to zero.
    """
    symmetric = ((pencil.K + pencil.K.T) * 0.5).tocsr()
    count = min(count, pencil.n)
    if count >= pencil.n - 1 or pencil.n < 60:
        values, vectors = la.eigh(symmetric.toarray(), pencil.M.toarray())
        return values[:count], vectors[:, :count]
    return _lowest_by_inverse(symmetric, pencil.M, count, workspace or Workspace())


def _lowest_by_inverse(stiffness, mass, count, workspace):
    """Lowest modes of a large symmetric pencil by shift and invert a little below zero."""
    shift = 1e-8 * np.median(stiffness.diagonal()) / np.median(mass.diagonal())
    structure = CoupledPencil(M=mass, C=sp.csr_matrix(mass.shape), K=stiffness)
    # a little below zero; where that is an eigenvalue, a little farther
    squares = {float(np.sqrt(square)): square for square in shift * 3.7 ** np.arange(6.0)}
    place, factor = first_regular(workspace.factored, structure, squares)
    n = mass.shape[0]
    inverse = spla.LinearOperator((n, n), matvec=lambda x: factor.solve(np.ravel(x)).real)
    start = np.random.default_rng(5).standard_normal(n)
    kept = min(n, max(2 * count + 1, FEW))
    return spla.eigsh(stiffness, count, mass, sigma=-squares[place], OPinv=inverse, v0=start, tol=1e-9, ncv=kept)
