"""The valve under back pressure: the one model of the valve, pressed from outside, and the passage left between its
walls.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..case.model import Case
from ..errors import SolveError
from ..shell.mesh import nodal_thickness
from .load_curve import LoadCurve
from .load_steps import LARGEST_JUMP, LoadStepOptions, LoadSteps
from .newton import NewtonOptions
from .strain_level import CLOSED
from .supports import CONTACT, HELD_LIPS, face_contact, held_rows
from .symmetry import EQUILIBRIA
from .valve import ValveModel

#: Smallest load step over the target pressure, and of a walk that ends at its limit point, which arclength locates from
#: there: each halving beside a limit point costs two Newton runs that fail.
MIN_STEP, MIN_STEP_TO_LIMIT = 1e-5, 1e-3
#: Largest load step over the first from rest, where the lips meet.
FIRST_SHARE = 20


@dataclass(frozen=True)
class Passage:
    """Passage between the inner faces, of the part that is computed, by mesh row from the lip."""

    z: np.ndarray  #: (rows,), m.
    area: np.ndarray  #: (rows,), m2; between inner face and closing plane; overlapping faces count as shut.
    reference: float  #: m2; area at the lip at rest, or of lips that stand apart there what their gap is of it.
    shut_fraction: float  #: A section is shut where less than this share of the reference is left.

    @property
    def left(self) -> float:
        """Narrowest section over the reference."""
        return float(self.area.min() / self.reference)

    @property
    def shut_length(self) -> float:
        """Length along the axis, m, that is shut."""
        return float(sum(b - a for a, b in self.shut_intervals))

    @property
    def lip_seal(self) -> float:
        """Length, m, that is shut from the lip on without a break."""
        shut = self.shut_intervals
        return shut[0][1] - self.z[0] if shut and shut[0][0] <= self.z[0] else 0.0

    @property
    def shut_intervals(self) -> list[tuple[float, float]]:
        """Intervals of z, m, that are shut.

        Between rows the roots of the areas are taken as linear, because walls that touch part from each other with at
        least the square of the distance.
        """
        excess = np.sqrt(self.area) - np.sqrt(self.shut_fraction * self.reference)
        cuts: list[tuple[float, float]] = []
        for a, b, fa, fb in zip(self.z[:-1], self.z[1:], excess[:-1], excess[1:]):
            if fa > 0 and fb > 0:
                continue
            start = a if fa <= 0 else a + (b - a) * fa / (fa - fb)
            stop = b if fb <= 0 else a + (b - a) * fa / (fa - fb)
            if cuts and abs(cuts[-1][1] - start) < 1e-12:
                cuts[-1] = (cuts[-1][0], stop)
            elif stop > start:
                cuts.append((start, stop))
        return [(float(a), float(b)) for a, b in cuts]


def area_under(gap: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Area (rows,) under the gap of rows of points; where the face folds back on itself no width is counted."""
    height = np.maximum(gap, 0.0)
    step = np.maximum(np.diff(x, axis=1), 0.0)
    return np.sum(0.5 * (height[:, 1:] + height[:, :-1]) * step, axis=1)


