"""Stiffness that relaxes: generalised Maxwell branches in the structural part of a pencil."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp


@dataclass(frozen=True, eq=False)
class Relaxation:
    r"""Parts of a stiffness that relax, each with strengths of its own over common times.

    .. math:: \sum_g \varphi_g(\lambda) K_g, \qquad
        \varphi_g(\lambda) = \sum_j g_{gj} \frac{\lambda \tau_j}{1 + \lambda \tau_j}

    comes on top of the slow stiffness K of a pencil. With :math:`z_j = q / (1 + \lambda \tau_j)` it is linear in
    lambda: :math:`\lambda \tau_j z_j = q - z_j`, force :math:`\sum_j N_j (q - z_j)`, :math:`N_j = \sum_g g_{gj} K_g`.

    Parameters
    ----------
    matrices : sequence of real sparse or dense matrices, shape (n, n)
        K_g.
    strengths : array, shape (g, j)
        Not negative, over the slow stiffness.
    times : array, shape (j,)
        Relaxation times, s, positive.

    Raises
    ------
    ValueError
        If shapes do not fit, a strength is negative or a time is not positive.

    Examples
    --------
    >>> relaxation = Relaxation([np.eye(1)], [[0.2]], [0.01])
    >>> relaxation.factors(0.0), relaxation.factors(1e9).round(6)
    (array([0.]), array([0.2]))
    """

    matrices: tuple[sp.csr_matrix, ...]
    strengths: np.ndarray
    times: np.ndarray

    def __post_init__(self):
        matrices = tuple(sp.csr_matrix(m, dtype=float) for m in self.matrices)
        strengths = np.array(self.strengths, float, ndmin=2)
        times = np.array(self.times, float, ndmin=1)
        if strengths.shape != (len(matrices), times.size):
            raise ValueError(f"Strengths have shape {strengths.shape}; {(len(matrices), times.size)} is needed.")
        if not (np.isfinite(strengths).all() and (strengths >= 0).all()):
            raise ValueError("Strengths of relaxation must be finite and not negative.")
        if not (np.isfinite(times).all() and (times > 0).all()):
            raise ValueError("Relaxation times must be finite and positive.")
        for name, value in (("matrices", matrices), ("strengths", strengths), ("times", times)):
            if isinstance(value, np.ndarray):
                value.setflags(write=False)
            object.__setattr__(self, name, value)

    @property
    def branches(self) -> int:
        """Number of relaxation times."""
        return self.times.size

    def factors(self, s) -> np.ndarray:
        """phi_g(s), shape (g, ...) for s of shape (...)."""
        x = np.multiply.outer(self.times, np.asarray(s))
        return np.tensordot(self.strengths, x / (1.0 + x), 1)

    def slopes(self, s) -> np.ndarray:
        """Derivatives of the factors by s, shape (g, ...)."""
        return self.quotients(s, s)

    def quotients(self, a, b) -> np.ndarray:
        """(phi_g(a) - phi_g(b)) / (a - b), shape (g, ...), of a and b that broadcast; the slope where they meet."""
        a, b = np.asarray(a), np.asarray(b)
        times = self.times.reshape((-1,) + (1,) * np.broadcast(a, b).ndim)
        return np.tensordot(self.strengths, times / ((1.0 + a * times) * (1.0 + b * times)), 1)

    def beside(self, line: float) -> tuple[np.ndarray, Relaxation]:
        """phi_g(line) and the relaxation in z = s - line: phi_g(s) = phi_g(line) + what relaxes with z.

        Raises
        ------
        ValueError
            If the line does not lie right of all poles -1/tau_j.
        """
        below = 1.0 + line * self.times
        if not (below > 0).all():
            raise ValueError(
                f"A growth rate of {line:.6g} 1/s lies left of the creep at {-1 / self.times.max():.6g} 1/s."
            )
        return self.factors(line), self.replace(self.strengths / below, self.times / below)

    def replace(self, strengths, times=None) -> Relaxation:
        """The same matrices with other strengths and, where given, times."""
        return Relaxation(self.matrices, strengths, self.times if times is None else times)
