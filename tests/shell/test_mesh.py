"""Directors, frames, reference geometry and the errors of a mesh."""

from __future__ import annotations

import numpy as np
import pytest

from dbvfiv.materials.laws import IsotropicElastic
from dbvfiv.shell import DofMap, Layer, Section, Shell, ShellMesh
from dbvfiv.shell.reference import reference_geometry, thickness_over_radius
from tests.shell.structures import grid, isotropic_section, rectangle


def arc(count: int, radius: float = 0.1) -> ShellMesh:
    patch = grid(count, 2, lambda u, v: (radius * np.cos(2 * u), radius * np.sin(2 * u), 0.2 * v))
    return ShellMesh.build(patch.nodes, patch.quads, 0.02)


def test_directors_point_to_the_side_from_which_elements_run_counter_clockwise():
    patch = rectangle(2, 2, 1.0, 1.0)
    mesh = ShellMesh.build(patch.nodes, patch.quads, 0.1, material_axis=(1, 0, 0))
    assert np.allclose(mesh.directors, [0, 0, 1])
    assert np.allclose(mesh.frames, [[[1, 0, 0], [0, 1, 0]]] * 9)


def test_frames_are_orthonormal_and_right_handed(mesh):
    triad = np.concatenate([mesh.frames, mesh.directors[:, None]], axis=1)
    assert np.allclose(triad @ triad.transpose(0, 2, 1), np.eye(3), atol=1e-14)
    assert np.allclose(np.linalg.det(triad), 1.0)


def test_frames_where_the_axis_pierces_the_wall():
    patch = rectangle(2, 2, 1.0, 1.0)
    mesh = ShellMesh.build(patch.nodes, patch.quads, 0.1, frame_axis=(0, 0, 1), material_axis=(1, 0, 0))
    triad = np.concatenate([mesh.frames, mesh.directors[:, None]], axis=1)
    assert np.allclose(triad @ triad.transpose(0, 2, 1), np.eye(3), atol=1e-14)


def test_symmetry_planes_hold_the_directors():
    patch = grid(4, 2, lambda u, v: (0.1 * np.sin(1.5 * u), 0.1 * np.cos(1.5 * u), 0.2 * v))
    mesh = ShellMesh.build(patch.nodes, patch.quads, 0.02, planes=[(patch.index[0], 0)])
    assert np.all(mesh.directors[patch.index[0], 0] == 0.0)


def test_curvature_and_area_of_a_cylinder():
    """Nodes and averaged directors turn alike, so the curvature is exact inside; the area misses by the square of the
    element size.
    """
    errors = []
    for count in (10, 20, 40):
        geometry = reference_geometry(arc(count))
        inner = thickness_over_radius(geometry)[
            2:-2
        ]  # without the ends, where the directors of a free edge are one-sided
        assert np.allclose(inner, 0.1, rtol=1e-12)
        errors.append(abs(geometry.area.sum() - 0.1 * 2 * 0.2))
    assert errors[-1] < 5e-6
    for coarse, fine in zip(errors[:-1], errors[1:]):
        assert np.log2(coarse / fine) == pytest.approx(2.0, abs=0.1)


def test_folded_places_are_found():
    shell = Shell(arc(20, 0.1), isotropic_section(1e6, 0.3, 0.02))
    assert len(shell.folded_places()) == 0
    tight = Shell(arc(20, 0.009), isotropic_section(1e6, 0.3, 0.02))
    assert len(tight.folded_places()) == 4 * (
        40 - 4
    )  # all but the ends, where the directors of a free edge are one-sided


def test_unknown_metric_is_refused():
    shell = Shell(arc(4), isotropic_section(1e6, 0.3, 0.02), metric="exact")
    with pytest.raises(ValueError, match="'exact'"):
        shell.force(np.zeros(shell.size))


def test_thickness_of_the_wrong_shape():
    patch = rectangle(2, 2, 1.0, 1.0)
    with pytest.raises(ValueError):
        ShellMesh.build(patch.nodes, patch.quads, np.ones(3), material_axis=(1, 0, 0))


def test_degenerate_element_is_named():
    patch = rectangle(2, 2, 1.0, 1.0)
    patch.nodes[patch.index[0, 0]] = patch.nodes[patch.index[0, 1]]
    with pytest.raises(ValueError, match="Element 0 is degenerate"):
        ShellMesh.build(patch.nodes, patch.quads, 0.1, material_axis=(1, 0, 0))


def test_material_axis_normal_to_the_wall_is_refused():
    patch = rectangle(2, 2, 1.0, 1.0)
    mesh = ShellMesh.build(patch.nodes, patch.quads, 0.1, material_axis=(0, 0, 1), frame_axis=(1, 0, 0))
    with pytest.raises(ValueError, match="stands normal to element"):
        Shell(mesh, isotropic_section(1e6, 0.3, 0.1))


def test_section_refuses_nonsense():
    law = IsotropicElastic(1e6, 0.3, 1.0)
    for layers, points in (((), 2), ((Layer(law, 0.0),), 2), ((Layer(law, 1.0),), 0)):
        with pytest.raises(ValueError):
            Section(layers, points)


def test_degrees_of_freedom_round_trip():
    free = np.ones((9, 5), bool)
    free[0], free[3, 2] = False, False
    dofs = DofMap(free, rectangle(2, 2, 1, 1).quads)
    q = np.arange(1.0, dofs.size + 1)
    full = dofs.expand(q)
    assert dofs.size == 45 - 6 and full[3, 2] == 0.0 and np.all(full[0] == 0.0)
    assert np.array_equal(dofs.restrict(full), q)
    indptr, indices = dofs.pattern
    rows = np.repeat(np.arange(dofs.size), np.diff(indptr))
    assert np.array_equal(rows[dofs.diagonal_slots], indices[dofs.diagonal_slots])
    assert np.array_equal(rows[dofs.diagonal_slots], np.arange(dofs.size))
