"""Bills that are shifted along their slit: by parameters, by key points, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

import dbvfiv
from dbvfiv.case.mesh import Mesh
from dbvfiv.case.part import HALF, QUARTER, part_of
from dbvfiv.case.valve import Valve
from dbvfiv.errors import CaseError
from dbvfiv.geometry.surface import key_point_table
from dbvfiv.geometry.valve_mesh import valve_mesh

WIDE = {"lip_half_width": 0.2}
MESH = Mesh(around=6, along=10)


def test_what_is_computed_follows_from_the_shape():
    assert part_of(Valve(), Mesh()) is QUARTER
    assert part_of(Valve(), Mesh(part="half")) is HALF
    assert part_of(Valve(**WIDE, bill_offset=0.5), Mesh()) is HALF
    assert [(part.copies, part.quarters, part.walls) for part in (QUARTER, HALF)] == [(4, 1, 2), (2, 2, 1)]


@pytest.mark.parametrize("width", [0.2, 0.09], ids=["wider than the pipe", "narrower"])
@pytest.mark.parametrize("offset", [0.3, 1.0])
def test_the_shift_takes_the_side_edge_towards_the_pipe(width, offset):
    valve = Valve(lip_half_width=width, bill_offset=offset, cuff_radius=0.12, flare_length=0.05, wall="uniform")
    mesh = valve_mesh(valve, MESH)
    lip, cuff = valve.lip.widest, 0.12
    left, right = mesh.nodes[mesh.rows[0, [0, -1]], 0]
    assert left == pytest.approx(-(lip + offset * (cuff - lip)), rel=1e-12)
    assert right - left == pytest.approx(2 * lip, rel=1e-12)
    flange = mesh.nodes[mesh.rows[-1, [0, -1]], 0]
    assert flange == pytest.approx([-valve.flange_radius, valve.flange_radius], rel=1e-12)


def test_a_scaled_bill_is_shifted_by_its_scale():
    meshes = [valve_mesh(Valve(**WIDE, bill_offset=1.0, scale=scale), MESH) for scale in (1.0, 3.0)]
    assert meshes[1].nodes == pytest.approx(3 * meshes[0].nodes, rel=1e-12, abs=1e-15)


@pytest.mark.parametrize("saddle", ["ruled", "smooth"])
def test_key_points_from_edge_to_edge_give_the_shape_back(tmp_path, saddle):
    valve = Valve(**WIDE, bill_offset=1.0, saddle=saddle)
    (tmp_path / "points.csv").write_text(key_point_table(valve, *((17, 9) if saddle == "smooth" else (33,))))
    skin = "ruled" if saddle == "ruled" else "smooth"
    points = Valve(key_points=tmp_path / "points.csv", key_point_skin=skin)
    assert not points.is_double_symmetric
    assert points.bill_reach == pytest.approx(valve.bill_reach, rel=1e-9)
    found, expected = (valve_mesh(one, Mesh(around=6, along=10, rows="uniform")) for one in (points, valve))
    assert found.part is HALF
    if saddle == "ruled":
        assert np.abs(found.nodes - expected.nodes).max() < 1e-9
        assert found.wall_deduction == pytest.approx(expected.wall_deduction, rel=1e-8)
        assert found.perimeter == pytest.approx(expected.perimeter, rel=1e-8)
    left = found.nodes[found.rows[:, 0], 0]
    assert left == pytest.approx(np.full(len(left), -valve.flange_radius), rel=1e-6)


def test_key_points_of_a_quarter_serve_a_half(tmp_path):
    (tmp_path / "points.csv").write_text(key_point_table(Valve(**WIDE), 17))
    valve = Valve(key_points=tmp_path / "points.csv")
    quarter, half = valve_mesh(valve, MESH), valve_mesh(valve, MESH.model_copy(update={"part": "half"}))
    for name in ("rest_area", "wall_deduction", "perimeter"):
        assert getattr(half, name) == pytest.approx(2 * getattr(quarter, name), rel=1e-12)
    right = half.nodes[half.rows[:, 6:]]
    assert right == pytest.approx(quarter.nodes[quarter.rows], rel=1e-12, abs=1e-15)


def test_patches_lie_on_both_sides():
    patch = {"end": 0.2, "around_from": 0.8, "extra": 0.002}
    meshes = [
        valve_mesh(Valve(**WIDE, patches=[patch]), Mesh(around=6, along=10, part=part)) for part in ("auto", "half")
    ]
    assert meshes[1].wall_deduction == pytest.approx(2 * meshes[0].wall_deduction, rel=1e-12)
    quarter, half = (mesh.thickness.reshape(mesh.shape[::-1]) for mesh in meshes)
    assert np.array_equal(half, np.concatenate([quarter[:, ::-1], quarter], axis=1))


def test_the_symmetric_saddle_may_be_that_steep():
    dbvfiv.load(None, {"valve.wall": "uniform", "valve.lip_half_width": 0.3, "valve.saddle_length": "58 mm"})


def test_an_offset_beside_key_points_is_refused(tmp_path, refused):
    (tmp_path / "points.csv").write_text(key_point_table(Valve()))
    with refused(CaseError, match="valve.bill_offset is 0.5 beside key_points"):
        dbvfiv.load(None, {"valve.key_points": str(tmp_path / "points.csv"), "valve.bill_offset": 0.5})
