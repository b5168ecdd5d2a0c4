"""The case of a page: read, written, checked; nothing outside its folder is read."""

from __future__ import annotations

import asyncio
from collections import defaultdict
from contextlib import nullcontext, suppress
from pathlib import Path
from types import SimpleNamespace

import pytest
from hypothesis import given as drawn
from hypothesis import strategies as st

from dbvfiv.app.ask import AskPanel
from dbvfiv.app.see import PICTURES, RECORD, RunsPanel, arguments_of, map_figure
from dbvfiv.app.sheet import (
    bring,
    change,
    check,
    data_files,
    given,
    read_sheet,
    shown_as,
    stay_inside,
    usual_value,
    write_sheet,
)
from dbvfiv.app.worker import text_for_page
from dbvfiv.case.axis import parse_stability_axis
from dbvfiv.case.quantity import GRAVITY
from dbvfiv.case.valve import Valve
from dbvfiv.errors import CaseError
from dbvfiv.geometry.surface import key_point_table
from dbvfiv.studies.case import Case, load_case
from tests.app.server import COARSE

NUMBERS = st.integers(-(2**53), 2**53) | st.floats(allow_nan=False, allow_infinity=False) | st.booleans()
TEXTS = st.text(st.characters(blacklist_categories=("Cs",)), max_size=20)
VALUES = st.recursive(NUMBERS | TEXTS, lambda v: st.lists(v, max_size=3) | st.dictionaries(TEXTS, v, max_size=3))


@drawn(st.dictionaries(TEXTS, VALUES, max_size=5))
def test_what_is_written_reads_back(data):
    assert read_sheet(write_sheet(data)) == data


def test_keys_are_set_and_taken_away(tmp_path):
    data = read_sheet(COARSE)
    change(data, "drive.pressure", "1 m")
    change(data, "layers.0.thickness", "3 mm")
    assert given(data, "drive.pressure") == "1 m"
    case = check(data, tmp_path).case
    assert case.drive.pressure == pytest.approx(9806.65) and case.layers[0].thickness == 0.003
    change(data, "drive.pressure", " ")
    data["outside"] = {"fluid": "same", "pipe_diameter": "400 mm"}
    change(data, "outside.fluid", "")
    assert data.pop("outside") == {}  # and what needs it
    assert "pressure" not in data["drive"]


def test_an_element_of_a_list_that_was_not_given_is_set_in_its_default(tmp_path):
    """Keys of a layer without a value are left out of the text that drawing, questions and runs read."""
    data = {}
    change(data, "layers.0.thickness", "3 mm")
    text = write_sheet(data)
    assert "None" not in text and "None" not in write_sheet({"layers": [{"material": "CR", "begin": None}]})
    assert read_sheet(text) == data
    assert check(read_sheet(text), tmp_path).case == Case().replace({"layers.0.thickness": 0.003})


def test_a_key_stands_in_the_place_of_one_that_says_the_same(tmp_path):
    data = {"drive": {"head": "2 m"}}
    change(data, "drive.pressure", "1 m")
    assert check(data, tmp_path).case.drive.pressure == pytest.approx(9806.65)


@pytest.mark.parametrize("form", ['"{}"', "'{}'"])
@pytest.mark.parametrize("name", ["my points.txt", "data/POINTS.CSV", "{folder}/points.csv"])
def test_a_case_brings_the_files_that_it_names(tmp_path, name, form):
    """Under names that fit the page, wherever they are; a mark in front of its text is none of it."""
    case, home = tmp_path / "cases/mine.toml", tmp_path / "home"
    source = case.parent / name.format(folder=tmp_path)
    for folder in (source.parent, case.parent, home):
        folder.mkdir(parents=True, exist_ok=True)
    source.write_text(key_point_table(Valve(), 17))
    text = f"[valve]\nkey_points = {form.format(name.format(folder=tmp_path))}\n"
    case.write_text(text, encoding="utf-8-sig")
    brought = bring(case, home)
    assert check(read_sheet(brought), home).case.valve.key_points == home / source.name
    assert (brought == text) == (name == "my points.txt") and data_files(home) == [home / source.name]
    source.write_text("later")
    bring(case, home, anew=False)
    assert (home / source.name).read_text() == key_point_table(Valve(), 17)


