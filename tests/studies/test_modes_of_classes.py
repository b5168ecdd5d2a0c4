"""Modes in the four classes of motion: result, file, certificates, figures, ParaView."""

from __future__ import annotations

import json

import numpy as np
import pytest

import dbvfiv
from dbvfiv.case.parameters import Mu
from dbvfiv.drawing.views import ValveSkin
from dbvfiv.errors import CaseError
from dbvfiv.model.classes import linearise_class
from dbvfiv.model.symmetry import SYMMETRIES
from dbvfiv.record.mesh import WholeValve
from dbvfiv.studies.modes.figures import ModeSurface
from tests.small_valves import find_open_state, make_valve

FLUTTER = {"density": 10, "alpha": 0}


@pytest.fixture(scope="module")
def four(coarse_run):
    return coarse_run.states[0].modes(count=3, symmetry="all", **FLUTTER)


@pytest.mark.slow
def test_all_classes_are_listed_by_growth_rate(four, coarse_run):
    assert {mode.symmetry for mode in four.modes} == set(SYMMETRIES)
    growth = [mode.growth_rate for mode in four.modes]
    assert growth == sorted(growth, reverse=True) and [m.number for m in four.modes] == list(range(1, len(growth) + 1))
    for name in SYMMETRIES:
        alone = coarse_run.states[0].modes(count=3, symmetry=name, **FLUTTER)
        ours = [mode for mode in four.modes if mode.symmetry == name]
        assert [m.eigenvalue for m in ours] == pytest.approx([m.eigenvalue for m in alone.modes], rel=1e-9)
        assert alone.certificate.agrees, alone.certificate.statement
        for mode, other in zip(ours, alone.modes, strict=True):
            assert np.array_equal(mode.shape, other.shape)


def test_the_default_is_the_symmetric_class(four, coarse_run):
    default = coarse_run.states[0].modes(count=3, **FLUTTER)
    assert {mode.symmetry for mode in default.modes} == {"SS"}
    assert [m.eigenvalue for m in default.modes] == [m.eigenvalue for m in four.modes if m.symmetry == "SS"]


def test_counts_are_sums_over_the_classes(four):
    said = json.loads(json.dumps(four.summary()))
    assert [part["symmetry"] for part in said["classes"]] == list(SYMMETRIES)
    for name in ("unstable_count", "unstable_count_independent"):
        assert said[name] == sum(part[name] for part in said["classes"])
    assert said["unstable_count"] == 2 and said["stable"] is False
    assert said["certificate"]["agrees"] and all(part["certificate"]["agrees"] for part in said["classes"])
    assert all(mode["symmetry"] in SYMMETRIES for mode in said["modes"])


def test_no_area_changes_but_in_the_symmetric_class(four):
    for mode in four.modes:
        moved = np.abs(mode.area).max() + np.abs(mode.pressure).max() + abs(mode.inlet_velocity)
        assert (moved > 0) == (mode.symmetry == "SS")


def test_they_come_back_from_a_file(four, tmp_path):
    stored = dbvfiv.load_result(four.save(tmp_path / "modes.h5"))
    assert stored.summary() == four.summary() and stored.lines() == four.lines()
    for name, certificate in four.certificates.items():
        assert np.array_equal(stored.certificates[name].phase, certificate.phase)
    assert "alone" not in four.sentence
    assert "class" in four.lines()[0] and any("sway together in y" in line for line in four.lines())


@pytest.mark.parametrize("name", list(SYMMETRIES))
def test_pictures_of_the_whole_valve_have_the_signs_of_the_class(four, name):
    mode = next(mode for mode in four.modes if mode.symmetry == name)
    skin = ValveSkin.of(four.mesh)
    surface = ModeSurface(four, mode, skin)
    still = skin.corners(four.state.nodal)[:, :, [2, 0, 1]] * 1e3
    moved = surface.corners(0.7) - still
    for axis, sign in zip((1, 2), SYMMETRIES[name].signs):  # drawn as z, x, y
        mirror = np.ones(3)
        mirror[axis] = -1
        key = lambda points: np.lexsort(np.round(points, 6).T)  # noqa: E731
        centres, motion = still.mean(axis=1), moved.mean(axis=1)
        there, back = key(centres), key(centres * mirror)
        assert centres[there] == pytest.approx((centres * mirror)[back], abs=1e-6)
        # rotations are finite, so a motion about a bent state mirrors to second order of the amplitude only
        image = sign * (motion * mirror)[back]
        if sign > 0:
            assert motion[there] == pytest.approx(image, abs=1e-6)
        else:
            assert np.abs(motion[there] - image).max() < 0.2 * np.abs(motion).max()


