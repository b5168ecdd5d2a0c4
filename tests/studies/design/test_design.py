"""Designs of a small valve: gradients of margin, loss and mass; run, file, interruption, case file, sentences."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.special import softmax

import dbvfiv
from dbvfiv.case.parameters import Mu
from dbvfiv.case.statement import parse_statement
from dbvfiv.errors import CaseError, NotValidError
from dbvfiv.materials.shipped import shipped_loss
from dbvfiv.model.closed import ClosedValve
from dbvfiv.model.sizes import ValveSizes
from dbvfiv.studies.case import thesis_case
from dbvfiv.studies.design import problem as problem_module
from dbvfiv.studies.design.problem import SHARPNESS, DesignProblem, Variable, statements_of, together
from dbvfiv.studies.design.study import CASE, DesignResult, _changed, check, draw_heads
from dbvfiv.studies.inputs import Plan, quasi_random
from dbvfiv.studies.stability.place import key_of, redesigned
from dbvfiv.studies.stability.verdict import OUTCOMES
from dbvfiv.studies.stability.walk import StabilityWalk
from tests.small_valves import load_small

KEYS = {"fluid.density": 20.0, "damping.beta": 3e-3, "design.evaluations": 4, "design.finer": 1}
VARIABLES = {"thickness": "0.7:1.4", "valve.lip_half_width": "115 mm:130 mm", "layers.2.angle": "30 deg:70 deg"}
AIM, CONSTRAINTS = "loss coefficient at 6 kPa down", ["margin at 6 kPa, 9 kPa at least 1 %", "mass at most 8 kg"]
ASKED = {"design.variables": VARIABLES, "design.aim": AIM, "design.constraints": CONSTRAINTS}


@pytest.fixture(scope="module")
def valve():
    return load_small(KEYS)


@pytest.fixture(scope="module")
def found(valve, tmp_path_factory):
    folder = tmp_path_factory.mktemp("design")
    return valve.design(VARIABLES, aim=AIM, constraints=CONSTRAINTS, cases=folder, output=folder / "d.h5")


def test_heads_are_drawn_over_the_pressure_that_drives():
    """Behind a line that in its reservoir, which the axis called a static inlet pressure."""
    case, one = thesis_case({"upstream.length": 20}), np.array([6e3, 9e3])
    rows = {"pressure": one, "margin": 1e-5 * one, "loss_coefficient": 1e-3 * one, "opening": 1e-6 * one}
    named = SimpleNamespace(name="line", text="as it is")
    result = SimpleNamespace(case=case, best={0: None}, verified=lambda number: rows, header=named, statements=[named])
    labels = {axes.get_xlabel() for axes in draw_heads(result).axes}
    assert labels == {"Pressure in the reservoir, kPa"}


LOSSY = {
    "damping.model": "loss factor",
    "damping.beta": 0,
    "materials.constants": "stable",
    "fluid.continuity": "storage",
}


def check_gradients(changes, share, way):
    """Derivatives of all that designs are judged by against differences of valves solved anew, along a direction."""
    problem = DesignProblem(load_small(KEYS, ASKED, changes).case)
    here, step = problem.at(problem.values_at(share), 6e3, True), 2e-4 * way
    ends = ([problem.at(problem.values_at(share + k * s * step), 6e3, True) for s in (1, -1)] for k in (2, 1))
    (wide, simple), widths = ends, np.array([one.high - one.low for one in problem.variables])
    assert {"flow", "opening", "loss coefficient", "mass", "margin"} == set(here.slopes)
    for name, slope in here.slopes.items():
        far, near = ((up.values[name] - down.values[name]) / (k * 4e-4) for k, (up, down) in ((2, wide), (1, simple)))
        direct, size = (4 * near - far) / 3, abs(here.values[name])
        assert slope @ (widths * way) == pytest.approx(direct, rel=1e-6, abs=1e-6 * size), name


@pytest.mark.slow
def test_gradients_are_those_of_valves_solved_anew():
    """Away from the case itself, for a factor and lengths alike."""
    check_gradients({}, np.array([0.35, 0.55, 0.3]), np.array([0.6, -0.5, 0.8]))


@pytest.mark.slow
@pytest.mark.parametrize("number", range(8))
def test_gradients_at_random_designs(number):
    """Two designs for each flow model, with Rayleigh damping and with loss factors."""
    share, way = np.random.default_rng(number).uniform(0.05, 0.95, (2, 3))
    lossy = LOSSY if number % 2 else {}
    check_gradients(lossy | {"fluid.continuity": ("quasi-steady", "storage")[number // 2 % 2]}, share, 2 * way - 1)


def test_a_wall_whose_rubber_is_unstable_has_no_margin(monkeypatch):
    """A state that is not valid is known as such before its modes are looked for."""
    problem = DesignProblem(load_small(KEYS, ASKED, LOSSY).case)
    monkeypatch.setattr(StabilityWalk, "refusal", lambda self, place: "The constants of CR are unstable.")
    monkeypatch.setattr(StabilityWalk, "search", lambda self, place: pytest.fail("modes are looked for"))
    with pytest.raises(NotValidError, match="unstable"):
        problem._modes(problem.walk(problem.case), Mu.of(problem.case))


def test_margins_count_all_modes_up_to_one_frequency():
    """Margins count modes of every design beyond the leading one that is listed, where loss factors damp all alike."""
    problem = DesignProblem(load_small(KEYS, ASKED, LOSSY, {"modes.count": 1}).case)
    thin, thick = (problem.values_at(np.array([share, 0.5, 0.5])) for share in (0.0, 1.0))
    problem.at(thin, 200.0, True)
    band, leads = problem.band, []
    for values in (thin, thick):
        case = problem.case_at(values).replace({"modes.max_frequency": band, "modes.count": 60})
        ratios = np.array([mode.damping_ratio for mode in dbvfiv.load(case).modes("200 Pa").modes])
        aggregate = ratios.min() - np.log(np.exp(-1000 * (ratios - ratios.min())).sum()) / 1000
        assert problem.at(values, 200.0, True).values["margin"] == pytest.approx(aggregate, rel=1e-6)
        leads.append(ratios.argmin() == 0)
    assert leads == [False, True]


def test_the_design_is_better_and_holds(valve, found):
    design = found.best[0]
    start = DesignProblem(found.case).at(tuple(one.start for one in found.variables), 6e3, True)
    assert design.holds and design.aim < 0.9 * start.values["loss coefficient"]
    assert design.constraints[0] >= 0.01 - 1e-6 and design.constraints[1] <= 8.0
    rows = found.verified(0)
    assert list(rows["pressure"]) == [6e3, 9e3] and (rows["margin"] >= 0.01 - 1e-6).all()
    assert rows["loss_coefficient"][0] == pytest.approx(design.aim, rel=1e-6)
    assert "stable at 2 heads" in found.evidence(0) and len(found.verified(CASE)["pressure"]) == 2


def test_the_case_file_is_the_design(found, command_line):
    told = json.loads(command_line("info", found.path, "--json", "--case").out)
    assert told["case"]["valve"] == found.case.to_dict()["valve"] and told["designs"]
    case = dbvfiv.load(found.path.parent / "design-1.toml").case
    assert case.valve.lip_half_width == pytest.approx(found.best[0].values[1], rel=1e-12)
    assert case.valve.thickness_factor == pytest.approx(found.best[0].values[0], rel=1e-12)
    modes = dbvfiv.load(found.path.parent / "design-1.toml").modes("9 kPa")
    assert modes.verdict.damping_ratio == pytest.approx(found.verified(0)["margin"][1], rel=1e-6)


def test_the_aim_of_the_case_stands_beside_that_of_the_design(found, valve):
    """Its loss coefficient, from a steady state of its own."""
    loss = valve.steady("6 kPa").hydraulics.loss_coefficient
    assert found.aim_of_case == pytest.approx(loss, rel=1e-6)
    assert any(line.split()[:3] == ["loss", "coefficient", f"{loss:.5g}"] for line in found.lines())


def test_the_file_says_the_same_and_draws(found):
    stored = dbvfiv.load_result(found.path)
    assert stored.summary() == found.summary() and stored.lines() == found.lines()
    assert found.summary()["symmetry"] == "SS" and "of class SS alone" in found.lines()[1]
    assert set(stored.figures()) == {"heads"}


@pytest.mark.slow
def test_five_starts_have_one_optimum():
    """The third ends thick, narrow and in flutter; begun again halfway to the case it arrives too."""
    asked = {"design.starts": 5, "design.evaluations": 30}
    result = load_small(KEYS, asked).design(VARIABLES, aim=AIM, constraints=CONSTRAINTS)
    assert [note["start"] for note in result.found] == [0, 1, 2, 3, 4]
    assert max(note["violation"] for note in result.found) <= 1e-5
    aims = [note["aim"] for note in result.found]
    assert aims == pytest.approx([min(aims)] * 5, rel=1e-4)
    values = np.array([note["values"] for note in result.found])
    assert values == pytest.approx(np.array([result.best[0].values] * 5), rel=0.02)
    assert [starts for _, starts in result.optima()] == [5]


@pytest.mark.slow
def test_a_front_goes_over_the_bounds(valve):
    constraints = ["mass at most 7 kg:9 kg:3"]
    front = valve.design({"thickness": "0.7:1.4"}, aim="flow at 6 kPa down", constraints=constraints)
    masses = [design.constraints[0] for design in front.best.values()]
    assert masses == pytest.approx([7.0, 8.0, 9.0], rel=1e-3)  # the heavier, the stiffer, the less flows
    flows = [design.aim for design in front.best.values()]
    assert flows[0] > flows[1] > flows[2] and set(front.figures()) == {"heads", "front"}


def test_what_holds_a_design_back_is_named(found):
    """Three variables and two constraints: the bounds that the optimum sits on, and the mass or the margin."""
    named = found.active(0)
    for one, value in zip(found.variables, found.best[0].values):
        near = min(value - one.low, one.high - value) <= 1e-3 * (one.high - one.low)
        assert near == any(text.startswith(one.name) for text in named)
    assert named and f"held back by: {', '.join(named)}" in "\n".join(found.lines())


def test_a_loss_factor_that_the_case_does_not_number_is_that_of_the_material(refused):
    """About which it is differentiated, as an uncertain input or a variable."""
    case, named = (load_small(LOSSY, keys).case for keys in ({}, {"materials.CR.loss_factor": "NR"}))
    for one, material in ((case, "CR"), (named, "NR")):
        assert key_of(one, "materials.CR.loss_factor", "of")[1] == shipped_loss(material).value
    with refused(CaseError, match="'fluid.sound_speed', which has no value in this case"):
        key_of(case, "fluid.sound_speed", "of")


@pytest.mark.slow
def test_the_margin_of_uncertain_loss_factors_is_that_of_the_numbers_written_out():
    inputs, number = {"materials.CR.loss_factor": "uniform(0.1, 0.3)"}, shipped_loss("CR").value
    cases = ({"uncertainty.inputs": inputs, **keys} for keys in ({}, {"materials.CR.loss_factor": number}))
    problems = [DesignProblem(load_small(KEYS, ASKED, LOSSY, keys).case) for keys in cases]
    found = [one.at(tuple(each.start for each in one.variables), 6e3, True).reserve for one in problems]
    assert found[0] == pytest.approx(found[1], rel=1e-3) and found[0] > 0


@pytest.mark.parametrize(
    ("name", "text"), [("thickness", "normal(0.98, 0.01)"), ("damping.beta", "lognormal(2.7e-3, 1.05)")]
)
def test_the_margin_of_inputs_whose_medians_are_not_the_numbers_of_the_case(name, text):
    """Margin of the valve at the 5 % quantile of its one input: a variable of the design, and a number of the case."""
    problem = DesignProblem(load_small(KEYS, ASKED, {"uncertainty.inputs": {name: text}}).case)
    here = problem.at(tuple(one.start for one in problem.variables), 6e3, True)
    ends, margins = problem.inputs[0].distribution.at(np.array([-1.645, 1.645])), []
    for end in ends:
        case = redesigned(problem.case, {name: end}).replace({"uncertainty.inputs": {}, "design.variables": {}})
        margins.append(DesignProblem(case).at((), 6e3, True).values["margin"])
    assert here.values["margin"] - here.reserve == pytest.approx(min(margins), rel=0.01)


@pytest.mark.slow
def test_the_margin_of_uncertain_valves_is_that_of_sampled_ones():
    """95 % quantile to first order against valves at quasi-random inputs, each solved anew."""
    inputs = {"thickness": "normal(1, 0.03)", "layers.2.angle": "normal(54 deg, 3 deg)", "damping.beta": "normal(5 %)"}
    problem = DesignProblem(load_small(KEYS, ASKED, {"uncertainty.inputs": inputs}).case)
    values = tuple(one.start for one in problem.variables)
    here, plan = problem.at(values, 6e3, True), Plan(problem.case)
    margins = []
    for row in plan.numbers(quasi_random(64, 3, 1)):
        sample = redesigned(problem.case, dict(zip(inputs, row)))
        sampled = DesignProblem(sample.replace({"uncertainty.inputs": {}, "design.variables": {}}))
        margins.append(sampled.at((), 6e3, True).values["margin"])
    assert here.reserve == pytest.approx(1.645 * np.std(margins), rel=0.1)
    assert here.values["margin"] - here.reserve == pytest.approx(np.quantile(margins, 0.05), abs=0.2 * here.reserve)


@pytest.mark.slow
def test_a_robust_margin_that_is_aimed_at_is_the_best_between_the_bounds():
    """The reserve moves with the design: held, it led from 15.2 % to 13.7 %."""
    keys = {"damping.beta": 3e-3, "damping.alpha": 0.0, "fluid.density": 1000.0, "design.finer": 1}
    keys |= {"uncertainty.inputs": {"damping.beta": "lognormal(1.3)"}, "design.evaluations": 12}
    found = load_small(keys).design({"thickness": "0.8:1.2"}, aim="margin at 1 m up")
    problem = DesignProblem(found.case)
    robust = [problem.without_reserve((x,), 9806.65) for x in np.linspace(0.8, 1.2, 9)]
    margins = np.array([one.values["margin"] for one in robust])
    assert found.best[0].aim >= margins.max() * (1 - 1e-6)
    for x in (0.9, 1.1):
        low, here, high = (problem.without_reserve((x + step,), 9806.65) for step in (-1e-3, 0.0, 1e-3))
        assert here.slopes["margin"][0] == pytest.approx(
            (high.values["margin"] - low.values["margin"]) / 2e-3, rel=0.02
        )
    own, beyond = found.best[0], found.verified(0)["margin"]
    assert beyond == pytest.approx([own.aim], abs=1e-3)


@pytest.mark.slow
def test_a_robust_design_keeps_its_reserve(valve):
    inputs = {"thickness": "normal(1, 0.03)"}
    robust = load_small(KEYS, {"uncertainty.inputs": inputs, "design.evaluations": 12}).design(
        {"thickness": "0.7:1.4"}, aim="flow at 6 kPa down", constraints=["margin at 6 kPa at least 5 %"]
    )
    problem = DesignProblem(robust.case)
    at = problem.at(robust.best[0].values, 6e3, True)
    assert robust.best[0].holds and at.reserve > 5e-4
    assert at.values["margin"] - at.reserve == pytest.approx(0.05, abs=1e-3)


def kept(aim, *constraints, notes=(), rows=(), failures=()):
    """A complete result of a record with these notes and rows of verdicts."""
    names = ("design", "pressure", "outcome", "margin")
    columns = {name: np.array([row.get(name, 0) for row in rows]) for name in names}
    record = SimpleNamespace(
        complete=True,
        failures=failures,
        notes=lambda what: [note for note in notes if note["what"] == what],
        column=lambda _table, name: columns.get(name, np.zeros(len(rows))),
    )
    found = DesignResult(record)
    statements = (parse_statement(aim, True, 1e3), *(parse_statement(text, False, 1e3) for text in constraints))
    vars(found).update(statements=statements, variables=(Variable("thickness", 0.7, 1.4, 1.0, ""),))
    return found


def test_the_margin_of_the_case_is_told_less_its_reserve():
    """As that of designs, so that their change from it is what was gained; none is told of a margin below 0."""
    state = {"what": "state", "values": [1.0], "pressure": 6e3, "margin": True, "found": {"margin": 0.052}}
    state |= {"slopes": {"margin": [0.1]}, "reserve": 0.011, "band": None}
    aim = kept("margin at 6 kPa up", notes=[state]).aim_of_case
    assert aim == pytest.approx(0.041, rel=1e-12) and _changed(aim, 0.049) == "+19.5 %"
    assert _changed(-0.012, 0.049) == ""


def test_a_constraint_with_the_bound_0_holds_a_design_back():
    """Counted in the value of the case itself."""
    state = {"what": "state", "values": [1.0], "pressure": 9e3, "margin": True, "found": {"margin": 0.05}}
    state |= {"slopes": {"margin": [0.1]}, "reserve": 0.0, "band": None}
    design = {"what": "design", "design": 0, "start": 0, "values": [1.1], "aim": 1.0, "violation": 0.0}
    for value, held in ((1e-7, ["margin at 9 kPa at least 0 %"]), (1e-3, [])):
        notes = [state, design | {"constraints": [value]}]
        assert kept("flow at 6 kPa up", "margin at 9 kPa at least 0 %", notes=notes).active() == held


def test_a_design_without_oscillations_has_no_margin_to_tell(recwarn):
    rows = [{"pressure": p, "outcome": OUTCOMES.index("stable"), "margin": np.nan} for p in (6e3, 9e3)]
    result = kept("flow at 6 kPa up", rows=rows)
    assert result.evidence(0) == "stable at 2 heads, no mode oscillates" and not recwarn.list
    rows[0]["margin"] = 0.02
    assert kept("flow at 6 kPa up", rows=rows).evidence(0) == "stable at 2 heads, margin at least 2 %"


@pytest.mark.parametrize(
    ("outcomes", "failures", "said"),
    [
        (("stable", "stable"), (), None),
        (("stable", "flutters"), (), "1 of 1 designs are not stable on the finer mesh"),
        (("flutters", "stable"), (), None),  # where no margin is asked
        (("stable",), ("Design 1 could not be verified: no state.",), "1 of 1 designs were not verified at all heads"),
        (("stable", "stable"), ("From start 2 no valve could be computed.",), "Not everything was reached"),
    ],
)
def test_a_design_that_does_not_stand_on_the_finer_mesh_falls_short(outcomes, failures, said):
    rows = [{"pressure": p, "outcome": OUTCOMES.index(one)} for p, one in zip((6e3, 9e3), outcomes)]
    design = {"what": "design", "design": 0, "start": 0, "values": [1.0], "aim": 1.0, "constraints": [0.05]}
    design["violation"] = 0.0
    asked = "loss coefficient at 6 kPa down", "margin at 9 kPa at least 5 %"
    assert kept(*asked, notes=[design], rows=rows, failures=failures).shortfall() == said


def test_seals_is_what_closure_finds():
    """The narrowest section under a back pressure over that of the lips at rest, and its change with the wall."""
    asked = {"design.constraints": ["seals at 1 kPa"]}
    valve = load_small(KEYS, ASKED, asked)
    problem = DesignProblem(valve.case)
    (_, statement), values = statements_of(valve.case), tuple(one.start for one in problem.variables)
    assert statement.pressures == (-1e3,) and statement.bounds == (0.2,) and statement.sign < 0
    result = valve.closure(["1 kPa"])
    closed = problem.at(values, -1e3, False)
    assert closed.values["gap left"] == pytest.approx(
        result.states[0].least_opening / result.reference_opening, rel=1e-6
    )
    open_ = problem.at(problem.values_at(np.array([0.5, 0.5, 0.5])), -50.0, False)
    ends = [problem.at(problem.values_at(np.array([0.5, x, 0.5])), -50.0, False).values for x in (0.4995, 0.5005)]
    direct = (ends[1]["gap left"] - ends[0]["gap left"]) / 0.001
    assert 15e-3 * open_.slopes["gap left"][1] == pytest.approx(direct, rel=1e-3)


def test_a_variable_at_the_end_of_its_key_has_derivatives_under_back_pressure(monkeypatch):
    """Towards its inside: lips rise no less than 0. Of a state that stays at rest."""
    keys = {"design.variables": {"valve.lip_rise": "0 mm:5 mm"}, "design.constraints": ["seals at 1 kPa"]}
    at_rest = lambda case, _: (ClosedValve(case), np.zeros(ClosedValve(case).size))  # noqa: E731
    monkeypatch.setattr(problem_module, "close_valve", at_rest)
    monkeypatch.setattr(problem_module, "Neighbourhood", lambda *_: SimpleNamespace(tangent=lambda *_: None))
    problem = DesignProblem(load_small(KEYS, ASKED, keys).case)
    at, step = problem.at((0.0,), -1e3, False), 2.5e-5
    near, far = (ValveSizes.of(ClosedValve(problem.case_at((k * step,)))).wall_mass for k in (1, 2))
    direct = (4 * near - far - 3 * at.values["mass"]) / (2 * step)
    assert at.slopes["mass"][0] == pytest.approx(direct, rel=1e-3) and direct != 0


def test_several_heads_of_an_aim_count_together(valve):
    problem = DesignProblem(load_small(KEYS, ASKED).case)
    values = tuple(one.start for one in problem.variables)
    pair = [problem.at(values, p, True) for p in (6e3, 9e3)]
    statement = type("S", (), {"quantity": "margin"})
    for reserves in ((), (0.0, 1e-3), (1e-3, 0.0), (1.0, 0.0), (0.0, 1.0)):
        margins = np.array([one.values["margin"] for one in pair]) - (reserves or 0.0)
        shares = softmax(-SHARPNESS * margins)
        value, slopes = together(statement, pair, reserves)
        assert margins.min() - np.log(2) / SHARPNESS <= value <= margins.min()
        assert slopes == pytest.approx(shares @ [one.slopes["margin"] for one in pair], rel=1e-9)


def test_a_key_that_is_turned_into_another_one_is_no_variable():
    """Said before the sealing pressure is looked for."""
    keys = {"valve.cracking_head": 0.2, "design.variables": {"valve.cracking_head": "0.1 m:0.3 m"}}
    with pytest.raises(CaseError, match="in whose place sealing is used"):
        check(load_small(KEYS, ASKED, keys).case)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"design.variables": {}}, "Nothing may change"),
        ({"design.aim": ""}, "Nothing is aimed at"),
        ({"design.variables": {"thicknes": "0.7:1.4"}}, "neither a parameter"),
        ({"design.variables": {"thickness": "1.1:1.4"}}, "not between them"),
        ({"design.variables": {"thickness": "thin:thick"}}, "must be LOW:HIGH"),
        ({"design.variables": {"angle": "0 deg:70 deg"}}, "lower bound above 0, such as 1 deg"),
        ({"design.variables": {"pressure": "1 kPa:2 kPa"}}, "no number that a designer chooses"),
        ({"design.aim": "mass down", "design.constraints": ["mass at most 3 kg"]}, "name no head"),
        ({"design.aim": "drag at 2 m down"}, "cannot be read"),
        ({"design.variables": {"drive.pressure": "1 kPa:20 kPa"}}, "no number that a designer chooses"),
        ({"design.variables": {"drive.head": "1 m:2 m"}}, "in whose place pressure is used"),
        ({"design.variables": {"materials.strain_level": "10 %:20 %"}}, "no number that a designer chooses"),
        ({"design.variables": {"thickness": 0.9}}, "must be names and bounds, such as"),
        ({"design.variables": {"thickness": "0.7:1.4", "valve.thickness_factor": "0.7:1.4"}}, "with which it changes"),
        ({"design.variables": {"angle": "30 deg:70 deg", "layers.2.angle": "30 deg:70 deg"}}, "with which it changes"),
        ({"design.constraints": ["mass at most 8 kg", "mass at most 8 m"]}, "constraints.1 .* is not a mass"),
        ({"design.constraints": ["mass at most 7 kg:7 kg:3"]}, "first bound is the last"),
        ({"uncertainty.inputs": {"thicknes": "normal(1, 0.03)"}}, "neither a parameter"),
        ({"design.constraints": ["mass at most 3 kg:4 kg:2", "margin at 1 m at least 1 %:2 %:2"]}, "more than one"),
    ],
)
def test_what_cannot_be_asked_is_said(changes, words):
    with pytest.raises(CaseError, match=words):
        load_small(KEYS, ASKED, changes).design()
