"""Response of small motions to the pressure at the inlet: T(i omega) x = f on a reduced operator that is checked on the
full one, mean squares under a pressure spectrum, correlation times.

The space holds the full response at some frequencies; the next of them is where the residual of the reduced one is
largest, until the full response there confirms what the reduced one gave. Loss factors are exact in frequency, as the
operator is.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np

from eigen import SingularShiftError, Workspace
from eigen.basis import orthonormal
from eigen.family import DenseOperator
from eigen.operator import real_apply
from eigen.pairs import all_eigenvalues

from ...case.parameters import PIPES, Mu
from ...errors import CaseError, SolveError
from ...flow import FlowMotion
from ...model import ValveModel
from ...model.dynamics import LinearisedState
from ...model.state import LipCentre

#: Quantities that answer, with their units over Pa: of the whole valve, the displacement of one lip.
OUTPUTS = {"lip_displacement": "m", "outlet_area": "m^2", "flow": "m^3/s", "flange_pressure": "Pa"}
#: Relative error of the reduced response at which its space is accepted, and full solutions at most.
ACCURACY, MOST = 1e-5, 40
#: Directions of the space weaker than these are left out.
WEAK = 1e-10
#: Half widths of a peak between which its square is integrated, and nodes on each piece.
WIDTHS, NODES = (-100.0, -30.0, -10.0, -3.0, -1.0, 0.0, 1.0, 3.0, 10.0, 30.0, 100.0), 12


@dataclass(frozen=True)
class Spread:
    """Random motion under a pressure spectrum.

    Attributes
    ----------
    rms : (k,) array
        Of the outputs.
    correlation_time : (k,) array, s
        Twice the integral of the square of the correlation coefficient over all lags: of one mode, one over its decay
        rate.
    """

    rms: np.ndarray
    correlation_time: np.ndarray


def require_inertia(model: ValveModel) -> None:
    """Refuse a valve whose fluid has no inertia.

    Raises
    ------
    CaseError
    """
    if not (model.flow.has_fluid and model.flow.unsteady):
        raise CaseError(
            "The response to the pressure at the inlet needs a fluid with inertia (fluid.unsteady = true).",
            key="fluid.unsteady",
        )


class Transfer:
    """Response of a steady state per pressure at its inlet, over frequency.

    Parameters
    ----------
    linear : LinearisedState
    mu : Mu
    frequencies : (k,) array, Hz
        Frequencies that it is made for, ascending and not negative.

    Attributes
    ----------
    error : float
        Largest relative difference from the full operator at frequencies that the space was not made for.
    checked : tuple of float, Hz
        Frequencies at which both were compared.

    Raises
    ------
    CaseError
        For a flow without inertia.
    SolveError
        If the reduced operator does not become accurate.
    """

    def __init__(self, linear: LinearisedState, mu: Mu, frequencies: np.ndarray):
        flow = linear.model.flow
        require_inertia(linear.model)
        if linear.seal is not None:
            raise SolveError("the faces of the bill touch and nothing flows, so there is no response of a flow.")
        self.linear, self.mu = linear, mu
        self.frequencies = np.asarray(frequencies, float)
        self.pencil, self._workspace = linear.pencil(mu), Workspace()
        self._drive(flow, mu)
        self._reduce()

    def _drive(self, flow, mu: Mu) -> None:
        """Derivatives of pressures and balances by the inlet pressure, and rows of the outputs."""
        linear, m = self.linear, self.pencil.m
        pipes = {name: mu[name] for name in PIPES if name in mu}
        given = flow.values({"inlet": linear.inlet, "density": mu.density, "storage": mu.get("storage"), **pipes})
        area, inner = jnp.asarray(linear.area), jnp.asarray(flow.steady_inner(linear.area, given))
        still = FlowMotion.still(area, inner)

        def driven(inlet):
            return flow.equations(still, given | {"inlet": inlet})

        pressure, balance = jax.jacfwd(driven)(jnp.asarray(linear.inlet, float))
        self.pressure = np.zeros(m)
        self.pressure[: len(area)], self.balance = pressure, np.asarray(balance)

        def leaving(area, rate, inner):
            return area[0] * flow.speeds_of(area, rate, inner, given)[0]

        copies = linear.model.mesh.part.copies
        rows = jax.jacrev(leaving, argnums=(0, 1, 2))(area, jnp.zeros_like(area), inner)
        self._by_area, self._by_rate = (copies * np.pad(np.asarray(row), (0, m - len(area))) for row in rows[:2])
        self._by_inner, self._copies, self._flange = copies * np.asarray(rows[2]), copies, len(area) - 1
        lip = LipCentre(linear.model.mesh, linear.model.shell)
        self._lip = np.array([lip.displacement(row) for row in np.eye(self.pencil.n)])
        self.force = self.pencil.G @ self.pressure

    def _outputs(self, s: complex, lip, motion, inner) -> np.ndarray:
        """Outputs (4, ...) from the displacement of the lip, areas (m, ...) and inner unknowns (b, ...)."""
        A, B, _, _ = self.pencil.fluid_at(s)
        flow = (self._by_area + s * self._by_rate) @ motion + self._by_inner @ inner
        pressure = A[self._flange] @ motion + B[self._flange] @ inner + self.pressure[self._flange]
        return np.array([lip, self._copies * motion[0], flow, pressure])

    def full(self, frequency: float) -> tuple[np.ndarray, np.ndarray]:
        """Outputs (4,) of the full operator, and its displacements (n,)."""
        s = 2j * np.pi * frequency if frequency else 0.0
        q, u = self._workspace.shifted(self.pencil, s).solve(self.force + 0.0 * s, -self.balance + 0.0 * s)
        return self._outputs(s, self._lip @ q, real_apply(self.pencil.J, q), u), q

    def _reduce(self) -> None:
        asked = self.frequencies
        picks = [float(f) for f in asked[np.linspace(0, len(asked) - 1, 6).astype(int)]]
        vectors, checked, errors = [], [], []
        for frequency in dict.fromkeys(picks):
            vectors.append(self._full_or_beside(frequency)[1])
        for number in range(MOST):
            self._project(np.column_stack([part for q in vectors for part in (q.real, q.imag)]))
            at = float(asked[int(np.argmax(self._residuals()))])
            at *= 1.0 + 1e-3 * (number % 2)  # a frequency of the grid is met and missed in turn
            outputs, q = self._full_or_beside(at)
            error = float(np.max(np.abs(outputs - self.at([at])[0]) / np.abs(outputs)))
            checked.append(at)
            errors.append(error)
            if error <= ACCURACY and len(errors) > 1 and errors[-2] <= ACCURACY:
                self.checked, self.error = tuple(checked[-2:]), max(errors[-2:])
                return
            vectors.append(q)
        raise SolveError(
            f"The response was not found on a reduced operator: after {MOST} full solutions it is {errors[-1]:.2g} off."
        )

    def _full_or_beside(self, frequency: float) -> tuple[np.ndarray, np.ndarray]:
        try:
            return self.full(frequency)
        except SingularShiftError as error:
            raise SolveError(f"The state has an undamped mode at {frequency:.6g} Hz: {error}") from error

    def _project(self, vectors: np.ndarray) -> None:
        pencil = self.pencil
        self._V = orthonormal(pencil.M, vectors, WEAK)[0]
        self._images = [matrix @ self._V for matrix in (pencil.M, pencil.C, pencil.K, *pencil.relaxing)]
        self.reduced = pencil.projected(self._V)
        self._operator, self._motion = DenseOperator(self.reduced), self.reduced.J.toarray()
        self._small_force, self._small_lip = self._V.T @ self.force, self._lip @ self._V

    def _solved(self, s: complex) -> tuple[np.ndarray, np.ndarray]:
        """Coordinates (k,) and inner unknowns (b,) of the reduced response."""
        whole = self._operator(s)[0]
        scale = np.abs(whole).max(axis=1)
        x = np.linalg.solve(whole / scale[:, None], np.concatenate([self._small_force, -self.balance]) / scale)
        return x[: self.size], x[self.size :]

    def _residuals(self) -> np.ndarray:
        """Norm of what the reduced response leaves of the full force, over its own, at each frequency asked."""
        pencil, own, out = self.pencil, self.pencil.relaxation, []
        M, C, K, *relaxing = self._images
        for s in 2j * np.pi * self.frequencies:
            x, u = self._solved(s)
            A, B, _, _ = pencil.fluid_at(s)
            left = s * s * (M @ x) + s * (C @ x) + K @ x - self.force
            if own is not None:
                left = left + sum(factor * (part @ x) for factor, part in zip(own.factors(s), relaxing))
            left = left - real_apply(pencil.G, A @ (self._motion @ x) + B @ u)
            out.append(np.linalg.norm(left) / np.linalg.norm(K @ x))
        return np.array(out)

    @property
    def size(self) -> int:
        """Unknowns of the reduced operator."""
        return self._V.shape[1]

    def at(self, frequencies) -> np.ndarray:
        """Complex responses (k, 4) per pressure at frequencies, Hz."""
        found = []
        for s in 2j * np.pi * np.asarray(frequencies, float):
            x, u = self._solved(s)
            found.append(self._outputs(s, self._small_lip @ x, self._motion @ x, u))
        return np.array(found).reshape(-1, len(OUTPUTS))

    def modes(self) -> np.ndarray:
        """Oscillating eigenvalues of the reduced operator in the range of frequencies, by falling growth rate."""
        values = all_eigenvalues(self.reduced)
        low, high = 2 * np.pi * self.frequencies[[0, -1]]
        kept = values[(values.imag > max(low, 1e-6 * high)) & (values.imag < high) & (-values.real < values.imag)]
        return kept[np.argsort(-kept.real)]

    def spread(self, density: Callable[[np.ndarray], np.ndarray], breaks=()) -> Spread:
        """Random motion under a pressure of a given one-sided power density, Pa2/Hz over Hz, within the range of
        frequencies; between `breaks` the density is smooth.
        """
        low, high = self.frequencies[[0, -1]]
        places = [low, high, *np.linspace(low, high, 33), *np.geomspace(low, high, 17), *breaks]
        for value in self.modes():
            places += [(value.imag + width * value.real) / (2 * np.pi) for width in WIDTHS]
        edges = np.unique([place for place in places if low <= place <= high])
        nodes, weights = np.polynomial.legendre.leggauss(NODES)
        half = 0.5 * np.diff(edges)[:, None]
        at = (0.5 * (edges[1:] + edges[:-1])[:, None] + half * nodes).ravel()
        power = np.abs(self.at(at)) ** 2 * np.asarray(density(at))[:, None]
        weight = (half * weights).ravel()
        variance = weight @ power
        return Spread(np.sqrt(variance), weight @ power**2 / variance**2)
