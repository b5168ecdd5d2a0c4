"""Key points of any number: tables with units and joints, the parametric shape written and read back, slips refused."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import dbvfiv
from dbvfiv.case.key_points import KeyProfile, read_key_points
from dbvfiv.errors import CaseError
from dbvfiv.geometry.sections import key_point_sections
from dbvfiv.geometry.surface import key_point_table, surface_of
from dbvfiv.geometry.valve_mesh import valve_mesh
from dbvfiv.model import strain_level
from dbvfiv.report.gather import second_mesh
from dbvfiv.studies.case import Case, load_case, thesis_case
from dbvfiv.studies.onset.search import coarse_case
from dbvfiv.studies.stability.place import rebuilder

ROOT = Path(__file__).resolve().parents[2]

WIDE = {
    "valve.lip_half_width": 0.18,
    "valve.flange_radius": 0.1,
    "valve.wall": "uniform",
    "valve.wall_thickness": 0.01,
    "mesh.around": 10,
    "mesh.along": 16,
}
SHAPE = ("lip_half_width", "lip_rise", "lip_radius", "cuff_radius", "flange_radius", "saddle")


def by_points(case: Case, folder, points: int = 17, extra: int = 0, **more) -> Case:
    """The same case by key points that are written from it."""
    (folder / "points.csv").write_text(key_point_table(case.valve, points, extra))
    data = case.to_dict()
    for name in SHAPE:
        data["valve"].pop(name)
    return Case.from_dict(data).replace({"valve.key_points": str(folder / "points.csv")} | more)


@pytest.mark.parametrize(
    "more",
    [
        {},
        pytest.param({"valve.lip_rise": 0.01}, marks=pytest.mark.slow),
        {"valve.cuff_length": 0.06, "valve.cuff_radius": 0.09, "valve.flare_length": 0.05},
        pytest.param({"valve.scale": 0.4}, marks=pytest.mark.slow),
        pytest.param({"valve.saddle": "smooth"}, marks=pytest.mark.slow),
    ],
)
def test_the_parametric_shape_comes_back(more, tmp_path):
    case = Case().replace(WIDE | more)
    skin = {"valve.key_point_skin": "smooth"} if "valve.saddle" in more else {}
    again = by_points(case, tmp_path, 65, **skin)
    one, two = (valve_mesh(c.valve, c.mesh, (0.5,)) for c in (case, again))
    size = case.valve.length
    assert two.z == pytest.approx(one.z, abs=1e-9 * size)
    assert two.nodes == pytest.approx(one.nodes, abs=(1e-9 if skin else 1e-12) * size)
    passage = one.rest_area - one.wall_deduction
    assert two.rest_area - two.wall_deduction == pytest.approx(passage, rel=1e-8)


def test_lips_bowed_to_half_a_circle_have_no_side_edge(tmp_path):
    case = Case().replace(WIDE | {"valve.lip_half_width": 0.07, "valve.lip_rise": 0.07})
    one, two = (valve_mesh(c.valve, c.mesh) for c in (case, by_points(case, tmp_path, 65)))
    assert two.rest_area == pytest.approx(one.rest_area, rel=1e-8)


def test_the_command_says_which_keys_give_the_valve_back(tmp_path, command_line):
    """Deductions of the 12-inch valve, which follow otherwise beside key points: three times its passage at rest."""
    target, case = tmp_path / "own.csv", Case()
    said = command_line("case", "--key-points", target, "--points", 65).out
    keys = dict(re.findall(r'(\w+) = "([^"]+)"', said))
    assert keys.pop("key_points") == "own.csv"
    assert keys == {"duckbill_wall_deduction": "6.19 mm", "flange_wall_deduction": "8.19 mm"}
    again = by_points(case, tmp_path, 65, **{f"valve.{name}": text for name, text in keys.items()})
    one, two = (valve_mesh(c.valve, c.mesh) for c in (case, again))
    assert two.rest_area - two.wall_deduction == pytest.approx(one.rest_area - one.wall_deduction, rel=1e-8)


@pytest.mark.slow
def test_a_wide_bill_by_points_and_by_parameters_is_one_valve(tmp_path):
    """Flow, opening and modes of a bill 1.86 times as wide as its pipe agree to 1e-10."""
    case = thesis_case(WIDE | {"mesh.around": 8, "steady.tolerance": 1e-12})
    again = by_points(case, tmp_path, 65)
    states = [dbvfiv.Valve(c).steady(pressure=5e3) for c in (case, again)]
    one, two = states
    assert two.mass_flow == pytest.approx(one.mass_flow, rel=1e-10)
    size = np.abs(one.nodal[:, :3]).max()
    assert two.nodal[:, :3] == pytest.approx(one.nodal[:, :3], abs=1e-10 * size)
    found = [np.array([(m.growth_rate, m.frequency) for m in s.modes(count=3, in_vacuo=True).modes]) for s in states]
    assert found[1] == pytest.approx(found[0], rel=1e-10)


def test_few_points_give_nearly_the_same_shape(tmp_path):
    case = Case().replace(WIDE)
    fine = np.linspace(0.0, 1.0, 201)
    own = surface_of(case.valve)
    for points, error in ((6, 1e-6), (17, 1e-10)):
        given = surface_of(by_points(case, tmp_path, points).valve)
        away = max(np.abs(given.section(z, fine) - own.section(z, fine)).max() for z in own.breaks)
        assert away < error
    more = by_points(case, tmp_path, 17, 5)
    assert len(surface_of(more.valve).profiles) == 9
    mesh, plain = (valve_mesh(c.valve, c.mesh) for c in (more, case))
    rest = np.interp(mesh.z, plain.z, plain.rest_area)
    assert mesh.rest_area == pytest.approx(rest, rel=2e-2)


def test_three_points_of_a_flange_have_a_curve_without_a_corner():
    """A parabola leaves 1.2 per cent of the quarter circle out, chords 10."""
    points = [(0.1 * np.sin(t), 0.1 * np.cos(t), 0.3) for t in np.radians([0.0, 45.0, 90.0])]
    lone = KeyProfile(tuple(points))
    # the same curve between joints, behind a straight edge
    joined = KeyProfile(((0.0, 0.2, 0.3), *points), (1,), smooth=True)
    for profile, pieces in ((lone, 1.0), (joined, None)):
        (found,) = key_point_sections([profile])
        share = 0.0 if pieces else 0.1 / found.length
        xy = found.points(np.linspace(share, 1.0, 2001))
        area = 0.5 * np.abs(np.sum(xy[:-1, 0] * xy[1:, 1] - xy[1:, 0] * xy[:-1, 1]))
        assert area == pytest.approx(0.25 * np.pi * 0.1**2, rel=0.02)
        step = np.diff(xy[1:], axis=0)
        assert np.abs(np.diff(np.unwrap(np.arctan2(step[:, 1], step[:, 0])))).max() < np.radians(1.0)


def test_a_smooth_skin_goes_through_its_profiles_and_needs_no_row_on_them(tmp_path):
    """An elliptic bill that opens into a round pipe, of 21 profiles: on 16 rows too."""
    angle = np.linspace(0, np.pi / 2, 21)
    with (tmp_path / "ellipses.csv").open("w") as file:
        file.write("x [cm]; y [cm]; z [m]\n")
        for z in np.linspace(0.0, 0.56, 21):
            a, b = 15.0 - 5.0 * np.sin(np.pi * z / 1.12), 1.0 + 9.0 * np.sin(np.pi * z / 1.12) ** 2
            file.writelines(f"{a * np.sin(t):.12f}; {b * np.cos(t):.12f}; {z:.12f}\n" for t in angle)
    given = {"valve.key_points": str(tmp_path / "ellipses.csv"), "mesh.along": 16, "mesh.around": 8}
    given["mesh.rows"] = "graded"  # the spline through the profiles is worst next to the lip, where areas are least
    case = Case().replace(given | {"valve.key_point_skin": "smooth"})
    mesh = valve_mesh(case.valve, case.mesh)
    assert mesh.shape == (8, 16)
    a, b = 0.15 - 0.05 * np.sin(np.pi * mesh.z / 1.12), 0.01 + 0.09 * np.sin(np.pi * mesh.z / 1.12) ** 2
    assert mesh.rest_area == pytest.approx(np.pi / 4 * a * b, rel=3e-3)
    assert case.valve.inlet_radius == pytest.approx(0.1, rel=1e-6)
    assert 2 * case.valve.bill_reach == pytest.approx(0.3 + case.valve.thickness_at(0.0), rel=1e-9)
    with pytest.raises(ValueError, match="the surface has 20 pieces and each needs an element"):
        ruled = Case().replace(given)
        valve_mesh(ruled.valve, ruled.mesh)


@pytest.mark.slow
def test_coarser_meshes_have_a_row_for_every_piece(tmp_path, monkeypatch, refused):
    """Levels of rubbers settle on fewer elements, and an onset is found again on a second mesh."""
    asked = []

    def settled(case, loads, levels, observer):
        asked.append(case)
        yield strain_level._Round(1, case, levels, (), 0.0)

    monkeypatch.setattr(strain_level, "_rounds", settled)
    case = by_points(Case().replace(WIDE), tmp_path, 17, 26, **{"mesh.along": 30})
    assert len(surface_of(case.valve).profiles) == 30
    strain_level.settle_levels(case, 6e3)
    found = [asked[0], *(coarse_case(case.replace({"mesh.along": n}), 0.5)[0] for n in (30, 80))]
    assert [valve_mesh(each.valve, each.mesh).shape for each in found] == [(14, 29), (6, 29), (6, 40)]
    assert second_mesh(case.replace({"mesh.along": 48}))["mesh.along"] == 29
    with refused(CaseError, match="mesh.along is 28, but the surface has 29 pieces"):
        rebuilder(case.replace({"mesh.along": 28}))({})


def test_forms_of_a_table(tmp_path):
    """Separators, units, order of columns, words for profiles; bare lines in m."""
    rows = [
        (0.0, 0.02, 0.0),
        (0.05, 0.015, 0.0),
        (0.06, 0.0, 0.0),
        (0.0, 0.04, 0.3),
        (0.03, 0.03, 0.3),
        (0.04, 0.0, 0.3),
    ]
    texts = {
        "bare": "".join(f"{x} {y} {z}\n" for x, y, z in rows),
        "bare commas": "".join(f"{x}, {y}, {z}  # a point\n" for x, y, z in rows),
        "table": "x [m], y [m], z [m]\n" + "".join(f"{x}, {y}, {z}\n" for x, y, z in rows),
        "millimetres": "Z (mm)\tX (mm)\tY (cm)\n" + "".join(f"{1e3 * z}\t{1e3 * x}\t{1e2 * y}\n" for x, y, z in rows),
        "words": "profile; x [m]; y [m]; z [m]; joint\n"
        + "".join(f"{'lip' if z == 0 else 'flange'}; {x}; {y}; {z}; 0\n" for x, y, z in rows),
    }
    for name, text in texts.items():
        (tmp_path / "points.csv").write_text(text)
        found = read_key_points(tmp_path / "points.csv")
        assert [len(profile.points) for profile in found] == [3, 3], name
        assert np.array([p for profile in found for p in profile.points]) == pytest.approx(np.array(rows)), name


GOOD = ["x [mm], y [mm], z [mm]", "0, 20, 0", "50, 15, 0", "60, 0, 0", "0, 40, 560", "30, 30, 560", "40, 0, 560"]


def changed(line: int, text: str | None) -> str:
    lines = list(GOOD)
    lines[line : line + 1] = [] if text is None else text.split("|")
    return "\n".join(lines)


BAD = {
    "empty": ("", "which holds no points"),
    "comments alone": ("# nothing\n\n# here", "which holds no points"),
    "header alone": (GOOD[0], "no points below its first line"),
    "no unit": (changed(0, "x, y, z"), "column x has no unit of length"),
    "unit of another dimension": (changed(0, "x [mm], y [kPa], z [mm]"), "column y has no unit of length"),
    "unknown unit": (changed(0, "x [mm], y [mm], z [furlung]"), "column z has no unit of length"),
    "no column y": (changed(0, "x [mm], u [mm], z [mm]"), "names no column y"),
    "column twice": (changed(0, "x [mm], y [mm], z [mm], x [mm]"), "names no column x, or several"),
    "unknown column": (changed(0, "x [mm], y [mm], z [mm], weight [kg]"), "not told or stands twice"),
    "word for a number": (changed(2, "50, fifteen, 0"), "line 3 is not three numbers"),
    "number missing": (changed(2, "50, 15"), "line 3 has 2 entries and not 3"),
    "number too many": (changed(2, "50, 15, 0, 7"), "line 3 has 4 entries and not 3"),
    "not finite": (changed(2, "50, inf, 0"), "line 3 is not three numbers"),
    "a joint in words": (
        "\n".join(f"{row}, {'no' if i else 'joint'}" for i, row in enumerate(GOOD)),
        "line 2 holds the joint 'no', which is neither 0 nor 1",
    ),
    "one profile": ("\n".join(GOOD[:4]), "holds one profile"),
    "two points in a profile": (changed(5, None), "profile 2 at z = 0.56 m has 2 points"),
    "does not begin at the centre": (changed(1, "5, 20, 0"), "profile 1 at z = 0 m does not run from the centre"),
    "does not end at the side edge": (changed(6, "40, 3, 560"), "profile 2 at z = 0.56 m does not run from"),
    "backwards": ("\n".join([GOOD[0], *GOOD[3:0:-1], *GOOD[4:]]), "profile 1 at z = 0 m does not run from"),
    "below the plane": (changed(2, "50, -15, 0"), "leaves the quarter"),
    "lower lip flat": (
        "\n".join([GOOD[0], "0, 40, 0", "60, 20, 0", "50, -10, 0", "0, -10, 0", *GOOD[4:]]),
        "profile 1 at z = 0 m leaves the quarter of positive x and y",
    ),
    "to the left": (changed(2, "-50, 15, 0"), "leaves the quarter"),
    "quarter after a half": (changed(1, "-60, 0, 0|0, 20, 0"), "profile 2 at z = 0.56 m does not begin as the first"),
    "half below the plane": (
        "\n".join([GOOD[0], "-60, 0, 0", "0, -20, 0", "60, 0, 0", "-40, 0, 560", "0, 40, 560", "40, 0, 560"]),
        "profile 1 at z = 0 m leaves the half of positive y",
    ),
    "half without its edge": (
        "\n".join([GOOD[0], "-60, 5, 0", "0, 20, 0", "60, 0, 0", "-40, 0, 560", "0, 40, 560", "40, 0, 560"]),
        "profile 1 at z = 0 m does not run from side edge to side edge",
    ),
    "same point twice": (changed(2, "50, 15, 0|50, 15, 0"), "has the same point twice"),
    "flange first": ("\n".join([GOOD[0], *GOOD[4:], *GOOD[1:4]]), "do not go from the lip to the flange"),
    "does not begin at the lip": ("\n".join(GOOD).replace(", 0\n", ", 7\n"), "first profile lies at z = 0.007 m"),
    "profiles mixed": (
        "profile, x [mm], y [mm], z [mm]\n" + "\n".join(f"{'ab'[i % 2]}, {row}" for i, row in enumerate(GOOD[1:])),
        "points of a profile do not follow each other",
    ),
    "not at one z": (
        "profile, "
        + "\n".join([GOOD[0], *("ab"[i > 2] + ", " + row for i, row in enumerate(GOOD[1:]))]).replace(
            "30, 30, 560", "30, 30, 555"
        ),
        "profile 2 at z = 0.558333 m has points from 0.555 to 0.56 m, and a profile lies at one z",
    ),
    "too short a valve": ("\n".join(GOOD).replace("560", "400"), "profiles end at z = 0.4 m; the lengths .*0.56 m"),
    "bare word among numbers": ("0 20 0\n50 x 0\n", "line 2 is not three numbers"),
    "binary": ("\x00\x01", "line 1 is not three numbers"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_tables(name, tmp_path, command_line, one_sentence):
    text, words = BAD[name]
    (tmp_path / "points.csv").write_text(text)
    (tmp_path / "case.toml").write_text("[valve]\nkey_points = 'points.csv'\n")
    done = command_line("case", tmp_path / "case.toml")
    assert done.status == 2 and not done.out
    message = done.err.replace("points.csv", "points").replace("case.toml", "case")
    assert one_sentence(message), message
    assert re.search(words, done.err)


LOOP = [(0, 60), (30, 55), (60, 40), (70, 25), (60, 15), (45, 20), (50, 40), (70, 55), (90, 40), (100, 15), (105, 0)]
#: What only the mesh shows.
IMPOSSIBLE = {
    "crosses itself": (
        "\n".join([GOOD[0], *(f"{x}, {y}, 0" for x, y in LOOP), *GOOD[4:]]),
        r"profile 1 at z = 0 m crosses itself at x = 0.05348 m, y = 0.04471 m",
    ),
    "swings beyond the plane": (
        "\n".join([GOOD[0], "0, 20, 0", "80, 20, 0", "100, 1, 0", "110, 0, 0", *GOOD[4:]]),
        r"profile 1 at z = 0 m leaves the quarter of positive x and y between its points",
    ),
    "lips wider than the flange": (
        "\n".join([GOOD[0], "0, 200, 0", "140, 140, 0", "200, 0, 0", *GOOD[4:]]),
        "leave .* cm2 between the lips at rest; the passage there must be smaller than that of the flange",
    ),
}


@pytest.mark.parametrize(
    "key, words",
    [
        ("valve.flange_wall_deduction=250 mm", "cuff leave no flow area inside a half wall of 0.25 m"),
        ("valve.duckbill_wall_deduction=168 mm", "lip leave no flow area inside a half wall of 0.168 m"),
        ("valve.initial_gap=20 mm", "0.00619 m above the slit, and valve.initial_gap is 0.02 m"),
    ],
)
def test_walls_and_gaps_that_no_valve_has_are_refused(tmp_path, key, words):
    """Both doors refuse them: key points and parameters."""
    with pytest.raises(CaseError, match=words):
        dbvfiv.load(by_points(Case(), tmp_path), key).session.mesh
    with pytest.raises(CaseError, match=key.partition("=")[0]):
        dbvfiv.load(None, key)


def test_key_points_stand_in_the_place_of_the_parameters(tmp_path):
    own = load_case(ROOT / "cases/dbv6.toml")
    (tmp_path / "points.csv").write_text(key_point_table(own.valve, 17, 0))
    found = load_case(ROOT / "cases/dbv6.toml", [f"valve.key_points={tmp_path / 'points.csv'}"])
    assert found.valve.inlet_radius == pytest.approx(own.valve.inlet_radius, rel=1e-6)


def test_joints_may_be_told_by_floats(tmp_path):
    """Spreadsheets and pandas write 0.0 and 1.0 where a cell is empty."""
    (tmp_path / "own.csv").write_text(table := key_point_table(Case().valve, 9, 0))
    (tmp_path / "floats.csv").write_text(re.sub(r"([01])$", r"\1.0", table, flags=re.MULTILINE))
    found, own = (read_key_points(tmp_path / name) for name in ("floats.csv", "own.csv"))
    assert [profile.joints for profile in found] == [profile.joints for profile in own] and own[0].joints
    assert ", 1.0\n" in (tmp_path / "floats.csv").read_text()


@pytest.mark.parametrize("name", IMPOSSIBLE)
def test_impossible_sections(name, tmp_path, refused):
    text, words = IMPOSSIBLE[name]
    (tmp_path / "points.csv").write_text(text)
    with refused(CaseError, match=words):
        dbvfiv.load(None, {"valve.key_points": str(tmp_path / "points.csv")}).session.mesh


def test_the_command_writes_a_table(tmp_path, command_line):
    target = tmp_path / "own.csv"
    done = command_line("case", "--key-points", target, "--points", 9, "--set", "valve.lip_half_width=0.16")
    assert done.status == 0 and 'key_points = "own.csv"' in done.out
    profiles = read_key_points(target)
    assert [len(profile.points) for profile in profiles] == [17, 17, 17, 17] and profiles[0].joints == (8,)
    assert command_line("case", "--key-points", target).status == 2  # not overwritten
    assert command_line("case", "--set", f"valve.key_points={target}", "--key-points", tmp_path / "b.csv").status == 2
    assert command_line("case", "--key-points", target, "--new").status == 2
