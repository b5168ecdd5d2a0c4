"""Floquet multipliers along a branch of orbits, and where they leave the unit circle."""

from __future__ import annotations

import numpy as np

from continuation.locate import special_at


def multipliers_of(monodromy) -> np.ndarray:
    """Eigenvalues of a monodromy matrix, largest modulus first."""
    values = np.linalg.eigvals(monodromy).astype(complex)
    return values[np.argsort(-np.abs(values), kind="stable")]


class FloquetMonitor:
    """Folds of cycles, period doublings, torus bifurcations.

    Test functions are real and smooth: the parameter's part of the tangent; the product of
    ``1 + m_i``; the product of ``m_i m_j - 1`` over pairs.  The trivial multiplier is left
    out.
    """

    def measure(self, tracer, here):
        problem = tracer.problem
        frame = problem.system
        values = multipliers_of(frame.monodromy(problem.u(here.z), problem.mu(here.z)))
        rest = np.delete(values, np.argmin(np.abs(values - 1.0)))
        here.eigenvalues = values
        here.unstable = int(np.sum(np.abs(rest) > 1.0 + 1e-7))
        pairs = [rest[i] * rest[j] - 1.0 for i in range(rest.size) for j in range(i)]
        here.tests["fold of cycles"] = float(here.tangent[problem.n])
        here.tests["period doubling"] = float(np.prod(1.0 + rest).real)
        here.tests["torus"] = float(np.prod(pairs).real) if pairs else 1.0
        here.tests["period"] = float(problem.u(here.z)[-1])
        here.data["rest"] = rest

    def between(self, tracer, before, after, index, found):
        special = []
        for kind in ("fold of cycles", "period doubling", "torus"):
            if before.tests[kind] * after.tests[kind] < 0:
                point = self._locate(tracer, kind, before, after, index)
                if point is not None:
                    special.append(point)
        # The phase is fixed against the latest orbit; it satisfies its own condition.
        nodes, _ = tracer.problem.system.split(tracer.problem.u(after.z))
        tracer.problem.system.set_reference(nodes)
        return special

    def _locate(self, tracer, kind, before, after, index):
        def test(here):
            self.measure(tracer, here)
            return here.tests[kind]

        here = tracer.root(before, after, test, tolerance=1e-9)
        if here is None:
            return special_at(tracer, kind, after, index, False, "the curve was lost")
        rest = here.data["rest"]
        values = {"period": here.tests["period"]}
        if kind == "torus":
            k = int(np.argmin(np.abs(np.abs(rest) - 1.0) + (rest.imag <= 0)))
            if rest[k].imag <= 0 or abs(abs(rest[k]) - 1.0) > 1e-3:
                return None  # Two real multipliers with product one: no bifurcation.
            values["angle"] = float(np.angle(rest[k]))
        return special_at(tracer, kind, here, index, True, "", values, {"multipliers": rest})
