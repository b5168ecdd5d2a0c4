"""Forms of second and third order of the fluid outside: derivatives of its added mass by the shape.

Its kinetic energy is rho v' M_a(q) v / 2, so by Lagrange's equations it resists with

    rho [ M_a(q) a + D M_a[v] v - grad (v' M_a v) / 2 ]

(Lamb 1932, Hydrodynamics, art. 136). The shape's influence on the potential flow is taken by central differences with
panels whose quadratures are frozen. It is projected on the slowest motions x_i, the kept ones of the added mass, with
X' K_s X = 1: displacements q have the coordinates X' K_s q, and forces f on these act as K_s X f. A motion outside of
their span carries little fluid, see `dbvfiv.model.outside`.

Equation (T.21) of docs/theory.md.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.linalg as la
import scipy.sparse.linalg as spla

from .valve import ValveModel

#: Motions that the derivatives are known on.
BASIS = 30
#: Largest displacement of a difference over the radius of the flange.
STEP = 2e-4


class OutsideForms:
    """Forms of the fluid outside about a state, of unit density.

    Parameters
    ----------
    model : ValveModel
        With a fluid outside.
    q : (n,) array
        The state.

    A direction is a triple (q, v, a) of displacements, velocities and accelerations (n,).
    """

    def __init__(self, model: ValveModel, q: np.ndarray):
        self.model, self.q = model, np.asarray(q, float)
        structure = model.shell.dofs.matrix(model.structure(self.q)[1])
        columns = model.outside.added_mass(self.q, structure).columns[:, :BASIS]
        motions = spla.splu(structure.tocsc()).solve(columns)
        turn = np.linalg.cholesky(motions.T @ columns)  # columns are K_s times the motions
        self._motions = la.solve_triangular(turn, motions.T, lower=True).T
        self._forces = la.solve_triangular(turn, columns.T, lower=True).T
        self._panels = model.outside.panels(self.q)
        self._here = self._mass(np.zeros_like(self.q))
        self._ends = [self._pair(motion) for motion in self._motions.T]
        self._slope = np.array([(up - down) / (2 * h) for h, up, down in self._ends])
        self._bends: dict[bytes, np.ndarray] = {}

    def second(self, *directions: tuple) -> np.ndarray:
        """Second derivative (n,) of the resistance along two directions, at rest."""
        (q, v, a), (r, w, b) = map(self._parts, directions)
        slope = self._slope
        along = lambda x, y: np.einsum("k,kij,j->i", x, slope, y)  # noqa: E731
        force = along(q, b) + along(r, a) + along(v, w) + along(w, v) - np.einsum("i,kij,j->k", v, slope, w)
        return self._forces @ force

    def third(self, *directions: tuple) -> np.ndarray:
        """Third derivative (n,) of the resistance along three directions, at rest."""
        parts = [self._parts(direction) for direction in directions]
        force = np.zeros(self._slope.shape[0])
        for i in range(3):
            (q, _, _), (r, v, a), (s, w, b) = parts[i], parts[(i + 1) % 3], parts[(i + 2) % 3]
            if not np.any(q):
                continue
            bend = self._bend(q)
            along = lambda x, y: np.einsum("k,kij,j->i", x, bend, y)  # noqa: E731, B023
            # each pair of displacements once, half of it from either of the two
            force += 0.5 * (along(r, b) + along(s, a))
            force += along(v, w) + along(w, v) - np.einsum("i,kij,j->k", v, bend, w)
        return self._forces @ force

    # -- derivatives of the mass on the motions
    # ----

    def _parts(self, direction: Sequence[np.ndarray]) -> list[np.ndarray]:
        """Coordinates of displacements, velocities and accelerations."""
        return [self._forces.T @ x for x in direction]

    def _mass(self, shift: np.ndarray) -> np.ndarray:
        """X' M_a X at a shifted shape."""
        outside, q = self.model.outside, self.q + shift
        swept = outside.face.fluxes(self.model.nodal(q)) @ self._motions
        return swept.T @ (outside.impedance(q, self._panels) @ swept)

    def _pair(self, way: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
        """Step along a direction (n,) that moves no point far, and the mass at both of its ends."""
        far = np.abs(self.model.nodal(way)[:, :3]).max()
        step = STEP * self.model.case.valve.flange_radius / far
        return step, self._mass(step * way), self._mass(-step * way)

    def _bend(self, q: np.ndarray) -> np.ndarray:
        """Second derivatives (k, r, r) of the mass along a displacement, given by coordinates, and each motion."""
        size = np.linalg.norm(q) * (1.0 if q[np.argmax(np.abs(q))] > 0 else -1.0)
        unit = q / size
        key = np.round(unit, 12).tobytes()
        if key not in self._bends:
            way = self._motions @ unit
            step, up, down = self._pair(way)
            own = (up + down - 2 * self._here) / step**2
            found = []
            for motion, (h, ahead, behind) in zip(self._motions.T, self._ends):
                # D2[a, b] from the second derivatives along a + b, a and b
                both = step * way + h * motion
                whole = self._mass(both) + self._mass(-both) - 2 * self._here
                other = ahead + behind - 2 * self._here
                found.append(0.5 * (whole - own * step**2 - other) / (step * h))
            self._bends[key] = np.array(found)
        return size * self._bends[key]
