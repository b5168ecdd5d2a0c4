"""Whole runs: starts, drives, files, resuming, being killed, verdicts."""

import numpy as np
import pytest

import dbvfiv
from dbvfiv.errors import CaseError, SolveError
from dbvfiv.motion.control import Drive
from dbvfiv.motion.equations import ValveMotion
from dbvfiv.motion.start import first_state, steady_positions
from dbvfiv.observer import Observer
from dbvfiv.studies.case import thesis_case
from dbvfiv.studies.session import load_result
from dbvfiv.studies.stability.verdict import DIVERGES, FLUTTERS, UNDECIDED
from dbvfiv.studies.transient.run import Runner, RunVerdict, assess, beyond_model, lip_gap, parting
from dbvfiv.studies.transient.study import stability_of
from dbvfiv.verdict import Verdict
from tests.small_valves import SMALL

from .runs import SHORT, transient


@pytest.mark.slow
def test_rest_start_opens_the_valve(valve):
    run = Runner(valve({"transient.duration": 0.05})).start()
    h = run.history
    assert h["time"] == pytest.approx(np.arange(51) * 1e-3)
    assert h["mass_flow"][0] == 0 and h["mass_flow"][-1] > 5
    assert h["lip_displacement"][-1] > 5e-3
    assert h["lip_opening"][0] == pytest.approx(0.38e-3, rel=1e-9)  # between the faces at rest
    assert h["lip_opening"][-1] == pytest.approx(0.38e-3 + 2 * h["lip_displacement"][-1], rel=0.05)
    assert h["inlet_pressure"] == pytest.approx(18e3)
    assert h["mass_flow"] == pytest.approx(h["inlet_mass_flow"], rel=1e-9)  # quasi-steady continuity
    assert np.abs(h["balance"]).max() < 0.02 * h["pressure_work"].max()
    assert h["station_pressure"][:, 0] == pytest.approx(0, abs=1e-3)
    assert not run.failures and not run.interrupted


def test_steady_start_stays(valve):
    run = Runner(valve({"transient.start": "steady", "transient.duration": 0.05, "drive.pressure": 6e3})).start()
    assert run.verdict.name == "steady" and run.verdict.decided
    assert run.verdict.residual < 1e-8
    assert np.ptp(run.history["lip_displacement"]) < 1e-9


def test_kick_rings_at_the_eigenvalue(valve):
    run = Runner(
        valve(
            {
                "transient.start": "kick",
                "transient.duration": 0.02,
                "transient.step": 2e-4,
                "transient.kick_opening": 1e-5,
                "drive.pressure": 6e3,
                "fluid.density": 10.0,
                "damping.alpha": 0.0,
            }
        )
    ).start()
    value = run.progress.eigenvalue
    h = run.history
    still = steady_positions(run.model, 6e3)[run.model.shell.dofs.index[run.model.mesh.rows[0, 0], 1]]
    expected = 1e-5 * np.exp(value * h["time"]).real
    assert h["lip_displacement"][0] - still == pytest.approx(1e-5, rel=1e-6)
    assert np.abs(h["lip_displacement"] - still - expected).max() < 0.02 * np.abs(expected).max()


def test_a_kick_before_anything_flows_pushes_the_valve_at_rest(valve):
    """The ramp begins below the pressure downstream."""
    changes = {"transient.start": "kick", "transient.ramp": 5e-3, "transient.duration": 5e-3}
    model = valve(changes | {"downstream.pressure": 400.0, "drive.pressure": 6e3})
    run = Runner(model).start()
    assert run.progress.eigenvalue.imag > 0 and run.history["lip_displacement"][0] == pytest.approx(1e-4, rel=1e-6)
    with pytest.raises(CaseError, match="is 0 Pa, below the 400 Pa at which nothing flows"):
        dbvfiv.load(model.case, {"fluid.unsteady": False}).transient()


@pytest.mark.parametrize(
    "beta, number",
    [(3e-3, 1), pytest.param(0.0, 1, marks=pytest.mark.slow), pytest.param(0.0, 3, marks=pytest.mark.slow)],
)
def test_a_kick_follows_a_leading_mode_by_the_rule_of_all_studies(valve, beta, number):
    """Without stiffness damping too, where a band of structural frequencies says what is leading."""
    changes = {"drive.pressure": 6e3, "fluid.density": 10.0, "damping.alpha": 0.0, "damping.beta": beta}
    kick = {"transient.start": "kick", "transient.kick_mode": number, "transient.duration": 1e-3}
    model = valve(changes | kick)
    listed = [m for m in dbvfiv.load(model.case).modes().modes if m.frequency > 0]
    followed = Runner(model).start().progress.eigenvalue
    mode = listed[number - 1]
    assert followed == pytest.approx(complex(mode.growth_rate, 2 * np.pi * mode.frequency), rel=1e-6)


