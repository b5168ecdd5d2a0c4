"""What the mesh leaves of error in the 12-inch valve: onset, growth, flow, and frequencies of the isotropic valve.

Defaults: rows on steps and joints, closer at kinks and at the lip, columns closer in the bend, enhanced element,
averaged mass, parabolic inertia of the fluid between rows. The thesis's cases have rows that are not closer at the lip,
the consistent mass and straight inertia.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

from dbvfiv.case.parameters import Mu
from dbvfiv.model import ValveModel, linearise
from dbvfiv.model.equilibria import LoadPath, SteadyOptions
from dbvfiv.studies.case import thesis_case
from eigen import SearchOptions, leading_modes
from tests.shell.structures import lowest_frequencies
from tests.verification.test_modal_valve import frequencies

MESHES = ((14, 24), (28, 48), (42, 72), (56, 96))
FLOWS = (6e3, 18e3, 36e3)
#: Of 84 x 144 elements and of the four meshes, see `test_onset_and_flow_converge`.
LIMIT_ONSET, LIMIT_GROWTH, LIMIT_FLOW = 53.80, 4.55, np.array([10.722, 41.663, 81.574])
#: The mesh and mass of the defaults, and those of the thesis's cases.
USUAL = {"mesh.rows": "lip", "mesh.inertia": "parabolic", "shell.mass": "averaged"}
EARLIER = {"mesh.rows": "graded", "mesh.inertia": "linear", "shell.mass": "consistent"}


def measured(around: int, along: int, keys=USUAL, pressures=FLOWS) -> tuple[float, float, np.ndarray]:
    """Onset density at 6 kPa, kg/m3, growth there at 45 kg/m3, 1/s, and flow at pressures from 6 kPa on, kg/s
    (quasi-steady, alpha 0, beta 3 ms).
    """
    model = ValveModel(thesis_case(keys | {"mesh.around": around, "mesh.along": along}))
    path = LoadPath(model, SteadyOptions.of(model.case))
    states = [path.go_to(pressure) for pressure in pressures]
    small = linearise(model, states[0].q, states[0].pressure)
    options = SearchOptions(limit_point=-1 / 0.003)

    def growth(density):
        return float(
            leading_modes(small.pencil(Mu(density=density, alpha=0.0, beta=0.003)), 1, options).eigenvalues[0].real
        )

    onset = brentq(growth, 45.0, 75.0, xtol=1e-3)
    return onset, growth(45.0), np.array([state.mass_flow for state in states])


def fitted(values) -> tuple[float, float]:
    """Order and limit of a sequence on the four meshes, by least squares of v + c h^p."""
    h = np.array([1 / along for _, along in MESHES]) * 24
    best = (np.inf, 0.0, 0.0)
    for order in np.linspace(0.5, 6.0, 111):
        columns = np.stack([np.ones(4), h**order], axis=1)
        found, *_ = np.linalg.lstsq(columns, values, rcond=None)
        best = min(best, (float(np.linalg.norm(columns @ found - values)), float(order), float(found[0])))
    return best[1], best[2]


@pytest.mark.slow
def test_default_mesh():
    """28 x 48 lies within 0.1 % in onset, 0.02 1/s in growth and 0.16 % in flow of the limits."""
    onset, growth, flow = measured(28, 48)
    print(f"\n28 x 48: onset {onset:.3f} kg/m3, growth {growth:.3f} 1/s, flow {np.round(flow, 3)} kg/s")
    assert (onset, growth) == pytest.approx((53.842, 4.566), rel=2e-4)
    assert flow == pytest.approx([10.7054, 41.6314, 81.5574], rel=2e-5)
    assert onset == pytest.approx(LIMIT_ONSET, rel=0.002)
    assert growth == pytest.approx(LIMIT_GROWTH, abs=0.05)
    assert flow == pytest.approx(LIMIT_FLOW, rel=0.002)


#: Onset, kg/m3, and growth, 1/s, on 28 x 48; the first as the thesis's cases have it.
STEPS = (
    (EARLIER, 54.113, 4.618),
    (EARLIER | {"shell.mass": "averaged"}, 55.714, 5.330),
    (EARLIER | {"shell.mass": "averaged", "mesh.inertia": "parabolic"}, 54.082, 4.631),
)


@pytest.mark.slow
@pytest.mark.parametrize("keys, onset, growth", STEPS)
def test_what_each_choice_takes_off(keys, onset, growth):
    """From the earlier mesh to the present one: errors of the consistent mass took off a part of those of the fluid's
    inertia, which was straight between rows; without them onsets stood farther off.
    """
    found = measured(28, 48, keys, FLOWS[:1])[:2]
    print(f"\n{keys}: onset {found[0]:.3f}, growth {found[1]:.3f}")
    assert found == pytest.approx((onset, growth), rel=2e-4)


@pytest.mark.slow
@pytest.mark.parametrize("mesh, onset, flow", [((28, 96), 53.925, 10.7325), ((56, 48), 53.677, 10.6920)])
def test_errors_along_and_around(mesh, onset, flow):
    """Twice the rows, or twice the columns, alone: 0.15 and 0.3 % of the onset, 0.25 and 0.13 % of the flow at 6 kPa,
    of opposite signs.
    """
    found = measured(*mesh, pressures=FLOWS[:1])
    print(f"\n{mesh}: onset {found[0]:.3f}, growth {found[1]:.3f}, flow {found[2]}")
    assert (found[0], found[2][0]) == pytest.approx((onset, flow), rel=2e-4)


@pytest.mark.slow
def test_onset_and_flow_converge():
    """Falling in onset and growth, rising in flow: onset 55.57, 53.84, 53.79, 53.76 kg/m3. The limits are those that
    the fast test holds the mesh against, of 84 x 144 elements, which have 53.805 kg/m3 and 4.563 1/s: beyond 28 x 48
    what moves is where rows and columns come to lie, 0.05 kg/m3.
    """
    found = [measured(*mesh) for mesh in MESHES]
    onset, growth = np.array([f[0] for f in found]), np.array([f[1] for f in found])
    flow = np.array([f[2] for f in found])
    print(f"\nonset {np.round(onset, 3)}, order and limit {fitted(onset)}")
    print(f"growth {np.round(growth, 3)}, order and limit {fitted(growth)}")
    for pressure, row in zip(FLOWS, flow.T):
        print(f"flow at {pressure / 1e3:g} kPa {np.round(row, 4)}")
    assert np.all(np.diff(onset) < 0) and np.all(np.diff(growth) < 0) and np.all(np.diff(flow, axis=0) > 0)
    assert fitted(onset)[1] == pytest.approx(LIMIT_ONSET, rel=2e-3)
    assert fitted(growth)[1] == pytest.approx(LIMIT_GROWTH, abs=0.05)
    assert flow[-1] == pytest.approx(LIMIT_FLOW, rel=1e-3)


@pytest.mark.slow
def test_earlier_meshes_go_to_the_same_onset():
    """60.66, 54.11, 53.59, 53.52 kg/m3 on the four meshes and 53.66 on 84 x 144: they cross the limit, and what was
    extrapolated from the four, 53.5, lay 0.5 % below it.
    """
    found = [measured(*mesh, EARLIER, FLOWS[:1])[0] for mesh in (*MESHES, (84, 144))]
    print(f"\nearlier: onset {np.round(found, 3)}")
    assert found == pytest.approx([60.660, 54.113, 53.59, 53.522, 53.663], rel=2e-4)
    assert found[-1] == pytest.approx(LIMIT_ONSET, rel=3e-3)


#: Lowest frequencies of the isotropic valve of other codes on 112 x 192, Hz.
OTHERS = (13.49, 18.63, 23.96, 30.81, 39.70)


@pytest.mark.slow
def test_isotropic_valve():
    """Five lowest frequencies on 28 x 48 within 0.1 % of those of 112 x 192 (13.50, 18.65, 24.01, 30.83, 39.71), and
    within 0.3 % of those of other codes there (0.06, 0.12, 0.27, 0.15, 0.08); with the consistent mass and rows of
    earlier versions 0.5 %. On 14 x 24 within 0.55 %.
    """
    fine, coarse = (frequencies(*mesh, 5 / 6, 5) for mesh in ((28, 48), (14, 24)))
    print(f"\n14 x 24 {np.round(coarse, 3)}, 28 x 48 {np.round(fine, 3)}")
    assert fine == pytest.approx([13.50, 18.65, 24.01, 30.83, 39.71], rel=1e-3)
    assert fine == pytest.approx(OTHERS, rel=0.003)
    assert coarse == pytest.approx(OTHERS, rel=0.0055)
    assert fine == pytest.approx([13.4982, 18.6516, 24.0239, 30.8567, 39.7305], rel=1e-4)
    earlier = frequencies(28, 48, 5 / 6, 5, "consistent", "graded")
    assert earlier == pytest.approx(OTHERS, rel=0.006)


def in_vacuo(around: int, along: int, mass: str) -> np.ndarray:
    """Five lowest frequencies, Hz, of the layered valve as it stands at 6 kPa, without fluid and damping."""
    keys = {"mesh.around": around, "mesh.along": along, "shell.mass": mass}
    model = ValveModel(thesis_case(keys))
    q = LoadPath(model, SteadyOptions.of(model.case)).go_to(FLOWS[0]).q
    return lowest_frequencies(model.shell, model.structure(q)[1], model.mass(q), 5, below=-1000.0)


#: By mesh and mass, Hz; see `test_layered_valve_in_vacuo`.
IN_VACUO = {
    (14, 24, "consistent"): (16.509, 18.670, 37.138, 41.489, 55.604),
    (14, 24, "averaged"): (16.417, 18.612, 36.635, 41.464, 54.033),
    (28, 48, "consistent"): (16.385, 18.625, 36.851, 41.403, 55.035),
    (28, 48, "averaged"): (16.363, 18.611, 36.729, 41.397, 54.644),
    (56, 96, "consistent"): (16.350, 18.595, 36.752, 41.383, 54.809),
    (56, 96, "averaged"): (16.345, 18.592, 36.721, 41.382, 54.712),
}


@pytest.mark.slow
def test_layered_valve_in_vacuo():
    """On rows of the thesis's cases. With the averaged mass 28 x 48 has the frequencies within 0.15 % of those of 56 x
    96, for 0.6 %; on 14 x 24 the fifth is 1.3 % too low, where it is 1.5 % too high with the consistent mass. The
    isotropic valve on 56 x 96: 0.13, 0.11, 0.22, 0.07 and 0.02 % over other codes, for 0.15, 0.14, 0.29, 0.14, 0.08.
    """
    found = {given: in_vacuo(*given) for given in IN_VACUO}
    for given, values in found.items():
        print(f"\n{given}: {np.round(values, 3)}")
        assert values == pytest.approx(IN_VACUO[given], rel=1e-4)
    fine = found[56, 96, "averaged"]
    assert found[28, 48, "averaged"] == pytest.approx(fine, rel=1.5e-3)
    assert np.max(found[28, 48, "consistent"] / fine) > 1.005
    for mass, shares in (("consistent", (0.15, 0.14, 0.29, 0.14, 0.08)), ("averaged", (0.13, 0.11, 0.22, 0.07, 0.02))):
        over = frequencies(56, 96, 5 / 6, 5, mass, "graded") / np.array(OTHERS) - 1.0
        assert 100 * over == pytest.approx(shares, abs=0.006)
