"""Faces of the wall, the skin of the whole valve, and how much of a motion travels."""

import numpy as np
import pytest

from dbvfiv.drawing.views import ValveSkin, offset_line
from dbvfiv.record.vtkhdf import faces
from dbvfiv.shell.mesh import nodal_thickness
from dbvfiv.studies.modes.figures import wave_content
from dbvfiv.studies.modes.search import drawn_amplitude


def test_the_faces_lie_a_wall_apart_and_a_closed_lip_shows_no_slot(coarse_run):
    mesh = coarse_run.mesh
    inner, outer = faces(mesh)
    assert np.allclose(np.linalg.norm(outer - inner, axis=1), nodal_thickness(mesh))
    lip = mesh.rows[0, 0]
    # mid-surface at 6.19 mm, wall 12 mm (App. A)
    assert inner[lip, 1] == pytest.approx(0.19e-3, abs=1e-6) and outer[lip, 1] == pytest.approx(12.19e-3, abs=1e-6)


def test_faces_turn_with_the_directors(coarse_run):
    mesh, state = coarse_run.mesh, coarse_run.states[-1]
    inner, outer = faces(mesh, state.nodal)
    assert np.allclose(np.linalg.norm(outer - inner, axis=1), nodal_thickness(mesh))
    assert np.allclose(0.5 * (outer + inner), mesh.nodes + state.nodal[:, :3])
    turned = (outer - inner) / nodal_thickness(mesh)[:, None]
    angle = np.degrees(np.arccos(np.clip(np.sum(turned * mesh.directors, axis=1), -1, 1)))
    assert angle.max() > 20  # at the highest pressure the wall bends by that much
    # in the plane x = 0 the normal of the deformed line is the director but for shear
    line = mesh.rows[:, 0]
    middle = mesh.nodes[line] + state.nodal[line, :3]
    z, y = offset_line(middle[:, 2], middle[:, 1], -0.5 * nodal_thickness(mesh)[line])
    assert np.abs(y - inner[line, 1]).max() < 1.5e-3 and np.abs(z - inner[line, 2]).max() < 2.5e-3


def test_the_skin_is_a_closed_surface_of_four_quarters(coarse_run):
    skin = ValveSkin.of(coarse_run.mesh)
    edges = np.concatenate([skin.quads[:, [i, (i + 1) % 4]] for i in range(4)])
    _, often = np.unique(np.sort(edges, axis=1), axis=0, return_counts=True)
    assert (often == 2).all()
    points = skin.points(coarse_run.states[0].nodal)
    for axis in (0, 1):
        assert points[:, axis].max() == pytest.approx(-points[:, axis].min())
    assert skin.means(np.ones(len(coarse_run.mesh.nodes))) == pytest.approx(1.0)


def test_standing_and_travelling_waves_are_told_apart():
    z = np.linspace(0.0, 1.0, 41) ** 1.3
    standing = np.sin(7 * z) * np.exp(0.4j)
    assert wave_content(standing, z).travelling == pytest.approx(0, abs=1e-12)
    assert wave_content(standing, z).words().endswith("0 %: a standing wave")
    to_lip, from_lip = np.exp(12j * np.pi * z), np.exp(-12j * np.pi * z)
    assert wave_content(to_lip, z).travelling == pytest.approx(1, abs=0.1)
    assert "travels downstream, to the lip" in wave_content(to_lip, z).words()
    assert "travels upstream, from the lip" in wave_content(from_lip, z).words()
    both = wave_content(to_lip + 0.5 * from_lip, z)  # semi-axes 1.5 and 0.5
    assert both.travelling == pytest.approx(1 / 3, abs=0.05) and both.words().startswith("travelling share 3")
    assert "partly standing" in both.words() and both.towards_start


def test_modes_are_drawn_without_lips_that_cross(coarse_run):
    state, drawn = coarse_run.states[0], 0
    for mode in state.modes(count=3, density=10, alpha=0).modes:
        amplitude = drawn_amplitude(state, mode)
        line = coarse_run.mesh.rows[:, 0]
        if amplitude > 0.11 * 0.035 * np.ptp(coarse_run.mesh.z):
            drawn += 1
            for phase in np.linspace(0, 2 * np.pi, 12):
                moved = faces(coarse_run.mesh, state.nodal + amplitude * mode.at_phase(phase))[0]
                assert moved[line, 1].min() > -0.5e-3
    assert drawn
