"""Reading tension tests and fitting constants to them."""

from __future__ import annotations

import numpy as np
import pytest

from dbvfiv.fit import TensionTest, fit_rubber, form_of, uniaxial_stress
from dbvfiv.fit.curves import read_curves, read_tests
from dbvfiv.materials.laws import MaterialError, MooneyRivlin
from dbvfiv.materials.shipped import published_rubber
from dbvfiv.materials.stability import stable_range


def _test_of(law, largest, count=30, noise=0.0, seed=0):
    strain = np.linspace(0.0, largest, count + 1)[1:]
    stress = uniaxial_stress(law, 1 + strain)
    return TensionTest(strain, stress + noise * np.random.default_rng(seed).normal(size=count))


def _columns(test):
    return form_of("mooney-rivlin", 3).columns(test.mode, test.strain)


def fitted(test, terms=3, *options, **more):
    return fit_rubber([test], form_of("mooney-rivlin", terms), *options, **more)


def test_two_constants_come_back_from_a_file(tmp_path):
    law = MooneyRivlin(0.3e6, 0.1e6, 0.0, 1300.0)
    path = tmp_path / "tension.csv"
    strains = np.linspace(0.02, 0.5, 12)
    lines = [
        f"{p / 1e6!r}\tx\t{100 * s!r}" for s, p in zip(strains.tolist(), uniaxial_stress(law, 1 + strains).tolist())
    ]
    path.write_text("# fifth loading\n\nNominal stress [MPa]\tremark\tengineering_strain (%)\n" + "\n".join(lines))
    test = read_tests(path)[0]
    np.testing.assert_allclose(test.strain, strains, rtol=1e-14)
    fit = fitted(test, 2)
    np.testing.assert_allclose(fit.constants, [0.3e6, 0.1e6], rtol=1e-10)
    assert fit.law(1000.0) == MooneyRivlin(*map(float, fit.constants), 0.0, 1000.0)


@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_separators_and_stretch(tmp_path, separator):
    path = tmp_path / "t.csv"
    path.write_text(f"stretch [-]{separator}nominal_stress [kPa]\n1.5{separator}2\n2{separator}3e0\n")
    test = read_tests(path)[0]
    np.testing.assert_allclose(test.strain, [0.5, 1.0])
    np.testing.assert_allclose(test.stress, [2000.0, 3000.0])


def test_condition_number_tells_short_tests_from_long_ones():
    law = MooneyRivlin(0.3e6, 0.1e6, 0.0, 1300.0)
    short = fitted(_test_of(law, 0.1)).condition_number
    long = fitted(_test_of(law, 2.0)).condition_number
    assert short > 10 * long
    raw = _columns(_test_of(law, 0.1))
    assert short == pytest.approx(np.linalg.cond(raw / np.linalg.norm(raw, axis=0)), rel=1e-6)


def test_covariance_is_that_of_repeated_tests():
    law, noise = MooneyRivlin(0.3e6, 0.1e6, 0.02e6, 1300.0), 2e3
    fits = [fitted(_test_of(law, 1.0, noise=noise, seed=s)) for s in range(400)]
    seen = np.std([f.constants for f in fits], axis=0)
    told = np.mean([f.standard_errors for f in fits], axis=0)
    np.testing.assert_allclose(told, seen, rtol=0.15)  # 400 samples: standard error 3.5 %


def test_non_negative_constants_are_the_best_of_their_kind():
    test = _test_of(published_rubber("EPDM", 0.40), 0.4)
    fit = fitted(test, 3, "non-negative")
    assert fit.active and fit.constants.min() == 0.0
    assert stable_range(fit.law(1300.0)).equivalent_strain == np.inf
    columns = _columns(test)
    slope = columns.T @ fit.residuals
    assert np.all(slope[fit.constants == 0.0] <= 0.0)
    np.testing.assert_allclose(slope[fit.constants > 0.0], 0.0, atol=1e-8 * np.abs(slope).max())


@pytest.mark.parametrize("terms, name, level", [(3, "SBR", 0.10), (3, "EPDM", 0.40), (2, "EPDM", 0.40)])
def test_stable_fit_is_stable_as_far_as_asked_and_no_worse_than_need_be(terms, name, level):
    test = _test_of(published_rubber(name, level), level)
    free, fit = (fitted(test, terms, c) for c in ("none", "stable"))
    assert stable_range(free.law(1.0)).equivalent_strain < np.log1p(level) or not fit.active
    assert stable_range(fit.law(1.0)).equivalent_strain >= np.log1p(level)
    positive = fitted(test, terms, "non-negative")
    assert free.r_squared >= fit.r_squared > positive.r_squared
    # a step towards the free fit is better, and must leave the stable set
    if fit.active:
        constants = fit.constants + 0.05 * (free.constants - fit.constants)
        step = MooneyRivlin(*constants, *([0.0] * (3 - terms)), 1.0)
        assert stable_range(step).equivalent_strain < np.log1p(level)


