"""The one rule for which modes count as leading."""

from __future__ import annotations

import numpy as np
import pytest

from dbvfiv.case.parameters import Mu
from dbvfiv.model import BandOrigin, LeadingSearch, growth_floor, limit_point, select_search
from eigen import SearchOptions

FREQUENCIES = np.array([14.0, 20.0, 28.0, 41.0])


def lowest(count):
    return FREQUENCIES[:count]


def never(_count):
    raise AssertionError("structural frequencies do not decide here")


def test_stiffness_damping_orders_the_modes():
    found = select_search(SearchOptions(tolerance=1e-9), Mu(density=10.0, alpha=0.0, beta=0.004), lowest, 3)
    assert found.options == SearchOptions(tolerance=1e-9, limit_point=-250.0, covered=found.claimed)
    assert found.origin is BandOrigin.NONE and np.isinf(found.band) and found.note is None and found.notes == ()
    assert found.floor == growth_floor(0.004) == pytest.approx(-200.0)
    assert found.claimed == pytest.approx(1.05 * 28.0), "no band is searched, yet verdicts end where models do"


@pytest.mark.parametrize("alpha", [0.0, 7.0])
def test_without_it_a_band_holds_as_many_structural_frequencies_as_modes(alpha):
    """Mass damping shifts all growth rates alike and orders nothing."""
    found = select_search(SearchOptions(), Mu(density=10.0, alpha=alpha, beta=0.0), lowest, 3)
    assert found.origin is BandOrigin.STRUCTURE and found.frequencies == 3
    assert found.band == found.options.max_frequency == pytest.approx(1.05 * 28.0)
    assert "29.4 Hz" in found.note and "modes.max_frequency" in found.note
    assert found.options.limit_point is None and np.isinf(found.floor)


def test_the_band_follows_the_size_of_the_valve():
    """A valve half as large rings twice as high, and its band reaches twice as far: no fixed number of Hz."""
    conditions = Mu(density=10.0, alpha=0.0, beta=0.0)
    full = select_search(SearchOptions(), conditions, lowest, 4).band
    half = select_search(SearchOptions(), conditions, lambda n: 2 * lowest(n), 4).band
    assert half == pytest.approx(2 * full)


@pytest.mark.parametrize("beta", [0.0, 0.003])
def test_a_band_that_was_asked_for_is_respected(beta):
    found = select_search(SearchOptions(max_frequency=60.0), Mu(density=10.0, alpha=0.0, beta=beta), never, 3)
    assert found.band == 60.0 and found.origin is BandOrigin.ASKED and found.note is None


def test_fewer_structural_frequencies_than_modes_are_said():
    found = select_search(SearchOptions(), Mu(density=10.0, alpha=0.0, beta=0.0), lowest, 9)
    assert found.frequencies == 4 and found.band == pytest.approx(1.05 * 41.0) and "holds 4 structural" in found.note


def test_a_structure_that_does_not_oscillate_has_no_band():
    found = select_search(SearchOptions(), Mu(density=10.0, alpha=0.0, beta=0.0), lambda n: np.zeros(n), 3)
    assert found.origin is BandOrigin.NONE and found.options == SearchOptions()


def test_limits():
    assert limit_point(0.0) is None and limit_point(0.002) == -500.0
    assert growth_floor(0.0) == -np.inf and growth_floor(0.002) == pytest.approx(-400.0)


@pytest.mark.parametrize("beta", [0.0, 0.004])
def test_loss_factors_do_not_order_the_modes(beta):
    """A band is needed whatever else damps, and creep is said."""
    found = select_search(SearchOptions(), Mu(density=10.0, alpha=0.0, beta=beta, loss_factor=1.0), lowest, 3)
    assert found.origin is BandOrigin.STRUCTURE and found.band == pytest.approx(1.05 * 28.0)
    assert found.options.limit_point is None and np.isinf(found.floor)
    assert "Loss factors" in found.note and len(found.notes) == 2 and "creep" in found.notes[1]
    asked = select_search(
        SearchOptions(max_frequency=60.0), Mu(density=10.0, alpha=0.0, beta=beta, loss_factor=1.0), lowest, 3
    )
    assert asked.band == 60.0 and asked.note is None and "creep" in asked.notes[0]


@pytest.mark.parametrize("band, share", [(20.0, None), (400.0, 0.05 * 1.05 * 41.0)])
def test_the_lower_end_of_a_wide_band_goes_by_the_first_frequencies(band, share):
    """Slow modes lead where loss factors damp, however high a search goes."""
    asked = select_search(SearchOptions(max_frequency=band), Mu(density=10.0, loss_factor=1.0), lowest, 3)
    assert asked.band == band and asked.options.lowest == pytest.approx(share)
    many = select_search(SearchOptions(), Mu(density=10.0, loss_factor=1.0), lambda n: 4.0 * np.arange(1.0, n + 1), 50)
    assert many.band == pytest.approx(210.0) and many.options.lowest == pytest.approx(0.05 * 42.0)


def test_what_a_band_left_open():
    """Growing pairs above what a line resolves are named, the fastest first, and how far off it is."""
    line = LeadingSearch(SearchOptions(max_frequency=10.0), BandOrigin.LINE)
    said = line.left_open(10.0, [0.5 + 2j * np.pi * 20, 2.0 + 2j * np.pi * 60, 3.0])
    assert said.startswith("Above 10 Hz the count finds more")
    assert "60 Hz by 2 1/s, 20 Hz by 0.5 1/s" in said and "6 times as far" in said and "upstream.elements" in said
    assert "may be unstable" in line.left_open(10.0)


def test_elements_of_a_line_that_a_band_takes():
    """A band of 60 Hz takes four times the elements that resolve 15 Hz; a longer reach than wanted says nothing."""
    asked = SearchOptions(max_frequency=60.0), Mu(density=10.0), never, 3
    short, long = (select_search(*asked, resolved=resolved) for resolved in (15.0, 90.0))
    assert short.note.endswith("moves its end, 4 times as many to the 60 Hz that were wanted.")
    assert short.claimed == short.band == 15.0 and long.band == long.claimed == 60.0 and long.note is None
    damped = select_search(SearchOptions(), Mu(density=10.0, beta=0.003), lambda n: np.full(n, 50.0), 2, resolved=90.0)
    assert damped.band == 90.0 and damped.note.endswith("moves its end.")
