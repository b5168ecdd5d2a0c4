"""Distributions as words: values against those of scipy, relative forms, shares outside of limits, refusals."""

import numpy as np
import pytest
from scipy import stats
from scipy.special import ndtri

from dbvfiv.case.distribution import Distribution, with_full_names
from dbvfiv.case.quantity import Quantity

PLAIN, LENGTH, PERCENT = Quantity(""), Quantity("m", "mm"), Quantity("", "%")
SHARES = np.array([0.001, 0.025, 0.3, 0.5, 0.84, 0.999])


@pytest.mark.parametrize(
    ("text", "own", "expected"),
    [
        ("normal(2, 0.5)", None, stats.norm(2, 0.5)),
        ("normal(5 %)", 20.0, stats.norm(20, 1)),
        ("lognormal(1.2)", 0.5, stats.lognorm(np.log(1.2), scale=0.5)),
        ("lognormal(3, 1.5)", None, stats.lognorm(np.log(1.5), scale=3)),
        ("uniform(-10 %, 20 %)", 5.0, stats.uniform(4.5, 1.5)),
        ("uniform(1, 4)", None, stats.uniform(1, 3)),
    ],
)
def test_values_are_those_of_their_probability(text, own, expected):
    found = Distribution.parse(text, PLAIN, own)
    np.testing.assert_allclose(found.at(ndtri(SHARES)), expected.ppf(SHARES), rtol=1e-12)
    low, high = expected.ppf(0.03), expected.ppf(0.9)
    assert found.share_outside(low, high) == pytest.approx(0.13, rel=1e-9)
    assert found.median == pytest.approx(expected.median(), rel=1e-12)
    slope = np.diff(found.at(np.array([-1e-6, 1e-6])))[0] / 2e-6
    assert found.spread == pytest.approx(expected.std() if found.form == "uniform" else slope, rel=1e-6)


def test_units_are_read():
    found = Distribution.parse("normal(2 mm, 0.1 mm)", LENGTH)
    assert found.numbers == (2e-3, 1e-4) and found.words(LENGTH) == "normal(2 mm, 0.1 mm)"


@pytest.mark.parametrize(
    ("text", "own", "numbers"),
    [
        ("uniform(10 %, 20 %)", 0.1, (0.1, 0.2)),
        ("uniform(10 %, 20 %)", None, (0.1, 0.2)),
        ("normal(45 %, 2 %)", 0.4, (0.45, 0.008)),
        ("normal(45 %, 0.02)", None, (0.45, 0.02)),
        ("normal(5 %)", 0.4, (0.4, 0.02)),
        ("lognormal(45 %, 1.1)", 0.4, (0.45, 1.1)),
        ("samples(40 %, 50 %)", 0.4, (0.4, 0.5)),
    ],
)
def test_numbers_given_in_per_cent_are_values_where_they_are_no_spread(text, own, numbers):
    assert Distribution.parse(text, PERCENT, own).numbers == pytest.approx(numbers, rel=1e-12)
    with pytest.raises(ValueError, match="relative to the value of the case"):
        Distribution.parse("normal(45 %, 2 %)", PERCENT, None)


def test_heads_are_of_the_fluid_of_the_case():
    pressure = Quantity("Pa", "kPa", head=True)
    found = Distribution.parse("normal(1 m, 0.1 m)", pressure, 18e3, 800.0)
    assert found.numbers == pytest.approx((7845.32, 784.532), rel=1e-12)
    assert Distribution.parse("uniform(1 m, 2 m)", pressure, 18e3, 800.0).numbers == pytest.approx((7845.32, 15690.64))


def test_samples_come_from_a_list_or_a_file(tmp_path):
    listed = Distribution.parse("samples(3, 1, 2, 2)", PLAIN)
    assert listed.at(ndtri(np.array([0.1, 0.3, 0.6, 0.9]))).tolist() == [1, 2, 2, 3]
    (tmp_path / "gaps.txt").write_text("# mm\n1 mm\n3 mm\n")
    many = f"samples({', '.join(f'{0.1 + number / 1000:.8g}' for number in range(64))})"
    assert with_full_names(many, tmp_path) == many
    folder = tmp_path / "Valves, 2024"  # a comma in a name is no list of values
    folder.mkdir()
    (folder / "gaps.txt").write_text("0.1\n0.2\n0.3\n")
    assert Distribution.parse(with_full_names("samples(gaps.txt)", folder), LENGTH).numbers == (0.1, 0.2, 0.3)
    text = with_full_names("samples(gaps.txt)", tmp_path)
    assert Distribution.parse(text, LENGTH).numbers == (1e-3, 3e-3)
    assert listed.share_outside(1.5, 3.0) == 0.25


@pytest.mark.parametrize("text", ["300,5\n310,25\n", "1, 300.5\n2, 310.25\n"])
def test_a_line_that_is_no_number_is_no_sample(tmp_path, text):
    """Decimals behind a comma and a second column are none either."""
    (tmp_path / "speeds.txt").write_text(text)
    with pytest.raises(ValueError, match="is not a number|which is no"):
        Distribution.parse(f"samples({tmp_path / 'speeds.txt'})", PLAIN)


@pytest.mark.parametrize("quantity", [PLAIN, LENGTH, PERCENT])
@pytest.mark.parametrize("found", [("normal", 0.2, 0.02), ("lognormal", 0.2, 1.1), ("uniform", 0.2, 0.3)])
def test_words_are_read_as_what_they_tell(quantity, found):
    form, *numbers = found
    words = Distribution(form, tuple(numbers)).words(quantity)
    assert Distribution.parse(words, quantity, 0.4).numbers == pytest.approx(numbers, rel=1e-12)


@pytest.mark.parametrize(
    ("text", "own", "clause"),
    [
        ("gamma(1, 2)", 1.0, "no distribution"),
        ("normal", 1.0, "no distribution"),
        ("normal(1, -2)", 1.0, "not greater than 0"),
        ("normal(5 %)", None, "relative to the value of the case"),
        ("normal(1, 2, 3)", 1.0, "3 arguments"),
        ("lognormal(0.8)", 1.0, "not greater than 1"),
        ("lognormal(-1, 1.2)", 1.0, "not greater than 0"),
        ("uniform(2, 1)", 1.0, "do not rise"),
        ("uniform(2)", 1.0, "1 arguments"),
        ("samples(missing.txt)", 1.0, "does not exist"),
        ("samples(1,)", 1.0, "fewer than two"),
        ("samples(1, 1)", 1.0, "all the same"),
        ("normal(1 kg, 2)", 1.0, "not"),
        (7, 1.0, "no distribution"),
    ],
)
def test_what_is_no_distribution_is_refused(text, own, clause):
    with pytest.raises(ValueError, match=clause):
        Distribution.parse(text, PLAIN, own)
