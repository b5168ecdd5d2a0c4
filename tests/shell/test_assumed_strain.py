"""The element's assumed in-plane strains: against textbook elements, and what they must keep whatever they assume."""

from __future__ import annotations

import numpy as np
import pytest

from dbvfiv.shell import Layer, Section, Shell, ShellMesh
from dbvfiv.shell.assumed_strain import ELEMENTS, MITC4, _enhancement, _tied, local_map, wall_at_rest
from tests.shell.structures import (
    CORNERS,
    distorted_plate,
    grid,
    isotropic_section,
    mixed_section,
    rectangle,
    single_element,
)


def textbook_stiffness(corners, plane, enhanced: int) -> np.ndarray:
    """(8, 8) stiffness of a bilinear plane element, unknowns x then y of each node, with the first of the four enhanced
    modes of Simo & Rifai (1990) condensed.
    """
    g = 1 / np.sqrt(3)
    signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])

    def jacobian(r, s):
        slope = 0.25 * np.stack([signs[:, 0] * (1 + signs[:, 1] * s), signs[:, 1] * (1 + signs[:, 0] * r)])
        return slope, slope @ corners  # rows: derivatives by r and s

    centre = jacobian(0, 0)[1]
    (a, b), (c, d) = np.linalg.inv(centre)
    # strains [11, 22, 2 12] in space from covariant ones, with the rows of J^-1 at the centre
    turn = np.array([[a * a, b * b, a * b], [c * c, d * d, c * d], [2 * a * c, 2 * b * d, a * d + b * c]])
    k, coupling, inner = np.zeros((8, 8)), np.zeros((enhanced, 8)), np.zeros((enhanced, enhanced))
    for r, s in g * signs:
        slope, jac = jacobian(r, s)
        det = np.linalg.det(jac)
        by_xy = np.linalg.solve(jac, slope)
        strain = np.zeros((3, 8))
        strain[0, 0::2], strain[1, 1::2] = by_xy[0], by_xy[1]
        strain[2, 0::2], strain[2, 1::2] = by_xy[1], by_xy[0]
        modes = np.linalg.det(centre) / det * turn @ np.array([[r, 0, 0, 0], [0, s, 0, 0], [0, 0, r, s]])
        modes = modes[:, :enhanced]
        k += det * strain.T @ plane @ strain
        coupling += det * modes.T @ plane @ strain
        inner += det * modes.T @ plane @ modes
    return k - coupling.T @ np.linalg.solve(inner, coupling) if enhanced else k


@pytest.mark.parametrize("element", ELEMENTS)
def test_flat_element_is_the_textbook_one(element):
    """In its plane a flat quadrilateral is the bilinear element, or the one of Simo and Rifai."""
    shell = Shell(single_element(), isotropic_section(1e6, 0.3, 0.01), element=element)
    stiffness = shell.dofs.matrix(shell.force_and_tangent(np.zeros(shell.size))[1]).toarray()
    own = stiffness.reshape(4, 5, 4, 5)[:, :2, :, :2].reshape(8, 8)
    plane = 1e6 / (1 - 0.09) * np.array([[1, 0.3, 0], [0.3, 1, 0], [0, 0, 0.35]])
    expected = 0.01 * textbook_stiffness(CORNERS, plane, 0 if element == MITC4 else 4)
    assert np.abs(own - expected).max() < 1e-12 * np.abs(expected).max()


@pytest.mark.parametrize("element", ELEMENTS)
def test_homogeneous_strains_of_any_size(element):
    """Stretched and sheared by half and turned: the strains of a distorted plate are those of the deformation."""
    mesh, _ = distorted_plate()
    shell = Shell(mesh, Section((Layer(mixed_section().layers[0].law, 0.01),)), element=element)
    gradient = np.array([[1.5, 0.4], [-0.1, 0.8]])
    nodal = np.zeros((mesh.node_count, 5))
    nodal[:, :2] = mesh.nodes[:, :2] @ (gradient - np.eye(2)).T
    green = 0.5 * (gradient.T @ gradient - np.eye(2))
    strain = shell.strains(shell.dofs.restrict(nodal))[..., :3]
    assert np.abs(strain - [green[0, 0], green[1, 1], 2 * green[0, 1]]).max() < 1e-13


