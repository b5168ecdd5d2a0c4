"""Left vectors: found with the factor at hand, scaled against the right ones."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .compact import oscillating_pairs
from .condensation import ShiftedPencil, Workspace
from .factorization import SingularShiftError
from .krylov import near_shift
from .pairs import SAME
from .pencil import CoupledPencil
from .products import coupling_of_modes
from .residual import factored_beside
from .spectrum import Spectrum


def attach_left(
    pencil, shifted: ShiftedPencil, batch, wanted, tolerance, found, limit_point: float | None = None
) -> None:
    """Left vectors from the same factor, matched by eigenvalue; strays by inverse iteration."""
    k = batch.values.size
    batch.left_q = np.zeros((pencil.n, k), complex)
    batch.left_u = np.zeros((pencil.b, k), complex)

    def enough(values, _reach):
        return _all_there(batch, values)

    if pencil.relaxation is not None:
        pairs = oscillating_pairs(shifted, transposed=True, enough=enough)
    else:
        pairs = near_shift(
            shifted, wanted, tolerance=tolerance, transposed=True, limit_point=limit_point, enough=enough
        )
    found.applications += pairs.applications
    free = np.ones(pairs.eigenvalues.size, bool)
    workspace = Workspace()
    for i, value in enumerate(batch.values):
        distance = np.where(free, np.abs(pairs.eigenvalues - value), np.inf)
        j = int(np.argmin(distance)) if distance.size else -1
        if j >= 0 and distance[j] <= SAME * abs(value):
            free[j] = False
            w, W = pairs.vectors_q[:, j], pairs.vectors_u[:, j]
        else:
            w, W = left_by_inverse_iteration(pencil, value, workspace)
        # the transposed problem gives w^T T = 0
        batch.left_q[:, i], batch.left_u[:, i] = w.conj(), W.conj()


def _all_there(batch, values) -> bool:
    """Whether each eigenvalue of the right vectors has turned up."""
    if values.size < batch.values.size:
        return False
    gaps = np.abs(values[:, None] - batch.values).min(axis=0)
    return bool((gaps <= 0.01 * SAME * np.abs(batch.values)).all())


def left_by_inverse_iteration(pencil, value, workspace):
    """Solution w of w^T T(value) = 0 by two solves with the transpose at the eigenvalue."""
    shifted = factored_beside(pencil, value if value.imag else value.real, workspace)
    if shifted is None:
        raise SingularShiftError(f"The pencil cannot be factored next to {value:.6g}.")
    rng = np.random.default_rng(11)
    w, W = rng.standard_normal(pencil.n) + 0j, rng.standard_normal(pencil.b) + 0j
    for _ in range(3):
        w, W = shifted.solve_transposed(w, W)
        size = np.linalg.norm(w) or np.linalg.norm(W)
        w, W = w / size, W / size
    return w, W


def with_left_vectors(pencil: CoupledPencil, spectrum: Spectrum) -> Spectrum:
    """Spectrum with left vectors, by inverse iteration on a small pencil."""
    workspace = Workspace()
    found = [left_by_inverse_iteration(pencil, value, workspace) for value in spectrum.eigenvalues]
    if not found:
        return replace(spectrum, left_q=spectrum.q, left_u=spectrum.u)
    w, W = (np.array(part).reshape(len(found), -1).T.conj() for part in zip(*found))
    w, W, _, _ = biorthogonalise(pencil, spectrum.eigenvalues, spectrum.q, spectrum.u, w, W)
    return replace(spectrum, left_q=w, left_u=W)


def biorthogonalise(pencil: CoupledPencil, eigenvalues, q, u, w, W, cluster: float = 1e-7):
    """Scale left vectors to w^H T' x = 1 and sort out those of multiple eigenvalues.

    Returns
    -------
    w, W : ndarray
    biorthogonality : float
        Largest off-diagonal product relative to the norms of the vectors' products.
    defective : list of int
        Modes whose w^H T' x vanishes: a defective or nearly defective eigenvalue. Their left
        vectors keep unit norm.
    """
    k = eigenvalues.size
    w, W = np.array(w, complex), np.array(W, complex)
    if not k:
        return w, W, 0.0, []
    size = np.linalg.norm(w, axis=0)
    size[size == 0] = 1.0
    w, W = w / size, W / size
    table = coupling_of_modes(pencil, eigenvalues, w, W, eigenvalues, q, u)
    magnitude = np.abs(table).max(axis=1)
    defective: list[int] = []
    done = np.zeros(k, bool)
    for i in range(k):
        if done[i]:
            continue
        near = np.abs(eigenvalues - eigenvalues[i]) <= cluster * max(abs(eigenvalues[i]), 1e-300)
        group = np.flatnonzero(near & ~done)
        done[group] = True
        block = table[np.ix_(group, group)]
        scale = magnitude[group].max() or 1.0
        if np.linalg.cond(block) > 1e8 or np.abs(block).max() < 1e-9 * scale:
            defective.extend(int(g) for g in group)
            continue
        turn = np.linalg.inv(block).conj().T
        w[:, group], W[:, group] = w[:, group] @ turn, W[:, group] @ turn
    table = coupling_of_modes(pencil, eigenvalues, w, W, eigenvalues, q, u)
    off = np.abs(table - np.diag(np.diag(table)))
    off[defective] = 0.0
    off[:, defective] = 0.0
    return w, W, float(off.max(initial=0.0)), defective
