"""Internal variables of a viscoelastic wall: Maxwell branches at every Gauss point, advanced exactly over a step.

Each group of layers with one series has, beside its slow resultants S(E), branches h_j with

    dh_j/dt + h_j / tau_j = g_j dS/dt

Over a step h in which S changes evenly,

    h_j' = exp(-h / tau_j) h_j + g_j (1 - exp(-h / tau_j)) (tau_j / h) (S' - S),

so the wall answers as an elastic one whose layers are stiffer by the sum of the last factors, under resultants that do
not depend on where the step ends.

Arrays of the compiled loops are by element and Gauss point: strains (ne, 4, 8), resultants of g groups (ne, 4, g, 8)
and of b branches (ne, 4, b, 8), ordered as `dbvfiv.shell.kernel_section` has them. Strains are total Lagrangian, so
what a branch holds can be integrated through the thickness once and for all.

Equation (T.7) of docs/theory.md.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from ..errors import CaseError
from .energy import FIRST_ORDER
from .kernel_rubber import FAST
from .kernel_section import add_point_stress, linear_response, numbers_of, strains_at
from .section import RUBBER
from .shell import Shell, StepWall


@dataclass(frozen=True)
class Memory:
    """Internal variables (Maxwell branches) of the wall at one state, and their energy."""

    branches: np.ndarray  #: (ne, 4, b, 8); resultants of each branch: N/m, N, N/m.
    stretch: np.ndarray  #: (ne, 4, j, 8); section strains that the springs of branches of each relaxation time hold.
    #: work and loss: (g,); work done against the branches of each group since the start, and the dissipated part of it,
    #: J.
    work: np.ndarray
    loss: np.ndarray
    stored: np.ndarray  #: (g,); energy stored in the branches, J.
    #: strain and slow: (ne, 4, 8), (ne, 4, g, 8); section strains and slow resultants of each group at the state; they
    #: follow from its positions.
    strain: np.ndarray
    slow: np.ndarray
    #: tuple of float and; length of a step, s, and the resultants (ne, 4, 8) of the branches that such a step starts
    #: with, where they are known.
    ahead: tuple[float, np.ndarray] | None = None


class WallMemory:
    """Branches of the groups of a shell's layers. Raises CaseError if the shell's metric has no compiled loops.

    Energies: the work that a step does against a branch is that of its resultants, weighed between both ends as forces
    are in the step's equations, over the change of strains; so is that of the slow law of linear layers. What the
    branch holds of it is half its resultants times the strains of its spring,
    which relax as the resultants do; the rest is dissipated. For linear layers that is the energy of the spring; for
    rubber, whose branches follow the stress rather than the strain, it is a convention.

    Parameters
    ----------
    strengths : (g, j) array
        Of each group of `shell.section.relaxing` at each relaxation time.
    times : (j,) array
        s.
    """

    def __init__(self, shell: Shell, strengths: np.ndarray, times: np.ndarray):
        if shell.metric != FIRST_ORDER:
            raise CaseError(
                f"shell.metric is {shell.metric!r}, but a wall that relaxes moves in time with {FIRST_ORDER!r} alone.",
                "shell.metric",
            )
        self.shell, self.times = shell, np.asarray(times, float)
        self._group, self._time = (x.astype(np.int64) for x in np.nonzero(strengths))
        self._strength = np.asarray(strengths, float)[self._group, self._time]
        section = shell.section
        owner = np.full(len(section.layers), -1)
        for number, group in enumerate(section.relaxing):
            owner[list(group.layers)] = number
        self._owner, self.groups = owner, len(section.relaxing)
        member = np.repeat(owner, section.points_per_layer)[section.kinds == RUBBER]
        sections = (section,) if shell.zones is None else shell.at_rest.sections
        self._walls = [self._wall_of(part, member) for part in sections]
        self._factors: dict[float, tuple] = {}

    def _wall_of(self, section, member: np.ndarray) -> tuple:
        """Arguments of the compiled loops for the groups of a section."""
        stiffness = [section.wall((self._owner == g).astype(float))[0] for g in range(self.groups)]
        return np.array(stiffness), *section.rubber_points, member

    @property
    def shapes(self) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """Shapes of branches and stretches."""
        count = self.shell.mesh.element_count
        return (count, 4, len(self._group), 8), (count, 4, len(self.times), 8)

    def at(self, q: np.ndarray, branches=None, stretch=None, work=None, loss=None, stored=None) -> Memory:
        """Memory at positions (n,); of a wall that has relaxed in them by default."""
        strain, slow = self.resultants(q)
        held, stretched = self.shapes
        branches = np.zeros(held) if branches is None else np.reshape(branches, held)
        stretch = np.zeros(stretched) if stretch is None else np.reshape(stretch, stretched)
        work, loss = (np.zeros(self.groups) if x is None else np.array(x, float) for x in (work, loss))
        stored = self._stored(branches, stretch) if stored is None else np.array(stored, float)
        return Memory(branches, stretch, work, loss, stored, strain, slow)

    def resultants(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Section strains (ne, 4, 8) and slow resultants (ne, 4, g, 8) of each group at positions (n,)."""
        shell, count = self.shell, self.shell.mesh.element_count
        nodal = shell.dofs.expand(q)
        strain, slow = np.empty((count, 4, 8)), np.empty((count, 4, self.groups, 8))
        directors = shell.directors(nodal)[0]
        for part, wall in zip(shell.parts, self._walls):
            own = strain[part.elements], slow[part.elements]  # views of a wall of one zone, copies of others
            slow_resultants(part.quads, shell.mesh.nodes, nodal, directors, part.reference, *wall, *own)
            strain[part.elements], slow[part.elements] = own
        return strain, slow

    def held(self, memory: Memory) -> StepWall:
        """The wall at the state of a memory: its slow law and what its branches hold."""
        out = np.empty_like(memory.strain)
        hold_resultants(memory.branches, memory.slow, np.ones(len(self._group)), np.zeros(self.groups), out)
        return StepWall(self.shell.wall, out)

    def step(self, memory: Memory, h: float) -> StepWall:
        """The wall at the end of a step of h, s, from the state of a memory."""
        kept, _, by_group, wall = self._over(h)
        if memory.ahead is not None and memory.ahead[0] == h:
            return StepWall(wall, memory.ahead[1])
        out = np.empty_like(memory.strain)
        hold_resultants(memory.branches, memory.slow, kept[0], by_group, out)
        return StepWall(wall, out)

    def advance(self, memory: Memory, q: np.ndarray, h: float, now: float) -> Memory:
        """Memory after a step of h, s, to positions q (n,); `now` is the weight of the new forces in its equations."""
        kept, gained, by_group, _ = self._over(h)
        strain, slow = self.resultants(q)
        branches, stretch = np.empty_like(memory.branches), np.empty_like(memory.stretch)
        work, area, ahead = np.zeros((2, self.groups)), self.shell.geometry.area, np.empty_like(strain)
        before = (memory.branches, memory.stretch, memory.slow, slow, memory.strain, strain)
        over = (self._group, self._time, kept, gained, by_group, now, area)
        advance_branches(*before, *over, branches, stretch, ahead, work)
        done, stored = work
        loss = memory.loss + done - (stored - memory.stored)
        return Memory(branches, stretch, memory.work + done, loss, stored, strain, slow, (h, ahead))

    def on_mode(self, q: np.ndarray, shape: np.ndarray, eigenvalue: complex, moved: np.ndarray) -> Memory:
        """Memory at positions moved (n,) on a mode about a state q (n,) in which the wall had relaxed.

        Parameters
        ----------
        shape : (n,) complex array
            The mode, of the size it has at this instant.
        eigenvalue : complex, 1/s
        """
        strain, slow = (a + 1j * b for a, b in zip(self._slopes(q, shape.real), self._slopes(q, shape.imag)))
        x = eigenvalue * self.times
        share = x / (1.0 + x)
        stretch = (share[:, None] * strain[:, :, None]).real
        branches = ((self._strength * share[self._time])[:, None] * slow[:, :, self._group]).real
        return self.at(moved, np.ascontiguousarray(branches), np.ascontiguousarray(stretch))

    def _slopes(self, q: np.ndarray, way: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of strains and slow resultants along a way, by differences over a ten thousandth of the wall."""
        size = np.abs(way).max()
        if size == 0.0:
            return tuple(np.zeros_like(x) for x in self.resultants(q))
        step = 1e-4 * float(self.shell.geometry.thickness.min()) / size
        return tuple(
            (b - a) / (2 * step) for a, b in zip(self.resultants(q - step * way), self.resultants(q + step * way))
        )

    def _over(self, h: float) -> tuple:
        """Decay and gain factors of the branches over a step h, s, gains of the groups, and the stiffened wall."""
        if h not in self._factors:
            if len(self._factors) > 16:
                self._factors.clear()
            ratio = h / self.times
            stay, taken = np.exp(-ratio), -np.expm1(-ratio) / ratio
            kept, gained = (np.zeros((2, max(len(self._group), len(self.times)))) for _ in range(2))
            kept[0, : len(self._group)], kept[1, : len(self.times)] = stay[self._time], stay
            gained[0, : len(self._group)] = self._strength * taken[self._time]
            gained[1, : len(self.times)] = taken
            by_group = np.bincount(self._group, gained[0, : len(self._group)], self.groups)
            factors = np.where(self._owner >= 0, 1.0 + by_group[self._owner], 1.0)
            self._factors[h] = kept, gained, by_group, self.shell.wall_of(factors)
        return self._factors[h]

    def _stored(self, branches, stretch) -> np.ndarray:
        each = 0.5 * np.einsum("ep,epbi,epbi->b", self.shell.geometry.area, branches, stretch[:, :, self._time])
        return np.bincount(self._group, each, self.groups)


@numba.njit(cache=True, fastmath=FAST)
def slow_resultants(
    quads, nodes, q, director, reference, stiffness, points, constants, scales, member, strain_out, slow_out
):
    """Fill strains (ne, 4, 8) and the slow law's resultants (ne, 4, g, 8) of each group; unknowns q (nn, 5).

    Parameters
    ----------
    stiffness : (g, 8, 8) array
        Of the linear layers of each group.
    points, constants, scales : (k, 2), (k, 7), (k,) arrays
        Of all points that carry rubber.
    member : (k,) int array
        The group of each of these points; negative for none.
    """
    thickness = reference[5]
    x = np.empty((4, 3))
    d = np.empty((4, 3))
    u = np.empty((3, 3))
    v = np.empty((3, 3))
    z = np.empty(16)
    e = np.empty(5)
    s = np.empty(5)
    for el in range(quads.shape[0]):
        numbers_of(el, quads[el], nodes, q, director, reference, x, d, u, v, z)
        h = thickness[el]
        for point in range(4):
            strain = strain_out[el, point]
            strains_at(el, point, reference, z, strain)
            slow = slow_out[el, point]
            for g in range(stiffness.shape[0]):
                linear_response(stiffness[g], h, strain, slow[g])
            for l in range(points.shape[0]):
                if member[l] < 0:
                    continue
                add_point_stress(points[l], constants[l], scales[l], h, strain, slow[member[l]], e, s)


# a function of its own without fast arithmetic, so that it has the same digits wherever it is called; said in so many
# words, as it would take over the arithmetic of whichever caller is compiled first
@numba.njit(fastmath=False)
def _hold(branches, slow, kept, gained, out):
    for i in range(8):
        out[i] = 0.0
    for b in range(branches.shape[0]):
        for i in range(8):
            out[i] += kept[b] * branches[b, i]
    for g in range(slow.shape[0]):
        for i in range(8):
            out[i] -= gained[g] * slow[g, i]


@numba.njit(cache=True)
def hold_resultants(branches, slow, kept, gained, out):
    """Fill out (ne, 4, 8): what branches (ne, 4, b, 8) keep of theirs by factors (b,), less factors (g,) of the slow
    law's resultants (ne, 4, g, 8).
    """
    for el in range(out.shape[0]):
        for point in range(4):
            _hold(branches[el, point], slow[el, point], kept, gained, out[el, point])


@numba.njit(cache=True, fastmath=FAST)
def advance_branches(
    branches,
    stretch,
    slow,
    slow_new,
    strain,
    strain_new,
    group,
    time,
    kept,
    gained,
    gained_by_group,
    now,
    area,
    out,
    stretch_out,
    held_out,
    work,
):
    """Fill branches (ne, 4, b, 8) and their stretches (ne, 4, j, 8) at the end of a step, and what `hold_resultants`
    would give at the end of another step of the same length (ne, 4, 8).

    Parameters
    ----------
    group, time : (b,) int arrays
        Group and relaxation time of each branch.
    kept, gained : (2, max(b, j)) arrays
        What stays of a branch, and the share of the change of resultants that it takes up; second row: of stretches.
    now : float
        Weight of the new resultants in the work.
    work : (2, g) array
        Is added to: work done against the branches of each group over the change of strains, and what they hold in the
        end, J.
    """
    change = np.empty(8)
    for el in range(slow.shape[0]):
        for point in range(4):
            weight = area[el, point]
            for i in range(8):
                change[i] = strain_new[el, point, i] - strain[el, point, i]
            for j in range(stretch.shape[2]):
                for i in range(8):
                    stretch_out[el, point, j, i] = kept[1, j] * stretch[el, point, j, i] + gained[1, j] * change[i]
            for b in range(branches.shape[2]):
                g = group[b]
                t = time[b]
                stay = kept[0, b]
                gain = gained[0, b]
                done = 0.0
                held = 0.0
                for i in range(8):
                    old = branches[el, point, b, i]
                    value = stay * old + gain * (slow_new[el, point, g, i] - slow[el, point, g, i])
                    out[el, point, b, i] = value
                    done += (old + now * (value - old)) * change[i]
                    held += value * stretch_out[el, point, t, i]
                work[0, g] += weight * done
                work[1, g] += 0.5 * weight * held
            _hold(out[el, point], slow_new[el, point], kept[0], gained_by_group, held_out[el, point])