def test_storage_law_lets_the_wall_displace_fluid(valve):
    changes = {
        "transient.start": "kick",
        "transient.kick_opening": 3e-3,
        "drive.pressure": 12e3,
        "transient.duration": 0.03,
        "transient.step": 5e-4,
    }
    h = Runner(valve({"fluid.continuity": "storage"} | changes)).start().history
    assert np.abs(h["mass_flow"] - h["inlet_mass_flow"]).max() > 0.5
    volume = np.trapezoid if hasattr(np, "trapezoid") else np.trapz
    z = np.array(valve({}).mesh.z)
    stored = 4 * volume(h["station_area"], z, axis=1)
    gained = volume(h["inlet_mass_flow"] - h["mass_flow"], h["time"]) / 1000.0
    assert stored[-1] - stored[0] == pytest.approx(gained, rel=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("kpa", [18, pytest.param(36, marks=pytest.mark.slow)])
def test_storage_law_draws_water_in_through_shut_lips_and_opens(valve, kpa):
    """The saddle grows while the lips are shut; the valve opens all the same and rests where load steps lead."""
    changes = {"fluid.continuity": "storage", "drive.pressure": 1e3 * kpa, "transient.duration": 0.5}
    run = Runner(valve(changes | {"transient.step": 2e-3})).start()
    h = run.history
    assert not run.failures
    drawn = h["time"][h["mass_flow"] < 0]
    assert len(drawn) > 5 and drawn.max() < 0.1
    q = steady_positions(run.model, 1e3 * kpa)
    steady = (
        4e3
        * run.model.flow.inlet_velocity(run.model.rows.areas(run.model.nodal(q)), 1e3 * kpa, 1e3)
        * run.model.rows.areas(run.model.nodal(q))[-1]
    )
    assert h["mass_flow"][-1] == pytest.approx(steady, rel=1e-4)
    assert np.abs(run.progress.state.q - q).max() < 1e-4 * np.abs(q).max()
    assert run.control.halvings < 30


def test_a_hold_is_judged_from_its_begin():
    assert Drive((0.0, 0.1, 1.0), (0.0, 6e3, 6e3)).settled_at == 0.1
    assert Drive((0.0, 0.1, 1.0), (6e3, 6e3, 0.0)).settled_at == 1.0
    assert Drive((0.0, 0.1, 1.0), (0.0, 6e3, 0.0)).settled_at == 1.0
    assert Drive((0.5,), (6e3,)).settled_at == Drive((0.5, 1.0), (6e3, 6e3)).settled_at == 0.0


@pytest.mark.parametrize("until, decided", [(0.5, True), (2.0, True), (2.001, False)])
def test_nothing_is_certain_before_the_drive_holds(valve, until, decided):
    """A run that ends before the last change of a table is not steady because nothing has changed so far."""
    history = made_history(model := valve(), 5.0)
    end = float(history["time"][-1])
    found = assess(history, model, drive=Drive((0.0, 0.25 * end * until, 0.5 * end * until), (6e3, 6e3, 7e3)))
    assert found.name == "steady" and found.decided == decided
    assert decided or "The drive changes until" in found.summary()["reason"]


def test_a_kick_says_what_became_of_it_where_that_is_certain(valve):
    """A steady state is that of one pressure."""
    told = {"verdict": "growing", "reason": "It drifts one way.", "decided": False}
    assert stability_of(told).outcome == UNDECIDED and not stability_of(told).certain
    assert stability_of(told | {"decided": True}).outcome == DIVERGES
    rings = {"decided": True, "lip_displacement": {"frequency": 20.0}}
    assert stability_of(told | rings).outcome == FLUTTERS and stability_of(told | rings).certain
    kicked = {"transient.start": "kick", "transient.ramp": 5e-3, "transient.duration": 8e-3}
    found = transient(valve(kicked | {"drive.pressure": 6e3})).stability
    assert found.outcome == UNDECIDED and "the drive changes until 0.005 s" in found.sentence("")


def test_drives(tmp_path, valve):
    assert Drive.of(valve({"transient.ramp": 0.1}).case)(0.025) == pytest.approx(4500)
    table = tmp_path / "drive.csv"
    table.write_text("# made up\ntime [ms], pressure [kPa]\n0, 0\n10, 6\n20, 0.006 MPa\n")
    case = valve().case.replace({"transient.drive_table": str(table)})
    drive = Drive.of(case)
    assert (drive(0.005), drive(0.01), drive(1.0)) == pytest.approx((3e3, 6e3, 6e3))
    assert drive.settled_at == pytest.approx(0.01)


@pytest.mark.parametrize(
    "text, words",
    [
        ("0, 1\n0, 2\n", "do not increase"),
        ("0, 1, 2\n", "not a time and a pressure"),
        ("time [kg], pressure [Pa]\n0, 1\n", "unit 'kg'"),
        ("0, -5\n", "must not be negative"),
        ("", "no rows"),
        ("0 s, 5 m\n", "5 m"),
    ],
)
def test_bad_drive_tables(tmp_path, text, words):
    table = tmp_path / "drive.csv"
    table.write_text(text)
    with pytest.raises(CaseError, match=words):
        thesis_case([f"transient.drive_table={table}"])
    assert thesis_case().replace({"transient.drive_table": str(table)}).transient.drive_table == table  # is not read


@pytest.mark.parametrize("start", ["rest", "steady", "kick"])
@pytest.mark.parametrize("law", ["quasi-steady", "storage"])
def test_a_valve_without_pressure_stays_as_it_is(tmp_path, valve, command_line, start, law):
    changes = {"drive.pressure": 0.0, "transient.start": start, "fluid.continuity": law, "transient.kick_opening": 1e-5}
    result = transient(valve(SHORT | changes), output=tmp_path / "run.h5")
    assert result.complete and not result.failures and len(result.history["time"]) == 21
    assert result.verdict["verdict"] != "closed" and (start == "kick" or result.verdict["verdict"] != "growing")
    assert load_result(tmp_path / "run.h5").lines()
    limit = 1e-12 if start != "kick" else 1.1e-5
    assert np.abs(result.history["lip_displacement"]).max() < limit
    assert command_line("info", tmp_path / "run.h5").status == 0


@pytest.mark.slow
@pytest.mark.parametrize("start, density", [("steady", 1000.0), ("rest", 1.2)])
def test_a_stiff_valve_that_stands_at_its_gap_is_open(valve, start, density):
    """It opens by a thousandth of its gap at rest, and lets flow what a jet of that area carries."""
    changes = {"valve.thickness_factor": 8.0, "drive.pressure": 500.0, "fluid.density": density}
    changes |= {"damping.alpha": 400.0, "transient.start": start, "transient.duration": 0.5, "transient.step": 2e-3}
    run = Runner(valve(changes | {"transient.numerical_damping": 0.1})).start()
    assert run.verdict.name == "steady" and run.verdict.decided
    area = run.history["smallest_area"][-1]
    assert area == pytest.approx(lip_gap(run.model), rel=2e-3)
    assert run.history["mass_flow"][-1] == pytest.approx(area * np.sqrt(2 * density * 500.0), rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("back", [0.0, pytest.param(1e3, marks=pytest.mark.slow)])
def test_a_valve_whose_drive_turns_around_closes_and_without_one_stands_at_its_gap(tmp_path, valve, back):
    """Lips that are pressed on their stops are shut; those that nothing presses let fluid pass."""
    table = tmp_path / "drive.csv"
    table.write_text("0, 6000\n0.05, 6000\n0.15, 0\n")
    changes = {"transient.drive_table": str(table), "downstream.pressure": back, "transient.start": "steady"}
    changes |= {"fluid.density": 10.0, "damping.alpha": 400.0, "transient.duration": 0.4}
    changes |= {} if back else {"transient.step": 2e-3}
    run = Runner(valve(changes | {"transient.numerical_damping": 0.1})).start()
    assert run.history["inlet_pressure"] == pytest.approx([run.drive(time) for time in run.history["time"]], abs=1e-6)
    assert run.history["smallest_area"][0] > 20 * lip_gap(run.model)
    assert (run.verdict.name == "closed" and run.verdict.decided) if back else run.verdict.name != "closed"


def made_history(model, share, flow=1e-3, time=np.linspace(0.0, 1.0, 101)):
    """Time, an even second, of a valve under 18 kPa whose passage is a share of the gap at rest."""
    ones = np.ones(len(time))
    history = dict.fromkeys(("lip_displacement", "lip_opening", "lip_velocity"), 1e-3 * ones)
    history |= dict.fromkeys(("mass_flow", "inlet_mass_flow"), flow * ones)
    history |= {"time": time, "inlet_pressure": 18e3 * ones}
    history |= dict.fromkeys(("stops", "stop_energy"), 0.0 * ones)
    return history | {"smallest_area": lip_gap(model) * share * ones}


@pytest.mark.parametrize(
    ("share", "flow", "name"), [(0.4, 1e-3, "closed"), (0.6, 1e-3, "steady"), (0.4, 5.0, "steady")]
)
def test_a_valve_is_closed_that_is_shut_and_lets_nothing_flow(valve, share, flow, name):
    """A passage of half the gap at rest or less is shut, if no more passes than leaks out of it."""
    model = valve()
    assert assess(made_history(model, share, flow), model).name == name


@pytest.mark.parametrize("counts, steps", [((1920, 440), (1e-3 / 32, 1e-3)), ((2000, 60), (2e-4, 5e-3))])
def test_a_run_of_short_steps_and_long_ones_is_judged_to_its_end(valve, counts, steps):
    """Steps that were halved while lips slammed, and adaptive ones that grow as the valve comes to rest: no gaps."""
    time = np.append(0.0, np.cumsum(np.repeat(steps, counts)))
    rings = 5.0 + np.exp(-time / 0.02) * np.sin(2 * np.pi * 200.0 * time)
    found = assess(made_history(model := valve(), 5.0, time=time) | {"mass_flow": rings}, model)
    assert found.mass_flow.judged == pytest.approx((0.0, np.dot(counts, steps)))
    assert found.name == "steady" and found.decided and not any("gap" in note for note in found.mass_flow.notes)


@pytest.mark.parametrize("apart", [{"valve.lip_rise": 0.04}, {"valve.lip_radius": 0.01, "supports.contact": "faces"}])
def test_lips_that_stand_apart_are_shut_where_they_meet(valve, apart):
    """Two fifths of what they leave at rest is open, and a lip that swings about its place at rest meets nothing."""
    model = valve(apart)
    at_rest = model.mesh.part.copies * float(model.mesh.rest_area[0] - model.mesh.wall_deduction[0])
    history = made_history(model, 0.4 * at_rest / lip_gap(model))
    assert assess(history, model).name == "steady"
    swing = 2e-4 * np.sin(2 * np.pi * 16.0 * history["time"])
    assert assess(history | {"lip_displacement": swing}, model).name not in ("closed", "chatters")
    assert np.allclose(parting(history | {"lip_displacement": np.full(101, -model.lens)}, model), 2.0)
    assert assess(made_history(model, 0.4), model).name == "closed"


def test_faces_that_part_and_meet_again_and_again_chatter(valve):
    """Sixteen openings a second of 3 mm, whose lips meet at 0.2 m/s; the same of stops is none."""
    phase = 16.0 * np.linspace(0.0, 1.0, 101) % 1.0
    for contact in ("faces", "stops"):
        model = valve({"supports.contact": contact})
        history = made_history(model, np.where(phase < 0.5, 0.1, 5.0))
        history |= {"lip_opening": np.where(phase < 0.5, 0.0, 3e-3), "lip_velocity": np.where(phase < 0.5, 0.0, -0.2)}
        found = assess(history, model)
        assert (found.name == "chatters") == (contact == "faces") and found.name != "closed"
        if contact == "faces":
            chatter = found.summary()["chatter"]
            assert found.decided and chatter["rate"] == pytest.approx(16.0, rel=0.02)
            assert chatter["impact_speed"] == pytest.approx(0.2) and chatter["opening"] == pytest.approx(3e-3)
            assert chatter["mean_flow"] == pytest.approx(1e-3) and chatter["shut_share"] == pytest.approx(0.5, abs=0.1)


@pytest.mark.slow
def test_the_verdict_ends_the_run(valve):
    model = valve(
        {
            "transient.duration": 5.0,
            "transient.stop_when": ["steady"],
            "transient.numerical_damping": 0.1,
            "drive.pressure": 6e3,
            "transient.start": "kick",
            "damping.alpha": 5.0,
            "transient.kick_opening": 1e-4,
        }
    )
    run = Runner(model).start()
    assert run.stopped and run.verdict.name == "steady" and run.progress.state.time < 4.0


@pytest.mark.slow
def test_staggered_coupling_reaches_the_same_state(valve):
    changes = {
        "transient.start": "kick",
        "transient.kick_opening": 1e-3,
        "transient.duration": 0.3,
        "transient.step": 5e-4,
        "transient.numerical_damping": 0.1,
    }
    one, other = (Runner(valve(changes | {"transient.coupling": c})).start() for c in ("monolithic", "staggered"))
    assert other.history["lip_displacement"][-1] == pytest.approx(one.history["lip_displacement"][-1], rel=1e-3)
    assert (
        np.abs(other.history["lip_displacement"] - one.history["lip_displacement"])[5:50].max() > 1e-7
    )  # not the same path


def test_no_flow_and_steady_law(valve):
    run = Runner(valve({"drive.kind": "uniform", "drive.pressure": 5e3, "transient.duration": 0.01})).start()
    assert np.all(run.history["mass_flow"] == 0) and run.history["lip_displacement"][-1] != 0
    steady = Runner(valve({"fluid.unsteady": False, "transient.duration": 0.01})).start()
    assert steady.history["mass_flow"][-1] > 0


def test_impossible_starts(tmp_path, valve):
    with pytest.raises(SolveError, match="no mode 90"):
        Runner(valve({"transient.start": "kick", "transient.kick_mode": 90, "mesh.around": 4, "mesh.along": 6})).start()
    path = tmp_path / "run.h5"
    transient(valve(SHORT), output=path)
    case = valve().case.replace({"transient.start": "state", "transient.start_file": str(path)})
    other = type(valve())(case.replace({"mesh.around": 4}))
    with pytest.raises(CaseError, match="mesh of 63 nodes and this case's has 45"):
        Runner(other).start()
    longer = type(valve())(case.replace({"valve.scale": 1.2}))
    with pytest.raises(CaseError, match="another valve, whose nodes lie up to 115 mm from those of this case"):
        Runner(longer).start()
    with pytest.raises(CaseError, match="no state 77"):
        Runner(type(valve())(case.replace({"transient.start_state": 77}))).start()


def test_the_python_interface_runs_and_resumes(tmp_path):
    small = dbvfiv.load(thesis_case(), SMALL | {"transient.step": "2 ms"})
    path = tmp_path / "run.h5"
    run = small.transient("10 ms", density=500.0, output=path)
    assert run.case.transient.duration == 0.01 and run.case.fluid.density == 500.0
    longer = dbvfiv.resume(path, duration=0.02)
    assert longer.history["time"][-1] == pytest.approx(0.02)
    assert np.array_equal(longer.history["lip_displacement"][:6], run.history["lip_displacement"])
    states = tmp_path / "steady.h5"
    small.steady([6e3], output=states)
    with pytest.raises(CaseError, match="kind 'steady'"):
        dbvfiv.resume(states, duration=1.0)


def test_pressures_below_vacuum_are_told():
    pressure = np.zeros((100, 5))
    history = {"time": np.linspace(0, 1, 100), "station_pressure": pressure}
    pressure[40:] = -1.0e5
    assert beyond_model(history, -101325.0) is None and beyond_model(history, -8e4) is not None
    pressure[50:60, 2] = -2.5e6
    sentence = beyond_model(history, -101325.0)
    assert "from 0.5051 s" in sentence and "10 %" in sentence and "-2500 kPa" in sentence


def verdict(name, decided=True, ends=(0.0, 1.0)):
    return Verdict(name, decided, f"It is {name}.", smallest=ends[0], largest=ends[1])


def test_a_flow_that_never_was_tells_nothing_of_a_run():
    """Runs without a flow, of a sealed bill or under a uniform load, could never be certain."""
    lip, none = verdict("decaying"), verdict("steady", ends=(0.0, 0.0))
    run = RunVerdict(none, lip, lip, 1e-6, 600, 1.2)
    assert run.name == "decaying" and run.decided and run.governing is lip
    flowing = RunVerdict(verdict("steady"), lip, lip, 1e-6, 600, 1.2)
    assert flowing.name == "decaying" and not flowing.decided


@pytest.mark.slow
def test_a_push_of_a_sealed_bill_is_measured_where_the_wall_moves():
    """The faces hold its lips: 0.1 mm there was 123 mm of the wall, and the pipe around it was blamed."""
    keys = SMALL | {"drive.pressure": "0.03 m", "transient.start": "kick"}
    valve = dbvfiv.load("cases/dbv12-moulded.toml", keys)
    motion = ValveMotion(valve.model)
    inlet = valve.case.drive.pressure
    state, steady, eigenvalue = first_state(motion, valve.case, inlet, Observer())
    moved = np.abs(valve.model.nodal(state.q - steady)[:, :3]).max()
    assert moved == pytest.approx(1e-4, rel=0.05) and eigenvalue.real < 0


def test_a_missing_drive_table_is_named():
    with pytest.raises(CaseError, match=r'transient.drive_table is given as ".*no.csv", which does not exist'):
        dbvfiv.load(thesis_case(), SMALL).transient("10 ms", drive_table="no.csv")
