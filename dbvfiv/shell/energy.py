"""The element is its energy: the one definition of the shell's mechanics, differentiated automatically.

Strains are covariant Green-Lagrange coefficients of a first-order (thick shell) kinematics x(t) = x + t d, with the
transverse shear of Dvorkin & Bathe (1984) and in-plane strains as `assumed_strain` has them. Two through-thickness
treatments:

``first-order``
    Mid-surface metric and area; E(t) = c0 + t (c1 - sym(kappa c0)), Budiansky-Sanders' best first-order theory.
``shifted``
    The strains of ``first-order`` on parallel surfaces of their own length and area: S^-1/2 E(t) S^-1/2 over det S,
    S = 1 + t kappa (Winkler and Bach's curved bar), see `reference.shifted_layers`. Right to first order in thickness
    over radius for unlike layers too, and bounded where the wall folds.

Equation (T.5) of docs/theory.md.
"""

from __future__ import annotations

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from ..materials.energy import LINEAR_ELASTIC, MOONEY_RIVLIN, linear_elastic_energy, rubber_energy
from .assumed_strain import FACTORS, PAIRS, VECTORS, AssumedStrains
from .reference import SHEAR_EDGES, SHEAR_WEIGHTS, ReferenceGeometry, shifted_layers
from .rotation import director
from .section import Section

FIRST_ORDER, SHIFTED = METRICS = "first-order", "shifted"
_LAWS = {LINEAR_ELASTIC: linear_elastic_energy, MOONEY_RIVLIN: rubber_energy}


def section_arrays(section: Section) -> dict:
    """Layer-point data for `element_energy`."""
    data = {
        "zeta": section.points[:, 0],
        "weight": section.points[:, 1],
        "parameters": section.parameters,
        "direction": section.directions,
        "shear": section.shear_scale,
    }
    return {key: jnp.asarray(value) for key, value in data.items()}


def element_arrays(mesh, geometry: ReferenceGeometry, points: np.ndarray, metric: str, assumed: AssumedStrains) -> dict:
    """Arrays with a leading element axis that `element_energy` is mapped over; `points` (np, 2) or, of zones, (ne, np,
    2).
    """
    data = {
        "x": mesh.nodes[mesh.quads],
        "director": mesh.directors[mesh.quads],
        "frame": mesh.frames[mesh.quads],
        "h": geometry.thickness,
        "area": geometry.area,
        "inplane": assumed.inplane,
        "products": assumed.products,
        "s0": geometry.shear0,
    }
    if points.ndim > 2:
        data |= {"zeta": points[..., 0], "weight": points[..., 1]}
    data |= {"q": geometry.q, "qk": geometry.qk, "p": geometry.p}
    if metric == SHIFTED:
        data |= dict(zip(("shift", "turn", "mu"), shifted_layers(geometry, points)))
    return {key: jnp.asarray(value) for key, value in data.items()}


def local_strains(unknowns, element, layers, metric):
    """Strains (4, np, 5) at all layer points in local axes, transverse shears not yet scaled.

    Parameters
    ----------
    unknowns : (4, 5) displacements and rotations of the nodes
    """
    return strains_of_shape(shape(unknowns, element), element, layers, metric)


def shape(unknowns, element):
    """Positions and directors (4, 3) of the nodes."""
    d = jax.vmap(director)(unknowns[:, 3:5], element["director"], element["frame"])
    return element["x"] + unknowns[:, :3], d


