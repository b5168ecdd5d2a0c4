"""Ply constants from constituents."""

from __future__ import annotations

import pytest

from dbvfiv.materials.laws import MaterialError, fibre_ply, halpin_tsai, ply_from_constituents


def test_limits_are_series_and_parallel_means():
    fibre, matrix, f = 70e9, 3e9, 0.6
    assert halpin_tsai(fibre, matrix, f, 0.0) == pytest.approx(1 / (f / fibre + (1 - f) / matrix), rel=1e-14)
    assert halpin_tsai(fibre, matrix, f, 1e15) == pytest.approx(f * fibre + (1 - f) * matrix, rel=1e-12)
    assert halpin_tsai(matrix, matrix, f, 2.0) == pytest.approx(matrix, rel=1e-14)


def test_agrees_with_the_usual_form_of_the_equation():
    fibre, matrix, f, xi = 70e9, 3e9, 0.4, 2.0
    eta = (fibre / matrix - 1) / (fibre / matrix + xi)
    usual = matrix * (1 + xi * eta * f) / (1 - eta * f)
    assert halpin_tsai(fibre, matrix, f, xi) == pytest.approx(usual, rel=1e-13)


def test_program_constants_meet_the_printed_ones_but_for_their_places():
    """Within rounding, except e1 (0.3 %) and the exchange of shear moduli and Poisson ratios."""
    program, table = fibre_ply("program"), fibre_ply("table")
    assert program.e1 == pytest.approx(1553.788e6, rel=1e-6)
    assert program.e1 == pytest.approx(table.e1, rel=0.003)
    assert program.e2 == pytest.approx(table.e2, abs=0.005e6)
    assert program.g12 == pytest.approx(5.566838e6, rel=1e-6)
    assert program.g12 == pytest.approx(table.g23, abs=0.005e6)
    assert program.g13 == program.g23 == pytest.approx(table.g12, abs=0.005e6)
    assert program.nu12 == pytest.approx(0.2820, abs=5e-5)
    assert table.nu12 == 0.27
    assert program.density == table.density == 1270.0


@pytest.mark.parametrize(
    "change",
    [
        {"fibre_fraction": 1.0},
        {"fibre_fraction": 0.0},
        {"fibre_modulus": -1.0},
        {"matrix_modulus": 0.0},
        {"fibre_poisson": 0.0},
        {"matrix_poisson": 0.6},
        {"xi": -1.0},
        {"density": 0.0},
    ],
)
def test_impossible_constituents_are_refused(change):
    with pytest.raises(MaterialError, match=next(iter(change))):
        ply_from_constituents(**change)


def test_unknown_choice_is_refused():
    with pytest.raises(MaterialError, match="program, table.*'book'"):
        fibre_ply("book")
