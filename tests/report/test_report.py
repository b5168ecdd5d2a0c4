"""A report: the questions of page one, verdicts equal to `modes`, nothing missing, failures named, computed once."""

from __future__ import annotations

import base64
import html
import io
import json
import os
import re
import signal
import sys
import time
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image

from dbvfiv.api import Valve
from dbvfiv.case.axis import parse_axis
from dbvfiv.case.units import UNITS
from dbvfiv.cli.pages import report as report_command
from dbvfiv.errors import CaseError
from dbvfiv.model import ValveModel
from dbvfiv.model.material_stability import material_stability
from dbvfiv.report import gather, parts, write_page, write_pdf
from dbvfiv.report.answers import UNKNOWN, answers, closes, loss_range, opens, trade
from dbvfiv.report.figures import vibration_figure
from dbvfiv.report.gather import Gathered, Run, _Studies, cycle_run, following, heads_of, planned, second_mesh
from dbvfiv.report.page import sheet
from dbvfiv.report.parts import _layers, heads_part, onset_part, steady_part
from dbvfiv.shell.section import Section, WallParts, Zones
from dbvfiv.studies.case import load_case
from dbvfiv.studies.cycle.study import CycleResult
from dbvfiv.studies.onset.search import NO_ONSET
from dbvfiv.studies.session import Session
from dbvfiv.studies.stability.verdict import Verdict
from dbvfiv.studies.steady.study import NOT_FOUND, Cracking
from dbvfiv.studies.workers import Lost, Workers
from tests.child import start
from tests.small_valves import THESIS_SET