def test_paraview_sees_one_continuous_valve(four):
    valve = WholeValve.of(four.mesh)
    for number, step in enumerate(four.steps(valve)):
        mode = four.modes[number]
        shape = step.point_data["mode_real"] + 1j * step.point_data["mode_imag"]
        lip = np.isclose(valve.points[:, 2], 0) & np.isclose(valve.points[:, 0], 0)
        up, down = (shape[lip & (side * valve.points[:, 1] > 0)][0] for side in (1, -1))
        sign = SYMMETRIES[mode.symmetry].signs[1]
        assert np.allclose(sign * up * [1, -1, 1], down)
        edges = np.concatenate([valve.quads[:, [i, (i + 1) % 4]] for i in range(4)])
        jumps = np.abs(shape[edges[:, 0]] - shape[edges[:, 1]]).max()
        quarter = np.concatenate([four.mesh.quads[:, [i, (i + 1) % 4]] for i in range(4)])
        within = np.abs(mode.shape[quarter[:, 0], :3] - mode.shape[quarter[:, 1], :3]).max()
        assert jumps < within * (1 + 1e-9)
    cycle = four.steps(valve, mode=next(m.number for m in four.modes if m.symmetry == "SA"), phases=4)
    lip = np.isclose(valve.points[:, 2], 0) & np.isclose(valve.points[:, 0], 0)
    moved = cycle[0].point_data["displacement"][lip, 1]
    assert abs(moved.sum()) > 0.3 * np.abs(cycle[0].point_data["oscillation"][lip, 1]).sum()


def test_every_class_has_its_figures(four):
    drawers = four.drawers()
    assert {"mode-shapes", "winding", "winding-SA", "winding-AS", "winding-AA"} <= set(drawers)
    lines = {name for name in drawers if name.startswith("centre-line")}
    leading = [mode for mode in four.modes[:3] if SYMMETRIES[mode.symmetry].signs[0] > 0]
    assert lines == {f"centre-line-{mode.number}" for mode in leading}
    assert "in class SA" in drawers["winding-SA"]().axes[0].get_title(loc="left")
    assert four.verdict.outcome == "flutters"
    for name, certificate in four.certificates.items():
        said = drawers["winding" if name == "SS" else f"winding-{name}"]().get_supxlabel()
        assert said.startswith("Flutters" if certificate.unstable_count else "Stable"), said


def test_both_laws_are_for_the_symmetric_class(coarse_valve, refused):
    with refused(CaseError):
        dbvfiv.load(coarse_valve.case.replace({"modes.continuity": "both"})).modes("6 kPa", symmetry="all")


@pytest.mark.parametrize("name", ["SA", "AS", "AA"])
def test_matrices_follow_the_conditions(name):
    """Damping, loss factors and density enter the pencil of a class as they do that of the symmetric one."""
    model = make_valve()
    linear = linearise_class(model, find_open_state(), 12e3, SYMMETRIES[name])
    pencil = linear.pencil(Mu(density=1000.0, alpha=5.0, beta=0.003))
    assert np.allclose((pencil.C - 5.0 * linear.mass - 0.003 * linear.structure).data, 0.0, atol=1e-9)
    assert pencil.m == (0 if name == "AA" else model.stations)
    light = linear.pencil(Mu(density=10.0, alpha=5.0, beta=0.003))
    assert np.allclose(light.A0, pencil.A0, rtol=1e-10) and np.allclose(100 * light.A2, pencil.A2, rtol=1e-10)