def test_files_of_one_name_are_kept_apart(tmp_path):
    (tmp_path / "cases/old").mkdir(parents=True)
    for name in ("a.csv", "old/a.csv"):
        (tmp_path / "cases" / name).write_text(f"pressure [kPa], flow [L/s]\n2, {len(name)}\n3, 9\n")
    (tmp_path / "cases/mine.toml").write_text('[steady]\nmeasured = ["a.csv", "old/a.csv"]')
    brought = read_sheet(bring(tmp_path / "cases/mine.toml", tmp_path))["steady"]["measured"]
    assert brought == ["a.csv", "1-a.csv"] and "2, 9" in (tmp_path / "1-a.csv").read_text()


def test_a_result_of_many_processes_is_a_case_of_the_page(tmp_path):
    data = read_sheet(text_for_page(Case().replace({"map.workers": 4, "drive.pressure": 5e3})))
    assert check(data, tmp_path).case == Case().replace({"drive.pressure": 5e3})
    stay_inside({"map": {"workers": "tcp://10.0.0.1:8786"}}, runs=False)


def test_a_page_takes_so_many_elements(tmp_path):
    found = check({"mesh": {"around": 100, "along": 41}}, tmp_path)
    assert found.case is None and found.problems[0].endswith("make 4100 elements; a page takes 4000.")
    assert check({"mesh": {"around": 100, "along": 40}}, tmp_path).case.mesh.along == 40


def test_a_sheet_is_the_case_of_its_file(tmp_path):
    (tmp_path / "dbv6.toml").write_text(COARSE)
    assert check(read_sheet(COARSE), tmp_path).case == load_case(tmp_path / "dbv6.toml")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('[valve]\nduckbill_length = "-1 mm"', 'The case, line 2: valve.duckbill_length is given as "-1 mm"'),
        ("[valve]\nlenght = 1", "valve.lenght is not a key of the case file"),
        ("[mesh]\naround = 400\nalong = 400", "160000 elements"),
        ('[map]\nworkers = "tcp://10.0.0.1:8786"', "map.workers"),
        ('[valve]\nkey_points = "/etc/passwd"', "without their folder"),
        ('[valve]\nkey_points = "../../etc/passwd"', "without their folder"),
        ('[materials.CR]\nloss_data = "~/secret.csv"', "without their folder"),
        ('[uncertainty.inputs]\ndensity = "samples(/etc/passwd)"', "without their folder"),
        ('[steady]\nmeasured = ["..\\\\x.csv"]', "without their folder"),
    ],
)
def test_what_does_not_fit_is_said(tmp_path, text, said):
    found = check(read_sheet(text), tmp_path, text)
    assert found.case is None and said in found.problems[0]


@pytest.mark.parametrize("text", ["a = [", "[" * 5000, "x = " + "[" * 5000, "\0", "a = 1\n" * 60_000])
def test_what_is_no_sheet_is_a_sentence(text):
    with pytest.raises(CaseError):
        read_sheet(text)


@drawn(st.dictionaries(st.sampled_from(["valve", "layers", "mesh", "fluid", "drive"]), VALUES, max_size=3))
def test_no_data_raise(data):
    check(data, Path("."))


@drawn(st.dictionaries(st.sampled_from(["valve", "layers"]), VALUES, max_size=2), st.sampled_from(["", "1 mm"]))
def test_changes_of_any_data_are_made_or_refused(data, typed):
    for key in ("layers.0.thickness", "layers.7.angle", "valve.wall_map.1.to", "valve.scale"):
        with suppress(CaseError):
            change(data, key, typed)


def test_usual_values_have_units():
    assert usual_value(Case().drive, "pressure") == "18 kPa" and usual_value(Case().layers[2], "angle") == "54 deg"


def test_pictures_begin_above_the_pressure_downstream():
    case = load_case(None, ["drive.pressure=10 kPa", "downstream.pressure=5 kPa"])
    assert arguments_of(case, "Head-loss curve") == ["-p", "5.75 kPa:12.5 kPa:10"]
    assert arguments_of(case, "Root locus over head") == ["--over", "pressure=5750:12500:10"]
    case = load_case(None, ["drive.pressure=10 kPa"])
    assert arguments_of(case, "Root locus over head") == ["--over", "pressure=1500:15000:10"]


@pytest.mark.parametrize(("units", "span"), [("psi", "0.217557 psi:2.17557 psi"), ("m", "0.152957 m:1.52957 m")])
def test_pictures_keep_the_units_of_the_project(units, span):
    case = load_case(None, ["drive.pressure=10 kPa", f"project.units={units}"])
    assert arguments_of(case, "Head-loss curve") == ["-p", f"{span}:10"]