#: A state that flutters, on a coarse mesh.
KEYS = [text.removeprefix("--set=") for text in THESIS_SET] + [
    "mesh.around=6",
    "mesh.along=8",
    "drive.pressure=6 kPa",
    "fluid.density=75",
    "damping.alpha=0",
    'report.heads=["2 kPa", "6 kPa"]',
    "closure.rated_pressure=10 kPa",
    "onset.coarse_mesh=0",
    "project.customer=Harbour board",
    "project.tag=V-7",
]
#: What takes longest.
LEFT_OUT = ("onset", "levels", "cycle", "mesh")


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A report: the page, and what it was made from."""
    folder = tmp_path_factory.mktemp("report")
    found = gather(load_case(None, KEYS), "valve", folder / "runs", LEFT_OUT, quiet=True)
    return found, write_page(found, folder / "page.html")


def text_of(page):
    """Words of a page, as a reader sees them."""
    body = re.sub(r"<script>.*?</script>|<style>.*?</style>", "", page.read_text(), flags=re.DOTALL)
    return " ".join(html.unescape(re.sub(r"<[^>]+>", " ", body)).split())


@pytest.mark.slow
def test_verdicts_are_those_of_modes(made):
    found, _ = made
    assert list(found.modes) == [2e3, 6e3]
    alone = Valve(load_case(None, [*KEYS, "modes.symmetry=all"])).modes(6e3).verdict
    own = found.modes[6e3].verdict
    assert (own.outcome, own.certain) == (alone.outcome, alone.certain) and own.outcome == "flutters"
    for name in ("growth_rate", "frequency", "damping_ratio", "critical_damping_factor"):
        assert getattr(own, name) == pytest.approx(getattr(alone, name), rel=1e-6, nan_ok=True)


def test_page_one_answers_the_four_questions(made):
    found, page = made
    by_question = {one.question.split(" from")[0].split(" at")[0]: one for one in answers(found)}
    assert [one.answer for one in by_question.values()][:3] == ["yes", "yes", "yes"]
    rated = found.get("closure").summary()["rated"]
    assert by_question["Does it seal"].answer == ("yes" if rated["sealed"] else "no")
    words = text_of(page)
    for one in answers(found):
        assert one.question in words and one.text in words and one.margin in words
    for given in ("Harbour board", "V-7", "cracking head", "jet velocity", "leak rate", "rated back pressure", "bill"):
        assert given in words


def test_chatter_is_told_with_all_its_frequencies(made):
    """From the least to the largest frequency of the heads that flutter, whichever grows fastest."""
    found, _ = made
    swings = [result.verdict.frequency for result in found.modes.values() if result.verdict.stable is False]
    told = next(one.text for one in answers(found) if "chatter" in one.question)
    ends = re.search(r", at ([\d.]+)(?: to ([\d.]+))? Hz", told)
    assert float(ends[1]) == pytest.approx(min(swings), rel=5e-3)
    assert float(ends[2] or ends[1]) == pytest.approx(max(swings), rel=5e-3)


@pytest.mark.parametrize("end, word", [(0.9, "verdict holds"), (1.1, "does not hold")])
def test_chatter_holds_while_one_head_chatters_at_the_most_damping(made, monkeypatch, end, word):
    found, _ = made
    factor = max(result.verdict.critical_damping_factor for result in found.modes.values())
    monkeypatch.setattr("dbvfiv.report.answers.loss_range", lambda _: (0.01, end * factor))
    told = next(one.uncertainty for one in answers(found) if "chatter" in one.question)
    assert any(word in line for line in told)


@pytest.mark.parametrize(
    "reasons, text",
    [
        (
            ("Nothing flows.", "Rubber."),
            "No certain verdict at 2 kPa: Nothing flows. No certain verdict at 6 kPa: Rubber.",
        ),
        (("Nothing flows.",) * 2, "No certain verdict at 2 kPa and 6 kPa: Nothing flows."),
    ],
)
def test_each_head_without_a_verdict_has_its_own_reason(made, monkeypatch, reasons, text):
    found, _ = made
    results = {p: SimpleNamespace(verdict=Verdict.undecided(why)) for p, why in zip(found.heads, reasons)}
    monkeypatch.setattr(type(found), "modes", property(lambda _: results))
    told = next(one for one in answers(found) if "chatter" in one.question)
    assert (told.answer, told.text) == (UNKNOWN, text)


@pytest.mark.parametrize(
    "verdicts, margin",
    [
        ((("stable", 0.3), ("stable", np.nan, 0.05)), "chatter begins at 0.3 times the damping"),
        ((("stable", np.nan, 0.05), ("stable", np.nan, 0.2)), "stable down to 0.2 times the damping"),
        ((("stable", np.nan, 0.05), ("stable", np.nan)), ""),
        ((("stable", 0.3), ("stable", np.nan)), ""),
        ((("stable", 0.3), ("undecided", np.nan)), ""),
        ((("flutters", 1.4), ("flutters", 1.2)), "quiet with 1.4 times the damping"),
        ((("flutters", 1.4), ("flutters", np.nan, 10.0)), "chatters up to 10 times the damping"),
        ((("flutters", 1.4), ("flutters", np.nan)), ""),
        ((("diverges", np.nan), ("stable", 0.3)), "no damping quiets what diverges"),
        ((("stable", 0.3),), ""),
    ],
)
def test_the_margin_in_damping_is_that_of_all_heads(verdicts, margin):
    assert on_chatter(with_verdicts(*(damped(*given) for given in verdicts))).margin == margin


def damped(outcome, factor, sought=np.nan):
    """A verdict with a multiple of the damping, and the last one that was looked at."""
    return Verdict(outcome, "", 1.0, 9.0, 0.02, factor, True, 90.0, sought)


def with_verdicts(*verdicts, keys=(), heads=(2e3, 6e3)):
    """A report on nothing but verdicts at its heads."""
    found = Gathered(load_case(None, [*KEYS, *keys]), "valve", heads, None)
    for i, verdict in enumerate(verdicts, 1):
        given = {"verdict": verdict, "stable": verdict.stable, "warnings": (), "failures": (), "certificates": {}}
        found.results[f"heads-{i}"] = SimpleNamespace(**given)
    return found


def on_chatter(found):
    return next(one for one in answers(found) if "chatter" in one.question)


@pytest.mark.parametrize(
    "verdicts, told",
    [
        ((("stable", 0.3), ("stable", np.nan, 0.05)), "down to 0.5 times: the verdict holds"),
        ((("stable", 0.3), ("stable", 0.7)), "down to 0.5 times: the verdict does not hold"),
        ((("stable", 0.3), ("stable", np.nan, 0.6)), "down to 0.5 times: not examined"),
        ((("flutters", np.nan, 10.0), ("flutters", 1.3)), "up to 1.5 times: the verdict holds"),
        ((("flutters", 1.2), ("flutters", 1.3)), "up to 1.5 times: the verdict does not hold"),
        ((("flutters", 1.2), ("flutters", np.nan)), "up to 1.5 times: not examined"),
        ((("diverges", np.nan), ("stable", 0.7)), "up to 1.5 times: the verdict holds"),
    ],
)
def test_a_verdict_over_the_range_of_the_loss_factors_is_on_what_was_looked_at(monkeypatch, verdicts, told):
    monkeypatch.setattr("dbvfiv.report.answers.loss_range", lambda _: (0.5, 1.5))
    (line,) = (x for x in on_chatter(with_verdicts(*(damped(*v) for v in verdicts))).uncertainty if "loss factors" in x)
    assert line == f"over the range of the loss factors, {told}"


@pytest.mark.parametrize(
    "keys, expected",
    [
        ([], (0.4, 2.0)),  # that of the fibre
        (["damping.loss_factor=2"], (0.2, 1.0)),
        (["damping.loss_factor=0"], None),
        ([f"materials.{name}.loss_factor=0.3" for name in ("CR", "SBR", "EPDM", "fibre")], None),
        (
            ["materials.CR.loss_factor=NBR", *(f"materials.{x}.loss_factor=1" for x in ("SBR", "EPDM", "fibre"))],
            (0.5, 1.5),
        ),
    ],
)
def test_the_range_of_the_loss_factors_is_that_of_the_shipped_ones_that_the_case_has(keys, expected):
    assert loss_range(load_case(None, keys)) == (None if expected is None else pytest.approx(expected))


def test_reasons_of_studies_are_told_in_the_units_of_the_case():
    found = with_verdicts(*[Verdict.undecided("The wall at 6 kPa is 3 mm thin.")] * 2, keys=["project.units=psi, in"])
    assert on_chatter(found).text.endswith("at 0.29 psi and 0.87 psi: The wall at 0.87 psi is 0.118 in thin.")


def test_heads_that_flutter_and_heads_that_diverge_are_told_apart():
    flutters = Verdict("flutters", "", 3.0, 31.0, -0.015, certain=True)
    diverges = Verdict("diverges", "", 0.5, 0.0, 0.03, certain=True)
    found = with_verdicts(flutters, diverges)
    assert on_chatter(found).text == "It flutters at 2 kPa, at 31 Hz. It diverges, without oscillating, at 6 kPa."
    assert found.worst == 6e3  # the second mesh has a look at that, and not at a stable head or a lesser evil
    assert on_chatter(with_verdicts(diverges, diverges)).text == "It diverges, without oscillating, at 2 kPa and 6 kPa."


def test_the_least_damped_mode_is_that_of_a_head_that_has_modes():
    still, rings = Verdict("stable", "", certain=True), Verdict("stable", "", -2.0, 9.0, 0.04, certain=True)
    told = "Stable at all 2 heads in every symmetry class"
    said = on_chatter(with_verdicts(still, rings)).text
    assert said == f"{told}; the least damped mode has a damping ratio of 4 %, at 6 kPa."
    assert on_chatter(with_verdicts(still, still)).text == f"{told}."


@pytest.mark.parametrize(
    "keys, told",
    [((), "class SS alone (both lips open and close)"), (("mesh.part=half",), "class S alone (both lips open and")],
)
def test_a_probability_of_chatter_names_the_class_that_was_looked_at(keys, told):
    """A valve that sways at the head of samples of which none flutters in the class of the equilibria."""
    found = with_verdicts(damped("stable", 0.3), damped("flutters", 1.2), keys=keys)
    point = {"value": 6e3, "probability": 0.0, "interval": [0.0, 0.014], "outcomes": {"diverges": {"probability": 0.0}}}
    found.results["chance"] = SimpleNamespace(points=[point], parameter="pressure")
    (said,) = (line for line in on_chatter(found).uncertainty if "probability" in line)
    assert said.startswith(f"probability of chatter at 6 kPa: 0 % (0 to 1.4 %), {told}")
    point["outcomes"]["diverges"]["probability"] = 0.3
    assert f": 0 % (0 to 1.4 %), of divergence 30 %, {told}" in " ".join(on_chatter(found).uncertainty)
    nothing = {
        "value": 12e3,
        "probability": None,
        "interval": [0.0, 1.0],
        "outcomes": {"diverges": {"probability": None}},
    }
    found.results["chance"].points.append(nothing)
    assert f"of divergence 30 %, not known at 12 kPa, {told}" in " ".join(on_chatter(found).uncertainty)


def test_onsets_are_told_with_their_kind_and_with_what_speaks_against_them():
    found = with_verdicts(damped("stable", np.nan), damped("flutters", np.nan))
    own = {"edge": True, "gains": True, "uncertainty": None, "confirmed": True, "note": None, "criticality": None}
    note = f"The mesh of 6 x 6 {NO_ONSET}{{}}, so its uncertainty is unknown."
    points = [
        own | {"value": 3e3, "frequency": 31.0},
        own | {"value": 4e3, "frequency": 30.0, "gains": False, "confirmed": False},
        own | {"value": 5e3, "frequency": 29.0, "note": note.format("")},
        own | {"value": 6e3, "frequency": 0.0, "note": note.format(" that was solved")},
    ]
    found.results["onset"] = SimpleNamespace(points=points, failures=(), case=found.case)
    assert on_chatter(found).text.partition("Hz. ")[2] == (
        "Chatter begins at 3 kPa, 31 Hz, ends at 4 kPa (not confirmed), 30 Hz and begins at 5 kPa (the second mesh "
        "has no onset like it), 29 Hz. "
        "Divergence begins at 6 kPa (the second mesh has no onset like it that was solved)."
    )
    rows = onset_part(found).tables[0].rows
    assert [row[1] for row in rows] == ["-", "-", "no such onset there", "no such onset there"]
    assert [row[3] for row in rows][:2] == ["unstable above", "stable above, not confirmed"]


def test_a_multiple_of_the_damping_that_is_not_known_is_none_that_was_looked_at():
    found = with_verdicts(damped("stable", np.nan, 0.05), damped("stable", np.nan))
    assert [row[5] for row in heads_part(found).tables[0].rows] == ["none to 0.05", "-"]
    found = with_verdicts(damped("stable", 0.4), damped("flutters", np.nan, 10.0))
    lines = {line.get_label(): line.get_xydata() for line in vibration_figure(found).axes[1].lines}
    assert lines["none found up to here"].tolist() == [[6.0, 10.0]] and "none found down to here" not in lines
    np.testing.assert_allclose(lines["chatter below"], [[2.0, 0.4], [6.0, np.nan]])


def test_the_band_of_a_verdict_on_several_classes_is_the_least_of_them():
    sways, parts = Verdict("stable", "", -1.0, 9.0, band=140.0), Verdict("stable", "", -2.0, 9.0, band=92.7)
    left_open = Verdict.undecided("Nothing.")
    assert Verdict.joined({"SS": parts, "SA": sways}).band == 92.7
    assert Verdict.joined({"SS": parts, "SA": left_open}).band == 92.7
    assert np.isnan(Verdict.joined({"SS": left_open, "SA": left_open}).band)


@pytest.mark.parametrize(
    "classes, factor, sought",
    [
        ({"SS": ("stable", 0.46), "SA": ("stable", np.nan, 0.05), "AA": ("stable", 0.6)}, 0.6, np.nan),
        ({"SS": ("stable", np.nan, 0.05), "SA": ("stable", np.nan, 0.1)}, np.nan, 0.1),
        ({"SS": ("stable", np.nan, 0.05), "SA": ("stable", np.nan)}, np.nan, np.nan),
        ({"SS": ("stable", 0.2), "SA": ("stable", np.nan)}, np.nan, np.nan),
        ({"SS": ("flutters", 1.3), "SA": ("stable", 0.6)}, 1.3, np.nan),
        ({"SS": ("flutters", 1.3), "SA": ("flutters", np.nan)}, np.nan, np.nan),
        ({"SS": ("flutters", 1.3), "SA": ("flutters", np.nan, 8.0), "AA": ("stable", np.nan, 0.05)}, np.nan, 8.0),
        ({"SS": ("stable", 0.5), "SA": ("undecided", np.nan)}, np.nan, np.nan),
    ],
)
def test_the_multiple_of_the_damping_is_that_of_all_classes(classes, factor, sought):
    joined = Verdict.joined({name: damped(*given) for name, given in classes.items()})
    found = joined.critical_damping_factor, joined.damping_sought
    assert found == pytest.approx((factor, sought), nan_ok=True)
    again = Verdict.read(json.loads(json.dumps(joined.summary())))
    assert (again.critical_damping_factor, again.damping_sought) == pytest.approx(found, nan_ok=True)
    assert ("damping_sought" in joined.summary()) == np.isfinite(sought)  # as in results that know of none


@pytest.mark.slow
def test_heads_at_which_a_verdict_is_one_on_the_fit_of_the_rubber_are_named(tmp_path):
    case = load_case(None, [*KEYS, 'report.heads=["2 kPa", "36 kPa"]'])
    found = gather(case, "valve", tmp_path, (*LEFT_OUT, "closure", "law"), quiet=True)
    model = ValveModel(case)
    sound = [material_stability(model, found.state(p, "steady").q, p).holds for p in found.heads]
    told = next(one.uncertainty for one in answers(found) if "chatter" in one.question)
    assert sound == [True, False]
    assert [line.split(" at ")[1].split(":")[0] for line in told if "not on the rubber" in line] == ["36 kPa"]


def test_nothing_asked_is_missing(made):
    found, page = made
    for name in {"answers", "steady", "heads", "onset", "closure", "strains", "layers", "law", "case"} - {*LEFT_OUT}:
        assert f'<section id="{name}"' in page.read_text(), name
    assert set(found.missing) <= {*LEFT_OUT}
    assert "mesh: not examined (It was left out.)" in text_of(page)
    assert not found.failed
    pressures = [state.pressure for state in found.get("closure").states]
    assert max(pressures) == pytest.approx(1.5 * 10e3)
    assert {2e3, 6e3} <= {state.pressure for state in found.get("steady").states}


def test_the_case_on_the_page_is_the_case(made, tmp_path):
    text = html.unescape(re.search(r"<pre>([^<]*)</pre></details>", made[1].read_text())[1])
    (tmp_path / "again.toml").write_text(text)
    assert load_case(tmp_path / "again.toml") == made[0].case


def test_pictures_are_in_the_page_and_nothing_is_fetched(made):
    text = made[1].read_text()
    page = re.sub(r"<script>.*?</script>", "", text, flags=re.DOTALL)
    assert not re.search(r"""(src|href)=["']?(https?:)?//""", page)
    images = re.findall(r'src="data:image/png;base64,([^"]+)"', page)
    assert len(images) >= 5
    for image in images:
        picture = Image.open(io.BytesIO(base64.b64decode(image)))
        assert picture.width > 300 and len(np.unique(np.asarray(picture.convert("L")))) > 20  # more than an empty frame
    numbers = [int(n) for n in re.findall(r"<figcaption>Figure (\d+)\.", page)]
    assert numbers == list(range(1, len(numbers) + 1))


