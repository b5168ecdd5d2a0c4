"""A valve that stands upright: steady states, modes, motions, and studies over the density, which moves them."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import dbvfiv
from continuation.normal_form import Motion
from continuation.periodic import PeriodicMotion
from dbvfiv.case.parameters import Mu
from dbvfiv.case.quantity import GRAVITY
from dbvfiv.errors import CaseError, SolveError
from dbvfiv.model.classes import linearise_class
from dbvfiv.model.equilibria import find_equilibrium, rest_state
from dbvfiv.model.forms import ValveForms
from dbvfiv.model.symmetry import SYMMETRIES
from dbvfiv.motion.periodic import PeriodicValve
from dbvfiv.studies.case import require_consistent, thesis_case
from dbvfiv.studies.measured import MeasuredTaps
from dbvfiv.studies.onset import search
from dbvfiv.studies.session import Session
from dbvfiv.studies.stability import place
from dbvfiv.studies.stability.place import is_surrounding, models_of, redesigned
from dbvfiv.studies.state import State
from dbvfiv.studies.steady.figures import _PANELS
from tests.model.test_residual_forms import check, difference
from tests.small_valves import SMALL, load_small, make_valve, settings
from tests.studies.along import check_map, check_sensitivity, check_sweep, check_walk

DOWN, UP = {"gravity.direction": "-z"}, {"gravity.direction": "+z"}
WET = {"outside.fluid": "same"}
LEVEL = 1000.0 * GRAVITY * 0.56


def test_the_operator_of_a_state_is_refused_in_a_fluid_whose_weight_moves_it(monkeypatch):
    """As its modes are."""

    def refuse(model, state):
        raise SolveError(f"no equilibrium of the {model}")

    monkeypatch.setattr("dbvfiv.studies.state.require_equilibrium", refuse)
    pencil = SimpleNamespace(pencil=lambda point: dict(point))
    monkeypatch.setattr("dbvfiv.studies.state.linearise", lambda *_: pencil)
    monkeypatch.setattr(Session, "model", "other model")
    monkeypatch.setattr(State, "solution", lambda self: None)
    state, session = object.__new__(State), Session(thesis_case(DOWN))
    results = SimpleNamespace(session=session, model=SimpleNamespace(case=session.case))
    for name, value in {"results": results, "pressure": 6e3, "q": None}.items():
        object.__setattr__(state, name, value)
    assert state.pencil(alpha=0.0)["alpha"] == 0.0
    with pytest.raises(SolveError, match="no equilibrium of the other model"):
        state.pencil(density=500.0)


@pytest.mark.slow
def test_a_valve_that_weighs_nothing_sees_the_level_alone():
    """One rubber as heavy as the fluid on both of its sides: the drive is that over the level."""
    floating = {"layers": [{"material": "CR", "thickness": 0.014}], "fluid.density": 1300.0}
    lying = load_small(floating, WET).steady(pressure=12e3)
    for gravity, sign in ((DOWN, -1.0), (UP, 1.0)):
        state = load_small(floating, WET, gravity).steady(pressure=12e3 + sign * 1.3 * LEVEL)
        assert state.q == pytest.approx(lying.q, rel=1e-7, abs=1e-10)
        assert state.mass_flow == pytest.approx(lying.mass_flow, rel=1e-8)
        assert state.hydraulics.loss_coefficient == pytest.approx(lying.hydraulics.loss_coefficient, rel=1e-7)
        assert state.level_pressure == pytest.approx(sign * 1.3 * LEVEL)


@pytest.mark.parametrize(
    "keys, drive", [({"upstream.length": 10.0, "upstream.loss": 1.0, "drive.at": "line"}, 12e3), ({}, 0.0)]
)
def test_heads_and_jet_of_a_valve_that_discharges_downwards(keys, drive):
    """A hanging column drives a flow alone, too."""
    state = load_small(DOWN, keys).steady(pressure=drive)
    flange, jet = state.station_velocity[-1], state.outlet_velocity
    fall = state.flange_pressure / 1000.0 + 0.5 * flange**2 + GRAVITY * 0.56
    assert 0.5 * jet**2 == pytest.approx(fall, rel=1e-8)
    assert state.hydraulics.total_head == pytest.approx(fall / GRAVITY, rel=1e-8)
    assert state.hydraulics.head_loss == pytest.approx(fall / GRAVITY, rel=1e-8)
    assert state.station_pressure[-1] == pytest.approx(state.flange_pressure, rel=1e-8, abs=1e-8)


def test_a_tap_at_the_flange_has_the_pressure_there_with_water_outside():
    """Still water inside and outside: stations see none over that beside them, taps that over the water at the lips."""
    z, drive = np.linspace(0.0, 0.56, 9), LEVEL + 2e3
    state = SimpleNamespace(pressure=drive, station_pressure=np.zeros(9), outlet_pressure=2e3, mass_flow=1.0)
    result = SimpleNamespace(states=[state], case=thesis_case(UP | WET), mesh=SimpleNamespace(z=z))
    taps = MeasuredTaps.of([[drive] * 2, [z[0], z[-1]], [2e3, drive - 1e3]], result)
    assert taps.excess == pytest.approx([0.0, 1e3], abs=1e-6)
    (_, panel), *_ = _PANELS
    assert panel(state, result)[-1] == pytest.approx(drive / 1e3, rel=1e-12)


def test_forces_balance_and_the_tangent_is_that_of_the_residual():
    for keys in (DOWN, UP | WET):
        model = load_small(keys).model
        q = load_small(keys).steady(pressure=12e3).q
        v = 1e-6 * np.random.default_rng(0).standard_normal(model.size)
        tangent = model.tangent(q, 12e3)
        found = model.residual(q + v, 12e3) - model.residual(q - v, 12e3)
        exact = 2 * model.apply(tangent, v)
        assert found == pytest.approx(exact, abs=1e-5 * np.abs(exact).max())
        own = model.shell.dofs.matrix(tangent.structure)
        assert abs(own - own.T).max() < 1e-14 * abs(own).max()


def test_a_valve_that_hangs_holds_still_water():
    model = load_small(UP).model
    state = rest_state(model)
    assert state.mass_flow == 0.0 and state.pressure == pytest.approx(LEVEL)
    depth = model.mesh.z
    assert state.station_pressure == pytest.approx(1000.0 * GRAVITY * depth, abs=1e-6)


def test_less_than_the_level_does_not_flow():
    with pytest.raises(SolveError, match="nothing flows.*by the level of the lips"):
        find_equilibrium(load_small(UP).model, 5e3)


@pytest.mark.parametrize("kind", [None, "steady", "modes", "onset"])
def test_lips_that_lie_deep_in_water_are_driven_by_the_level_too(kind):
    """1 m of water at the lips, which lie 0.56 m below the inlet."""
    deep = load_small(DOWN, {"downstream.pressure": 9.8e3, "drive.pressure": 6e3, "report.heads": [5e3, 6e3]})
    require_consistent(deep.case, kind)
    with pytest.raises(CaseError, match="4 kPa, which is not above 4.308 kPa, downstream.pressure = 9.8 kPa less the"):
        require_consistent(deep.replace({"drive.pressure": 4e3}).case, kind)


def test_energies_balance():
    keys = SMALL | DOWN | {"transient.start": "rest", "transient.duration": 0.03, "transient.step": 2e-4}
    keys |= {"transient.numerical_damping": 0.0, "drive.pressure": 4e3, "damping.alpha": 0.0}
    history = dbvfiv.load(thesis_case(), keys).transient().history
    turned_over = np.abs(np.diff(history["pressure_work"])).sum()
    assert np.abs(history["weight_energy"]).max() > 1e-3 * turned_over
    off = np.abs(history["balance"]).max()
    assert off < 5e-3 * turned_over and off < 0.2 * np.abs(history["weight_energy"]).max()


@pytest.mark.slow
def test_classes_of_motion_hold_the_weight():
    """The tangent of each class is that of the whole weight, by differences of its force."""
    model = make_valve(DOWN)
    q = load_small(DOWN).steady(pressure=12e3).q
    bare = make_valve()
    for symmetry in SYMMETRIES.values():
        heavy, light = (linearise_class(m, q, 12e3, symmetry).structure for m in (model, bare))
        shell = linearise_class(model, q, 12e3, symmetry).shell if symmetry.name != "SS" else model.shell
        here = np.zeros(shell.size) if symmetry.name != "SS" else q
        v = 1e-4 * np.random.default_rng(1).standard_normal(shell.size)
        change = model.weight.force(shell, here + v) - model.weight.force(shell, here - v)
        assert change == pytest.approx(2 * (heavy - light) @ v, abs=1e-6 * np.abs(change).max())


@pytest.mark.slow
def test_studies_over_the_density_follow_the_steady_state():
    keys = DOWN | {"drive.pressure": "6 kPa", "damping.alpha": 0.0}
    assert not is_surrounding(load_small(keys).case, "density") and is_surrounding(load_small().case, "density")
    swept = check_sweep((keys,), "density=10:400:3:log", "fluid.density", (0, 2))
    assert len(swept.points) == 3
    check_walk((keys,), swept, "fluid.density", (0, 2))
    check_sensitivity((keys,), "density", "fluid.density", 1.0)


def test_each_density_has_a_model_of_its_levels(monkeypatch):
    """Models of periodic motions and normal forms, with the other parameters of the design that are asked for."""
    monkeypatch.setattr(place, "ValveModel", lambda case: SimpleNamespace(case=case, flow=own.flow))
    case, lying = thesis_case(DOWN), thesis_case()
    own = SimpleNamespace(case=case, flow=SimpleNamespace(names=("inlet",)))
    models, mu = models_of(case, own), Mu.of(case).for_system()
    assert models(mu | {"alpha": 2.0}) is own and models_of(lying, own)(mu | {"density": 300.0}) is own
    for asked in ({"density": 300.0}, {"density": 300.0, "thickness": 1.1}, {"thickness": 1.1}):
        assert models(mu | asked).case == redesigned(case, asked) and models(mu | asked) is models(mu | asked)
    there, taken = Mu.of(case).at(density=300.0, thickness=1.1), []
    light = SimpleNamespace(case=redesigned(case, {"density": 300.0}), flow=own.flow)
    monkeypatch.setattr(search, "ValveForms", lambda model, *_: taken.append(model.case))
    monkeypatch.setattr(search, "hopf_normal_form_of", lambda *_: None)
    built = SimpleNamespace(model=light)
    walk = SimpleNamespace(built=lambda _: built, equilibrium=lambda _: None, unknowns=lambda *_: None)
    search.normal_form(case, walk, there, SimpleNamespace(eigenvalue=30j))
    assert taken == [redesigned(case, there.only("density", "thickness"))]


@pytest.mark.slow
def test_a_steady_state_of_another_density_is_a_periodic_motion():
    model, light = load_small(DOWN).model, load_small(DOWN, {"fluid.density": 300.0})
    mu = Mu.of(light.case).for_system()
    q = light.steady(pressure=mu["inlet"]).q
    rest = np.concatenate([q, light.model.flow.steady_inner(light.model.rows.areas(light.model.nodal(q)), mu)])
    system = PeriodicValve(models_of(model.case, model), mu)
    missing = system.residual(PeriodicMotion.of_waves((rest, np.zeros_like(rest)), 1, 30.0), mu)
    assert np.abs(missing).max() < 1e-6 * model.force_scale(q, mu["inlet"])


LOSSES = {"damping.model": "loss factor", "materials.constants": "stable"}


@pytest.mark.slow
@pytest.mark.parametrize("keys", [DOWN, DOWN | LOSSES], ids=["beta", "loss factors"])
def test_normal_forms_hold_the_weight(keys):
    """Those of a wall that relaxes are those of one that does not where nothing relaxes."""
    model = load_small(keys, {"damping.beta": 1e-3} if "damping.model" not in keys else {}).model
    q = load_small(keys).steady(pressure=6e3).q
    mu = {"inlet": 6e3, "density": 1000.0, "storage": 1.0, "alpha": 1.0, "beta": 1e-3, "loss_factor": 0.0}
    forms, random = ValveForms(model, q, mu), np.random.default_rng(2)
    a, b = (Motion(s, random.normal(size=model.size + 1) * 1e-3) for s in (3.0, -2.0))
    check(forms, forms.second(a, b).real, difference(forms, [a, b], mu), 1e-3)


@pytest.mark.slow
def test_a_map_over_the_density():
    axes = {"map.x": "pressure=3 kPa:6 kPa:2:log", "map.y": "density=10:1000:3:log"}
    check_map((DOWN, {"damping.alpha": 0.0}), axes, {(0, 0): {"fluid.density": 10.0, "drive.pressure": 3e3}})


@pytest.mark.slow
def test_back_pressure_says_that_nothing_weighs(command_line):
    out = command_line("closure", *settings(SMALL | DOWN | {"closure.pressures": "[100]"}))
    assert out.status == 0 and "Gravity has no part" in out.out + out.err
