"""The shell as a structure: internal force, tangent and mass of any mesh with any wall."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass
from functools import cached_property, partial

import jax
import jax.numpy as jnp
import numpy as np

from .assumed_strain import ENHANCED, assumed_strains, local_map
from .energy import (
    FIRST_ORDER,
    EnergyFunctions,
    material_strains,
    point_energies,
    point_volumes,
    shape,
    strains_of_shape,
)
from .kernel import shell_force, shell_tangent
from .mass import AVERAGED, assemble_mass, inertia_force, kinetic_energy, mass_integrals
from .mesh import UNKNOWNS_PER_NODE, DofMap, ShellMesh
from .reference import reference_geometry, shear_map, thickness_over_radius
from .rotation import director_derivatives
from .section import Section, WallParts, Zones

#: Resultants on top of those of the layers where there are none.
_NONE_HELD = np.zeros((0, 4, 8))


@dataclass(frozen=True)
class _Part:
    """Elements of one zone, as the compiled loops take them."""

    elements: slice | np.ndarray
    quads: np.ndarray
    reference: tuple


@dataclass(frozen=True)
class StepWall:
    """A wall as one instant of a motion sees it."""

    wall: tuple  #: Laws of its layers, zone by zone, see `Section.wall`.
    held: np.ndarray  #: (ne, 4, 8); resultants at each Gauss point that come on top of those of the layers.


class Shell:
    """A layered shell with finite rotations, total Lagrangian.

    Parameters
    ----------
    free : (nn, 5) bool array, optional
        Free unknowns of each node; all by default.
    metric : "first-order" or "shifted"
        Through-thickness treatment, see `dbvfiv.shell.energy`. Only the first-order treatment has a compiled element
        loop; the other is evaluated by automatic differentiation of its energy, several times slower.
    element : str
        What is assumed about the in-plane strains, see `dbvfiv.shell.assumed_strain`.
    zones : Zones, optional
        Where which layers of the section are; all are everywhere by default.
    mass_kind : "consistent" or "averaged"
        See `dbvfiv.shell.mass`.
    stress_free : ShellMesh, optional
        The shape without stress, on the same elements, where the wall of `mesh` is preset: strains are measured from
        it, displacements and rotations from `mesh`.
    closing_pressure : float, Pa
        Even pressure that holds such a wall in the shape of `mesh`.

    All states are vectors of the free unknowns (n,): displacements in m, rotations in rad. Forces are in N and N m.
    """

    def __init__(
        self,
        mesh: ShellMesh,
        section: Section,
        free=None,
        metric: str = FIRST_ORDER,
        element: str = ENHANCED,
        zones: Zones | None = None,
        mass_kind: str = AVERAGED,
        stress_free: ShellMesh | None = None,
        closing_pressure: float = 0.0,
    ):
        self.mesh = mesh
        self.stress_free, self.closing_pressure = stress_free, float(closing_pressure)
        free = np.ones((mesh.node_count, UNKNOWNS_PER_NODE), bool) if free is None else np.asarray(free, bool)
        self.dofs = DofMap(free, mesh.quads)
        self.metric, self.element, self.zones, self.mass_kind = metric, element, zones, mass_kind
        self.geometry = reference_geometry(mesh if stress_free is None else stress_free)
        self._frames = np.ascontiguousarray(mesh.frames)
        self._lay(section)

    def _lay(self, section: Section) -> None:
        """Take a section for the wall."""
        self.section, mesh, zones, g = section, self.mesh, self.zones, self.geometry
        self.at_rest = section if zones is None else WallParts(section, zones)
        unstrained = mesh if self.stress_free is None else self.stress_free
        self._assumed = a = assumed_strains(unstrained, g, self.at_rest, self.element)
        # in one order: loops are compiled for each that they meet
        arrays = a.products, g.shear0, local_map(g) @ a.inplane, shear_map(g), g.area, g.thickness
        reference = tuple(map(np.ascontiguousarray, arrays))
        if zones is None:
            self.parts = (_Part(slice(None), mesh.quads, reference),)
        else:
            self.parts = tuple(
                _Part(own, mesh.quads[own], tuple(array[own] for array in reference)) for own in self.at_rest.elements
            )
        self.wall = self.wall_of()
        self.inertia_integrals = mass_integrals(g, self.at_rest, self.mass_kind)

    def with_free(self, free=None) -> Shell:
        """Copy of the shell with other free unknowns (nn, 5); all free by default."""
        return self._copy(free, self.stress_free, self.closing_pressure)

    def with_section(self, section: Section) -> Shell:
        """Copy of the shell, in the same shape without stress, with other layers."""
        found = copy(self)
        for derived in ("energies", "point_volumes"):
            vars(found).pop(derived, None)
        found._lay(section)
        return found

    def preset(self, stress_free: ShellMesh, closing_pressure: float) -> Shell:
        """Copy of the shell without stress in another shape of its mesh; a pressure, Pa, holds it in its own."""
        return self._copy(self.dofs.free, stress_free, closing_pressure)

    def _copy(self, free, *preset) -> Shell:
        return Shell(self.mesh, self.section, free, self.metric, self.element, self.zones, self.mass_kind, *preset)

    def wall_of(self, factors: np.ndarray | None = None) -> tuple:
        """Arguments of the compiled loops, zone by zone; `factors` (nl,) multiply the stress of each layer."""
        sections = (self.section,) if self.zones is None else self.at_rest.sections
        return tuple(section.wall(factors) for section in sections)

    @property
    def size(self) -> int:
        return self.dofs.size

    @cached_property
    def energies(self) -> EnergyFunctions:
        """The automatically differentiated definition on this mesh."""
        points = None if self.zones is None else self.at_rest.points
        return EnergyFunctions(self.mesh, self.geometry, self.section, self.metric, self._assumed, points)

    def directors(self, nodal: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Directors (nn, 3), first (nn, 2, 3) and second (nn, 3, 3) derivatives for nodal unknowns (nn, 5)."""
        count = self.mesh.node_count
        d, d1, d2 = np.empty((count, 3)), np.empty((count, 2, 3)), np.empty((count, 3, 3))
        director_derivatives(np.ascontiguousarray(nodal[:, 3:5]), self.mesh.directors, self._frames, d, d1, d2)
        return d, d1, d2

    def energy(self, q: np.ndarray) -> float:
        """Strain energy, J."""
        return float(np.sum(self.energies.energy(self._element_unknowns(q))))

    def force(self, q: np.ndarray, step: StepWall | None = None) -> np.ndarray:
        """Internal force (n,): the derivative of the energy, or that of another wall."""
        if self.metric != FIRST_ORDER:
            return self._scatter(np.asarray(self.energies.force(self._element_unknowns(q))))
        nodal = self.dofs.expand(q)
        d, d1, _ = self.directors(nodal)
        out = np.zeros_like(nodal)
        for part, wall, held in self._zones(step):
            shell_force(part.quads, self.mesh.nodes, nodal, d, d1, part.reference, wall, held, out)
        return self.dofs.restrict(out)

    def _zones(self, step: StepWall | None):
        """Parts of the shell, the laws of their layers and the resultants on top of those."""
        walls, held = (self.wall, None) if step is None else (step.wall, step.held)
        for part, wall in zip(self.parts, walls):
            yield part, wall, _NONE_HELD if held is None else held[part.elements]

    def _add_tangent(self, nodal, part, wall, held, geometric, out, data) -> None:
        fixed = (part.quads, self.mesh.nodes, nodal, *self.directors(nodal), part.reference)
        shell_tangent(*fixed, wall, held, geometric, self.dofs.slots[part.elements], out, data)

    def force_and_tangent(self, q: np.ndarray, step: StepWall | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Internal force (n,) and values (nnz,) of the symmetric tangent on the pattern of `dofs`, or those of another
        wall.
        """
        data = np.zeros(len(self.dofs.pattern[1]))
        if self.metric != FIRST_ORDER:
            unknowns = self._element_unknowns(q)
            self._scatter_matrix(np.asarray(self.energies.tangent(unknowns)), data)
            return self._scatter(np.asarray(self.energies.force(unknowns))), data
        nodal = self.dofs.expand(q)
        out = np.zeros_like(nodal)
        for zone in self._zones(step):
            self._add_tangent(nodal, *zone, True, out, data)
        return self.dofs.restrict(out), data

    def relaxing_tangents(self, q: np.ndarray) -> list[np.ndarray]:
        """Material part of the tangent, values (nnz,), of each group of `Section.relaxing`.

        The part by which strains change stresses; that by which stresses turn with the wall belongs to no layer alone
        and does not relax.
        """
        nodal, found = self.dofs.expand(q), []
        for group in self.section.relaxing:
            data, share = np.zeros(len(self.dofs.pattern[1])), np.zeros(len(self.section.layers))
            share[list(group.layers)] = 1.0
            if self.metric == FIRST_ORDER:
                unused = np.zeros_like(nodal)
                for part, wall in zip(self.parts, self.wall_of(share)):
                    self._add_tangent(nodal, part, wall, _NONE_HELD, False, unused, data)
            else:
                self._scatter_matrix(np.asarray(self.energies.material_tangent(self._element_unknowns(q), share)), data)
            found.append(data)
        return found

    def mass(self, q: np.ndarray | None = None) -> np.ndarray:
        """Values (nnz,) of the mass matrix at a state (at rest by default), kg and kg m2."""
        q = np.zeros(self.size) if q is None else q
        _, d1, _ = self.directors(self.dofs.expand(q))
        data = np.zeros(len(self.dofs.pattern[1]))
        assemble_mass(self.mesh.quads, self.inertia_integrals, d1, self.dofs.slots, data)
        return data

    def inertia(self, q: np.ndarray, rate: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
        """Inertia force (n,) at velocities and accelerations (n,): M(q) a and what is quadratic in the velocities."""
        nodal = self.dofs.expand(q)
        _, d1, d2 = self.directors(nodal)
        moved, out = (self.dofs.expand(rate), self.dofs.expand(acceleration)), np.zeros_like(nodal)
        inertia_force(self.mesh.quads, self.inertia_integrals, d1, d2, *moved, out)
        return self.dofs.restrict(out)

    def kinetic_energy(self, q: np.ndarray, rate: np.ndarray) -> float:
        """J, at positions and velocities (n,)."""
        first = self.directors(self.dofs.expand(q))[1]
        return float(kinetic_energy(self.mesh.quads, self.inertia_integrals, first, self.dofs.expand(rate)))

    def second(self, q, a, b) -> np.ndarray:
        """Second directional derivative (n,) of the internal force along a and b (n,)."""
        return self._scatter(np.asarray(self.energies.second(*map(self._element_unknowns, (q, a, b)))))

    def third(self, q, a, b, c) -> np.ndarray:
        """Third directional derivative (n,) of the internal force along a, b and c (n,)."""
        return self._scatter(np.asarray(self.energies.third(*map(self._element_unknowns, (q, a, b, c)))))

    def relaxed_form(self, q, directions, factors) -> np.ndarray:
        """Derivative (n,), complex, of the internal force of a wall that relaxes, along k directions (n,).

        Parameters
        ----------
        q : (n,) array
        directions : sequence of k complex (n,) arrays
        factors : (2**k, nl) complex array
            On the stress of each layer that belongs to each set of directions, see `relaxed_forms`; ones give
            `second` and `third`.
        """
        fields = [self.dofs.expand(np.asarray(x))[self.mesh.quads] for x in directions]
        form = relaxed_force_form(self.energies, self._element_unknowns(q), fields, np.asarray(factors))
        return self._scatter(form.real) + 1j * self._scatter(form.imag)

    def strains(self, q: np.ndarray) -> np.ndarray:
        """Green-Lagrange strains (ne, 4, np, 5) in layer axes at all integration points; none where a layer is not."""
        strains = np.asarray(self.energies.strains(self._element_unknowns(q)))
        if self.zones is None:
            return strains
        return np.where(self.at_rest.points[:, None, :, 1:] > 0, strains, 0.0)

    @cached_property
    def point_volumes(self) -> np.ndarray:
        """Volumes (ne, 4, np) that the layer points stand for, m3, by the area of the mid-surface."""
        weights = self.at_rest.points[..., 1]
        weights = weights if weights.ndim == 1 else weights[:, None]
        return (self.geometry.thickness[:, None] * self.geometry.area)[:, :, None] * weights

    def folded_places(self) -> np.ndarray:
        """Positions (k, 3) of the integration points at which half the wall exceeds the radius of the mid-surface."""
        return self.geometry.position[thickness_over_radius(self.geometry) > 1.0]

    def _element_unknowns(self, q):
        return self.dofs.expand(np.asarray(q, float))[self.mesh.quads]

    def _scatter(self, element_forces: np.ndarray) -> np.ndarray:
        out = np.zeros(self.dofs.free.shape)
        np.add.at(out, self.mesh.quads, element_forces.reshape(-1, 4, UNKNOWNS_PER_NODE))
        return self.dofs.restrict(out)

    def _scatter_matrix(self, element_matrices: np.ndarray, data: np.ndarray) -> None:
        slots = self.dofs.slots.ravel()
        keep = slots >= 0
        np.add.at(data, slots[keep], element_matrices.reshape(-1)[keep])


def relaxed_force_form(energies: EnergyFunctions, unknowns, directions, factors) -> np.ndarray:
    """Derivative (ne, 4 c), complex, of the internal force along k directions.

    Parameters
    ----------
    unknowns : (ne, 4, c) array
        The state about which it is taken.
    directions : sequence of k complex (ne, 4, c) arrays
    factors : (2**k, nl) complex array
        On the stress of each layer, for each set of directions: bit i of the row's number says whether direction i is
        one of the set. Row 0 is that of the steady stress.
    """
    points = len(energies.kinds) // factors.shape[1]
    share = jnp.repeat(jnp.asarray(factors, complex), points, axis=1)
    fields = tuple(jnp.asarray(x, complex) for x in (unknowns, *directions))
    return np.asarray(_forms(energies.kinds, energies.metric, fields, share, energies.elements, energies.layers))


def _along_sets(function, count):
    """Derivatives of a function along all sets of `count` directions, from those of its argument.

    Both are tuples numbered as `factors` of `relaxed_force_form` are.
    """
    if count == 0:
        return lambda parts: (function(parts[0]),)
    fewer = _along_sets(function, count - 1)

    def along(parts):
        half = len(parts) // 2
        values, slopes = jax.jvp(fewer, (parts[:half],), (parts[half:],))
        return (*values, *slopes)

    return along


def _element_form(kinds, metric, fields, share, element, layers):
    count = len(fields) - 1
    weight = point_volumes(metric, element, layers)

    def strains(place):
        return material_strains(strains_of_shape(place, element, layers, metric), layers)

    def stress(e):
        energy = lambda x: jnp.sum(weight * point_energies(kinds, layers["parameters"], x))  # noqa: E731
        return jax.grad(energy, holomorphic=True)(e)

    def force(parts):
        unknowns, pull = parts
        return jax.vjp(lambda u: shape(u, element), unknowns)[1](pull)[0].ravel()

    single = {1 << i: field for i, field in enumerate(fields[1:])} | {0: fields[0]}
    unknowns = tuple(single.get(i, jnp.zeros_like(fields[0])) for i in range(1 << count))
    places = _along_sets(lambda u: shape(u, element), count)(unknowns)
    # strains are quadratic in the places and forces on them bilinear in places and stresses: sums over pairs of sets
    half_change = lambda a, b: 0.5 * jax.jvp(strains, (a,), (b,))[1]  # noqa: E731
    strained = _products(half_change, places, places, count)
    strained = (strains(places[0]), *strained[1:])
    stresses = _along_sets(stress, count)(strained)
    remembered = tuple(factor[:, None] * s for factor, s in zip(share, stresses))
    pulls = _products(lambda a, s: jax.vjp(strains, a)[1](s)[0], places, remembered, count)
    return _along_sets(force, count)(tuple(zip(unknowns, pulls)))[-1]


def _products(form, left, right, count):
    """Derivatives along all sets of directions of form(a, b), linear in each, from those of a and b."""
    pairs = np.array([(whole, part) for whole in range(1 << count) for part in range(whole + 1) if part & ~whole == 0])
    stacked = lambda parts, rows: jax.tree.map(lambda *x: jnp.stack(x)[rows], *parts)  # noqa: E731
    values = jax.vmap(form)(stacked(left, pairs[:, 1]), stacked(right, pairs[:, 0] - pairs[:, 1]))
    summed = jax.tree.map(lambda x: jax.ops.segment_sum(x, pairs[:, 0], 1 << count), values)
    return tuple(jax.tree.map(lambda x, i=i: x[i], summed) for i in range(1 << count))


@partial(jax.jit, static_argnums=(0, 1))
def _forms(kinds, metric, fields, share, elements, layers):
    one = lambda field, element: _element_form(kinds, metric, field, share, element, layers)  # noqa: E731
    return jax.vmap(one)(fields, elements)
