"""Normal forms at Hopf and fold points.

Hopf: ``z' = i omega z + c1 z |z|^2`` on the centre manifold, by the homological equations (Kuznetsov, Elements of
Applied Bifurcation Theory, ch. 5.4, 3.5).  They ask for the residual of motions ``sum a_i exp(s_i t)`` about the
equilibrium alone,

    sum T(s_i) a_i exp(s_i t) + 1/2 sum d2[(s_i, a_i), (s_j, a_j)] exp((s_i + s_j) t) + ...,

so that one derivation serves ``B(u) u' = F(u)``, with ``T(s) = A - s B``, and viscoelastic systems, whose internal
variables are no part of the state: kernels that are sums of exponentials make that exact.

Normalisation: ``q* q = 1`` and ``p* T' q = 1``, or ``p* B q = 1`` for ``B u' = F``; ``l1 = Re c1 / omega``.  It
scales with ``|q|^2``; its sign, the amplitude of the motion and the orbit do not depend on it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from continuation.conditions import FoldCondition, null_pair
from continuation.harmonics import Harmonics
from continuation.linear import Bordered
from continuation.options import NotABifurcation, SingularSystem
from continuation.periodic import PeriodicMotion
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
    _require_frequency(omega)
    form = hopf_normal_form_of(SystemForms(system, u, mu), omega, q, parameter)
    return replace(form, p=-form.p)  # T' = -B


def hopf_normal_form_of(
    forms: SystemForms, omega: float, q: np.ndarray, parameter: str | None = None
) -> HopfNormalForm:
    """First Lyapunov coefficient and the second-order motion from the residual of exponential motions.

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

    Raises
    ------
    NotABifurcation
        ``i omega`` is not a simple eigenvalue, or the frequency is zero.
    """
    _require_frequency(omega)
    s = 1j * omega
    q, p = _eigenvectors(forms, s, np.asarray(q, complex))

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


def _require_frequency(omega):
    if not omega > 0:
        raise NotABifurcation(f"A Hopf point needs a positive frequency, not {omega}.")


def _eigenvectors(forms: SystemForms, s: complex, q: np.ndarray):
    """Right vector of unit state and left vector with ``p* T'(s) q = 1``."""
    pencil = forms.pencil(s)
    q = q / np.linalg.norm(q)
    p = forms.slope(Motion(s, q))
    if np.linalg.norm(p) <= 1e-12:
        p = q
    try:
        for _ in range(3):
            _, q, p, _ = null_pair(pencil, p / np.linalg.norm(p), q / np.linalg.norm(q))
    except SingularSystem as error:
        raise NotABifurcation(f"The critical eigenvalue is not simple: {error}") from error
    q = q / np.linalg.norm(forms.state(Motion(s, q)))
    slope = forms.slope(Motion(s, q))
    overlap = np.vdot(p, slope)
    if abs(overlap) <= 1e-10 * np.linalg.norm(p) * max(np.linalg.norm(slope), 1e-300):
        raise NotABifurcation("The critical eigenvalue is not simple: p* T' q vanishes.")
    return q, p / np.conj(overlap)


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


#: Highest order of the amplitude equation and its motion.
ORDER = 7
#: Rounding of the residual over its size at the unit amplitude: that of positions, as stiff directions carry it.
_ROUNDING = 8e-12
#: Change of the frequency, relative, above which terms are taken anew, and how often.
_TUNED, _ROUNDS = 5e-3, 4


@dataclass(frozen=True, repr=False)
class AmplitudeEquation:
    """Cycles on the invariant manifold of one oscillating mode of a steady state, see `amplitude_equation`.

    Attributes
    ----------
    omega : float
        Frequency at which the coefficients are taken, near that of the cycle.
    coefficients : (m,) complex array
        ``g1, g3, g5, g7``.
    observed : (2 m, 2 m) complex array
        Harmonics, the second index, of the observed quantity that come with ``r``, ``r^2``, ...; of ``r`` the first one
        is a half.
    residual : float
        Share of the amplitude of the cycle by which the residual of the equations would correct it, or the observed
        motion, at first sight; infinite without a cycle.
    """

    omega: float
    coefficients: np.ndarray
    observed: np.ndarray
    residual: float = np.inf

    def __repr__(self) -> str:
        return f"<AmplitudeEquation: amplitude {self.amplitude:.6g}, residual {self.residual:.1g}>"

    @property
    def amplitude(self) -> float:
        """``r`` of the cycle, the least; nan without one."""
        a, *more = self.coefficients.real
        square = _least_root(a, *_summed(more, -a / more[0] if more[0] else 0.0))
        return np.nan if square is None else float(np.sqrt(square))

    @property
    def frequency(self) -> float:
        """Angular frequency of the cycle."""
        first, *more = self.coefficients.imag
        square = self.amplitude**2
        top, bottom = _summed(more, square)
        return float(self.omega + first + square * np.polyval(top[::-1], square) / np.polyval(bottom[::-1], square))

    @property
    def attracts(self) -> bool:
        """True where the cycle attracts motions of the mode."""
        more, square = self.coefficients.real[1:], self.amplitude**2
        return bool(sum((m + 1) * g * square**m for m, g in enumerate(more)) < 0)

    def extremes(self, instants: int = 1000) -> tuple[float, float]:
        """Least and largest value of the observed quantity over the cycle, from its value at rest."""
        r = self.amplitude
        parts = r ** np.arange(1, len(self.observed) + 1) @ self.observed * np.append(1, np.full(len(self.observed), 2))
        phases = 2 * np.pi * np.arange(instants) / instants
        values = (np.exp(1j * np.outer(phases, np.arange(len(parts)))) @ parts).real
        return float(values.min()), float(values.max())


