"""Stability maps on a coarse mesh: order of columns, certificates, gaps, resume, lost workers."""

import json
import multiprocessing
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from dbvfiv.errors import SolveError
from dbvfiv.model import ValveModel
from dbvfiv.model.equilibria import LoadPath, find_equilibrium
from dbvfiv.observer import Observer
from dbvfiv.record.files import Header
from dbvfiv.record.record import GrowingRecord
from dbvfiv.studies.case import thesis_case
from dbvfiv.studies.map.column import MapColumn, MapPlan
from dbvfiv.studies.map.figures import stability_map
from dbvfiv.studies.map.study import MapResult, _doubts, check_cells, keep_column, tables_of
from dbvfiv.studies.modes.search import run_modes
from dbvfiv.studies.session import load_result
from dbvfiv.studies.stability.samples import SAMPLE_TABLE, Sample, SampleKey, keep_samples, read_samples
from eigen import Certificate, SingularShiftError, unstable_count
from eigen.columns import DIRECT, Cell
from tests.small_valves import SMALL, settings

from .axes import AXES, run_map


def test_every_cell_is_certified_and_checks_agree(whole):
    assert whole.grid("certified").all()
    assert len(whole.checks) == 3 and all(check["agrees"] for check in whole.checks)
    unstable = whole.grid("unstable")[0]
    assert set(np.unique(unstable)) == {0, 2} and (unstable == whole.grid("counted")[0]).all()
    assert ((whole.grid("growth_rate")[0] > 0) == (unstable > 0)).all()


def test_a_check_whose_state_is_not_found_again_ends_no_map(case):
    plan, said, found = MapPlan(case), [], Cell(np.array([-1.0 + 50j]), Certificate(0, 0, True), DIRECT)

    def cell(place):
        if place.pressure < 3000.0:
            raise SolveError("No equilibrium was found.")
        return found

    cells = [Sample.of(value, found) for value in plan.along.values]
    columns = tuple(MapColumn(value, 0, {0: cells}, np.zeros((0, 5))) for value in plan.across.values)
    walk = SimpleNamespace(cell=cell, observer=SimpleNamespace(warn=said.append))
    checks = check_cells(plan, columns, walk, 12)
    assert len(checks) + len(said) == 12 and min(check["x"] for check in checks) > 3000.0
    assert said and all(text.startswith("The cell at pressure = 1 kPa, density = ") for text in said)


@pytest.mark.parametrize(
    ("kept", "full", "agrees"),
    [
        ([2e-13 + 30j, 50j], [1e-12 + 50j, 30j], True),  # without damping, in the order of rounding
        ([-1 + 30j, -2 + 50j], [-1 + 50j, -2 + 30j], False),
        ([], [], True),
        ([], [-1 + 30j], False),
    ],
)
def test_checks_compare_modes_that_may_lead(case, kept, full, agrees):
    plan, counts = MapPlan(case), Certificate(0, 0, True)
    cells = [Sample.of(value, Cell(np.array(kept, complex), counts, DIRECT)) for value in plan.along.values]
    columns = tuple(MapColumn(value, 0, {0: cells}, np.zeros((0, 5))) for value in plan.across.values)
    walk = SimpleNamespace(cell=lambda place: Cell(np.array(full, complex), counts, DIRECT))
    (check,) = check_cells(plan, columns, walk, 1)
    assert check["agrees"] == agrees


def test_cells_whose_mode_grows_too_slowly_to_be_counted_are_uncertain(case):
    plan = MapPlan(case.replace({"map.symmetry": "all"}))
    slow, calm = (Cell(np.array([complex(rate, 94.0)]), Certificate(0, 0, True, 0.1), DIRECT) for rate in (0.05, -1.0))
    cells = {part: [Sample.of(v, slow if part else calm) for v in plan.along.values] for part in range(4)}
    columns = tuple(MapColumn(value, 0, cells, np.zeros((0, 5))) for value in plan.across.values)
    number = len(plan.along.values) * len(columns)
    said = _doubts(plan, columns, [])
    assert [text.split(" cells are")[0] for text in said] == [
        f"In class {name}: {number}" for name in ("SA", "AS", "AA")
    ]
    place = {"x": 1e3, "y": 2.0, "unstable": 2, "agrees": False}
    other, far = (_doubts(plan, columns, [place | {"error": error}])[-1] for error in (3e-9, 2e-4))
    assert other.endswith("the full pencil has 2 unstable eigenvalues and the cell another number.")
    assert far.endswith("the full pencil differs by 2.0e-04.")
    result = SimpleNamespace(plan=plan, columns=columns)
    assert {v["outcome"] for row in MapResult._verdicts(result, 0) for v in row} == {"undecided"}  # and not stable
    note = {"symmetry": "SA", "motion": "sway", "certified": np.ones((10, 6), bool)}
    assert MapResult._class_line(result, 1, note) == "class SA (sway): 0 cells unstable, 0 stable, 60 of 60 certified."


