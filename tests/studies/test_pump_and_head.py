"""Pumps and heads in cases: operating points, modes at them, runs in time, and what is refused."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator
from scipy.optimize import brentq

from dbvfiv.case.parameters import Mu
from dbvfiv.case.quantity import GRAVITY
from dbvfiv.errors import CaseError, SolveError
from dbvfiv.flow.law import FlowMotion
from dbvfiv.flow.terms import pump
from dbvfiv.model import ValveModel
from dbvfiv.model import forms as forms_module
from dbvfiv.model.forms import ValveForms
from dbvfiv.studies.case import thesis_case
from dbvfiv.studies.cycle import start
from dbvfiv.studies.onset import search
from dbvfiv.studies.orbits import Follower
from dbvfiv.studies.stability.walk import StabilityWalk
from tests.small_valves import SMALL, load_small, settings

LINE = {"upstream.length": 20.0, "upstream.diameter": 0.3, "upstream.friction": 0.02}
DAMPED = {"damping.alpha": 0.0, "damping.beta": 1e-3}
ROWS = [[0, 3.0], [0.03, 2.6], [0.06, 1.8], [0.1, 0.3]]
PUMP = {"upstream.pump": ROWS}
STAGGERED = {"transient.coupling": "staggered", "transient.duration": 0.04}


def load(*keys):
    return load_small(LINE, DAMPED, *keys)


@pytest.fixture(scope="module")
def operating():
    (state,) = load(PUMP).steady().states
    assert not load(PUMP).case.meets_pump("levels")  # whose pressures are listed
    return state


@pytest.mark.slow
def test_the_operating_point_is_where_the_curves_cross(operating):
    """Against a hand calculation: flows over pressure without a pump, by a cubic through states around."""
    curve = PchipInterpolator(*np.array(ROWS).T)
    assert operating.hydraulics.supply_head == pytest.approx(float(curve(operating.volume_flow)), rel=1e-9)
    pressures = operating.pressure * np.array([0.9, 0.97, 1.03, 1.1])
    flows = [load().steady(pressure=float(p)).volume_flow for p in pressures]
    flow = np.poly1d(np.polyfit(pressures, flows, 3))
    crossing = brentq(lambda p: p - 1000.0 * GRAVITY * curve(flow(p)), pressures[0], pressures[-1])
    assert operating.pressure == pytest.approx(crossing, rel=1e-6)


def test_a_list_of_pressures_is_what_was_asked_for(operating):
    found = load(PUMP).steady(pressure=["5 kPa", "10 kPa"])
    assert [state.pressure for state in found.states] == [5e3, 1e4]
    assert found.states[0].volume_flow == pytest.approx(load().steady(pressure="5 kPa").volume_flow, rel=1e-9)


def test_the_command_line_gives_the_operating_point(command_line, operating, tmp_path):
    (tmp_path / "pump.csv").write_text("flow [L/s], head [m]\n0, 3\n30, 2.6\n60, 1.8\n100, 0.3\n")
    pump = {"upstream.pump": tmp_path / "pump.csv"}
    out = command_line("steady", *settings(SMALL | LINE | DAMPED | pump)).out
    assert f"{operating.pressure / 1e3:.6g}" in out


@pytest.mark.slow
@pytest.mark.parametrize(
    "waves",
    [{}, pytest.param({"upstream.wave_speed": 1000.0, "mesh.along": 12, "mesh.around": 8}, marks=pytest.mark.slow)],
)
def test_modes_see_the_slope_and_sweeps_keep_the_pressure(waves):
    point = load(waves, PUMP).steady().states[0].pressure
    fixed = load(waves, {"drive.pressure": point, "modes.count": 2}).modes()
    found = load(waves, PUMP, {"sweep.checks": 2}).sweep("beta=0.5 ms:2 ms:3", count=2)
    middle = load(waves, PUMP, {"damping.beta": found.values[1]}).modes(count=2)
    assert middle.modes[0].growth_rate != pytest.approx(fixed.modes[0].growth_rate, rel=1e-3)
    growth = max(b.growth_rate[1] for b in found.branches if np.isfinite(b.growth_rate[1]))
    assert growth == pytest.approx(middle.modes[0].growth_rate, rel=1e-6, abs=1e-8)


def test_derivatives_move_along_the_curve_of_the_pump():
    """Against the operating points of a thicker and a thinner wall."""
    (found,) = load(PUMP).sensitivity(["thickness"]).sensitivities
    sides = [load(PUMP, {"valve.thickness_factor": factor}).modes(count=1) for factor in (0.998, 1.002)]
    flow, rate = np.diff([(side.state.volume_flow, side.modes[0].growth_rate) for side in sides], axis=0)[0] / 0.004
    assert found.performance["flow"] == pytest.approx(flow, rel=1e-3)
    assert found.growth_rate == pytest.approx(rate, rel=1e-3)
    with pytest.raises(CaseError, match="Over the density a pump has no steady state to keep"):
        load(PUMP).sensitivity(["fluid.density"])


def test_a_run_stays_at_the_operating_point_and_comes_back_to_it(operating):
    steady = {"transient.start": "steady", "transient.step": 4e-3}
    run = load(PUMP, steady, {"transient.duration": 0.04}).transient()
    assert np.abs(run.history["mass_flow"] / operating.mass_flow - 1).max() < 1e-9
    low = {"drive.pressure": 0.97 * operating.pressure, "transient.duration": 0.4}
    moved = load(PUMP, low, steady).transient()
    away = moved.history["mass_flow"] / operating.mass_flow - 1
    slowest = load(PUMP).modes(count=1).modes[0]
    assert slowest.frequency == 0 and away[0] < -0.01
    for name, run in (("monolithic", moved), ("staggered", load(PUMP, low, steady, STAGGERED).transient())):
        flow, pressure = run.history["inlet_mass_flow"] / 1000.0, run.history["inlet_pressure"]
        curve = PchipInterpolator(*np.array(ROWS).T)(flow)
        assert pressure == pytest.approx(1000.0 * GRAVITY * curve, rel=1e-9), name
        assert np.ptp(pressure) > 10.0
    assert away[-1] / away[50] == pytest.approx(np.exp(0.2 * slowest.growth_rate), rel=0.02)


def test_a_kick_from_a_state_that_the_pump_does_not_hold_tells_nothing_of_it(operating):
    kick = {"transient.start": "kick", "transient.step": 4e-3, "transient.duration": 0.04}
    off = load(PUMP, kick, {"drive.pressure": 1.3 * operating.pressure}).transient().stability
    assert off.outcome == "undecided" and off.reason.startswith("The pump gives another pressure")
    assert not load(PUMP, kick).transient().stability.reason.startswith("The pump")


def test_cycles_begin_at_the_state_that_spectra_are_of(operating):
    """A static lift makes up the difference to a pressure off the pump's curve."""
    pressure = 1.2 * operating.pressure
    case = load(PUMP, {"drive.pressure": pressure}).case
    walk, place = StabilityWalk(case), Mu.of(case)
    follower = Follower(case, walk, place, "pressure", SimpleNamespace(eigenvalues=()))
    rest = follower.at_rest(SimpleNamespace(place=place, eigenvalue=10j))
    left, scale = follower.system.residual(rest.motion, rest.mu), walk.built(place).model.force_scale
    assert np.linalg.norm(left[0]) < 1e-6 * scale(walk.equilibrium(place), pressure)


