"""Hidden valves found from records of their small motions; what cannot be told apart is said; files and refusals."""

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import dbvfiv
from dbvfiv.errors import CaseError
from dbvfiv.studies import identify
from dbvfiv.studies.identify.study import IdentifyResult
from dbvfiv.studies.identify.valves import Places, least_damping, measured_of, onsets
from dbvfiv.studies.inputs import Plan, inputs_of
from dbvfiv.studies.response.study import Transfer
from dbvfiv.studies.stability.walk import StabilityWalk
from tests.observers import Stop
from tests.small_valves import SMALL, load_small

INPUTS = {"beta": "lognormal(1.3)", "materials.SBR.stiffness_factor": "lognormal(1.1)"}
MORE = INPUTS | {"alpha": "uniform(0, 4)", "pipe_length": "normal(10 %)"}
KEYS = {
    "fluid.density": 1000.0,
    "damping.alpha": 1.0,
    "damping.beta": 5e-4,
    "drive.pressure": 3e3,
    "upstream.length": 2.0,
    "upstream.diameter": 0.3,
    "identify.over": "pressure=3000,9000",
    "identify.error": 0.0,
    "identify.damping_error": 0.0,
    "identify.round": 6,
    "identify.rounds": 1,
}


def load(inputs=INPUTS, **changes):
    return load_small(KEYS, {"uncertainty.inputs": inputs, "identify.samples": 8}, changes)


class Hidden:
    """A valve drawn from the prior, its modes and its onset above 3 kPa."""

    def __init__(self, case, seed):
        self.plan, self.random = Plan(case), np.random.default_rng([37, seed])
        z = self.random.standard_normal((1, len(self.plan.inputs)))
        self.values = self.plan.numbers(z)[0]
        self.case = self.plan.redescribed(self.values)
        self.walk = StabilityWalk(self.case)

    def point(self, pressure):
        return self.plan.point(self.case, self.values, pressure=pressure)

    def modes(self, pressure):
        return self.walk.spectrum(self.point(pressure), 12).eigenvalues

    def lightest(self, pressure):
        """The least damped mode from 30 to 60 Hz."""
        values = self.modes(pressure)
        band = values[(values.imag > 2 * np.pi * 30) & (values.imag < 2 * np.pi * 60)]
        return band[np.argmin(np.abs(band.real / band.imag))]

    def onset(self):
        """Pressure above 3 kPa at which flutter begins; ends, of a valve that flutters there."""
        pressures = np.geomspace(2e3, 9e3, 24)
        damping = [least_damping(self.modes(p)[None])[0] for p in pressures]
        return float(onsets(pressures, np.array([damping]), 3e3)[1][0])

    def measured(self, pressure, error=0.002):
        """A measured mode, as identify.records takes it."""
        mode = self.lightest(pressure)
        frequency, ratio = mode.imag / (2 * np.pi), -mode.real / abs(mode)
        a, b = error / 1.96 * self.random.standard_normal(2)
        numbers = {"frequency": frequency * (1 + a), "frequency_interval": error * frequency}
        ratios = {"damping_ratio": ratio + b, "damping_ratio_interval": error}
        return numbers | ratios | {"at": f"pressure={pressure} Pa"}

    def ring(self, pressure, path, rate=250.0, duration=6.0):
        """A tap that moves one mode, and all others a little; growth where it grows."""
        values, main = self.modes(pressure), self.lightest(pressure)
        time = np.arange(0.0, duration if main.real <= 0 else min(duration, 5 / main.real), 1 / rate)
        motion = np.zeros(len(time))
        for value in values[values.imag > 2 * np.pi]:
            size = 1.0 if value == main else 0.03 * self.random.uniform(0.3, 1)
            motion += size * np.real(np.exp(value * time + 1j * self.random.uniform(0, 2 * np.pi)))
        return self._write(path, time, motion / np.abs(motion).max(), 0.01)

    def noisy(self, pressure, path, rate=250.0, duration=60.0):
        """The lip under white noise of the pressure."""
        count, place = int(rate * duration), self.point(pressure)
        transfer = Transfer(self.walk.family(place).linear, place, np.linspace(0.5, 120, 160))
        grid, frequency = np.linspace(0.5, 120, 4000), np.fft.rfftfreq(2 * count, 1 / rate)
        lip = np.interp(frequency, grid, transfer.at(grid)[:, 0], right=0.0)
        motion = np.fft.irfft(np.fft.rfft(self.random.standard_normal(2 * count)) * lip)[count:]
        return self._write(path, np.arange(count) / rate, motion / motion.std(), 0.05)

    def _write(self, path, time, motion, noise):
        table = np.column_stack([time, motion + noise * self.random.standard_normal(len(time))])
        np.savetxt(path, table, delimiter=",", header="time [s],lip", comments="", fmt="%.8g")
        return str(path)