def test_numbers_of_tables_have_units(made):
    """Every column of numbers names its unit, but for those that have none."""
    plain = {
        "K",
        "layer",
        "flow model",
        "verdict",
        "counts agree",
        "shut",
        "chatter begins at times the damping",
        "beta, s",
    }
    known = {name for _, names in UNITS.values() for name in names}
    heads = re.findall(r"<th>(.*?)</th>", made[1].read_text())
    assert len(heads) > 20
    for head in heads:
        title = html.unescape(head)
        unit = title.rpartition(", ")[2]
        assert (
            title in plain
            or unit in known | {"1/s", "Hz", "%", "gpm", "m3/h", "N", "L/h", "MPa", "s", "degrees"}
            or (not re.search(r"pressure|flow|opening|loss,|length", title) or " at " in title)
        ), title


def test_layers_are_as_thick_as_they_are_where_they_are():
    """A filler from 210 to 490 mm between rubbers, which fill the wall where it is not."""
    rubber, ply = ({"material": name, "thickness": size} for name, size in (("CR", 0.006), ("fibre", 0.001)))
    case = load_case().replace({"layers": [rubber, ply | {"begin": 0.21, "end": 0.49, "angle": 54}, rubber]})
    wall = Section(tuple(SimpleNamespace(thickness=layer.thickness) for layer in case.layers))
    walls = WallParts(wall, Zones.of(np.array([[1, 0, 1], [1, 1, 1], [1, 1, 1], [1, 0, 1]])))
    mesh = SimpleNamespace(
        thickness=np.array([0.012, 0.015, 0.019, 0.016]),
        layer_names=("CR", "fibre", "CR"),
        layer_angles=np.array([0.0, 54.0, 0.0]),
        layer_fractions=wall.fractions,
    )
    result = SimpleNamespace(case=case, mesh=mesh, model=SimpleNamespace(shell=SimpleNamespace(at_rest=walls)))
    rows = _layers(result, case.units).rows
    assert [row[2] for row in rows] == ["6 to 8.769", "1.154 to 1.462", "6 to 8.769"]
    assert [row[1] for row in rows] == ["CR", "fibre (z = 210 to 490 mm)", "CR"]
    everywhere = case.replace({"layers": [rubber, ply, rubber]})
    rows = _layers(SimpleNamespace(case=everywhere, mesh=mesh), case.units).rows
    assert [row[2] for row in rows] == ["5.538 to 8.769", "0.9231 to 1.462", "5.538 to 8.769"]
    assert [row[1] for row in rows] == ["CR", "fibre", "CR"]


