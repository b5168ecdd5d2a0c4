"""Stability of a coarse valve with loss factors: columns, maps, onsets and what they rest on against full pencils."""

import numpy as np
import pytest

from dbvfiv import resume
from dbvfiv.api import Valve
from dbvfiv.case.parameters import Mu
from dbvfiv.studies.case import Case, thesis_case
from dbvfiv.studies.onset.search import run_onset
from dbvfiv.studies.session import load_result
from dbvfiv.studies.stability.line import ParameterLine
from dbvfiv.studies.stability.walk import StabilityWalk
from eigen import certified_spectrum
from tests.observers import Stop
from tests.small_valves import FORMER, SMALL
from tests.studies.map.axes import run_map

LAWS = pytest.mark.parametrize("continuity", [pytest.param("quasi-steady", marks=pytest.mark.slow), "storage"])


@pytest.fixture(scope="module")
def lossy_case():
    """On the mesh that its densities and loss factors were chosen on."""
    return thesis_case(
        [
            "mesh.around=8",
            "mesh.along=14",
            *(f"{key}={value}" for key, value in FORMER.items()),
            "damping.model='loss factor'",
            "materials.constants='stable'",
            "fluid.density=20",
            "drive.pressure=6000",
            "map.workers=1",
            "map.refine=0",
            "map.curve=false",
            "map.checks=4",
        ]
    )


@pytest.fixture(scope="module")
def lossy_walk(lossy_case):
    return StabilityWalk(lossy_case)


@pytest.mark.slow
@pytest.mark.parametrize(
    "parameter, values, storage",
    [
        ("density", (1.0, 1000.0), 0.0),
        ("loss_factor", (0.25, 3.0), 1.0),
        pytest.param("density", (1.0, 1000.0), 1.0, marks=pytest.mark.slow),
        pytest.param("loss_factor", (0.25, 3.0), 0.0, marks=pytest.mark.slow),
    ],
)
def test_cells_agree_with_the_full_pencil(lossy_case, lossy_walk, parameter, values, storage):
    base = Mu.of(lossy_case).at(storage=storage)
    places = [base.at(**{parameter: value}) for value in np.geomspace(*values, 9)]
    column = lossy_walk.column(places)
    assert column.certified.all() and (column.how == 0).sum() > 6
    for i in range(0, 9, 2):
        full = lossy_walk.spectrum(places[i])
        found = column.leading[i]
        assert abs(found - full.eigenvalues[0]) < 1e-6 * abs(full.eigenvalues[0])
        assert column.unstable[i] == column.cells[i].certificate.counted == full.unstable_count


@pytest.mark.slow
def test_cells_of_dense_fluids_over_the_loss_factor_need_no_full_pencil(lossy_case, lossy_walk):
    """Vectors corrected once left 1e-5 of the leading eigenvalue there, and every cell to the full pencil."""
    base = Mu.of(lossy_case).at(storage=0.0, density=1000.0)
    places = [base.at(loss_factor=value) for value in np.geomspace(0.25, 1.5, 12)]
    column = lossy_walk.column(places)
    assert column.certified.all() and (column.how == 0).all() and column.error < 1e-6
    for i in (0, 5, 11):
        full = lossy_walk.spectrum(places[i]).eigenvalues[:2]
        assert np.abs(column.cells[i].leading[:2] - full) == pytest.approx(0.0, abs=1e-6 * np.abs(full).min())


def test_an_elastic_wall_is_one_without_loss_factors(lossy_case, lossy_walk):
    """At a factor of zero on them, beside cells that relax."""
    base = Mu.of(lossy_case)
    elastic = lossy_walk.spectrum(base.at(loss_factor=0.0)).eigenvalues[0]
    barely = lossy_walk.spectrum(base.at(loss_factor=1e-4)).eigenvalues[0]
    assert barely == pytest.approx(elastic, rel=1e-3)