def strains_of_shape(place, element, layers, metric):
    """`local_strains` from a `shape`; but for a constant a quadratic form of it."""
    x, d = place
    numbers = inplane_products(x, d) - element["products"]
    covariant = jnp.einsum("pij,j->pi", element["inplane"], numbers)
    c0, c1 = covariant[:, :3], covariant[:, 3:]
    edge = 0.25 * jnp.sum(
        (x[SHEAR_EDGES[:, 1]] - x[SHEAR_EDGES[:, 0]]) * (d[SHEAR_EDGES[:, 1]] + d[SHEAR_EDGES[:, 0]]), axis=1
    )
    shear = SHEAR_WEIGHTS * (edge - element["s0"])
    gamma = jnp.stack([shear[:, 0] + shear[:, 1], shear[:, 2] + shear[:, 3]], axis=1)
    t = element["h"] * (element if "zeta" in element else layers)["zeta"]
    membrane = jnp.einsum("pij,pj->pi", element["q"], c0)
    bending = jnp.einsum("pij,pj->pi", element["q"], c1) - jnp.einsum("pij,pj->pi", element["qk"], c0)
    plane = membrane[:, None] + t[None, :, None] * bending[:, None]
    across = jnp.broadcast_to(jnp.einsum("pac,pc->pa", element["p"], gamma)[:, None], plane.shape[:2] + (2,))
    if metric == SHIFTED:
        plane = jnp.einsum("plij,plj->pli", element["shift"], plane)
        across = jnp.einsum("plab,plb->pla", element["turn"], across)
    return jnp.concatenate([plane, across], axis=-1)


def inplane_products(x, d):
    """(12,): the six products of positions and their change along the directors, both (4, 3); see `assumed_strain`."""
    u, v = VECTORS @ x, VECTORS @ d
    i, j = PAIRS.T
    products = FACTORS * jnp.sum(u[i] * u[j], axis=1)
    return jnp.concatenate([products, FACTORS * jnp.sum(u[i] * v[j] + v[i] * u[j], axis=1)])


def material_strains(strains, layers):
    """Turn local strains (..., np, 5) into the axes of each layer and scale the transverse shears."""
    c, s = layers["direction"][:, 0], layers["direction"][:, 1]
    e1, e2, e3, g1, g2 = (strains[..., i] for i in range(5))
    k = layers["shear"]
    return jnp.stack(
        [
            c * c * e1 + s * s * e2 + c * s * e3,
            s * s * e1 + c * c * e2 - c * s * e3,
            2 * c * s * (e2 - e1) + (c * c - s * s) * e3,
            k * (c * g1 + s * g2),
            k * (c * g2 - s * g1),
        ],
        axis=-1,
    )


def point_energies(kinds, parameters, strains):
    """Energy densities (..., np) of strains (..., np, 5); `kinds` is static, so each law is traced once, and only if it
    occurs.
    """
    kinds = np.asarray(kinds)
    parts, chosen = [], []
    for kind in np.unique(kinds):
        points = np.flatnonzero(kinds == kind)
        over_points = jax.vmap(_LAWS[int(kind)], in_axes=(0, 0))
        over_gauss = jax.vmap(over_points, in_axes=(None, 0))
        parts.append(over_gauss(parameters[points], strains[:, points]))
        chosen.append(points)
    return jnp.concatenate(parts, axis=1)[:, np.argsort(np.concatenate(chosen))]


def element_energy(kinds, metric, unknowns, element, layers):
    """Strain energy of one element, J.

    Parameters
    ----------
    kinds : tuple of int, static
        Law of each layer point.
    metric : str, static
    unknowns : (4, 5)
    element, layers : dict of arrays, see `element_arrays` and `section_arrays`
    """
    strains = material_strains(local_strains(unknowns, element, layers, metric), layers)
    return jnp.sum(point_volumes(metric, element, layers) * point_energies(kinds, layers["parameters"], strains))


def point_volumes(metric, element, layers):
    """Volumes (4, np) that the layer points of one element stand for, m3."""
    weight = element["h"] * element["area"][:, None] * (element if "zeta" in element else layers)["weight"]
    return weight if metric == FIRST_ORDER else weight * element["mu"]


def material_part(kinds, metric, unknowns, element, layers):
    """Part (20, 20) of the Hessian of `element_energy` by which strains change stresses, not that by which stresses
    turn.
    """
    strains, back = jax.linearize(
        lambda u: material_strains(local_strains(u, element, layers, metric), layers), unknowns
    )
    slope = jax.vmap(back)(jnp.eye(unknowns.size).reshape(-1, *unknowns.shape))
    weight = point_volumes(metric, element, layers)

    def stress(e):
        return jax.grad(lambda x: jnp.sum(weight * point_energies(kinds, layers["parameters"], x)))(e)

    change = jax.vmap(lambda direction: jax.jvp(stress, (strains,), (direction,))[1])(slope)
    return jnp.einsum("aple,bple->ab", slope, change)


