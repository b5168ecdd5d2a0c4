"""Samples of a small valve: outcomes are those of the full model asked for each, whoever works and however often the
run is interrupted; what cannot be used is answered by a sentence.
"""

import json
from contextlib import suppress
from types import SimpleNamespace

import numpy as np
import pytest

import dbvfiv
from dbvfiv.case.distribution import Distribution
from dbvfiv.case.materials import BUILT_IN, RUBBERS, HalpinTsai, ShippedRubber
from dbvfiv.errors import CaseError
from dbvfiv.observer import Observer
from dbvfiv.record.record import GrowingRecord
from dbvfiv.report.answers import _chance
from dbvfiv.report.gather import Gathered
from dbvfiv.report.parts import chance_part
from dbvfiv.studies import workers
from dbvfiv.studies.case import load_case, thesis_case
from dbvfiv.studies.inputs import Plan, inputs_of, quasi_random
from dbvfiv.studies.session import Session, load_result
from dbvfiv.studies.stability.place import number_of, plain_number, redesigned
from dbvfiv.studies.stability.verdict import OUTCOMES
from dbvfiv.studies.uncertainty.figures import tornado
from dbvfiv.studies.uncertainty.study import UncertaintyResult
from tests.observers import Stop
from tests.small_valves import SMALL, load_small, settings

LINE = "cases/dbv12-in-line.toml"
KEYS = {"uncertainty.samples": 16, "drive.pressure": 4e3, "fluid.density": 20.0, "damping.alpha": 0.0}
OWN = {"thickness": "normal(4 %)", "materials.CR.stiffness_factor": "lognormal(1.2)", "beta": "lognormal(0.002, 2)"}
PUMP = {"upstream.length": 20.0, "upstream.diameter": 0.3, "upstream.friction": 0.02, "fluid.density": 1000.0}
PUMP |= {"upstream.pump": [[0, 3.0], [0.03, 2.6], [0.06, 1.8], [0.1, 0.3]]}


def load(**changes):
    return load_small(KEYS, changes)


@pytest.fixture(scope="module")
def valve():
    return load()


@pytest.fixture(scope="module")
def found(valve):
    return valve.uncertainty(inputs=OWN)


@pytest.mark.slow
def test_outcomes_are_those_of_modes(valve, found):
    samples = found.at(found.plan.values[0])
    names = [one.name for one in found.plan.inputs]
    assert {"stable", "flutters"} <= {OUTCOMES[i] for i in samples["outcome"]}
    for i in (0, 5, 11):
        row = dict(zip(names, samples["inputs"][i]))
        changes = {
            "valve.thickness_factor": row["thickness"],
            "materials.CR.stiffness_factor": row["materials.CR.stiffness_factor"],
            "damping.beta": row["beta"],
        }
        modes = load(**changes).modes()
        assert modes.verdict.outcome == OUTCOMES[samples["outcome"][i]]
        assert modes.verdict.growth_rate == pytest.approx(samples["growth_rate"][i], rel=1e-6, abs=1e-6)
        assert modes.state.outlet_area == pytest.approx(samples["opening"][i], rel=1e-6)


@pytest.mark.slow
def test_undecided_samples_say_why():
    """In a band below the flutter, with the key that moves its end."""
    light = {"damping.beta": 1e-4}
    (first, *_) = load(**light).modes().modes
    assert first.growth_rate > 0
    below = load(**light | {"modes.max_frequency": 0.6 * first.frequency})
    (last,) = below.uncertainty(inputs={"beta": "lognormal(1e-4, 1.1)"}).lines()[-1:]
    assert last.startswith("16 of 16 verdicts are undecided; the first: 0 unstable eigenvalues up to")
    assert last.endswith("modes.max_frequency moves the end.")


@pytest.fixture(scope="module")
def refused():
    """Samples that share a state in which the published constants of its rubber are unstable."""
    return load(**{"damping.model": "loss factor", "drive.pressure": 12e3}).uncertainty(
        inputs={"loss_factor": "lognormal(1.3)"}
    )


