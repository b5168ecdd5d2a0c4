"""Derivative of an eigenvalue with respect to a parameter, from left and right vectors."""

from __future__ import annotations

import numpy as np

from .operator import CoupledPencil, real_apply
from .spectrum import Mode


def coupling_of_modes(pencil: CoupledPencil, left_values, left_q, left_u, right_values, right_q, right_u) -> np.ndarray:
    r"""w_i^H [T(l_i) - T(l_j)] / (l_i - l_j) x_j, the product in which modes are orthogonal.

    For a quadratic pencil this is w^H [(l_i + l_j) M' + C'] x with M', C' the coefficients of
    lambda^2 and lambda of the full pencil; on the diagonal it is w^H T'(l) x. What relaxes adds the
    divided differences of its factors.

    Returns
    -------
    ndarray, shape (k_left, k_right)
    """
    x = right_q, right_u
    wh, Wh = left_q.conj().T, left_u.conj().T
    inertia, damping = (wh @ f + Wh @ g for f, g in (pencil.polynomial(None, None, x), pencil.polynomial(None, x)))
    first, second = np.asarray(left_values)[:, None], np.asarray(right_values)
    table = (first + second) * inertia + damping
    if pencil.relaxation is not None:
        for quotient, matrix in zip(pencil.relaxation.quotients(first, second), pencil.relaxing):
            table = table + quotient * (wh @ real_apply(matrix, right_q))
    return table


def eigenvalue_derivative(pencil: CoupledPencil, mode: Mode, change: tuple[np.ndarray, np.ndarray]) -> complex:
    r"""d lambda = - w^H (dT) x / (w^H T' x) of a simple eigenvalue.

    Parameters
    ----------
    pencil : CoupledPencil
    mode : Mode
        With left vectors, of any scaling.
    change : arrays (n,) and (b,)
        (dT) x, the derivative of T(lambda) x by the parameter at the eigenvalue and vector of the mode, as the
        difference of `CoupledPencil.apply` of two pencils has it.

    Returns
    -------
    complex
        Per unit of the parameter.

    Raises
    ------
    ValueError
        If the mode has no left vector or the eigenvalue is defective.

    Examples
    --------
    >>> from eigen import SearchOptions, leading_modes
    >>> pencil = CoupledPencil(M=np.eye(1), C=[[0.2]], K=[[4.0]])
    >>> mode = leading_modes(pencil, 1, SearchOptions(left=True)).mode(0)
    >>> derivative = eigenvalue_derivative(pencil, mode, (mode.eigenvalue * mode.q, mode.u))  # by the damping
    >>> round(derivative.real, 6)
    -0.5
    """
    if mode.left_q is None:
        raise ValueError("The derivative of an eigenvalue needs its left vector: search with left=True.")

    def along(f, g):
        return np.vdot(mode.left_q, f) + np.vdot(mode.left_u, g)

    below = along(*pencil.apply_derivative(mode.eigenvalue, mode.q, mode.u))
    if abs(below) == 0.0:
        raise ValueError("The eigenvalue is defective; it has no derivative.")
    return complex(-along(*change) / below)