class EnergyFunctions:
    """Compiled maps of the element energy and its derivatives over all elements of one mesh.

    The layer data are arguments of the compiled functions, not constants in them, so a change of material or thickness
    does not compile anew.
    """

    def __init__(
        self, mesh, geometry: ReferenceGeometry, section: Section, metric: str, assumed: AssumedStrains, points=None
    ):
        if metric not in METRICS:
            raise ValueError(f"The shell metric is '{metric}', but only {', '.join(map(repr, METRICS))} exist.")
        self.metric = metric
        self.kinds = tuple(int(kind) for kind in section.kinds)
        points = section.points if points is None else points
        self.elements = element_arrays(mesh, geometry, points, metric, assumed)
        self.layers = section_arrays(section)

    def energy(self, unknowns):
        """(ne,) energies from unknowns (ne, 4, 5)."""
        return _energies(self.kinds, self.metric, unknowns, self.elements, self.layers)

    def force(self, unknowns):
        """(ne, 20) gradients."""
        return _gradients(self.kinds, self.metric, unknowns, self.elements, self.layers)

    def tangent(self, unknowns):
        """(ne, 20, 20) Hessians."""
        return _hessians(self.kinds, self.metric, unknowns, self.elements, self.layers)

    def material_tangent(self, unknowns, share):
        """(ne, 20, 20): material part of the Hessians, each layer's by a factor; share (nl,)."""
        factor = jnp.repeat(jnp.asarray(share), len(self.kinds) // len(share))
        elements, layers = self.elements, self.layers | {"weight": self.layers["weight"] * factor}
        if "weight" in elements:
            elements = elements | {"weight": elements["weight"] * factor}
        return _materials(self.kinds, self.metric, unknowns, elements, layers)

    def second(self, unknowns, a, b):
        """(ne, 20): second directional derivative of the force along a and b (ne, 4, 5)."""
        return _second(self.kinds, self.metric, unknowns, a, b, self.elements, self.layers)

    def third(self, unknowns, a, b, c):
        """(ne, 20): third directional derivative of the force."""
        return _third(self.kinds, self.metric, unknowns, a, b, c, self.elements, self.layers)

    def strains(self, unknowns):
        """(ne, 4, np, 5): strains in the axes of the layers, shear correction not applied."""
        layers = self.layers | {"shear": jnp.ones_like(self.layers["shear"])}
        return _strains(self.kinds, self.metric, unknowns, self.elements, layers)


def _mapped(function):
    """Compile `function(kinds, metric, *unknowns, element, layers)` mapped over elements."""

    @partial(jax.jit, static_argnums=(0, 1))
    def run(kinds, metric, *arguments):
        *fields, elements, layers = arguments
        one = lambda *row: function(kinds, metric, *row, layers)  # noqa: E731
        return jax.vmap(one)(*fields, elements)

    return run


def _force(kinds, metric, unknowns, element, layers):
    return jax.grad(element_energy, argnums=2)(kinds, metric, unknowns, element, layers)


def _along(function, *directions):
    """Directional derivative of function(u) along each direction in turn."""
    for direction in directions:
        function = partial(lambda inner, v, u: jax.jvp(inner, (u,), (v,))[1], function, direction)
    return function


_energies = _mapped(element_energy)
_gradients = _mapped(lambda k, m, u, e, l: _force(k, m, u, e, l).ravel())
_hessians = _mapped(
    lambda k, m, u, e, l: jax.jacfwd(lambda v: _force(k, m, v, e, l).ravel())(u).reshape(u.size, u.size)
)
_materials = _mapped(material_part)
_second = _mapped(lambda k, m, u, a, b, e, l: _along(lambda v: _force(k, m, v, e, l).ravel(), a, b)(u))
_third = _mapped(lambda k, m, u, a, b, c, e, l: _along(lambda v: _force(k, m, v, e, l).ravel(), a, b, c)(u))
_strains = _mapped(lambda k, m, u, e, l: material_strains(local_strains(u, e, l, m), l))
