"""The valve as a System of `continuation`: B(u, mu) u' = F(u, mu) with u = (q, v, U), U the flow law's l unknowns.

    q' = v,    (M - G A2 J) v' - G B1 U' = -r(q, v, U),    R2 J v' + S1 U' = -e(q, v, U)

Rates of velocity enter linearly, so the mass matrix depends on the state only. Parameters: those of the flow law (inlet
pressure, fluid density, the blend of the continuity laws), Rayleigh alpha and beta; whatever else a case holds is a
design parameter, for which the model is built anew.

With `loss_factor` among mu the wall relaxes. What u leaves out, its memory, changes neither equilibria nor their
derivatives, and spectra hold it; motions are refused, and `memory_forms` has the forms of motions that grow at given
rates.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property

import numpy as np

from continuation import OutOfDomain, Spectrum, System
from eigen import CoupledPencil, SearchOptions, SingularShiftError, Workspace, leading_modes

from ..case.parameters import SYSTEM_NAMES
from ..errors import SolveError
from .dynamics import linearise
from .residual import DAMPING, ValveResidual
from .valve import ValveModel

_MEMORY = (
    "A wall that relaxes remembers, and a state of displacements, velocities and flow does not hold its memory, so "
    "there are equilibria, spectra and normal forms of onsets with loss factors but no orbits."
)


class ValveSystem(System):
    """A coupled valve with flow as a dynamical system.

    Parameters
    ----------
    model : ValveModel
    rebuild : callable, optional
        From the design parameters (a dict) to a model; lets names outside `parameters` be continuation parameters.
    search : SearchOptions, optional
        How leading eigenvalues are sought.

    Attributes
    ----------
    parameters : tuple of str
        Names of the flow law's parameters, then alpha and beta. Equilibria do not depend on `loss_factor`, which mu may
        hold as well.
    """

    constant_mass = False

    def __init__(
        self,
        model: ValveModel,
        rebuild: Callable[[dict], ValveModel] | None = None,
        search: SearchOptions | None = None,
    ):
        self._base = model
        self._rebuild = rebuild
        self._models: dict[tuple, ValveModel] = {(): model}
        self._residuals: dict[tuple, ValveResidual] = {}
        self._search = search or SearchOptions()
        self._length = float(np.ptp(model.mesh.nodes[:, 2]))
        self.parameters = (*model.flow.names, *DAMPING)
        self._inner = model.flow.inner
        self.size = 2 * model.size + self._inner

    # -- layout
    # ----

    def state(self, q: np.ndarray, mu) -> np.ndarray:
        """State u of a steady valve with displacements q."""
        model = self.model(mu)
        area = model.rows.areas(model.nodal(q))
        return np.concatenate([q, np.zeros(model.size), model.flow.steady_inner(area, mu)])

    def split(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Displacements (n,), velocities (n,) and the flow's unknowns (l,) of a state."""
        n = self._base.size
        return u[:n], u[n : 2 * n], u[2 * n :]

    @cached_property
    def state_weights(self) -> np.ndarray:
        """Weights of the arclength: displacements over the valve's length, per unknown; velocities follow from them at
        steady states.
        """
        n = self._base.size
        weights = np.zeros(self.size)
        weights[:n] = 1.0 / (n * self._length**2) * 1e4
        return weights

    def model(self, mu) -> ValveModel:
        """Model for the design parameters among mu."""
        return self._models_get(self._design(mu))

    def _design(self, mu) -> tuple:
        known = {*self.parameters, *SYSTEM_NAMES}
        return tuple(sorted((key, float(value)) for key, value in mu.items() if key not in known))

    def _models_get(self, key: tuple) -> ValveModel:
        if key not in self._models:
            if self._rebuild is None:
                raise ValueError(
                    f"This valve cannot be rebuilt for the parameters {', '.join(name for name, _ in key)}."
                )
            if len(self._models) > 8:
                self._models = {(): self._base}
                self._residuals = {}
            self._models[key] = self._rebuild(dict(key))
        return self._models[key]

    def _analytic(self, mu) -> ValveResidual:
        key = self._design(mu)
        if key not in self._residuals:
            self._residuals[key] = ValveResidual(self._models_get(key))
        return self._residuals[key]

    def _at(self, u, mu):
        q, v, inner = self.split(np.asarray(u, float))
        zero = np.zeros_like(q)
        return (q, v, zero, inner, np.zeros_like(inner)), mu

    def _static(self, u_direction, n):
        q, v, inner = self.split(u_direction)
        return (q, v, np.zeros(n), inner, np.zeros_like(inner))

    def _rates(self, u_rate, n):
        _, v_rate, inner_rate = self.split(u_rate)
        return (np.zeros(n), np.zeros(n), v_rate, np.zeros_like(inner_rate), inner_rate)

    def _require_no_memory(self, mu, moves: bool) -> None:
        """Refuse what a state without the memory of a relaxing wall cannot tell.

        Raises
        ------
        SolveError
        """
        if moves and mu.get("loss_factor", 0.0) and self.model(mu).relaxation.groups:
            raise SolveError(_MEMORY)

    def _still(self, u, mu, *directions):
        """Motion and parameters of a state at rest; others are not needed, since equilibria do not move."""
        motion, parameters = self._at(u, mu)
        self._require_no_memory(mu, any(np.any(self.split(x)[1]) for x in directions))
        if np.any(motion[1]):
            raise OutOfDomain("The valve moves, and derivatives are taken at rest.")
        return motion, parameters

    # -- the contract
    # ----

    def residual(self, u, mu):
        motion, parameters = self._at(u, mu)
        if not np.isfinite(u).all() or np.abs(motion[0]).max() > 2 * self._length + np.pi:
            raise OutOfDomain("The valve is displaced by more than its own length.")
        self._require_no_memory(mu, bool(np.any(motion[1])))
        return np.concatenate([motion[1], -self._analytic(mu).value(motion, parameters)])

    def residual_norm(self, residual) -> float:
        """Largest of the force imbalance over the load of 1 Pa, the flow's equations in their units (Pa) and velocity
        mismatch.
        """
        n = self._base.size
        return float(
            max(
                np.linalg.norm(residual[n : 2 * n]) / self._unit_load,
                np.abs(residual[2 * n :]).max(initial=0.0),
                np.abs(residual[:n]).max() / self._length,
            )
        )

    @cached_property
    def _unit_load(self) -> float:
        return float(np.linalg.norm(self._base.pressure_derivative(self._base.rest(), self._base.flow.back + 1.0)))

    def linear(self, u, mu) -> ValveLinearisation:
        return ValveLinearisation(self._pencil(u, mu))

    def _pencil(self, u, mu) -> CoupledPencil:
        """Pencil at a state at rest, in equilibrium or not."""
        q, _, inner = self.split(np.asarray(u, float))
        return linearise(self.model(mu), q, mu["inlet"], mu, inner).pencil(mu)

    def d_parameter(self, u, mu, name):
        if name not in self.parameters:
            return super().d_parameter(u, mu, name)
        motion, parameters = self._still(u, mu)
        return np.concatenate(
            [np.zeros(self._base.size), -self._analytic(mu).parameter_slope(motion, parameters, name)]
        )

    def d2(self, u, mu, a, b):
        motion, parameters = self._still(u, mu, a, b)
        n = self._base.size
        return np.concatenate(
            [np.zeros(n), -self._analytic(mu).second(motion, parameters, self._static(a, n), self._static(b, n))]
        )

    def d3(self, u, mu, a, b, c):
        motion, parameters = self._still(u, mu, a, b, c)
        n = self._base.size
        directions = (self._static(x, n) for x in (a, b, c))
        return np.concatenate([np.zeros(n), -self._analytic(mu).third(motion, parameters, *directions)])

    def d2_parameter(self, u, mu, name, a):
        if name not in self.parameters:
            return super().d2_parameter(u, mu, name, a)
        motion, parameters = self._still(u, mu, a)
        n = self._base.size
        return np.concatenate([np.zeros(n), -self._analytic(mu).mixed(motion, parameters, self._static(a, n), name)])

    def mass_d(self, u, mu, c, a):
        motion, parameters = self._still(u, mu, c, a)
        n = self._base.size
        return np.concatenate(
            [np.zeros(n), self._analytic(mu).second(motion, parameters, self._rates(c, n), self._static(a, n))]
        )

    def mass_d2(self, u, mu, c, a, b):
        motion, parameters = self._still(u, mu, c, a, b)
        n = self._base.size
        forms = self._analytic(mu).third(motion, parameters, self._rates(c, n), self._static(a, n), self._static(b, n))
        return np.concatenate([np.zeros(n), forms])

    def mass_parameter(self, u, mu, name, c):
        if name not in self.parameters:
            return super().mass_parameter(u, mu, name, c)
        motion, parameters = self._still(u, mu)
        n = self._base.size
        return np.concatenate([np.zeros(n), self._analytic(mu).mixed(motion, parameters, self._rates(c, n), name)])

    def spectrum(self, u, mu, count, near=None):
        pencil = self._pencil(u, mu)
        options = self._search if near is None else replace(self._search, shifts=(near,))
        found = leading_modes(pencil, count, options)
        vectors = np.concatenate([found.q, found.eigenvalues * found.q, found.u])
        return Spectrum(found.eigenvalues, vectors, np.ones(len(found), bool), found.applications)


