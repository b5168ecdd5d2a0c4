"""Fluid outside the wall: potential flow on the deformed outer face as added mass.

    M_a(q) = rho E' S E,     E: volume swept by the panels, S: pressure impulse on them of unit volume fluxes

S is symmetric and full. Of M_a the part kept is that of the r motions x_i that it slows down most,

    M_a x_i = mu_i K_s x_i,     M_r = sum_i w_i w_i',  w_i = M_a x_i / sqrt(x_i' M_a x_i),

which is exact for every motion made of them and leaves out at most mu_(r+1) K_s: frequencies that stand well below
that of the first motion left out, 1/sqrt(mu_(r+1)), do not see it.

The fluid's kinetic energy is rho v' M_a(q) v / 2, so by Lagrange's equations it resists with

    rho [ M_a(q) a + D M_a[v] v - grad (v' M_a v) / 2 ]

(Lamb 1932, Hydrodynamics, art. 136). The shape's influence on the potential flow is taken by central differences with
panels whose quadratures are frozen. It is projected on the slowest motions x_i, the kept ones of the added mass, with
X' K_s X = 1: displacements q have the coordinates X' K_s q, and forces f on these act as K_s X f. A motion outside of
their span carries little fluid, see above.

Equations (T.19), (T.20) and (T.21) of docs/theory.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from eigen.basis import NotConvergedError, NotPositiveError, largest_pairs
from eigen.factor import SingularShiftError, Workspace
from eigen.operator import CoupledPencil

from ..case.model import Case
from ..case.part import QUARTER, Part
from ..errors import CaseError, SolveError
from ..flow.outside.panels import Panels, arc, end_face, extruded, pipe, ring_face, stretched, strip
from ..flow.outside.potential_flow import BODY, ROOM, Impedance, PotentialFlow, Surroundings
from ..flow.outside.shape import ShapeDerivative
from ..geometry.valve_mesh import ValveMesh
from ..shell.pressure import OuterFace
from ..shell.shell import Shell
from .symmetry import equilibria_of

#: Motions kept of the added mass of a quarter.
KEPT = 30
#: Motions that are looked for together, and how well they are told. What is kept of the added mass is exact on them
#: whatever they are; an error of 1e-3 moves eigenvalues by less than 1e-8 of themselves.
BLOCK, TOLERANCE = 16, 1e-4
#: Length of the rigid tube that goes on upstream in unbounded fluid, in diameters of the flange.
TUBE = 4.0
#: Where a pipe around the valve is open, from lip and flange, in its diameters.
OPEN_DOWN, OPEN_UP = 2.0, 2.0
#: Least height of an open gap between the lips over their half width.
SLIVER = 1e-3
#: Panels around a quarter of the surrounding pipe for each column of the wall.
AROUND = 0.5


@dataclass(frozen=True)
class AddedMass:
    """Added mass of unit density, m3 for displacements."""

    columns: np.ndarray  #: (n, r); w_i: the mass is their product with their transpose.
    #: (r + 1,); mu_i of the motions kept and of the first left out, s2 m3/kg: a massless wall in a fluid of density rho
    #: has the frequencies 1/sqrt(rho mu)/(2 pi).
    slowness: np.ndarray
    motions: np.ndarray | None = None  #: (n, r); x_i, where they are known.

    @classmethod
    def of_images(cls, motions: np.ndarray, images: np.ndarray, slowness: np.ndarray) -> AddedMass:
        """Added mass from motions (n, r) and its images (n, r) of these: exact on their span."""
        gram = motions.T @ images
        values, turn = la.eigh(0.5 * (gram + gram.T))
        told = values > len(values) * np.finfo(float).eps * values[-1]  # of the others rounding is all there is
        return cls(images @ (turn / np.sqrt(np.where(told, values, np.inf))), slowness, motions)

    @property
    def rank(self) -> int:
        return self.columns.shape[1]

    def coupling(self, forces, slope) -> tuple[sp.csr_matrix, sp.csr_matrix]:
        """G (n, m + r) and J (m + r, n): the flow's own with the added mass behind them."""
        own = sp.csr_matrix(self.columns)
        return sp.hstack([sp.csr_matrix(forces), own], "csr"), sp.vstack([sp.csr_matrix(slope), own.T], "csr")

    def parts(self, flow: dict[str, np.ndarray], density: float) -> dict[str, np.ndarray]:
        """Parts A0 to S1 of `eigen.CoupledPencil` for that coupling.

        Parameters
        ----------
        flow : dict
            Those of the flow, A0 (m, m) to S1.
        density : float
            Of the fluid outside, kg/m3.
        """
        r = self.rank
        wider = {"A": ((0, r), (0, r)), "B": ((0, r), (0, 0)), "R": ((0, 0), (0, r)), "S": ((0, 0), (0, 0))}
        found = {name: np.pad(value, wider[name[0]]) for name, value in flow.items()}
        inertia = found["A2"]
        outside = np.arange(inertia.shape[0] - r, inertia.shape[0])
        inertia[outside, outside] = -density
        return found