def test_figures_of_steady_states_and_of_the_closure_have_names_of_their_own(monkeypatch):
    monkeypatch.setattr(parts, "picture", lambda name, *_, **__: SimpleNamespace(name=name))
    case, numbers = load_case(), ("pressure", "sealed_length", "leak", "contact_force", "max_displacement")
    state = SimpleNamespace(**dict.fromkeys(numbers, 1.0), closed=True, beyond_limit=False)
    drawers = dict.fromkeys(("measured-passage", "measured-sections"))
    result = SimpleNamespace(states=(state,), drawers=lambda: drawers, case=case, failures=(), remarks=lambda: ())
    found = SimpleNamespace(get={"closure": result}.get, case=case)
    part = parts.closure_part(found)
    assert [one.name for one in part.pictures] == ["closure", "closure-measured-passage", "closure-measured-sections"]
    assert part.tables[0].rows[0][1] == "yes"
    result.case = case.replace({"closure.supports": "held-lips"})
    assert parts.closure_part(found).tables[0].rows[0][1] == "held"


def test_verdicts_over_the_pipe_without_a_mode_have_no_damping_ratio(monkeypatch):
    monkeypatch.setattr(parts, "picture", lambda *_, **__: None)
    case = load_case("cases/dbv12-in-line.toml", ["project.units=kPa"])
    verdicts = [Verdict.not_valid("The rubber fails."), Verdict.of([-3 + 100j], 0, 0, True)]
    sweep = SimpleNamespace(values=(5.0, 20.0), verdicts=verdicts, case=case, failures=())
    (table,) = parts.pipe_part(SimpleNamespace(pipes={5e3: sweep}, case=case)).tables
    assert table.rows == (("5 kPa", "not valid", "stable, 3 %"),)


