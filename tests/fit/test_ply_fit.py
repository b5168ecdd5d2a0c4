"""Plies from strip tests, Halpin-Tsai backwards and forwards."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dbvfiv.fit import TensionTest
from dbvfiv.fit.ply import StripTest, constituents_of, fit_ply, read_strip_test
from dbvfiv.materials.laws import MaterialError, OrthotropicPly, fibre_ply, ply_from_constituents

APP_A = {
    "fibre_fraction": 0.45,
    "fibre_modulus": 3460e6,
    "matrix_modulus": 4.37e6,
    "fibre_poisson": 0.21,
    "matrix_poisson": 0.35,
}


def _strip(direction, modulus, nu=None, largest=0.05):
    strain = np.linspace(0.0, largest, 21)[1:]
    across = None if nu is None else np.sqrt(1 - 2 * nu * (strain + strain**2 / 2)) - 1
    return StripTest(direction, TensionTest(strain, modulus * StripTest.unit_stress(strain)), across)


def test_the_constituents_of_appendix_a_come_back_from_its_ply():
    ply = fibre_ply("program")
    found = constituents_of(ply.e1, ply.e2, 0.45, 120000.0, ply.nu12)
    for name, value in APP_A.items():
        assert getattr(found, name) == pytest.approx(value, rel=1e-8), name
    assert found.ply(1270.0).g23 == pytest.approx(ply.g23, rel=1e-9)


@given(st.floats(0.05, 0.9), st.floats(1e5, 1e9), st.floats(0.05, 4.0), st.floats(1.0, 1e3), st.floats(0.05, 0.48))
def test_backwards_and_forwards_are_inverse(fraction, matrix, decades, slender, nu):
    fibre = matrix * 10**decades
    xi = slender * 10**decades  # a coefficient below the ratio of the moduli leaves the fibre undetermined
    ply = ply_from_constituents(fraction, fibre, matrix, 0.2, nu, xi)
    found = constituents_of(ply.e1, ply.e2, fraction, xi, ply.nu12, (0.2, 0.35))
    assert found.fibre_modulus == pytest.approx(fibre, rel=1e-8)
    assert found.matrix_modulus == pytest.approx(matrix, rel=1e-8)
    assert found.matrix_poisson == pytest.approx(nu, rel=1e-8)
    other = ply_from_constituents(0.3, fibre, matrix, 0.2, nu, xi)
    assert found.ply(1270.0, 0.3).parameters == pytest.approx(other.parameters, rel=1e-7)


def _bias_modulus(ply):
    """Modulus of a strip cut at 45 degrees, Pa."""
    return 4.0 / (1.0 / ply.e1 + 1.0 / ply.e2 + 1.0 / ply.g12 - 2.0 * ply.nu12 / ply.e1)


@pytest.mark.parametrize("constants", ["program", "table"])
def test_ply_constants_come_back_from_strips(constants):
    ply = fibre_ply(constants)
    tests = (_strip("warp", ply.e1, ply.nu12), _strip("weft", ply.e2, None, 0.4), _strip("bias", _bias_modulus(ply)))
    found = fit_ply(tests)
    for name in ("e1", "e2", "nu12", "g12"):
        assert getattr(found.ply, name) == pytest.approx(getattr(ply, name), rel=1e-8), name
    assert found.measured == ("e1", "e2", "nu12", "g12")
    assert np.abs(tests[1].residuals).max() < 1e-9 * tests[1].test.stress.max()


@pytest.mark.parametrize("nu12", [0.42, 0.001])
def test_a_poisson_ratio_that_no_constituents_give_is_that_of_the_ply_all_the_same(nu12):
    ply = OrthotropicPly(1500e6, 8e6, nu12, 3e6, 2e6, 2e6, 1270.0)
    found = fit_ply((_strip("warp", ply.e1, nu12), _strip("weft", ply.e2), _strip("bias", _bias_modulus(ply))))
    for name in ("e1", "e2", "nu12", "g12"):
        assert getattr(found.ply, name) == pytest.approx(getattr(ply, name), rel=1e-8), name
    assert f"No matrix gives a ply the Poisson ratio {nu12:.4g} with 0.21 of the fibre" in found.missed
    assert found.constituents.matrix_poisson == pytest.approx(0.499 if nu12 > 0.4 else 1e-3)


def test_a_strip_answers_as_the_law_of_the_wall_does():
    """Tension at 45 degrees by the stiffness of the ply, turned."""
    ply = fibre_ply()
    q11, q22, q12, q66 = ply.parameters[:4]
    q = np.array([[q11, q12, 0], [q12, q22, 0], [0, 0, q66]])
    turn = np.array([[0.5, 0.5, 1.0], [0.5, 0.5, -1.0], [-0.5, 0.5, 0.0]])  # stress to axes at 45 degrees
    compliance = turn.T @ np.linalg.inv(q) @ turn
    assert 1 / compliance[0, 0] == pytest.approx(_bias_modulus(ply), rel=1e-12)


def test_what_was_not_measured_comes_from_the_constituents():
    ply = fibre_ply()
    found = fit_ply((_strip("warp", ply.e1), _strip("weft", ply.e2)))
    assert found.measured == ("e1", "e2")
    assert found.ply.g12 == pytest.approx(ply.g12, rel=1e-8) and found.ply.nu12 == pytest.approx(ply.nu12, rel=1e-8)


def test_a_file_with_the_strain_across(tmp_path):
    path = tmp_path / "warp.csv"
    path.write_text("stretch [-]; transverse_strain [%]; nominal_stress [MPa]\n1.01; -0.3; 15\n1.02; -0.6; 30\n")
    strip = read_strip_test(path, "warp")
    assert strip.poisson == pytest.approx(0.3, rel=0.02) and strip.modulus == pytest.approx(1470e6, rel=0.02)
    for columns, words in (
        ("transverse_strain; nominal_stress [MPa]\n1.01; -0.3; 15\n", "transverse_strain no unit is given"),
        ("transverse_strain [%]; nominal_stress [MPa]\n1.01; ; 15\n", "line 2: column transverse_strain.*''"),
        ("nominal_stress [MPa]\n", "no row of numbers"),
        ("nominal_stress [MPa]\n0; 1\n", "greater than -1"),
    ):
        path.write_text(f"stretch [-]; {columns}")
        with pytest.raises(MaterialError, match=words):
            read_strip_test(path, "warp")


def test_impossible_plies_get_a_sentence():
    ply = fibre_ply()
    with pytest.raises(MaterialError, match="warp and weft exchanged"):
        fit_ply((_strip("warp", ply.e2), _strip("weft", ply.e1)))
    with pytest.raises(MaterialError, match="weft is missing"):
        fit_ply((_strip("warp", ply.e1),))
    with pytest.raises(MaterialError, match="too stiff"):
        fit_ply((_strip("warp", ply.e1), _strip("weft", ply.e2), _strip("bias", ply.e1)))
    with pytest.raises(MaterialError, match="No matrix gives a ply the Poisson ratio 0.9"):
        constituents_of(ply.e1, ply.e2, nu12=0.9)
    with pytest.raises(MaterialError, match="less than 1"):
        constituents_of(ply.e1, ply.e2, 1.0)
    with pytest.raises(MaterialError, match="fibre_fraction must be greater than zero"):
        constituents_of(ply.e1, ply.e2, 0.0)
    with pytest.raises(MaterialError, match="no stiffness"):
        StripTest("warp", TensionTest([0.1], [-1.0])).modulus
    with pytest.raises(MaterialError, match="no strain other than zero"):
        StripTest("warp", TensionTest([0.0], [1.0])).modulus