def test_samples_whose_constants_do_not_hold_tell_nothing_of_stability(refused):
    """Nor does page one of a report say 0 %."""
    (point,) = refused.points
    assert point["outcomes"]["not valid"]["probability"] == 1.0 and point["undecided"] == 0
    assert point["probability"] is None and point["interval"] == [0.0, 1.0]
    assert [point["outcomes"][name]["probability"] for name in ("stable", "diverges")] == [None, None]
    assert (refused.at(point["value"])["opening"] > 0).all()
    said = _chance(SimpleNamespace(get=lambda _: refused, case=refused.case))
    assert said == "probability of chatter: not known, no sample was decided"


@pytest.mark.parametrize("method", ["plain", "rare"])
def test_samples_whose_constants_do_not_hold_widen_the_interval(method):
    """Thirty of a hundred, of which none of the others flutters; of all samples 0 is within 3.6 %."""
    result = object.__new__(UncertaintyResult)
    outcome = np.where(np.arange(100) < 30, OUTCOMES.index("not valid"), OUTCOMES.index("stable"))
    rows = {"outcome": outcome, "weight": np.ones(100), "stage": np.zeros(100, int)}
    case = load_case(None, [f"uncertainty.method={method}"])
    vars(result).update(record=SimpleNamespace(header=SimpleNamespace(case=case)), at=lambda _: rows)
    found, stable = result.probability(0.0), result.probability(0.0, "stable")
    assert found.value == 0.0 and 0.35 < found.high < 0.45
    assert stable.value == 1.0 and stable.low == pytest.approx(1 - found.high, abs=0.02)
    assert result.probability(0.0, "not valid").value == pytest.approx(0.3)


def test_figures_of_samples_without_a_damping_ratio_are_drawn(refused):
    assert set(refused.figures()) == {"margin"}


@pytest.mark.parametrize(("mean", "spread"), [(0.0, 8.0), (40.0, 8.0), (40.0, 1.0)])
def test_a_measurement_of_an_input_narrows_the_margin_by_a_share_of_its_median(mean, spread):
    """A ratio that is a twentieth of the input in per cent: 10 % of 40 are 4, beside what is known of it; of 0 there is
    no share.
    """
    own, result = Distribution("normal", (mean, spread)), object.__new__(UncertaintyResult)
    inputs = own.at(quasi_random(4096, 1, 1))
    rows = {"damping_ratio": inputs[:, 0] / 2000, "inputs": inputs, "stage": np.zeros(4096, int)}
    vars(result).update(plan=SimpleNamespace(inputs=[SimpleNamespace(name="x", distribution=own)]), at=lambda _: rows)
    known = result.measured(0.0, "x", 0.1)
    if mean == 0.0:
        assert known is None
    else:
        now, then = (np.ptp(row) for row in known)
        left = 1.96 / np.hypot(1 / spread, 1.96 / 4.0)
        assert then == pytest.approx(2 * left / 2000, rel=0.02) and then < now
        assert now == pytest.approx(2 * 1.96 * spread / 2000, rel=0.02)


def test_a_sealed_bill_is_one_whatever_its_verdict():
    """Twenty of 256 bills without a verdict: all let flow pass, or two without a steady state."""
    result = object.__new__(UncertaintyResult)
    outcome = np.where(np.arange(256) < 20, OUTCOMES.index("undecided"), OUTCOMES.index("stable"))
    for flow, high in ((np.ones(256), 1.0), (np.where(np.arange(256) < 2, np.nan, 0.0), 0.028)):
        rows = {"outcome": outcome, "flow": flow}
        header = SimpleNamespace(case=load_case(None, []))
        vars(result).update(record=SimpleNamespace(header=header), at=lambda _, rows=rows: rows)
        found = result.probability(0.0, "not sealed")
        assert found.value == np.nanmean(flow) and found.high == pytest.approx(high, abs=1e-3)


def test_flow_models_are_compared_by_the_same_samples():
    """Blocks that workers kept in any order before a run was interrupted."""
    one, two = object.__new__(UncertaintyResult), object.__new__(UncertaintyResult)
    plan, case = SimpleNamespace(values=(1.0,)), SimpleNamespace(fluid=SimpleNamespace(continuity="storage"))
    for result, samples in ((one, [0, 1, 4, 5]), (two, [2, 3, 4, 5])):
        rows = {"sample": np.array(samples), "outcome": np.array(samples) % 4}
        vars(result).update(plan=plan, case=case, at=lambda _, rows=rows: rows)
    vars(one).update(other_law=("quasi-steady", two))
    assert one.comparison == "Under quasi-steady 2 of 2 samples have the outcome of storage."


