"""Normal forms of Hopf points.

``z' = i omega z + c1 z |z|^2`` on the centre manifold, by the homological equations (Kuznetsov, Elements of
Applied Bifurcation Theory, ch. 5.4, 3.5).  They ask for the residual of motions ``sum a_i exp(s_i t)`` about the
equilibrium alone,

    sum T(s_i) a_i exp(s_i t) + 1/2 sum d2[(s_i, a_i), (s_j, a_j)] exp((s_i + s_j) t) + ...,

so that one derivation serves ``B(u) u' = F(u)``, with ``T(s) = A - s B``, and viscoelastic systems, whose internal
variables are no part of the state: kernels that are sums of exponentials make that exact.

Normalisation: ``q* q = 1`` and ``p* T' q = 1``, or ``p* B q = 1`` for ``B u' = F``; ``l1 = Re c1 / omega``.  It
scales with ``|q|^2``; its sign, the amplitude of the motion and the orbit do not depend on it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from continuation.conditions import null_vectors
from continuation.options import NotABifurcation, SingularSystem
from continuation.system import Derivatives


@dataclass(frozen=True, repr=False)
class HopfNormalForm:
    """Cubic normal form at a Hopf point.

    Attributes
    ----------
    omega : float
        Angular frequency.
    q, p : ndarray, complex, shape (n,)
        Right and left eigenvectors, ``q* q = 1``, ``p* B q = 1`` or ``p* T' q = 1``.
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

    def __repr__(self) -> str:
        crossing = "" if self.crossing is None else f", growth rate by the parameter {self.crossing.real:.6g}"
        return f"<HopfNormalForm: {self.criticality}, omega {self.omega:.6g}, l1 {self.l1:.6g}{crossing}>"

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
            The observed quantity ``functional . u``; without it the largest norm over a cycle.
        """
        if self.crossing is None:
            raise ValueError("The crossing speed is unknown: name a parameter.")
        largest = np.sqrt(2.0 * (1.0 + abs(self.q @ self.q)))  # of 2 Re(z q) over |z|
        gain = largest if functional is None else 2.0 * abs(functional @ self.q)
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


class Motion(NamedTuple):
    """Motion ``vector * exp(rate * t)``, vector of shape (n,)."""

    rate: complex
    vector: np.ndarray


class SystemForms:
    """Residual ``F(u, mu) - B(u, mu) u'`` about an equilibrium, for exponential motions.

    A viscoelastic system has a class of its own with these methods; vectors of motions have n entries.

    Parameters
    ----------
    system : System
        With ``d2`` and ``d3``.
    u : ndarray, shape (n,)
        The equilibrium.
    mu : mapping of str to float
    """

    def __init__(self, system, u, mu):
        self.rest, self._mu, self._system = np.array(u), dict(mu), system
        self._d, self._linear = Derivatives(system, u, self._mu), system.linear(u, self._mu)

    def pencil(self, s):
        """``T(s)``, with ``matvec``, ``rmatvec``, ``solve`` and ``solve_transpose``."""
        return self._linear.shifted(s) if s else self._linear

    def slope(self, motion):
        """``T'(s) a``."""
        return -self._linear.mass_matvec(motion.vector)

    def second(self, a, b):
        """Second form of two motions, complex."""
        mass = self._d.mass_d(a.rate * a.vector, b.vector) + self._d.mass_d(b.rate * b.vector, a.vector)
        return self._d.d2(a.vector, b.vector) - mass

    def third(self, a, b, c):
        """Third form of three motions, complex."""
        d = self._d
        mass = sum(d.mass_d2(x.rate * x.vector, y.vector, z.vector) for x, y, z in ((a, b, c), (b, a, c), (c, a, b)))
        return d.d3(a.vector, b.vector, c.vector) - mass

    def state(self, motion):
        """State of a motion, linear in its vector: its norm is the unit of the amplitude."""
        return motion.vector

    def parameter_slope(self, name):
        """Derivative of the residual at the equilibrium by a parameter."""
        return self._system.d_parameter(self.rest, self._mu, name)

    def mixed(self, motion, name):
        """Derivative of ``T(s) a`` by a parameter at a fixed state."""
        d = self._d
        return d.d2_parameter(name, motion.vector) - motion.rate * d.mass_parameter(name, motion.vector)