class OutsideFluid:
    """Added mass of the fluid outside a valve. Raises CaseError if the pipe around the valve does not clear its outer
    face at rest.
    """

    def __init__(self, case: Case, mesh: ValveMesh, shell: Shell):
        self.face, self.part = OuterFace(shell), mesh.part
        self.shell, self.equilibria = shell, equilibria_of(mesh.part).name
        self._edge, self.inlet_radius = mesh.rows[0], case.valve.inlet_radius
        self.open_lips = case.outside.lips == "open"
        diameter = case.outside.pipe_diameter
        self.radius = None if diameter is None else 0.5 * diameter
        rest = shell.dofs.expand(np.zeros(shell.size))
        points, _ = self.face.points(rest)
        sentence = self._check_clearance(points)
        if sentence:
            raise CaseError(sentence, "outside.pipe_diameter")
        self._at_rest = points[mesh.rows]
        self._flows: dict[str, PotentialFlow] = {}
        self._workspaces: dict[str, Workspace] = {}

    def _flow(self, symmetry: str) -> PotentialFlow:
        """The fluid between the wall and what stays at rest, in motions of a class."""
        if symmetry not in self._flows:
            closed = BODY if self.radius is None else ROOM
            self._flows[symmetry] = PotentialFlow(surroundings(self._at_rest, self.radius, self.part), symmetry, closed)
        return self._flows[symmetry]

    def _check_clearance(self, points: np.ndarray) -> str:
        """Sentence for a pipe around the valve that does not clear its outer face; empty where it does."""
        widest = float(np.hypot(points[:, 0], points[:, 1]).max())
        if self.radius is None or widest < self.radius:
            return ""
        return (
            f"outside.pipe_diameter is {2e3 * self.radius:g} mm; the valve's outer face reaches {2e3 * widest:.4g} mm, "
            "so it must be larger."
        )

    def panels(self, q: np.ndarray) -> Panels:
        """Outer faces of the elements at a state, in their order; behind them what closes the end of the tube, and last
        the opening between the lips where that is open. Raises SolveError if the wall touches the pipe around it.
        """
        points, directors = self.face.points(self.shell.dofs.expand(q))
        sentence = self._check_clearance(points)
        if sentence:
            raise SolveError(f"The wall touches the pipe around it: {sentence}")
        quads = self.shell.mesh.quads
        wall = Panels.of(points[quads], directors[quads])
        outer, middle = points[self._edge], np.array([1.0, 0.0, 1.0])
        if not self.open_lips:
            return Panels.joined(wall, strip(outer, outer * middle))
        inner = self._inner_edge(outer, directors)
        return Panels.joined(wall, strip(outer, inner), strip(inner, inner * middle))

    def _inner_edge(self, outer: np.ndarray, directors: np.ndarray) -> np.ndarray:
        """Edge (k, 3) of the opening: that of the inner face, kept apart where lips touch and the side edge folds."""
        edge = outer - 2.0 * self.face.half_wall[self._edge, None] * directors[self._edge]
        centre = self.part.centre(len(edge))
        sides = [slice(centre, None)] if self.part.is_quarter else [slice(centre, None), slice(centre, None, -1)]
        for side, sign in zip(sides, (1.0, -1.0)):
            middle = edge[centre, 0]
            edge[side] = self._opened(edge[side], outer[side], middle, sign)
        return edge

    @staticmethod
    def _opened(edge: np.ndarray, outer: np.ndarray, middle: float, sign: float) -> np.ndarray:
        """A side (k, 3) of the edge from its middle outwards, with x growing in the direction of a sign."""
        edge, own, far = edge.copy(), sign * (edge[:, 0] - middle), sign * (outer[:, 0] - middle)
        apart = SLIVER * far[-1]
        edge[:, 1] = np.clip(edge[:, 1], np.minimum(apart, 0.5 * outer[:, 1]), outer[:, 1])
        edge[-1, 1] = 0.0
        steps = np.maximum(np.diff(np.clip(own, 0.0, far)), 0.1 * np.diff(far))
        edge[:, 0] = middle + sign * np.minimum(np.concatenate([[0.0], np.cumsum(steps)]), far)
        return edge

    def impedance(self, q: np.ndarray, frozen: Panels | None = None, symmetry: str | None = None) -> Impedance:
        """S (ne, ne), 1/m, in motions of a class, by default that of the equilibria: see `PotentialFlow.impedance`."""
        count = len(self.shell.mesh.quads), self._opening
        return self._flow(symmetry or self.equilibria).impedance(self.panels(q), *count, frozen)

    @property
    def _opening(self) -> int:
        """Number of panels of the opening between the lips."""
        return 2 * (len(self._edge) - 1) if self.open_lips else 0

    def all_panels(self, q: np.ndarray) -> Panels:
        """Panels at a state, those of the surroundings behind them."""
        return self._flow(self.equilibria).all_panels(self.panels(q))

    def shape_derivative(self, q: np.ndarray, left: np.ndarray, right: np.ndarray) -> ShapeDerivative:
        """Derivative of the sum of the products of the added mass with motions (n, m) and (n, m), complex, of
        equilibria's class, by what changes the shape; that of E is not in it.
        """
        fluxes = self.face.fluxes(self.shell.dofs.expand(q))
        count = len(self.shell.mesh.quads), self._opening
        return ShapeDerivative(self._flow(self.equilibria), self.panels(q), *count, fluxes @ left, fluxes @ right)

    def resistance(self, q: np.ndarray, motions: np.ndarray, frozen: Panels | None = None) -> np.ndarray:
        """Forces (n, k) of a fluid of unit density on accelerations (n, k): the whole added mass times these."""
        fluxes = self.face.fluxes(self.shell.dofs.expand(q))
        return fluxes.T @ (self.impedance(q, frozen) @ (fluxes @ motions))

    def added_mass(
        self, q: np.ndarray, structure: sp.csr_matrix, symmetry: str | None = None, shell: Shell | None = None
    ) -> AddedMass:
        """Added mass of unit density at a state, of the `KEPT` motions that it slows down most.

        Parameters
        ----------
        q : (n,) array
            By the unknowns of the symmetric class.
        structure : (k, k) sparse matrix
            The structure's own tangent, which says what motions are slow.
        symmetry : str, optional
            Class of the motions, whose signs the images have; that of the equilibria by default.
        shell : Shell, optional
            With the unknowns of that class.
        """
        face = self.face if shell is None else OuterFace(shell)
        fluxes, impedance = face.fluxes(self.shell.dofs.expand(q)), self.impedance(q, symmetry=symmetry)
        workspace = self._workspaces.setdefault(symmetry or self.equilibria, Workspace())
        return leading_added_mass(fluxes, impedance, structure, KEPT * self.part.quarters, workspace)


