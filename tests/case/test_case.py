"""The case model: defaults, units, overrides, copies, damping, words of the trade, texts made from the declarations."""

from __future__ import annotations

import inspect
import math
import subprocess
import sys
from operator import attrgetter
from pathlib import Path

import numpy as np
import pytest

import dbvfiv
from dbvfiv.case.axis import parse_axis, parse_point
from dbvfiv.case.describe import SYNONYMS, explain, page, walk
from dbvfiv.case.key_points import read_key_points
from dbvfiv.case.load import make_case
from dbvfiv.case.materials import shear_modulus_of
from dbvfiv.case.measured import read_measured
from dbvfiv.case.model import Case as PhysicsCase
from dbvfiv.case.model import change_case
from dbvfiv.case.parameters import PARAMETERS
from dbvfiv.case.quantity import Quantity
from dbvfiv.case.tables import read_drive_table, read_pump_table
from dbvfiv.case.valve import PRESETS
from dbvfiv.case.write import case_toml
from dbvfiv.errors import CaseError
from dbvfiv.fit.curves import read_curves
from dbvfiv.studies import KINDS
from dbvfiv.studies.case import THESIS, Case, load_case, thesis_case

ROOT = Path(__file__).resolve().parents[2]


def test_defaults_are_those_of_predictions():
    case = Case()
    assert case.fluid.continuity == "storage" and case.damping.model == "loss factor"
    assert case.materials.strain_level == "auto" and case.seeks_levels


def test_the_reference_case_is_the_thesis_and_names_what_is_its_own():
    """The file is made by `make docs`; the thesis's settings are the only keys that are not defaults."""
    assert load_case(ROOT / "cases/dbv12.toml") == thesis_case()
    text = (ROOT / "cases/dbv12.toml").read_text()
    assert text.partition("[valve]")[2] == case_toml(thesis_case()).partition("[valve]")[2], "run `make docs`"
    head = " ".join(line.removeprefix("# ") for line in text.partition("[valve]")[0].splitlines())
    assert f"12-inch inline valve, but for {', '.join(THESIS)}. Those are as the thesis has them." in head
    assert "the 12-inch inline valve." in " ".join(case_toml(Case()).replace("\n# ", " ").split())
    names = {info.key.split(".")[-1] for info in walk(Case) if not info.key.startswith("materials.NAME")}
    assert not [name for name in names if name not in text]


def test_the_defaults_are_the_12_inch_valve():
    case = Case()
    assert case.valve.length == pytest.approx(0.56)
    assert [case.valve.thickness_at(z) for z in (0.0, 0.2099, 0.25, 0.4, 0.56)] == [0.012, 0.012, 0.015, 0.019, 0.016]
    assert [layer.material for layer in case.layers] == ["CR", "SBR", "fibre", "fibre", "EPDM"]
    assert [layer.angle for layer in case.layers] == [0, 0, 54, -54, 0]
    assert math.fsum(layer.thickness for layer in case.layers) == pytest.approx(0.0143764)
    assert (case.mesh.around, case.mesh.along) == (28, 48)


@pytest.mark.parametrize(
    "override, key, value",
    [
        ("drive.pressure=36 kPa", "drive.pressure", 36000.0),
        ('drive.pressure="0.36 bar"', "drive.pressure", 36000.0),
        ("drive.pressure=29e3", "drive.pressure", 29000.0),
        ("valve.lip_radius=6.19 mm", "valve.lip_radius", 0.00619),
        ("valve.flange_radius = 139.19 mm", "valve.flange_radius", 0.13919),
        ("materials.strain_level=15 %", "materials.strain_level", 0.15),
        ("materials.strain_level=0.2", "materials.strain_level", 0.2),
        ("layers.2.angle=45 deg", "layers.2.angle", 45.0),
        ("layers.2.angle=0.5 rad", "layers.2.angle", math.degrees(0.5)),
        ("drive.unloaded_edge=1/28", "drive.unloaded_edge", 1 / 28),
        ("fluid.density=1.2 g/l", "fluid.density", 1.2),
        ("damping.alpha=5 1/s", "damping.alpha", 5.0),
        ("damping.alpha=5/s", "damping.alpha", 5.0),
        ("transient.step=3 ms", "transient.step", 0.003),
        ("supports.lip_stop_stiffness=1e5 kN/m", "supports.lip_stop_stiffness", 1e8),
        ("fluid.continuity=storage", "fluid.continuity", "storage"),
        ("fluid.unsteady=false", "fluid.unsteady", False),
        ("mesh.around=14", "mesh.around", 14),
        ("steady.pressures=['1 kPa', 2000]", "steady.pressures", (1000.0, 2000.0)),
        ("valve.wall_map.0.thickness=13 mm", "valve.wall_map.0.thickness", 0.013),
    ],
)
def test_overrides_become_si(override, key, value):
    found = load_case(None, [override])
    for part in key.split("."):
        found = found[int(part)] if part.isdigit() else getattr(found, part)
    assert found == pytest.approx(value, rel=1e-14) if isinstance(value, float) else found == value