def test_a_growing_mode_of_the_full_matrices_decides_whatever_the_count_says(case):
    """Cells that flutter without a count are unstable to the map and to each class, and not told as uncertain."""
    plan = MapPlan(case.replace({"map.symmetry": "all"}))
    proven = Sample(1.0, np.array([5 + 60j]), unstable=2, counted=0, how=DIRECT)
    cells = dict.fromkeys(range(4), [proven] * len(plan.along.values))
    columns = tuple(MapColumn(value, 0, cells, np.zeros((0, 5))) for value in plan.across.values)
    assert _doubts(plan, columns, []) == []
    note = {"symmetry": "SA", "motion": "sway", "certified": np.zeros((10, 6), bool)}
    said = MapResult._class_line(SimpleNamespace(plan=plan, columns=columns), 1, note)
    assert said == "class SA (sway): 60 cells unstable, 0 stable, 0 of 60 certified."


def test_a_text_of_a_sample_that_was_cut_off_is_not_told_of_the_next_in_its_row(case):
    slow = Cell(np.array([complex(0.05, 94.0)]), Certificate(0, 0, True, 0.1), DIRECT)
    plain = replace(Sample.of(1.0, slow), key=SampleKey(symmetry="SS"))
    first = GrowingRecord(Header.of("map", case, "valve"), None, (SAMPLE_TABLE,))
    keep_samples(first, [replace(plain, left_open="Above 25 Hz more is counted.")])
    assert [sample.left_open for sample in read_samples(first)] == ["Above 25 Hz more is counted."]
    known = SimpleNamespace(rows=lambda _: 0, log=first.log)
    again = GrowingRecord(first.header, None, (SAMPLE_TABLE,), known=known)
    keep_samples(again, [plain])
    assert [sample.left_open for sample in read_samples(again)] == [""]


def test_onsets_of_columns_lie_between_cells_of_opposite_sign(whole):
    y = np.array(whole.plan.y.values)
    for column in whole.columns:
        for _, along, frequency, direction, _ in column.onsets:
            rates = column.numbers(0, "growth_rate")
            below, above = rates[y < along][-1], rates[y > along][0]
            assert np.sign(above - below) == direction and below * above < 0 and frequency > 10


def test_columns_are_put_in_where_onsets_vanish(whole):
    assert any(column.level == 1 for column in whole.columns)
    numbers = [len(column.onsets) for column in whole.columns]
    assert numbers != sorted(set(numbers))


@pytest.mark.slow
def test_transposed_map_gives_the_same_cells(case, whole):
    turned = case.replace({"map.x": AXES["map.y"], "map.y": AXES["map.x"], "map.refine": 0, "map.checks": 0})
    other = run_map(turned)
    assert other.plan.transposed
    assert other.grid("growth_rate")[0].T == pytest.approx(whole.grid("growth_rate")[0], rel=1e-6, abs=1e-6)


@pytest.mark.slow
def test_columns_of_a_bill_that_is_moulded_shut_follow_the_pressure_and_name_sealed_and_lost_cells(monkeypatch):
    """Over pressure and sealing pressure: sealed cells are stable, a cell without an equilibrium leaves a gap that is
    told, and only that.
    """
    find = LoadPath.go_to

    def lost(path, target):
        if 2e3 < target < 3e3 and path.model.case.valve.sealing_pressure > 1e3:
            raise SolveError(f"No equilibrium was found at {target:.6g} Pa.")
        return find(path, target)

    monkeypatch.setattr(LoadPath, "go_to", lost)
    keys = SMALL | {"valve.sealing_pressure": 800.0, "map.curve": False, "map.refine": 0, "map.checks": 1}
    axes = {"map.x": "pressure=500,2500,4000", "map.y": "sealing=800,1500", "map.continuity": "both"}
    found = run_map(thesis_case(keys | axes))
    assert found.plan.transposed and len(found.columns) == 2
    sealed = np.array([[True, False, False], [True, False, False]])
    for law in (0, 1):
        assert np.array_equal(found.grid("sealed")[law] > 0, sealed)
        assert np.all(found.grid("growth_rate")[law][sealed] < 0)
        known = found.grid("certified")[law] > 0
        assert np.array_equal(known, [[True, True, True], [True, False, True]])
    assert any("2500 Pa" in sentence for sentence in found.warnings)