@pytest.fixture(scope="module")
def found():
    valve = load()
    hidden = Hidden(valve.case, 3)
    records = [hidden.measured(2000.0), hidden.measured(3000.0)]
    return SimpleNamespace(hidden=hidden, records=records, valve=valve, result=valve.identify(records))


def holds(row, value):
    return row["interval"][0] <= value <= row["interval"][1]


def test_a_hidden_valve_is_found(found):
    document = json.loads(json.dumps(found.result.summary()))
    beta, modulus = document["inputs"]
    assert holds(beta, found.hidden.values[0]) and holds(modulus, found.hidden.values[1])
    assert beta["learned"] > 0.9 and modulus["learned"] > 0.5
    for match, record in zip(document["matches"], found.records, strict=True):
        assert match["modes"][0]["frequency"] == pytest.approx(record["frequency"], rel=0.003)
    assert document["check"]["check"]["modes"]
    for mode in document["check"]["check"]["modes"]:
        assert mode["emulated"] == pytest.approx(mode["full"], rel=0.02)
    onset = found.hidden.onset()
    low, high = document["onset"]["above"]["interval"]
    assert (low or np.inf) <= onset <= (high or np.inf) or abs(onset - low) < 0.02 * onset
    said = "\n".join(found.result.lines())
    assert document["symmetry"] == "SS" and "Modes are of class SS alone (both lips open and close)" in said
    assert "beta" in said and "flutter begins at" in said and "95 %" in said


@pytest.mark.slow
def test_an_interrupted_run_has_the_digits_of_a_whole_one(found, tmp_path):
    path = tmp_path / "identify.h5"
    partly = found.valve.identify(found.records, output=path, observer=Stop(3))
    assert partly.interrupted and partly.lines() == ["Too few valves were computed to learn from."]
    whole = dbvfiv.resume(path, workers=2)
    assert whole.complete and whole.summary() == found.result.summary() == dbvfiv.load_result(path).summary()
    assert set(whole.figures()) == {"inputs", "onset"}


@pytest.mark.slow
def test_workers_change_no_digit(found):
    assert found.valve.identify(found.records, workers=2).summary() == found.result.summary()


@pytest.mark.slow
def test_a_case_file_with_what_was_learned_is_read_by_uncertainty(found, tmp_path, command_line):
    record = found.hidden.ring(3000.0, tmp_path / "tap.csv")
    keys = KEYS | SMALL | {"identify.samples": 8, "damping.model": "rayleigh"}
    options = [f"--set={name}={value}" for name, value in keys.items()]
    options += [f"--set=uncertainty.inputs.{name}={text}" for name, text in INPUTS.items()]
    known = tmp_path / "known.toml"
    told = command_line(
        "identify", "cases/dbv12.toml", record, *options, "--at", "pressure=3 kPa", "--case", known, "--json"
    )
    assert told.status == 0, told.err
    document = json.loads(told.out)
    case = dbvfiv.load(known).case
    assert case.uncertainty.inputs == document["uncertainty"]["inputs"]
    assert {frozenset(row[:2]) for row in case.uncertainty.correlation} <= {frozenset(INPUTS)}
    answer = json.loads(command_line("uncertainty", known, "-n", "16", "--json").out)
    assert answer["points"][0]["samples"] == 16
    (text,) = (row["distribution"] for row in answer["inputs"] if row["parameter"] == "beta")
    assert text.startswith(("lognormal", "samples"))


