"""Measured areas, sections and pressures along the axis beside computed ones, and bad files of them."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import dbvfiv
from dbvfiv.case.measured import AREA, DISCHARGE, SHAPE, TAPS, read_measured
from dbvfiv.errors import CaseError
from dbvfiv.record.vtkhdf import faces
from dbvfiv.studies.case import Case, thesis_case
from dbvfiv.studies.closure import study as closure
from dbvfiv.studies.measured import cut, distances
from dbvfiv.studies.steady import study as steady
from tests.small_valves import SMALL, load_small

# -- tables


@pytest.mark.parametrize(
    "text, holds, columns",
    [
        ("pressure [kPa], area [cm2]\n2, 30\n", {AREA}, {"pressure": 2e3, "area": 3e-3}),
        ("Area [mm²]; head [mH2O]\n30; 1\n", {AREA}, {"pressure": 9806.65, "area": 3e-5}),
        (
            "pressure [kPa], flow [kg/s], area [cm^2]\n2, 5, 30\n",
            {DISCHARGE, AREA},
            {"pressure": 2e3, "mass_flow": 5.0, "area": 3e-3},
        ),
        (
            "pressure [kPa], x [mm], y [cm]\n2, -30, 4\n",
            {SHAPE},
            {"pressure": 2e3, "x": -0.03, "y": 0.04, "z": None, "face": "inner"},
        ),
        (
            "face, z [mm], pressure [Pa], x [m], y [m]\nOuter, 50, 3, .1, .2\n",
            {SHAPE},
            {"pressure": 3.0, "x": 0.1, "y": 0.2, "z": 0.05, "face": "outer"},
        ),
        ("pressure [kPa]\tz [m]\ttap pressure [kPa]\n2\t.1\t-1\n", {TAPS}, {"pressure": 2e3, "z": 0.1, "tap": -1e3}),
        ("head [m], z [m], tap [m]\n1, .1, .5\n", {TAPS}, {"pressure": 9806.65, "z": 0.1, "tap": 4903.325}),
    ],
)
def test_tables_in_any_units(tmp_path, text, holds, columns):
    (tmp_path / "points.csv").write_text(text)
    table = read_measured(tmp_path / "points.csv")
    assert table.name == "points.csv" and table.holds == holds and set(table.columns) == set(columns)
    for name, value in columns.items():
        (found,) = table.columns[name]
        assert found == (value if value is None or isinstance(value, str) else pytest.approx(value, rel=1e-12)), name


BAD = {
    "nothing": ("", "no rows"),
    "a first line alone": ("pressure [kPa], flow [L/s]\n", "no rows below its first line"),
    "numbers alone": ("18, 47.88\n", "columns are not told; the first line must name"),
    "two pressures": ("pressure [kPa], pressure [Pa]\n1, 2\n", "columns are not told"),
    "a flow in m/s": ("pressure [kPa], flow [m/s]\n1, 2\n", "columns are not told"),
    "x beside a flow": ("pressure [kPa], flow [L/s], x [mm]\n1, 2, 3\n", "columns are not told"),
    "a row too short": ("pressure [kPa], flow [L/s]\n18\n", "line 2 is not a pressure or head and a flow"),
    "a word": ("pressure [kPa], flow [L/s]\n18, many\n", "line 2 holds 'many', which is not a number"),
    "a flow that runs back": (
        "pressure [kPa], flow [L/s]\n18, -3\n",
        "line 2 holds '-3', and numbers must be finite and not negative",
    ),
    "no number": ("pressure [kPa], flow [L/s]\n18, nan\n", "line 2 holds 'nan'"),
    "x in kPa": ("pressure [kPa], x [kPa], y [mm]\n1, 2, 3\n", "column x is in 'kPa', which is no unit of a length"),
    "tap in mm": (
        "pressure [kPa], z [mm], tap [mm]\n1, 2, 3\n",
        "column tap is in 'mm', which is no unit of a pressure",
    ),
    "taps without a place": ("pressure [kPa], tap [kPa]\n1, 2\n", "columns are not told"),
    "y missing": ("pressure [kPa], x [mm]\n1, 2\n", "columns are not told"),
    "sections without a pressure": ("x [mm], y [mm]\n1, 2\n", "columns are not told"),
    "a column twice": ("pressure [kPa], x [mm], x [mm], y [mm]\n1, 2, 3, 4\n", "because two are x"),
    "an unknown column": ("pressure [kPa], speed [m/s]\n1, 2\n", r"because 'speed \[m/s\]' is none that is known"),
    "a column without a unit": ("pressure [kPa], number, area [cm2]\n1, 2, 3\n", "columns are not told"),
    "no such face": (
        "pressure [kPa], face, x [mm], y [mm]\n1, left, 2, 3\n",
        "line 2 holds 'left', and a face is inner, outer or middle",
    ),
    "negative area": (
        "pressure [kPa], area [cm2]\n1, -2\n",
        "line 2 holds '-2', and numbers must be finite and not neg",
    ),
    "a place in front of the lip": ("pressure [kPa], z [mm], x [mm], y [mm]\n1, -5, 2, 3\n", "line 2 holds '-5'"),
    "an infinite tap": ("pressure [kPa], z [mm], tap [kPa]\n1, 2, inf\n", "line 2 holds 'inf'"),
    "a row too long": ("pressure [kPa], area [cm2]\n1, 2\n3, 4, 5\n", "line 3 is not a pressure or head and an area"),
    "an empty cell": ("pressure [kPa], area [cm2]\n1,\n", "line 2 holds '', which is not a number"),
}


@pytest.mark.parametrize("text, words", BAD.values(), ids=BAD.keys())
def test_a_bad_table_is_refused_in_one_sentence(tmp_path, misused, text, words):
    file = tmp_path / "points.csv"
    file.write_text(text)
    with pytest.raises(CaseError, match=rf"steady\.measured is given as .*, wh.*{words}"):
        thesis_case([f"steady.measured={file}"])
    with pytest.raises(CaseError, match=rf"steady\.measured is given as .*, wh.*{words}"):
        load_small({"steady.measured": str(file)}).steady([6e3])
    misused("", "case", f"--set=steady.measured={file}")


def test_back_pressure_takes_no_discharge(tmp_path):
    file = tmp_path / "points.csv"
    file.write_text("pressure [kPa], flow [L/s]\n1, 2\n")
    with pytest.raises(
        CaseError, match=r"closure\.measured is given as .* which holds a discharge, and here belong areas"
    ):
        thesis_case([f"closure.measured={file}"])
    with pytest.raises(CaseError, match=r"closure\.measured is given as .*, which holds a discharge"):
        dbvfiv.load(thesis_case(), SMALL | {"closure.measured": str(file)}).closure(["2 kPa"])


def test_several_files(tmp_path):
    good, bad = tmp_path / "good.csv", tmp_path / "bad.csv"
    good.write_text("pressure [kPa], flow [L/s]\n1, 2\n")
    bad.write_text("pressure [kPa], area [cm2]\n")
    case = thesis_case([f'steady.measured=["{good}", "{good}"]'])
    assert case.steady.measured == (good, good) and Case.from_dict(case.to_dict()) == case
    with pytest.raises(
        CaseError, match=r"steady\.measured is given as a list of 2, of which '.*bad.csv' is one which ho"
    ):
        thesis_case([f'steady.measured=["{good}", "{bad}"]'])
    for wrong, words in (("[3]", "of which one names no file"), ("3", "which names no file")):
        with pytest.raises(CaseError, match=words):
            thesis_case([f"steady.measured={wrong}"])
    assert Case.from_dict({"steady": {"measured": None}}).steady.measured == ()  # as earlier versions wrote it


# -- sections


@settings(max_examples=40)
@given(a=st.floats(0.02, 0.3), angle=st.floats(0.0, 6.3), off=st.floats(-0.3, 0.3))
def test_distances_from_a_circle_are_signed(a, angle, off):
    """A fine polygon of a circle of radius a, from points at a (1 - off), in any quarter."""
    turn = np.linspace(0, np.pi / 2, 400)
    circle = a * np.stack([np.sin(turn), np.cos(turn)], axis=1)
    point = a * (1 - off) * np.array([[np.cos(angle), np.sin(angle)]])
    (found,) = distances(point, circle)
    assert found == pytest.approx(a * off, abs=1e-5 * a)


def test_a_cone_is_cut_where_its_plane_is():
    turn, z = np.linspace(0, np.pi / 2, 7), np.array([0.0, 0.1, 0.25, 0.4])
    radius = 0.05 + 0.2 * z
    cone = np.stack(np.broadcast_arrays(radius[:, None] * np.sin(turn), radius[:, None] * np.cos(turn), z[:, None]), -1)
    for at in (0.0, 0.05, 0.1, 0.3, 0.4):
        assert np.linalg.norm(cut(cone, at), axis=1) == pytest.approx(0.05 + 0.2 * at)
    assert cut(cone, 0.41) is None
    withdrawn = cone + [0, 0, 0.02]  # its edge lies behind the plane, and is what one sees
    assert cut(withdrawn, 0.01) == pytest.approx(cone[0, :, :2])


# -- beside states

PRESSURES = (4e3, 8e3, 16e3)


@pytest.fixture(scope="module")
def states():
    return dbvfiv.load(thesis_case(), SMALL).steady(pressure=list(PRESSURES)).states


def write_all(folder, states, lip=1.0):
    """Tables that say what was computed, areas 5 % more, and points `lip` mm outside the lips, before their edges."""
    mesh, state = states[0].results.mesh, states[1]
    rows = "".join(f"{s.pressure}, {s.mass_flow}, {1.05e4 * s.outlet_area}\n" for s in states)
    (folder / "areas.csv").write_text("pressure [Pa], flow [kg/s], area [cm2]\n" + rows + "12e3, 30, 40\n")
    inner, outer = (1e3 * face[mesh.rows] for face in faces(mesh, state.nodal))
    edges = np.diff(inner[0, :4, :2], axis=0)
    normal = edges[:, ::-1] * [-1, 1] / np.linalg.norm(edges, axis=1)[:, None]
    points = 0.5 * (inner[0, 1:4, :2] + inner[0, :3, :2]) + lip * normal
    (folder / "lips.csv").write_text(
        "\n".join(["pressure [kPa], x [mm], y [mm]", *(f"8, {x:.12g}, {-y:.12g}" for x, y in points)])
    )
    lines = [f"8, {z:.12g}, outer, 0, {y:.12g}" for _, y, z in outer[2:6, 0]] + ["90, 0, inner, 0, 5"]
    (folder / "sections.csv").write_text("\n".join(["pressure [kPa], z [mm], face, x [mm], y [mm]", *lines]))
    taps = (state.station_pressure + state.outlet_pressure)[[1, 4, 7]]
    lines = [f"8, {1e3 * z:.12g}, {p / 1e3 - 0.2:.12g}" for z, p in zip(mesh.z[[1, 4, 7]], taps)]
    (folder / "taps.csv").write_text("\n".join(["pressure [kPa], z [mm], tap [kPa]", *lines, "8, 9000, 3"]))
    return [str(folder / f"{name}.csv") for name in ("areas", "lips", "sections", "taps")]


@pytest.fixture(scope="module")
def runs(states, tmp_path_factory):
    """Two steady runs with measured data, which have gone since."""
    folder = tmp_path_factory.mktemp("runs")
    files = write_all(folder, states)
    kept = []
    for angle in (54, 40):
        changes = {"steady.measured": files, "steady.pressures": PRESSURES, "layers.2.angle": angle}
        session = dbvfiv.load(thesis_case(), SMALL | changes).session
        kept.append(session.perform("steady", folder / f"{angle}.h5").path)
    for name in files:
        (folder / name).unlink()
    return kept


def test_measured_data_beside_states(runs, states):
    result = dbvfiv.load_result(runs[0])
    areas = result.measured.area
    assert areas.difference[:3] == pytest.approx(1 / 1.05 - 1, rel=1e-9) and np.isfinite(areas.computed[3])
    assert result.measured.discharge.difference[:3] == pytest.approx(0.0, abs=1e-12)
    document = result.summary()
    assert document["measured_area"][0]["computed_area"] == pytest.approx(states[0].outlet_area)
    taps = result.measured.taps
    assert taps.excess[:3] == pytest.approx(200.0, rel=1e-6) and np.isnan(taps.computed[3])
    assert document["measured_taps"][3]["computed_tap"] is None
    first, *centre, beyond = result.measured.shapes.sections
    assert len(first.points) == 3 and first.distance == pytest.approx(-1e-3, rel=1e-6)
    assert all(section.distance == pytest.approx(0.0, abs=1e-9) for section in centre) and len(centre) == 4
    assert beyond.curve is None and document["measured_sections"][-1]["root_mean_square"] is None
    assert json.dumps(document)
    told = "\n".join(result.lines())
    assert "Measured: 4 points of lip area; computed lip area over measured" in told
    assert "Measured: 8 points of the wall in 6 sections; the computed wall lies -1 to" in told
    assert "Measured: 4 pressures along the axis; computed less measured +0.2 kPa, +2.5 %" in told
    assert "at the 7 at pressures computed and within the valve; states at 90 kPa would have to be computed" in told


def test_figures_show_what_was_measured(runs, tmp_path):
    drawn = dbvfiv.load_result(runs[0]).figures()
    assert {"area-pressure", "measured-sections", "measured-centre-line"} <= set(drawn)
    for name in ("head-discharge", "area-discharge", "area-pressure", "measured-sections", "measured-centre-line"):
        assert any("measured" in line.get_label() for line in drawn[name].axes[0].lines), name
    assert len(drawn["passage"].axes[0].collections) == 1
    (points,) = [line for line in drawn["measured-sections"].axes[0].lines if line.get_label() == "measured"]
    assert len(points.get_xdata()) == 3


def test_steady_runs_are_compared_with_measured_data(runs, command_line, tmp_path):
    told = steady.compare([dbvfiv.load_result(run) for run in runs]).lines()
    areas, lips, taps = (
        told[next(i for i, line in enumerate(told) if line.startswith(name)) + 2].split()
        for name in (
            "Computed over measured lip area, %",
            "Sections, computed from measured",
            "Pressure along the axis",
        )
    )
    assert "Computed over measured flow, %" in told
    assert areas[:3] == ["1:", "4", "kPa,"] and areas[4:6] == ["cm2", "-4.762"]
    assert float(areas[6]) > -4.762  # the softer lips of 40 degrees
    assert lips[:8] == ["1:", "8", "kPa,", "lip,", "inner,", "3", "points", "1"] and taps[-2] == "0.2"
    document = json.loads(command_line("compare", *runs, "-o", tmp_path / "both.png", "--json").out)
    assert [run["label"] for run in document["runs"]] == ["angle 54", "angle 40"]
    ours, other = (run["measured_sections"][0]["root_mean_square"] for run in document["runs"])
    assert ours == pytest.approx(1e-3, rel=1e-6) and abs(other - ours) > 1e-5


# -- back pressure


@pytest.fixture(scope="module")
def pressed(tmp_path_factory):
    """Two runs under back pressure, the second with a wall of 0.9, held against the first one's passage and section."""
    folder = tmp_path_factory.mktemp("pressed")
    changes = SMALL | {"closure.max_step": "2 kPa", "closure.pressures": ["2 kPa", "4 kPa"]}
    first = dbvfiv.load(thesis_case(), changes).closure(output=folder / "plain.h5")
    state = first.states[-1]
    areas, shapes = folder / "areas.csv", folder / "shapes.csv"
    rows = "".join(f"{s.pressure}, {1e6 * s.least_opening + 3}\n" for s in first.states)
    areas.write_text("pressure [Pa], area [mm2]\n" + rows)
    outer = faces(first.mesh, state.nodal)[1][first.mesh.rows]
    row = 4
    lines = [f"4, {1e3 * outer[row, 0, 2]:.12g}, outer, 0, {1e3 * outer[row, 0, 1]:.12g}"]
    shapes.write_text("\n".join(["pressure [kPa], z [mm], face, x [mm], y [mm]", *lines]))
    kept = []
    for factor in (1.0, 0.9):
        more = {"closure.measured": [str(areas), str(shapes)], "valve.thickness_factor": factor}
        kept.append(dbvfiv.load(thesis_case(), changes | more).closure(output=folder / f"{factor}.h5").path)
    return kept


