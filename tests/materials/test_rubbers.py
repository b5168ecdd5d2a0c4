"""The shipped constants against the printed table, and what lies between the levels."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from dbvfiv.fit import TensionTest, fit_rubber, form_of, uniaxial_stress
from dbvfiv.materials.laws import MaterialError
from dbvfiv.materials.shipped import published_rubber, rubber, rubber_names, strain_levels
from tests.pages import agrees

DOCUMENT = Path(__file__).parents[2] / "docs/evidence/materials.md"

# Th. Table 3-3, MPa: for each level the three-constant set, then the two-constant set.
TABLE_3_3 = {
    "SBR": [
        (-36.10, 38.22, 53.52, -10.57, 12.28),
        (-12.01, 13.53, 9.25, -3.21, 4.44),
        (-6.55, 7.92, 2.82, -1.14, 2.14),
        (-2.92, 3.91, 0.97, -0.30, 1.04),
    ],
    "CR": [
        (-6.09, 6.80, 8.10, -1.87, 2.51),
        (-3.11, 3.78, 2.23, -0.77, 1.36),
        (-1.50, 2.11, 0.66, -0.18, 0.70),
        (-0.95, 1.51, 0.34, -0.03, 0.51),
    ],
    "EPDM": [
        (-16.24, 17.39, 23.35, -5.33, 6.31),
        (-8.94, 9.99, 7.25, -1.80, 2.62),
        (-2.91, 3.66, 1.47, -0.15, 0.72),
        (-1.83, 2.48, 0.74, 0.18, 0.30),
    ],
}


@pytest.mark.parametrize("name", TABLE_3_3)
def test_shipped_constants_round_to_the_printed_table(name):
    for level, (c10, c01, c11, two_c10, two_c01) in zip(strain_levels(), TABLE_3_3[name], strict=True):
        three, two = published_rubber(name, level), published_rubber(name, level, terms=2)
        # half a unit of the last printed digit, and a hair for decimal fractions
        np.testing.assert_allclose(
            np.array([three.c10, three.c01, three.c11]) / 1e6, [c10, c01, c11], rtol=0, atol=0.005001
        )
        np.testing.assert_allclose([two.c10, two.c01, two.c11], [two_c10 * 1e6, two_c01 * 1e6, 0], rtol=1e-15)
        assert three.density == two.density == 1300.0


def test_names_and_levels():
    assert rubber_names() == ("CR", "EPDM", "SBR")
    assert strain_levels() == (0.10, 0.20, 0.40, 0.60)


@pytest.mark.parametrize("level, weight", [(0.15, 0.5), (0.12, 0.2), (0.5, 0.5)])
def test_energy_is_interpolated_linearly_between_levels(level, weight):
    low = max(v for v in strain_levels() if v <= level)
    high = min(v for v in strain_levels() if v >= level)
    e = np.array([0.04, -0.02, 0.03, 0.05, -0.01])
    between = published_rubber("SBR", level)
    ends = [published_rubber("SBR", v).energy(e) for v in (low, high)]
    assert between.energy(e) == pytest.approx((1 - weight) * ends[0] + weight * ends[1], rel=1e-10)
    moduli = [published_rubber("SBR", v).small_strain_shear_modulus for v in (low, high)]
    assert min(moduli) < between.small_strain_shear_modulus < max(moduli)


#: R^2 of the stable constants against the published curve, and their largest error beyond 2 % strain.
FOUND = {
    "SBR": [(0.99997, 0.0083), (0.99997, 0.0081), (0.99993, 0.0326), (0.99995, 0.0603)],
    "CR": [(0.99999, 0.0038), (0.99999, 0.0047), (0.99998, 0.0259), (0.99998, 0.0410)],
    "EPDM": [(0.99998, 0.0066), (0.99997, 0.0088), (0.99998, 0.0361), (0.99998, 0.0565)],
}


def _curve(name, level):
    """60 points of the curve that the published constants of a level describe."""
    strain = np.linspace(0.0, level, 61)[1:]
    return TensionTest(strain, uniaxial_stress(published_rubber(name, level), 1 + strain))


@cache
def _fit(name, level):
    return fit_rubber([_curve(name, level)], form_of("softening"))


@pytest.mark.parametrize("name", FOUND)
def test_stable_constants_follow_the_published_curves(name):
    for level, (r_squared, error) in zip(strain_levels(), FOUND[name], strict=True):
        test, law = _curve(name, level), rubber(name, level)
        stress = form_of("softening").columns("uniaxial", test.strain, [law.x_0]) @ [
            law.mu_inf,
            law.mu_0,
            law.c,
            law.c_3,
        ]
        left = test.stress - stress
        assert 1 - np.sum(left**2) / np.sum((test.stress - test.stress.mean()) ** 2) >= r_squared
        assert np.abs(left / test.stress)[test.strain >= 0.02].max() <= error


@pytest.mark.parametrize("name", FOUND)
def test_stable_constants_are_the_least_squares(name):
    for level in strain_levels():
        fit, law = _fit(name, level), rubber(name, level)
        np.testing.assert_allclose(fit.constants, [law.mu_inf, law.mu_0, law.c, law.c_3], rtol=1e-5)
        assert fit.exponents[0] == pytest.approx(law.x_0, rel=1e-5)


def test_the_documented_fits_are_true():
    """docs/evidence/materials.md: constants, R^2 and largest error beyond 2 % strain, to the digits printed."""
    rows = [[c.strip() for c in line.strip("|").split("|")] for line in DOCUMENT.read_text().splitlines()]
    rows = [row for row in rows if row[0] in FOUND and len(row) == 10]
    assert len(rows) == 12
    for name, level, published, modulus, *cells in rows:
        level = float(level.split()[0]) / 100
        law, test = rubber(name, level), _curve(name, level)
        fit = _fit(name, level)
        assert published == f"{published_rubber(name, level).small_strain_shear_modulus / 1e6:.3f}"
        assert modulus == f"{law.small_strain_shear_modulus / 1e6:.3f}"
        error = np.abs(fit.residuals / test.stress)[test.strain >= 0.02].max()
        found = (law.mu_inf / 1e6, law.x_0, law.c / 1e6, law.c_3 / 1e6, fit.r_squared, 100 * error)
        assert all(agrees(cell.split()[0], value) for cell, value in zip(cells, found, strict=True)), (
            name,
            level,
            found,
        )


def test_stable_constants_between_levels():
    """Moduli in proportion to the strain level, x_0 by its logarithm."""
    low, between, high = (rubber("EPDM", level) for level in (0.2, 0.25, 0.4))
    for key in ("mu_inf", "mu_0", "c", "c_3"):
        assert getattr(between, key) == pytest.approx(0.75 * getattr(low, key) + 0.25 * getattr(high, key), rel=1e-12)
    assert between.x_0 == pytest.approx(low.x_0**0.75 * high.x_0**0.25, rel=1e-12)


def test_density_can_be_replaced():
    assert published_rubber("CR", 0.2, density=1100.0).density == rubber("CR", density=1100.0).density == 1100.0


@pytest.mark.parametrize("level", [0.09, 0.61, float("nan"), 10])
def test_levels_outside_the_tests_are_refused(level):
    for of in (rubber, published_rubber):
        with pytest.raises(MaterialError, match="strain_level"):
            of("CR", level)


def test_unknown_names_and_terms_are_refused():
    with pytest.raises(MaterialError, match="CR, EPDM, SBR.*'NBR'"):
        rubber("NBR")
    with pytest.raises(MaterialError, match="2 or 3 constants"):
        published_rubber("CR", terms=4)