def test_a_stable_cycle_is_said_to_be_so_in_the_class_of_the_model(monkeypatch):
    monkeypatch.setattr(parts, "pictures_of", lambda *_: ())
    case = load_case(None, ["drive.pressure=6 kPa"])
    point = SimpleNamespace(value=6e3, amplitude=3e-3, frequency=8.0, lip_least=0.0, lip_largest=9e-3, stable=True)
    result = SimpleNamespace(case=case, parameter="pressure", points=[point], nearest=lambda _: point, failures=())
    vars(result).update(
        onset=None, _row=None, special_points=(), reason="ends", remarks=lambda: CycleResult.remarks(result)
    )
    said, limit = parts.cycle_part(SimpleNamespace(case=case, get=lambda _: result)).sentences
    assert said.startswith("A stable limit cycle of 3 mm") and limit.startswith("Stable means: against perturbations")


def test_cycles_are_followed_from_onsets_that_open_and_close_the_lips():
    """Not from a nearer one at which the lips sway."""
    case = load_case(None, ["drive.pressure=6 kPa"])
    opens = {"edge": True, "value": 5e3, "gains": True, "frequency": 30.0, "symmetry": "SS"}
    sways = opens | {"value": 5.5e3, "symmetry": "SA"}
    onset = SimpleNamespace(points=(sways,))
    found = SimpleNamespace(case=case, get={"onset": onset}.get, modes={6e3: SimpleNamespace(stable=False)})
    assert not [*cycle_run(found)]
    onset.points = (sways, opens)
    (run,) = cycle_run(found)
    own = case.replace({"cycle.start": "file", "cycle.start_file": __file__}).replace(run.changes).cycle
    assert own.start_file is None and own.axis.values[0] == pytest.approx(4.9e3)  # a little before the onset