def test_normal_forms_have_the_pressure_that_spectra_have(monkeypatch):
    """Off the pump's curve too, of a valve held at rest; their linearisation is about it as well."""
    model, about = ValveModel(load(PUMP, {"drive.pressure": 30e3}).case), []
    linear = SimpleNamespace(pencil=lambda _: None)
    monkeypatch.setattr(forms_module, "linearise", lambda model, *_: about.append(model.flow) or linear)
    q, mu = np.zeros(model.size), Mu.of(model.case).for_system()
    area, forms = model.rows.areas(model.nodal(q)), ValveForms(model, q, mu)
    motion = FlowMotion.still(area, forms.rest[2 * len(q) :])
    pressure, left = forms.model.flow.evaluate(motion, mu)
    assert pressure == pytest.approx(model.flow.steady_pressure(area, 30e3), rel=1e-9, abs=1e-6)
    assert left == pytest.approx([0.0], abs=1e-6) and about == [forms.model.flow]
    assert abs(model.flow.evaluate(motion, mu)[1][0]) > 500.0  # a lift makes up for this


@pytest.mark.parametrize(("parameter", "told"), [("beta", True), ("pressure", False)])
def test_a_normal_form_behind_a_pump_has_no_speed_where_the_lift_would_follow(monkeypatch, parameter, told):
    case, asked = load(PUMP).case, []
    built = SimpleNamespace(model=SimpleNamespace(case=case, flow=SimpleNamespace(names=())))
    walk = SimpleNamespace(built=lambda _: built, equilibrium=lambda _: None, unknowns=lambda *_: None)
    monkeypatch.setattr(search, "ValveForms", lambda *_: None)
    monkeypatch.setattr(search, "hopf_normal_form_of", lambda _forms, _omega, _mode, name: asked.append(name))
    search.normal_form(case, walk, Mu.of(case), SimpleNamespace(eigenvalue=10j), parameter)
    assert asked == [parameter if told else None]


