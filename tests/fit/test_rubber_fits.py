"""Fits to several kinds of test at once: recovery, Treloar's data, stability, tables that cannot be used."""

from __future__ import annotations

import sys
import tomllib
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dbvfiv.errors import CaseError
from dbvfiv.fit import TensionTest, fit_rubber, form_of
from dbvfiv.fit.curves import MODES, loading_tests, read_curves, read_tests
from dbvfiv.fit.report import describe_fits, toml_table
from dbvfiv.fit.rubber import LEAST_MARGIN, RAYS
from dbvfiv.materials.energy import rubber_energy
from dbvfiv.materials.laws import MaterialError
from dbvfiv.materials.shipped import published_rubber, rubber_names, strain_levels
from dbvfiv.materials.stability import hill_margin
from dbvfiv.studies.case import load_case

TRELOAR = Path(__file__).parent / "treloar.csv"
REACH = {"uniaxial": 4.0, "planar": 3.0, "biaxial": 2.0}
LAWS = [
    ("neo-hookean", [0.26e6], ()),
    ("mooney-rivlin", [0.18e6, 0.012e6], ()),
    ("mooney-rivlin", [-2.0e6, 2.6e6, 0.9e6], ()),
    ("yeoh", [0.18e6, -1.4e3], ()),
    ("yeoh", [0.18e6, -1.4e3, 39.0], ()),
    ("softening", [0.2e6, 0.5e6, 1e4, 1e2], [0.3]),
    ("ogden", [0.4e6], [1.7]),
    ("ogden", [0.62e6, -0.01e6], [1.3, -2.0]),
    ("ogden", [1180.0, 0.62e6, -9800.0], [5.0, 1.3, -2.0]),
]


def _tests(form, constants, exponents, modes=MODES, points=25):
    tests = []
    for mode in modes:
        strain = np.linspace(0.0, REACH[mode], points + 1)[1:]
        tests.append(TensionTest(strain, form.columns(mode, strain, exponents) @ np.array(constants), mode))
    return tests


def _energy(form, constants, exponents, ln):
    if form.name == "softening":
        x = jnp.sum(jnp.exp(2 * ln)) - 3
        knee = 2 * exponents[0] * (jnp.sqrt(1 + x / exponents[0]) - 1)
        return (constants[0] * x + constants[1] * knee + constants[2] * x**2 / 2 + constants[3] * x**3 / 3) / 2
    if form.name == "ogden":
        return sum(m / a * (jnp.sum(jnp.exp(a * ln)) - 3) for m, a in zip(constants, exponents))
    i1, i2 = jnp.sum(jnp.exp(2 * ln)) - 3, jnp.sum(jnp.exp(-2 * ln)) - 3
    powers = ((int(name[1]), int(name[2])) for name in form.names)
    return sum(c * i1**i * i2**j for c, (i, j) in zip(constants, powers))


# those of most terms: the others have some of their columns
@pytest.mark.parametrize("name, constants, exponents", [LAWS[2], LAWS[4], LAWS[5], LAWS[8]])
def test_stresses_and_moduli_are_derivatives_of_the_energy(name, constants, exponents):
    form = form_of(name, len(constants))
    slope, curvature = (jax.jit(d(lambda x: _energy(form, constants, exponents, x))) for d in (jax.grad, jax.hessian))
    for mode in MODES:
        ray = np.array(RAYS[mode])
        for stretch in (0.8, 1.05, 1.9):
            ln = jnp.asarray(np.log(stretch) * ray)
            tau = np.asarray(slope(ln))
            stress = form.columns(mode, [stretch - 1], exponents) @ np.array(constants)
            assert stress[0] == pytest.approx((tau[0] - tau[2]) / stretch, rel=1e-9)
            second = np.asarray(curvature(ln))
            basis = np.array([[1, -1, 0], [1, 1, -2]]) / np.sqrt([[2], [6]])
            moduli = np.tensordot(form.moduli(np.asarray(ln), exponents), constants, axes=([0], [0]))
            scale = np.abs(second).max()
            np.testing.assert_allclose(moduli[:2, :2], basis @ second @ basis.T, rtol=0, atol=1e-11 * scale)
            across = (tau[0] - tau[2]) / float(ln[0] - ln[2])
            assert moduli[3, 3] == pytest.approx(across, abs=1e-10 * scale)


@pytest.mark.parametrize("name, constants, exponents", [*LAWS[:-1], pytest.param(*LAWS[-1], marks=pytest.mark.slow)])
def test_constants_of_every_form_come_back(name, constants, exponents):
    form = form_of(name, len(constants))
    fit = fit_rubber(_tests(form, constants, exponents), form)
    np.testing.assert_allclose(fit.constants, constants, rtol=1e-8)
    np.testing.assert_allclose(fit.exponents, exponents, rtol=1e-8)
    assert fit.r_squared == pytest.approx(1.0, abs=1e-12) and not fit.active


