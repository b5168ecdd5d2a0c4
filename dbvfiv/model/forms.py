"""The valve's residual for motions that grow at given rates, a wall that relaxes included: what normal forms ask for.

What a wall remembers of a motion exp(s t) is known from s, so no unknowns are needed for it: displacements q and the
flow's unknowns U have velocities s q, accelerations s^2 q and rates s U, and the stress of a layer its factor r(s).
Steady stresses, pressures and lip stops do not relax.
"""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from functools import cached_property
from itertools import product

import numpy as np

from continuation.normal_form import Motion
from continuation.system import expand
from eigen.factor import Workspace, first_regular
from eigen.operator import CoupledPencil, real_apply

from ..flow.terms.pump import with_static_lift
from .dynamics import linearise
from .residual import ValveResidual
from .valve import ValveModel

#: Relative step of central differences by the factor on loss factors.
_STEP = 1e-4


class ValveForms:
    """`continuation.normal_form.SystemForms` of a steady valve: vectors are (q, U), (n + l,), states (q, v, U).

    Parameters
    ----------
    q : (n,) array
        Displacements of the steady state; behind a pump a static lift gives it the pressure of `mu`, as in spectra.
    mu : mapping
        Parameters by their names in the equations (`Mu.for_system`), `loss_factor` among them where the wall relaxes.
    """

    def __init__(self, model: ValveModel, q: np.ndarray, mu: Mapping[str, float]):
        self.q, self.mu = np.asarray(q, float), dict(mu)
        area = model.rows.areas(model.nodal(self.q))
        inner = model.flow.steady_inner(area, self.mu)
        if model.pump is not None:
            model = copy(model)
            model.flow = with_static_lift(model.flow, area, inner, self.mu)
        self.model, self._analytic = model, ValveResidual(model)
        zero = np.zeros(model.size)
        self._motion = (self.q, zero, zero, inner, np.zeros_like(inner))
        self._coupled = linearise(model, self.q, self.mu["inlet"], self.mu, inner).pencil(self.mu)
        self._pencils: dict[complex, PencilAt] = {}
        self.rest = np.concatenate([self.q, zero, inner])

    def pencil(self, s: complex) -> PencilAt:
        """T(s); those asked for are kept."""
        if s not in self._pencils:
            self._pencils[s] = PencilAt(self._coupled, s)
        return self._pencils[s]

    def slope(self, motion: Motion) -> np.ndarray:
        """T'(s) x, complex (n + l,)."""
        n = self.model.size
        x = motion.vector
        return np.concatenate(self._coupled.apply_derivative(motion.rate, x[:n], x[n:]))

    def state(self, motion: Motion) -> np.ndarray:
        """Displacements, velocities and flow unknowns (2 n + l,)."""
        n = self.model.size
        q, inner = motion.vector[:n], motion.vector[n:]
        return np.concatenate([q, motion.rate * q, inner])

    def second(self, a: Motion, b: Motion) -> np.ndarray:
        """Second form of the residual, complex (n + l,)."""
        return self._form(a, b)

    def third(self, a: Motion, b: Motion, c: Motion) -> np.ndarray:
        """Third form of the residual, complex (n + l,)."""
        return self._form(a, b, c)

    def parameter_slope(self, name: str) -> np.ndarray:
        """Derivative (n + l,) of the residual by a parameter; what relaxes has none at rest."""
        if name == "loss_factor":
            return np.zeros(self.model.size + self.model.flow.inner)
        return self._analytic.parameter_slope(self._motion, self.mu, name)

    def mixed(self, motion: Motion, name: str) -> np.ndarray:
        """Derivative of T(s) x, complex (n + l,), by a parameter."""
        if name != "loss_factor":
            form = lambda x: self._analytic.mixed(self._motion, self.mu, self._split(x), name)  # noqa: E731
            return expand(form, self._joined(motion))
        factor, n = self.mu["loss_factor"], self.model.size
        above, below = (self._relaxed(motion.rate, factor * (1 + sign * _STEP)) for sign in (1, -1))
        slopes = (above - below) / (2 * _STEP * factor)
        force = sum(x * real_apply(k, motion.vector[:n]) for x, k in zip(slopes, self._coupled.relaxing))
        return np.concatenate([force, np.zeros(self.model.flow.inner)])

    def _relaxed(self, s: complex, factor: float) -> np.ndarray:
        """phi_g(s) (g,)."""
        return np.array([group.series.scaled(factor).modulus(s) - 1.0 for group in self.model.relaxation.groups])

    # -- forms

    def _form(self, *motions: Motion) -> np.ndarray:
        def remainder(*directions):
            return self._analytic.remainder_form(self._motion, self.mu, *map(self._split, directions))

        out = expand(remainder, *map(self._joined, motions)).astype(complex)
        n, rates = self.model.size, [motion.rate for motion in motions]
        # beta damps with the tangent of the unrelaxed wall, so its force is the rate of the elastic one
        damped = self.mu["beta"] * sum(rates)
        vectors = [motion.vector[:n] for motion in motions]
        weight, shell = self.model.weight, self.model.shell
        if self._coupled.relaxation is None:
            own = shell.second if len(vectors) == 2 else shell.third
            out[:n] += (1.0 + damped) * expand(lambda *x: own(self.q, *x), *vectors)
        else:
            out[:n] += shell.relaxed_form(self.q, vectors, self._factors(rates) + damped)
        if weight is not None:
            out[:n] += (1.0 + damped) * expand(lambda *x: weight.form(shell, self.q, *x), *vectors)
        return out

    def _factors(self, rates) -> np.ndarray:
        """(2**k, nl): r(s) of each layer for the sum s of each set of rates, see `Shell.relaxed_form`."""
        sums = [
            sum(s for s, there in zip(reversed(rates), chosen) if there)
            for chosen in product((0, 1), repeat=len(rates))
        ]
        factors = np.ones((len(sums), len(self.model.shell.section.layers)), complex)
        relaxation = self._coupled.relaxation
        if relaxation is not None:
            for group, relaxed in zip(self.model.relaxation.groups, relaxation.factors(sums)):
                factors[:, list(group.layers)] += relaxed[:, None]
        return factors

    def _joined(self, motion: Motion) -> np.ndarray:
        """Displacements, velocities, accelerations, flow unknowns and their rates (3 n + 2 l,)."""
        n, s = self.model.size, motion.rate
        q, inner = motion.vector[:n], motion.vector[n:]
        return np.concatenate([q, s * q, s * s * q, inner, s * inner])

    def _split(self, joined: np.ndarray) -> tuple:
        n, inner = self.model.size, self.model.flow.inner
        return tuple(np.split(joined, [n, 2 * n, 3 * n, 3 * n + inner]))


class PencilAt:
    """T(s) of a coupled pencil as products and solves in (q, U)."""

    def __init__(self, pencil: CoupledPencil, s: complex):
        self.pencil, self.s = pencil, s
        self.size = pencil.n + pencil.b

    @cached_property
    def _factor(self):
        # a hair beside an eigenvalue to rounding: products use s itself, so bordered solves refine themselves
        shifts = (self.s + nudge * max(abs(self.s), 1.0) for nudge in (0.0, 1e-9, -1e-8, 1e-7, -1e-6))
        return first_regular(Workspace().shifted, self.pencil, shifts)[1]

    def matvec(self, x):
        return np.concatenate(self.pencil.apply(self.s, *self._parts(x)))

    def rmatvec(self, x):
        return np.concatenate(self.pencil.apply(self.s, *self._parts(x), transposed=True))

    def solve(self, rhs):
        return np.concatenate(self._factor.solve(*self._parts(rhs)))

    def solve_transpose(self, rhs):
        return np.concatenate(self._factor.solve_transposed(*self._parts(rhs)))

    def _parts(self, x):
        return x[: self.pencil.n], x[self.pencil.n :]