def test_a_quantity_in_its_usual_unit_is_the_same_float():
    # otherwise a case file in mm and kPa would not equal the defaults
    assert load_case(None, ["drive.pressure=17.23 kPa"]).drive.pressure == 17230.0
    quantity = PARAMETERS["pressure"].quantity
    for number in range(1, 2000):
        assert quantity.parse(f"{number / 100} kPa") == number * 10.0


@pytest.mark.parametrize(
    ("given", "si", "value"),
    [
        ("3000 rpm", "Hz", 50.0),
        ("200 rad/s", "Hz", 100 / math.pi),
        ("360 deg/s", "Hz", 1.0),
        ("2 kHz", "Hz", 2000.0),
        ("60 1/min", "Hz", 1.0),
        ("200 rad/s", "1/s", 200.0),
        ("100 gpm", "m^3/s", 0.006309019640),
        ("1 MGD", "m^3/s", 0.0438126363889),
        ("2 cfs", "m^3/s", 0.056633693184),
    ],
)
def test_units_of_the_trade_and_of_angular_velocities_in_hertz(given, si, value):
    assert Quantity(si).parse(given) == pytest.approx(value, rel=1e-12)


def test_overrides_win_over_the_file_and_each_other(tmp_path):
    file = tmp_path / "a.toml"
    file.write_text("[drive]\npressure = '2 kPa'\n[fluid]\ndensity = 10")
    case = load_case(file, ["drive.pressure=3 kPa", "drive.pressure=4 kPa"])
    assert (case.drive.pressure, case.fluid.density) == (4000.0, 10.0)


def test_replace_leaves_the_original_alone_and_checks_again():
    case = Case()
    changed = case.replace({"drive.pressure": "36 kPa", "layers.2.angle": 45, "layers.3.angle": -45})
    assert changed.drive.pressure == 36e3 and [c.angle for c in changed.layers] == [0, 0, 45, -45, 0]
    assert case == Case()
    counted = case.replace(
        {"drive.pressure": np.int64(6000), "levels.pressures": [np.float32(2e3)], "modes.count": np.int64(2)}
    )
    assert (counted.drive.pressure, counted.levels.pressures, counted.modes.count) == (6e3, (2e3,), 2)
    assert case.replace({"drive": {"pressure": np.int64(6000)}}).drive.pressure == 6e3
    with pytest.raises(CaseError, match="fluid.density"):
        case.replace({"fluid.density": -1})


@pytest.mark.parametrize(
    "given",
    [
        ["downstream.length=2", "downstream.pipe_diameter=0.4"],
        ["report.heads=5000", "life.precursor=2e-5"],
        ["project.tag=12", "project.date=2026-11-29"],
        ["downstream.length=2"],
        ["downstream.length=-2", "downstream.pipe_diameter=400 mm"],
    ],
)
def test_changes_from_python_are_those_of_set(given):
    found = []
    for make in (lambda: change_case(Case(), given), lambda: load_case(None, given)):
        try:
            found.append(make())
        except CaseError as error:
            found.append(str(error).removeprefix("In an override, "))
    assert found[0] == found[1]