def test_the_document_has_probability_interval_and_what_decides(found):
    document = json.loads(json.dumps(found.summary()))
    assert document["symmetry"] == "SS" and "class SS alone (both lips open and close):" in found.lines()[0]
    (point,) = document["points"]
    hits = sum(OUTCOMES[i] == "flutters" for i in found.at(point["value"])["outcome"])
    assert point["probability"] == hits / 16 and point["interval"][0] < hits / 16 < point["interval"][1]
    assert point["samples"] == 16 and point["undecided"] == 0
    assert {row["parameter"] for row in document["decides"]} == set(OWN)
    assert {row["parameter"] for row in document["inputs"]} == set(OWN)


def test_samples_that_diverge_are_told(found):
    class Record:
        """The record, in which four samples diverge."""

        def __getattr__(self, name):
            return getattr(found.record, name)

        def column(self, table, name):
            values = found.record.column(table, name)
            four = table == "samples" and name == "outcome"
            return np.where(np.arange(len(values)) < 4, OUTCOMES.index("diverges"), values) if four else values

    some = object.__new__(UncertaintyResult)
    vars(some).update({name: one for name, one in vars(found).items() if name not in ("_rows", "points", "others")})
    some.record = Record()
    head, row = (" ".join(line.split()) for line in some.lines()[4:6])
    assert "diverges not valid undecided samples" in head and " 0.25 0 0 16 " in row
    assert "diverges" not in " ".join(found.lines())
    (axes,) = some.figures(only=["margin"])["margin"].axes
    assert "diverges, 4 samples" in [text.get_text() for text in axes.get_legend().get_texts()]
    table = chance_part(SimpleNamespace(get=lambda _: some, case=some.case)).tables[0]
    assert table.rows[0][list(table.head).index("diverges, %")] == "25"


def test_interruptions_change_no_digit(valve, found, tmp_path):
    path = tmp_path / "samples.h5"
    partly = valve.uncertainty(inputs=OWN, output=path, observer=Stop(8))
    assert partly.interrupted and 0 < len(partly.at(partly.plan.values[0])["outcome"]) < 16
    whole = dbvfiv.resume(path)
    assert whole.complete and whole.summary() == found.summary() == load_result(path).summary()


@pytest.mark.slow
def test_inputs_without_a_verdict_are_not_kept_twice(valve, found, tmp_path, monkeypatch):
    """A run that is killed after the inputs of some samples, before their verdicts."""
    path, extend, inner = tmp_path / "samples.h5", [], GrowingRecord.extend

    def killed(self, table, columns):
        extend.append(table)
        if extend.count("numbers") == 2 and table == "samples":
            raise KeyboardInterrupt
        inner(self, table, columns)

    monkeypatch.setattr(GrowingRecord, "extend", killed)
    partly = valve.uncertainty(inputs=OWN, output=path)
    monkeypatch.undo()
    assert len(partly.record.column("numbers", "sample")) > len(partly.record.column("samples", "sample")) * len(OWN)
    record = dbvfiv.resume(path).record
    for name in ("sample", "input", "value"):
        assert np.array_equal(record.column("numbers", name), found.record.column("numbers", name))


@pytest.mark.slow
def test_surroundings_are_asked_side_by_side(valve):
    """Inputs that leave the steady state alone share it and its reduced model."""
    inputs = {"beta": "lognormal(0.002, 2)", "density": "uniform(10, 40)"}
    found = valve.uncertainty(inputs=inputs, over="pressure=3000,6000")
    assert found.plan.is_surrounding
    for value in found.plan.values:
        samples = found.at(value)
        assert np.ptp(samples["opening"]) == 0 and len(samples["outcome"]) == 16
        assert np.ptp(samples["flow"] * np.sqrt(samples["inputs"][:, 1])) < 1e-12 < np.ptp(samples["flow"])
        beta, density = samples["inputs"][3]
        alone = valve.modes(value, beta=beta, density=density)
        assert alone.verdict.outcome == OUTCOMES[samples["outcome"][3]]
        assert alone.verdict.growth_rate == pytest.approx(samples["growth_rate"][3], rel=1e-5, abs=1e-5)
        assert alone.state.volume_flow == pytest.approx(samples["flow"][3], rel=1e-9)


