"""Keys of a case in the wall, the passage and the flow that are built from it."""

from __future__ import annotations

import numpy as np
import pytest

from dbvfiv.errors import CaseError
from dbvfiv.materials.laws import OrthotropicPly
from dbvfiv.model import ValveModel
from dbvfiv.model.build import build_section
from dbvfiv.model.closed import ClosedValve
from dbvfiv.studies.case import thesis_case
from tests.small_valves import SMALL

BOILING = SMALL | {"fluid.sound_speed": 1480.0, "fluid.continuity": "storage"}
BOILING |= {"fluid.vapour_pressure": 2339.0, "downstream.pressure": 1e4}


def test_a_fluid_boils_below_what_is_around_the_jet():
    case = thesis_case(BOILING | {"fluid.ambient_pressure": "0.9 bar"})
    assert case.boiling_pressure == pytest.approx(2339.0 - 0.9e5 - 1e4)
    assert case.vacuum_pressure == pytest.approx(-0.9e5 - 1e4)
    assert ValveModel(case).flow.vapour == case.boiling_pressure


@pytest.mark.parametrize(
    ("changes", "words"),
    [({"fluid.sound_speed": None}, "without fluid.sound_speed"), ({"fluid.vapour_pressure": 2e5}, "boils everywhere")],
)
def test_vapour_pressures_that_no_flow_has(refused, changes, words):
    with refused(CaseError, match=words):
        thesis_case({key: value for key, value in (BOILING | changes).items() if value is not None})


def test_layers_have_the_factor_of_their_kind_and_the_points_asked_for():
    keys = {"shell.shear_correction_plies": 0.7, "shell.shear_correction_rubber": 0.9, "mesh.layer_points": 3}
    section = build_section(thesis_case(keys))
    found = {(isinstance(layer.law, OrthotropicPly), layer.shear_correction) for layer in section.layers}
    assert found == {(True, 0.7), (False, 0.9)} and section.points_per_layer == 3


def test_a_section_is_shut_where_less_than_the_share_is_left():
    shut = []
    for share in (0.2, 0.9):
        model = ClosedValve(thesis_case(SMALL | {"closure.shut_fraction": share}))
        passage = model.passage(np.zeros(model.size))
        assert passage.shut_fraction == share
        shut.append(passage.shut_length)
    assert shut[0] == 0.0 < shut[1]
