"""Equilibria over pressures: what is reached, and what is said when it is not."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from dbvfiv import resume
from dbvfiv.case.load import make_case, parse_toml
from dbvfiv.errors import CaseError, SolveError
from dbvfiv.model import ValveModel
from dbvfiv.model.equilibria import LoadPath, SteadyOptions, model_warnings
from dbvfiv.model.load_curve import LimitPoint
from dbvfiv.model.newton import NewtonOptions
from dbvfiv.model.state import LipCentre, describe_state
from dbvfiv.studies.case import Case, load_case, thesis_case
from dbvfiv.studies.comparing import Compared, Comparison
from dbvfiv.studies.session import Session
from dbvfiv.studies.stability.place import redesigned
from dbvfiv.studies.steady import study
from dbvfiv.studies.steady.study import PARTED, _met, parted_width
from tests.small_valves import SMALL


@pytest.fixture(scope="module")
def model():
    return ValveModel(thesis_case(SMALL))


@pytest.mark.parametrize("pressure", [50.0, 400.0, 2e3, 18e3, 60e3])
def test_any_pressure_from_rest_in_one_go(model, pressure):
    state = LoadPath(model).go_to(pressure)
    assert state.converged and state.residual < 1e-7
    residual = model.residual(state.q, pressure)
    assert np.linalg.norm(residual) < 1e-7 * model.force_scale(state.q, pressure)
    assert state.outlet_area > 0 and state.mass_flow > 0


def test_the_way_does_not_matter(model):
    at_once = LoadPath(model).go_to(20e3)
    walk = LoadPath(model)
    for pressure in (1e3, 60e3, 5e3, 20e3):
        state = walk.go_to(pressure)
    assert np.abs(state.q - at_once.q).max() < 1e-7


@pytest.mark.parametrize("thickness", [0.9424, 0.94238, 0.9436])
def test_the_state_of_a_rising_load_among_several(thickness):
    """At 2 m this valve has an equilibrium that opens by a third more, and one between that diverges: Newton's method
    strays to all three from rest, by the fifth digit of the thickness.
    """
    case = load_case("cases/dbv6.toml", ["mesh.around=14", "mesh.along=24"])
    for name, value in {"thickness": thickness, "angle": 30.0, "valve.saddle_length": 0.112}.items():
        case = redesigned(case, {name: value})
    model = ValveModel(case)
    at_once, in_steps = (LoadPath(model, SteadyOptions.of(case)) for _ in range(2))
    found = at_once.go_to(19613.3)
    for share in (0.125, 0.25, 0.5, 0.75, 1.0):
        last = in_steps.go_to(share * 19613.3)
    assert found.outlet_area == pytest.approx(last.outlet_area, rel=1e-6)
    assert found.outlet_area == pytest.approx(17.28e-4, rel=2e-3)


def test_flow_is_that_of_bernoulli_at_the_outlet(model):
    """Outlet velocity from the inlet pressure and the areas; mass flow from either end."""
    state = LoadPath(model).go_to(18e3)
    density = model.case.fluid.density
    a, b = state.station_area[0], state.station_area[-1]
    velocity = np.sqrt(2 * 18e3 / density / (1 - (a / b) ** 2))
    assert state.outlet_velocity == pytest.approx(velocity, rel=1e-6)
    assert state.mass_flow == pytest.approx(4 * density * a * velocity, rel=1e-6)
    assert state.station_pressure[0] == pytest.approx(0.0, abs=1e-9) and state.station_pressure[-1] == pytest.approx(
        18e3
    )
    assert state.lip_displacement > 0.01
    assert state.head == pytest.approx(18e3 / (9.80665 * density), rel=1e-14)
    assert state.volume_flow == pytest.approx(state.mass_flow / density, rel=1e-14)


def test_lip_opening_is_the_distance_between_the_faces(model):
    """About 48 mm at 18 kPa where the displacement of one lip, 24 mm, was called the opening before.

    At rest 2 (6.19 - 6) mm are left between the faces; a state adds twice the displacement and what the turn of the
    director gives back of the half wall.
    """
    centre = LipCentre(model.mesh, model.shell)
    assert centre.half_wall == pytest.approx(0.006)
    assert centre.opening(model.rest()) == pytest.approx(0.38e-3, rel=1e-9) and centre.displacement(model.rest()) == 0
    state = LoadPath(model).go_to(18e3)
    nodal = model.nodal(state.q)
    node = model.mesh.rows[0, 0]
    assert state.lip_displacement == nodal[node, 1]
    director = model.shell.directors(nodal)[0][node]
    face = model.mesh.nodes[node] + nodal[node, :3] - 0.006 * director
    assert state.lip_opening == pytest.approx(2 * face[1], rel=1e-12)
    assert state.lip_opening > 2 * state.lip_displacement + 0.38e-3
    crossed = np.zeros_like(nodal)
    crossed[node, 1] = -0.001
    assert centre.opening(model.shell.dofs.restrict(crossed)) == 0.0


def test_lip_opening_knows_the_wall(model):
    thin = ValveModel(model.case.replace({"valve.thickness_factor": 0.5}))
    assert LipCentre(thin.mesh, thin.shell).opening(thin.rest()) == pytest.approx(2 * (0.00619 - 0.003), rel=1e-9)
    thick = ValveModel(model.case.replace({"valve.thickness_factor": 1.3}))  # the faces cross as drawn
    lifted = np.zeros((len(thick.mesh.nodes), 5))
    lifted[thick.mesh.centre_line[0], 1] = 0.002
    centre = LipCentre(thick.mesh, thick.shell)
    assert centre.opening(thick.rest()) == 0.0
    assert centre.opening(thick.shell.dofs.restrict(lifted)) == pytest.approx(0.004, rel=1e-9)


def test_heads_of_the_fluid():
    """Metres of the fluid, whatever the order of keys, and metres of water."""
    for text in ("[fluid]\ndensity = 800\n[drive]\npressure = '2 m'", "drive.pressure = '2 m'\nfluid.density = 800"):
        assert make_case(Case, parse_toml(text)).drive.pressure == pytest.approx(2 * 800 * 9.80665, rel=1e-14)
    assert thesis_case({"drive.pressure": "2 m"}).drive.pressure == pytest.approx(19613.3, rel=1e-14)
    for text in ("2 mH2O", "200 cmH2O", "2000mmH2O"):
        case = thesis_case({"drive.pressure": text, "fluid.density": 10, "steady.pressures": [text]})
        assert case.drive.pressure == case.steady.pressures[0] == pytest.approx(19613.3, rel=1e-12)
    changed = thesis_case({"fluid.density": 10}).replace({"closure.pressures": ["3 m"]})
    assert changed.closure.pressures == pytest.approx((3 * 10 * 9.80665,), rel=1e-14)
    for key, given in (("drive.pressure", "2 mm"), ("sweep.over", "density=1 m:2 m:3"), ("fluid.density", "2 m")):
        with pytest.raises(CaseError):
            thesis_case({key: given})
    with pytest.raises(CaseError, match="modulus|pressure"):
        thesis_case({"materials.rubber": {"kind": "neo-hookean", "shear_modulus": "2 m", "density": 1000}})


def test_run_keeps_the_order_asked_for(model):
    pressures = [5e3, 20e3, 2e3]
    found = Session(model.case.replace({"steady.pressures": pressures})).perform("steady")
    assert [state.pressure for state in found.states] == pressures
    assert np.argsort([state.mass_flow for state in found.states]).tolist() == [2, 0, 1]


def test_folded_wall_is_told():
    """Half the wall (7.5 mm) exceeds the radius (6.2 mm) at the side edge just behind the duckbill."""
    fine = ValveModel(thesis_case({"mesh.around": 28, "mesh.along": 24}))
    (sentence,) = model_warnings(fine)
    assert "Half the wall exceeds the radius" in sentence and "z 0.21" in sentence
    thin = ValveModel(thesis_case({"mesh.around": 28, "mesh.along": 24, "valve.thickness_factor": 0.5}))
    assert not list(model_warnings(thin))


RANGES = {
    "sweep": {"sweep.over": "pressure=6e3:36e3:2", "sweep.count": 2},
    "onset": {"onset.over": "density=900:1000:2", "onset.coarse_mesh": 0, "onset.normal_form": False},
    "map": {"map.x": "pressure=6e3:36e3:2", "map.y": "density=900:1000:2", "map.checks": 0, "map.curve": False},
    "uncertainty": {"uncertainty.samples": 16, "uncertainty.inputs": {"density": "normal(1 %)"}},
}


@pytest.mark.parametrize("kind", RANGES)
def test_studies_over_parameters_judge_wall_and_rubber(kind):
    """Their verdicts rest on Rayleigh damping, and hold for the fit of the rubber and not for the rubber."""
    keys = {"materials.constants": "published", "drive.pressure": 36e3} | RANGES[kind]
    said = Session(thesis_case(SMALL | keys)).perform(kind).warnings
    for words in ("Half the wall exceeds the radius", "The rubber's constants are unstable here: at 36000 Pa"):
        assert sum(words in sentence for sentence in said) == 1


def one_iteration(model) -> SteadyOptions:
    """Options no valve can meet: one iteration, and load steps no smaller than a third."""
    return SteadyOptions(NewtonOptions(tolerance=1e-12, max_iterations=1), min_step=0.3)


def test_failure_is_one_sentence(model, refused):
    path = LoadPath(model, one_iteration(model))
    with refused(SolveError, match="18000 Pa") as caught:
        path.go_to(18e3)
    assert "iterations ran out" in str(caught.value)
    assert path.pressure == 0.0 and np.all(path.q == 0.0)


def test_uniform_pressure():
    model = ValveModel(thesis_case(SMALL | {"drive.kind": "uniform"}))
    state = LoadPath(model).go_to(2e3)
    assert state.converged and state.mass_flow == 0.0 and state.lip_displacement > 0


def test_a_state_without_a_finite_flow_is_an_error():
    """Lips pulled open beyond the flange: a flow of inf is none."""
    model = ValveModel(thesis_case({"mesh.around": 6, "mesh.along": 8}))
    open_wide = 40.0 * LoadPath(model).go_to(6e3).q
    with pytest.raises(SolveError, match="no finite steady flow"):
        describe_state(model, open_wide, 6e3)


def test_a_load_meets_limit_points_beyond_those_before():
    """Limit points of lips bowed apart by 40 mm, of 5 mm SBR on 14 x 24 elements, pressed shut from outside."""
    pressures = 1018.0, 984.0, 995.0, 886.0, 957.0, 831.0, 949.0, 871.0, 1073.0, 985.0
    limits = [LimitPoint(pressure, highest=i % 2 == 0) for i, pressure in enumerate(pressures)]
    assert _met(limits, rising=True) == [1018.0, 1073.0]
    assert _met(limits, rising=False) == [985.0, 871.0, 831.0]


def test_runs_are_compared_with_a_first_one_that_is_sealed():
    quantity = Compared("flow", share=True, unit="m3/s")
    values = {"flow": np.array([[0.0, 2.0], [1.0, 3.0]])}
    with np.errstate(all="raise"):
        runs = (SimpleNamespace(case=Case()),)
        found = Comparison(runs, ["sealed", "open"], (quantity,), None, np.array([1e3, 2e3]), values)
        assert found.lines()[-2].split() == ["1", "0", "1", "-"] and found.lines()[-1].split()[-1] == "+50.000"


def test_what_a_curve_holds_is_kept_once(tmp_path, monkeypatch):
    """An interrupt while widths that have parted are kept: who goes on tells each once."""
    keys = {"mesh.around": 6, "mesh.along": 8, "valve.sealing_pressure": 300.0, "materials.strain_level": 0.1}
    case = load_case("cases/dbv4-moulded.toml").replace(keys | {"steady.pressures": [600.0, 900.0]})
    whole = Session(case).perform("steady").record.notes(PARTED)

    def stopped(model, q, calls=iter(range(9))):
        if next(calls):
            raise KeyboardInterrupt
        return parted_width(model, q)

    monkeypatch.setattr(study, "parted_width", stopped)
    assert not Session(case).perform("steady", tmp_path / "part.h5").complete
    monkeypatch.undo()
    assert resume(tmp_path / "part.h5").record.latest(PARTED) == whole and len(whole) == 2
