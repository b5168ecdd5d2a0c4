"""What the mesh leaves of error in the 12-inch valve: onset, growth, flow, and frequencies of the isotropic valve.

Defaults: rows on steps and joints, closer at kinks, columns closer in the bend, enhanced element. With even rows and
columns and the plain element the growth at 45 kg/m3 was 13.25, 5.19, 4.09, 5.38 1/s on the same four meshes.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.sparse.linalg import eigsh

from dbvfiv.model import Conditions, ValveModel, linearise
from dbvfiv.model.equilibria import find_equilibria
from dbvfiv.studies.case import thesis_case
from eigen import SearchOptions, leading_modes
from tests.verification.test_modal_valve import frequencies

MESHES = ((14, 24), (28, 48), (42, 72), (56, 96))
FLOWS = (6e3, 18e3, 36e3)
#: Of the four meshes, see `test_onset_and_flow_converge`.
LIMIT_ONSET, LIMIT_GROWTH, LIMIT_FLOW = 53.5, 4.39, np.array([10.72, 41.65, 81.56])


def measured(around: int, along: int, mass="consistent", pressures=FLOWS) -> tuple[float, float, np.ndarray]:
    """Onset density at 6 kPa, kg/m3, growth there at 45 kg/m3, 1/s, and flow at pressures from 6 kPa on, kg/s
    (quasi-steady, alpha 0, beta 3 ms).
    """
    model = ValveModel(thesis_case({"mesh.around": around, "mesh.along": along, "shell.mass": mass}))
    states = find_equilibria(model, pressures).states
    small = linearise(model, states[0].q, states[0].pressure)
    options = SearchOptions(limit_point=-1 / 0.003)

    def growth(density):
        return float(leading_modes(small.pencil(Conditions(density, 0.0, 0.003)), 1, options).eigenvalues[0].real)

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


def test_default_mesh():
    """28 x 48 lies within 2 % in onset, 0.3 1/s in growth and 0.3 % in flow of the limits."""
    onset, growth, flow = measured(28, 48)
    print(f"\n28 x 48: onset {onset:.3f} kg/m3, growth {growth:.3f} 1/s, flow {np.round(flow, 3)} kg/s")
    assert onset == pytest.approx(LIMIT_ONSET, rel=0.02)
    assert growth == pytest.approx(LIMIT_GROWTH, abs=0.3)
    assert flow == pytest.approx(LIMIT_FLOW, rel=0.003)


def test_edges_that_bow_go_to_the_same_flow():
    """From farther below than the default element, as plies bend less freely with one bow for two elements."""
    found = []
    for around, along in MESHES[:2]:
        keys = {"mesh.around": around, "mesh.along": along, "mesh.element": "MITC4+drilling"}
        found.append(find_equilibria(ValveModel(thesis_case(keys)), FLOWS[:1]).states[0].mass_flow)
    print(f"\nflow at 6 kPa {np.round(found, 4)} kg/s")
    assert found == pytest.approx([10.430, 10.655], rel=1e-3)
    assert (4 * found[1] - found[0]) / 3 == pytest.approx(LIMIT_FLOW[0], rel=2e-3)


@pytest.mark.slow
def test_onset_and_flow_converge():
    """Monotone in onset and growth; the limits are those that the fast test holds the default mesh against."""
    found = [measured(*mesh) for mesh in MESHES]
    onset, growth = np.array([f[0] for f in found]), np.array([f[1] for f in found])
    flow = np.array([f[2] for f in found])
    print(f"\nonset {np.round(onset, 3)}, order and limit {fitted(onset)}")
    print(f"growth {np.round(growth, 3)}, order and limit {fitted(growth)}")
    for pressure, row in zip(FLOWS, flow.T):
        print(f"flow at {pressure / 1e3:g} kPa {np.round(row, 4)}")
    assert np.all(np.diff(onset) < 0) and np.all(np.diff(growth) < 0)
    assert fitted(onset)[1] == pytest.approx(LIMIT_ONSET, rel=2e-3)
    assert fitted(growth)[1] == pytest.approx(LIMIT_GROWTH, abs=0.05)
    assert flow[-1] == pytest.approx(LIMIT_FLOW, rel=1e-3)


#: Lowest frequencies of the isotropic valve of other codes on 112 x 192, Hz.
OTHERS = (13.49, 18.63, 23.96, 30.81, 39.70)


def test_isotropic_valve():
    """Five lowest frequencies on 28 x 48 beside those of other codes on 112 x 192: within 0.6 %, of which 0.3 % is the
    mesh (56 x 96: 13.51, 18.66, 24.03, 30.85, 39.73; 112 x 192: 13.50, 18.65, 24.01, 30.83, 39.71, and with even rows
    and columns and the plain element 13.49, 18.64, 24.00, 30.82, 39.70). Much of it is left by the consistent
    mass: with the averaged one all but the first are nearer on 14 x 24 than these here.
    """
    own = frequencies(28, 48, 5 / 6, 5)
    print(f"\n28 x 48 {np.round(own, 3)}")
    assert own == pytest.approx(OTHERS, rel=0.006)
    assert own == pytest.approx([13.510, 18.655, 24.030, 30.853, 39.732], rel=0.003)


def test_isotropic_valve_with_the_averaged_mass():
    """Within 0.3 % of the other codes on 28 x 48 (0.22, 0.13, 0.26, 0.11, 0.05), and on 14 x 24 within 0.35 % (0.32,
    0.19, 0.25, 0.20, 0.15), where the consistent mass leaves up to 1.4 %.
    """
    fine, coarse = (frequencies(*mesh, 5 / 6, 5, "averaged") for mesh in ((28, 48), (14, 24)))
    print(f"\naveraged: 14 x 24 {np.round(coarse, 3)}, 28 x 48 {np.round(fine, 3)}")
    assert fine == pytest.approx(OTHERS, rel=0.003)
    assert coarse == pytest.approx(OTHERS, rel=0.0035)
    assert fine == pytest.approx([13.520, 18.655, 24.022, 30.844, 39.718], rel=1e-4)


def in_vacuo(around: int, along: int, mass: str) -> np.ndarray:
    """Five lowest frequencies, Hz, of the layered valve as it stands at 6 kPa, without fluid and damping."""
    model = ValveModel(thesis_case({"mesh.around": around, "mesh.along": along, "shell.mass": mass}))
    q = find_equilibria(model, FLOWS[:1]).states[0].q
    stiffness, inertia = (model.shell.dofs.matrix(v).tocsc() for v in (model.structure(q)[1], model.mass(q)))
    values = eigsh(stiffness, 5, inertia, sigma=-1000.0, return_eigenvectors=False)
    return np.sqrt(np.sort(values)) / (2 * np.pi)


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
    """With the averaged mass 28 x 48 has the frequencies within 0.15 % of those of 56 x 96, for 0.6 %; on 14 x 24 the
    fifth is 1.3 % too low, where it is 1.5 % too high with the consistent mass. The isotropic valve on 56 x 96: 0.13,
    0.11, 0.22, 0.07 and 0.02 % over other codes, for 0.15, 0.14, 0.29, 0.14 and 0.08.
    """
    found = {given: in_vacuo(*given) for given in IN_VACUO}
    for given, values in found.items():
        print(f"\n{given}: {np.round(values, 3)}")
        assert values == pytest.approx(IN_VACUO[given], rel=1e-4)
    fine = found[56, 96, "averaged"]
    assert found[28, 48, "averaged"] == pytest.approx(fine, rel=1.5e-3)
    assert np.max(found[28, 48, "consistent"] / fine) > 1.005
    for mass, shares in (("consistent", (0.15, 0.14, 0.29, 0.14, 0.08)), ("averaged", (0.13, 0.11, 0.22, 0.07, 0.02))):
        over = frequencies(56, 96, 5 / 6, 5, mass) / np.array(OTHERS) - 1.0
        assert 100 * over == pytest.approx(shares, abs=0.006)


def test_onset_with_the_averaged_mass():
    """Why it is not the default: 55.71 kg/m3 on 28 x 48 and 67.57 on 14 x 24 stand two to four times as far from the
    limit of 53.5 as 54.11 and 60.66 with the consistent mass (growth 5.33 and 9.81 for 4.62 and 7.32 1/s, of 4.39). An
    onset is a balance of stiffness, load and mass, and errors of the consistent mass take off a part of the others'.
    """
    (fine, growth, _), (coarse, *_) = (measured(*mesh, "averaged", FLOWS[:1]) for mesh in ((28, 48), (14, 24)))
    print(f"\naveraged: onset {coarse:.3f} on 14 x 24, {fine:.3f} on 28 x 48, growth there {growth:.3f}")
    assert (coarse, fine) == pytest.approx((67.575, 55.714), rel=2e-4)
    assert growth == pytest.approx(5.330, abs=2e-3)
    assert fine - LIMIT_ONSET > 2 * (54.113 - LIMIT_ONSET)


@pytest.mark.slow
def test_onsets_of_both_masses_have_one_limit():
    """Both masses are that of the wall as elements shrink: 67.57, 55.71, 54.18, 53.92 go to 53.53 kg/m3."""
    found = [measured(*mesh, "averaged", FLOWS[:1]) for mesh in MESHES]
    onset, growth = np.array([f[0] for f in found]), np.array([f[1] for f in found])
    print(f"\naveraged: onset {np.round(onset, 3)}, order and limit {fitted(onset)}")
    print(f"growth {np.round(growth, 3)}, order and limit {fitted(growth)}")
    assert np.all(np.diff(onset) < 0) and np.all(np.diff(growth) < 0)
    assert fitted(onset)[1] == pytest.approx(LIMIT_ONSET, rel=2e-3)
    assert fitted(growth)[1] == pytest.approx(LIMIT_GROWTH, abs=0.05)
