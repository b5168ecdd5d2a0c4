"""Normal forms at Hopf and fold points, with a mass matrix that may depend on the state.

Hopf: ``z' = i omega z + c1 z |z|^2`` on the centre manifold, by the homological equations
(Kuznetsov, Elements of Applied Bifurcation Theory, ch. 5.4, 3.5), extended to
``B(u) u' = F(u)``: a term ``exp(s t) a`` of the motion has the velocity ``s a``, so the
nonlinearity ``F(u) - (B(u) - B(u0)) u'`` is multilinear in pairs ``(a, s a)``.

Normalisation: ``q* q = 1`` and ``p* B q = 1``; ``l1 = Re c1 / omega``.  ``l1`` scales with
``|q|^2``; its sign, the amplitude of the motion and the orbit do not depend on it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from continuation.conditions import FoldCondition, HopfCondition
from continuation.errors import NotABifurcation
from continuation.multilinear import Derivatives


@dataclass(frozen=True)
class HopfNormalForm:
    """Cubic normal form at a Hopf point.

    Attributes
    ----------
    omega : float
        Angular frequency.
    q, p : ndarray, complex, shape (n,)
        Right and left eigenvectors, ``q* q = 1``, ``p* B q = 1``.
    c1 : complex
        Cubic coefficient.
    l1 : float
        First Lyapunov coefficient ``Re c1 / omega``.
    h20, h11 : ndarray, shape (n,)
        Second-order terms of the motion, of ``z^2/2`` and ``|z|^2``.
    u : ndarray, shape (n,)
        The equilibrium.
    crossing : complex or None
        ``d lambda / d mu`` along the branch, for the parameter asked for.
    cancellation : float
        ``|Re c1|`` over the sum of the sizes of its terms: digits lost to cancellation.
    """

    omega: float
    q: np.ndarray
    p: np.ndarray
    c1: complex
    l1: float
    h20: np.ndarray
    h11: np.ndarray
    u: np.ndarray
    crossing: complex | None = None
    cancellation: float = 1.0

    @property
    def criticality(self) -> str:
        """``"super"``: cycles are attracting within the centre manifold; ``"sub"``: repelling.

        ``"degenerate"`` when the cubic terms cancel to rounding, or there are none.
        """
        if self.cancellation <= 1e-10:
            return "degenerate"
        return "super" if self.l1 < 0 else "sub"

    def radius(self, change: float) -> float:
        """``|z|`` of the cycle at ``mu_c + change``; nan on the side without a cycle."""
        if self.crossing is None:
            raise ValueError("The crossing speed is unknown: name a parameter.")
        if self.criticality == "degenerate":
            return float("nan")
        square = -self.crossing.real * change / self.c1.real
        return float(np.sqrt(square)) if square >= 0 else float("nan")

    def amplitude_coefficient(self, functional=None) -> float:
        """``a`` in: amplitude ~ ``a sqrt(|mu - mu_c|)``, half of peak to peak.

        Parameters
        ----------
        functional : ndarray, shape (n,), optional
            The observed quantity ``functional . u``; without it ``2 |q| = 2`` stands for the
            largest norm over a cycle of a circular motion.
        """
        if self.crossing is None:
            raise ValueError("The crossing speed is unknown: name a parameter.")
        gain = 2.0 if functional is None else 2.0 * abs(functional @ self.q)
        if self.criticality == "degenerate":
            return float("inf")
        return float(gain * np.sqrt(abs(self.crossing.real / self.c1.real)))

    def side(self) -> int:
        """+1 if the cycles exist above the critical parameter, -1 below."""
        return int(np.sign(-self.crossing.real * self.c1.real))

    def frequency(self, change: float) -> float:
        """Angular frequency of the cycle at ``mu_c + change`` to first order."""
        r2 = self.radius(change) ** 2
        return self.omega + self.crossing.imag * change + self.c1.imag * r2

    def orbit(self, radius: float, phases: np.ndarray) -> np.ndarray:
        """States of the cycle to second order at the phases (rad), shape (len, n).

        The shift of the equilibrium with the parameter is not included.
        """
        z = radius * np.exp(1j * np.asarray(phases))[:, None]
        motion = 2 * (z * self.q).real + (z**2 * self.h20).real + np.abs(z) ** 2 * self.h11.real
        return self.u + motion


def hopf_normal_form(system, u, mu, omega, q, p, parameter: str | None = None) -> HopfNormalForm:
    """First Lyapunov coefficient and the second-order motion at a located Hopf point.

    Parameters
    ----------
    system : System
        With ``d2`` and ``d3``.
    u, mu, omega
        The point.
    q, p : ndarray, complex, shape (n,)
        Right and left eigenvectors, of any size; polished here by one bordered solve.
    parameter : str, optional
        Also give the speed at which the eigenvalue crosses along this parameter.

    Raises
    ------
    NotABifurcation
        ``i omega`` is not a simple eigenvalue, or the frequency is zero.
    """
    mu = dict(mu)
    if not omega > 0:
        raise NotABifurcation(f"A Hopf point needs a positive frequency, not {omega}.")
    linear = system.linear(u, mu)
    value = HopfCondition(p, q).evaluate(system, u, mu, (), linear, [omega])
    q = value.v / np.linalg.norm(value.v)
    bq = linear.mass_matvec(q)
    overlap = np.vdot(value.w, bq)
    if abs(overlap) <= 1e-10 * np.linalg.norm(value.w) * max(np.linalg.norm(bq), 1e-300):
        raise NotABifurcation("The critical eigenvalue is not simple: p* B q vanishes.")
    p = value.w / np.conj(overlap)
    d = Derivatives(system, u, mu)
    s = 1j * omega

    def second(a, sa, b, sb):
        return d.d2(a, b) - d.mass_d(sa * a, b) - d.mass_d(sb * b, a)

    def third(a, sa, b, sb, c, sc):
        return d.d3(a, b, c) - d.mass_d2(sa * a, b, c) - d.mass_d2(sb * b, a, c) - d.mass_d2(sc * c, a, b)

    def solve(shift, rhs):
        return linear.shifted(shift).solve(rhs) if shift else linear.solve(rhs)

    c1, h20, h11, cancellation = cubic_coefficient(second, third, solve, q, p, s)
    crossing = None
    if parameter is not None:
        du = -linear.solve(system.d_parameter(u, mu, parameter))
        dmu = {parameter: 1.0}
        change = d.jacobian_along(q, du, dmu) - s * d.mass_along(q, du, dmu)
        crossing = complex(np.vdot(p, change))
    return HopfNormalForm(
        float(omega),
        q,
        p,
        c1,
        c1.real / omega,
        h20,
        h11,
        np.array(u),
        crossing,
        cancellation,
    )


def cubic_coefficient(second, third, solve, q, p, s):
    """Cubic coefficient at a Hopf point from what a system makes of motions ``a exp(sa t)``.

    Parameters
    ----------
    second, third : callable
        Forms ``second(a, sa, b, sb)`` and ``third(a, sa, b, sb, c, sc)`` of ``L(s) a + N = 0``.
    solve : callable
        ``solve(s, rhs)``, the solution with ``L(s)``; real for ``s = 0``.
    q, p : ndarray, complex, shape (n,)
        ``L(s) q = 0``, ``p* L(s) = 0``, ``p* L'(s) q = -1``.
    s : complex
        ``i omega``.

    Returns
    -------
    c1 : complex
    h20, h11 : ndarray, shape (n,)
    cancellation : float
        See `HopfNormalForm`.
    """
    conj = q.conj()
    h20 = -solve(2 * s, second(q, s, q, s))
    h11 = -solve(0.0, second(q, s, conj, -s).real)
    terms = (
        second(q, s, h11.astype(complex), 0.0),
        0.5 * second(conj, -s, h20, 2 * s),
        0.5 * third(q, s, q, s, conj, -s),
    )
    parts = [complex(np.vdot(p, term)) for term in terms]
    c1 = sum(parts)
    size = sum(map(abs, parts))
    return c1, h20, h11, abs(c1.real) / size if size > 0 else 0.0


def fold_coefficient(system, u, mu, v, w) -> float:
    """``a`` of ``x' = a x^2 + ...`` at a fold, with ``|v| = 1`` and ``w' B v = 1``.

    Zero at a cusp; infinite where ``w' B v`` vanishes (Bogdanov-Takens).
    """
    linear = system.linear(u, mu)
    value = FoldCondition(w, v).evaluate(system, u, mu, (), linear, ())
    v = value.v / np.linalg.norm(value.v)
    scale = value.w @ linear.mass_matvec(v)
    with np.errstate(divide="ignore"):
        return float(0.5 * (value.w @ system.d2(u, mu, v, v)) / scale)
