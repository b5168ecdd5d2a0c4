"""Cycles on the invariant manifold of one oscillating mode, to seventh order in their amplitude."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from continuation.harmonics import Harmonics
from continuation.linear import Bordered
from continuation.normal_form import Motion, require_frequency
from continuation.options import NotABifurcation
from continuation.periodic import PeriodicMotion

#: Highest order of the amplitude equation and its motion.
ORDER = 7
#: Rounding of the residual over its size at the unit amplitude: that of positions, as stiff directions carry it.
_ROUNDING = 8e-12
#: Change of the frequency, relative, above which terms are taken anew, and how often.
_TUNED, _ROUNDS = 5e-3, 4


@dataclass(frozen=True, repr=False)
class AmplitudeEquation:
    """Cycles on the invariant manifold of one oscillating mode of a steady state, see `amplitude_equation`."""

    omega: float  #: Frequency at which the coefficients are taken, near that of the cycle.
    coefficients: np.ndarray  #: (m,); ``g1, g3, g5, g7``.
    #: (2 m, 2 m); harmonics, the second index, of the observed quantity that come with ``r``, ``r^2``, ...; of ``r``
    #: the first one is a half.
    observed: np.ndarray
    #: Share of the amplitude of the cycle by which the residual of the equations would correct it, or the observed
    #: motion, at first sight; infinite without a cycle.
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
        """True where the cycle attracts motions of the mode: at the least amplitude a mode that grows ceases to."""
        return bool(self.coefficients[0].real > 0 and self.amplitude > 0)

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
    """Cycles that a nearly neutral mode leads to, at the same parameters, to seventh order in their amplitude. Raises
    NotABifurcation: the mode does not oscillate, or does not move the observed quantity.

    The motion is a series in the amplitude ``r`` of its first harmonic,

        x = rest + 2 Re sum r^m x_mk exp(i k Omega t),    0 = g1 + g3 r^2 + g5 r^4 + g7 r^6,

    the parametrisation of the invariant manifold tangent to the mode (Haro et al., The Parameterization Method for
    Invariant Manifolds, Springer 2016), on the circle where its motions neither grow nor decay. There all rates are
    multiples of ``i Omega``, so that the same equations hold for viscoelastic systems. ``g1 = lambda - i Omega``
    nearly, and ``g3`` is the cubic coefficient of `continuation.normal_form.HopfNormalForm` where ``lambda = i Omega``.
    Terms of each order are read off the residual of the motion to the order before. Of a stable series the sum is the
    Pade approximant [1/1] of ``g3, g5, g7``, which is the same to this order and holds farther.

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

    Examples
    --------
    >>> import jax.numpy as jnp
    >>> from continuation import JaxSystem
    >>> from continuation.first_order import FirstOrderSystem
    >>> system = JaxSystem(lambda u, mu: jnp.stack([  # z' = (r + 2 i) z - z|z|^2
    ...     mu["r"] * u[0] - 2 * u[1] - u[0] * (u @ u), 2 * u[0] + mu["r"] * u[1] - u[1] * (u @ u)]), 2)
    >>> mu, periodic = {"r": 0.01}, FirstOrderSystem(system)
    >>> from continuation.normal_form import SystemForms
    >>> forms = SystemForms(system, np.zeros(2), mu)
    >>> found = amplitude_equation(forms, lambda m: -periodic.residual(m, mu), 0.01 + 2j, [1, -1j], [1.0, 0.0], 1.0)
    >>> round(found.amplitude, 6), found.attracts
    (0.1, True)
    """
    require_frequency(eigenvalue.imag)
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
