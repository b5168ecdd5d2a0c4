"""The valve in periodic motion: what `continuation` asks of a system whose cycles are sought as Fourier series.

    M(q) a + h(q, v) + alpha M v + beta dF/dt + F(q) + F_h(q, h) - G(q) p = 0,     e = 0

the equations of `dbvfiv.motion.equations` without a step: rates, and what relaxing layers remember, are filters of the
samples over a period. Unknowns are (q, U) with the flow law's own U (l,); pressures p and equations e are those of its
definition. The flow is outward.

Matrices of structure and inertia are dear and change with the shape alone, whose higher harmonics are small. They are
taken at fewer phases than there are samples and interpolated by a trigonometric polynomial; what pressure makes is
taken at each sample.

Equation (T.15) of docs/theory.md.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numba
import numpy as np
import scipy.sparse as sp

from continuation.blocks import BlockRows, SparseBlocks
from continuation.harmonics import Harmonics, Rates
from continuation.options import OutOfDomain
from continuation.periodic import PeriodicMotion, PeriodicOperator, Term, by_parts
from eigen.factor import SingularShiftError, Workspace
from eigen.operator import FLUID_PARTS, CoupledPencil

from ..errors import SolveError
from ..flow.law import FlowLaw, FlowMotion
from ..model.relaxing import Branches
from ..model.valve import ValveModel
from ..shell.memory import WallMemory
from ..shell.shell import Shell, StepWall

#: Weight of all but the structure's tangent in what is left out of sums: soft shapes are what is left of large
#: stiffnesses, of which little may be missing. With a hundredth exponents move by 1e-6 of themselves.
REST = 0.02
#: The same of all of a rough linearisation.
ROUGH = 0.1
#: The same where something touches, over the ratio of stiffnesses of stops and of the wall.
HARD = 100.0
#: Phases that the structure's tangent is taken at if the motion has harmonics for them, at least.
LEAST = 13


@dataclass(frozen=True)
class StiffnessDamping:
    """1 + beta d/dt, what stiffness damping makes of the internal force."""

    beta: float
    polynomial: bool = True

    def __call__(self, s):
        return 1.0 + self.beta * s


@dataclass(frozen=True)
class MassDamping:
    """d2/dt2 + alpha d/dt, what damping by the mass makes of accelerations."""

    alpha: float
    polynomial: bool = True

    def __call__(self, s):
        return s * (s + self.alpha)


class WallSlopes:
    """Matrices of a wall at the samples of motions.

    Parameters
    ----------
    size : int
        Unknowns, those of the flow behind the wall's.
    scales : (n,) array
        Sizes of the wall's unknowns.
    """

    def __init__(self, size: int, scales: np.ndarray):
        self._size, self._scales = size, scales
        self._used: dict[str, np.ndarray] = {}
        self._sizes: np.ndarray | None = None

    def terms(
        self,
        model: ValveModel,
        motion: PeriodicMotion,
        mu: Mapping[str, float],
        pressures: np.ndarray,
        rough: bool = False,
        geometric: Callable[[int], np.ndarray] | None = None,
    ) -> tuple[list[Term], tuple[np.ndarray, ...]]:
        """Terms of a linearisation, and means (nnz,) of the tangent of the structure, of the rest of the stiffness, of
        damping but for that by stiffness, and of the mass.

        Parameters
        ----------
        pressures : (N, m) array
            Pa, at the samples.
        rough : bool
            Whether to take the harmonics of the structure's tangent up to half those of the motion alone, instead of
            all but the last, and to leave out how inertia changes with the motion.
        geometric : callable, optional
            What else there is of the stiffness, values (nnz,), from the number of a sample.
        """
        h, alpha = motion.harmonics, mu["alpha"]
        samples = motion.samples[:, : model.size]
        few = min(h.count + 3 | 1 if rough else max(2 * h.count - 1, LEAST), h.size)
        weight, none = ROUGH if rough else 1.0, np.zeros(len(model.shell.dofs.pattern[1]))
        if any(model.touching(q) for q in samples):  # stops and contacts come and go at once, and outweigh the wall
            few, rough, weight = h.samples, False, HARD
        spread = between_phases(few, h.samples) if few < h.samples else None
        own, mass, inertia = self._of_shape(model, motion, few, alpha, rough)
        pressed = self._rows("pressed", h.samples)
        for i, q in enumerate(samples):
            values = model.follower_stiffness(model.nodal(q), pressures[i], none)
            model.add_contact(q, values)
            pressed.put(values if geometric is None else values + geometric(i))
        self._used |= {"own": own.used, "mass": mass.used, "pressed": pressed.used}
        stiffness, rest = own.mean, pressed.mean
        damping, masses = alpha * mass.mean, mass.mean
        inert = self.blocks(model, mass, REST * weight, spread if len(mass.values) > 1 else np.ones((h.samples, 1)))
        middle = [(0, self.blocks(model, pressed, REST * weight)), (MassDamping(alpha) if alpha else 2, inert)]
        if inertia:
            whole = self._norm(model, rest)
            for power, (name, rows) in enumerate(inertia.items()):
                self._used[name], mean = rows.used, rows.mean
                size = motion.omega**power * self._norm(model, mean)
                share = min(size / whole, 1.0) if whole else 1.0
                middle.append((power, self.blocks(model, rows, REST * weight * share, spread)))
                rest, damping = (rest + mean, damping) if power == 0 else (rest, damping + mean)
        structure = Term([(0, self.blocks(model, own, weight, spread))], outer=StiffnessDamping(mu["beta"]))
        return [structure, Term(middle)], (stiffness, rest, damping, masses)

    def _rows(self, name: str, count: int) -> BlockRows:
        return BlockRows(count, self._used.get(name))

    def _of_shape(self, model: ValveModel, motion: PeriodicMotion, few: int, alpha: float, rough: bool):
        """Tangents of the structure and masses at as many phases, and derivatives of the inertia forces by positions
        and by rates, those of the turning of the wall's sections alone; none of these, and one mass, in a rough one.
        """
        phases = 2 * np.pi * np.arange(few) / few
        own, mass = self._rows("own", few), self._rows("mass", 1 if rough else few)
        inertia = {} if rough else {name: self._rows(name, few) for name in ("by position", "by rate")}
        for q, v, a in zip(*(x[:, : model.size] for x in motion.with_rates(phases))):
            own.put(model.structure(q)[1])
            if not rough:
                mass.put(model.mass(q))
                slopes = inertia_slopes(model.shell, model.nodal(q), model.nodal(v), model.nodal(a + alpha * v))
                for rows, values in zip(inertia.values(), slopes):
                    rows.put(values)
        if rough:
            mass.put(model.mass(motion.coefficients[0, : model.size]))
        return own, mass, inertia

    def blocks(self, model: ValveModel, values, share: float = 1.0, spread: np.ndarray | None = None) -> SparseBlocks:
        """Matrices (n + l, n + l), nothing on the flow's unknowns, of values on the structure's pattern."""
        indptr, indices = model.shell.dofs.pattern
        inner = self._size - model.size
        indptr = np.append(indptr, np.full(inner, indptr[-1], indptr.dtype))
        return SparseBlocks(values, indices, indptr, (self._size, self._size), share, spread)

    def _norm(self, model: ValveModel, values: np.ndarray) -> float:
        """Frobenius norm of a matrix on the structure's pattern, with its unknowns scaled by their sizes."""
        indptr, indices = model.shell.dofs.pattern
        if self._sizes is None:
            self._sizes = np.repeat(self._scales, np.diff(indptr)) * self._scales[indices]
        return float(np.linalg.norm(values * self._sizes))