@pytest.mark.slow
def test_a_pressure_may_be_uncertain(valve):
    """By its parameter and by its key, which are one input."""
    own = {"beta": "lognormal(0.002, 2)"}
    plans = [
        Plan(valve.case.replace({"uncertainty.inputs": {name: "normal(5 %)"} | own}))
        for name in ("pressure", "drive.pressure")
    ]
    assert [one.name for one in plans[0].inputs] == ["pressure", "beta"] and plans[0].inputs == plans[1].inputs
    found = valve.uncertainty(inputs={"drive.pressure": "normal(5 %)"} | own)
    samples = found.at(found.plan.values[0])
    pressure, beta = samples["inputs"][3]
    modes = valve.modes(pressure, beta=beta)
    assert modes.state.outlet_area == pytest.approx(samples["opening"][3], rel=1e-6)
    assert modes.verdict.outcome == OUTCOMES[samples["outcome"][3]]
    assert modes.verdict.growth_rate == pytest.approx(samples["growth_rate"][3], rel=1e-5)


@pytest.mark.slow
def test_both_flow_models_have_the_same_samples(valve, found, tmp_path):
    path = tmp_path / "both.h5"
    both = valve.replace({"uncertainty.continuity": "both"}).uncertainty(inputs=OWN, output=path)
    law, other = both.other_law
    alone = valve.replace({"fluid.continuity": law}).uncertainty(inputs=OWN)
    assert both.points == found.points and other.points == alone.points
    read = load_result(path)
    assert read.summary() == both.summary() and read.summary()["other_law"]["continuity"] == law
    assert any(line == f"Under {law}:" for line in read.lines())


@pytest.mark.slow
def test_samples_behind_a_pump_have_operating_points_of_their_own():
    keys = {name: value for name, value in KEYS.items() if name != "drive.pressure"} | PUMP
    found = load_small(keys).uncertainty(inputs={"thickness": "normal(4 %)", "beta": "lognormal(0.002, 2)"})
    samples = found.at(found.plan.values[0])
    assert np.ptp(samples["flow"]) > 0.01 * samples["flow"].mean()
    thickness, beta = samples["inputs"][3]
    modes = load_small(keys, {"valve.thickness_factor": thickness, "damping.beta": beta}).modes()
    assert modes.state.volume_flow == pytest.approx(samples["flow"][3], rel=1e-8)
    assert modes.verdict.outcome == OUTCOMES[samples["outcome"][3]]
    assert modes.verdict.growth_rate == pytest.approx(samples["growth_rate"][3], rel=1e-5)


@pytest.mark.slow
def test_a_bill_that_is_moulded_shut_may_be_sealed_or_not():
    """Below the heads that crack its samples none lets flow pass; next to that of the case those do that are pressed
    less.
    """
    keys = {**SMALL, "uncertainty.samples": 16, "uncertainty.inputs": {"sealing": "lognormal(1.5)"}}
    moulded = dbvfiv.load("cases/dbv12-moulded.toml", keys)
    found = moulded.uncertainty(over="pressure=0.02 m,0.24 m")
    shares = [point["outcomes"]["not sealed"]["probability"] for point in found.points]
    assert shares[0] == 0.0 < shares[1] < 1.0
    samples = found.at(found.plan.values[1])
    flows, pressed = samples["flow"] > 0, samples["inputs"][:, 0]
    assert pressed[flows].max() < pressed[~flows].min()


@pytest.mark.slow
def test_subset_sampling_agrees_with_plain_samples(valve, tmp_path):
    """A run of levels that is read from its file again, and one of the inputs as they are."""
    inputs = OWN | {"beta": "lognormal(0.004, 1.6)"}
    levels = valve.replace({"uncertainty.method": "subset"})
    found = levels.uncertainty(inputs=inputs, samples=400, output=tmp_path / "levels.h5")
    (one,), (plain,) = found.points, valve.uncertainty(inputs=inputs, samples=400).points
    assert one["interval"][0] < plain["interval"][1] and plain["interval"][0] < one["interval"][1]
    assert load_result(tmp_path / "levels.h5").points == found.points