def test_a_second_report_computes_nothing(made):
    found, page = made
    folder = page.parent / "runs"
    before = {path.name: path.stat().st_mtime_ns for path in folder.iterdir()}
    # a new sheet is no new computation, and everything is told in its units
    case = load_case(None, [*KEYS, "project.revision=B", "project.units=ft"])
    again = gather(case, "valve", folder, LEFT_OUT, quiet=True)
    assert {path.name: path.stat().st_mtime_ns for path in folder.iterdir()} == before
    assert [one.answer for one in answers(again)] == [one.answer for one in answers(found)]
    assert {result.case.project for result in again.results.values()} == {case.project}


def test_a_study_that_fails_is_named_on_page_one(command_line, one_sentence, tmp_path):
    page = tmp_path / "page.html"
    (tmp_path / "runs").mkdir()
    (tmp_path / "runs" / "dbv12-heads-1.h5").mkdir()  # its file cannot be written
    keys = [word for key in (*KEYS, 'report.heads=["6 kPa"]') for word in ("--set", key)]
    without = [word for name in (*LEFT_OUT, "closure", "law", "steady") for word in ("--without", name)]
    outcome = command_line("report", *keys, *without, "--runs", tmp_path / "runs", "-o", page, "--json")
    assert outcome.status == 1 and "heads-1" in outcome.err
    answered = json.loads(outcome.out)["answers"]
    assert {one["answer"] for one in answered} == {UNKNOWN}
    assert "The study heads-1 failed" in text_of(page)


def test_a_study_over_which_workers_died_is_named_on_page_one(monkeypatch, tmp_path):
    class Dying(Workers):
        def share(self, tasks, ask):
            return ((task, Lost) for task in tasks)

    monkeypatch.setattr(sys.modules[gather.__module__], "Workers", Dying)
    without = (*LEFT_OUT, "closure", "law", "steady")
    found = gather(load_case(None, KEYS), "valve", tmp_path / "runs", without, workers=2, quiet=True)
    assert set(found.failed) == {"heads-1", "heads-2"}
    assert "The study heads-2 failed: 3 workers died" in text_of(write_page(found, tmp_path / "page.html"))


def test_a_strain_level_that_the_case_has_is_no_other_one():
    def levels(*keys):
        runs = planned(load_case(None, [*KEYS, *keys]))
        return [run.name for run in runs if run.part == "levels"]

    assert levels("materials.strain_level=10 %") == ["levels-steady-0.2"]
    assert levels("materials.strain_level=15 %") == ["levels-steady-0.1", "levels-steady-0.2"]


def test_heads_at_which_the_bill_is_sealed_have_rows_without_losses(made):
    """Heads that open keep their losses."""
    case = load_case("cases/dbv12-moulded.toml")
    losses = SimpleNamespace(head_loss=0.9, loss_coefficient=1234.0, kv=20.0, cv=23.0, line_loss=0.1)
    states = [
        SimpleNamespace(pressure=1e3, volume_flow=0.0, lip_opening=0.0, residual=0.0, hydraulics=None),
        SimpleNamespace(
            pressure=1e4, volume_flow=0.02, lip_opening=0.03, residual=0.0, hydraulics=losses, outlet_velocity=4.0
        ),
    ]
    cracking = Cracking(2.0, 6e3, 0.6118, sealed=True)
    nothing = SimpleNamespace(states=states, cracking=cracking, failures=(), drawers=dict, case=case)
    found = SimpleNamespace(
        case=case,
        get={"steady": nothing}.get,
        modes=made[0].modes,
        heads=tuple(made[0].modes),
        state=lambda _: states[0],
        missing={},
    )
    (table,) = steady_part(found).tables
    assert {len(row) for row in table.rows} == {len(table.head)} == {9}
    assert table.rows[0][3:] == ("-",) * 6 and table.rows[1][5:8] == ("1230", "20", "23")
    assert [row[1] for row in heads_part(found).tables[0].rows][-1] == "flutters (sealed)"
    answer = opens(found)  # the bill cracks above the heads examined, at a pressure that the case has besides
    assert answer.answer == "no" and answer.text.endswith("; they do at 0.612 m.")