def test_texts_may_be_numbers_and_dates():
    project = load_case(None, ["project.tag=12", "project.date=2026-11-29", "project.revision=2"]).project
    assert (project.tag, project.date, project.revision) == ("12", "2026-11-29", "2")
    with pytest.raises(CaseError, match="revision"):
        load_case(None, ["project.revision=1.10"])  # 1.1 as a number
    assert change_case(Case(), "report.heads=5000").report.heads == (5000.0,)


def test_a_case_cannot_be_changed_in_place():
    with pytest.raises(ValueError):
        Case().drive.pressure = 3.0


def test_own_and_built_in_materials():
    case = load_case(
        None,
        [
            "materials.CR={kind='neo-hookean', shear_modulus='1 MPa', density=1100}",
            "materials.skin={kind='shipped', rubber='SBR', strain_level='20 %'}",
            "layers.0.material=skin",
        ],
    )
    materials = case.materials
    assert materials.card("CR").shear_modulus == 1e6
    assert (materials.card("SBR").kind, materials.card("SBR").strain_level) == ("shipped", 0.1)
    assert materials.card("skin").strain_level == 0.2
    assert materials.card("fibre").fibre_modulus == 3460e6 and materials.card("fibre").density == 1270
    with pytest.raises(KeyError):
        materials.card("teflon")


SPREADSHEETS = [
    (read_drive_table, "time [s], pressure [kPa]\n0.0, 1.5\n0.25, 2.75\n1, 12.5 kPa\n"),
    (read_pump_table, "flow [L/s], head [m]\n0, 12.5\n50.5, 9.25\n"),
    (read_measured, "pressure [kPa], flow [L/s]\n1.5, 10.25\n2.5, 15\n"),
    (read_measured, "pressure [kPa], z [mm], face, x [mm], y [mm]\n1.5, 0.5, outer, -0.25, 10.125\n"),
    (
        read_key_points,
        "x [mm], y [mm], z [mm]\n" + "".join(f"0, 9.5, {z}\n7.5, 7.25, {z}\n9.5, 0, {z}\n" for z in "09"),
    ),
    (read_curves, "engineering_strain [%], nominal_stress [MPa]\n0.0, 0.0\n10.5, 0.25\n20.5, 0.375\n"),
]


@pytest.mark.parametrize(("read", "text"), SPREADSHEETS, ids=lambda x: getattr(x, "__name__", ""))
@pytest.mark.parametrize("mark", [";", "\t"])
def test_tables_may_have_decimal_commas(read, text, mark, tmp_path):
    """Semicolons or tabs between cells and commas within numbers, as spreadsheets of half the world write them."""
    file = tmp_path / "table.csv"
    file.write_text(text)

    expected = repr(read(file))
    file.write_text(text.replace(",", mark).replace(".", ","))
    assert repr(read(file)) == expected


def test_a_semicolon_in_a_remark_divides_no_row_below_a_header_with_commas(tmp_path):
    file = tmp_path / "table.csv"
    file.write_text('engineering_strain [%], nominal_stress [MPa], remark\n0, 0, "clamped; new"\n10, 0.25,\n')
    (test,) = read_curves(file)
    assert test.strain.tolist() == [0.0, 0.1] and test.stress.tolist() == [0.0, 0.25e6]


def test_key_points_are_found_beside_the_case_file(tmp_path):
    points = [(0.1 * j, 0.01 * (j < 14), 0.07 * i) for i in range(9) for j in range(15)]
    (tmp_path / "points.txt").write_text("# x y z\n" + "\n".join("{:g} {:g} {:g}".format(*p) for p in points))
    (tmp_path / "a.toml").write_text("[valve]\nkey_points = 'points.txt'")
    case = load_case(tmp_path / "a.toml")
    assert case.valve.key_points == (tmp_path / "points.txt").resolve()
    (tmp_path / "points.txt").write_text("1 2 3\n" * 134)
    with pytest.raises(CaseError, match="holds one profile"):
        load_case(tmp_path / "a.toml")
    (tmp_path / "points.txt").write_text("1 2 3\n" * 5 + "1 2\n")
    with pytest.raises(CaseError, match="line 6"):
        load_case(tmp_path / "a.toml")
    # a stored case can be rebuilt where the file is gone
    assert Case.from_dict(case.to_dict()) == case


