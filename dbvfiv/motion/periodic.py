"""The valve in periodic motion: what `continuation` asks of a system whose cycles are sought as Fourier series.

    M(q) a + h(q, v) + alpha M v + beta dF/dt + F(q) + F_h(q, h) - G(q) p = 0,     e = 0

the equations of `dbvfiv.motion.equations` without a step: rates, and what relaxing layers remember, are filters of the
samples over a period. Unknowns are (q, U) with the flow law's own U (l,); pressures p and equations e are those of its
definition. The flow is outward.

Equation (T.15) of docs/theory.md.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from continuation import OutOfDomain
from continuation.harmonics import Rates
from continuation.periodic import PeriodicMotion, PeriodicOperator, Term
from eigen import CoupledPencil, SingularShiftError, Workspace
from eigen.operator import FLUID_PARTS

from ..errors import SolveError
from ..flow import FlowMotion
from ..model import ValveModel
from ..model.relaxing import Branches
from ..shell import Shell, StepWall, WallMemory
from .periodic_wall import WallSlopes

#: Distance from the imaginary axis, over the angular frequency, of the matrices that smooth: clear of neutral modes.
CLEAR = 0.15


class PeriodicValve:
    """Equations of a valve's periodic motions, a system of `continuation.cycles.CycleSolver`.

    Parameters
    ----------
    rebuild : callable
        From parameters mu, by the names of `dbvfiv.model.forms.ValveForms`, to the model for them.

    Raises
    ------
    SolveError
        If the valve has no flow, or fluid outside.
    """

    autonomous = True

    def __init__(self, rebuild: Callable[[Mapping[str, float]], ValveModel], mu: Mapping[str, float]):
        self._model = rebuild
        model = rebuild(mu)
        check_periodic(model)
        self.inner, self.size = model.flow.inner, model.size + model.flow.inner
        area = float(model.mesh.rest_area[-1])
        self.flow_weight = area  # turns the flow's equations, Pa, into forces
        self._workspace = Workspace()
        self._known_forces: tuple[ValveModel, np.ndarray, np.ndarray] | None = None
        scale = np.ones(model.shell.dofs.free.shape)
        scale[:, 3:] = 2.0 / float(np.mean(model.shell.geometry.thickness))
        jet = np.sqrt(2.0 * abs(mu["inlet"]) / mu["density"])
        #: (n + l,): m and rad that are alike at the face of the wall, and m/s that go with them.
        self.scales = np.append(scale[model.shell.dofs.free], np.full(self.inner, 10.0 * jet))
        self._wall = WallSlopes(self.size, self.scales[: model.size])

    def model(self, mu: Mapping[str, float]) -> ValveModel:
        """The model for parameters."""
        return self._model(mu)

    # -- parts
    # ----

    def _split(self, samples: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        n = self.size - self.inner
        return samples[:, :n], samples[:, n:]

    def passages(self, motion: PeriodicMotion, mu: Mapping[str, float]) -> list[FlowMotion]:
        """Areas and the flow's unknowns with their rates at each sample."""
        model, rates = self.model(mu), motion.rates
        q, u = self._split(motion.samples)
        area = np.stack([model.rows.areas(model.nodal(x)) for x in q])
        return [FlowMotion(*x) for x in zip(area, rates.apply(1, area), rates.apply(2, area), u, rates.apply(1, u))]

    def pressures(self, motion: PeriodicMotion, mu: Mapping[str, float]) -> tuple[np.ndarray, np.ndarray]:
        """Pressures (N, m), Pa, and the flow's equations (N, l)."""
        flow = self.model(mu).flow
        p, rest = zip(*(flow.evaluate(passage, mu) for passage in self.passages(motion, mu)))
        return np.array(p), np.array(rest)

    def _memory(self, mu: Mapping[str, float]) -> PeriodicMemory | None:
        model = self.model(mu)
        branches = model.relaxation.branches(mu.get("loss_factor", 0.0))
        return PeriodicMemory(model.shell, branches) if branches else None

    # -- the contract
    # ----

    def residual(self, motion: PeriodicMotion, mu: Mapping[str, float]) -> np.ndarray:
        """Residual (N, n + l): forces, N and N m, and the flow's equations by the area of the inlet."""
        model, rates = self.model(mu), motion.rates
        q, _ = self._split(motion.samples)
        v, a = rates.apply(1, q), rates.apply(2, q)
        p, rest = self.pressures(motion, mu)
        memory = self._memory(mu)
        held = None if memory is None else memory.held(q, rates)
        slow = self._internal_forces(model, q)
        out = slow + mu["beta"] * rates.apply(1, slow)
        if model.contact is not None:
            out += np.stack([model.contact.force(x) for x in q])
        for i in range(len(q)):
            nodal = model.nodal(q[i])
            if held is not None:
                out[i] += memory.force(q[i], held[i])
            out[i] += model.shell.inertia(q[i], v[i], a[i] + mu["alpha"] * v[i])
            out[i] -= model.pressure_force(nodal, p[i])
        return np.concatenate([out, self.flow_weight * rest], axis=1)

    def _internal_forces(self, model: ValveModel, q: np.ndarray) -> np.ndarray:
        """(N, n); those of the last positions are kept, for derivatives by frequency and parameters ask again."""
        known = self._known_forces
        if known is None or known[0] is not model or not np.array_equal(known[1], q):
            self._known_forces = known = (model, q.copy(), np.stack([model.internal_force(x) for x in q]))
        return known[2]

    def linearise(self, motion: PeriodicMotion, mu: Mapping[str, float], rough: bool = False) -> PeriodicOperator:
        """Linearisation about a motion; its `average` is the pencil of the mean of all samples. A rough one has the
        structure's tangent at half as many phases.
        """
        model, rates = self.model(mu), motion.rates
        q, _ = self._split(motion.samples)
        passages = self.passages(motion, mu)
        slopes = [model.flow.linearise(passage, mu).parts() for passage in passages]
        parts = {name: np.array([one[name] for one in slopes]) for name in FLUID_PARTS}
        p = np.array([model.flow.evaluate(passage, mu)[0] for passage in passages])
        memory = self._memory(mu)
        geometric = None
        if memory is not None:
            held = memory.held(q, rates)
            geometric = lambda i: memory.geometric(q[i], held[i])  # noqa: E731
        terms, means = self._wall.terms(model, motion, mu, p, rough, geometric)
        left = [model.station_forces(model.nodal(x)) for x in q]
        right = [model.rows.jacobian(model.nodal(x)) for x in q]
        terms.append(self._fluid_term(left, right, parts))
        coarse = None
        if memory is not None:
            groups = zip(*(model.shell.relaxing_tangents(x) for x in q))
            relaxing = [self._wall.blocks(model, np.array(group)) for group in groups]
            coarse = [*terms, *(Term([(0, b)], outer=phi) for b, phi in zip(relaxing, memory.filters))]
            terms.append(MemoryTerm(memory, q, self.size))
        operator = PeriodicOperator(motion, terms, coarse)
        operator.average = self._average(model, means, (left, right), parts, q, mu)
        return operator

    def _fluid_term(self, left, right, parts) -> Term:
        """- G p over the flow's equations, from areas and the flow's unknowns."""
        a0, a1, a2, b0, b1, r0, r1, r2, s0, s1 = (parts[name] for name in FLUID_PARTS)
        w = self.flow_weight
        zero = np.zeros_like(s0), np.zeros_like(b0)
        middle = [
            (0, np.block([[-a0, -b0], [w * r0, w * s0]])),
            (1, np.block([[-a1, -b1], [w * r1, w * s1]])),
            (2, np.block([[-a2, zero[1]], [w * r2, zero[0]]])),
        ]
        return Term(middle, *([_with_identity(matrix, self.inner) for matrix in side] for side in (left, right)))

    def _average(self, model, means, coupling, parts, q, mu) -> CoupledPencil:
        own, rest, damping, mass = means
        matrix, beta = model.shell.dofs.matrix, mu["beta"]
        g, j = (sum(some) / len(some) for some in coupling)
        relaxation = model.relaxation.stiffness(
            mu.get("loss_factor", 0.0), lambda: model.relaxing_stiffness(q.mean(axis=0))
        )
        fluid = {name: part.mean(axis=0) for name, part in parts.items()}
        return CoupledPencil(
            matrix(mass), matrix(damping + beta * own), matrix(own + rest), g, j, relaxation=relaxation, **fluid
        )

    def smoother(self, operator: PeriodicOperator, mu: Mapping[str, float]):
        """Solves with the averaged linearised state at each harmonic."""
        relaxation, beta = operator.average.relaxation, mu["beta"]

        def stiffening(s):
            relaxed = 0.0 if relaxation is None else np.mean([relaxation.factors(x) for x in s], axis=1)
            return 1.0 + relaxed + beta * s

        return AveragedSolves(operator.average, operator.motion, self.flow_weight, stiffening, self._workspace)