@pytest.mark.parametrize("error", ["absolute", "relative"])
def test_one_kind_of_test_is_enough_without_scatter(error):
    form = form_of("yeoh")
    fit = fit_rubber(_tests(form, [0.2e6, -2e3, 60.0], (), ["biaxial"]), form, error=error)
    np.testing.assert_allclose(fit.constants, [0.2e6, -2e3, 60.0], rtol=1e-8)


@pytest.mark.parametrize("name, exponents, constants", [("ogden", [2.3], [1.0]), ("softening", [0.3], [1, 1, 1, 1])])
def test_slopes_by_exponents_are_derivatives(name, exponents, constants):
    form = form_of(name, len(constants))
    for mode in MODES:
        step = 1e-6
        below, above = (form.columns(mode, [0.7], [exponents[0] + s]) @ constants for s in (-step, step))
        slope = form.slopes(mode, [0.7], exponents, constants)
        assert slope[0, 0] == pytest.approx((above - below)[0] / (2 * step), rel=1e-8)


@pytest.fixture(scope="module")
def treloar():
    return loading_tests(read_tests(TRELOAR))


# Fits to one test of this table each, MPa, as the examples of the open-source library simcoon quote them: neo-Hookean
# mu, Mooney-Rivlin C10 and C01.
QUOTED = {
    "uniaxial": (0.5673, 0.2588, -0.0449),
    "planar": (0.3360, 0.2348, -0.065),
    "biaxial": (0.4104, 0.1713, 0.0047),
}


def test_treloar_fits_to_one_test_each(treloar):
    """Two of the quoted fits are those of least squares, to their digits; none leaves less than ours."""
    for test in treloar:
        neo, c10, c01 = (1e6 * value for value in QUOTED[test.mode])
        for form, quoted in ((form_of("neo-hookean"), [neo / 2]), (form_of("mooney-rivlin", 2), [c10, c01])):
            if test.mode == "planar" and form.terms == 2:
                continue  # both columns are the same there
            left = test.stress - form.columns(test.mode, test.strain) @ np.array(quoted)
            assert fit_rubber([test], form).rms <= np.sqrt(np.mean(left**2)) * (1 + 1e-12)
    assert fit_rubber(treloar[:1], form_of("neo-hookean")).shear_modulus / 1e6 == pytest.approx(0.5673, abs=2e-4)
    pair = fit_rubber(treloar[2:], form_of("mooney-rivlin", 2))
    np.testing.assert_allclose(pair.constants / 1e6, [0.1713, 0.0047], rtol=0, atol=5e-5)


def test_planar_tension_alone_cannot_tell_c10_from_c01(treloar):
    with pytest.raises(MaterialError, match="cannot be told apart"):
        fit_rubber(treloar[1:2], form_of("mooney-rivlin", 2))


@pytest.mark.slow
def test_treloar_residuals_are_no_greater_than_the_reference_ones(treloar):
    """Three terms of Ogden (1972) for the same tests: 6.3, 0.012, -0.1 kgf/cm2 with 1.3, 5, -2."""
    published = np.array([6.3, 0.012, -0.1]) * 0.0980665e6
    left = np.concatenate(
        [t.stress - form_of("ogden", 3).columns(t.mode, t.strain, [1.3, 5.0, -2.0]) @ published for t in treloar]
    )
    ours = fit_rubber(treloar, form_of("ogden", 3))
    assert ours.rms < 0.3 * np.sqrt(np.mean(left**2))
    assert ours.rms / 1e6 == pytest.approx(0.0629, abs=2e-4)
    stress = np.concatenate([t.stress for t in treloar])
    relative = fit_rubber(treloar, form_of("ogden", 3), error="relative")
    assert np.linalg.norm(relative.residuals / stress) < np.linalg.norm(left / stress)
    assert fit_rubber(treloar, form_of("yeoh", 3)).rms / 1e6 == pytest.approx(0.1451, abs=2e-4)
    assert fit_rubber(treloar, form_of("neo-hookean")).rms / 1e6 == pytest.approx(0.6309, abs=2e-4)


@pytest.mark.parametrize("level", strain_levels())
@pytest.mark.parametrize("name", rubber_names())
def test_shipped_sets_are_reproduced_by_their_own_curves(name, level):
    law = published_rubber(name, level)
    form = form_of("mooney-rivlin", 3)
    strain = np.linspace(0.0, level, 31)[1:]
    tests = [TensionTest(strain, form.columns(mode, strain) @ law.parameters[:3], mode) for mode in MODES]
    for chosen in (tests, tests[:1]):
        fit = fit_rubber(chosen, form)
        np.testing.assert_allclose(fit.constants, [law.c10, law.c01, law.c11], rtol=1e-8)


