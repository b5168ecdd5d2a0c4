"""Laws of pipes and pumps know how much of the valve the areas are those of."""

from __future__ import annotations

import numpy as np
import pytest

from dbvfiv.case.part import HALF, QUARTER
from dbvfiv.flow import Channel
from dbvfiv.flow.elastic_line import ElasticLine
from dbvfiv.flow.terms.line import Line
from dbvfiv.flow.terms.pump import Pump
from dbvfiv.flow.terms.tail import Tail
from tests.flow.test_channel import FLOOR, passage
from tests.flow.test_pump import DENSITY, FLOWS, HEADS, SUPPLY

TERMS = {
    "line": lambda copies: [Line(20.0, 0.25, 0.02, loss=1.0, copies=copies)],
    "line as wide as the flange": lambda copies: [Line(20.0, None, 0.02, copies=copies)],
    "line and pump": lambda copies: [Line(5.0, 0.3, copies=copies), Pump(FLOWS, HEADS, DENSITY, SUPPLY, copies=copies)],
    "tail": lambda copies: [Tail(0.4, 3.0, 0.7, copies=copies)],
}


@pytest.mark.parametrize("name", TERMS)
def test_a_half_has_the_pressures_of_the_quarter(name):
    z, area = passage()
    given, found = {"inlet": SUPPLY, "density": DENSITY}, []
    for part in (QUARTER, HALF):
        law = Channel(z, FLOOR * part.quarters, 1.0, terms=TERMS[name](part.copies))
        areas = part.quarters * area
        still = law.linearise_still(areas, given)
        found.append((law.inlet_velocity(areas, **given), law.steady_pressure(areas, SUPPLY), still))
    (speed, pressure, parts), (other, same, others) = found
    assert other == pytest.approx(speed, rel=1e-12) and same == pytest.approx(pressure, rel=1e-12)
    for key, value in parts.items():
        per_area = 2.0 if key[0] in "AR" else 1.0  # what stands beside changes of areas
        size = np.abs(value).max(initial=0.0)
        assert per_area * others[key] == pytest.approx(value, rel=1e-10, abs=1e-12 * size), key


def test_a_pump_behind_an_elastic_line_is_fed_the_whole_flow():
    _, area = passage()
    found = []
    for part in (QUARTER, HALF):
        line, pump = Line(40.0, 0.25, 0.02, copies=part.copies), Pump(FLOWS, HEADS, DENSITY, SUPPLY, part.copies)
        given = {"density": DENSITY, "pipe_length": 40.0, "wave_speed": 500.0}
        elastic = ElasticLine(line, 500.0, 4, pump)
        found.append(float(elastic.far_head(0.8, SUPPLY / DENSITY, part.quarters * float(area[-1]), given)))
    assert found[1] == pytest.approx(found[0], rel=1e-12)