def check_periodic(model: ValveModel) -> None:
    """Refuse a valve whose periodic motions these equations do not cover.

    Raises
    ------
    SolveError
    """
    if not model.flow.has_fluid:
        raise SolveError("Without flow nothing feeds an oscillation, so there are no cycles to follow.")
    if model.outside is not None:
        raise SolveError(
            "With fluid outside the wall cycles are not followed: how its added mass changes with the shape within "
            "a cycle is not among the equations; runs in time show them."
        )


def _with_identity(matrix: sp.csr_matrix, count: int) -> sp.csr_matrix:
    """A matrix and the identity on its diagonal."""
    rows, columns = matrix.shape
    data = np.append(matrix.data, np.ones(count))
    indices = np.append(matrix.indices, np.arange(columns, columns + count, dtype=matrix.indices.dtype))
    indptr = np.append(matrix.indptr, matrix.indptr[-1] + np.arange(1, count + 1, dtype=matrix.indptr.dtype))
    return sp.csr_matrix((data, indices, indptr), shape=(rows + count, columns + count), copy=False)


class AveragedSolves:
    """T(c)^-1 of an averaged pencil, c real, for each harmonic, times what damping makes of c for i k omega.

    Stiff directions answer as damped springs, and slow ones belong to the basis, so one factorisation serves all
    harmonics.

    Parameters
    ----------
    pencil : CoupledPencil
    motion : PeriodicMotion
    weight : float
        Of the flow's equations in the residual.
    stiffening : callable
        Factor on the stiffness of motions exp(s t).
    workspace : Workspace
    """

    def __init__(self, pencil, motion, weight: float, stiffening, workspace: Workspace):
        self.size, self.weight, self.harmonics = pencil.n, weight, motion.harmonics
        clear = CLEAR * motion.omega
        try:
            self._factor = workspace.shifted(pencil, clear)
        except SingularShiftError as error:
            raise OutOfDomain("The mean of the motion's linearisation is singular, as where stops hit hard.") from error
        rates = 1j * motion.omega * np.arange(motion.harmonics.count + 1)
        self._shares = stiffening(np.array([clear])) / stiffening(rates)

    def __call__(self, coefficients: np.ndarray) -> np.ndarray:
        """Coefficients (2 H + 1, n + l), real or complex, of solutions."""
        if np.iscomplexobj(coefficients):
            return self(coefficients.real) + 1j * self(coefficients.imag)
        n, h = self.size, self.harmonics
        found = np.vstack(self._factor.solve(coefficients[:, :n].T, coefficients[:, n:].T / self.weight)).T
        return h.real(self._shares[:, None] * h.complex(np.real(found)))