def test_errors_know_key_and_line(tmp_path):
    (tmp_path / "a.toml").write_text('# a\n[valve]\nsaddle = "ruled"\n\nlip_radius = "6 kPa"\n')
    with pytest.raises(CaseError) as info:
        load_case(tmp_path / "a.toml")
    assert (info.value.key, info.value.line) == ("valve.lip_radius", 5)


LOSS, RAYLEIGH = {"damping.model": "loss factor"}, {"damping.model": "rayleigh"}
SIX_INCH = {"valve.wall": "uniform", "valve.wall_thickness": 0.007, "valve.lip_half_width": 0.062}
PLY = {"kind": "orthotropic", "e1": 3e6, "e2": 1e6, "nu12": 0.4, "g12": 1e6, "g13": 1e6, "g23": 1e6, "density": 1}
MOONEY = {"kind": "mooney-rivlin", "c10": "-1.5 MPa", "c01": "2.1 MPa", "c11": 7, "density": 1}


@pytest.mark.parametrize("comments", [True, False])
@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"drive.pressure": 12345.678901234567, "valve.lip_radius": 0.0061999999999999999, "layers.1.angle": -0.1},
        {"materials.A": PLY, "materials.a b": MOONEY},
        {"valve.scale": 3},
        SIX_INCH | {"valve.lip_radius": "8 mm", "valve.flange_wall_deduction": "4 mm"},
        {"valve.patches": [{"end": 0.21, "around_from": 0.9, "extra": 0.002}, {"thickness": 0.013}]},
        LOSS | {"damping.loss_factor": 0.5, "damping.band": [2, "300 Hz"]},
        LOSS | {"materials.CR.loss_factor": "NBR", "materials.fibre.prony": [[0.1, "3 ms"], [0.2, 1]]},
        RAYLEIGH,
        RAYLEIGH | {"damping.beta": 0.001},
        {"project.customer": 'ACME "\\"\nMain\tStreet\x7f\x01', "uncertainty.inputs": {"thickness": "normal(5 %)"}},
    ],
)
def test_written_text_reads_back_as_the_same_case(tmp_path, changes, comments):
    case = Case().replace(changes)
    (tmp_path / "b.toml").write_text(case_toml(case, comments=comments))
    assert load_case(tmp_path / "b.toml") == case
    assert Case.from_dict(case.to_dict()) == case


@pytest.mark.parametrize("comments", [True, False])
@pytest.mark.parametrize(
    "override", ["drive.pressure=2 kPa", "steady.pressures=[2e3, 6e3]", "closure.rated_pressure=8e3"]
)
def test_written_text_asks_for_the_same_pressures(tmp_path, override, comments):
    """Lists of pressures that were not given are not given in the text either."""
    case = load_case(None, [override])
    (tmp_path / "b.toml").write_text(case_toml(case, comments=comments))
    again = load_case(tmp_path / "b.toml")
    assert again == case and again.replace({"closure.rated_pressure": 2e3}).closure.pressures == (2e3, 3e3)
    assert again.steady_pressures() == case.steady_pressures()
    assert again.straining_pressures() == case.straining_pressures()


def test_the_reference_page_is_up_to_date():
    assert (ROOT / "docs/case-reference.md").read_text() == page(Case), "run `make docs`"


def test_every_key_is_described():
    for info in walk(Case):
        assert info.description.endswith("."), info.key
        assert info.allowed, info.key
        assert explain(Case, info.key)[0].description


def test_parameter_ranges():
    axis = parse_axis("density=1:1000:4:log")
    assert axis.key == "fluid.density" and axis.values == pytest.approx((1, 10, 100, 1000))
    assert parse_axis("pressure=0.5 kPa:50 kPa:3").values == (500.0, 25250.0, 50000.0)
    assert parse_axis("alpha=0:5:2").values == (0.0, 5.0)
    with pytest.raises(ValueError, match="start is below 0"):
        parse_axis("alpha=-1:5:3")
    with pytest.raises(ValueError, match="gives pressure twice"):
        parse_point("pressure=1 kPa, pressure=2 kPa")
    for text in ("pressure=0", "density=0", "pipe_length=0 m"):
        with pytest.raises(ValueError, match="is not within more than 0 to"):
            parse_point(text)
    assert parse_point("alpha=0") == {"alpha": 0.0}
    assert load_case(None, ["damping.alpha=.5", "drive.pressure=5."]).damping.alpha == 0.5
    assert parse_axis("pressure=0.5 kPa, 2 kPa,1 m", density=1000.0).values == (500.0, 2000.0, 1000.0 * 9.80665)