def leading_added_mass(fluxes, impedance, structure, kept: int, workspace: Workspace | None = None) -> AddedMass:
    """The part of E' S E that slows motions down most, see the module. Raises SolveError if the stiffness is far from
    positive, or the motions are not found.

    Parameters
    ----------
    fluxes : (k, n) sparse matrix E
    impedance : (k, k) array or linear operator S
    structure : (n, n) sparse matrix
        Symmetric; where it is not positive it is shifted by a small part of its diagonal.
    """
    n = structure.shape[0]
    kept = min(kept, fluxes.shape[0] - 2, n - 2)
    back = fluxes.T.tocsr()
    apply = lambda x: back @ (impedance @ (fluxes @ x))  # noqa: E731
    unit = sp.diags(structure.diagonal()).tocsr()
    start = back @ np.random.default_rng(11).standard_normal((fluxes.shape[0], BLOCK))
    for share in (0.0, 1e-6, 1e-3, 1e-1):
        stiffness = structure if share == 0.0 else (structure + share * unit).tocsr()
        try:
            solver = (workspace or Workspace()).factored(CoupledPencil(unit, 0.0 * unit, stiffness), 0.0)
            pairs = largest_pairs(apply, stiffness, solver.solve, start, kept + 1, TOLERANCE)
        except (SingularShiftError, NotPositiveError):
            continue
        except NotConvergedError as error:
            raise SolveError(f"The added mass of the fluid outside was not found: {error}") from error
        kept = min(kept, len(pairs.values) - 1)
        # signs that stay from state to state: differences are taken of the columns
        signs = np.where(start[:, 0] @ pairs.vectors[:, :kept] < 0.0, -1.0, 1.0)
        columns = pairs.images[:, :kept] * (signs / np.sqrt(pairs.values[:kept]))
        return AddedMass(columns, pairs.values, pairs.vectors[:, :kept])
    raise SolveError("The wall's stiffness is far from positive definite; no added mass can be told from it.")