@pytest.mark.slow
def test_a_rare_flutter_is_found_with_few_samples(valve):
    """Interval of weighted samples beside that of plain ones at a probability of a few per cent."""
    inputs = OWN | {"beta": "lognormal(0.004, 1.6)"}
    rare = valve.replace({"uncertainty.method": "rare"}).uncertainty(inputs=inputs, samples=250).points[0]
    plain = valve.uncertainty(inputs=inputs, samples=1000).points[0]
    low, high = (max if end == 0 else min for end in (0, 1))
    assert low(rare["interval"][0], plain["interval"][0]) < high(rare["interval"][1], plain["interval"][1])


def test_shipped_inputs_name_their_sources():
    inputs = {one.name: one for one in inputs_of(dbvfiv.load(LINE, dict(SMALL)).case)}
    assert inputs["materials.SBR.loss_factor"].distribution.numbers == (0.10, 0.25)
    assert inputs["materials.CR.stiffness_factor"].distribution.form == "lognormal"
    assert inputs["pipe_length"].distribution.numbers == (20.0, 0.4)
    assert all(one.source for one in inputs.values())


def plies(angle):
    return {"layers.2.angle": angle, "layers.3.angle": -angle}


@pytest.mark.parametrize(
    ("keys", "name", "form", "numbers"),
    [
        ({}, "angle", "normal", (54.0, 2.0)),
        (plies(90.0), "angle", "uniform", (86.54, 90.0)),
        (plies(1.0), "angle", "uniform", (0.0, 4.46)),
        (plies(120.0), "angle", "normal", (60.0, 2.0)),
        ({"valve.scale": 1 / 12}, "thickness", "lognormal", (1.0, 1.2)),
        ({"valve.scale": 1 / 2}, "thickness", "normal", (1.0, 0.0)),
    ],
)
def test_shipped_inputs_lie_where_their_numbers_can_be(keys, name, form, numbers):
    """Plies near the ends of their range, and a wall of a one-inch valve, whose tolerance is a fifth of it."""
    case = dbvfiv.load(None, SMALL | keys).case
    inputs = {one.name: one.distribution for one in inputs_of(case)}
    if form is None:
        assert name not in inputs
    else:
        assert inputs[name].form == form and inputs[name].numbers == pytest.approx(numbers, abs=0.06)


def test_a_pressure_may_be_uncertain_as_a_head():
    case = load_case(None, ["uncertainty.inputs.pressure=normal(1 m, 0.1 m)", "fluid.density=800"])
    assert inputs_of(case)[0].distribution.numbers == pytest.approx((7845.32, 784.532))


def test_a_sealing_pressure_may_be_uncertain():
    keys = {**SMALL, "uncertainty.inputs": {"sealing": "normal(5 %)"}}
    case = dbvfiv.load("cases/dbv12-moulded.toml", keys).case
    (one,) = inputs_of(case)
    assert one.distribution.numbers == (case.valve.sealing_pressure, 0.05 * case.valve.sealing_pressure)