class ValveLinearisation:
    """A = dF/du and B at a state at rest, as products and solves through the pencil.

    Where the wall relaxes, they are those of motions so slow that it does not: there are no shifts but zero.

    Parameters
    ----------
    pencil : CoupledPencil
    """

    def __init__(self, pencil: CoupledPencil):
        self.pencil = pencil
        self.size = 2 * pencil.n + pencil.b
        self._at_zero = None

    def _parts(self, x):
        n = self.pencil.n
        return x[:n], x[n : 2 * n], x[2 * n :]

    def matvec(self, x):
        q, v, u = self._parts(x)
        f, g = self.pencil.polynomial((q, u), (v, 0.0 * u))
        return np.concatenate([v, -f, -g])

    def rmatvec(self, x):
        a, *rest = self._parts(x)
        q, u = self.pencil.polynomial(rest, transposed=True)
        v, _ = self.pencil.polynomial(None, rest, transposed=True)
        return np.concatenate([-q, a - v, -u])

    def mass_matvec(self, x):
        q, v, u = self._parts(x)
        return np.concatenate([q, *self.pencil.polynomial(None, (0.0 * v, u), (v, u))])

    def mass_rmatvec(self, x):
        a, *rest = self._parts(x)
        v, _ = self.pencil.polynomial(None, None, rest, transposed=True)
        _, u = self.pencil.polynomial(None, rest, transposed=True)
        return np.concatenate([a, v, u])

    def shifted(self, shift: complex) -> _Shifted:
        return _Shifted(self, shift)

    def _zero(self):
        if self._at_zero is None:
            self._at_zero = _Shifted(self, 0.0)
        return self._at_zero

    def solve(self, rhs):
        return self._zero().solve(rhs)

    def solve_transpose(self, rhs):
        return self._zero().solve_transpose(rhs)


