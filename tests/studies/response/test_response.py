"""Forced response against runs in time, against the full operator and against the closed form of one mode."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import trapezoid

import dbvfiv
from dbvfiv.case.parameters import Mu
from dbvfiv.case.part import QUARTER
from dbvfiv.errors import CaseError
from dbvfiv.flow.channel import Channel
from dbvfiv.flow.terms.tail import Tail
from dbvfiv.studies.case import load_case, thesis_case
from dbvfiv.studies.response import study
from dbvfiv.studies.response.study import OUTPUTS, Transfer
from dbvfiv.studies.stability.walk import StabilityWalk
from eigen.operator import CoupledPencil
from eigen.pairs import all_eigenvalues
from tests.small_valves import SMALL, load_small

RAYLEIGH = {"damping.alpha": 5.0, "damping.beta": 0.001}
LOSS = {"damping.model": "loss factor", "materials.constants": "stable", "damping.alpha": 0.0, "damping.beta": 0.0}
#: Stable states under both flow models, with either damping.
STATES = {
    "storage-rayleigh": {"fluid.continuity": "storage", "drive.pressure": 6e3, **RAYLEIGH},
    "storage-loss": {"fluid.continuity": "storage", "drive.pressure": 6e3, **LOSS},
    "quasi-steady-rayleigh": {
        "fluid.continuity": "quasi-steady",
        "drive.pressure": 6e3,
        **RAYLEIGH,
        "damping.beta": 0.003,
    },
    "quasi-steady-loss": {"fluid.continuity": "quasi-steady", "drive.pressure": 30e3, **LOSS, "damping.alpha": 60.0},
    "line-and-water-outside": None,
}
FREQUENCIES = np.append(np.geomspace(0.02, 0.45, 12), np.arange(1, 241) * 0.5)


def transfer_of(case, frequencies=FREQUENCIES):
    walk, place = StabilityWalk(case), Mu.of(case)
    assert walk.verdict(place).stable, "a state that is stable is needed"
    return Transfer(walk.family(place).linear, place, frequencies)


@pytest.fixture(scope="module", params=STATES)
def valve(request):
    if STATES[request.param] is None:
        case = load_case("cases/dbv12-in-line.toml").replace({**SMALL, "drive.pressure": 30e3, "damping.alpha": 20.0})
    else:
        case = load_small(STATES[request.param], {"fluid.density": 1000.0}).case
    return SimpleNamespace(case=case, transfer=transfer_of(case))


@pytest.mark.slow
def test_a_lip_that_stops_hold_answers_as_exactly_as_the_rest():
    """It moves by a millionth of the wall."""
    patch = [{"begin": "0 mm", "end": "60 mm", "thickness": "2.1 mm"}]
    changes = {"mesh.around": 8, "mesh.along": 6, "valve.wall": "uniform", "valve.patches": patch}
    changes |= {"fluid.density": 65.0, "fluid.continuity": "quasi-steady", "drive.pressure": 6.3}
    case = load_case("cases/dbv12.toml").replace({**changes, "materials.strain_level": 0.1})
    transfer = transfer_of(case, np.append(0.0, FREQUENCIES))
    (found,), (full, _) = transfer.at([33.3]), transfer.full(33.3)
    assert abs(full[0]) < 1e-4 * abs(full[1]) and transfer.error <= 1e-5
    assert found == pytest.approx(full, rel=1e-4)


def test_the_pressure_at_a_flange_without_a_line_is_that_which_drives(monkeypatch):
    """However the wall moves, with a pipe behind the valve too, whose fluid moves the pressure around the jet."""
    z, area = np.linspace(0.0, 0.56, 6), np.linspace(2e-3, 18e-3, 6)
    flow = Channel(z, 1e-5, 1.0, terms=[Tail(0.33, 10.0, 1.5)])
    monkeypatch.setattr(study, "LipCentre", lambda *_: None)
    transfer, empty = object.__new__(Transfer), np.zeros((0, 6))
    parts = flow.linearise_still(area, {"inlet": 6e3, "density": 1000.0})
    transfer.pencil = CoupledPencil(*np.zeros((3, 0, 0)), empty, empty.T, **parts)
    model = SimpleNamespace(flow=flow, tail=flow.terms[0], mesh=SimpleNamespace(part=QUARTER), shell=None)
    transfer.linear = SimpleNamespace(model=model, inlet=6e3, area=area)
    transfer._drive(flow, Mu(density=1000.0, storage=1.0))
    random = np.random.default_rng(9)
    for s in (0.0, 2j * np.pi * 3.0, 2j * np.pi * 20.0):
        motion = 1e-6 * (random.standard_normal(6) + 1j * random.standard_normal(6))
        _, _, R, S = transfer.pencil.fluid_at(s)
        inner = np.linalg.solve(S, -transfer.balance - R @ motion)
        assert transfer._outputs(s, 0.0, motion, inner)[3] == pytest.approx(1.0, rel=1e-9)


class Oscillators(Transfer):
    """Two modes of closed form, of 5 and 20 Hz."""

    size, error = 2, 0.0

    def __init__(self, _linear, _mu, frequencies):
        self.frequencies, self.reduced = frequencies, None

    def at(self, frequencies):
        turns = 2 * np.pi * np.asarray(frequencies)
        found = sum(1.0 / (abs(v) ** 2 - turns**2 - 2j * v.real * turns) for v in EIGENVALUES)
        return np.repeat(found[:, None], len(OUTPUTS), axis=1)


EIGENVALUES = 2 * np.pi * np.array([5.0, 20.0]) * complex(-0.02, 1.0)


@pytest.mark.parametrize(("resolved", "most", "modes"), [(8.0, 8.0, [5.0]), (np.inf, 60.0, [5.0, 20.0])])
def test_a_response_ends_where_waves_are_no_longer_resolved(monkeypatch, resolved, most, modes):
    stable = SimpleNamespace(stable=True, growth_rate=-1.0, frequency=5.0)
    linear = SimpleNamespace(resolved=lambda _place: resolved)
    keys = {"response.max_frequency": 60.0, "response.count": 240, "damping.band": ["10 Hz", "50 Hz"], **LOSS}
    valve = load_small(keys)
    family = SimpleNamespace(linear=linear)
    walk = SimpleNamespace(case=valve.case, verdict=lambda _: stable, family=lambda _: family, about_rubbers=list)
    monkeypatch.setattr(study, "StabilityWalk", lambda *_: walk)
    monkeypatch.setattr(study, "Transfer", Oscillators)
    monkeypatch.setattr(Oscillators, "_eigenvalues", lambda _self: EIGENVALUES)
    found = valve.response()
    (point,) = found.points
    assert found.curve(point["value"])["frequency"][-1] == pytest.approx(most)
    assert [peak["frequency"] for peak in found.peaks(point["value"])] == pytest.approx(modes)
    ended = [text for text in found.warnings if "resolve waves up to 8 Hz, so curves, peaks and root mean" in text]
    assert len(ended) == (resolved == 8.0)
    assert any(text.startswith("5 Hz lies outside damping.band") for text in found.warnings)
    fine = np.linspace(0.0, most, 200_001)
    power = np.abs(Oscillators.at(None, fine)[:, 0]) ** 2 * 100.0**2 / 60.0
    assert point["lip_displacement_rms"] == pytest.approx(np.sqrt(trapezoid(power, fine)), rel=1e-3)


def test_a_spectrum_may_name_the_units_of_its_columns(tmp_path):
    """Power densities in kPa2/Hz are 1e6 times as large as in Pa2/Hz."""
    case, path, rows = thesis_case(), tmp_path / "spectrum.csv", np.array([[10.0, 4.0], [60.0, 2.0]])
    for head, unit in (("", 1.0), ("frequency [Hz], density [Pa2/Hz]\n", 1.0), ("f [Hz];power [kPa^2/Hz]\n", 1e-6)):
        path.write_text(head + "".join(f"{f}{';' if ';' in head else ','}{unit * p}\n" for f, p in rows))
        found = case.replace({"response.spectrum": str(path)}).response.density()
        assert np.array(found) == pytest.approx(rows, rel=1e-12)
    path.write_text("frequency [Hz], density [Pa]\n10, 4\n60, 2\n")
    with pytest.raises(CaseError, match="names the unit 'Pa', which is not a power density of a pressure"):
        case.replace({"response.spectrum": str(path)}).response.density()


def in_time(case, folder, time, pressure, step, duration):
    table = folder / "drive.csv"
    np.savetxt(table, np.column_stack([time, pressure]), delimiter=",", header="time [s],pressure [Pa]", comments="")
    keys = {"drive_table": str(table), "start": "steady", "step": step, "duration": duration}
    return dbvfiv.load(case, {f"transient.{name}": value for name, value in keys.items()}).transient().history


@pytest.mark.slow
@pytest.mark.parametrize("frequency", [3.0, 12.0, 25.0])
def test_a_sine_in_time_has_the_amplitude_and_the_phase(valve, tmp_path, frequency):
    inlet, amplitude = valve.case.drive.pressure, 5.0
    step, duration = 1 / frequency / 100, max(12 / frequency, 1.2)
    time = np.arange(0.0, duration, step / 2)
    pressure = inlet + amplitude * np.sin(2 * np.pi * frequency * time)
    history = in_time(valve.case, tmp_path, time, pressure, step, duration - step)
    t = history["time"]
    late = t > t[-1] - 4 / frequency
    turn = 2 * np.pi * frequency * t[late]
    columns = np.column_stack([np.sin(turn), np.cos(turn), np.ones(len(turn)), turn])
    (found,) = valve.transfer.at([frequency])
    for name, number, scale in (("lip_displacement", 0, 1.0), ("outlet_area", 1, 1.0), ("mass_flow", 2, 1e3)):
        sine, cosine, *_ = np.linalg.lstsq(columns, history[name][late], rcond=None)[0]
        ratio = (sine + 1j * cosine) / amplitude / scale / found[number]
        assert abs(abs(ratio) - 1) < 0.01 and abs(np.angle(ratio, deg=True)) < 1.0, name


@pytest.mark.slow
def test_noise_in_time_has_the_root_mean_square(valve, tmp_path):
    inlet, sigma, step, duration = valve.case.drive.pressure, 10.0, 1e-3, 8.0
    time = np.arange(0.0, duration + 4 * step, 4 * step)  # straight between values at random
    random = sigma * np.random.default_rng(7).standard_normal(len(time))
    history = in_time(valve.case, tmp_path, time, inlet + random, step, duration)
    kept = history["time"] > 1.0
    spread = valve.transfer.spread(lambda f: 2 * sigma**2 * 4 * step * np.sinc(f * 4 * step) ** 4)
    # the same noise through the response, which leaves no scatter of one sample
    fine = np.arange(0.0, duration, step)
    spectrum = np.fft.rfft(np.interp(fine, time, random))
    grid = np.fft.rfftfreq(len(fine), step)
    inside = (grid >= FREQUENCIES[0]) & (grid <= FREQUENCIES[-1])
    passed = np.zeros((len(grid), len(OUTPUTS)), complex)
    passed[inside] = spectrum[inside, None] * valve.transfer.at(grid[inside])
    expected = np.fft.irfft(passed, len(fine), axis=0)[fine > 1.0].std(axis=0)
    for name, number, scale in (("lip_displacement", 0, 1.0), ("mass_flow", 2, 1e3)):
        rms = history[name][kept].std() / scale
        print(f"{name}: {rms / expected[number]:.4f} of the same noise, {rms / spread.rms[number]:.4f} of its spectrum")
        assert rms == pytest.approx(expected[number], rel=0.05)


@pytest.mark.slow
def test_the_reduced_operator_is_the_full_one():
    transfer = transfer_of(
        load_small(STATES["storage-rayleigh"], {"fluid.density": 1000.0}).case, FREQUENCIES[12:170:4]
    )
    assert transfer.error < 1e-5 and transfer.size < 60
    for frequency in (0.9, 17.3, 44.4, 63.6):
        full = transfer.full(frequency)[0]
        assert np.abs(transfer.at([frequency])[0] / full - 1).max() < 1e-5


PIPES = {
    "upstream.length": 5.0,
    "upstream.diameter": "300 mm",
    "upstream.loss": 1.5,
    "downstream.pipe_diameter": "330 mm",
    "downstream.length": 5.0,
    "downstream.loss": 1.5,
}


@pytest.mark.slow
@pytest.mark.parametrize("pipes", [{}, PIPES])
def test_the_static_response_is_the_slope_of_the_steady_states(pipes):
    case = load_small(STATES["storage-rayleigh"], {"fluid.density": 1000.0}, pipes).case
    low, high = (dbvfiv.load(case).steady(pressure=pressure) for pressure in (5990.0, 6010.0))
    names = "lip_displacement", "volume_flow", "flange_pressure"
    slopes = [(getattr(high, n) - getattr(low, n)) / 20 for n in names]
    place = Mu.of(case)
    transfer = Transfer(StabilityWalk(case).family(place).linear, place, FREQUENCIES[12:44])
    assert transfer.full(0.0)[0][[0, 2, 3]] == pytest.approx(slopes, rel=2e-3)


def test_variance_and_correlation_time_of_one_mode_are_those_of_its_formula(monkeypatch):
    """One oscillator under white noise: variance S / (8 zeta w^3), S one-sided per Hz; correlation time 1 / decay."""
    w, zeta = 2 * np.pi * 20.0, 0.01
    transfer = object.__new__(Transfer)
    transfer.frequencies = np.array([0.01, 400.0])
    at = lambda f: (1.0 / (w**2 - (2 * np.pi * f) ** 2 + 2j * zeta * w * 2 * np.pi * f))[:, None]  # noqa: E731
    monkeypatch.setattr(transfer, "at", at)
    vars(transfer)["modes"] = np.array([w * complex(-zeta, np.sqrt(1 - zeta**2))])
    found = transfer.spread(lambda f: np.full_like(f, 3.0))
    assert found.rms[0] ** 2 == pytest.approx(3.0 / (8 * zeta * w**3), rel=1e-3)
    assert found.correlation_time[0] == pytest.approx(1 / (zeta * w), rel=1e-2)


def test_the_command_tells_peaks_precursors_and_states_that_flutter(tmp_path, command_line):
    size = ("--set", "mesh.around=6", "--set", "mesh.along=8", "--set", "response.count=64")
    given = ("--over", "density=100:1000:3", "-p", "6 kPa", "--max-frequency", "60 Hz", "-o", tmp_path / "found.h5")
    told = command_line("response", "cases/dbv12.toml", *size, *given, "--plots", tmp_path, "--json")
    document = json.loads(told.out)
    assert told.status == 1 and len(document["failures"]) == 1 and "is not stable" in document["failures"][0]
    first, second = document["points"]
    assert document["symmetry"] == "SS"
    assert first["value"] == 550 and second["value"] == 1000
    assert first["lip_displacement_rms"] > second["lip_displacement_rms"]  # the onset lies at lower densities
    assert len(first["curve"]["frequency"]) == 64 and first["peaks"][0]["frequency"] > 0
    assert {path.name for path in tmp_path.glob("*.png")} == {"response.png", "precursors.png"}
    assert dbvfiv.load_result(tmp_path / "found.h5").summary()["points"][0]["peaks"] == first["peaks"]
    for option, part in (
        (("--noise", "200"), "--noise is given as '200', without a unit"),
        (("--noise", "2 Pa", "--spectrum", "cases/closing.csv"), "one of them has to go"),
        (("--law", "both"), "it must be"),
    ):
        refused = command_line("response", "cases/dbv12.toml", *size, *option)
        assert refused.status == 2 and part in refused.err.replace("\n", " "), refused.err
    assert "both" not in command_line("response", "--help").out
    still = command_line("response", "cases/dbv12.toml", *size, "--set", "fluid.unsteady=false", "-p", "6 kPa")
    assert still.status == 2 and "needs a fluid with inertia" in still.err.replace("\n", " ")


@pytest.mark.slow
def test_peaks_are_eigenvalues_of_the_full_operator():
    """Strongly damped ones of the reduced operator were 3.7 % off."""
    keys = {"fluid.continuity": "storage", "damping.beta": 1.5e-3, "drive.pressure": 18e3, "fluid.density": 1000.0}
    transfer = transfer_of(load_small(keys).case, np.linspace(1.0, 150.0, 24))
    every = all_eigenvalues(transfer.pencil)
    assert len(transfer.modes) > 3
    for value in transfer.modes:
        assert np.abs(every - value).min() < 1e-6 * abs(value)