PUMP_KEYS = "".join(f"{key[9:]} = {value}\n" for key, value in PUMP.items() if key.startswith("upstream."))
#: Sections, the names of inputs in front, and what is said of them.
MALFORMED = [
    ("inputs = 3", "inputs is given as 3"),
    ("inputs.thickness = 3", "thickness is given as 3"),
    ('inputs.thickness = ""', "must be a text that is not empty|no distribution"),
    ("inputs.thickness = 1", "must be names and distributions, such as"),
    ('inputs.thickness = "wide"', "no distribution; it must be such as"),
    ('inputs.thickness = "gamma(1, 2)"', "no distribution; it must be such as"),
    ('inputs.thickness = "normal(1, 0.5)"', "0.029 lies where thickness cannot be"),
    ('inputs.thickness = "normal(nan, 0.1)"', "not finite"),
    ('inputs.thickness = "normal(1, inf)"', "not finite"),
    ('inputs.thickness = "normal(1, -0.1)"', "deviation is not greater than 0"),
    ('inputs.thickness = "normal(1 mm, 0.1 mm)"', "not a plain number"),
    ('inputs.thickness = "normal(1, 0.1, 0.2)"', "3 arguments"),
    ('inputs.thickness = "lognormal(0.8)"', "0.8 is not greater than 1"),
    ('inputs.thickness = "uniform(1.2, 0.8)"', "bounds do not rise"),
    ('inputs.thickness = "samples(missing.txt)"', "does not exist"),
    ('inputs.thickness = "samples(1, -1)"', "0.5 lies where thickness cannot be"),
    ('inputs.thicknes = "normal(5 %)"', "neither a parameter"),
    ('inputs."materials.XR.stiffness_factor" = "normal(5 %)"', "neither a parameter"),
    ('inputs.tail_length = "normal(5 %)"', "no tail_length to change"),
    ('inputs."valve.wall" = "normal(5 %)"', "holds a number"),
    ('inputs."materials.CR.loss_factor" = "uniform(0.1, 3)"', "cannot be"),
    ('inputs."materials.fibre.fibre_fraction" = "normal(5 %)"', "of fibre need a table .materials.fibre. with its"),
    ('inputs."materials.CR.density" = "normal(5 %)"', "other numbers of CR need a table"),
    ('inputs."mesh.grading" = "normal(5 %)"', "describes no valve but how it is computed"),
    ('inputs."transient.step" = "normal(5 %)"', "describes no valve but how it is computed"),
    ('inputs."valve.wall_thickness" = "normal(5 %)"', "says nothing with valve.wall = 'measured'"),
    ('inputs."fluid.heat_capacity_ratio" = "normal(5 %)"', "says nothing without sound_speed"),
    ('inputs.density = "normal(5 %)"\ninputs."fluid.density" = "normal(2 %)"', "density twice"),
    ('inputs.pressure = "normal(5 %)"\nover = "pressure=0.1 m:1 m:3"', "uncertainty.over moves"),
    ('inputs."fluid.density" = "normal(5 %)"\nover = "density=10:100:3"', "uncertainty.over moves"),
    ('inputs."valve.cracking_head" = "normal(0.2 m, 0.02 m)"', "in whose place sealing is used"),
    ('inputs."drive.head" = "normal(1 m, 0.1 m)"', "in whose place pressure is used"),
    ('inputs.angle = "normal(2 deg)"\ninputs."layers.2.angle" = "normal(2 deg)"', "layers.2.angle, which angle sets"),
    (
        'inputs.thickness = "normal(2 %)"\ninputs."valve.thickness_factor" = "normal(2 %)"',
        "valve.thickness_factor, which thickness sets",
    ),
    (
        'inputs."materials.strain_level" = "normal(20 %, 2 %)"\nover = "strain=0.1,0.2"',
        "strain_level, which strain sets",
    ),
    ('correlation = ["thickness", "angle", 0.5]', "correlation"),
    ('correlation = [["thickness", "angle"]]', "correlation"),
    ('correlation = [["thickness", "angle", 1.2]]', "between -1 and 1"),
    ('correlation = [["thickness", "width", 0.5]]', "'width', which is no input"),
    ('correlation = [["thickness", "thickness", 0.5]]', "'thickness' twice"),
    ('correlation = [["thickness", "angle", 0.5], ["angle", "thickness", -0.5]]', "the pair angle and thickness twice"),
    (
        'inputs = {thickness = "normal(2 %)", angle = "normal(2 %)", density = "normal(2 %)"}\ncorrelation = '
        '[["thickness", "angle", 0.9], ["angle", "density", 0.9], ["thickness", "density", -0.9]]',
        "no numbers can be correlated so",
    ),
    ('over = "presure=0.1 m:1 m:3"', "pressure"),
    ('over = "pressure=0.1 m:1 m:0"', "uncertainty.over"),
    ('method = "rare"\nover = "pressure=0.1 m:1 m:3"', "one state"),
    ('method = "best"', '"plain"'),
    ("samples = 3", "at least 16"),
    ("samples = 64.5", "uncertainty.samples"),
    ("seed = -1", "uncertainty.seed"),
    ("sample = 64", "samples"),
    ('workers = "few"', "neither a number nor an address"),
    ("workers = 0", "out of range"),
    (f'inputs.pressure = "normal(5 %)"\n[upstream]\n{PUMP_KEYS}', "that at which both meet"),
    (f'inputs."drive.pressure" = "normal(5 %)"\n[upstream]\n{PUMP_KEYS}', "that at which both meet"),
]


