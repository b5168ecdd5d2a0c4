"""Small models of one linearised state, for any density, damping and continuity law.

Two stages. The first space holds what station pressures and area changes do statically, K^-1 G and K^-T J^T, and what
its own inertia does, K^-1 M X. The second holds the leading eigenvectors of the first at a few conditions after one
correction with the full matrices, so that eigenvalues of forty vectors carry seven digits. With the inlet velocity
scaled by sqrt(density) the fluid's parts are powers of sqrt(density) times those of unit density.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from eigen import CoupledPencil, SingularShiftError
from eigen.factorization import MumpsFactorization, StructureMatrices

from ..model.dynamics import LinearisedState, fluid_parts

#: Power of sqrt(density) that each part of the fluid goes with.
POWERS = {"A0": 0, "A1": 1, "A2": 2, "B0": 0, "B1": 1, "R0": 0, "R1": 1, "R2": 2, "S0": 0, "S1": 1}
#: Static corrections below this share of the largest are left out of the first space.
COMPRESSION = 1e-4
#: Low motions that inertia corrections are made for.
MOTIONS = 20


class StaticSolver:
    """Block solves with K and its transpose; the symbolic factorisation is kept between states of one model."""

    def __init__(self):
        self._structure = None
        self._factor = None

    def factor(self, linear: LinearisedState) -> None:
        """Factor K of a state; where it is singular a little inertia stands in.

        Raises
        ------
        SingularShiftError
        """
        pencil = CoupledPencil(linear.mass, sp.csr_matrix(linear.mass.shape), linear.stiffness)
        if self._structure is not None and self._structure.fits(pencil):
            self._structure.load(pencil)
        else:
            self._structure = StructureMatrices(pencil)
            self._factor = MumpsFactorization(self._structure)
        for shift in (0.0, 20.0, 100.0):
            try:
                return self._factor.refactor(self._structure.values(shift))
            except SingularShiftError:
                continue
        raise SingularShiftError("The stiffness of the state is singular.")

    def solve(self, right: np.ndarray) -> np.ndarray:
        """K^-1 of columns (n, k), real or complex."""
        return self._factor.solve(right)

    def solve_transposed(self, right: np.ndarray) -> np.ndarray:
        """K^-T of columns (n, k)."""
        inner = getattr(self._factor, "_factor", None)
        if not hasattr(inner, "setMumpsIcntl"):
            return self._factor.solve_transposed(right)
        inner.setMumpsIcntl(9, 0)  # MUMPS solves whole blocks with the transpose when told so
        try:
            return self._factor.solve(right)
        finally:
            inner.setMumpsIcntl(9, 1)


class UnitFluid:
    """Fluid parts of a state at unit density for every blend of the continuity laws.

    Parameters
    ----------
    linear : LinearisedState
    """

    def __init__(self, linear: LinearisedState):
        self.linear = linear
        self.flow = linear.model.flow
        self._parts: dict[float, dict[str, np.ndarray]] = {}

    def parts(self, storage: float) -> dict[str, np.ndarray]:
        """A0 to S1 at density 1 with the inlet velocity times sqrt(density) as unknown."""
        key = float(storage)
        if key not in self._parts:
            if len(self._parts) > 256:
                self._parts.clear()
            self._parts[key] = self._computed(key)
        return self._parts[key]

    def _computed(self, storage: float) -> dict[str, np.ndarray]:
        linear, m = self.linear, len(self.linear.area)
        if self.flow.unsteady:
            return fluid_parts(self.flow, linear.area, linear.inlet, 1.0, storage)
        zero = {"A": (m, m), "B": (m, 0), "R": (0, m), "S": (0, 0)}
        parts = {name: np.zeros(zero[name[0]]) for name in POWERS}
        if self.flow.has_fluid:
            parts["A0"] = self.flow.steady_operator(linear.area, linear.inlet)[1]
        return parts

    def at(self, s: complex, density: float, storage: float):
        """A, B, R, S (s) at a density, inlet velocity scaled."""
        p, z = self.parts(storage), s * np.sqrt(density)
        return (
            p["A0"] + z * (p["A1"] + z * p["A2"]),
            p["B0"] + z * p["B1"],
            p["R0"] + z * (p["R1"] + z * p["R2"]),
            p["S0"] + z * p["S1"],
        )


@dataclass(frozen=True)
class Pairs:
    """Eigenvalues with right and left vectors (columns): structural parts and inner unknowns."""

    values: np.ndarray
    q: np.ndarray
    u: np.ndarray
    w: np.ndarray
    c: np.ndarray


class Reduced:
    """The pencil of a state on a space.

    Parameters
    ----------
    linear : LinearisedState
    fluid : UnitFluid
    space : (n, k) array
        Made orthonormal in the mass here; directions below `compression` of the largest are left out.
    """

    def __init__(self, linear: LinearisedState, fluid: UnitFluid, space: np.ndarray, compression: float = 1e-9):
        self.linear, self.fluid = linear, fluid
        self.V, MV = V, MV = orthonormal(linear.mass, space, compression)
        self.K = V.T @ (linear.stiffness @ V)
        self.Ks = V.T @ (linear.structure @ V)
        self.M = V.T @ MV
        self.G = linear.forces.T.dot(V).T
        self.J = linear.slope @ V
        self._fluid: dict[float, dict[str, np.ndarray]] = {}

    @property
    def size(self) -> int:
        return self.V.shape[1]

    def _coupling(self, storage: float) -> dict[str, np.ndarray]:
        key = float(storage)
        if key not in self._fluid:
            if len(self._fluid) > 256:
                self._fluid.clear()
            p, side = (
                self.fluid.parts(key),
                {"A": (self.G, self.J), "B": (self.G, None), "R": (None, self.J), "S": (None, None)},
            )
            parts = {}
            for name, value in p.items():
                left, right = side[name[0]]
                value = value if left is None else left @ value
                parts[name] = value if right is None else value @ right
            self._fluid[key] = parts
        return self._fluid[key]

    def first_order(self, conditions) -> np.ndarray:
        """Matrices whose eigenvalues are those of the pencil, (cells, 2k + b, 2k + b).

        Parameters
        ----------
        conditions : sequence of (density, alpha, beta, storage)
        """
        k, cells = self.size, len(conditions)
        b = self._coupling(conditions[0][3])["S0"].shape[0]
        left, right = np.zeros((cells, k + b, k + b)), np.zeros((cells, k + b, 2 * k + b))
        for i, (density, alpha, beta, storage) in enumerate(conditions):
            c, root = self._coupling(storage), np.sqrt(density)
            left[i, :k, :k] = self.M - density * c["A2"]
            right[i, :k, :k] = c["A0"] - self.K
            right[i, :k, k : 2 * k] = root * c["A1"] - alpha * self.M - beta * self.Ks
            if b:
                left[i, :k, k:], left[i, k:, :k], left[i, k:, k:] = -root * c["B1"], density * c["R2"], root * c["S1"]
                right[i, :k, 2 * k :], right[i, k:, 2 * k :] = c["B0"], -c["S0"]
                right[i, k:, :k], right[i, k:, k : 2 * k] = -c["R0"], -root * c["R1"]
        out = np.zeros((cells, 2 * k + b, 2 * k + b))
        out[:, :k, k : 2 * k] = np.eye(k)
        out[:, k:] = np.linalg.solve(left, right)
        return out

    def eigenvalues(self, conditions) -> np.ndarray:
        """All eigenvalues (cells, 2k + b), complex."""
        matrices = self.first_order(conditions)
        return np.linalg.eigvals(matrices) if len(matrices) else np.zeros((0, matrices.shape[1]), complex)

    def pairs(self, condition, floor: float, most: int = 8) -> Pairs:
        """Leading eigenpairs of the upper half-plane with growth rates above a floor, lifted to the full unknowns."""
        density, alpha, beta, storage = condition
        values, left, right = la.eig(self.first_order([condition])[0], left=True, right=True)
        keep = np.flatnonzero((values.imag >= 0) & (values.real > floor))
        keep = keep[np.argsort(-values.real[keep])][:most]
        k, c, root = self.size, self._coupling(storage), np.sqrt(density)
        b = c["S0"].shape[0]
        # left vectors of F - lambda E from those of E^-1 F
        mass = np.zeros((k + b, k + b))
        mass[:k, :k] = self.M - density * c["A2"]
        if b:
            mass[:k, k:], mass[k:, :k], mass[k:, k:] = -root * c["B1"], density * c["R2"], root * c["S1"]
        under = np.linalg.solve(mass.T, left[k:, keep])
        return Pairs(values[keep], self.V @ right[:k, keep], right[2 * k :, keep], self.V @ under[:k], under[k:])


def orthonormal(mass, X: np.ndarray, compression: float, passes: int = 2) -> tuple[np.ndarray, np.ndarray]:
    """Mass-orthonormal basis of the span of columns, and mass times it; directions weaker than `compression` left out,
    each column counts alike.
    """
    MX = mass @ X
    size = np.sqrt(np.einsum("ij,ij->j", X, MX))
    X, MX = X[:, size > 0] / size[size > 0], MX[:, size > 0] / size[size > 0]
    # a second pass removes what rounding left in the first; the mass goes along, which spares a product
    for threshold in (max(compression**2, 1e-14), 1e-14)[:passes]:
        gram = X.T @ MX
        weight, turn = np.linalg.eigh(0.5 * (gram + gram.T))
        keep = weight > threshold * weight[-1]
        turn = turn[:, keep][:, ::-1] / np.sqrt(weight[keep][::-1])
        X, MX = X @ turn, MX @ turn
    return X, MX


class StateFamily:
    """Everything at one steady state that does not depend on density, damping and continuity law.

    Parameters
    ----------
    linear : LinearisedState
    solver : StaticSolver, optional
        Keeps the symbolic factorisation between states.
    """

    def __init__(self, linear: LinearisedState, solver: StaticSolver | None = None):
        self.linear = linear
        self.fluid = UnitFluid(linear)
        self.solver = solver or StaticSolver()
        self.solver.factor(linear)

    @cached_property
    def coarse(self) -> Reduced:
        """First stage."""
        linear = self.linear
        still = [
            self.solver.solve(linear.forces.toarray()),
            self.solver.solve_transposed(linear.slope.toarray().T.copy()),
        ]
        first, inertia = orthonormal(linear.mass, np.hstack(still), COMPRESSION, passes=1)
        # one step of subspace iteration on the lowest motions found there
        stiffness = first.T @ (linear.stiffness @ first)
        lowest = la.eigh(0.5 * (stiffness + stiffness.T), subset_by_index=(0, min(MOTIONS, first.shape[1]) - 1))[1]
        moving = self.solver.solve(inertia @ lowest)
        return Reduced(linear, self.fluid, np.hstack([first, moving]), COMPRESSION)

    def residual(self, values, q, u, condition, left: bool = False):
        """T(lambda) x of pairs, or T^H w of left vectors: force part (n, k) and outlet part (b, k)."""
        density, alpha, beta, storage = condition
        lin, s = self.linear, np.conj(values) if left else values
        turn = (lambda a: a.T) if left else (lambda a: a)
        q = np.asarray(q, complex)
        mq, kq = real_times(lin.mass, q), real_times(turn(lin.stiffness), q)
        force = mq * (s * s + alpha * s) + kq
        if beta:
            force += real_times(lin.structure, q) * (beta * s)
        y = real_times(lin.forces.T if left else lin.slope, q)
        inner = np.zeros((u.shape[0], len(values)), complex)
        pressure = np.zeros_like(y)
        for i, value in enumerate(s):
            A, B, R, S = self.fluid.at(value, density, storage)
            if left:
                pressure[:, i] = A.T @ y[:, i] - R.T @ u[:, i]
                inner[:, i] = -B.T @ y[:, i] + S.T @ u[:, i]
            else:
                pressure[:, i] = A @ y[:, i] + B @ u[:, i]
                inner[:, i] = R @ y[:, i] + S @ u[:, i]
        force -= real_times(lin.slope.T if left else lin.forces, pressure)
        return force, inner

    def corrected(self, pairs: Pairs, condition) -> tuple[np.ndarray, np.ndarray]:
        """Right and left structural vectors after one correction of what the space leaves out, (n, k) each."""
        beta = condition[2]
        force, _ = self.residual(pairs.values, pairs.q, pairs.u, condition)
        back, _ = self.residual(pairs.values, pairs.w, pairs.c, condition, left=True)
        # far from the leading modes T is nearly (1 + lambda beta) K
        scale = 1.0 / (1.0 + pairs.values * beta)
        return pairs.q - self.solver.solve(force) * scale, pairs.w - self.solver.solve_transposed(back) * np.conj(scale)

    def fine(self, conditions, floor: float, most: int = 4) -> Reduced:
        """Second stage: a space made of corrected leading vectors at some conditions."""
        columns = []
        for condition in conditions:
            right, left = self.corrected(self.coarse.pairs(condition, floor, most), condition)
            columns += [right.real, right.imag, left.real, left.imag]
        return Reduced(self.linear, self.fluid, np.hstack(columns), 3e-7)


def real_times(matrix, x: np.ndarray) -> np.ndarray:
    """Real sparse matrix times complex columns without making the matrix complex."""
    x = np.ascontiguousarray(x)
    if not np.iscomplexobj(x) or not x.size:
        return matrix @ x
    return np.ascontiguousarray(matrix @ x.view(float)).view(complex)