def two_that_act_alike(seed):
    """Only one frequency is measured, on which stiffness and thickness act alike."""
    inputs = {"materials.SBR.stiffness_factor": "lognormal(1.1)", "thickness": "normal(3 %)"}
    valve = load(inputs, **{"identify.over": "pressure=3000,6000"})
    record = Hidden(valve.case, seed).measured(3000.0)
    record = {name: value for name, value in record.items() if "damping" not in name}
    return valve.identify([record])


def says_confounded(result):
    rows, (best, vector) = result.inputs, result.learned.directions()[0]
    assert len(result.confounded) == 1 and "are confounded" in result.confounded[0]
    assert all(row["confounded_with"] for row in rows)
    assert best < 0.3 and np.abs(vector).min() > 0.1
    return {row["target"] for row in result.further}


@pytest.mark.slow
def test_two_inputs_that_act_alike_are_said_to_be_confounded():
    assert set(INPUTS) - {"beta"} < says_confounded(two_that_act_alike(0))


@pytest.mark.slow
def test_confounded_inputs_are_said_in_all_runs():
    for seed in range(1, 4):
        says_confounded(two_that_act_alike(seed))


#: Inputs and keys of hidden valves: mass and stiffness damping before a rigid line, or loss factors before an elastic
#: one, whose modes stand beside those of the wall.
RAYLEIGH = (MORE, {})
ELASTIC = (
    {
        "loss_factor": "lognormal(1.3)",
        "materials.SBR.stiffness_factor": "lognormal(1.1)",
        "pipe_length": "normal(5 %)",
        "wave_speed": "lognormal(1.1)",
    },
    {
        "damping.model": "loss factor",
        "damping.loss_factor": 0.7,
        "damping.alpha": 0.0,
        "damping.beta": 0.0,
        "materials.constants": "stable",
        "fluid.continuity": "storage",
        "upstream.length": 4.0,
        "upstream.wave_speed": 400.0,
    },
)


def found_of(valve, seed, folder):
    """What ring-downs at 2 kPa and motion under noise at 3 kPa tell of a hidden valve: True for each input and the
    onset that are in their intervals.
    """
    hidden = Hidden(valve.case, seed)
    stable = hidden.modes(3000.0).real.max() < 0
    second = (hidden.noisy if stable else hidden.ring)(3000.0, folder / "b.csv")
    records = [
        {"file": hidden.ring(2000.0, folder / "a.csv"), "at": "pressure=2 kPa"},
        {"file": second, "at": "pressure=3 kPa"},
    ]
    result = valve.identify(records)
    onset, stands = hidden.onset(), result.onset if stable else result.onset["ends"]
    low, high = stands["above"]["interval"]
    begins = (low or np.inf) <= (onset if np.isfinite(onset) else np.inf) <= (high or np.inf)
    return [holds(row, value) for row, value in zip(result.inputs, hidden.values)], begins


@pytest.mark.slow
@pytest.mark.parametrize(
    "valves, least, most", [(1, 0.75, 1.0), pytest.param(25, 0.90, 0.99, marks=pytest.mark.random)]
)
def test_intervals_hold_hidden_inputs_and_onsets(valves, least, most, tmp_path):
    """Shares of valves under each kind of damping; of few, the binomial distribution leaves more room beside 95 %."""
    more = {"identify.samples": 24, "identify.round": 8, "identify.over": "pressure=2000,3000,4000,6000,9000"}
    inputs, begins = [], []
    for names, keys in (RAYLEIGH, ELASTIC):
        valve = load(names, **more | keys)
        for seed in range(valves):
            held, begin = found_of(valve, seed, tmp_path)
            inputs, begins = inputs + held, [*begins, begin]
    print(f"\n{np.mean(inputs):.3f} of {len(inputs)} inputs, {np.mean(begins):.3f} of {len(begins)} onsets")
    assert least <= np.mean(inputs) <= most and np.mean(begins) >= least


