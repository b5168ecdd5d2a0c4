"""Onsets of the valve on a coarse mesh."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from dbvfiv.api import Valve
from dbvfiv.case.parameters import Mu
from dbvfiv.errors import CaseError, SolveError
from dbvfiv.studies import session
from dbvfiv.studies.case import Case, thesis_case
from dbvfiv.studies.onset import search
from dbvfiv.studies.onset.search import run_onset
from dbvfiv.studies.session import Session
from dbvfiv.studies.stability.walk import StabilityWalk
from eigen import SearchOptions, leading_modes
from tests.small_valves import FORMER
from tests.studies.map.axes import run_map


@pytest.fixture(scope="module")
def coarse_case(coarse_case):
    """On the mesh that these densities and bands were chosen on."""
    return coarse_case.replace(FORMER)


def asked(case, over, **keys):
    """A case whose onsets over a range are located, and nothing more."""
    more = {f"onset.{name}": value for name, value in keys.items()}
    return case.replace({"onset.over": over, "onset.normal_form": False, "onset.coarse_mesh": 0} | more)


@pytest.fixture(scope="module")
def over_density(coarse_case):
    return run_onset(asked(coarse_case, "density=1:1000:21:log"))


def test_the_onset_is_neutral_and_confirmed_on_both_sides(over_density):
    (point,) = over_density.points
    assert abs(point.growth_rate) < 1e-6
    assert point.confirmed and point.edge and not point.gains
    assert point.below.eigenvalue.real > 0 > point.above.eigenvalue.real
    sides = point.below, point.above
    assert [side.unstable_count for side in sides] == [2, 0] == [side.unstable_count_independent for side in sides]


@pytest.mark.slow
def test_onset_over_pressure_meets_onset_over_density(over_density, coarse_case):
    (point,) = over_density.points
    case = coarse_case.replace({"fluid.density": point.value})
    (other,) = run_onset(asked(case, "pressure=5500,6200,7000")).points
    assert other.value == pytest.approx(6000.0, rel=1e-6)
    assert other.frequency == pytest.approx(point.frequency, rel=1e-6)
    behind = case.replace({"downstream.pressure": 4e6})  # 0.2 % of which is more than the valve's own
    found = run_onset(asked(behind, "pressure=4005500,4007000"))
    (same,) = found.points
    assert same.confirmed and not found.failures and same.value - 4e6 == pytest.approx(6000.0, rel=1e-4)


def test_unstable_intervals(over_density):
    (interval,) = over_density.unstable_intervals
    assert interval == (pytest.approx(1.0), pytest.approx(over_density.points[0].value))


def test_no_flow_no_onset(coarse_case):
    with pytest.raises(SolveError, match="flow"):
        Session(coarse_case.replace({"drive.kind": "uniform"})).perform("onset")


@pytest.mark.parametrize("over", ["alpha=0,40,120", "beta=0.002,0.004,0.008", "storage=0,0.5,1"])
def test_onset_over_other_parameters(coarse_case, over):
    result = run_onset(asked(coarse_case.replace({"fluid.density": 20}), over))
    (point,) = result.points
    assert point.confirmed and point.edge and not point.gains
    assert result.growth_rates[0, 0] > 0 > result.growth_rates[-1, 0]


def test_onset_over_wall_thickness(coarse_case):
    result = run_onset(asked(coarse_case, "thickness=0.8,0.9,1.1", tolerance=1e-5))
    assert len(result.values) >= 3 and not result.failures
    (point,) = result.points
    assert point.confirmed and point.edge and point.gains and 0.8 < point.value < 0.9


@pytest.mark.slow
def test_criticality_and_uncertainty(coarse_case):
    case = coarse_case.replace({"mesh.around": 12, "mesh.along": 24})
    (point,) = run_onset(asked(case, "density=1:1000:21:log", normal_form=True, coarse_mesh=0.5)).points
    assert point.criticality == "super" and point.first_lyapunov_coefficient < 0
    width = point.above.value - point.below.value
    speed = (point.above.eigenvalue.real - point.below.eigenvalue.real) / width
    assert point.crossing_speed == pytest.approx(speed, rel=1e-3)
    assert point.uncertainty == pytest.approx(abs(point.value - point.coarse_value) / 3, rel=0.05)


@pytest.mark.parametrize(
    "mesh, coarse, ratio", [((28, 48), (14, 24), 2.0), ((8, 16), (6, 8), (8 / 3) ** 0.5), ((4, 48), (4, 24), 1.0)]
)
def test_a_second_mesh_is_coarser_both_ways_or_says_nothing(mesh, coarse, ratio):
    case, found = search.coarse_case(Case().replace({"mesh.around": mesh[0], "mesh.along": mesh[1]}), 0.5)
    assert (case.mesh.around, case.mesh.along) == coarse and found == pytest.approx(ratio)


def test_a_parameter_point_is_changed(coarse_case):
    place = Mu.of(coarse_case).at(density=3.0, thickness=0.9)
    assert (place.density, place.alpha, place.beta, place.storage) == (3.0, 0.0, 0.003, 0.0)
    assert place.design == {"thickness": 0.9}
    assert place.for_system()["inlet"] == 6000.0 and place.for_system()["thickness"] == 0.9


def _undamped(coarse_case, **more):
    return coarse_case.replace({"damping.alpha": 0, "damping.beta": 0, "drive.pressure": 14e3, **more})


def test_without_damping_growth_above_80_hz_is_no_stable_valve(coarse_case):
    # all that grows there does so above 100 Hz
    case = _undamped(coarse_case, **{"fluid.continuity": "storage"})
    result = run_onset(asked(case, "density=900,1000,1100:log"))
    assert (result.growth_rates[:, 0] > 0.5).all() and (result.frequencies[:, 0] > 100.0).all()
    assert not result.stable_intervals and result.unstable_intervals
    assert any("hold for modes up to" in sentence for sentence in result.warnings)


def test_a_band_that_is_asked_for_is_kept(coarse_case):
    case = _undamped(coarse_case, **{"modes.max_frequency": 60.0})
    result = run_onset(asked(case, "density=100,200,400:log"))
    assert np.nanmax(result.frequencies) <= 60.0


@pytest.mark.slow
def test_each_onset_over_alpha_is_listed_once_and_shown_by_its_sides(coarse_case):
    case = coarse_case.replace({"damping.beta": 0, "fluid.density": 4, "mesh.along": 14})
    points = run_onset(asked(case, "alpha=0:100:6")).points
    assert len({round(p.value, 6) for p in points}) == len(points) >= 2
    for p in points:
        assert p.below.eigenvalue.real > 0 > p.above.eigenvalue.real and p.confirmed


#: Valve with so little damping that modes of 30 and of 140 Hz are as near to flutter.
LIGHT = {"mesh.around": 5, "mesh.along": 6, "damping.alpha": 0.0}


@pytest.mark.parametrize(
    "beta, density, pressure", [(2e-5, 262.0, 5.43e3), pytest.param(5.6e-6, 295.0, 3.2e3, marks=pytest.mark.slow)]
)
def test_short_lists_of_a_lightly_damped_valve_hold_the_leading_modes(beta, density, pressure):
    """Modes of all up to the frequency that verdicts hold to; one search near the lowest ones missed up to five."""
    case = thesis_case(LIGHT | {"damping.beta": beta, "fluid.density": density, "drive.pressure": pressure})
    walk, place = StabilityWalk(case), Mu.of(case)
    pencil, asked = walk.family(place).at(place), walk.search(place)
    every = leading_modes(pencil, 80, SearchOptions(method="dense")).eigenvalues
    for count in (3, 10):
        found = leading_modes(pencil, count, replace(asked.options, method="krylov"))
        assert found.status == "complete" and len(found) == count
        ahead = every[(every.real > found.growth_rate.min() + 1e-6) & (every.imag < 2 * np.pi * asked.claimed)]
        assert all(np.abs(found.eigenvalues - value).min() < 1e-6 * abs(value) for value in ahead)


@pytest.mark.parametrize(
    "over, values",
    [
        ("density=17:20:2", [18.2696]),
        pytest.param("density=1:300:12:log", [18.2696, 154.463, 233.202], marks=pytest.mark.slow),
    ],
)
def test_each_onset_of_a_lightly_damped_valve_is_found_once(over, values):
    """The first was lost as a jump, the last found twice, as above the band a list may lack a mode that crosses too."""
    case = thesis_case(LIGHT | {"mesh.around": 6, "mesh.along": 8, "damping.beta": 2e-5, "drive.pressure": 6e3})
    found = run_onset(asked(case, over))
    assert [point.value for point in found.points] == pytest.approx(values, rel=1e-5)
    assert all(point.confirmed for point in found.points) and not found.failures


def test_nothing_is_claimed_beside_a_value_without_a_certificate(coarse_case, monkeypatch):
    honest = StabilityWalk.sample

    def doubtful(self, place, cell, value):
        sample = honest(self, place, cell, value)
        return replace(sample, certain=sample.certain and abs(value - 100.0) > 1e-6)

    monkeypatch.setattr(StabilityWalk, "sample", doubtful)
    result = run_onset(asked(coarse_case, "density=1,10,100,1000:log"))
    assert not result.points
    assert result.certified.tolist() == [abs(v - 100.0) > 1e-6 for v in result.values]
    assert all(high <= 10.0 + 1e-9 for _, high in result.unstable_intervals) and not result.stable_intervals
    assert any("nothing is claimed" in sentence for sentence in result.warnings)


@pytest.mark.parametrize(
    "parameter, words", [("strain", "no layer is one of the built-in rubbers"), ("angle", "ply|angle")]
)
def test_what_a_case_does_not_have_is_no_parameter(parameter, words, refused):
    """Before, every state of such a scan was the same."""
    own = {"kind": "neo-hookean", "shear_modulus": "1 MPa", "density": 1200}
    case = thesis_case({"materials.own": own, "layers": [{"material": "own", "thickness": 0.01}]})
    for ask in (
        lambda: Session(case.replace({"onset.over": parameter})).perform("onset"),
        lambda: run_map(case.replace({"map.x": USUAL[parameter], "map.y": "density=1:10:2"})),
    ):
        with refused(CaseError, match=words):
            ask()


@pytest.mark.parametrize(
    "kind, keys",
    [
        ("sweep", {"sweep.over": "tail_length=1:3:3"}),
        ("onset", {"onset.over": "tail_length=1:3:3"}),
        ("map", {"map.x": "tail_length=1:3:3"}),
        ("cycle", {"cycle.over": "tail_length=1:3:3"}),
        ("response", {"response.over": "tail_length=1:3:3"}),
        ("uncertainty", {"uncertainty.over": "tail_length=1:3:3"}),
        ("identify", {"identify.over": "tail_length=1:3:3"}),
        ("design", {"drive.kind": "uniform"}),
        ("onset", {"onset.over": "storage", "fluid.sound_speed": 343}),
        ("modes", {"modes.continuity": "both", "modes.symmetry": "all"}),
        ("map", {"map.continuity": "both", "fluid.unsteady": False}),
        ("response", {"fluid.unsteady": False}),
    ],
)
def test_refusal_precedes_the_search_for_levels(kind, keys, monkeypatch):
    monkeypatch.setattr(session, "settle_levels", None)
    assert Case().seeks_levels
    said = "no tail_length to|Without flow|differ in|no flow model to|at work|inertia"
    case = Case().replace(keys)
    for ask in (partial(Session(case).perform, kind), getattr(Valve(case), kind)):
        with pytest.raises((CaseError, SolveError), match=said):
            ask()


USUAL = {"strain": "strain=0.1:0.6:3", "angle": "angle=20:80:3"}
