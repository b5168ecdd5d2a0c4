"""Leading modes at many parameters on one structural basis, checked against full solves."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from .condensation import Workspace
from .creep import apart_from_creep
from .dense import all_eigenvalues
from .options import SearchOptions
from .pencil import CoupledPencil
from .search import leading_modes
from .transfer import TransferBasis


@dataclass(frozen=True)
class Sweep:
    """Leading eigenvalues along a parameter at one structural state.

    Attributes
    ----------
    values : ndarray, shape (p,)
    eigenvalues : ndarray, shape (p, k)
        Sorted by growth rate at each value, NaN where there are fewer.
    certified : bool
        The last checks all met the tolerance.
    checks : tuple of (float, float)
        Parameter and largest relative difference |dl| / |l| of the leading modes between basis
        and full solve, in the order made; a failed check is followed by an enlarged basis.
    tolerance : float
    full_solves : int
    basis_size : int
    notes : tuple of str
    """

    values: np.ndarray
    eigenvalues: np.ndarray
    certified: bool
    checks: tuple[tuple[float, float], ...]
    tolerance: float
    full_solves: int
    basis_size: int
    notes: tuple[str, ...] = ()


def sweep(
    pencil_at: Callable[[float], CoupledPencil],
    values,
    count: int,
    options: SearchOptions | None = None,
    *,
    basis: TransferBasis | None = None,
    damping_at: Callable[[float], tuple[float, float]] | None = None,
    stiffness=None,
    tolerance: float = 1e-6,
    checks: int = 3,
    max_solves: int = 8,
    workspace: Workspace | None = None,
) -> Sweep:
    """Leading modes at many values of the fluid's density, or of the damping; what creeps is left out.

    Parameters
    ----------
    pencil_at : callable
        Full pencil at a value. M, K, G, J (and C, unless `damping_at` is given) must be the
        same objects at every value.
    values : sequence of float
    count : int
    options : SearchOptions, optional
        For the full solves; max_frequency also cuts the reduced ones.
    basis : TransferBasis, optional
    damping_at : callable, optional
        (alpha, beta) at a value, for C = alpha M + beta `stiffness` on the basis.
    stiffness : sparse, shape (n, n), optional
        The symmetric stiffness the damping is proportional to; default K.
    tolerance : float
        Accepted relative error of the eigenvalues at the check points.
    checks : int
        Check points: both ends and points between.
    max_solves : int
        Full solves at most.

    Returns
    -------
    Sweep
    """
    values = np.asarray(values, float)
    options = options or SearchOptions()
    workspace = workspace or Workspace()
    # small to begin with: what it lacks comes from the first full solve
    basis = basis or TransferBasis(pencil_at(float(values[0])), modes=8, compression=2e-4)
    band = np.inf if options.max_frequency is None else 2 * np.pi * options.max_frequency

    def reduced(value):
        pencil = pencil_at(value)
        if damping_at is None:
            return basis.reduced(pencil)
        alpha, beta = damping_at(value)
        Ks = pencil.K if stiffness is None else stiffness
        return basis.reduced(pencil, damping=alpha * basis.project(pencil.M) + beta * basis.project(Ks))

    done: list[tuple[float, float]] = []
    places = np.unique(np.linspace(0, values.size - 1, max(1, checks)).astype(int))
    # the one in the middle goes first and feeds the basis, the others judge it
    queue = sorted((int(i) for i in places), key=lambda i: abs(i - 0.5 * (values.size - 1)))
    certified = False
    while len(done) < max_solves:
        if not queue:
            certified = True
            break
        index = queue.pop(0)
        value = float(values[index])
        pencil = pencil_at(value)
        feeds = not done and bool(queue)
        full = leading_modes(pencil, count, replace(options, left=options.left or feeds), workspace=workspace)
        error = _difference(full, all_eigenvalues(reduced(value)))
        done.append((value, error))
        if feeds:
            basis.enlarge(full.q, full.left_q)
        elif error > tolerance:
            if full.left_q is None:
                full = leading_modes(pencil, count, replace(options, left=True), workspace=workspace)
            basis.enlarge(full.q, full.left_q)
            # what was enlarged has to be checked at a place it was not made for
            queue.append(_farthest(values, [v for v, _ in done]))
    table = np.full((values.size, count), np.nan, complex)
    for row, value in zip(table, values):
        pencil = reduced(float(value))
        found = all_eigenvalues(pencil)
        found = found[(found.imag <= band) & apart_from_creep(pencil, found)]
        found = found[np.lexsort((found.imag, -found.real))][:count]
        row[: found.size] = found
    notes = (
        ()
        if certified
        else (
            f"After {len(done)} full solves the basis still missed the tolerance {tolerance:.1g}; "
            f"the last error was {done[-1][1]:.2g}.",
        )
    )
    return Sweep(values, table, certified, tuple(done), tolerance, len(done), basis.size, notes)


def _difference(full, reduced) -> float:
    worst = 0.0
    for value in full.eigenvalues:
        gap = np.abs(reduced - value).min(initial=np.inf)
        worst = max(worst, float(gap / max(abs(value), 1e-300)))
    return worst


def _farthest(values, used) -> int:
    position = np.arange(values.size)
    at = np.array([int(np.argmin(np.abs(values - u))) for u in used])
    return int(np.argmax(np.abs(position[:, None] - at).min(axis=1)))
