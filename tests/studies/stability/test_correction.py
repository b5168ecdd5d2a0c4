"""Onsets of a column brought to the full matrices, on a family whose growth rate is known."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from dbvfiv.errors import SolveError
from dbvfiv.studies.stability.line import OnsetCorrection

#: Neutral at 2, at 10 rad/s; the small model has it at 2.02.
EXACT, SMALL = 2.0, 2.02


def pair(value, neutral):
    return np.array([complex(3.0 * (value - neutral), 10.0)])


def corrected_by(values, shift=SMALL - EXACT):
    def nearest(condition, place):
        found = values(condition)
        return complex(found[np.argmin(np.abs(found - place))]) if found.size else complex(np.nan)

    change = complex(3.0 * shift, 0.0)
    column = SimpleNamespace(
        nearest=nearest,
        corrected=lambda condition, values: np.full(len(values), change),
        exact=lambda condition, found: found + change,
    )
    return OnsetCorrection(column, lambda value: value, lambda value: pair(value, EXACT))


def test_small_models_with_corrections():
    value, frequency, left = corrected_by(lambda value: pair(value, SMALL))(SMALL, 10.0 / (2 * np.pi))
    assert value == pytest.approx(EXACT, abs=1e-9) and frequency == pytest.approx(10.0 / (2 * np.pi)) and left < 1e-8


def test_a_correction_that_errs_by_more_than_it_changes_gives_way_to_the_full_matrices():
    """At growth rates that hardly change along the line 1e-6 of an eigenvalue is 1e-4 of the onset."""
    small = EXACT + 1e-6
    right = corrected_by(lambda value: pair(value, small), small - EXACT)
    wrong = SimpleNamespace(**vars(right.model) | {"corrected": lambda condition, values: np.full(len(values), -1e-6)})
    value, _, left = OnsetCorrection(wrong, right.place, right.direct, single=1e-9)(small, 10.0 / (2 * np.pi))
    assert value == pytest.approx(EXACT, abs=1e-9) and left < 1e-8


def test_small_models_without_any_mode_leave_it_to_the_full_matrices():
    value, frequency, left = corrected_by(lambda value: np.zeros(0, complex))(SMALL, 10.0 / (2 * np.pi))
    assert value == pytest.approx(EXACT, abs=1e-9) and frequency == pytest.approx(10.0 / (2 * np.pi)) and left < 1e-8


@pytest.mark.parametrize("direct", [lambda value: np.zeros(0, complex), lambda value: np.array([1.0 + 99.0j])])
def test_an_onset_that_nothing_holds_stays_where_it_was_found(direct):
    nothing = corrected_by(lambda value: np.zeros(0, complex))
    value, frequency, left = OnsetCorrection(nothing.model, nothing.place, direct)(SMALL, 1.5)
    assert (value, frequency) == (SMALL, 1.5) and np.isnan(left)


def test_states_that_cannot_be_solved():
    def refused(value):
        raise SolveError("No state.")

    nothing = corrected_by(lambda value: np.zeros(0, complex))
    assert np.isnan(OnsetCorrection(nothing.model, nothing.place, refused)(SMALL, 1.5)[2])