def test_stable_reach_can_be_chosen():
    test = _test_of(published_rubber("SBR", 0.10), 0.1)
    near = fitted(test, 3, "stable", stable_to=0.05)
    far = fitted(test, 3, "stable", stable_to=0.5)
    assert near.r_squared > far.r_squared
    assert stable_range(far.law(1.0)).equivalent_strain >= np.log(1.5)


HEAD = "test, stretch [-], nominal_stress [MPa]\n"


@pytest.mark.parametrize(
    "text, words",
    [
        ("", "is empty"),
        ("# only a remark\n", "is empty"),
        ("a,b\n1,2\n", "header must name engineering_strain"),
        ("engineering_strain [%],force [N]\n1,2\n", "nominal_stress"),
        ("engineering_strain,nominal_stress [Pa]\n1,2\n", "no unit is given"),
        ("engineering_strain [%],nominal_stress [bar]\n1,2\n", "'bar' is not known"),
        ("engineering_strain [%],stretch [-],nominal_stress [Pa]\n1,1,2\n", "not both"),
        ("stretch [-],stretch [-],nominal_stress [Pa]\n1,1,2\n", "twice"),
        ("engineering_strain [%],nominal_stress [Pa]\n", "no row of numbers"),
        ("engineering_strain [%],nominal_stress [Pa]\n1,2\n3,abc\n", "line 3: column nominal_stress.*'abc'"),
        ("engineering_strain [%],nominal_stress [Pa]\n1\n", "line 2: column nominal_stress.*''"),
        ("engineering_strain [%],nominal_stress [Pa]\n1,inf\n", "line 2.*'inf'"),
        ("engineering_strain [%],nominal_stress [Pa]\n-100,2\n", "greater than -1"),
        (HEAD + "shear, 1.1, 2\n", "line 2: column test must hold one of uniaxial, planar, biaxial, but 'shear'"),
        (HEAD + ", 1.1, 2\n", "column test.*''"),
        ("cycle, " + HEAD + "0, planar, 1.1, 2\n", "column cycle must hold a whole number from 1, but '0'"),
        ("cycle, " + HEAD + "1.5, planar, 1.1, 2\n", "whole number"),
        ("cycle, " + HEAD + "x, planar, 1.1, 2\n", "whole number.*'x'"),
        ("test, stretch, nominal_stress [MPa]\n", "no unit is given"),
        ("test, stretch [-]\nplanar, 1.1\n", "nominal_stress"),
    ],
)
def test_bad_files_are_refused_with_the_place(tmp_path, text, words):
    path = tmp_path / "bad.csv"
    path.write_text(text)
    with pytest.raises(MaterialError, match=words) as caught:
        read_tests(path)[0]
    assert str(path) in str(caught.value) and "\n" not in str(caught.value)


def test_unreadable_files_are_refused(tmp_path):
    with pytest.raises(MaterialError, match="cannot be read: No such file"):
        read_tests(tmp_path / "none.csv")
    with pytest.raises(MaterialError, match="cannot be read"):
        read_tests(tmp_path)
    (tmp_path / "binary.csv").write_bytes(b"\xff\xfe\x00\x81")
    with pytest.raises(MaterialError, match="UTF-8"):
        read_tests(tmp_path / "binary.csv")


@pytest.mark.parametrize("title", ["cycle", "cycle [-]", "Cycle (-)", "cycle [1]", "CYCLE []"])
def test_cycles_are_told_by_a_column_with_any_unit(tmp_path, title):
    (tmp_path / "t.csv").write_text(f"{title}, stretch [-], nominal_stress [MPa]\n1, 1.1, 2\n2, 1.1, 1\n2, 1.2, 1.5\n")
    assert [(test.cycle, len(test.strain)) for test in read_curves(tmp_path / "t.csv")] == [(1, 1), (2, 2)]


def test_bad_questions_are_refused():
    test = _test_of(published_rubber("CR", 0.2), 0.2)
    with pytest.raises(MaterialError, match="2 or 3 terms"):
        fitted(test, 4)
    with pytest.raises(MaterialError, match="none, non-negative, stable"):
        fitted(test, 3, "positive")
    with pytest.raises(MaterialError, match="stable_to"):
        fitted(test, 3, "stable", stable_to=0.0)
    with pytest.raises(MaterialError, match="at least 4 different strains.*has 3"):
        fitted(TensionTest([0.0, 0.1, 0.2, 0.2, 0.3], [0.0, 1.0, 2.0, 2.0, 3.0]), 3)
    with pytest.raises(MaterialError, match="shear modulus"):
        fitted(TensionTest(test.strain, -test.stress), 2).law(1300.0)
    with pytest.raises(MaterialError, match="as many strains"):
        TensionTest([0.1], [1.0, 2.0])
    with pytest.raises(MaterialError, match="finite"):
        TensionTest([0.1], [np.nan])