@pytest.mark.parametrize(
    "top, text", [(12e3, "up to 12 kPa; they do at 13 kPa."), (20e3, "Cracks at 13 kPa; at 20 kPa")]
)
def test_the_lips_crack_above_the_pressure_downstream(top, text):
    case = load_case(None, [*KEYS, "downstream.pressure=10 kPa"])
    found = Gathered(case, "valve", (11e3, top), SimpleNamespace(bill_width=0.2, bill_height=0.1))
    losses = SimpleNamespace(head_loss=0.9)
    state = SimpleNamespace(pressure=top, lip_opening=0.03, volume_flow=0.02, outlet_velocity=4.0, hydraulics=losses)
    state.hydraulics = losses if top > 13e3 else None
    found.results["steady"] = SimpleNamespace(states=(state,), cracking=Cracking(2.0, 3e3, 0.3), failures=())
    assert text in opens(found).text
    assert ("cracking head", "3 kPa over that at rest") in trade(found)
    found.results["steady"].failures = ("The state at 11 kPa was not found.",)
    lost = f"{NOT_FOUND} Rising pressures lead to another equilibrium than the one that was found."
    unknown = SimpleNamespace(states=(state,), cracking=None, failures=(), warnings=(lost,))
    assert opens(replace(found, results={"steady": unknown})).text == lost
    assert opens(found).text.endswith(" No state was found at 11 kPa: The state at 11 kPa was not found.")


@pytest.mark.parametrize(
    "keys, answer, missed",
    [
        (["closure.rated_pressure=60 kPa"], "yes", ""),
        (["closure.rated_pressure=100 kPa"], UNKNOWN, "rated 100 kPa"),
        (["closure.pressures=[10 kPa, 60 kPa, 100 kPa]"], UNKNOWN, "100 kPa asked for"),
    ],
)
def test_a_back_pressure_that_was_not_reached_is_named(keys, answer, missed):
    case = load_case(None, [*(key for key in KEYS if "rated" not in key), *keys])
    found = Gathered(case, "valve", (2e3, 6e3), None)
    states = [SimpleNamespace(pressure=p, closed=True, beyond_limit=False) for p in (1e4, 6e4)]
    nothing = {"failures": (), "critical_pressure": None, "safety": None, "classes": (), "buckling": ()}
    found.results["closure"] = SimpleNamespace(states=states, case=case, **nothing)
    told = closes(found)
    missed = f"; no state was found at the {missed}" if missed else ""
    assert (told.answer, told.text) == (answer, f"Shut at 10 kPa and 60 kPa{missed}.")
    free = {"closure.rated_pressure": None, "closure.pressures": (60e3, 10e3)}
    found.case = found.results["closure"].case = case.replace(free)
    states.reverse()  # as closure.pressures has them
    assert (closes(found).answer, closes(found).text) == ("yes", "Shut at 10 kPa and 60 kPa.")
    states[0].closed = False
    assert (closes(found).answer, closes(found).text) == ("no", "Shut at 10 kPa.")
    states[0].closed, held = True, case.replace(free | {"closure.supports": "held-lips"})
    found.case = found.results["closure"].case = held
    assert (closes(found).answer, closes(found).text) == (UNKNOWN, "The lips are held shut by the supports.")


@pytest.mark.parametrize(
    "name, label", [("dbv12", "Static inlet pressure"), ("dbv12-in-line", "Pressure in the reservoir")]
)
def test_the_axis_of_the_heads_names_the_place_of_the_pressure(name, label):
    found = with_verdicts(damped("stable", 0.4), damped("stable", 0.4))
    found.case = load_case(f"cases/{name}.toml", ["project.units=kPa"])
    assert {axes.get_xlabel() for axes in vibration_figure(found).axes} == {f"{label}, kPa"}


@pytest.mark.parametrize("name, span, along", [("in-line", "4:100:6:log", None), ("moulded", "4:100:3:log", 24)])
def test_lengths_of_the_pipe_are_fewer_where_each_has_a_curve_of_equilibria(name, span, along):
    found = SimpleNamespace(case=load_case(f"cases/dbv12-{name}.toml"), worst=2e3, heads=(1e3, 2e3, 5e3), modes={})
    (pipe,) = (run.changes for run in following(found) if run.part == "pipe")
    assert pipe["sweep.over"] == f"pipe_length={span}" and pipe["drive.pressure"] == 2e3
    assert pipe.get("mesh.along") == along


@pytest.mark.parametrize(
    "stable, over",
    [
        ((True, False, True, True, True, False), (2e3, 5e3, 1e4, 2e4, 4e4, 7e4)),
        ((True, True, False, True, True, True), (5e3, 1e4, 2e4)),
        ((True, False, False, False, False, False), (2e3, 3.5e3, 5e3)),
    ],
)
def test_onsets_are_sought_between_the_heads_that_differ(stable, over):
    heads = (2e3, 5e3, 1e4, 2e4, 4e4, 7e4)
    found = with_verdicts(*(damped("stable" if one else "flutters", np.nan) for one in stable), heads=heads)
    (run,) = (run for run in following(found) if run.name == "onset")
    assert parse_axis(run.changes["onset.over"]).values == over