def surroundings(grid: np.ndarray, radius: float | None, part: Part = QUARTER) -> Surroundings:
    """Boundaries at rest around a valve: extension of its flange, and the pipe around it.

    Parameters
    ----------
    grid : (l, k, 3) array, m
        Outer face at rest from the lip's row to the flange's, columns as those of the part.
    radius : float, optional
        Radius of the pipe around it, m; without one the fluid is unbounded.
    """
    contour, top = grid[-1][:, :2], float(grid[-1][:, 2].mean())
    bore, step = float(np.hypot(*contour[0])), float(grid[-1][:, 2].mean() - grid[-2][:, 2].mean())
    if radius is None:
        length = 2 * TUBE * bore
        tube = extruded(contour, stretched(top, step, length))
        return Surroundings(Panels.joined(tube, end_face(contour, top + length, True)))
    around = max(4, round(AROUND * (grid.shape[1] - 1) / part.quarters))
    lip = float(grid[0][:, 2].min())
    low, high = lip - 2 * OPEN_DOWN * radius, top + 2 * OPEN_UP * radius
    beside = np.linspace(lip, top, max(2, round((top - lip) / (radius * 0.5 * np.pi / around))) + 1)
    spacing = beside[1] - beside[0]
    down, up = stretched(0.0, spacing, lip - low), stretched(top, spacing, high - top)
    z = np.concatenate([(lip - down)[::-1], beside[1:], up[1:]])
    tube = extruded(contour, up)
    circle = arc(radius, np.linspace(part.turn, 0.0, len(contour)))
    angles = np.linspace(part.turn, 0.0, part.quarters * around + 1)
    coarse = arc(radius, angles)
    ends = Panels.joined(end_face(coarse, low, True), ring_face(contour, circle, high, False))
    return Surroundings(Panels.joined(tube, pipe(radius, z, angles)), ends)


#: Motions that the derivatives are known on.
BASIS = 30
#: Largest displacement of a difference over the radius of the flange.
STEP = 2e-4


class OutsideForms:
    """Forms of the fluid outside about a state, of unit density.

    Parameters
    ----------
    q : (n,) array
        The state.
    structure : (n, n) sparse matrix
        The structure's own tangent there.

    A direction is a triple (q, v, a) of displacements, velocities and accelerations (n,).
    """

    def __init__(self, outside: OutsideFluid, q: np.ndarray, structure: sp.csr_matrix):
        self.outside, self.q = outside, np.asarray(q, float)
        columns = outside.added_mass(self.q, structure).columns[:, :BASIS]
        motions = spla.splu(structure.tocsc()).solve(columns)
        turn = np.linalg.cholesky(motions.T @ columns)  # columns are K_s times the motions
        self._motions = la.solve_triangular(turn, motions.T, lower=True).T
        self._forces = la.solve_triangular(turn, columns.T, lower=True).T
        self._panels = outside.panels(self.q)
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

    def _parts(self, direction: Sequence[np.ndarray]) -> list[np.ndarray]:
        """Coordinates of displacements, velocities and accelerations."""
        return [self._forces.T @ x for x in direction]

    def _mass(self, shift: np.ndarray) -> np.ndarray:
        """X' M_a X at a shifted shape."""
        outside, q = self.outside, self.q + shift
        swept = outside.face.fluxes(outside.shell.dofs.expand(q)) @ self._motions
        return swept.T @ (outside.impedance(q, self._panels) @ swept)

    def _pair(self, way: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
        """Step along a direction (n,) that moves no point far, and the mass at both of its ends."""
        far = np.abs(self.outside.shell.dofs.expand(way)[:, :3]).max()
        step = STEP * self.outside.inlet_radius / far
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