@dataclass(frozen=True)
class BranchFilter:
    """phi(s) = sum g s tau / (1 + s tau) of the branches of a group.

    Attributes
    ----------
    strengths, times : tuples of float
        1, s.
    """

    strengths: tuple[float, ...]
    times: tuple[float, ...]

    def __call__(self, s):
        x = np.multiply.outer(np.asarray(s), self.times)
        return (x / (1.0 + x)) @ np.asarray(self.strengths)


class PeriodicMemory:
    """Branches of a shell's layers in periodic motions.

    dh/dt + h / tau = g dS/dt makes h_k = g s tau / (1 + s tau) S_k of each harmonic, s = i k omega: the branches of a
    group together are one filter of its slow resultants.

    Parameters
    ----------
    shell : Shell
    branches : Branches
    """

    def __init__(self, shell: Shell, branches: Branches):
        self.shell, self.branches = shell, branches
        self.wall = WallMemory(shell, branches.strengths, branches.times)
        self._none = shell.wall_of(np.zeros(len(shell.section.layers)))
        #: phi(s) of each group.
        self.filters = [BranchFilter(tuple(row), tuple(branches.times)) for row in branches.strengths]

    def held(self, q: np.ndarray, rates: Rates) -> np.ndarray:
        """Resultants (N, ne, 4, 8) that the branches hold at samples q (N, n)."""
        return self.filtered(np.stack([self.wall.resultants(x)[1] for x in q]), rates)

    def filtered(self, slow: np.ndarray, rates: Rates) -> np.ndarray:
        """Branch resultants (N, ne, 4, 8) from slow resultants (N, ne, 4, g, 8)."""
        return sum(rates.apply(phi, slow[:, :, :, g]) for g, phi in enumerate(self.filters))

    def slopes(self, q: np.ndarray, way: np.ndarray) -> np.ndarray:
        """Derivative (ne, 4, g, 8) of the slow resultants at positions (n,) along a way (n,)."""
        return self.wall._slopes(q, way)[1]

    def force(self, q: np.ndarray, held: np.ndarray) -> np.ndarray:
        """Force (n,) of resultants that are held at positions (n,)."""
        return self.shell.force(q, StepWall(self._none, np.ascontiguousarray(held)))

    def geometric(self, q: np.ndarray, held: np.ndarray) -> np.ndarray:
        """Values (nnz,) of its derivative by the positions."""
        return self.shell.force_and_tangent(q, step=StepWall(self._none, np.ascontiguousarray(held)))[1]