def test_the_valve_of_the_second_mesh_cracks_at_the_head_of_the_case(monkeypatch, tmp_path):
    sought = []

    def sealing(case, _ratio, _observer):
        sought.append(case.mesh.along)
        return 10.0 * case.mesh.along

    monkeypatch.setattr("dbvfiv.studies.session.sealing_for_cracking", sealing)
    cracks = {"valve.sealing_pressure": None, "valve.cracking_head": 0.1}
    given = Session(load_case("cases/dbv12-moulded.toml").replace(cracks))
    found = SimpleNamespace(state=lambda _: None)
    studies = _Studies(found, given.at_cracking(), tmp_path, 1, None, given)

    def of(**changes):
        return studies._asked(Run("mesh-modes", "modes", "", changes, 1)).case.valve.sealing_pressure

    assert of(**{"drive.pressure": 2e3}) == 480.0
    coarse = second_mesh(given.case)
    assert [of(**coarse), of(**coarse | {"drive.pressure": 2e3})] == [240.0, 240.0]
    assert sought == [48, 24]


def test_heads_are_those_asked_or_shares_of_the_largest_pressure():
    assert heads_of(load_case(None, ["report.heads=1 m:2 m:3"])) == pytest.approx([9806.65, 14709.975, 19613.3])
    heads = heads_of(load_case(None, ["drive.pressure=1 m"]))
    assert heads[-1] == pytest.approx(9806.65) and heads[0] < 0.05 * heads[-1]
    downwards = heads_of(load_case(None, ["drive.pressure=1 m", "gravity.direction=-z"]))
    assert min(downwards) > 0 and downwards == heads


def test_without_a_printer_the_pdf_says_what_is_missing(made, monkeypatch, one_sentence, tmp_path):
    monkeypatch.setattr("shutil.which", lambda name: None)
    monkeypatch.setattr("dbvfiv.report.page.find_spec", lambda name: None)
    with pytest.raises(CaseError) as refused:
        write_pdf(made[1], tmp_path / "page.pdf")
    assert "chromium" in str(refused.value) and "weasyprint" in str(refused.value)
    monkeypatch.setattr("dbvfiv.report.gather", lambda *given: pytest.fail("solved before it was refused"))
    with pytest.raises(CaseError, match="chromium"):
        report_command(None, tmp_path / "page.html", pdf=True)


@pytest.mark.parametrize("browser", [None, "/bin/false"])
def test_weasyprint_prints_where_no_browser_does(monkeypatch, tmp_path, browser):
    class HTML:
        def __init__(self, page):
            self.page = page

        def write_pdf(self, path):
            Path(path).write_text(f"{self.page} printed")

    monkeypatch.setattr("shutil.which", lambda name: browser)
    monkeypatch.setattr("dbvfiv.report.page.find_spec", lambda name: name)
    monkeypatch.setitem(sys.modules, "weasyprint", SimpleNamespace(HTML=HTML))
    page, path = tmp_path / "page.html", tmp_path / "page.pdf"
    assert write_pdf(page, path) == path and path.read_text() == f"{page} printed"
    assert [left.name for left in tmp_path.iterdir()] == ["page.pdf"]


def test_who_made_a_report_and_when():
    case = load_case(None, ["project.author=A. N. Other", 'project.date="2026-02-28"'])
    assert sheet(SimpleNamespace(case=case)) == (("author", "A. N. Other"), ("date", "2026-02-28"))


@pytest.mark.parametrize(
    "arguments, words",
    [
        (("--without", "mode"), "none of steady, heads"),
        (("--set", "report.heads=1 bar:2 furlong:3"), "report.heads"),
        (("-o", "/proc/none/page.html", "--without", "steady"), "cannot be written"),
        (("-o", "my.h5"), "such as my.html"),
        (("-o", "my.toml"), "such as my.html"),
    ],
)
def test_bad_arguments(misused, arguments, words):
    misused(words, "report", *(f"--set={key}" for key in KEYS), *arguments)


@pytest.mark.slow
@pytest.mark.parametrize("whole_group", [True, False], ids=["Ctrl-C", "its own process alone"])
def test_a_report_of_several_processes_ends_when_it_is_told_to_and_goes_on(tmp_path, whole_group):
    left_out = [word for name in LEFT_OUT for word in ("--without", name)]
    command = [
        "report",
        *(word for key in KEYS for word in ("--set", key)),
        "--workers",
        2,
        "-o",
        tmp_path / "page.html",
    ]
    with start(*command, *left_out, start_new_session=True) as child:
        until = time.monotonic() + 300
        while len(list(tmp_path.rglob("*.h5"))) < 3 and time.monotonic() < until:
            time.sleep(0.2)
        (os.killpg if whole_group else os.kill)(child.pid, signal.SIGINT if whole_group else signal.SIGTERM)
        child.communicate(timeout=60)
        assert child.returncode not in (0, None)
    if not whole_group:
        return  # it goes on in the same way
    with start(*command, *left_out) as child:
        _, said = child.communicate(timeout=600)
        assert child.returncode == 0, said
    assert "Does it chatter" in text_of(tmp_path / "page.html")


def test_a_valve_that_its_own_column_drives_needs_heads():
    keys = ["drive.pressure=0", "gravity.direction=-z"]
    with pytest.raises(CaseError, match=r"give report\.heads"):
        heads_of(load_case(None, keys))
    assert heads_of(load_case(None, [*keys, "report.heads=1 m"])) == (9806.65,)
