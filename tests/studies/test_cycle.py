"""Branches of limit cycles of the valve: beside the onset, in a file, in time, and where there are none."""

from __future__ import annotations

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from continuation.periodic import PeriodicMotion
from dbvfiv.case.parameters import Mu
from dbvfiv.errors import CaseError, SolveError
from dbvfiv.flow.channel import Channel
from dbvfiv.shell.recovery import face_strains
from dbvfiv.studies.case import thesis_case
from dbvfiv.studies.life import Life, motion_of
from dbvfiv.studies.orbits import Orbit
from dbvfiv.studies.session import Session, load_result, resume_result
from dbvfiv.studies.stability.walk import StabilityWalk
from tests.observers import Stop
from tests.verification.test_cycles_in_time import run

CASE = {
    "mesh.around": 6,
    "mesh.along": 8,
    "drive.pressure": 6e3,
    "damping.alpha": 0.0,
    "damping.beta": 3e-3,
    "cycle.over": "density=230:260:4",
}


def session_of(**changes):
    return Session(thesis_case(CASE | {key.replace("__", "."): v for key, v in changes.items()}))


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    return tmp_path_factory.mktemp("cycles") / "cycles.h5"


@pytest.fixture(scope="module")
def found(file):
    return session_of().perform("cycle", file)


def test_life_of_a_cycle(found):
    """A block is a period; flaws are driven harder by larger cycles; half the instants give the same energies."""
    motions = [motion_of(found, found.points[k].value) for k in (-1, -1, 0)]
    few = (replace(motion, states=motion.states[::step]) for motion, step in zip(motions, (1, 2, 2)))
    large, fewer, small = (Life(found, motion) for motion in few)
    assert np.isclose(large.motion.hours * 3600 * found.points[-1].frequency, 1.0)
    assert all(a.release > 1.05 * b.release > 0 for a, b in zip(large.parts[:3], small.parts))
    assert np.allclose([part.release for part in fewer.parts], [part.release for part in large.parts], rtol=1e-3)


def test_amplitude_is_the_root_of_the_distance_from_the_onset(found):
    """And the slope at the onset is the same from the first two cycles; frequencies tend to that of the onset."""
    first, second = found.points[:2]
    onset = found.onset["value"]
    assert np.isclose(first.amplitude, 1e-3, rtol=2e-3)
    slopes = [(onset - p.value) / p.amplitude**2 for p in (first, second)]
    assert np.isclose(*slopes, rtol=0.02) and slopes[0] > 0
    assert abs(first.frequency - found.onset["frequency"]) < 0.01 * first.frequency
    assert first.stable and found.points[-1].stable


@pytest.mark.slow
def test_cycles_are_those_of_runs_in_time(found):
    """Steps come back to where they started but for their error of second order."""
    point = found.points[-1]
    start = point.orbit.lip[0]
    coarse, fine = (run(point, steps, periods=1)[-1] - start for steps in (60, 120))
    assert 3.0 < coarse / fine < 5.0
    assert abs(4 * fine - coarse) / 3 < 2e-3 * point.amplitude


def beside(command_line, folder, record, result, *options):
    """Lines of a record as `compare` tells them."""
    np.savetxt(folder / "record.csv", np.column_stack(record), delimiter=",", header="time [s],lip", comments="")
    files = folder / "record.csv", result, "-o", folder / "beside.png"
    told = command_line("compare", *files, *options, "--json")
    assert told.status == 0, told.err
    return json.loads(told.out)["measured"]


def test_a_record_is_the_cycle_of_its_frequency(found, file, tmp_path, command_line):
    point, time = found.points[-1], np.arange(0.0, 4.0, 1e-3)
    noise = 0.05 * np.random.default_rng(3).standard_normal(len(time))
    turn = 2 * np.pi * float(point.frequency) * time
    (line,) = beside(command_line, tmp_path, (time, np.cos(turn) + noise), file, "--within", "0.01")
    assert line["matches"][0]["name"] == "cycle at 230 kg/m³" and line["matches"][0]["share"] > 0.5
    assert "cycle at 230" in line["says"]
    (ring,) = beside(command_line, tmp_path, (time, np.exp(-2 * time) * np.cos(turn) + noise), file)
    assert ring["says"] == "It is damped, and nothing that was computed is."


