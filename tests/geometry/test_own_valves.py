"""Valves of one's own: what follows from wall and shape, and what key points replace."""

import numpy as np
import pytest

from dbvfiv.errors import CaseError
from dbvfiv.geometry.valve_mesh import valve_mesh
from dbvfiv.studies.case import Case
from dbvfiv.studies.stability.place import redesigned

SIX_INCH = {
    "valve.duckbill_length": 0.105,
    "valve.saddle_length": 0.14,
    "valve.flange_length": 0.035,
    "valve.lip_half_width": 0.062,
    "valve.flange_radius": 0.07,
    "valve.wall": "uniform",
    "valve.wall_thickness": 0.007,
}


def lip_area(case: Case) -> float:
    mesh = valve_mesh(case.valve, case.mesh)
    return float(mesh.rest_area[0] - mesh.wall_deduction[0])


def test_twelve_inch_valve_keeps_its_numbers():
    valve = Case().valve
    numbers = (valve.lip_radius, valve.duckbill_wall_deduction, valve.flange_wall_deduction)
    assert numbers == (0.00619, 0.00619, 0.00819)
    averaged = Case().replace({"valve.wall": "uniform"}).valve
    assert (averaged.lip_radius, averaged.flange_wall_deduction) == (0.00619, 0.00819)


def test_half_the_wall_is_taken_where_nothing_is_given():
    """Before, a valve of this size had the lips of the 12-inch valve: 6.19 mm high, 8.19 mm off the flange."""
    case = Case().replace(SIX_INCH)
    valve = case.valve
    assert (valve.lip_radius, valve.duckbill_wall_deduction, valve.flange_wall_deduction) == (0.0035, 0.0035, 0.0035)
    assert lip_area(case) == pytest.approx(0.062 * 1e-4, rel=1e-3)  # the gap alone: the faces touch at rest
    mesh = valve_mesh(valve, case.mesh)
    assert mesh.rest_area[-1] - mesh.wall_deduction[-1] == pytest.approx(np.pi / 4 * 0.0665**2, rel=1e-6)


def test_what_follows_goes_on_following():
    case = Case().replace(SIX_INCH).replace({"valve.wall_thickness": "10 mm"})
    assert case.valve.lip_radius == case.valve.duckbill_wall_deduction == 0.005
    assert Case.from_dict(case.to_dict()) == case
    assert (
        case.replace({"valve.lip_radius": "5 mm"}).replace({"valve.wall_thickness": "9 mm"}).valve.lip_radius == 0.005
    )


def test_given_numbers_stay():
    case = Case().replace(SIX_INCH | {"valve.lip_radius": "8 mm", "valve.flange_wall_deduction": "4 mm"})
    assert (case.valve.duckbill_wall_deduction, case.valve.flange_wall_deduction) == (0.0035, 0.004)
    inner = 0.008 - 0.0035  # open at rest by what the lips leave between them, the round corner included
    assert lip_area(case) == pytest.approx(0.062 * (inner + 1e-4) + np.pi / 4 * inner**2, rel=1e-6)
    low = Case().replace(SIX_INCH | {"valve.lip_radius": "3 mm"})
    assert low.valve.duckbill_wall_deduction == 0.003  # faces that would cross at rest touch


def test_thickness_factor_leaves_the_passage():
    assert lip_area(Case().replace(SIX_INCH | {"valve.thickness_factor": 0.7})) == lip_area(Case().replace(SIX_INCH))


@pytest.fixture
def points(tmp_path):
    """Key points of a round pipe of 0.1 m that flattens to an ellipse, straight between."""
    path, angle = tmp_path / "points.txt", np.linspace(0, np.pi / 2, 15)
    with path.open("w") as file:
        for z in np.linspace(0, 0.56, 9):
            x, y = 0.1 + 0.02 * (1 - z / 0.56), 0.02 + 0.08 * z / 0.56
            file.writelines(f"{x * np.sin(a):.9f} {y * np.cos(a):.9f} {z:.9f}\n" for a in angle)
    return str(path)


@pytest.mark.parametrize("key, value", [("lip_half_width", 0.1), ("lip_radius", 0.007), ("flange_radius", 0.14)])
def test_shape_beside_key_points_is_refused(points, key, value):
    """Before, these keys still changed the flow section of a valve whose shape the points give."""
    with pytest.raises(CaseError, match=f"valve.{key} is .* beside key_points; the points give the shape"):
        Case().replace({"valve.key_points": points, f"valve.{key}": value})


def test_saddle_beside_key_points_is_refused(points):
    with pytest.raises(CaseError, match="valve.saddle is 'smooth' beside key_points"):
        Case().replace({"valve.key_points": points, "valve.saddle": "smooth"})


def test_a_number_of_a_valve_of_key_points_changes_by_itself(points):
    case = Case().replace({"valve.key_points": points})
    valve = redesigned(case, {"valve.initial_gap": 2e-4}).valve
    assert valve.initial_gap == 2e-4 and valve.key_points is not None
    assert valve.flange_wall_deduction == case.valve.flange_wall_deduction


def test_walls_of_key_points_follow_from_the_points(points):
    case = Case().replace({"valve.key_points": points, "valve.wall": "uniform", "valve.wall_thickness": 0.01})
    mesh = valve_mesh(case.valve, case.mesh)
    assert mesh.wall_deduction[-1] == pytest.approx(np.pi / 4 * (0.1**2 - 0.095**2), rel=1e-4)
    fine = np.linspace(0, np.pi / 2, 200_001)
    length = np.hypot(0.12 * np.cos(fine), 0.02 * np.sin(fine)).mean() * np.pi / 2
    lip = 0.005 * length - np.pi / 4 * 0.005**2 - 1e-4 * (0.12 - 0.005)
    assert mesh.wall_deduction[0] == pytest.approx(lip, rel=1e-3)


def test_walls_that_fill_key_points_are_refused(points):
    case = Case().replace({"valve.key_points": points, "valve.wall": "uniform", "valve.wall_thickness": 0.05})
    with pytest.raises(ValueError, match="key points of the lip leave no flow area"):
        valve_mesh(case.valve, case.mesh)
