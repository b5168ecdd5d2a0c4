"""The wall: layers from inside to outside, integrated through the thickness, and zones that do not have all of them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..materials.energy import KNEE, OGDEN_FROM
from ..materials.prony import Prony
from .reference import strain_map

LINEAR, RUBBER = 0, 1


@dataclass(frozen=True)
class Layer:
    """One layer."""

    law: object
    thickness: float  #: Nominal thickness, m; a section scales all layers so that they fill the local wall.
    #: Angle of the first material direction from the mesh's material axis, degrees, counter-clockwise about the outward
    #: normal.
    angle: float = 0.0
    shear_correction: float = 1.0  #: Factor on the transverse shear energy.
    name: str = ""
    relaxation: Prony | None = None  #: How it relaxes beyond its slow law; not at all without one.


@dataclass(frozen=True)
class RelaxingGroup:
    """Layers of a wall that relax alike."""

    name: str  #: Their materials.
    layers: tuple[int, ...]  #: From inside to outside.
    series: Prony


@dataclass(frozen=True)
class Section:
    """Layers, inside to outside, with Gauss points in each.

    Through-thickness coordinate and weights are normalised: zeta in (-1/2, 1/2), weights summing to one; a wall of
    thickness h has t = h zeta.
    """

    layers: tuple[Layer, ...]
    points_per_layer: int = 2
    #: Which of the layers are there; all by default. Those that are not have points without weight, so that layers are
    #: numbered alike wherever a wall has how many.
    present: tuple[bool, ...] = ()

    def __post_init__(self):
        if self.present and (len(self.present) != len(self.layers) or not any(self.present)):
            raise ValueError("A section needs a layer that is there, and a word on each whether it is.")
        if not self.layers:
            raise ValueError("A section needs at least one layer.")
        if min(layer.thickness for layer in self.layers) <= 0:
            raise ValueError("Every layer of a section needs a positive thickness.")
        if self.points_per_layer < 1:
            raise ValueError("A layer needs at least one integration point.")

    @cached_property
    def fractions(self) -> np.ndarray:
        """Thickness of each layer over that of the wall (nl,)."""
        h = np.array([layer.thickness for layer in self.layers])
        if self.present:
            h = h * np.array(self.present)
        return h / h.sum()

    @cached_property
    def interfaces(self) -> np.ndarray:
        """Normalised coordinates of the layer faces (nl + 1,), from -1/2 to 1/2."""
        return np.concatenate([[0.0], np.cumsum(self.fractions)]) - 0.5

    @cached_property
    def points(self) -> np.ndarray:
        """(nl * points, 2): normalised coordinate and weight of every layer point."""
        x, w = np.polynomial.legendre.leggauss(self.points_per_layer)
        centre = 0.5 * (self.interfaces[1:] + self.interfaces[:-1])
        zeta = centre[:, None] + 0.5 * self.fractions[:, None] * x
        weight = 0.5 * self.fractions[:, None] * w
        return np.stack([zeta.ravel(), weight.ravel()], axis=1)

    @cached_property
    def kinds(self) -> np.ndarray:
        return np.repeat([layer.law.kind for layer in self.layers], self.points_per_layer).astype(np.int64)

    @cached_property
    def parameters(self) -> np.ndarray:
        """(np, 8), or (np, 8 + 2 n) with Ogden rubbers of up to n terms: constants of the law at each layer point."""
        given = [layer.law.parameters for layer in self.layers]
        constants = np.zeros((len(given), max(len(each) for each in given)))
        for row, each in zip(constants, given):
            row[: len(each)] = each
        return np.repeat(constants, self.points_per_layer, axis=0)

    @cached_property
    def directions(self) -> np.ndarray:
        """(np, 2): cosine and sine of the layer angle at each layer point."""
        angle = np.radians([layer.angle for layer in self.layers])
        return np.repeat(np.stack([np.cos(angle), np.sin(angle)], axis=1), self.points_per_layer, axis=0)

    @cached_property
    def shear_scale(self) -> np.ndarray:
        """(np,): factor on the transverse shear strains, the root of the shear correction."""
        return np.repeat(np.sqrt([layer.shear_correction for layer in self.layers]), self.points_per_layer)

    @cached_property
    def inertia(self) -> np.ndarray:
        """(3,): integrals of density * zeta^k over the normalised wall, k = 0, 1, 2 (kg/m3), exact."""
        z = self.interfaces
        density = np.array([layer.law.density for layer in self.layers])
        return np.array([(density * (z[1:] ** (k + 1) - z[:-1] ** (k + 1))).sum() / (k + 1) for k in range(3)])

    @cached_property
    def relaxing(self) -> tuple[RelaxingGroup, ...]:
        """Layers that relax, those with the same series together."""
        found: dict[Prony, list[int]] = {}
        for number, layer in enumerate(self.layers):
            if layer.relaxation is not None and not layer.relaxation.elastic:
                found.setdefault(layer.relaxation, []).append(number)
        names = [layer.name or f"layer {number + 1}" for number, layer in enumerate(self.layers)]
        return tuple(
            RelaxingGroup(" + ".join(dict.fromkeys(names[i] for i in layers)), tuple(layers), series)
            for series, layers in found.items()
        )

    def wall(self, factors: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Arguments of the compiled loops: stiffness of the linear layers and points of the rubber layers.

        Parameters
        ----------
        factors : (nl,) array, optional
            Factors on the stress of each layer; one by default. Points of rubber with a factor of zero are left out.

        Returns
        -------
        stiffness : (8, 8) array
            See `linear_stiffness`.
        points, constants, scales : (k, 2), (k, 8 + 2 n), (k,) arrays
            See `rubber_points`.
        """
        if factors is None:
            return (self.linear_stiffness, *self.rubber_points)
        factor = np.repeat(np.asarray(factors, float), self.points_per_layer)
        kept = factor[self.kinds == RUBBER]
        points, constants, scales = self.rubber_points
        chosen = kept != 0
        scaled = constants[chosen] * kept[chosen, None]
        for place in (KNEE, *range(OGDEN_FROM + 1, constants.shape[1], 2)):  # a strain and exponents, no stress
            scaled[:, place] = constants[chosen, place]
        return self._linear_stiffness(factor), points[chosen], scaled, scales[chosen]

    @cached_property
    def linear_stiffness(self) -> np.ndarray:
        """(8, 8) stiffness of the linear layers for a wall of unit thickness.

        Rows: membrane (11, 22, 12), bending (11, 22, 12), transverse shear (13, 23). For a wall of thickness h the
        membrane and shear blocks scale with h, the coupling with h^2, the bending block with h^3.
        """
        return self._linear_stiffness(np.ones(len(self.kinds)))

    def _linear_stiffness(self, factor: np.ndarray) -> np.ndarray:
        """Stiffness (8, 8) of the linear layers, with a factor (np,) on the stress at each layer point."""
        total = np.zeros((8, 8))
        for (zeta, weight), kind, par, (c, s), shear in zip(
            self.points * np.stack([np.ones_like(factor), factor], axis=1),
            self.kinds,
            self.parameters,
            self.directions,
            self.shear_scale,
        ):
            if kind != LINEAR:
                continue
            q11, q22, q12, q66, q55, q44 = par[:6]
            turn = np.array([[c, s], [-s, c]])
            plane = strain_map(turn)
            q = plane.T @ np.array([[q11, q12, 0], [q12, q22, 0], [0, 0, q66]]) @ plane
            qs = shear**2 * turn.T @ np.diag([q55, q44]) @ turn
            total[:3, :3] += weight * q
            total[:3, 3:6] += weight * zeta * q
            total[3:6, :3] += weight * zeta * q
            total[3:6, 3:6] += weight * zeta**2 * q
            total[6:, 6:] += weight * qs
        return total

    @cached_property
    def plane_stiffness(self) -> np.ndarray:
        """(6, 6) stiffness of all layers at rest, rows and scaling as those of `linear_stiffness`; rubber answers as
        an incompressible material of its shear modulus does in plane stress.
        """
        total = self.linear_stiffness[:6, :6].copy()
        moduli = np.repeat([layer.law.small_strain_shear_modulus for layer in self.layers], self.points_per_layer)
        for (zeta, weight), modulus in zip(self.rubber_points[0], moduli[self.kinds == RUBBER]):
            rubber = modulus * np.array([[4.0, 2.0, 0.0], [2.0, 4.0, 0.0], [0.0, 0.0, 1.0]])
            total += weight * np.kron(np.array([[1.0, zeta], [zeta, zeta**2]]), rubber)
        return total

    @cached_property
    def rubber_points(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Points (k, 2), constants (k, 8 + 2 n) and shear scale (k,) of the points that carry rubber."""
        chosen = self.kinds == RUBBER
        return (self.points[chosen], self.parameters[chosen], self.shear_scale[chosen])


@dataclass(frozen=True)
class Zones:
    """Zones of the wall: elements that have the same layers."""

    presence: np.ndarray  #: (nz, nl); true where a zone has a layer.
    of_element: np.ndarray  #: (ne,); zone of each element.

    @classmethod
    def of(cls, present: np.ndarray) -> Zones:
        """Zones of elements that have the same layers; present (ne, nl) bool."""
        presence, zone = np.unique(np.asarray(present, bool), axis=0, return_inverse=True)
        return cls(presence, np.ravel(zone))


@dataclass(frozen=True)
class WallParts:
    """A wall zone by zone."""

    section: Section  #: All its layers.
    zones: Zones

    @cached_property
    def sections(self) -> tuple[Section, ...]:
        """Section (layers through the thickness) of each zone."""
        return tuple(replace(self.section, present=tuple(map(bool, row))) for row in self.zones.presence)

    @cached_property
    def elements(self) -> tuple[np.ndarray, ...]:
        """Elements of each zone."""
        return tuple(np.flatnonzero(self.zones.of_element == i) for i in range(len(self.sections)))

    def _by_element(self, values: list[np.ndarray]) -> np.ndarray:
        return np.stack(values)[self.zones.of_element]

    @cached_property
    def fractions(self) -> np.ndarray:
        """(ne, nl): those of the section of each element; 0 where it lacks a layer."""
        return self._by_element([section.fractions for section in self.sections])

    @cached_property
    def plane_stiffness(self) -> np.ndarray:
        """(ne, 6, 6): that of the section of each element."""
        return self._by_element([section.plane_stiffness for section in self.sections])

    @cached_property
    def inertia(self) -> np.ndarray:
        """(ne, 3): that of the section of each element."""
        return self._by_element([section.inertia for section in self.sections])

    @cached_property
    def points(self) -> np.ndarray:
        """(ne, np, 2): those of the section of each element."""
        return self._by_element([section.points for section in self.sections])
