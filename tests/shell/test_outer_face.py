"""The outer face: its places, and the volumes it sweeps against differences of the volume beneath it."""

from __future__ import annotations

import numpy as np

from dbvfiv.shell.pressure import OuterFace
from tests.small_valves import find_open_state, make_valve


def beneath(place: np.ndarray, quads: np.ndarray) -> np.ndarray:
    """Volume between each bilinear quadrilateral and the origin, as a sum over Gauss points of x . n dA / 3."""
    a = 1.0 / np.sqrt(3.0)
    total = np.zeros(len(quads))
    for s in (-a, a):
        for t in (-a, a):
            shape = 0.25 * np.array([(1 - s) * (1 - t), (1 + s) * (1 - t), (1 + s) * (1 + t), (1 - s) * (1 + t)])
            along = 0.25 * np.array([-(1 - t), 1 - t, 1 + t, -(1 + t)])
            across = 0.25 * np.array([-(1 - s), -(1 + s), 1 + s, 1 - s])
            x, g, h = (np.einsum("a,eai->ei", w, place[quads]) for w in (shape, along, across))
            total += np.einsum("ei,ei->e", x, np.cross(g, h)) / 3.0
    return total


def test_fluxes_of_an_inner_patch_are_rates_of_the_volume_beneath():
    """Summed over a patch whose rim stands still they are the derivative of the volume under the patch."""
    model = make_valve()
    face, mesh = OuterFace(model.shell), model.shell.mesh
    q = find_open_state().copy()
    rows, columns = model.mesh.rows[2:6], slice(1, 5)
    inside = rows[:, columns].ravel()
    way = np.zeros((mesh.node_count, 5))
    way[inside] = np.random.default_rng(3).standard_normal((len(inside), 5)) * [1e-3, 1e-3, 1e-3, 1e-1, 1e-1]
    way = model.shell.dofs.restrict(way * model.shell.dofs.free)
    volume = lambda x: beneath(face.points(model.nodal(x))[0], mesh.quads).sum()  # noqa: E731
    step = 1e-4
    rate = (volume(q + step * way) - volume(q - step * way)) / (2 * step)
    found = face.fluxes(model.nodal(q)) @ way
    np.testing.assert_allclose(found.sum(), rate, rtol=1e-6)
    touched = np.isin(mesh.quads, inside).any(axis=1)
    assert not np.any(found[~touched])


def test_the_face_lies_half_a_wall_outside():
    model = make_valve()
    face = OuterFace(model.shell)
    rest = model.nodal(model.rest())
    points, directors = face.points(rest)
    out = np.einsum("ni,ni->n", points - model.shell.mesh.nodes, directors)
    np.testing.assert_allclose(out, face.half_wall)
    radius = np.hypot(*points[model.mesh.rows[-1], :2].T)
    np.testing.assert_allclose(radius, 0.13919 + 0.008, rtol=2e-3)
    assert np.all(points[model.mesh.rows[:, -1], 1] < 1e-12) and np.all(points[model.mesh.rows[:, 0], 0] < 1e-12)
