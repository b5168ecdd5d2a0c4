"""First loading and stabilised cycles, permanent set, loss factors of loops."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dbvfiv.fit import TensionTest, form_of
from dbvfiv.fit.curves import describe_cycles, hysteresis_loss, loading_tests, read_tests
from dbvfiv.fit.report import describe_fits
from dbvfiv.materials.laws import MaterialError

NEO = form_of("neo-hookean")


@pytest.fixture(autouse=True)
def one_form(monkeypatch):
    """Cycles are looked at, not forms: one of these is fitted."""
    monkeypatch.setattr("dbvfiv.fit.report.all_forms", lambda: [NEO])


@given(st.floats(0.0, 1.2), st.floats(0.01, 0.5), st.floats(-0.2, 1.0), st.floats(1e4, 1e8))
def test_loss_factor_of_a_linear_material(delta, amplitude, mean, modulus):
    """Stress ahead of a sinusoidal strain by delta: the ellipse's tan delta, less 1e-5 for 800 sides."""
    phase = np.linspace(0.0, 2 * np.pi, 801)[:-1] - np.pi / 2
    strain = mean + amplitude * np.sin(phase)
    stress = modulus * amplitude * np.sin(phase + delta)
    lost, factor = hysteresis_loss(strain, stress)
    assert factor == pytest.approx(np.tan(delta), rel=2e-5, abs=1e-9)
    assert lost == pytest.approx(
        np.pi * modulus * amplitude**2 * np.sin(delta), rel=2e-5, abs=1e-9 * modulus * amplitude**2
    )


def _cycle(number, modulus, residual=0.0, top=0.5):
    """A neo-Hookean bar whose rest length has grown by its permanent set; it unloads at 80 % of the stress."""
    outer = np.linspace(0.0, top, 41)
    inner = (1 + outer) / (1 + residual) - 1
    stress = np.where(inner > 0, NEO.columns("uniaxial", inner)[:, 0] * 0.5 * modulus / (1 + residual), 0.0)
    strain = np.concatenate([outer, outer[-2::-1]])
    return TensionTest(strain, np.concatenate([stress, 0.8 * stress[-2::-1]]), cycle=number)


def test_first_and_stabilised_constants_come_back():
    curves = [_cycle(1, 1.0e6), _cycle(2, 0.7e6, 0.03), _cycle(3, 0.6e6, 0.05), _cycle(4, 0.595e6, 0.05)]
    assert [c.set_strain for c in describe_cycles(curves)] == pytest.approx([0.0, 0.03, 0.05, 0.05], abs=3e-3)
    report = describe_fits(curves, law="neo-hookean")
    assert report.first.shear_modulus == pytest.approx(1.0e6, rel=1e-8)
    assert report.chosen.shear_modulus == pytest.approx(0.595e6, rel=0.01)  # the set lies between two rows
    assert describe_fits(curves, law="neo-hookean", cycle="first").first is None
    text = "\n".join(report.lines("r", 1300.0))
    assert "stabilised" in text and "(Mullins)" in text and "loss_factor = " in text
    assert "loss_factor" in report.summary("r", 1300.0)


def test_cycles_are_compared_where_there_are_two_that_can_be_fitted():
    fifth, brief = _cycle(5, 0.6e6), TensionTest(np.array([0.0, 0.1, 0.2]), np.array([0.0, 1e5, 2e5]), cycle=1)
    alone = describe_fits([fifth], law="neo-hookean")
    assert alone.first is None and "Mullins" not in "\n".join(alone.lines("r", 1300.0))
    report = describe_fits([brief, fifth], law="neo-hookean")
    assert report.first is None and report.chosen.shear_modulus == pytest.approx(0.6e6, rel=1e-6)
    assert "first loading: Cycle 1 of the uniaxial test has 2 rows" in "\n".join(report.lines("r", 1300.0))


def test_a_first_cycle_without_stress_is_compared_with_none():
    """A logger that calls its first sample, at rest, cycle 1."""
    first = TensionTest(np.array([0.0]), np.array([0.0]), cycle=1)
    text = "\n".join(describe_fits([first, _cycle(2, 0.6e6)], law="neo-hookean").lines("r", 1300.0))
    assert "stabilised" not in text


def test_a_loop_of_a_biaxial_test_loses_the_work_of_both_directions():
    one = _cycle(2, 0.6e6)
    both = TensionTest(one.strain, one.stress, "biaxial", cycle=2)
    alone, twice = describe_cycles([one, both])
    assert twice.lost == pytest.approx(2.0 * alone.lost) and twice.loss_factor == pytest.approx(alone.loss_factor)


def test_a_set_on_a_row_is_taken_off_exactly():
    curve = _cycle(2, 0.6e6, 0.05)  # a row lies at 5 %
    test = loading_tests([curve])[0]
    assert test.strain[0] > 0.0 and test.strain[-1] == pytest.approx(1.5 / 1.05 - 1)
    np.testing.assert_allclose(test.stress, NEO.columns("uniaxial", test.strain)[:, 0] * 0.3e6, rtol=1e-12)


def test_a_cycle_without_its_way_back_has_no_loss(tmp_path):
    path = tmp_path / "c.csv"
    rows = "".join(f"{n},{s / 10},{n * s / 10}\n" for n in (1, 2) for s in range(6))
    path.write_text("cycle,engineering_strain [-],nominal_stress [MPa]\n" + rows)
    curves = read_tests(path)
    assert all(np.isnan(c.loss_factor) for c in describe_cycles(curves))
    assert loading_tests(curves, "first")[0].stress.max() == pytest.approx(0.5e6)
    assert loading_tests(curves, "last")[0].stress.max() == pytest.approx(1.0e6)


def test_bad_loops_are_refused():
    with pytest.raises(MaterialError, match="gives energy away"):
        hysteresis_loss([0.0, 1.0, 2.0, 1.0], [0.0, 1.0, 3.0, 2.0])
    with pytest.raises(MaterialError, match="greater at its largest strain"):
        hysteresis_loss([0.0, 1.0, 2.0], [0.0, -1.0, -3.0])
    with pytest.raises(MaterialError, match="strains that differ"):
        hysteresis_loss([1.0, 1.0, 1.0], [0.0, 1.0, 3.0])
    with pytest.raises(MaterialError, match="first, last, but 'third'"):
        loading_tests([_cycle(1, 1e6)], "third")
    few = TensionTest([0.0, 0.1, 0.2, 0.1], [0.0, 1.0, 2.0, 0.5], cycle=2)
    with pytest.raises(MaterialError, match="Cycle 2 of the uniaxial test has 2 rows"):
        loading_tests([few])