@pytest.mark.slow
def test_a_record_is_the_run_that_it_is(tmp_path, command_line):
    kick = {"start": "kick", "step": 2e-3, "duration": 0.8}
    session = session_of(damping__alpha=10.0, fluid__density=1000.0)
    run = session.replace({f"transient.{key}": value for key, value in kick.items()}).perform(
        "transient", tmp_path / "run.h5"
    )
    time, lip = run.history["time"], run.history["lip_displacement"]
    noise = 1e-3 * np.ptp(lip) * np.random.default_rng(4).standard_normal(len(lip))
    lines = beside(command_line, tmp_path, (time, lip + noise), tmp_path / "run.h5", "--within", "1")
    assert lines[0]["matches"][0]["name"] == "run" and lines[0]["matches"][0]["distance"] < 1.0
    assert lines[0]["says"].startswith("It is run")
    faster = beside(command_line, tmp_path, (0.5 * time, lip + noise), tmp_path / "run.h5", "--within", "1")
    assert faster[0]["says"].startswith("None of them")


def test_the_flow_of_a_cycle_is_that_of_its_parameters_at_all_instants():
    """Fluid that a wall displaces leaves by the blend of the flow models of a cycle, whose largest flow lies between
    the samples of the series.
    """
    model = SimpleNamespace(size=7, nodal=lambda x: x, flow=Channel(np.linspace(0.0, 0.6, 7), 1e-9))
    model.rows = SimpleNamespace(areas=lambda x: x, jacobian=lambda _: np.eye(7))
    model.mesh = SimpleNamespace(part=SimpleNamespace(copies=4))
    mean, swing = np.linspace(1e-3, 5e-3, 7), np.append(np.full(6, 1e-4), 0.0)  # at 2 m/s 0.01 m3/s flow in
    waves = np.append(mean, 2.0), np.append(0.5 * np.exp(0.4j) * swing, 0.0)
    motion, turn = PeriodicMotion.of_waves(waves, 1, 200.0), 2 * np.pi * np.linspace(0.0, 1.0, 5000)
    for storage in (0.0, 0.25, 1.0):
        orbit = Orbit(model, {"inlet": 1e3, "density": 800.0, "storage": storage}, motion)
        moved = storage * 200.0 * 0.1 * (0.5 + 5.0) * 1e-4  # by trapezoids over the length
        assert orbit.flow_extremes == pytest.approx((3200 * (0.01 - moved), 3200 * (0.01 + moved)), rel=1e-6)
        at_lip = (0.01 + moved * np.sin(turn)) / (1e-3 + 1e-4 * np.cos(turn))
        assert orbit.flow[1].min() == pytest.approx(min(2.0, at_lip.min()), rel=1e-3)


def test_modes_of_a_flow_without_inertia_have_its_unknowns():
    """Modes by which periodic motions and normal forms are started have the same pressures with their inlet velocity as
    without unknowns.
    """
    law, random = Channel(np.linspace(0.0, 0.6, 5), 1e-9, unsteady=False), np.random.default_rng(1)
    area, slope, place = np.linspace(1e-3, 5e-3, 5), random.standard_normal((5, 3)), Mu(pressure=6e3, density=800.0)
    linear = SimpleNamespace(area=area, slope=slope, model=SimpleNamespace(flow=law))
    walk = SimpleNamespace(built=lambda _: linear, family=lambda _: SimpleNamespace(linear=linear))
    mode = SimpleNamespace(q=random.standard_normal(3) + 1j * random.standard_normal(3), u=np.zeros(0))
    x, parts = StabilityWalk.unknowns(walk, place, mode), law.linearise_still(area, place.for_system())
    pressures = parts["A0"] @ slope @ x[:3] + parts["B0"] @ x[3:]
    assert len(x) == 4 and np.allclose(x[:3], mode.q)
    assert np.allclose(pressures, law.steady_operator(area, 6e3)[1] @ slope @ mode.q, rtol=1e-9)


def test_lips_that_stand_apart_touch_where_their_faces_meet():
    orbit = Orbit(SimpleNamespace(room=3e-3), {}, None)
    vars(orbit)["lip"] = 1e-3 - 2e-3 * np.cos(orbit.phases)
    assert orbit.lip_extremes[0] == pytest.approx(-1e-3) and orbit.clearance == pytest.approx(2e-3)


