"""`valve.scale`: the same valve larger or smaller, as a case and as a mesh."""

import pytest

from dbvfiv.geometry.valve_mesh import valve_mesh
from dbvfiv.studies.case import Case

OWN = {"valve.lip_half_width": 0.15, "valve.cuff_length": 0.05, "valve.lip_rise": 0.004, "valve.flare_length": 0.04}
UNIFORM = {"valve.wall": "uniform"}


@pytest.mark.parametrize("changes", [{}, OWN | UNIFORM, {"mesh.breaks": [0.1, 0.33]}])
@pytest.mark.parametrize("factor", [2.0, 0.37])
def test_every_length_is_multiplied(changes, factor):
    case, large = Case().replace(changes), Case().replace(changes | {"valve.scale": factor})
    one, other = (valve_mesh(c.valve, c.mesh, (0.5,)) for c in (case, large))
    for name in ("nodes", "z", "thickness"):
        assert getattr(other, name) == pytest.approx(factor * getattr(one, name), rel=1e-12, abs=1e-15)
    for name in ("rest_area", "wall_deduction"):
        assert getattr(other, name) == pytest.approx(factor**2 * getattr(one, name), rel=1e-11)
    assert other.columns == pytest.approx(one.columns, abs=1e-12)


def test_a_case_says_what_was_given():
    """Sizes are read, written and changed as given; the model sees them multiplied."""
    case = Case().replace({"valve.scale": 3})
    assert case.valve.duckbill_length == pytest.approx(0.63) and case.valve.wall_map[0].thickness == pytest.approx(
        0.036
    )
    assert case.valve.lip_radius == pytest.approx(3 * 0.00619)
    assert case.to_dict()["valve"]["duckbill_length"] == 0.21
    assert Case.from_dict(case.to_dict()) == case
    assert case.replace({"valve.scale": 1}) == Case()
    assert case.replace({"valve.duckbill_length": "200 mm"}).valve.duckbill_length == pytest.approx(0.6)
    assert case.replace({"fluid.density": 5}).valve == case.valve