@dataclass(frozen=True, eq=False)
class MemoryTerm:
    """Change of what branches hold with the motion, a term of `continuation.periodic.PeriodicOperator`.

    Attributes
    ----------
    memory : PeriodicMemory
    q : (N, n) array
        Positions at the samples.
    size : int
        Unknowns, those of the flow behind the wall's.
    """

    memory: PeriodicMemory
    q: np.ndarray
    size: int

    def apply(self, samples: np.ndarray, rates: Rates) -> np.ndarray:
        """Samples (N, size) of forces for those of a change."""
        n = self.q.shape[1]
        held = self.memory.filtered(self._slopes(samples[:, :n]), rates)
        out = np.zeros((len(samples), self.size), held.dtype)
        out[:, :n] = self._forces(held)
        return out

    def _slopes(self, ways: np.ndarray) -> np.ndarray:
        if np.iscomplexobj(ways):
            return self._slopes(ways.real) + 1j * self._slopes(ways.imag)
        return np.stack([self.memory.slopes(q, way) for q, way in zip(self.q, ways)])

    def _forces(self, held: np.ndarray) -> np.ndarray:
        if np.iscomplexobj(held):
            return self._forces(held.real) + 1j * self._forces(held.imag)
        return np.stack([self.memory.force(q, h) for q, h in zip(self.q, held)])