@pytest.mark.slow
@LAWS
@pytest.mark.parametrize(
    "second", ["density=1:1000:4:log", pytest.param("loss_factor=0.3:3:4:log", marks=pytest.mark.slow)]
)
def test_maps_against_certified_spectra(lossy_case, lossy_walk, continuity, second):
    case = lossy_case.replace({"fluid.continuity": continuity, "map.x": "pressure=2000:20000:2", "map.y": second})
    result = run_map(case)
    assert result.grid("certified").all()
    assert len(result.checks) == 4 and all(check["agrees"] for check in result.checks)
    growth, unstable = result.grid("growth_rate")[0], result.grid("unstable")[0]
    for i, j in ((0, 0), (1, 3)):
        place = result.plan.place(result.plan.x.values[i], result.plan.y.values[j], result.plan.laws[0])
        family = lossy_walk.family(place)
        found = certified_spectrum(family.at(place), 6, family.search(place))
        assert found.unstable_count == found.unstable_count_independent == unstable[j, i]
        assert growth[j, i] == pytest.approx(
            found.spectrum.growth_rate[0], abs=1e-6 * abs(found.spectrum.eigenvalues[0])
        )


@pytest.mark.slow
def test_a_map_over_loss_factors_resumes_to_the_same_numbers(lossy_case, tmp_path):
    case = lossy_case.replace({"map.x": "pressure=2000:4000:3", "map.y": "loss_factor=0.3:3:4:log"})
    whole, path = Valve(case, "valve").map(), tmp_path / "map.h5"
    assert np.isfinite(whole.grid("growth_rate")).all()
    first, second = Stop(2), Stop()
    assert not Valve(case, "valve").map(output=path, observer=first).complete
    result = resume(path, observer=second)
    assert result.complete and not set(first.seen) & set(second.seen)
    again = load_result(path)
    for name in ("growth_rate", "frequency", "unstable", "counted"):
        for other in (result, again):
            assert np.array_equal(other.grid(name), whole.grid(name))


def test_loss_factors_beyond_the_branches_of_a_rubber_cost_their_own_cells_alone():
    """Rubbers of tan delta 1, 4 branches of which reach up to 2.1 or so."""
    keys = {f"materials.{name}.loss_factor": 1.0 for name in ("CR", "SBR", "EPDM")}
    keys |= {"materials.strain_level": 0.1, "fluid.density": 10.0, "drive.pressure": 2e3}
    case = Case().replace(SMALL | keys)
    line = ParameterLine(StabilityWalk(case), Mu.of(case), "loss_factor", (0.5, 1.0, 3.0))
    sound, own, beyond = line.cells()
    assert sound.certified and own.certified and not (sound.is_missing or own.is_missing)
    assert beyond.verdict.outcome == "not valid" and "damping.loss_factor must be lower" in beyond.verdict.reason
    assert len(line.scan.run(line.values)) == 0 and list(line.scan.failures) == [3.0]


@pytest.mark.slow
@LAWS
def test_onset_over_the_loss_factor_is_between_growth_and_decay(lossy_case, lossy_walk, continuity):
    density = 300.0 if continuity == "quasi-steady" else 20.0
    case = lossy_case.replace(
        {
            "fluid.continuity": continuity,
            "fluid.density": density,
            "onset.over": "loss_factor=1:4:3:log",
            "onset.coarse_mesh": 0,
            "onset.normal_form": False,
        }
    )
    result = run_onset(case)
    (point,) = (p for p in result.points if p.edge)
    assert point.confirmed and not point.gains and abs(point.growth_rate) < 1e-6

    def growth(value):
        return lossy_walk.spectrum(Mu.of(case).at(loss_factor=value)).growth_rate[0]

    assert growth((1 - 8e-5) * point.value) > 0 > growth((1 + 8e-5) * point.value)


@pytest.mark.slow
def test_the_normal_form_of_an_onset_over_the_loss_factor(lossy_case):
    case = lossy_case.replace(
        {"onset.over": "loss_factor=1:4:3:log", "onset.coarse_mesh": 0, "fluid.continuity": "storage"}
    )
    (point,) = (p for p in run_onset(case).points if p.edge)
    assert point.criticality in ("super", "sub")
    assert (point.first_lyapunov_coefficient < 0) == (point.criticality == "super")
    across = (point.above.eigenvalue.real - point.below.eigenvalue.real) / (point.above.value - point.below.value)
    assert point.crossing_speed == pytest.approx(across, rel=1e-2)