@pytest.mark.parametrize(
    "text, overrides, expected",
    [
        ("", [], None),
        ("[drive]\npressure = 5e3", [], (5e3,)),
        ("[steady]\npressures = [1e3, 2e3]", [], (1e3, 2e3)),
        ("[drive]\npressure = 5e3\n[steady]\npressures = [1e3, 2e3]", [], (1e3, 2e3)),
        ("[steady]\npressures = [1e3, 2e3]", ["drive.pressure=7 kPa"], (7e3,)),
        ("[drive]\npressure = 5e3", ["steady.pressures=[3e3]"], (3e3,)),
        ("[steady]\npressures = [1e3, 2e3]", ["drive.pressure=7 kPa", "steady.pressures=[3e3]"], (3e3,)),
        ("", ["closure.pressures=[4e3]", "drive.pressure=7 kPa"], (7e3,)),
    ],
)
def test_pressures_of_steady(tmp_path, text, overrides, expected):
    """What was given alone, or last, counts; the same by file, by override and by a change from Python."""
    (tmp_path / "a.toml").write_text(text)
    assert load_case(tmp_path / "a.toml", overrides).steady_pressures() == (expected or Case().steady.pressures)
    case = load_case(tmp_path / "a.toml")
    changes = {key: value for key, _, value in (o.partition("=") for o in overrides)}
    changes = {key: value if "[" not in value else [float(value.strip("[]"))] for key, value in changes.items()}
    changed = case.replace(changes).replace({"fluid.density": 10})
    assert changed.steady_pressures() == (expected or Case().steady.pressures)
    assert Case().steady_pressures() == Case().steady.pressures


@pytest.mark.parametrize("name", ["a" * 5000, "nowhere.h5", "bad\x00name"])
def test_a_start_file_that_cannot_be(name, refused):
    """A name longer than the system allows ended in a traceback."""
    with refused(CaseError, match="transient.start_file is given as .* which does not exist"):
        make_case(Case, {"transient": {"start": "state", "start_file": name}})


def test_every_study_brings_its_section_and_the_physics_does_without():
    case = Case()
    assert list(Case.model_fields) == [*PhysicsCase.model_fields, *KINDS]
    for kind in KINDS:
        keys = type(getattr(case, kind))
        assert keys.__module__ == f"dbvfiv.studies.{kind}"
        assert Case.model_fields[kind].description == inspect.getdoc(keys).splitlines()[0]
    physics = make_case(PhysicsCase, {name: case.to_dict()[name] for name in PhysicsCase.model_fields})
    assert physics.replace({"drive.pressure": "36 kPa"}).drive.pressure == 36e3
    with pytest.raises(CaseError, match="^steady is not a key of the case file"):
        make_case(PhysicsCase, {"steady": {}})


def test_keys_are_light_to_import():
    code = "import sys, dbvfiv.studies.case; print({'numpy', 'jax', 'scipy', 'h5py'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout == "set()\n"


def test_heads_in_ranges_are_those_of_the_fluid_of_the_case():
    heads = "onset.over=pressure=0.1 m:4 ft:8:log", "sweep.over=pressure=1 m:2 m:3"
    case = load_case(None, ("fluid.density=1025", *heads))
    weight = 1025 * 9.80665
    assert case.onset.axis.log and case.onset.axis.values[::7] == pytest.approx([0.1 * weight, 4 * 0.3048 * weight])
    assert case.sweep.axis.values == pytest.approx([weight, 1.5 * weight, 2 * weight])
    case = case.replace(
        {"onset.over": "sealing=0.1 m:.3 m:5", "map.y": "sealing=0.1 m,1. m", "sweep.over": "pressure=1. m:2 m:3"}
    )
    assert case.onset.axis.values[::4] == pytest.approx([0.1 * weight, 0.3 * weight])
    assert case.map.axes[1].values == pytest.approx([0.1 * weight, weight]) and case.map.axes[1].parameter == "sealing"
    assert case.sweep.axis.values[0] == pytest.approx(weight)


