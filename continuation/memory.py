"""Hopf normal form of a system with memory, from what it makes of motions that grow at given rates.

What a system with fading memory remembers is no part of its state.  For a motion ``sum a_i exp(s_i t)`` about an
equilibrium its residual is known all the same,

    sum T(s_i) a_i exp(s_i t) + 1/2 sum d2[(s_i, a_i), (s_j, a_j)] exp((s_i + s_j) t) + ...,

and that is all that the homological equations of `normal_form` ask for.  Kernels that are sums of exponentials make
it exact: the same coefficient as that of the system with the memory among its unknowns.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

from continuation.conditions import null_pair
from continuation.errors import NotABifurcation
from continuation.normal_form import HopfNormalForm, cubic_coefficient


class Motion(NamedTuple):
    """The motion ``vector * exp(rate * t)``, vector of shape (n,)."""

    rate: complex
    vector: np.ndarray


class MemoryForms(Protocol):
    """Residual of a system with memory about an equilibrium, for motions that grow at given rates.

    Attributes
    ----------
    rest : ndarray, shape (k,)
        The equilibrium, as `state` gives it.
    """

    rest: np.ndarray

    def pencil(self, s: complex):
        """``T(s)``, with ``matvec``, ``rmatvec``, ``solve`` and ``solve_transpose``."""

    def slope(self, motion: Motion) -> np.ndarray:
        """``T'(s) a``, shape (n,)."""

    def second(self, a: Motion, b: Motion) -> np.ndarray:
        """Second form, shape (n,), complex."""

    def third(self, a: Motion, b: Motion, c: Motion) -> np.ndarray:
        """Third form, shape (n,), complex."""

    def state(self, motion: Motion) -> np.ndarray:
        """What is seen of a motion, shape (k,), linear in its vector: its norm is the unit of the amplitude."""

    def parameter_slope(self, name: str) -> np.ndarray:
        """Derivative of the residual at the equilibrium, shape (n,), by a parameter."""

    def mixed(self, motion: Motion, name: str) -> np.ndarray:
        """Derivative of ``T(s) a``, shape (n,), by a parameter at a fixed state."""


def hopf_normal_form_with_memory(
    forms: MemoryForms, omega: float, q: np.ndarray, parameter: str | None = None
) -> HopfNormalForm:
    """First Lyapunov coefficient and the second-order motion at a located Hopf point of a system with memory.

    Parameters
    ----------
    forms : MemoryForms
    omega : float
        Angular frequency.
    q : ndarray, complex, shape (n,)
        ``T(i omega) q = 0`` nearly, of any size; polished here by bordered solves.
    parameter : str, optional
        Also give the speed at which the eigenvalue crosses along this parameter.

    Returns
    -------
    HopfNormalForm
        ``q``, ``h20`` and ``h11`` as `MemoryForms.state` gives them, with ``|q| = 1``; ``p`` is the left vector of the
        pencil, ``p* T'(i omega) q = 1``.  Without memory the same as that of `hopf_normal_form`.

    Raises
    ------
    NotABifurcation
        ``i omega`` is not a simple eigenvalue, or the frequency is zero.
    """
    if not omega > 0:
        raise NotABifurcation(f"A Hopf point needs a positive frequency, not {omega}.")
    s = 1j * omega
    q, p, slope = _polished(forms, s, np.asarray(q, complex))
    overlap = np.vdot(p, slope)
    if abs(overlap) <= 1e-10 * np.linalg.norm(p) * max(np.linalg.norm(slope), 1e-300):
        raise NotABifurcation("The critical eigenvalue is not simple: p* T' q vanishes.")
    p = p / np.conj(overlap)

    def second(a, sa, b, sb):
        return -forms.second(Motion(sa, a), Motion(sb, b))

    def third(a, sa, b, sb, c, sc):
        return -forms.third(Motion(sa, a), Motion(sb, b), Motion(sc, c))

    def solve(shift, rhs):
        return -forms.pencil(shift).solve(rhs)

    c1, h20, h11, cancellation = cubic_coefficient(second, third, solve, q, p, s)
    crossing = None
    if parameter is not None:
        du = -forms.pencil(0.0).solve(forms.parameter_slope(parameter))
        change = forms.mixed(Motion(s, q), parameter)
        if np.any(du):
            change = change + forms.second(Motion(s, q), Motion(0.0, du))
        crossing = -complex(np.vdot(p, change))
    return HopfNormalForm(
        float(omega),
        forms.state(Motion(s, q)),
        p,
        c1,
        c1.real / omega,
        forms.state(Motion(2 * s, h20)),
        forms.state(Motion(0.0, h11)),
        np.array(forms.rest),
        crossing,
        cancellation,
    )


def _polished(forms: MemoryForms, s: complex, q: np.ndarray):
    """Right vector of unit state, left vector, and ``T'(s) q``."""
    pencil = forms.pencil(s)
    q = q / np.linalg.norm(q)
    p = forms.slope(Motion(s, q))
    for _ in range(3):
        _, q, p, _ = null_pair(pencil, p / np.linalg.norm(p), q / np.linalg.norm(q))
    q = q / np.linalg.norm(forms.state(Motion(s, q)))
    return q, p, forms.slope(Motion(s, q))