def test_sliders_have_the_unit_of_the_project():
    for units, unit, scale in (("bar", "bar", 1e5), ("m", "m", 9806.65), ("", "m", 9806.65)):
        found = shown_as(load_case(None, [f"project.units={units}"]), "pressure")
        assert (found["unit"], found["scale"]) == (unit, pytest.approx(scale))


def test_heads_beside_other_densities_are_of_a_fluid_that_is_named():
    figure, _ = map_figure(Case(), found_map("density"))
    assert figure["layout"]["xaxis"]["title"]["text"] == "Head of fluid of 1000 kg/m³, m"
    assert figure["data"][0]["x"] == pytest.approx([1 / GRAVITY, 2 / GRAVITY])
    figure, _ = map_figure(Case(), found_map("pipe_length"))
    assert figure["layout"]["xaxis"]["title"]["text"] == "Head of the fluid, m"


PICTURE = {"growth_rate": [[-2.0, 1.0]], "certified": [[True, False]], "onset_curves": []}


def found_map(name: str, **more) -> dict:
    axes = {"x": {"parameter": "pressure", "values": [1e3, 2e3]}, "y": {"parameter": name, "values": [1.0]}}
    return {axis: row | {"log": False} for axis, row in axes.items()} | PICTURE | {"continuity": "storage"} | more


@pytest.mark.parametrize(
    ("name", "changes", "own"),
    [
        ("density", {}, 1000.0),
        ("sealing", {"valve.sealing_pressure": 1.5e3}, 1.5),
        ("thickness", {"valve.thickness_factor": 0.8}, 1.0),
        ("angle", {"layers.2.angle": 40}, None),
        ("sealing", {}, None),
        ("pipe_length", {}, None),
    ],
)
def test_the_star_of_a_map_stands_where_the_case_has_both_values(name, changes, own):
    figure, _ = map_figure(Case().replace({"drive.pressure": 9806.65, **changes}), found_map(name))
    stars = [(line["x"], line["y"]) for line in figure["data"] if line.get("name") == "this installation"]
    assert stars == ([] if own is None else [([pytest.approx(1.0)], [pytest.approx(own)])])


def test_a_map_of_all_classes_is_drawn_by_the_motion_that_grows_fastest():
    leading = {"growth_rate": [[3.0, 1.0]], "certified": [[True, False]]}
    figure, _ = map_figure(Case(), found_map("density", leading=leading))
    assert figure["data"][0]["z"] == [[3.0, None]]


def test_a_map_of_both_flow_models_is_drawn_for_that_of_the_case():
    """With its name; cells without a certificate are blank, and words below name the margins that are drawn."""
    contours = [{"level": "4 %", "points": [[1e3, 1.0]]}]
    laws = [PICTURE | {"continuity": "quasi-steady"}, PICTURE | {"continuity": "storage", "contours": contours}]
    laws[1]["growth_rate"] = [[-3.0, 1.0]]
    figure, said = map_figure(Case(), found_map("density", laws=laws))
    assert figure["data"][0]["z"] == [[-3.0, None]] and figure["layout"]["title"]["text"] == "Flow model: storage"
    assert "margin 4 %" in said and "margin 4 %" in [line.get("name") for line in figure["data"]]
    figure, said = map_figure(Case(), found_map("density"))
    assert figure["data"][0]["z"] == [[-2.0, None]] and "title" not in figure["layout"] and "margin" not in said


ROWS = {"pressure": {"title": "Head", "unit": "m", "scale": 9806.65, "low": 980.665, "high": 24516.625, "own": 9806.65}}
ROWS |= {"density": {"title": "Density", "unit": "kg/m³", "scale": 1.0, "low": 500.0, "high": 1500.0, "own": 1e3}}


