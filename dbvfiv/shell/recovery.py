"""Strains and stresses of every layer, in the layer's own axes."""

from __future__ import annotations

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np

from ..materials.energy import ENERGIES, MOONEY_RIVLIN
from ..texts import shortly
from .section import Section
from .shell import Shell


@shortly
@dataclass(frozen=True)
class LayerFields:
    """Element values of each layer: means over the in-plane and layer points of an element, extremes for von Mises."""

    names: tuple[str, ...]  #: inside to outside.
    strain: np.ndarray  #: (ne, nl, 5); Green-Lagrange strain [E11, E22, 2 E12, 2 E13, 2 E23] in the layer's axes.
    stress: np.ndarray  #: (ne, nl, 5), Pa; second Piola-Kirchhoff stress conjugate to it.
    von_mises: np.ndarray  #: (ne, nl), Pa; of the Cauchy stress; the largest in the element's part of the layer.
    stretch: np.ndarray  #: (ne, nl, 2); smallest and largest principal stretch in the plane of the layer.


def layer_fields(shell: Shell, q: np.ndarray) -> LayerFields:
    """Strains and stresses of a state (n,) of a shell."""
    section = shell.section
    strain = shell.strains(q)  # (ne, 4, np, 5)
    stress = point_stresses(section, strain)
    von_mises = von_mises_stress(strain, stress, section.kinds == MOONEY_RIVLIN)
    count, layers, points = len(strain), len(section.layers), section.points_per_layer

    def by_layer(field):
        return field.reshape(count, 4, layers, points, *field.shape[3:])

    c11, c22, c12 = 1 + 2 * strain[..., 0], 1 + 2 * strain[..., 1], strain[..., 2]
    mean, radius = 0.5 * (c11 + c22), np.hypot(0.5 * (c11 - c22), c12)
    low, high = by_layer(np.sqrt(np.maximum(mean - radius, 0.0))), by_layer(np.sqrt(mean + radius))
    return LayerFields(
        names=tuple(layer.name or f"layer {i + 1}" for i, layer in enumerate(section.layers)),
        strain=by_layer(strain).mean(axis=(1, 3)),
        stress=by_layer(stress).mean(axis=(1, 3)),
        von_mises=by_layer(von_mises).max(axis=(1, 3)),
        stretch=np.stack([low.min(axis=(1, 3)), high.max(axis=(1, 3))], axis=-1),
    )


def point_stresses(section: Section, strain: np.ndarray, every: int = 1) -> np.ndarray:
    """Second Piola-Kirchhoff stresses (..., np, 5), Pa, of strains at all points of the wall, or at every so many."""
    stress, kinds, parameters = np.empty_like(strain), section.kinds[::every], section.parameters[::every]
    for kind in np.unique(kinds):
        chosen = np.flatnonzero(kinds == kind)
        stress[..., chosen, :] = stress_at(int(kind), parameters[chosen], strain[..., chosen, :])
    return stress


def stress_at(kind: int, parameters: np.ndarray, strain: np.ndarray) -> np.ndarray:
    """Second Piola-Kirchhoff stresses (..., np, 5), Pa, of strains at points with one kind of law, whose parameters are
    (np, k).
    """
    flat = np.moveaxis(strain, -2, 0)
    stress = _stresses(kind, jnp.asarray(parameters), jnp.asarray(flat.reshape(len(parameters), -1, 5)))
    return np.moveaxis(np.asarray(stress).reshape(flat.shape), 0, -2)


def face_strains(shell: Shell, q: np.ndarray) -> np.ndarray:
    """Strains (ne, nl, 2, 5) at the inner and the outer face of each layer, in its axes, means over the element.

    Strains are linear through the wall (of the shifted metric nearly so); a layer of one point has it on both faces.
    """
    count = shell.section.points_per_layer
    strain = shell.strains(q).mean(axis=1)
    strain = strain.reshape(len(strain), -1, count, 5)
    middle, half = 0.5 * (strain[:, :, 0] + strain[:, :, -1]), 0.5 * (strain[:, :, -1] - strain[:, :, 0])
    if count > 1:
        half = half / np.polynomial.legendre.leggauss(count)[0][-1]
    return np.stack([middle - half, middle + half], axis=2)


def interlaminar_shear(shell: Shell, q: np.ndarray) -> np.ndarray:
    """Shear stress (ne, nl - 1), Pa, at the joints between layers, inside to outside: that of a parabola through the
    wall with the shear force of the element.
    """
    section, points = shell.section, shell.at_rest.points
    (cosine, sine), scale = section.directions.T, section.shear_scale
    strain = shell.strains(q).mean(axis=1)
    strain[..., 3:] *= scale[:, None]
    shear = point_stresses(section, strain)[..., 3:]
    axes = np.stack([cosine * shear[..., 0] - sine * shear[..., 1], sine * shear[..., 0] + cosine * shear[..., 1]])
    mean = np.hypot(*(points[..., 1] * scale * axes).sum(axis=-1))
    shares = points[..., 1].reshape(*points.shape[:-2], -1, section.points_per_layer).sum(axis=-1)
    joints = np.cumsum(shares, axis=-1)[..., :-1] - 0.5
    return 1.5 * mean[:, None] * (1.0 - 4.0 * joints**2)


def _stresses(kind, parameters, strain):
    one = jax.grad(ENERGIES[kind], argnums=1)
    return jax.vmap(jax.vmap(one, in_axes=(None, 0)), in_axes=(0, 0))(parameters, strain)


_stresses = jax.jit(_stresses, static_argnums=(0,))


def von_mises_stress(strain: np.ndarray, stress: np.ndarray, incompressible: np.ndarray) -> np.ndarray:
    """Von Mises value of the Cauchy stress, Pa, from strains and second Piola-Kirchhoff stresses (..., np, 5).

    Invariants of the Cauchy stress follow from S and C without the rotation: tr(sigma) = tr(S C)/J, tr(sigma^2) = tr(S
    C S C)/J^2. The thickness stretch follows from incompressibility in rubber (`incompressible` (np,) is true) and is
    taken as one in the nearly inextensible plies.
    """
    c = np.zeros(strain.shape[:-1] + (3, 3))
    s = np.zeros_like(c)
    for field, target in ((strain, c), (stress, s)):
        target[..., 0, 0], target[..., 1, 1] = field[..., 0], field[..., 1]
        for (i, j), k in (((0, 1), 2), ((0, 2), 3), ((1, 2), 4)):
            target[..., i, j] = target[..., j, i] = field[..., k]
    c[..., 0, 0] = 1 + 2 * strain[..., 0]
    c[..., 1, 1] = 1 + 2 * strain[..., 1]
    plane = c[..., 0, 0] * c[..., 1, 1] - c[..., 0, 1] ** 2
    across = (
        c[..., 1, 1] * c[..., 0, 2] ** 2
        - 2 * c[..., 0, 1] * c[..., 0, 2] * c[..., 1, 2]
        + c[..., 0, 0] * c[..., 1, 2] ** 2
    )
    c[..., 2, 2] = np.where(incompressible, (1 + across) / plane, 1.0)
    volume = np.where(incompressible, 1.0, np.sqrt(np.abs(plane)))
    product = s @ c
    first = np.trace(product, axis1=-2, axis2=-1) / volume
    second = np.einsum("...ij,...ji->...", product, product) / volume**2
    return np.sqrt(np.maximum(1.5 * (second - first**2 / 3), 0.0))
