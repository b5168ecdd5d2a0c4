"""Maps of a wall whose rubber has lost stability: cells against what `modes` finds."""

from __future__ import annotations

import numpy as np
import pytest

from dbvfiv.studies.case import thesis_case
from dbvfiv.studies.map.run import run_map
from dbvfiv.studies.map.runaway import runs_away
from dbvfiv.studies.stability.place import Place
from dbvfiv.studies.stability.walk import StabilityWalk
from eigen import certified_spectrum

COARSE = ["mesh.around=6", "mesh.along=8", "damping.model='loss factor'", "map.curve=false", "map.refine=0"]


def mapped(*changes):
    return run_map(thesis_case([*COARSE, "map.checks=1", *changes]), workers=1)


def agrees_with_modes(found, law, j, i):
    """A cell and the certified spectrum of the full pencil."""
    plan = found.plan
    walk = StabilityWalk(plan.case)
    place = plan.place(plan.across.values[i], plan.along.values[j], plan.laws[law])
    family = walk.family(place)
    modes = certified_spectrum(family.pencil(place.condition), 6, family.search(place.condition))
    assert modes.agrees and modes.unstable_count == found.grid("unstable")[law, j, i]
    leading = complex(found.grid("growth_rate")[law, j, i], 2 * np.pi * found.grid("frequency")[law, j, i])
    assert leading == pytest.approx(modes.spectrum.eigenvalues[0], rel=1e-6)


def test_columns_over_density_hold_what_runs_away():
    found = mapped(
        "damping.loss_factor=2", "map.continuity=both", "map.x=pressure=6e3:16e3:2", "map.y=density=1:1000:4:log"
    )
    # all but a cell in which a mode is close to neutral on the small model
    assert found.grid("certified").all() and (found.grid("how") == 0).sum() >= found.grid("how").size - 2
    away = runs_away(found.plan, found.grid("growth_rate"), found.grid("frequency"))
    assert away[:, :, 1].all() and not away[:, :, 0].any()
    assert (found.grid("unstable")[:, :, 1] >= 2).all()
    (sentence,) = (words for words in found.warnings if "runs away by itself" in words)
    assert sentence.startswith("In 8 cells, of columns between pressure = 16 and 16 kPa, ") and "8.56e+03" in sentence
    assert all(check.agrees for check in found.checks)
    agrees_with_modes(found, 1, 3, 1)


def test_a_wall_that_is_held_is_not_said_to_run_away():
    found = mapped("map.x=pressure=2e3:6e3:2", "map.y=density=1:1000:4:log")
    assert not any("runs away" in words for words in found.warnings)


@pytest.mark.slow
def test_columns_over_loss_factors_hold_what_runs_away():
    """Each factor has rates of its own, and some have none."""
    found = mapped("fluid.density=1000", "map.x=pressure=16e3:28e3:2", "map.y=loss_factor=0.5:2:6")
    assert found.grid("certified").all()
    away = runs_away(found.plan, found.grid("growth_rate"), found.grid("frequency"))[0]
    assert not away[0].any() and away[-1].all()
    for i in (0, 1):
        agrees_with_modes(found, 0, 1, i)
        agrees_with_modes(found, 0, 5, i)


@pytest.mark.parametrize(
    ("pressure", "densities"), [(14.06e3, (50.0, 406.0)), (19.3e3, (165.0,)), (22.628e3, (1.0, 6.0))]
)
def test_no_mode_is_lost_beside_what_runs_away(pressure, densities):
    """The leading one swings in part as the wall runs away; without that part it is far off."""
    case = thesis_case([*COARSE, "damping.loss_factor=2", "fluid.continuity=storage"])
    walk, base = StabilityWalk(case), Place.of(case).at(pressure=pressure, storage=1.0)
    values = np.sort([*np.geomspace(1.0, 1000.0, 12), *densities])
    column = walk.column([base.at(density=density) for density in values])
    assert (column.runaway == 2).all() and column.certified.all()
    for i in np.searchsorted(values, densities):
        modes = walk.spectrum(base.at(density=float(values[i]))).eigenvalues
        modes = modes[modes.imag > 1.0]
        assert column.leading[i][0] == pytest.approx(modes[np.argmax(modes.real)], rel=1e-5)
