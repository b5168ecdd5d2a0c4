"""Meshes of the flow domain: sound at all openings, closed by their patches, of the volume of what they stand for."""

import numpy as np
import pytest

from dbvfiv.cfd.domain import PATCHES
from dbvfiv.cfd.foam import FlowCase, faces_of
from dbvfiv.errors import CaseError
from dbvfiv.exchange.bodies import shape_of
from dbvfiv.exchange.files import triangulated


def flow_case(state, pipe=0.33, fineness=0.35):
    return FlowCase("dbv12", state.results.mesh, state, 1000.0, pipe, fineness)


@pytest.mark.parametrize("number", [0, 1, 2])
@pytest.mark.parametrize("pipe", [0.33, None])
def test_cells_are_sound_and_fill_the_domain(coarse_run, number, pipe):
    case = flow_case(coarse_run.states[number], pipe)
    mesh, domain = case.cells, case.domain
    assert mesh.corner_volumes().min() > 0
    passage = (mesh.station >= domain.lip) & (mesh.station < domain.flange) & (mesh.part < 2)
    fluid = triangulated(shape_of(case.faces, "fluid", whole=False))
    assert mesh.volumes[passage].sum() == pytest.approx(fluid.volume, rel=0.025)  # chords of a coarse mesh
    pipe_volume = 0.25 * np.pi * domain.radius**2 * (domain.rows[0] - domain.stations[0])
    assert mesh.volumes[mesh.station < domain.lip].sum() == pytest.approx(pipe_volume, rel=0.02)


def test_patches_lie_where_their_names_say(coarse_run):
    case = flow_case(coarse_run.states[1])
    mesh, domain = case.cells, case.domain
    middle = {name: mesh.points[quads].mean(axis=1) for name, quads in mesh.patches.items()}
    assert set(middle) == set(PATCHES)
    assert np.all(middle["centre"][:, 0] == 0) and np.all(middle["side"][:, 1] == 0)
    assert np.allclose(middle["inlet"][:, 2], domain.stations[-1])
    assert np.allclose(middle["outlet"][:, 2], domain.stations[0])
    assert np.allclose(np.hypot(*mesh.points[mesh.patches["downstream"]][..., :2].reshape(-1, 2).T), 0.165)
    assert np.allclose(middle["flange"][:, 2], domain.rows[-1])
    # every wall node of the passage lies on the inner face, but for those that close its tip
    x, y, z = mesh.points[np.unique(mesh.patches["inner"])].T
    tall = y > 0.1 * np.interp(z, domain.rows, case.faces.inner[:, 0, 1])
    row = np.searchsorted(domain.rows, np.clip(z, domain.rows[0], domain.rows[-1] - 1e-9), side="right") - 1
    for k in np.unique(row[tall])[::3]:
        ours = np.flatnonzero(tall & (row == k))
        low, high = (case.faces.inner[j] for j in (k, k + 1))
        bounds = np.sort([np.interp(x[ours], f[:, 0], f[:, 1]) for f in (low, high)], axis=0)
        assert np.all(y[ours] > bounds[0] - 2e-3) and np.all(y[ours] < bounds[1] + 2e-3)


def test_faces_are_in_the_order_that_openfoam_wants(coarse_run):
    mesh = flow_case(coarse_run.states[2]).cells
    faces, owner, neighbour, patches = faces_of(mesh)
    inner = len(neighbour)
    assert np.all(owner[:inner] < neighbour)
    assert np.all(np.diff(owner[:inner] * len(mesh.cells) + neighbour) > 0)
    assert [name for name, *_ in patches] == list(PATCHES)
    assert patches[0][1] == inner and sum(count for *_, count in patches) == len(faces) - inner
    # area vectors of each cell, those of its lower side turned round, add up to nothing
    p = mesh.points[faces]
    area = 0.5 * np.cross(p[:, 2] - p[:, 0], p[:, 3] - p[:, 1])
    total = np.zeros((len(mesh.cells), 3))
    np.add.at(total, owner, area)
    np.add.at(total, neighbour, -area[:inner])
    assert np.abs(total).max() < 1e-15
    outwards = np.einsum("fi,fi->f", area, p.mean(axis=1) - mesh.centres[owner])
    assert outwards.min() > 0


@pytest.mark.slow
@pytest.mark.parametrize("fineness", [0.3, 0.7, 1.0])
def test_meshes_of_many_openings_are_sound(coarse_valve, fineness):
    states = coarse_valve.steady(pressure=[1e3, 2e3, 4e3, 9e3, 14e3, 25e3, 50e3]).states
    for state in states:
        for pipe in (0.31, 0.33, 0.5, None):
            assert flow_case(state, pipe, fineness).cells.corner_volumes().min() > 0


def test_a_pipe_that_is_too_narrow_is_a_sentence(coarse_run, refused):
    with refused(CaseError) as caught:
        _ = flow_case(coarse_run.states[2], 0.28).domain
    assert "at least" in str(caught.value)