@pytest.mark.parametrize(
    ("clicked", "asked", "told"),
    [
        ({"density": 700.0}, {"pressure": 9806.65, "density": 700.0}, None),
        ({"density": 499.9999}, {"pressure": 9806.65, "density": 500.0}, None),
        ({"density": 10.0, "pressure": 2e3}, {}, "Density reaches from 500 to 1500 kg/m³ here, so that 10 is"),
        ({"wave_speed": 300.0}, {}, "cannot be moved here"),
    ],
)
def test_a_valve_that_is_being_built_is_asked_where_a_map_was_clicked(monkeypatch, clicked, asked, told):
    """The tab opens it first, by itself; what the sliders do not reach is told in place of an answer elsewhere."""
    said, moved, file = [], {}, Path("case.toml")

    async def day():
        built = asyncio.Event()

        async def about(_file, _do):
            await built.wait()
            return {"parameters": ROWS, "units": {}}

        workers = SimpleNamespace(of=lambda *_: (SimpleNamespace(about=about), None))
        panel = AskPanel(SimpleNamespace(file=file, tell=said.append, site=SimpleNamespace(workers=workers)))
        panel._status, panel._card = SimpleNamespace(), nullcontext()
        monkeypatch.setattr(AskPanel, "_draw_sliders", lambda self: None)
        monkeypatch.setattr(AskPanel, "_answer", lambda *_: asyncio.sleep(0))
        panel._boxes = {name: (SimpleNamespace(), SimpleNamespace()) for name in ROWS}
        panel.open()
        await asyncio.sleep(0)
        panel.open(clicked)
        built.set()
        await asyncio.sleep(0.01)
        panel._task.cancel()
        moved.update(panel.values)

    asyncio.run(day())
    assert moved == asked and (not said if told is None else told in said[0])


@pytest.mark.parametrize(
    ("outcome", "factor", "sought", "told"),
    [
        ("stable", 0.4, None, "begins at 0.4 × damping"),
        ("stable", None, 0.05, "none down to 0.05 × damping"),
        ("flutters", 2.3, None, "ends at 2.3 × damping"),
        ("flutters", None, 10.0, "no end up to 10 × damping"),
    ],
)
def test_where_flutter_ends_is_not_where_it_begins(outcome, factor, sought, told):
    panel, label = AskPanel(None), lambda: SimpleNamespace(classes=lambda **_: None)
    for name in ("margin", "factor", "verdict", "mark", "reason", "card", "modes"):
        setattr(panel, f"_{name}", label())
    panel._numbers, panel._units = defaultdict(label), defaultdict(lambda: ("m", 1.0))
    numbers = {"damping_ratio": 0.01, "critical_damping_factor": factor, "damping_sought": sought}
    answer = {"verdict": {"outcome": outcome, "reason": ""} | numbers, "bound": 0.0, "confirmed": True}
    panel._show(answer | {"state": defaultdict(float), "eigenvalues": []}, whole=True)
    assert panel._factor.content == f"<b>{told}</b>"


def test_a_record_is_compared_with_the_wall_that_the_sliders_move(monkeypatch, tmp_path, command_line):
    """Whose rubbers have the strain levels of the pressures that the case names, in its own units."""
    added, asked = [], []
    file = tmp_path / "case.toml"
    file.write_text('project.units = "m"\ndrive.head = "1 m"\nsteady.pressures = [50e3]\nfluid.density = 998\n')

    async def read():
        return b"time,p"

    page = SimpleNamespace(file=file, name="case", home=tmp_path, files=dict, checked=SimpleNamespace(case=Case()))
    page.asking = SimpleNamespace(values_of=lambda _: {"pressure": 9786.1, "density": 700.0, "loss_factor": 0.1})
    page.site = SimpleNamespace(runs=SimpleNamespace(add=lambda *given: added.extend(given)))
    monkeypatch.setattr(RunsPanel, "refresh", lambda self: None)
    asyncio.run(RunsPanel(page)._take(SimpleNamespace(file=SimpleNamespace(name="p.csv", read=read))))
    _, kind, _, files, arguments = added
    assert kind == "compare" and RECORD in files

    def settle(case, opening, *_):
        asked.append((opening, case.damping.loss_factor, case.fluid.density, case.units.name("pressure")))
        raise CaseError("Enough.")

    monkeypatch.setattr("dbvfiv.studies.session.settle_levels", settle)
    assert command_line("modes", file, *arguments).err.strip() == "Enough."
    assert asked == [(50e3, 0.1, 998.0, "m")]


@pytest.mark.parametrize(
    "keys",
    [{"damping.model": "loss factor", "damping.loss_factor": 5.0}, {"drive.pressure": 0.0, "gravity.direction": "-z"}],
)
def test_ranges_of_pictures_can_be_read(keys):
    case = Case().replace(keys)
    for title, (study, _) in PICTURES.items():
        for text in arguments_of(case, title):
            if "=" in text and study != "steady":
                parse_stability_axis(text)