@pytest.mark.parametrize(
    ("records", "words"),
    [
        ([], "no record to identify"),
        ([{"at": "pressure=3 kPa"}], "names no file"),
        ([{"frequency": 20.0}], "needs frequency and frequency_interval"),
        ([{"frequency": 20.0, "frequency_interval": 0.1, "damping_ratio": 0.1}], "give both"),
        ([{"frequency": 20.0, "frequency_interval": 0.1, "at": "head=1 m"}], "must be such as 'pressure=1 m'"),
        (
            [{"frequency": 20.0, "frequency_interval": 0.1, "at": "pressure=1e9"}],
            "pressure is not within more than 0 to 1e",
        ),
        ([{"frequency": 20.0, "frequency_interval": 0.1, "at": "pressure=1 kg"}], "pressure=1 kg.* is not a pressure"),
        ([{"frequency": 20.0, "frequency_interval": 0.1, "at": "thickness=1"}], "must be such as"),
        ([{"frequency": 20.0, "frequency_interval": 0.1, "at": "tail_length=5 m"}], "no tail_length to change"),
        ([{"frequency": 20.0, "frequency_interval": 0.1, "at": "loss_factor=2"}], "no loss_factor to change"),
        ([{"file": "none.csv"}], "does not exist"),
        ([{"file": "README.md", "frequency": 20.0}], "names a file and has frequency, .* one of them"),
    ],
)
def test_records_that_cannot_be_used_are_answered_by_a_sentence(records, words, refused):
    with refused(CaseError, match=words):
        load().identify(records)


def test_a_mode_in_several_columns_is_measured_once(tmp_path):
    """A ring in three columns, of which one is noisier, and another ring: the same errors tell no more."""
    time, random = np.arange(0.0, 6.0, 4e-3), np.random.default_rng(8)
    slow, quick = (np.exp(-decay * time) * np.cos(2 * np.pi * f * time) for decay, f in ((1.0, 12.0), (1.4, 31.0)))
    noise = 0.01 * random.standard_normal(len(time))
    columns = np.column_stack([time, slow + noise, 2 * (slow + noise), slow + 5 * noise, quick + noise])
    np.savetxt(tmp_path / "tap.csv", columns, delimiter=",", header="time [s],lip,pressure,flow,wall", comments="")

    def of(column):
        records = [{"file": str(tmp_path / "tap.csv"), "column": column}]
        return measured_of(load(**{"identify.records": records, "identify.error": 0.01}).case, 0)

    (one, other), said = of("")
    (alone,), _ = of("lip")
    assert one == alone and other.frequency == pytest.approx(31.0, rel=1e-3) and said.count("decayed") == 4


@pytest.mark.parametrize(("over", "own"), [("thickness=0.8,1.2", 1.0), ("angle=30,60", 54.0), ("beta=1e-4,1e-3", 5e-4)])
def test_the_range_stands_about_the_value_at_the_last_record(over, own):
    changes = {"identify.over": over, "identify.records": [{"frequency": 20.0, "frequency_interval": 0.1}]}
    assert Places(load(**changes).case).now == pytest.approx(own)


@pytest.mark.parametrize(
    ("direction", "around", "pressure"),
    [("+z", 0.0, 8e3), ("-z", 9.8e3, 6e3), ("-z", 0.0, 3e3), ("none", 0.0, 3e3), ("none", 9e3, 9.05e3)],
)
def test_the_range_without_one_lies_where_something_flows_and_holds_the_records(direction, around, pressure):
    record = {"frequency": 20.0, "frequency_interval": 0.1, "at": f"pressure={pressure} Pa"}
    keys = {name: value for name, value in KEYS.items() if name != "identify.over"} | {"identify.records": [record]}
    changes = {"gravity.direction": direction, "downstream.pressure": around, "drive.pressure": 2e4}
    places = Places(load_small(keys, changes).case)
    assert places.case.rest_pressure < places.values[0] < places.now < places.values[-1] and places.values[0] > 0
    expected = max(pressure / 2.5, 1.01 * places.case.rest_pressure)
    assert places.values[0] == pytest.approx(expected) or expected > pressure


@pytest.mark.parametrize(
    ("inputs", "keys", "name"),
    [
        (INPUTS, {"identify.over": "beta=1e-4,1e-3"}, "beta"),
        (INPUTS | {"pressure": "normal(3 %)"}, {}, "pressure"),
        (INPUTS | {"fluid.density": "normal(3 %)"}, {}, "density"),
    ],
)
def test_inputs_that_a_place_names_or_the_range_moves_are_refused(inputs, keys, name, refused):
    """Numbers of the place or the range stood in for them, and the valve of the record was another one."""
    record = {"frequency": 20.0, "frequency_interval": 0.1, "at": "pressure=3 kPa, density=1025"}
    words = f"holds '{name}', which the place of a record or the range of identify moves; one of them has to go"
    with refused(CaseError, match=words):
        load(inputs, **keys).identify([record])


