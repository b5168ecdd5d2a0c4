"""Sweeps, columns, onsets and derivatives of a valve with fluid outside."""

from __future__ import annotations

import numpy as np
import pytest

import dbvfiv
from dbvfiv.case.parameters import Mu
from dbvfiv.model import ValveModel, linearise
from dbvfiv.model.equilibria import find_equilibrium
from dbvfiv.studies.case import thesis_case
from dbvfiv.studies.stability.derivatives import Neighbourhood
from dbvfiv.studies.stability.walk import StabilityWalk
from eigen import SearchOptions, leading_modes

MESH = {"mesh.around": 8, "mesh.along": 14, "damping.alpha": 0.0, "damping.beta": 0.00116}


def walk_of(**keys):
    case = thesis_case(MESH | keys)
    return case, StabilityWalk(case)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("law", "fluid"),
    [
        ("quasi-steady", 1000.0),
        ("storage", "same"),
        pytest.param("quasi-steady", "same", marks=pytest.mark.slow),
        pytest.param("storage", 1000.0, marks=pytest.mark.slow),
    ],
)
def test_columns_over_density_agree_with_full_spectra(law, fluid):
    case, walk = walk_of(**{"outside.fluid": fluid, "fluid.continuity": law})
    base = Mu.of(case).at(pressure=6e3)
    places = [base.at(density=d) for d in np.geomspace(2.0, 1500.0, 12)]
    column = walk.column(places)
    assert column.certified.all() and column.error < 1e-6
    for i in (1, 6, 10):
        full = walk.spectrum(places[i], 3)
        assert column.leading[i].real == pytest.approx(full.growth_rate[0], abs=1e-4)
        assert column.leading[i].imag / (2 * np.pi) == pytest.approx(full.frequency[0], abs=1e-4)
        single = leading_modes(
            linearise(walk.built(base).model, walk.equilibrium(base), 6e3).pencil(places[i]),
            3,
            SearchOptions(limit_point=-1 / 0.00116),
        )
        assert single.growth_rate[0] == pytest.approx(full.growth_rate[0], abs=1e-6)


@pytest.mark.slow
def test_most_cells_need_no_direct_solution():
    """Counts that jump over a mode of the laden structure would all be repaired directly, at many times the cost."""
    case, walk = walk_of(**{"outside.fluid": "same", "fluid.continuity": "storage"})
    base = Mu.of(case).at(pressure=6e3)
    column = walk.column([base.at(density=d) for d in np.geomspace(2.0, 1500.0, 30)])
    assert np.count_nonzero(column.how) <= 2 and column.certified.all()


def test_sensitivities_are_slopes_of_the_eigenvalue():
    case = thesis_case(MESH | {"outside.fluid": "same"})
    model, pressure, conditions = ValveModel(case), 8e3, Mu(density=200.0, alpha=0.0, beta=0.002)

    def leading(pressure, density, near=None):
        q = find_equilibrium(model, pressure).q
        pencil = linearise(model, q, pressure).pencil(conditions.at(density=density))
        found = leading_modes(pencil, 6, SearchOptions(limit_point=-500.0, left=near is None))
        i = (
            int(np.argmin(np.abs(found.eigenvalues - near)))
            if near is not None
            else int(np.argmax(found.frequency > 0))
        )
        return q, found.mode(i), found

    q, mode, every = leading(pressure, 200.0)
    here = Neighbourhood(model, q, pressure, conditions, [mode])
    found = [here.slope(name) for name in ("pressure", "density")]
    for sensitivity, h in zip(found, (8.0, 0.2)):
        ends = [
            leading(*((pressure + s * h, 200.0) if sensitivity.parameter == "pressure" else (pressure, 200.0 + s * h)),
                    near=mode.eigenvalue)[1].eigenvalue
            for s in (1, -1)
        ]  # fmt: skip
        slope = (ends[0] - ends[1]) / (2 * h)
        assert abs(sensitivity.derivative - slope) < 1e-4 * abs(slope)
    modes, share = [every.mode(i) for i in range(3)], np.array([2 - 1j, 0.0, 0.5j])
    each, sums = Neighbourhood(model, q, pressure, conditions, modes), [share, [0.0, 1.0, 0.0]]
    together = Neighbourhood(model, q, pressure, conditions, modes, sums=np.array(sums))
    several = each.slope("pressure").eigenvalues
    assert together.slope("pressure").eigenvalues == pytest.approx((share @ several, several[1]), rel=1e-9)


@pytest.mark.slow
def test_an_onset_has_a_kind_and_names_what_is_outside():
    changes = MESH | {"outside.fluid": "same", "drive.pressure": 6e3, "damping.beta": 0.003}
    changes |= {"onset.over": "density=20:600:6:log", "onset.coarse_mesh": 0.0}
    found = dbvfiv.load(thesis_case(), changes).onset()
    swinging = [point for point in found.points if point["frequency"]]
    assert swinging and all(point["criticality"] in ("super", "sub") for point in swinging)
    assert "with the same fluid outside, unbounded" in found.lines()[0]
    assert found.summary()["fixed"]["outside"] == "with the same fluid outside, unbounded"


@pytest.mark.slow
def test_verdicts_name_what_is_outside():
    changes = MESH | {"outside.fluid": 1000.0, "outside.pipe_diameter": 0.33, "drive.pressure": 6e3}
    found = dbvfiv.load(thesis_case(), changes).modes(count=4)
    assert "continuity with fluid of 1000 kg/m3 outside, in a pipe of 330 mm" in found.sentence
    still = dbvfiv.load(thesis_case(), changes | {"modes.in_vacuo": True}).modes(count=4)
    assert still.sentence.startswith("Stable with fluid of 1000 kg/m3 outside")