def test_values_asked_for_are_met(found):
    assert {p.value for p in found.points if p.asked} <= set(found.case.cycle.axis.values)
    assert found.points[-1].value == 230.0 and found.points[-1].asked
    assert found.reason == "ended on the limit density = 230"


def test_what_is_read_off(found):
    point = found.points[-1]
    orbit = point.orbit
    assert np.isclose(point.amplitude, 0.5 * np.ptp(orbit.lip), rtol=1e-3)
    assert np.isclose(orbit.lip_rate.max(), np.gradient(orbit.lip, orbit.time).max(), rtol=2e-2)
    assert np.isclose(orbit.lip_harmonics[0], point.lip_mean, rtol=1e-6)
    held = replace(orbit)
    vars(held)["lip"] = np.zeros_like(orbit.lip)  # as where its node is held
    assert not held.lip_harmonics.any()
    assert orbit.clearance > 0 and point.least_speed > 0
    summary = found.summary()
    assert summary["parameter"] == "density" and summary["special_points"] == []
    for key in ("value", "amplitude", "frequency", "stable"):
        assert all(key in row for row in summary["points"])
    assert summary["points"][-1]["exponents"][0]["growth_rate"] < 0
    assert any("onset" in line for line in found.lines())
    assert found.nearest(found.points[2].value).number == 2


def test_ranges_for_fatigue(found):
    """Ranges of each layer, at its faces; those of a smaller cycle are smaller."""
    small, large = (found.points[k].ranges for k in (0, -1))
    layers, orbit = large.largest(), found.points[-1].orbit
    shell, states = orbit.model.shell, orbit.motion.at(orbit.phases)[:, : orbit.model.size]
    bent = np.ptp([face_strains(shell, q) for q in states], axis=0).max(axis=(0, 2, 3))
    assert np.allclose([row["strain_range"] for row in layers], bent, rtol=2e-3)
    assert [row["layer"] for row in layers] == list(large.names) and len(layers) == 5
    for small_row, row in zip(small.largest(), layers):
        assert 0 < small_row["strain_range"] < row["strain_range"] < 0.5
        assert 0 < small_row["stress_range"] < row["stress_range"]
        assert row["strain_position"][2] < 0.56


def test_file_figures_and_fields(found, file, tmp_path):
    again = load_result(file)
    assert again.summary() == found.summary()
    figures = again.figures()
    assert set(figures) == {
        "branch",
        "envelope",
        "phase-plane",
        "centre-line-cycle",
        "wave",
        "spectrum",
        "stress-range",
    }
    assert again.export(tmp_path / "cycle.vtkhdf").stat().st_size > 0


def test_interrupted_and_resumed(tmp_path):
    """Before its fourth cycle, whose prediction knows the onset: with the same cycles between the values asked for."""
    path, keys = tmp_path / "part.h5", {"cycle__over": "density=225:245:2", "cycle__max_step": 0.1}
    whole = session_of(cycle__exponents=0, **keys).perform("cycle")
    part = session_of(cycle__exponents=0, **keys).perform("cycle", path, Stop(3))
    assert part.interrupted and len(part.points) == 3 and part.points[0].stable is None
    resumed = resume_result(path)
    assert resumed.complete and len(resumed.points) > 4 and resumed.points[-1].value == 225.0
    assert np.allclose([p.value for p in resumed.points], [p.value for p in whole.points], rtol=1e-6)
    assert np.allclose([p.amplitude for p in resumed.points], [p.amplitude for p in whole.points], rtol=1e-4)
    with pytest.raises(CaseError, match="nothing to resume"):
        resume_result(path)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"cycle__over": "density=300:400:3"}, "No oscillation starts"),
        ({"drive__kind": "uniform"}, "Without flow"),
        ({"outside__fluid": "same", "cycle__over": "density=230:260:4"}, "fluid outside"),
        ({"cycle__amplitude": 0.09}, "cycle.amplitude"),
    ],
)
def test_what_cannot_be_followed_is_said(changes, said):
    with pytest.raises(SolveError, match=said):
        session_of(**changes).perform("cycle")


def test_bad_keys():
    with pytest.raises(CaseError, match="tail_length"):
        session_of(cycle__over="tail_length=1:2:3").perform("cycle")
    with pytest.raises(CaseError, match="cycle.tolerance"):
        session_of(cycle__tolerance=0.5)