@pytest.mark.parametrize("text", ["pressure=5,10,20 kPa", "pressure=0.5:50 kPa:64", "thickness=0.5:120 %:3"])
def test_a_range_has_units_at_all_of_its_values_or_at_none(text):
    """A bare number is SI, and seldom meant so beside one with another unit."""
    with pytest.raises(ValueError, match="which has a unit at some of its values alone"):
        parse_axis(text, tuple(PARAMETERS))


@pytest.mark.parametrize(
    "text", ["pipe_length=1,1e1,3e1 m", "pressure=5 Pa:1e-1 kPa:3", "alpha=5:20 1/s:3", "beta=0:20 s:3"]
)
def test_ranges_in_si_units_and_from_0_may_be_short(text):
    assert parse_axis(text, tuple(PARAMETERS)).values[-1] in (30.0, 100.0, 20.0)


def test_numbers_that_are_not_given_follow_from_the_model():
    damping = Case().damping
    assert (damping.model, damping.alpha, damping.beta, damping.loss_factor) == ("loss factor", 0.0, 0.0, 1.0)
    assert (damping.band, damping.branches) == ((1.0, 200.0), 4)
    damping = Case().replace(RAYLEIGH).damping
    assert (damping.alpha, damping.beta, damping.loss_factor) == (5.0, 0.003, 0.0)
    assert Case().replace(RAYLEIGH).replace(LOSS) == Case()
    assert Case().replace({"damping.band": ["0.1 Hz", "1 kHz"]}).damping.branches == 6


def test_what_is_given_stays():
    damping = Case().replace(LOSS | {"damping.alpha": 3, "damping.loss_factor": "1/2", "damping.branches": 6}).damping
    assert (damping.alpha, damping.loss_factor, damping.branches) == (3.0, 0.5, 6)
    assert Case().replace(LOSS | {"damping.beta": 0, "damping.loss_factor": 0}).damping.loss_factor == 0.0


def test_cases_of_earlier_versions_are_read():
    data = Case().to_dict() | {"damping": {"alpha": 5.0, "beta": 0.003}}
    assert Case.from_dict(data).damping.model == "rayleigh"


A = "[materials.A]\nkind='neo-hookean'\nshear_modulus=1e6\ndensity=1000\n"
ON = "[damping]\nmodel='loss factor'\n"


def test_materials_that_no_layer_uses_need_say_nothing(tmp_path):
    (tmp_path / "good.toml").write_text(ON + A)
    assert load_case(tmp_path / "good.toml").damping.relaxes


def test_parameters_that_the_model_lacks():
    rayleigh = Case().replace(RAYLEIGH)
    assert rayleigh.damping.lacks("beta") is None and Case().damping.lacks("loss_factor") is None
    assert "damping.model = 'rayleigh'" in rayleigh.damping.lacks("loss_factor")
    assert "damping.model = 'loss factor'" in Case().damping.lacks("beta")


RUBBER = "materials.NR"


def _of_hardness(hardness):
    text = f'{{kind="neo-hookean", shear_modulus="{hardness}", density=1100}}'
    return load_case(None, (f"{RUBBER}={text}",))


def test_modulus_is_that_of_gent():
    # E = 0.0981 x 515.6 / (0.137505 x 101.6) = 3.6205 MPa at 60 Shore A
    assert shear_modulus_of(60.0) == pytest.approx(3.6205e6 / 3, rel=1e-4)
    assert 0.18 < shear_modulus_of(65.0) / shear_modulus_of(60.0) - 1 < 0.24  # five points, a fifth


@pytest.mark.parametrize("words", ("60 Shore A", "60 ShA", "60 shore a", "60.0 Shore-A"))
def test_hardness_stands_where_the_modulus_does(words):
    assert _of_hardness(words).materials.card("NR").shear_modulus == pytest.approx(shear_modulus_of(60.0), rel=1e-12)


@pytest.mark.parametrize("words", ("120 Shore A", "10 Shore A", "60 Shore D"))
def test_other_hardness_is_refused_with_a_sentence(words):
    with pytest.raises(CaseError, match="shear_modulus"):
        _of_hardness(words)