def test_the_range_of_other_samples_takes_no_input_away():
    """Range of uncertainty, which identify does not walk; the file with what was learned has it no longer."""
    case = load(MORE, **{"uncertainty.over": "pipe_length=2,4", "uncertainty.samples": 16}).case
    found = object.__new__(IdentifyResult)
    header, scores = SimpleNamespace(case=case), np.random.default_rng(1).standard_normal((400, len(MORE) + 2))
    vars(found).update(record=SimpleNamespace(header=header), samples=scores)
    assert [one.name for one in found.plan.inputs] == [*MORE]
    known = found.posterior_case()
    assert [one.name for one in inputs_of(known)] == [*MORE]


def test_inputs_that_a_place_takes_stay_as_uncertain_as_they_were():
    """They are in no record's samples, and uncertain in whatever is asked of the valve afterwards."""
    case = load_small(KEYS, {"identify.over": "thickness=0.9,1.1"}).case.replace({"uncertainty.inputs": {}})
    found = object.__new__(IdentifyResult)
    shipped = {one.name: one for one in inputs_of(case)}
    scores = np.random.default_rng(1).standard_normal((400, len(shipped) + 2))
    vars(found).update(record=SimpleNamespace(header=SimpleNamespace(case=case)), samples=scores)
    assert "thickness" in shipped and "thickness" not in [one.name for one in found.plan.inputs]
    known = {one.name: one for one in inputs_of(found.posterior_case())}
    assert known.keys() == shipped.keys()
    assert known["thickness"].distribution.numbers == pytest.approx(shipped["thickness"].distribution.numbers, rel=1e-3)


def test_a_range_over_what_has_no_one_value_is_refused(refused):
    valve = load(**{"identify.over": "angle=30,60", "layers.2.angle": 30.0})
    with refused(CaseError, match="identify.over moves angle, of which .* no one value"):
        valve.identify([{"frequency": 20.0, "frequency_interval": 0.1}])


@pytest.mark.parametrize("over", ["pressure=4000,9000", "pressure=1000,2000"])
def test_a_range_that_does_not_hold_the_last_record_is_refused(over, refused):
    """Beyond its end nothing is computed, and the verdict at the last record would be that at the end."""
    record = {"frequency": 20.0, "frequency_interval": 0.1, "at": "pressure=3 kPa"}
    with refused(CaseError, match="identify.over goes from .* last record was taken at 3 kPa") as caught:
        load(**{"identify.over": over}).identify([record])
    assert caught.value.key == "identify.over"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("time,lip\n0,1\n0.1,\n0.2,2\n", "line 3 holds nothing .*; take such rows out"),
        ("time [parsec],lip\n0,1\n0.1,2\n0.2,2\n", "parsec"),
        ("lip\n1\n2\n3\n", "single column; give the sampling rate"),
    ],
)
def test_a_record_that_cannot_be_read_is_refused_without_options_of_another_command(text, words, tmp_path):
    (tmp_path / "tap.csv").write_text(text)
    with pytest.raises(CaseError, match=words) as caught:
        load().identify([{"file": str(tmp_path / "tap.csv")}])
    assert "--" not in str(caught.value)


def test_a_record_without_a_mode_is_refused(tmp_path):
    time = np.arange(0.0, 4.0, 4e-3)
    path = tmp_path / "line.csv"
    np.savetxt(path, np.column_stack([time, np.cos(70 * time)]), delimiter=",", header="time [s],lip", comments="")
    with pytest.raises(CaseError, match="No record holds a mode.*limit cycle"):
        load().identify([{"file": str(path)}])


def test_records_of_a_case_that_is_written_elsewhere_are_found(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    record = tmp_path / "tap.csv"
    record.write_text("time [s],lip\n" + "".join(f"{k / 100},{np.cos(k / 2):.4f}\n" for k in range(200)))
    asked = identify.command(None, records=[Path("tap.csv")]).changes["identify.records"]
    assert asked[0]["file"] == str(record)