def test_the_last_period_of_a_run_is_behind_the_pump_of_the_run(monkeypatch):
    """At the pressure of the case a pump has its own head; at another one, which a branch may be at, one more."""
    case, asked = load(PUMP, {"drive.pressure": 20e3}).case, []
    state = SimpleNamespace(nodal=np.zeros(2), nodal_rate=np.zeros(2), station_velocity=[1.0])
    now = SimpleNamespace(q=np.zeros(2), fluid=SimpleNamespace(velocity=1.0))
    shell = SimpleNamespace(dofs=SimpleNamespace(restrict=lambda nodal: nodal))
    model = SimpleNamespace(pump=pump.from_case(case), flow=SimpleNamespace(inner=1), shell=shell)
    monkeypatch.setattr(start, "ValveMotion", lambda *_: None)
    monkeypatch.setattr(
        start, "consistent_state", lambda _motion, _time, q, v, inlet, inner: asked.append(inlet) or now
    )
    step = SimpleNamespace(step=lambda *_: SimpleNamespace(state=now))
    monkeypatch.setattr(start, "Stepper", lambda _motion, _scheme, inlet: asked.append(inlet(0.0)) or step)
    run = SimpleNamespace(states=[state], verdict={"verdict": "limit cycle", "mass_flow": {}})
    run.verdict["lip_displacement"] = {"verdict": "limit cycle", "frequency": 10.0}
    start._last_period(model, case, Mu.of(case).at(pressure=15e3), run)
    assert [model.pump.pressure(inlet, 0.03) for inlet in asked] == pytest.approx([1000 * GRAVITY * 2.6] * 2)
    model.pump = None
    start._last_period(model, case, Mu.of(case).at(pressure=15e3), run)
    assert asked[2:] == [15e3, 15e3]


def test_a_flow_beyond_the_table_is_told():
    with pytest.raises(SolveError, match="pump's table goes from 0 to 10 L/s.*no operating point"):
        load({"upstream.pump": [[0, 10.0], [0.01, 9.0]]}).modes(count=2)
    with pytest.raises(SolveError, match="takes .* L/s, and the pump's table goes from"):
        load(PUMP, {"drive.pressure": 80e3}).modes(count=2)
    above = [[row[0] + 0.01, row[1]] for row in ROWS]
    found = load({"upstream.pump": above}, {"transient.duration": 0.01}).transient()
    assert found.failures and "table goes from 10 to" in found.failures[0]


def test_what_has_no_meaning_with_a_pump_is_refused():
    with pytest.raises(CaseError, match="Over the density a pump has no steady state to keep"):
        load(PUMP).sweep("density=100:1000:3")
    point = "another operating point at each value"
    with pytest.raises(CaseError, match=f"Over pipe_length a pump has {point}; set upstream.length for each"):
        load(PUMP).sweep("pipe_length=10:30:3")
    for study in ("onset", "cycle"):
        with pytest.raises(CaseError, match=f"Over thickness a pump has {point}"):
            getattr(load(PUMP), study)("thickness=0.9:1.1:3")
    with pytest.raises(CaseError, match=f"Over strain a pump has {point}"):
        load(PUMP).map("strain=0.2:0.4:3", "beta=0.5 ms:2 ms:3")
    with pytest.raises(CaseError, match=r"transient\.ramp is given beside a pump"):
        load(PUMP, {"transient.ramp": 0.1})
    with pytest.raises(CaseError, match=r"no wave_speed to change"):
        load().sweep("wave_speed=100:1000:3")


def test_a_head_is_another_way_to_give_the_pressure():
    case = thesis_case(["drive.head=3 m", "fluid.density=800"])
    assert case.drive.pressure == pytest.approx(800 * GRAVITY * 3, rel=1e-14) and case.drive.head is None
    assert case.steady_pressures() == (case.drive.pressure,)
    other = case.replace({"drive.head": 2.0})
    assert other.drive.pressure == pytest.approx(800 * GRAVITY * 2, rel=1e-14)
    assert other.steady_pressures() == (other.drive.pressure,)
    assert case.replace({"fluid.density": 1.2}).drive.pressure == case.drive.pressure
    assert type(case).from_dict(case.to_dict()) == case