@pytest.mark.parametrize("word", SYNONYMS)
def test_word_of_the_trade_leads_to_a_key_that_exists(word):
    key = SYNONYMS[word]
    assert key in {info.key for info in walk(Case)}
    with pytest.raises(CaseError, match="is not a key") as raised:
        explain(Case, f"valve.{word}")
    assert key in str(raised.value)


ALTERNATIVES = """
drive.head = "1 m"
damping = { model = "rayleigh", beta = "3 ms" }
upstream = { length = 3, roughness = "1 mm" }
valve.sealing_force = "500 N/m"
outside = { fluid = "same", pipe_diameter = "330 mm" }
"""


@pytest.mark.parametrize(
    ("override", "other"),
    [
        ("drive.pressure=2 kPa", "drive.head"),
        ("upstream.friction=0.02", "upstream.roughness"),
        ("valve.sealing_pressure=1 kPa", "valve.sealing_force"),
        ("valve.overlap=3 mm", "valve.sealing_force"),
        ("damping.model=loss factor", "damping.beta"),
        ("outside.fluid=none", "outside.pipe_diameter"),
    ],
)
def test_override_stands_in_the_place_of_the_key_that_says_the_same(tmp_path, override, other):
    path = tmp_path / "case.toml"
    path.write_text(ALTERNATIVES)
    before, after, name = load_case(path), load_case(path, [override]), override.partition("=")[0]
    where = other.replace("drive.head", "drive.pressure")
    replaced = before.replace({name: override.partition("=")[2]})
    for key in (name, where):
        assert attrgetter(key)(before) != attrgetter(key)(after) == attrgetter(key)(replaced)


@pytest.mark.parametrize("given", ['shear_modulus = "1 MPa"', 'hardness = "60 Shore A"'])
@pytest.mark.parametrize(("key", "value"), [("hardness", "70 Shore A"), ("shear_modulus", 1.5e6)])
def test_another_hardness_or_modulus_stands_in_the_place_of_either(tmp_path, given, key, value):
    path = tmp_path / "case.toml"
    path.write_text(f"materials.soft = {{ {given}, kind = 'neo-hookean', density = 1100 }}")
    found = load_case(path, [f"materials.soft.{key}={value}"]).materials.named["soft"].shear_modulus
    assert found == pytest.approx(shear_modulus_of(70.0) if key == "hardness" else value)


@pytest.mark.parametrize(
    ("given", "key"),
    [
        ("pipe_length=30 m", "upstream.length"),
        ("valve.hardness=60", "materials.NAME(neo-hookean).shear_modulus"),
        ("closure.back_pressure=5 m", "closure.rated_pressure"),
        ("head=2 m", "drive.head"),
        ("steady.heads=[1]", "steady.pressures"),
    ],
)
def test_unknown_key_names_the_one_that_holds_it(given, key):
    with pytest.raises(CaseError) as raised:
        load_case(None, [given])
    assert f"the nearest valid key is {key}" in str(raised.value)


@pytest.mark.parametrize(
    "change",
    [
        "fluid.density=800",
        "drive.pressure=7 kPa",
        "mesh.around=8",
        "transient.drive_table=drive.csv",
        "layers.0.angle=3",
    ],
)
def test_changes_in_python_are_those_of_set(tmp_path, change):
    """Units are those of the file, and names of files begin in its folder."""
    (tmp_path / "drive.csv").write_text("0, 1000\n1, 2000\n")
    (tmp_path / "own.toml").write_text('[drive]\npressure = "2 m"\n')
    set_, key = load_case(tmp_path / "own.toml", [change]), change.partition("=")[0]
    for changes in ([change], {key: change.partition("=")[2]}):
        made = dbvfiv.load(tmp_path / "own.toml", changes).case
        assert made == set_ and made.units == set_.units