def between_phases(few: int, count: int) -> np.ndarray:
    """(count, few) weights of values at an odd number of equally spaced phases in those at more, by the trigonometric
    polynomial through them.

    Examples
    --------
    >>> values = 2.0 + np.cos(2 * np.pi * np.arange(3) / 3)
    >>> (between_phases(3, 4) @ values).round(12).tolist()
    [3.0, 2.0, 1.0, 2.0]
    """
    series = Harmonics((few - 1) // 2, few)
    return series.basis_at(2 * np.pi * np.arange(count) / count) @ series.basis.T / few


#: Step of the central difference that stands for third derivatives of directors, rad.
_STEP = 1e-4


def inertia_slopes(shell: Shell, nodal: np.ndarray, rate: np.ndarray, acceleration: np.ndarray):
    """Values (nnz,) of the derivatives by positions and by velocities on the pattern of the shell's matrices.

    Parameters
    ----------
    nodal, rate, acceleration : (nn, c) arrays
    """
    _, d1, d2 = shell.directors(nodal)
    r, a = rate[:, 3:5], acceleration[:, 3:5]
    mixed = np.stack([d2[:, [0, 2]], d2[:, [2, 1]]], axis=1)  # (nn, 2, 2, 3)
    turn = np.einsum("nri,nr->ni", d1, a) + _twice(d2, r)
    by_rate = 2.0 * np.einsum("nrsi,ns->nri", mixed, r)
    by_angle = np.einsum("nrsi,ns->nri", mixed, a)
    for s in range(2):
        ahead, behind = nodal.copy(), nodal.copy()
        ahead[:, 3 + s] += _STEP
        behind[:, 3 + s] -= _STEP
        by_angle[:, s] += (_twice(shell.directors(ahead)[2], r) - _twice(shell.directors(behind)[2], r)) / (2 * _STEP)
    size = len(shell.dofs.pattern[1])
    position, velocity = np.zeros(size), np.zeros(size)
    fixed = (shell.mesh.quads, shell.inertia_integrals, d1, mixed, turn, acceleration, by_angle, by_rate)
    _assemble(*fixed, shell.dofs.slots, position, velocity)
    return position, velocity


def _twice(d2: np.ndarray, r: np.ndarray) -> np.ndarray:
    """Second derivatives of directors (nn, 3, 3) along rates (nn, 2) twice, (nn, 3)."""
    x, y = r[:, :1], r[:, 1:]
    return d2[:, 0] * x * x + d2[:, 1] * y * y + 2.0 * d2[:, 2] * x * y


@numba.njit(cache=True)
def _assemble(quads, integrals, d1, mixed, turn, acceleration, by_angle, by_rate, slots, position, velocity):
    kq = np.empty((20, 20))
    kv = np.empty((20, 20))
    moment = np.empty(3)
    for el in range(quads.shape[0]):
        kq[:] = 0.0
        kv[:] = 0.0
        for a in range(4):
            na = quads[el, a]
            moment[:] = 0.0
            for b in range(4):
                nb = quads[el, b]
                m1 = integrals[el, 1, a, b]
                m2 = integrals[el, 2, a, b]
                for i in range(3):
                    moment[i] += m1 * acceleration[nb, i] + m2 * turn[nb, i]
                for s in range(2):
                    for i in range(3):
                        kq[5 * a + i, 5 * b + 3 + s] += m1 * by_angle[nb, s, i]
                        kv[5 * a + i, 5 * b + 3 + s] += m1 * by_rate[nb, s, i]
                    for r in range(2):
                        for i in range(3):
                            kq[5 * a + 3 + r, 5 * b + 3 + s] += m2 * d1[na, r, i] * by_angle[nb, s, i]
                            kv[5 * a + 3 + r, 5 * b + 3 + s] += m2 * d1[na, r, i] * by_rate[nb, s, i]
            for r in range(2):
                for s in range(2):
                    for i in range(3):
                        kq[5 * a + 3 + r, 5 * a + 3 + s] += mixed[na, r, s, i] * moment[i]
        for i in range(20):
            for j in range(20):
                where = slots[el, 20 * i + j]
                if where >= 0:
                    position[where] += kq[i, j]
                    velocity[where] += kv[i, j]


#: Distance from the imaginary axis, over the angular frequency, of the matrices that smooth: clear of neutral modes.
CLEAR = 0.15


class PeriodicValve:
    """Equations of a valve's periodic motions, a system of `continuation.cycles.CycleSolver`. Raises SolveError if the
    valve has no flow, or fluid outside.

    Parameters
    ----------
    rebuild : callable
        From parameters mu, by the names of `dbvfiv.model.forms.ValveForms`, to the model for them.
    flow : callable, optional
        From parameters to the flow law for them; that of the model without it.
    """

    autonomous = True

    def __init__(
        self,
        rebuild: Callable[[Mapping[str, float]], ValveModel],
        mu: Mapping[str, float],
        flow: Callable[[Mapping[str, float]], FlowLaw] | None = None,
    ):
        self._model, self._flow = rebuild, flow or (lambda mu: rebuild(mu).flow)
        model = rebuild(mu)
        check_periodic(model)
        self.inner, self.size = model.flow.inner, model.size + model.flow.inner
        area = float(model.mesh.rest_area[-1])
        self.flow_weight = area  # turns the flow's equations, Pa, into forces
        self._workspace = Workspace()
        self._known_forces: tuple[ValveModel, np.ndarray, np.ndarray] | None = None
        scale = np.ones(model.shell.dofs.free.shape)
        scale[:, 3:] = 2.0 / float(np.mean(model.shell.geometry.thickness))
        drive = max(abs(mu["inlet"] - model.flow.back), model.load_unit)  # a hanging column may be all that drives
        jet = np.sqrt(2.0 * drive / mu["density"])
        #: (n + l,): m and rad that are alike at the face of the wall, and m/s that go with them.
        self.scales = np.append(scale[model.shell.dofs.free], np.full(self.inner, 10.0 * jet))
        self._wall = WallSlopes(self.size, self.scales[: model.size])

    def model(self, mu: Mapping[str, float]) -> ValveModel:
        """The model for parameters."""
        return self._model(mu)

    # -- parts

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
        flow = self._flow(mu)
        p, rest = zip(*(flow.evaluate(passage, mu) for passage in self.passages(motion, mu)))
        return np.array(p), np.array(rest)

    def _memory(self, mu: Mapping[str, float]) -> PeriodicMemory | None:
        model = self.model(mu)
        branches = model.relaxation.branches(mu.get("loss_factor", 0.0))
        return PeriodicMemory(model.shell, branches) if branches else None

    # -- the contract

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
        passages, flow = self.passages(motion, mu), self._flow(mu)
        slopes = [flow.linearise(passage, mu) for passage in passages]
        parts = {name: np.array([one[name] for one in slopes]) for name in FLUID_PARTS}
        p = np.array([flow.evaluate(passage, mu)[0] for passage in passages])
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
    """Refuse a valve whose periodic motions these equations do not cover. Raises SolveError."""
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
        return by_parts(self._solved, coefficients)

    def _solved(self, coefficients: np.ndarray) -> np.ndarray:
        n, h = self.size, self.harmonics
        found = np.vstack(self._factor.solve(coefficients[:, :n].T, coefficients[:, n:].T / self.weight)).T
        return h.real(self._shares[:, None] * h.complex(np.real(found)))


@dataclass(frozen=True)
class BranchFilter:
    """phi(s) = sum g s tau / (1 + s tau) of the branches of a group."""

    #: strengths and times: 1, s.
    strengths: tuple[float, ...]
    times: tuple[float, ...]

    def __call__(self, s):
        x = np.multiply.outer(np.asarray(s), self.times)
        return (x / (1.0 + x)) @ np.asarray(self.strengths)


class PeriodicMemory:
    """Branches of a shell's layers in periodic motions.

    dh/dt + h / tau = g dS/dt makes h_k = g s tau / (1 + s tau) S_k of each harmonic, s = i k omega: the branches of a
    group together are one filter of its slow resultants.
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
    """Change of what branches hold with the motion, a term of `continuation.periodic.PeriodicOperator`."""

    memory: PeriodicMemory
    q: np.ndarray  #: (N, n); positions at the samples.
    size: int  #: Unknowns, those of the flow behind the wall's.

    def apply(self, samples: np.ndarray, rates: Rates) -> np.ndarray:
        """Samples (N, size) of forces for those of a change."""
        n = self.q.shape[1]
        held = self.memory.filtered(self._each(self.memory.slopes, samples[:, :n]), rates)
        out = np.zeros((len(samples), self.size), held.dtype)
        out[:, :n] = self._each(self.memory.force, held)
        return out

    def _each(self, function, samples: np.ndarray) -> np.ndarray:
        """Values of a function of the positions at samples, real or complex, in which it is linear."""
        return by_parts(lambda part: np.stack([function(q, one) for q, one in zip(self.q, part)]), samples)
