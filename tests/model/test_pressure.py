"""Follower pressure: force, stiffness, columns of unit pressures, and which elements carry it."""

from __future__ import annotations

import numpy as np
import pytest

from dbvfiv.shell import Shell, ShellMesh
from dbvfiv.shell.pressure import pressure_force, pressure_stiffness
from tests.shell.structures import grid, isotropic_section


def patch_shell(held: str) -> Shell:
    patch = grid(5, 4, lambda u, v: (0.5 * u, 0.4 * v + 0.05 * u, 0.1 * np.sin(2 * u) + 0.1 * v**2))
    free = np.ones((len(patch.nodes), 5), bool)
    edges = {"left": patch.index[0], "right": patch.index[-1], "front": patch.index[:, 0], "back": patch.index[:, -1]}
    for name, nodes in edges.items():
        if held == "all" or name == held:
            free[nodes, :3] = False
    return Shell(
        ShellMesh.build(patch.nodes, patch.quads, 0.01, material_axis=(1.0, 0, 0)),
        isotropic_section(1e6, 0.3, 0.01),
        free,
    )


def force(shell, q, nodal_pressure, loaded):
    out = np.zeros((shell.mesh.node_count, 5))
    pressure_force(shell.mesh.quads, shell.mesh.nodes, shell.dofs.expand(q), nodal_pressure, loaded, out)
    return shell.dofs.restrict(out)


def stiffness(shell, q, nodal_pressure, loaded):
    data = np.zeros(len(shell.dofs.pattern[1]))
    slots = shell.dofs.slots
    pressure_stiffness(
        shell.mesh.quads, shell.mesh.nodes, shell.dofs.expand(q), nodal_pressure, loaded, slots, 1.0, data
    )
    return shell.dofs.matrix(data)


def state(shell, seed=0):
    return 0.02 * np.random.default_rng(seed).standard_normal(shell.size)


@pytest.mark.parametrize("held", ["all", "left"])
def test_stiffness_against_differences(held):
    """The force is quadratic in the positions, so a central difference is exact."""
    shell = patch_shell(held)
    q, direction = state(shell), state(shell, 1)
    pressure = 1e3 * np.random.default_rng(2).uniform(0.5, 1.5, shell.mesh.node_count)
    loaded = np.random.default_rng(3).uniform(0, 1, shell.mesh.element_count)
    loaded[3] = 0.0
    slope = (force(shell, q + direction, pressure, loaded) - force(shell, q - direction, pressure, loaded)) / 2
    product = stiffness(shell, q, pressure, loaded) @ direction
    assert np.linalg.norm(product - slope) < 1e-12 * np.linalg.norm(slope)


def test_uniform_pressure_is_conservative_when_all_edges_are_held():
    shell = patch_shell("all")
    one = np.ones(shell.mesh.node_count), np.ones(shell.mesh.element_count)
    matrix = stiffness(shell, state(shell), *one)
    assert abs(matrix - matrix.T).max() < 1e-12 * abs(matrix).max()


def test_a_free_edge_makes_the_stiffness_unsymmetric():
    shell = patch_shell("left")
    one = np.ones(shell.mesh.node_count), np.ones(shell.mesh.element_count)
    matrix = stiffness(shell, state(shell), *one)
    assert abs(matrix - matrix.T).max() > 0.1 * abs(matrix).max()


def test_pressure_on_a_closed_surface_has_no_resultant():
    """All of a sphere cut open along one meridian but joined node by node: forces and moments cancel whatever the
    shape.
    """
    n = 8
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, n + 1)[:-1], np.linspace(0.4, np.pi - 0.4, n + 1), indexing="ij")
    nodes = np.stack([np.sin(v) * np.cos(u), np.sin(v) * np.sin(u), np.cos(v)], axis=-1).reshape(-1, 3)
    index = np.arange(n * (n + 1)).reshape(n, n + 1)
    following = np.roll(index, -1, axis=0)
    quads = (
        np.stack([index[:, :-1], index[:, 1:], following[:, 1:], following[:, :-1]], axis=-1)
        .reshape(-1, 4)
        .astype(np.int32)
    )
    q = np.zeros((len(nodes), 5))
    q[:, :3] = 0.05 * np.random.default_rng(1).standard_normal(nodes.shape)
    out = np.zeros_like(q)
    pressure_force(quads, nodes, q, np.ones(len(nodes)), np.ones(len(quads)), out)
    # the two open rims carry what the caps would: the resultant is that of the flat-fanned caps turned inside out
    place = nodes + q[:, :3]
    caps = np.zeros(3)
    for rim, sign in ((index[:, 0], -1.0), (index[:, -1], 1.0)):
        ring = place[rim]
        caps += sign * 0.5 * np.cross(ring, np.roll(ring, -1, axis=0)).sum(axis=0)
    total = out[:, :3].sum(axis=0)
    assert np.abs(total - caps).max() < 1e-12
    assert np.abs(total).max() > 1e-3


def test_unit_columns_sum_to_the_force(model, make_state):
    q = make_state(model, 0.02)
    nodal = model.nodal(q)
    p = 1e3 * np.random.default_rng(0).uniform(0, 1, model.stations)
    expected = model.pressure_force(nodal, p)
    assert np.allclose(model.station_forces(nodal) @ p, expected, rtol=0, atol=1e-13 * np.abs(expected).max())


def test_side_edge_of_the_duckbill_is_unloaded(make_model):
    """Nothing on the last 3 of 28 columns beside the side edge of the duckbill (App. A), the same width on any mesh."""
    model = make_model(mesh__around=28, mesh__along=12, mesh__columns="uniform")
    loaded = model.loaded.reshape(12, 28)
    duckbill = model.mesh.element_z.reshape(12, 28)[:, 0] < 0.21
    assert np.all(loaded[~duckbill] == 1.0)
    assert np.all(loaded[duckbill, :25] == 1.0) and np.all(loaded[duckbill, 25:] == 0.0)
    halves = make_model(mesh__around=14, mesh__along=12, mesh__columns="uniform").loaded.reshape(12, 14)[0]
    assert halves == pytest.approx([1.0] * 12 + [0.5, 0.0], abs=1e-12)
    for around in (7, 14, 30):  # a column of nodes on the edge: no element is loaded in part
        model = make_model(mesh__around=around, mesh__along=12, mesh__columns="graded")
        loaded = model.loaded.reshape(12, around)[0]
        assert set(loaded) == {0.0, 1.0}
        assert model.mesh.columns[np.count_nonzero(loaded)] == pytest.approx(25 / 28, abs=1e-14)