@pytest.mark.parametrize(
    "changes",
    [
        {"materials.CR.loss_factor": 0.2},
        {"materials.rub.prony.0.0": 0.3},
        {"materials.rub.mu.0": 1e6},
        {"materials.rub.alpha.0": 2.5},
        {"materials.SBR.stiffness_factor": 1.1},
        {"upstream.pieces.0.roughness": "1 mm"},
        {"upstream.pieces": [{"length": 5.0}, {"length": 2.0}]},
        {"upstream.length": "3 m"},
    ],
)
def test_a_change_of_a_case_is_that_of_its_file(tmp_path, changes):
    """Single numbers of materials and of pieces change, and what says the same otherwise makes way."""
    (tmp_path / "own.toml").write_text(
        "[materials.CR]\nprony = [[0.1, 0.01]]\n[[upstream.pieces]]\nlength = 4\nfriction = 0.02\n"
        '[materials.rub]\nkind = "ogden"\nmu = [5e5, 1e5]\nalpha = [2, 4]\ndensity = 1200\nprony = [[0.2, 0.05]]\n'
    )
    found = dbvfiv.load(tmp_path / "own.toml", changes).case
    assert dbvfiv.load(tmp_path / "own.toml").replace(changes).case == found
    assert found != dbvfiv.load(tmp_path / "own.toml").case


def test_pieces_stand_in_the_place_of_one_pipe():
    pieces = load_case(ROOT / "cases/dbv12-in-line.toml", ["upstream.pieces=[{length=5}]"])
    assert pieces.upstream.whole_length == 5.0


@pytest.mark.parametrize("key", ["materials.SBR.loss_data", "transient.drive_table", "steady.measured"])
def test_a_file_that_python_names_keeps_its_full_name(tmp_path, monkeypatch, key):
    """A change of the folder does not lose it."""
    monkeypatch.chdir(tmp_path)
    tables = {"measured": "pressure [kPa], flow [L/s]\n1, 2\n", "drive_table": "0, 1000\n1, 2000\n"}
    loss = "frequency [Hz], loss_factor\n1, 0.1\n10, 0.2\n100, 0.3\n"
    (tmp_path / "t.csv").write_text(tables.get(key.rpartition(".")[2], loss))
    changes = {key: "t.csv"}
    assert dbvfiv.load().replace(changes).case == dbvfiv.load(changes=changes).case


@pytest.mark.parametrize("key", ["transient.drive_table", "steady.measured", "valve.key_points", "cycle.start_file"])
def test_a_missing_file_is_refused_by_every_door(tmp_path, key):
    (tmp_path / "own.toml").write_text("")
    with pytest.raises(CaseError, match=f"{key} is .*"):
        dbvfiv.load(tmp_path / "own.toml", {key: "nope.csv"})
    with pytest.raises(CaseError, match=f"{key} is .*"):
        dbvfiv.load(tmp_path / "own.toml").replace({key: "nope.csv"})


@pytest.mark.parametrize(
    "change, name",
    [
        ("materials.rubber.prony=[[0.1, 0.01]]", "rubber"),
        ("materials.rubber.loss_data=tan-delta.csv", "rubber"),
        ('valve.patches.0.thickness="10 mm"', ""),
    ],
)
def test_a_key_that_is_set_takes_the_place_of_what_says_the_same(change, name):
    """Damping data and the thickness of patches too."""
    case = load_case(ROOT / "cases/dbv4-wide.toml", [change])
    assert case.materials.named[name].loss_factor is None if name else case.valve.patches[0].extra is None


@pytest.mark.parametrize(
    "key, words",
    [
        ("identify.records[].frequency", "a frequency greater than 0 Hz"),
        ("identify.records[].damping_ratio", "a number greater than -1 and less than 1"),
        ("report.heads", "a list of pressures, each greater than 0 kPa"),
    ],
)
def test_what_is_allowed_holds_the_limits(key, words):
    """Numbers that may be left out, and those in lists, have theirs."""
    assert next(info.allowed for info in walk(Case) if info.key == key).startswith(words)


def test_how_far_a_bill_is_moulded_shut_goes_with_its_preset():
    case = load_case(ROOT / "cases/dbv4-moulded.toml", ["valve.moulded_length=20 mm"])
    given = next(name for name in PRESETS if getattr(case.valve, name))
    open_ = case.replace({f"valve.{given}": None})
    assert not open_.valve.is_preset and open_.valve.moulded_length == open_.valve.duckbill_length
    assert case.replace({"valve.overlap": "1 mm"}).valve.moulded_length == 0.02
