"""A valve twice the size of another, of the same materials: the same shape at the same pressure, half the frequencies.

Stiffness grows with the first power of the length, mass with the third, and pressures do not know it at all. Numbers
that have a length or a time in them and do not belong to the valve go along by hand: the springs of the lip stop with
the length, Rayleigh's alpha against it and beta with it.
"""

import numpy as np
import pytest

import dbvfiv
from dbvfiv.studies.case import thesis_case

MESH = {"mesh.around": 6, "mesh.along": 8, "damping.alpha": 4.0, "damping.beta": 2e-3, "steady.tolerance": 1e-11}
MESH |= {"fluid.continuity": "storage"}
TWICE = {"valve.scale": 2, "supports.lip_stop_stiffness": 2e8, "damping.alpha": 2.0, "damping.beta": 4e-3}


@pytest.mark.slow
def test_twice_the_size_is_half_the_frequency():
    one = dbvfiv.load(thesis_case(), MESH).steady(pressure=6e3)
    two = dbvfiv.load(thesis_case(), MESH | TWICE).steady(pressure=6e3)
    size = np.abs(one.nodal[:, :3]).max()
    assert two.nodal[:, :3] / 2 == pytest.approx(one.nodal[:, :3], abs=1e-8 * size)
    assert two.nodal[:, 3:] == pytest.approx(one.nodal[:, 3:], abs=1e-8)
    assert two.mass_flow / 4 == pytest.approx(one.mass_flow, rel=1e-8)
    for choices in ({"in_vacuo": True}, {"density": 10.0}):
        found = [
            np.array([(mode.growth_rate, mode.frequency) for mode in state.modes(count=4, **choices).modes])
            for state in (one, two)
        ]
        assert 2 * found[1] == pytest.approx(found[0], rel=1e-8, abs=1e-8 * np.abs(found[0]).max())