@pytest.mark.slow
def test_both_laws_and_pairs_without_the_load(coarse_case):
    both = run_map(
        coarse_case.replace(
            AXES | {"map.x": "pressure=2000:6000:2", "map.continuity": "both", "map.refine": 0, "map.checks": 2}
        )
    )
    assert both.grid("growth_rate").shape == (2, 10, 2) and both.grid("certified").all()
    document, laws = both.summary(), both.summary()["laws"]
    own = both.plan.laws.index(both.plan.base.storage)
    assert document["growth_rate"] == laws[own]["growth_rate"] != laws[1 - own]["growth_rate"]
    pair = coarse_case.replace(AXES | {"map.x": "beta=0.001:0.004:3", "map.y": "storage=0:1:5", "map.refine": 0})
    result = run_map(pair)
    assert result.grid("certified").all()
    assert len(result.checks) == 3 and all(check["agrees"] for check in result.checks)


def test_two_structural_axes(coarse_case):
    result = run_map(
        coarse_case.replace(
            AXES | {"map.x": "pressure=3000:9000:2", "map.y": "thickness=0.9:1.1:2", "map.refine": 0, "map.checks": 1}
        )
    )
    assert result.grid("certified").all() and (result.grid("how") == 1).all()
    assert len(result.checks) == 1 and result.checks[0]["agrees"]


def test_a_missing_state_is_a_marked_gap(case, monkeypatch):
    honest = LoadPath.go_to

    def go_to(self, target):
        if abs(target - 5400) < 1:
            raise SolveError("No equilibrium was found at 5400 Pa.")
        return honest(self, target)

    monkeypatch.setattr(LoadPath, "go_to", go_to)
    result = run_map(case.replace({"map.x": "pressure=3200:7600:3", "map.refine": 0, "map.checks": 0}))
    (failure,) = (column.failure for column in result.columns if column.failure)
    assert "5400" in failure
    assert np.isnan(result.grid("growth_rate")[0][:, 1]).all() and (result.grid("unstable")[0][:, 1] == -1).all()
    assert np.isfinite(result.grid("growth_rate")[0][:, [0, 2]]).all()


@pytest.mark.slow
def test_json_and_figures(command_line, tmp_path):
    options = settings(AXES | {"mesh.around": 8, "mesh.along": 16, "damping.alpha": 0})
    shown = "--json", "--plots", tmp_path / "figures"
    outcome = command_line("map", *options, "--x", "pressure=3 kPa:8 kPa:3", *shown)
    assert outcome.status == 0, outcome.err
    document = json.loads(outcome.out)
    assert np.shape(document["growth_rate"]) == (10, 3) == np.shape(document["unstable_count"])
    assert document["x"]["parameter"] == "pressure" and document["onset_curves"]
    assert {p.name for p in (tmp_path / "figures").iterdir()} == {"stability-map.png", "leading-frequency.png"}


def test_the_command_says_what_is_fixed(command_line, misused, tmp_path):
    mesh = settings(SMALL | {"map.checks": 0, "map.curve": False})
    axes = ["--x", "density=1:100:3:log", "--y", "beta=0.001:0.004:3"]
    path = tmp_path / "map.h5"
    outcome = command_line("map", *mesh, *axes, "-p", "4 kPa", "-o", path)
    assert outcome.status == 0, outcome.err
    assert outcome.out.startswith("At 4 kPa static, quasi-steady, α = ")
    fixed = load_result(path).summary()["fixed"]
    assert fixed["pressure"] == 4e3 and not {"density", "beta"} & set(fixed)
    misused("map.x", "map", *mesh, *axes, "--density", 10)
    assert command_line("resume", path, "--workers", 2).status == 2  # complete


