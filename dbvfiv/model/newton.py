"""Equilibrium at one pressure: globalised Newton by PETSc's SNES on the coupled residual, solved directly."""

from __future__ import annotations

import weakref
from dataclasses import dataclass
from typing import Any

import numpy as np
from petsc4py import PETSc

from eigen.factor import SingularShiftError

_REASONS = {
    -1: "the residual or tangent could not be evaluated",
    -2: "too many residuals were evaluated",
    -3: "the tangent is singular or holds numbers that are not finite",
    -4: "the residual became infinite",
    -5: "the iterations ran out",
    -6: "the line search found no acceptable step",
    -7: "the inner solve failed",
    -8: "the line search stalled in a local minimum of the residual",
    -9: "the residual grew beyond bounds",
    -11: "the tangent solves became inaccurate",
}


@dataclass(frozen=True)
class NewtonOptions:
    """Options of the equilibrium iteration."""

    tolerance: float = 1e-8  #: Largest norm of the residual over that of the pressure forces.
    max_iterations: int = 30
    #: A SNES line search. Full steps ("basic") serve shells best: the residual rises before it falls, as membrane
    #: forces follow bending, so searches on its norm crawl; load steps catch what diverges.
    line_search: str = "basic"
    #: Bound on the share of a correction that a search finds, over the valve's length in m times the root of the node
    #: count: beyond it the whole correction is taken.
    largest_step: float = 0.1


@dataclass(frozen=True)
class NewtonResult:
    """Outcome of one equilibrium iteration."""

    q: np.ndarray  #: (n,).
    converged: bool
    iterations: int
    residual: float  #: Norm of the unbalanced force over that of the pressure forces.
    rounding: float  #: Relative residual that rounding alone leaves; a residual below it counts as zero.
    reason: str


class EquilibriumSolver:
    """Newton iterations for one model; keeps its factorisation between calls.

    Parameters
    ----------
    model : ValveModel, PressedShell or alike
    """

    def __init__(self, model: Any, options: NewtonOptions = NewtonOptions()):
        self.model = model
        self.options = options
        self.factor = model.factor()
        self.tangent: Any = None
        self._pressure = 0.0
        self._error = ""
        n = model.size
        self._snes = snes = PETSc.SNES().create(PETSc.COMM_SELF)
        self._vector = PETSc.Vec().createSeq(n)
        self._residual = PETSc.Vec().createSeq(n)
        me = weakref.proxy(self)  # PETSc would keep solver, model and factors alive for ever
        jacobian = PETSc.Mat().createPython((n, n), context=_CoupledTangent(me), comm=PETSc.COMM_SELF)
        jacobian.setUp()
        snes.setFunction(lambda *given: me._evaluate(*given), self._residual)
        snes.setJacobian(lambda *given: me._linearise(*given), jacobian, jacobian)
        snes.setConvergenceTest(lambda *given: me._test(*given))
        snes.setMaxFunctionEvaluations(1000)
        ksp = snes.getKSP()
        ksp.setType("preonly")
        pc = ksp.getPC()
        pc.setType("python")
        pc.setPythonContext(_DirectPC(me))
        prefix = f"dbvfiv_equilibrium_{id(self)}_"
        snes.setOptionsPrefix(prefix)
        settings = PETSc.Options(prefix)
        settings["snes_linesearch_type"] = options.line_search
        length = float(np.ptp(model.mesh.nodes[:, 2]))
        settings["snes_linesearch_maxstep"] = options.largest_step * length * np.sqrt(len(model.mesh.nodes))
        snes.setFromOptions()
        for key in ("snes_linesearch_type", "snes_linesearch_maxstep"):
            settings.delValue(key)
        # left alone, it would be freed by PETSc when Python has ended already, and its preconditioner is Python's: a
        # crash at the end of the program
        weakref.finalize(self, snes.destroy)

    def solve(self, start: np.ndarray, pressure: float, most: int | None = None) -> NewtonResult:
        """Iterate from a state (n,) to the equilibrium at an inlet pressure, Pa; at most so many times, if the options
        allow more.
        """
        self._pressure = pressure
        self._scale = max(self.model.force_scale(start, pressure), np.finfo(float).tiny)
        self._rounding = 0.0
        self._error = ""
        self._vector.setArray(start)
        self._snes.setTolerances(max_it=min(most or self.options.max_iterations, self.options.max_iterations))
        try:
            self._snes.solve(None, self._vector)
        except PETSc.Error as error:
            reason = self._error or f"PETSc stopped with error {error.ierr}"
            return NewtonResult(start, False, self._snes.getIterationNumber(), np.inf, self._rounding, reason)
        q = _real(self._vector).copy()
        code = self._snes.getConvergedReason()
        norm = float(np.linalg.norm(_real(self._residual))) / self._scale
        reason = "converged" if code > 0 else self._error or _REASONS.get(code, f"SNES stopped with reason {code}")
        return NewtonResult(q, code > 0, self._snes.getIterationNumber(), norm, self._rounding / self._scale, reason)

    def sensitivity(self, q: np.ndarray, pressure: float) -> np.ndarray:
        """Derivative (n,) of the equilibrium with respect to pressure, from the factors of the last tangent."""
        return -self.factor.solve(self.model.pressure_derivative(q, pressure))

    # -- what SNES calls

    def _evaluate(self, snes, x, f):
        f.setArray(self.model.residual(_real(x), self._pressure))

    def _linearise(self, snes, x, jacobian, preconditioner):
        q = _real(x)
        self.tangent = self.model.tangent(q, self._pressure)
        if not self._rounding:
            self._rounding = self.model.rounding(q, self.tangent)
        try:
            self.model.refactor(self.factor, self.tangent)
        except SingularShiftError as error:
            self._error = str(error)
            raise
        preconditioner.assemble()
        if jacobian != preconditioner:
            jacobian.assemble()

    def _test(self, snes, iteration, norms):
        norm = norms[2]
        if not np.isfinite(norm):
            return PETSc.SNES.ConvergedReason.DIVERGED_FNORM_NAN
        if norm <= self.options.tolerance * self._scale or norm <= self._rounding:
            return PETSc.SNES.ConvergedReason.CONVERGED_FNORM_ABS
        if norm > 1e6 * self._scale:
            return PETSc.SNES.ConvergedReason.DIVERGED_DTOL
        return PETSc.SNES.ConvergedReason.ITERATING


def _real(vector) -> np.ndarray:
    """Entries of a PETSc vector; real also where PETSc's scalars are complex."""
    return vector.getArray(readonly=True).real


class _CoupledTangent:
    """The tangent as an operator, for the slopes that line searches ask for."""

    def __init__(self, solver: EquilibriumSolver):
        self.solver = solver

    def mult(self, matrix, x, y):
        y.setArray(self.solver.model.apply(self.solver.tangent, _real(x)))


class _DirectPC:
    """Coupled direct solve as a preconditioner."""

    def __init__(self, solver: EquilibriumSolver):
        self.solver = solver

    def apply(self, pc, x, y):
        y.setArray(self.solver.factor.solve(_real(x)))