SCATTER = st.integers(0, 10**6)
FORMS = st.sampled_from([("mooney-rivlin", 2), ("mooney-rivlin", 3), ("yeoh", 3), ("yeoh", 2)])


@settings(max_examples=15, deadline=None)
@given(FORMS, SCATTER, st.sampled_from([MODES, ("uniaxial",), ("uniaxial", "planar")]), st.floats(0.05, 2.0))
def test_stable_holds_over_the_range_it_promises(which, seed, modes, far):
    """Softening curves with scatter, which a free fit answers with constants of opposite sign."""
    rng = np.random.default_rng(seed)
    form = form_of(*which)
    tests = []
    for mode in modes:
        strain = np.linspace(0.0, far / (2.0 if mode == "biaxial" else 1.0), 14)[1:]
        softer = 1.0 - rng.uniform(0.0, 0.7) * strain / far
        stress = form_of("neo-hookean").columns(mode, strain)[:, 0] * 0.3e6 * softer
        tests.append(TensionTest(strain, stress * (1 + 0.03 * rng.normal(size=13)), mode))
    fit = fit_rubber(tests, form, "stable")
    angle, radius = rng.uniform(0, 2 * np.pi, 2000), fit.reach * np.sqrt(rng.uniform(0, 1, 2000))
    states = radius[:, None] * np.stack([np.cos(angle - k * 2 * np.pi / 3) for k in range(3)], axis=-1)
    assert fit.shear_modulus > 0
    assert hill_margin(fit.law(1.0), states).min() > 0.5 * LEAST_MARGIN
    free = fit_rubber(tests, form)
    assert free.rms <= fit.rms * (1 + 1e-9)


def test_the_fitted_law_of_a_wall_is_the_fit(treloar):
    """Stress of thin sheets by the energy that the wall integrates against those of the fit."""
    slope = jax.jit(jax.grad(rubber_energy, argnums=1))
    for name, terms in (("neo-hookean", 1), ("mooney-rivlin", 3), ("yeoh", 2), ("yeoh", 3)):
        fit = fit_rubber(treloar, form_of(name, terms), "stable")
        law = fit.law(1300.0)
        assert law.small_strain_shear_modulus == pytest.approx(fit.shear_modulus, rel=1e-12)
        across = {"uniaxial": lambda l: l**-0.5, "planar": lambda l: 1.0, "biaxial": lambda l: l}
        for mode in MODES:
            for stretch in (1.1, 1.8):
                e = jnp.array([(stretch**2 - 1) / 2, (across[mode](stretch) ** 2 - 1) / 2, 0.0, 0.0, 0.0])
                second = slope(law.parameters, e)[0]
                assert stretch * second == pytest.approx(fit.stress(mode, [stretch - 1])[0], rel=1e-10)


def test_stable_and_non_negative_ogden():
    form = form_of("ogden", 2)
    strain = np.linspace(0.05, 1.0, 12)
    stress = form.columns("uniaxial", strain, [2.0, 3.0]) @ np.array([0.9e6, -0.35e6])
    tests = [TensionTest(strain, stress)]
    stable = fit_rubber(tests, form, "stable")
    positive = fit_rubber(tests, form, "non-negative")
    assert stable.active and positive.active
    assert np.all(positive.constants * positive.exponents >= 0.0)
    assert stable.stable_range.equivalent_strain >= stable.reach
    assert positive.stable_range.equivalent_strain == np.inf
    assert stable.rms <= positive.rms * (1 + 1e-6)


@pytest.mark.slow
def test_the_best_form_for_a_wall_is_told_and_its_table_can_be_pasted(treloar):
    report = describe_fits(read_tests(TRELOAR), constraint="stable")
    assert report.chosen.form.name == "softening"
    assert report.chosen.stable_range.equivalent_strain == np.inf
    assert "stable in every state by its form" in "\n".join(report.lines("r", 1.0))
    assert report.first is None and not report.cycles