def amplitude_equation(
    forms, residual: Callable[[PeriodicMotion], np.ndarray], eigenvalue: complex, q, row, unit: float
) -> AmplitudeEquation:
    """Cycles that a nearly neutral mode leads to, at the same parameters, to seventh order in their amplitude.

    The motion is a series in the amplitude ``r`` of its first harmonic,

        x = rest + 2 Re sum r^m x_mk exp(i k Omega t),    0 = g1 + g3 r^2 + g5 r^4 + g7 r^6,

    the parametrisation of the invariant manifold tangent to the mode (Haro et al., The Parameterization Method for
    Invariant Manifolds, Springer 2016), on the circle where its motions neither grow nor decay. There all rates are
    multiples of ``i Omega``, so that the same equations hold for viscoelastic systems. ``g1 = lambda - i Omega``
    nearly, and ``g3`` is the cubic coefficient of `HopfNormalForm` where ``lambda = i Omega``. Terms of each order are
    read off the residual of the motion to the order before. Of a stable series the sum is the Pade approximant [1/1] of
    ``g3, g5, g7``, which is the same to this order and holds farther.

    Parameters
    ----------
    forms : SystemForms
        ``pencil``, ``slope`` and ``rest`` of the steady state, or an object with these three.
    residual : callable
        Residual (N, n) at the samples of a motion, with the sign of the pencil.
    eigenvalue : complex
        ``lambda``, of the mode, with a positive imaginary part.
    q : (n,) complex array
        Right vector of the mode, of any size.
    row : (n,) array
        Observed quantity ``row . x``, moved by the mode.
    unit : float
        An amplitude of the observed quantity at which the system is far from linear.

    Raises
    ------
    NotABifurcation
        The mode does not oscillate, or does not move the observed quantity.

    Examples
    --------
    >>> import jax.numpy as jnp
    >>> from continuation import JaxSystem
    >>> from continuation.first_order import FirstOrderSystem
    >>> system = JaxSystem(lambda u, mu: jnp.stack([  # z' = (r + 2 i) z - z|z|^2
    ...     mu["r"] * u[0] - 2 * u[1] - u[0] * (u @ u), 2 * u[0] + mu["r"] * u[1] - u[1] * (u @ u)]), 2)
    >>> mu, periodic = {"r": 0.01}, FirstOrderSystem(system)
    >>> forms = SystemForms(system, np.zeros(2), mu)
    >>> found = amplitude_equation(forms, lambda m: -periodic.residual(m, mu), 0.01 + 2j, [1, -1j], [1.0, 0.0], 1.0)
    >>> round(found.amplitude, 6), found.attracts
    (0.1, True)
    """
    _require_frequency(eigenvalue.imag)
    q, row = np.asarray(q, complex), np.asarray(row, float)
    if abs(row @ q) <= 1e-9 * np.linalg.norm(row) * np.linalg.norm(q):
        raise NotABifurcation("The mode does not move the observed quantity.")
    border = forms.slope(Motion(eigenvalue, 0.5 * q / (row @ q)))
    omega, order = eigenvalue.imag, 3
    for _ in range(_ROUNDS):
        series = _MotionSeries(forms, residual, omega, border, row, unit)
        series.extend(order)
        found = series.equation()
        moved = found.frequency - omega
        if order == ORDER and not abs(moved) > _TUNED * omega:
            break
        order, omega = ORDER, omega if np.isnan(moved) else omega + moved
    return replace(found, residual=series.correction(found))