class ClosedValve(ValveModel):
    """The valve of a case, pressed from outside; nothing flows, and wall and fluid weigh nothing.

    Parameters
    ----------
    case : Case
        Its ``closure.supports`` are "contact": the inner faces touch the closing plane; or "held-lips": the duckbill
        cannot move across the plane and the mid-surface of the saddle cannot cross it (Th. 3.6).

    Attributes
    ----------
    plane : PlaneContact
        Contact of the inner faces, for measuring gaps with either supports.
    held : (rows,) bool array
        Rows that are shut by the supports.
    """

    def __init__(self, case: Case):
        self.supports = case.closure.supports
        super().__init__(case.replace(CLOSED), closed_by=self.supports)
        self.held = held_rows(case, self.mesh) & (self.supports == HELD_LIPS)
        self.plane = face_contact(self.case, self.mesh, self.shell, CONTACT)

    @property
    def nodes_beyond(self) -> np.ndarray:
        """Numbers of the nodes whose inner face starts beyond the closing plane."""
        return self.plane.nodes[self.plane.start < 0]

    def gaps(self, nodal: np.ndarray) -> np.ndarray:
        """Gaps (nn,), m, of all nodes for nodal unknowns (nn, c), measured as the contact measures them: faces that
        touch leave none.
        """
        return self._points(nodal)[0]

    def passage(self, q: np.ndarray) -> Passage:
        """Passage of a state (n,); at rest the lip has the initial gap at least."""
        nodal, rows = self.nodal(q), self.mesh.rows
        gap, x = self._points(nodal)
        area = area_under(gap[rows], x[rows])
        area[self.held] = 0.0
        return Passage(self.mesh.z, area, self._reference, self.case.closure.shut_fraction)

    @cached_property
    def _reference(self) -> float:
        """Area, m2, that `Passage` compares with."""
        if self.mesh.stands_apart:
            return self.mesh.lip_gap
        lip = self.mesh.rows[:1]
        gap, x = (part[lip] for part in self._points(self.nodal(np.zeros(self.size))))
        return float(area_under(np.maximum(gap, self.case.valve.initial_gap), x)[0])

    def _points(self, nodal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Gap (nn,) and x position (nn,) of the inner face at all nodes; the clamped flange is no contact node but has
        a face all the same.
        """
        shell, plane = self.shell, self.plane
        depth, lift = 0.5 * nodal_thickness(shell.mesh), np.zeros(shell.mesh.node_count)
        depth[plane.nodes], lift[plane.nodes] = plane.depth, plane.lift
        directors = shell.directors(nodal)[0] if nodal.any() else shell.mesh.directors
        point = shell.mesh.nodes + nodal[:, :3] - depth[:, None] * directors
        gap = point[:, 1] + lift
        return np.where(gap < plane.law.rounding, np.minimum(gap, 0.0), gap), point[:, 0]

    @property
    def reference_opening(self) -> float:
        """Passage between the inner faces of the lip at rest, whole valve, m2; that of touching lips where they stand
        apart.
        """
        return self.mesh.part.copies * self._reference

    def start_warnings(self) -> Iterator[str]:
        """Warnings about where the inner face starts, and about supports that hold it."""
        plane, beyond = self.plane, self.nodes_beyond
        if len(beyond):
            z = self.mesh.nodes[plane.nodes[plane.lifted], 2]
            yield (
                f"The inner face starts beyond the closing plane at {len(beyond)} node{'s' * (len(beyond) > 1)}, by up "
                f"to {float(-plane.start.min()) * 1e3:.2g} mm, and nearer to it than the initial gap at {len(z)} "
                f"(z {z.min():.3f} to {z.max():.3f} m, of {plane.count} nodes): there half the wall is thicker than "
                "the mid-surface is high, and contact resists further closing by more than the initial gap only."
            )
        if self.supports == HELD_LIPS:
            yield (
                "The duckbill is held shut by its supports, as in Th. 3.6, so that nothing is found out about "
                "whether its lips seal."
            )
            if self.case.closure.symmetry != EQUILIBRIA:
                yield (
                    "closure.symmetry asks for all symmetry classes, but lips that are held shut cannot move "
                    "together, so with these supports only the class of the model is watched for buckling."
                )


def load_steps(model: ClosedValve) -> LoadStepOptions:
    """Load steps from one back pressure to the next, as a case asks for them."""
    closure, steady = model.case.closure, model.case.steady
    jump = LARGEST_JUMP * float(np.mean(model.mesh.thickness))
    newton = NewtonOptions(steady.tolerance, steady.max_iterations)
    smallest = MIN_STEP if closure.arclength else MIN_STEP_TO_LIMIT
    gap = float(model.gaps(model.nodal(model.rest()))[model.mesh.rows[0]].max())
    return LoadStepOptions(newton, smallest, closure.max_step / FIRST_SHARE, closure.max_step, jump, jump + gap)


def close_valve(case: Case, pressure: float) -> tuple[ClosedValve, np.ndarray]:
    """Valve under a back pressure, Pa, and its displacements (n,), from rest; past limit points by arclength where
    closure.arclength is true. Raises SolveError if they are not reached.
    """
    model = ClosedValve(case)
    steps = LoadSteps(model, load_steps(model))
    try:
        steps.reach(pressure)
    except SolveError:
        if not case.closure.arclength:
            raise
        curve = LoadCurve(model, steps.options.newton, steps.observer, (steps.pressure, steps.q))
        return model, curve.reach(pressure)[0].q
    return model, steps.q