def test_a_workbook_is_read_like_its_table(tmp_path, monkeypatch):
    """Titles of two lines, empty rows and columns, formulas without a value, remarks."""
    from openpyxl import Workbook

    book, (head, *rows) = Workbook(), [line.split(",") for line in TRELOAR.read_text().splitlines() if line[0] != "#"]
    book.active.append(["# the laboratory's remark"])
    book.active.append([title.strip().replace(" [", "\n[") for title in head] + ["=1+1"])
    book.active.append([])
    for test, *numbers in rows:
        book.active.append([test, *map(float, numbers)])
    path = tmp_path / "treloar.xlsx"
    book.save(path)
    for found, expected in zip(read_curves(path), read_curves(TRELOAR), strict=True):
        assert found.mode == expected.mode
        assert np.array_equal(found.strain, expected.strain) and np.array_equal(found.stress, expected.stress)
    book.active["C6"] = "=A1"
    book.save(path)
    with pytest.raises(MaterialError, match="line 6: column nominal_stress must hold a finite number, but ''"):
        read_curves(path)
    path.write_text("no workbook")
    with pytest.raises(MaterialError, match="is not a workbook"):
        read_curves(path)
    monkeypatch.setitem(sys.modules, "openpyxl", None)
    with pytest.raises(MaterialError, match=r"needs the package openpyxl \(pip install 'dbvfiv\[fit\]'\)"):
        read_curves(path)


def test_the_table_of_a_rubber_without_a_knee_is_read_by_a_case():
    """The softening form of neo-Hookean curves keeps mu_inf alone."""
    strain = np.linspace(0.02, 0.6, 20)
    tests = [TensionTest(strain, form_of("neo-hookean").columns("uniaxial", strain)[:, 0] * 0.3e6)]
    fit = fit_rubber(tests, form_of("softening"))
    assert fit.law(1300.0).small_strain_shear_modulus == pytest.approx(0.6e6, rel=1e-6)
    given = tomllib.loads("\n".join(toml_table(fit, "SOFT", 1300.0)))["materials"]["SOFT"]
    card = load_case(None).replace({"materials.SOFT": given}).materials.named["SOFT"]
    assert card.mu_inf + card.mu_0 == pytest.approx(0.6e6, rel=1e-6)
    with pytest.raises(CaseError, match="mu_0 is 0 Pa beside mu_inf = 0 Pa; mu_inf . mu_0 must be greater than 0"):
        load_case(None).replace({"materials.SOFT": given | {"mu_0": 0.0, "mu_inf": 0.0}})


def test_a_cell_of_a_workbook_that_shows_a_per_cent_is_one(tmp_path):
    """It holds a fraction, which the unit of the column must not divide by 100 once more."""
    from openpyxl import Workbook

    book, path = Workbook(), tmp_path / "tension.xlsx"
    for row in (("engineering_strain [%]", "nominal_stress [MPa]"), (0.05, 1.0), (10.0, 2.0), (15.0, 3.0)):
        book.active.append(row)
    book.active["A2"].number_format, book.active["A4"].number_format = "0.0%", '0" %"'
    book.save(path)
    assert read_curves(path)[0].strain == pytest.approx([0.05, 0.1, 0.15], rel=1e-14)
    book.active["B3"].number_format = "0%"
    book.save(path)
    with pytest.raises(MaterialError, match="line 3: column nominal_stress must hold a finite number, but '200%' was"):
        read_curves(path)


def test_bad_questions_are_refused(tmp_path, treloar):
    with pytest.raises(MaterialError, match="neo-hookean, softening, mooney-rivlin, yeoh, ogden, but 'gent'"):
        form_of("gent")
    with pytest.raises(MaterialError, match="Yeoh fit has 2 or 3 terms, but 4"):
        form_of("yeoh", 4)
    with pytest.raises(MaterialError, match="absolute, relative, but 'least'"):
        fit_rubber(treloar, form_of("yeoh"), error="least")
    with pytest.raises(MaterialError, match="uniaxial, planar, biaxial, but 'shear'"):
        TensionTest([0.1], [1.0], "shear")
    with pytest.raises(MaterialError, match="holds a planar test already"):
        read_tests(TRELOAR, planar=TRELOAR)
    with pytest.raises(MaterialError, match="has a column test, so it cannot be given as planar"):
        read_curves(TRELOAR, "planar")
    with pytest.raises(MaterialError, match="needs the law"):
        describe_fits(read_tests(TRELOAR), terms=3)
    plain = tmp_path / "t.csv"
    plain.write_text("stretch [-],nominal_stress [Pa]\n1.1,2\n")
    with pytest.raises(MaterialError, match="at least 2 different strains"):
        fit_rubber(loading_tests(read_tests(plain)), form_of("neo-hookean"))
    plain.write_text("stretch [-],nominal_stress [Pa]\n1.1,2\n1.2,0\n1.3,0\n")
    with pytest.raises(MaterialError, match="at least 2 different strains other than zero, with stress"):
        fit_rubber(loading_tests(read_tests(plain)), form_of("neo-hookean"), error="relative")
    with pytest.raises(MaterialError, match="No fit finds a positive stiffness"):
        describe_fits(loaded(tmp_path))


def loaded(folder):
    path = folder / "falling.csv"
    path.write_text("stretch [-],nominal_stress [Pa]\n" + "".join(f"{1 + s / 10},{-s}\n" for s in range(1, 4)))
    return read_tests(path)