class _MotionSeries:
    """Terms of the motion and of the amplitude equation at one frequency."""

    def __init__(self, forms, residual, omega: float, border, row, unit: float):
        self._forms, self._residual, self._border, self._row = forms, residual, border, row
        self.omega, self._unit, self.rest = omega, unit, np.asarray(forms.rest, float)
        #: Terms of the motion (m + 1, n) by harmonics, of order m = 1, 2, ...; coefficients of the amplitude equation.
        self.terms: list[np.ndarray] = []
        self.g: list[complex] = []
        self._still: np.ndarray | float = 0.0  # what the steady state leaves
        self._still = self._left(self._wave(0.0, 1), omega)[0]
        self._first = Bordered(self._pencil(1), border, row.astype(complex))
        first = self._first.solve(np.append(np.zeros(len(border), complex), 0.5))
        self.terms.append(np.stack([0 * first[:-1], first[:-1]]))
        self.g.append(complex(first[-1]))

    def _pencil(self, k: int):
        return self._forms.pencil(1j * k * self.omega)

    def equation(self) -> AmplitudeEquation:
        """Amplitude equation so far."""
        observed = np.zeros((len(self.terms), len(self.terms) + 1), complex)
        for line, term in zip(observed, self.terms):
            line[: len(term)] = term @ self._row
        return AmplitudeEquation(self.omega, np.array(self.g), observed)

    def extend(self, order: int) -> None:
        """Add terms up to an order."""
        for m in range(len(self.terms) + 1, order + 1):
            near, far = (self._defect(share * _sampled(m) * self._unit, m) for share in (0.5, 1.0))
            change, g = self._solved((4 * near - far) / 3, range(m % 2, m + 1, 2))
            self.terms.append(change)
            if m % 2:
                self.g.append(g)

    def _defect(self, r: float, order: int) -> np.ndarray:
        """Residual (H + 1, n) of the motion without terms of an order, over ``r**order``."""
        left = self._left(self._wave(r, order), self.omega)
        left[1] += self._border * sum(g * r ** (2 * m + 1) for m, g in enumerate(self.g))
        return left / r**order

    def _solved(self, left: np.ndarray, numbers) -> tuple[np.ndarray, complex]:
        """Change (H + 1, n) of some harmonics of the motion for what is left of the equations, and what it leaves of
        the amplitude equation.
        """
        change, g = np.zeros_like(left), 0j
        for k in numbers:
            if k == 1:
                solution = self._first.solve(np.append(-left[1], 0.0))
                change[1], g = solution[:-1], complex(solution[-1])
            else:
                change[k] = self._pencil(k).solve(-left[k] if k else -left[k].real)
        return change, g

    def _wave(self, r: float, count: int) -> np.ndarray:
        """Harmonics (count + 1, n) of the motion at an amplitude."""
        wave = np.zeros((count + 1, len(self.rest)), complex)
        wave[0] = self.rest
        for m, term in enumerate(self.terms, 1):
            wave[: m + 1] += r**m * term
        return wave

    def _left(self, wave: np.ndarray, omega: float) -> np.ndarray:
        """Harmonics (H + 1, n) of the residual of a motion, without what the steady state leaves: so many samples that
        what folds back is four orders above.
        """
        h = Harmonics(len(wave) - 1, 2 * len(wave) + 3)
        left = h.complex(h.project(self._residual(PeriodicMotion(h, h.real(wave), omega))))
        left[0] -= self._still
        return left

    def correction(self, equation: AmplitudeEquation) -> float:
        """Correction that the residual of the cycle asks for: of the even harmonics first, then of the odd ones with
        them mended; the amplitude by the slope of the cubic equation.
        """
        r, count = equation.amplitude, len(self.terms)
        if np.isnan(r):
            return np.inf
        wave, omega = self._wave(r, count), equation.frequency
        even, _ = self._solved(self._left(wave, omega), range(0, count + 1, 2))
        odd, g = self._solved(self._left(wave + even, omega), range(1, count + 1, 2))
        moved = np.abs((even + odd) @ self._row) @ np.append(1.0, np.full(count, 2.0))
        return float(np.hypot(0.5 * g.real / (r**3 * self.g[1].real), moved / r))


def _sampled(order: int) -> float:
    """Amplitude over the unit at which the residual is taken for the terms of an order.

    Of what comes four orders later the extrapolation from r/2 and r leaves r^4/4 where its terms are of size one at the
    unit, and of rounding (4/3) 2^order / r^order: both are the same here.
    """
    return (16 / 3 * 2.0**order * _ROUNDING) ** (1 / (order + 4))


def _summed(terms, square: float) -> tuple[list[float], list[float]]:
    """Coefficients of a rational function ``top / bottom`` of x that is ``terms[0] + terms[1] x + ...`` to its order: a
    Pade approximant where it has no pole up to twice a square and the last terms matter.
    """
    if len(terms) > 1:
        *few, c, d = [0.0] * (3 - len(terms)) + list(terms)
        if abs(d * square) > 1e-4 * abs(c) > 0 and 1 - 2 * square * d / c > 0:
            return ([few[0], c - few[0] * d / c] if len(terms) == 3 else [c]), [1.0, -d / c]
    return list(terms), [1.0]


def _least_root(a: float, top, bottom) -> float | None:
    """Least positive x with ``a + x top(x) / bottom(x) = 0`` before a pole."""
    poles = [x.real for x in np.roots(bottom[::-1]) if not x.imag and x.real > 0]
    whole = np.polyadd(a * np.array(bottom[::-1]), np.append(top[::-1], 0.0))
    roots = [
        x.real for x in np.roots(whole) if abs(x.imag) <= 1e-9 * abs(x) and 0 < x.real < min(poles, default=np.inf)
    ]
    return min(roots, default=None)