def factored(pencil: CoupledPencil, shift: complex):
    """LU at a shift, a hair beside it where an eigenvalue sits on it to rounding: products use the exact shift, so
    bordered solves refine themselves.
    """
    size = max(abs(shift), 1.0)
    for nudge in (0.0, 1e-9, -1e-8, 1e-7, -1e-6):
        try:
            return Workspace().shifted(pencil, shift + nudge * size)
        except SingularShiftError as error:
            refused = error
    raise refused


class _Shifted:
    """Solves with A - shift B by elimination of v: T(shift) (q, U) on the left."""

    def __init__(self, linear: ValveLinearisation, shift: complex):
        if shift and linear.pencil.branches:
            raise SolveError(_MEMORY)
        self.linear, self.shift = linear, shift
        self._factor = factored(linear.pencil, shift)

    def matvec(self, x):
        return self.linear.matvec(x) - self.shift * self.linear.mass_matvec(x)

    def rmatvec(self, x):
        return self.linear.rmatvec(x) - self.shift * self.linear.mass_rmatvec(x)

    def solve(self, rhs):
        p, s = self.linear.pencil, self.shift
        r1, r2, r3 = self.linear._parts(rhs)
        still = 0.0 * r3
        f, g = p.polynomial(None, (r1, still), (s * r1, still))
        q, u = self._factor.solve(-r2 - f, -r3 - g)
        return np.concatenate([q, r1 + s * q, u])

    def solve_transpose(self, rhs):
        p, s = self.linear.pencil, self.shift
        rq, rv, ru = self.linear._parts(rhs)
        w, c = self._factor.solve_transposed(-(rq + s * rv), -ru)
        carried, _ = p.polynomial(None, (w, c), (s * w, s * c), transposed=True)
        return np.concatenate([rv + carried, w, c])