@pytest.mark.slow
def test_a_killed_worker_costs_only_the_columns_in_flight(case, whole):
    killed, said, observer = [], [], Observer()

    def kill(_result):
        if not killed:
            killed.append(multiprocessing.active_children()[0])
            killed[0].kill()

    observer.item, observer.warn = kill, said.append
    result = run_map(case, observer, workers=2)
    assert killed and any("worker was lost" in sentence for sentence in said)
    assert not any(column.failure for column in result.columns)
    found, expected = (dict(part.summary()) for part in (result, whole))
    lost = set(found.pop("warnings")) - set(expected.pop("warnings"))
    assert found == expected and lost == set(said) - set(whole.warnings)


def test_cells_that_the_count_does_not_confirm_are_uncertain(case, monkeypatch):
    # a count that sees one pair too many, whatever the model
    monkeypatch.setattr("eigen.family.unstable_count", lambda pencil, **_: replace(unstable_count(pencil), number=4))
    monkeypatch.setattr("eigen.columns.certified_spectrum", _refuse)
    result = run_map(case.replace({"map.x": "pressure=3000:8000:2", "map.refine": 0, "map.checks": 0}))
    assert not result.grid("certified").any()
    assert not result.curves, "an onset between cells without a certificate was claimed"
    number = np.count_nonzero(result.grid("growth_rate") > 0)
    assert 0 < number < 20 and any(f"{20 - number} cells are uncertain" in sentence for sentence in result.warnings)
    record = GrowingRecord(Header.of("map", result.plan.case, "valve"), None, tables_of(None))
    for column in result.columns:
        keep_column(record, column)
    results = MapResult(record)
    # an unstable eigenvalue of the full pencil is proof without the count
    assert results.lines()[0].endswith("; class SS alone (both lips open and close):")
    assert f" {number} unstable, 0 stable, 0 of 20 certified" in results.lines()[1]
    axes = stability_map(results).axes[0]
    assert any(getattr(part, "get_hatch", lambda: None)() for part in axes.collections)
    assert {text.get_text() for text in axes.texts} <= {"uncertain"}


def _refuse(*_arguments, **_options):
    raise SingularShiftError("nothing to count")


@pytest.mark.slow
def test_cells_of_light_damping_are_those_of_the_full_matrices():
    """At beta = 1e-4 s quick modes lead, to 500 Hz, which a space made for slow ones knows to 10 % alone."""
    keys = SMALL | {"map.x": "pressure=450:1820:2", "map.y": "beta=1e-4:1e-2:4:log", "map.curve": False}
    result = run_map(thesis_case(keys | {"map.refine": 0, "map.checks": 8}))
    assert result.grid("certified").all()
    assert len(result.checks) == 8 and all(check["agrees"] for check in result.checks)
    assert result.grid("frequency").max() > 150


UNDAMPED = {"damping.alpha": 0, "damping.beta": 0, "map.curve": False, "map.refine": 0, "map.checks": 0}


@pytest.fixture(scope="module")
def undamped(coarse_case):
    """Neither alpha nor beta, where modes above 80 Hz grow."""
    axes = {"map.x": "pressure=10000:14000:2", "map.y": "density=1:1000:4:log"}
    return run_map(coarse_case.replace(UNDAMPED | axes))


@pytest.mark.slow
def test_a_map_without_damping_finds_what_modes_finds(undamped, coarse_case):
    assert undamped.grid("certified").all()
    for i, pressure in enumerate(undamped.plan.x.values):
        for j in (1, 2):
            case = coarse_case.replace(UNDAMPED | {"fluid.density": undamped.plan.y.values[j]})
            model = ValveModel(case)
            state = find_equilibrium(model, pressure)
            modes = run_modes(model, state)
            assert modes.certificate.agrees
            assert undamped.grid("growth_rate")[0][j, i] == pytest.approx(modes.eigenvalues[0].real, rel=1e-5)
            assert undamped.grid("unstable")[0][j, i] == modes.certificate.unstable_count > 0
    assert undamped.grid("frequency")[0].max() > 80.0
    assert any("hold for modes up to" in sentence for sentence in undamped.warnings)


def test_the_band_of_modes_is_that_of_the_map(coarse_case):
    axes = {"map.x": "pressure=10000:14000:2", "map.y": "density=1:1000:3:log", "modes.max_frequency": 60.0}
    result = run_map(coarse_case.replace(UNDAMPED | axes))
    assert result.grid("frequency")[0].max() <= 60.0
    assert any("up to 60 Hz" in sentence or "up to 59.94 Hz" in sentence for sentence in result.warnings)
