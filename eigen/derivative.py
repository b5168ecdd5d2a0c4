"""Derivative of an eigenvalue with respect to a parameter, from left and right vectors."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .operator import FLUID_PARTS, CoupledPencil, FluidParts, real_apply
from .spectrum import Mode


@dataclass(frozen=True, eq=False)
class PencilDerivative(FluidParts):
    """Derivatives of the parts of a pencil; a missing part does not depend on the parameter.

    M, C, K, G, J may be matrices or callables that apply the derivative to a complex vector;
    the parts of the fluid are arrays. Of what relaxes: `strengths` (g, j), `times` (j,) and `relaxing`, one matrix or
    callable for each K_g.
    """

    M: object | Callable | None = None
    C: object | Callable | None = None
    K: object | Callable | None = None
    G: object | Callable | None = None
    J: object | Callable | None = None
    strengths: np.ndarray | None = None
    times: np.ndarray | None = None
    relaxing: tuple | None = None

    def __repr__(self) -> str:
        parts = [name for name, part in vars(self).items() if part is not None]
        return f"<PencilDerivative: of {', '.join(parts) or 'nothing'}>"


def coupling_of_modes(pencil: CoupledPencil, left_values, left_q, left_u, right_values, right_q, right_u) -> np.ndarray:
    r"""w_i^H [T(l_i) - T(l_j)] / (l_i - l_j) x_j, the product in which modes are orthogonal.

    For a quadratic pencil this is w^H [(l_i + l_j) M' + C'] x with M', C' the coefficients of
    lambda^2 and lambda of the full pencil; on the diagonal it is w^H T'(l) x. What relaxes adds the
    divided differences of its factors.

    Returns
    -------
    ndarray, shape (k_left, k_right)
    """
    p = pencil
    y = real_apply(p.J, right_q)
    wg = real_apply(p.G.T.tocsr(), left_q).conj().T  # w^H G
    wh, Wh = left_q.conj().T, left_u.conj().T
    inertia = wh @ real_apply(p.M, right_q) - wg @ (p.A2 @ y) + Wh @ (p.R2 @ y)
    damping = wh @ real_apply(p.C, right_q) - wg @ (p.A1 @ y + p.B1 @ right_u) + Wh @ (p.R1 @ y + p.S1 @ right_u)
    first, second = np.asarray(left_values)[:, None], np.asarray(right_values)
    table = (first + second) * inertia + damping
    if p.relaxation is not None:
        for quotient, matrix in zip(p.relaxation.quotients(first, second), p.relaxing):
            table = table + quotient * (wh @ real_apply(matrix, right_q))
    return table


def eigenvalue_derivative(pencil: CoupledPencil, mode: Mode, change: PencilDerivative) -> complex:
    r"""d lambda = - w^H (dT) x / (w^H T' x) of a simple eigenvalue.

    Parameters
    ----------
    pencil : CoupledPencil
    mode : Mode
        With left vectors, of any scaling.
    change : PencilDerivative

    Returns
    -------
    complex
        Per unit of the parameter.

    Raises
    ------
    ValueError
        If the mode has no left vector, the eigenvalue is defective, or what relaxes changes in a pencil without.

    Examples
    --------
    >>> import numpy as np
    >>> from eigen import SearchOptions, leading_modes
    >>> pencil = CoupledPencil(M=np.eye(1), C=[[0.2]], K=[[4.0]])
    >>> mode = leading_modes(pencil, 1, SearchOptions(left=True)).mode(0)
    >>> derivative = eigenvalue_derivative(pencil, mode, PencilDerivative(C=np.eye(1)))
    >>> round(derivative.real, 6)
    -0.5
    """
    if mode.left_q is None:
        raise ValueError("The derivative of an eigenvalue needs its left vector: search with left=True.")
    s = np.array([mode.eigenvalue])
    below = coupling_of_modes(
        pencil, s, mode.left_q[:, None], mode.left_u[:, None], s, mode.q[:, None], mode.u[:, None]
    )[0, 0]
    if abs(below) == 0.0:
        raise ValueError("The eigenvalue is defective; it has no derivative.")
    f, g = _changed(pencil, mode, change)
    f = f + _relaxation_changed(pencil, mode, change)
    return complex(-(np.vdot(mode.left_q, f) + np.vdot(mode.left_u, g)) / below)


def _changed(pencil, mode, change):
    """(dT) x by rows."""
    s, q, u = mode.eigenvalue, mode.q, mode.u

    def part(name):
        value = getattr(change, name)
        return 0.0 if value is None else np.asarray(value)

    def applied(name, x, size):
        value = getattr(change, name)
        if value is None:
            return np.zeros(size, complex)
        return value(x) if callable(value) else value @ x

    def fluid(name, x, rows):
        return part(name) @ x if getattr(change, name) is not None else np.zeros(rows, complex)

    n, m, b = pencil.n, pencil.m, pencil.b
    A, B, R, S = pencil.fluid_at(s)
    y = real_apply(pencil.J, q)
    dy = applied("J", q, m)
    p = A @ y + B @ u
    dp = (
        A @ dy + sum(s**k * fluid(f"A{k}", y, m) for k in range(3)) + sum(s**k * fluid(f"B{k}", u, m) for k in range(2))
    )
    f = (
        s * s * applied("M", q, n)
        + s * applied("C", q, n)
        + applied("K", q, n)
        - applied("G", p, n)
        - real_apply(pencil.G, np.asarray(dp, complex))
    )
    g = R @ dy + sum(s**k * fluid(f"R{k}", y, b) for k in range(3)) + sum(s**k * fluid(f"S{k}", u, b) for k in range(2))
    return f, g


def _relaxation_changed(pencil, mode, change):
    """Contribution of a change of the relaxation to the first row of (dT) x."""
    if change.strengths is None and change.times is None and change.relaxing is None:
        return 0.0
    known, s, q = pencil.relaxation, mode.eigenvalue, mode.q
    if known is None:
        raise ValueError("The derivative by a relaxation needs a pencil that relaxes.")
    factor = np.zeros(len(known.matrices), complex)
    below = 1.0 + s * known.times
    if change.strengths is not None:
        factor += np.asarray(change.strengths) @ (s * known.times / below)
    if change.times is not None:
        factor += known.strengths @ (s * np.asarray(change.times) / below**2)
    f = sum(x * real_apply(matrix, q) for x, matrix in zip(factor, known.matrices))
    for x, part in zip(known.factors(s), change.relaxing or ()):
        f = f + x * (part(q) if callable(part) else part @ q)
    return f


def difference(first: CoupledPencil, second: CoupledPencil, step: float) -> PencilDerivative:
    """Derivative from two pencils a step apart, whose relaxations, if any, have as many parts and times."""
    names = ("M", "C", "K", "G", "J") + FLUID_PARTS
    parts = {name: (getattr(second, name) - getattr(first, name)) / step for name in names}
    if first.relaxation is not None and second.relaxation is not None:
        a, b = first.relaxation, second.relaxation
        parts |= {"strengths": (b.strengths - a.strengths) / step, "times": (b.times - a.times) / step}
        parts["relaxing"] = tuple((y - x) / step for x, y in zip(a.matrices, b.matrices))
    return PencilDerivative(**parts)
