"""Walls that vary around the section: thickness, rows and columns on the edges, and the flow section inside."""

from __future__ import annotations

import numpy as np
import pytest

from dbvfiv.errors import CaseError
from dbvfiv.geometry.divisions import grading
from dbvfiv.geometry.valve_mesh import valve_mesh
from dbvfiv.model import ValveModel
from dbvfiv.model.build import build_shell
from dbvfiv.model.sizes import ValveSizes
from dbvfiv.studies.case import Case

EVEN = {"valve.wall": "uniform", "valve.wall_thickness": 0.012}


def case_of(*patches, **more):
    return Case().replace(EVEN | {"mesh.around": 16, "mesh.along": 24, "valve.patches": list(patches)} | more)


def meshes(*patches, **more):
    return [valve_mesh(case.valve, case.mesh) for case in (case_of(**more), case_of(*patches, **more))]


def test_rows_and_columns_stand_on_the_edges_of_a_patch():
    patch = {"begin": 0.05, "end": 0.4, "around_from": 0.4, "around_to": 0.85, "thickness": 0.02}
    case = case_of(patch)
    mesh = valve_mesh(case.valve, case.mesh)
    shares = grading(mesh.columns, case.mesh.grading)
    assert np.abs(mesh.z[:, None] - [0.05, 0.4]).min(axis=0) == pytest.approx(0.0, abs=1e-12)
    assert np.abs(shares[:, None] - [0.4, 0.85]).min(axis=0) == pytest.approx(0.0, abs=1e-12)
    middle = grading(mesh.element_columns.mean(axis=1), case.mesh.grading)
    inside = (mesh.element_z > 0.05) & (mesh.element_z < 0.4) & (middle > 0.4) & (middle < 0.85)
    assert np.array_equal(mesh.thickness, np.where(inside, 0.02, 0.012))
    assert not len(mesh.missed_columns) and not len(mesh.missed_rows)
    built, shell = build_shell(case)
    assert np.array_equal(shell.mesh.thickness, built.thickness) and set(built.thickness) == {0.012, 0.02}


def test_patches_lie_on_top_of_each_other():
    valve = case_of({"thickness": 0.01}, {"end": 0.1, "extra": 0.003}, {"around_from": 0.5, "extra": -0.001}).valve
    assert [valve.wall_at(z, s) for z in (0.05, 0.2) for s in (0.2, 0.7)] == pytest.approx([0.013, 0.012, 0.01, 0.009])
    twice = case_of({"extra": 0.003, "end": 0.1}, **{"valve.scale": 2, "valve.thickness_factor": 0.5}).valve
    assert twice.thickness_at(0.1, 0.2) == pytest.approx(0.015) and twice.thickness_at(0.3, 0.2) == pytest.approx(0.012)


def test_flow_section_of_the_flange_follows_the_inner_face():
    """A quarter circle of which a third has a wall of 20 mm and the rest of 12: sectors of two radii."""
    even, patched = meshes({"around_from": 2 / 3, "thickness": 0.02})
    radius = 0.13919
    area = np.pi / 4 * (2 / 3 * (radius - 0.006) ** 2 + 1 / 3 * (radius - 0.010) ** 2)
    assert patched.rest_area[-1] - patched.wall_deduction[-1] == pytest.approx(area, rel=1e-5)
    assert even.rest_area[-1] - even.wall_deduction[-1] == pytest.approx(np.pi / 4 * (radius - 0.006) ** 2, rel=1e-6)
    assert np.all(patched.wall_deduction >= even.wall_deduction)


