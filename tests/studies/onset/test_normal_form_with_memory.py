"""The normal form from motions at given rates is, without relaxation, that of the first-order system."""

import numpy as np
import pytest

from continuation.normal_form import hopf_normal_form_of
from dbvfiv.model.memory_forms import ValveMemoryForms
from dbvfiv.studies.case import thesis_case
from dbvfiv.studies.onset.normal_form import normal_form
from dbvfiv.studies.onset.search import OnsetOptions, OnsetSearch

pytestmark = pytest.mark.slow


def test_without_relaxation_both_ways_give_the_same():
    given = ["mesh.around=6", "mesh.along=8", "damping.alpha=1", "damping.beta=0.003", "drive.pressure=6 kPa"]
    case = thesis_case(given)
    options = OnsetOptions("density", tuple(np.geomspace(1, 1000, 9)), True, normal_form=False, coarse_mesh=0)
    search = OnsetSearch(case, options)
    (crossing,) = search.scan.run(options.values)
    point = search.point(crossing)
    place = search.place(point.value)
    mode = search.critical(place, 2j * np.pi * point.frequency)
    plain = normal_form(case, search.walk, place, mode, "density")
    model = search.walk.built(place).model
    forms = ValveMemoryForms(model, search.walk.equilibrium(place), place.for_system())
    found = hopf_normal_form_of(forms, plain.omega, np.concatenate([mode.q, mode.u]), "density")
    assert found.c1 == pytest.approx(plain.c1, rel=1e-8) and found.l1 == pytest.approx(plain.l1, rel=1e-8)
    assert found.crossing == pytest.approx(plain.crossing, rel=1e-8)
    turn = np.vdot(found.q, plain.q)
    assert abs(turn) == pytest.approx(1.0, rel=1e-10)
    for one, other in ((found.h20 * turn**2, plain.h20), (found.h11, plain.h11)):
        assert np.linalg.norm(one - other) < 1e-7 * np.linalg.norm(other)