def hopf_normal_form(system, u, mu, omega: float, q, parameter: str | None = None) -> HopfNormalForm:
    """First Lyapunov coefficient and the second-order motion at a located Hopf point.

    Parameters
    ----------
    system : System
        With ``d2`` and ``d3``.
    u : ndarray, shape (n,)
    mu : mapping of str to float
    omega : float
        Angular frequency, rad per unit of time.
    q : ndarray, complex, shape (n,)
        Right eigenvector, of any size; polished here by bordered solves.
    parameter : str, optional
        Also give the speed at which the eigenvalue crosses along this parameter.

    Raises
    ------
    NotABifurcation
        ``i omega`` is not a simple eigenvalue, or the frequency is zero.

    Examples
    --------
    >>> import jax.numpy as jnp
    >>> from continuation import JaxSystem
    >>> system = JaxSystem(lambda u, mu: jnp.stack([  # z' = (r + 2 i) z - z|z|^2
    ...     mu["r"] * u[0] - 2 * u[1] - u[0] * (u @ u), 2 * u[0] + mu["r"] * u[1] - u[1] * (u @ u)]), 2)
    >>> hopf_normal_form(system, np.zeros(2), {"r": 0.0}, 2.0, [1.0, -1j], "r")
    <HopfNormalForm: super, omega 2, l1 -1, growth rate by the parameter 1>
    """
    require_frequency(omega)
    form = hopf_normal_form_of(SystemForms(system, u, mu), omega, q, parameter)
    return replace(form, p=-form.p)  # T' = -B


def hopf_normal_form_of(
    forms: SystemForms, omega: float, q: np.ndarray, parameter: str | None = None
) -> HopfNormalForm:
    """First Lyapunov coefficient and the second-order motion from the residual of exponential motions. Raises
    NotABifurcation: ``i omega`` is not a simple eigenvalue, or the frequency is zero.

    Parameters
    ----------
    forms : SystemForms
        Of a viscoelastic system, say.
    omega, q, parameter
        As in `hopf_normal_form`; ``T(i omega) q = 0`` nearly, q of shape (n,).

    Returns
    -------
    HopfNormalForm
        ``q``, ``h20`` and ``h11`` as `SystemForms.state` gives them, with ``|q| = 1``; ``p`` is the left vector of the
        pencil, ``p* T'(i omega) q = 1``.
    """
    require_frequency(omega)
    s = 1j * omega
    q, p = _eigenvectors(forms, s, np.asarray(q, complex))

    wave, back = Motion(s, q), Motion(-s, q.conj())
    double = Motion(2 * s, -forms.pencil(2 * s).solve(forms.second(wave, wave)))
    shift = Motion(0.0, -forms.pencil(0.0).solve(forms.second(wave, back).real))
    terms = (
        forms.second(wave, shift._replace(vector=shift.vector.astype(complex))),
        0.5 * forms.second(back, double),
        0.5 * forms.third(wave, wave, back),
    )
    parts = [-complex(np.vdot(p, term)) for term in terms]
    c1, size = sum(parts), sum(map(abs, parts))
    crossing = None
    if parameter is not None:
        du = -forms.pencil(0.0).solve(forms.parameter_slope(parameter))
        change = forms.mixed(wave, parameter)
        if np.any(du):
            change = change + forms.second(wave, Motion(0.0, du))
        crossing = -complex(np.vdot(p, change))
    return HopfNormalForm(
        float(omega),
        forms.state(wave),
        p,
        c1,
        c1.real / omega,
        forms.state(double),
        forms.state(shift),
        np.array(forms.rest),
        crossing,
        abs(c1.real) / size if size > 0 else 0.0,
    )


def require_frequency(omega):
    """Refuse a mode that does not oscillate."""
    if not omega > 0:
        raise NotABifurcation(f"A Hopf point needs a positive frequency, not {omega}.")


def _eigenvectors(forms: SystemForms, s: complex, q: np.ndarray):
    """Right vector of unit state and left vector with ``p* T'(s) q = 1``."""
    pencil, q = forms.pencil(s), q / np.linalg.norm(q)
    try:
        p, q = null_vectors(pencil, forms.slope(Motion(s, q)), q, passes=3)
    except SingularSystem as error:
        raise NotABifurcation(f"The critical eigenvalue is not simple: {error}") from error
    q = q / np.linalg.norm(forms.state(Motion(s, q)))
    slope = forms.slope(Motion(s, q))
    overlap = np.vdot(p, slope)
    if abs(overlap) <= 1e-10 * np.linalg.norm(p) * max(np.linalg.norm(slope), 1e-300):
        raise NotABifurcation("The critical eigenvalue is not simple: p* T' q vanishes.")
    return q, p / np.conj(overlap)