def test_lips_that_touch_stay_touching():
    """A thicker lip grows outwards where the faces meet, a thinner one leaves a slot of what was taken off."""
    even, thicker = meshes({"end": 0.21, "thickness": 0.02})
    on_lips = even.z < 0.209
    assert thicker.wall_deduction[on_lips] == pytest.approx(even.wall_deduction[on_lips], abs=1e-9)
    even, thinner = meshes({"end": 0.21, "around_to": 0.5, "thickness": 0.008})
    length = 0.5 * (0.125 + np.pi / 2 * 0.006)
    assert (even.wall_deduction - thinner.wall_deduction)[on_lips] == pytest.approx(0.002 * length, rel=1e-3)
    assert thinner.wall_deduction[-1] == even.wall_deduction[-1]


def test_a_step_within_the_duckbill_is_the_patch_that_says_the_same():
    """Behind a lip of 14 mm a wall of 12 leaves a slot of 1 mm below either face, and one of 16 grows outwards."""
    passages = {}
    for behind in (0.012, 0.014, 0.016):
        stepped = [(0.05, 0.014), (0.21, behind), (0.56, 0.014)]
        told = (
            {"valve.wall": "measured", "valve.wall_map": [{"to": to, "thickness": h} for to, h in stepped]},
            {"valve.wall_thickness": 0.014, "valve.patches": [{"begin": 0.05, "end": 0.21, "thickness": behind}]},
        )
        found = [valve_mesh(case.valve, case.mesh) for case in (case_of(**keys) for keys in told)]
        on_lips = found[0].z < 0.209
        passages[behind], other = (1e6 * (mesh.rest_area - mesh.wall_deduction)[on_lips] for mesh in found)
        assert passages[behind] == pytest.approx(other, abs=1e-3)
    depth = np.interp(found[0].z[on_lips], [0.0499, 0.05, 0.0501], [0.0, 0.5, 1.0])  # mm
    slot = 125.0 * depth + np.pi / 4 * depth**2
    assert passages[0.012] - passages[0.014] == pytest.approx(slot, rel=1e-3, abs=1e-3)
    assert passages[0.016] == pytest.approx(passages[0.014], abs=1e-3)


def test_a_patch_of_the_same_wall_changes_no_passage():
    even, patched = meshes({"begin": 0.1, "end": 0.3, "around_from": 0.2, "thickness": 0.012})
    assert np.interp(even.z, patched.z, patched.wall_deduction) == pytest.approx(even.wall_deduction, rel=1e-3)
    assert patched.wall_deduction[0] == even.wall_deduction[0]


@pytest.mark.parametrize("part", ["auto", "half"])
def test_size_of_a_bill_with_a_thicker_edge_or_middle(part):
    sizes = []
    for patch in ({"extra": 0.0}, {"around_from": 0.82, "extra": 0.003}, {"around_to": 0.4, "extra": 0.003}):
        case = case_of(patch | {"end": 0.05}, **{"mesh.around": 8, "mesh.along": 16, "mesh.part": part})
        found = ValveSizes.of(ValveModel(case))
        assert found.bill_width == pytest.approx(2 * case.valve.bill_reach, rel=1e-9)
        assert found.lip_area == pytest.approx(4 * 0.125 * 1e-4, rel=1e-3)  # edges beside a place of the sum, too
        sizes.append((found.bill_width, found.bill_height))
    even, edge, middle = sizes
    wider, higher = np.subtract(edge, even), np.subtract(middle, even)
    assert wider == pytest.approx([0.003, 0.003], abs=1e-9)  # the edge begins where the lips are flat
    assert higher == pytest.approx([0.0, 0.003], abs=1e-9)


def test_a_patch_that_fills_a_narrow_place(one_sentence):
    """On its way from the flange to the lips the inner face of a patch meets itself."""
    narrow = {"valve.flange_radius": 0.03, "valve.lip_half_width": 0.02, "valve.lip_radius": 0.007}
    case = case_of({"begin": 0.5, "thickness": 0.0599}, **narrow)
    with pytest.raises(CaseError, match="valve.patches leave no flow area at z = 0.5") as caught:
        valve_mesh(case.valve, case.mesh)
    assert one_sentence(str(caught.value).replace("0.5", ""))