def without_and_of_modes(shell):
    """In-plane maps (ne, 4, 6, 12) of the element without enhanced modes, and what these add to c0."""
    g, x = shell.geometry, shell.mesh.nodes[shell.mesh.quads]
    plain = np.zeros((len(x), 4, 6, 12))
    plain[:, :, :3, :6] = plain[:, :, 3:, 6:] = _tied(x, g.thickness)
    return plain, _enhancement(x, g, shell.section, plain)


def test_enhanced_modes_do_no_work_on_constant_stress(mesh):
    """The sum over an element of what the modes add to the strains in local axes vanishes, so patch tests hold."""
    shell = Shell(mesh, mixed_section())
    added = shell.geometry.q @ without_and_of_modes(shell)[1]
    total = np.einsum("ep,epik->eik", shell.geometry.area, added)
    size = np.einsum("ep,epik->eik", shell.geometry.area, np.abs(added))
    assert np.abs(total).max() < 1e-13 * size.max()


def test_enhancement_only_takes_stiffness_away():
    """Of a warped patch of a linear material: the modes lie at their least energy."""
    patch = grid(4, 6, lambda u, v: (0.4 * u, 0.5 * v + 0.05 * u**2, 0.4 * (u - 0.3) * (v - 0.6) + 0.1 * u**2))
    mesh = ShellMesh.build(patch.nodes, patch.quads, 0.012, material_axis=(0.3, 1.0, 0.1))
    shell = Shell(mesh, isotropic_section(1e6, 0.4, 0.012))
    plain, modes = without_and_of_modes(shell)
    rich = plain.copy()
    rich[:, :, :3] += modes
    strains = [local_map(shell.geometry) @ part for part in (plain, rich)]
    wall = wall_at_rest(shell.section, shell.geometry.thickness)
    k = [np.einsum("ep,epia,eij,epjb->eab", shell.geometry.area, e, wall, e) for e in strains]
    taken = np.linalg.eigvalsh(k[0] - k[1])
    size = np.abs(k[0]).max(axis=(1, 2))
    assert np.all(taken[:, 0] > -1e-10 * size)
    assert np.all(taken[:, -1] > 1e-3 * size)


def test_no_buckling_by_itself_under_pressure_along_short_sides():
    """Slender elements pressed by 20 % along their short sides, held in their plane, stay stable (Sussman & Bathe 2014
    show that enhanced elements with the squared hourglass strain do not).
    """
    patch = rectangle(24, 2, 1.0, 0.5)  # elements 0.042 by 0.25
    mesh = ShellMesh.build(patch.nodes, patch.quads, 0.01, material_axis=(1.0, 0, 0))
    free = np.ones((mesh.node_count, 5), bool)
    free[:, 2:] = False
    free[np.ix_(np.concatenate([patch.index[0], patch.index[-1]]), [0])] = False
    free[patch.index[[0, -1], 0], 1] = False
    section = isotropic_section(1e6, 0.0, 0.01)
    nodal = np.zeros((mesh.node_count, 5))
    nodal[:, 0] = -0.2 * mesh.nodes[:, 0]
    held = Shell(mesh, section)
    data = held.force_and_tangent(held.dofs.restrict(nodal))[1]
    keep = free.ravel()
    matrix = held.dofs.matrix(data).toarray()[np.ix_(keep, keep)]
    # the strip as a beam of stiffness EI = E h w^3 / 12 buckles at 4 pi^2 EI / L^2 between ends that do not turn:
    # 4 pi^2 / 12 w^2 = 0.82 of E h w, far above 0.2
    assert np.linalg.eigvalsh(matrix)[0] > 0


def test_unknown_element_is_refused():
    patch = rectangle(1, 1, 1.0, 1.0)
    mesh = ShellMesh.build(patch.nodes, patch.quads, 0.01, material_axis=(1.0, 0, 0))
    with pytest.raises(ValueError, match="The element is 'S4R'"):
        Shell(mesh, isotropic_section(1e6, 0.0, 0.01), element="S4R")