def test_measured_data_under_back_pressure(pressed):
    result = dbvfiv.load_result(pressed[0])
    assert result.measured.area.excess == pytest.approx(-3e-6, rel=1e-6)
    (section,) = result.measured.shapes.sections
    assert section.distance == pytest.approx(0.0, abs=1e-9)
    told = "\n".join(result.lines())
    assert "Measured: 2 points of passage left" in told and "Measured: 1 point of the wall in 1 section;" in told
    assert "measured-passage" in result.figures(["measured-passage"])
    assert result.summary()["measured_area"][0]["difference"] < 0


def test_closure_runs_side_by_side(pressed, command_line, tmp_path):
    figure = tmp_path / "beside.png"
    document = json.loads(command_line("compare", *pressed, "-o", figure, "--json").out)
    assert figure.stat().st_size > 1000 and document["runs"][1]["label"] == "thickness_factor 0.9"
    rows = document["comparison"]
    assert [row["pressure"] for row in rows] == [2e3, 4e3]
    for row, one, two in zip(rows, *(run["points"] for run in document["runs"])):
        for name in ("lip_seal", "contact_force", "max_displacement", "least_opening"):
            assert row[name] == pytest.approx([one[name], two[name]], rel=1e-9), name
            assert row[f"{name}_difference"] == pytest.approx([0.0, two[name] - one[name]], abs=1e-12)
        assert row["max_displacement_difference"][1] > 0  # a thinner wall gives way more
    out = "\n".join(closure.compare([dbvfiv.load_result(run) for run in pressed]).lines())
    assert "Largest displacement, mm" in out and "2: thickness_factor 0.9" in out
    assert "2: no buckling on its path, safety factor" in out and "Sections, computed from measured" in out


def test_runs_of_several_kinds_are_not_compared(pressed, runs, misused, tmp_path):
    misused("runs of one kind", "compare", pressed[0], runs[0], "-o", tmp_path / "no.png")
