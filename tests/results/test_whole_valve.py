"""Four mirror images of the quarter: joined without gaps, oriented outwards, symmetric."""

import numpy as np

from dbvfiv.record.mesh import WholeValve
from dbvfiv.record.vtkhdf import motion


def _normals(points, quads):
    corners = points[quads]
    return 0.5 * np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])


def test_joined_and_oriented(coarse_run):
    mesh = coarse_run.mesh
    whole, quarter = WholeValve.of(mesh), WholeValve.of(mesh, quarter=True)
    assert len(quarter.points) == len(mesh.nodes) and np.array_equal(quarter.quads, mesh.quads)
    assert len(np.unique(np.round(whole.points, 9), axis=0)) == len(whole.points) == 32 * 17
    edges = np.sort(np.stack([whole.quads, np.roll(whole.quads, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    _, uses = np.unique(edges, axis=0, return_counts=True)
    assert np.count_nonzero(uses == 1) == 2 * 32 and uses.max() == 2  # open at lip and flange only
    centres = whole.points[whole.quads].mean(axis=1)
    outwards = np.einsum("ni,ni->n", _normals(whole.points, whole.quads)[:, :2], centres[:, :2])
    assert (outwards > 0).all()
    assert np.allclose(_normals(whole.points, whole.quads).sum(axis=0)[:2], 0, atol=1e-12)


def test_motion_is_symmetric_and_turns_the_directors(coarse_run):
    state = coarse_run.states[-1]
    whole = WholeValve.of(coarse_run.mesh)
    fields = motion(coarse_run.mesh, whole, state.nodal)
    assert np.allclose(fields["displacement"][:, :2].sum(axis=0), 0, atol=1e-12)
    directors, _, _ = coarse_run.model.shell.directors(state.nodal)
    assert np.allclose(fields["director"], whole.vectors(directors), atol=1e-12)
    # a mirror image turns the other way about axes in the plane of the mirror
    across = whole.sign[:, 0] * whole.sign[:, 1]
    rest = coarse_run.mesh.directors[whole.node] * whole.sign
    expected = np.cross(rest, fields["director"])
    angle = np.linalg.norm(fields["rotation"], axis=1)
    assert np.allclose(expected, fields["rotation"] * np.sinc(angle / np.pi)[:, None], atol=1e-12)
    assert set(across) == {1.0, -1.0}