@pytest.mark.parametrize(("section", "clause"), MALFORMED, ids=[f"{i}" for i in range(len(MALFORMED))])
def test_what_cannot_be_used_is_answered_by_a_sentence(tmp_path, misused, section, clause):
    path, keys = tmp_path / "bad.toml", SMALL | {"materials.strain_level": "10 %"}
    path.write_text(f"[uncertainty]\n{section}\n")
    misused(clause, "uncertainty", path, *settings(keys, {}))


def test_a_dead_scheduler_is_said_before_anything_is_computed(monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr(workers, "PATIENCE", 1)
    seen, watch = [], Observer()
    watch.progress = seen.append
    with pytest.raises(CaseError, match="no Dask scheduler answers within 1 s"):
        load().uncertainty(workers="tcp://127.0.0.1:9", observer=watch)
    assert not seen


def test_a_report_and_a_tornado_say_what_the_samples_say(found):
    part = chance_part(Gathered(found.case, "valve", (4e3,), None, results={"chance": found}))
    (point,) = found.points
    ((_, chatters, interval, invalid, undecided),) = part.tables[0].rows
    assert float(chatters) == pytest.approx(100 * point["probability"], rel=0.01)
    assert [float(end) for end in interval.split(" to ")] == pytest.approx(
        [100 * p for p in point["interval"]], rel=0.01
    )
    assert (float(invalid), undecided) == (0.0, "0 of 16")
    assert {"margin", "tornado"} <= {one.name for one in part.pictures}
    samples, names = found.at(point["value"]), [one.name for one in found.plan.inputs]
    values, ratio = samples["inputs"][:, names.index("beta")], 100 * samples["damping_ratio"]
    low = np.median(ratio[values <= np.quantile(values, 0.2)])
    figure = tornado(found)
    bars = figure.axes[0].containers[0]
    row = [label.get_text() for label in figure.axes[0].get_yticklabels()].index("Stiffness damping")
    assert bars[row].get_x() + bars[row].get_width() == pytest.approx(low)


@pytest.mark.parametrize(
    "pressure, told",
    [("normal(20 kPa, 1 kPa)", 20e3), ("normal(5 %)", 2e3), ("uniform(0 %, 10 %)", 2.1e3), (None, 2e3)],
)
def test_samples_are_told_at_the_median_of_their_pressures(pressure, told):
    inputs = {"thickness": "lognormal(1.1)"} | ({"pressure": pressure} if pressure else {})
    keys = [f"uncertainty.inputs.{name}={text}" for name, text in inputs.items()]
    assert Plan(load_case(None, ["drive.pressure=2 kPa", *keys])).values == (pytest.approx(told),)


@pytest.mark.parametrize("level", ["10 %", "auto"])
def test_numbers_that_are_taken_as_inputs_can_be_set(level):
    """Numbers of built-in materials, before and after their strain levels are found."""
    case = load_case(None, [f"materials.strain_level={level}"])
    settled = case.replace(case.materials.at_levels(dict.fromkeys(RUBBERS, 0.2) if level == "auto" else {}))
    taken = []
    for name in BUILT_IN:
        for field in {**HalpinTsai.model_fields, **ShippedRubber.model_fields}:
            key = f"materials.{name}.{field}"
            with suppress(CaseError):
                value = number_of(case, key, "of")[1]
                taken.append((key, plain_number(case, key, value)))
    if level == "auto":
        with pytest.raises(CaseError, match="in whose place strain is used"):
            number_of(settled, "materials.strain_level", "of")
    for key, number in taken:
        assert settled.replace({key: 0.3 if number is None else number})
    rubber = {"density", "strain_level"} if level == "auto" else set()
    assert {key.rpartition(".")[2] for key, _ in taken} == {"stiffness_factor", "loss_factor"} | rubber


def test_materials_may_have_dots_in_their_names():
    card = {"kind": "neo-hookean", "shear_modulus": 1e6, "density": 1200.0, "loss_factor": 0.1}
    case = load_case("cases/dbv12.toml").replace(
        {"materials": {"EPDM 60.1": card}, "layers": [{"material": "EPDM 60.1", "thickness": 0.01}]}
    )
    plan = Plan(case.replace({"damping.model": "loss factor", "damping.beta": None}))
    names = [one.name for one in plan.inputs]
    assert names[:2] == ['materials."EPDM 60.1".stiffness_factor', 'materials."EPDM 60.1".loss_factor']
    assert plan.inputs[0].title == "EPDM 60.1: stiffness factor"
    sampled = plan.redescribed(np.array([1.1, 0.2, *(one.distribution.median for one in plan.inputs[2:])]))
    own = sampled.materials.named["EPDM 60.1"]
    assert (own.stiffness_factor, own.loss_factor) == (1.1, 0.2)


@pytest.mark.parametrize("share", [0.9, 0.98, 1.02])
def test_a_radius_of_the_lip_that_varies_makes_the_valve_that_has_it(share):
    """No more of the bill than its radius is taken from the passage; a smaller one left none."""
    case = load_case("cases/dbv6.toml")
    radius = share * case.valve.as_given.lip_radius
    typed = load_case("cases/dbv6.toml", [f"valve.lip_radius={radius}"])
    made = redesigned(case, {"valve.lip_radius": radius})
    assert made.valve.rest_areas == pytest.approx(typed.valve.rest_areas)


def test_lengths_and_sizes_of_a_sampled_valve_move_as_those_of_a_design():
    """Places along the wall with the parts; sizes that follow by rules of the 12-inch valve stay."""
    inputs = {"valve.duckbill_length": "normal(2 %)", "valve.saddle_length": "normal(2 %)"}
    inputs |= {"valve.lip_half_width": "normal(1 %)", "materials.CR.stiffness_factor": "lognormal(1.1)"}
    rows = [0.0, 0.1, 0.21, 0.3, 0.4, 0.49, 0.52, 0.56]
    keys = {"valve.patches": [{"end": 0.49, "extra": 0.002}], "valve.moulded_length": 0.21, "layers.0.end": 0.3}
    keys |= {"mesh.row_positions": rows, "mesh.breaks": [0.525], "valve.sealing_pressure": 800.0}
    plan = Plan(load_case("cases/dbv12.toml").replace({"uncertainty.inputs": inputs} | keys))
    valve, sampled = plan.case.valve, plan.redescribed(np.array([0.22, 0.29, 0.126, 1.2]))
    ends = [step.to for step in sampled.valve.wall_map]
    assert ends == pytest.approx([0.22, 0.22 + 0.29 * 0.09 / 0.28, 0.51, 0.58])
    assert (sampled.valve.patches[0].end, sampled.valve.moulded_length) == pytest.approx((0.51, 0.22))
    assert sampled.mesh.breaks == pytest.approx([0.545]) and sampled.mesh.row_positions[5] == pytest.approx(0.51)
    turned = redesigned(plan.case, {"valve.saddle_length": 0.14, "angle": 30.0})
    assert (turned.layers[0].end, turned.layers[2].angle) == pytest.approx((0.255, 30.0))
    assert (sampled.valve.lip_half_width, sampled.materials.named["CR"].stiffness_factor) == (0.126, 1.2)
    for name in ("lip_radius", "duckbill_wall_deduction", "flange_wall_deduction"):
        assert getattr(sampled.valve, name) == getattr(valve, name)


def test_what_is_given_beside_an_input_is_refused():
    """The command asked at 1 m, whatever -p said; an input that counts from the case follows it."""
    session = Session(thesis_case(SMALL | {"uncertainty.inputs": {"pressure": "normal(1 m, 0.05 m)"}}))
    with pytest.raises(CaseError, match="uncertainty.inputs holds pressure"):
        session.prepared("uncertainty", {"drive.pressure": "2 m"})
    session = session.replace({"uncertainty.inputs": {"drive.pressure": "normal(5 %)"}})
    assert session.prepared("uncertainty", {"drive.pressure": "2 m"}).case.drive.pressure == pytest.approx(19613.3)
    both = {"uncertainty.inputs": {"storage": "uniform(0, 1)"}, "uncertainty.continuity": "both"}
    with pytest.raises(CaseError, match="uncertainty.inputs moves the flow model itself"):
        session.replace(both).perform("uncertainty")
