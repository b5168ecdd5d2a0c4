"""Sampling against closed forms: intervals of plain and of rare probabilities hold them, shares of variance."""

import numpy as np
import pytest
from scipy.stats import norm

from dbvfiv.studies.inputs import counted, quasi_random
from dbvfiv.studies.uncertainty.sampling import DEFENSIVE, Shifted, approach, shares, subset, weighted

#: Stiffnesses 1 + 0.1 z1 and 1.5 + 0.1 z2 of two modes that a circulatory force couples.
SPREAD, APART = 0.1, 0.5


def growth(scores, force):
    """Largest growth rate of q'' + [[k1, c], [-c, k2]] q = 0, from the characteristic equation; the square under its
    root, turned, where none grows: how far the frequencies are from meeting.
    """
    k1, k2 = 1 + SPREAD * scores[:, 0], 1 + APART + SPREAD * scores[:, 1]
    under = 0.25 * (k1 - k2) ** 2 - force**2
    meeting = np.sqrt(np.maximum(-under, 0.0))
    rates = np.abs(np.sqrt(-0.5 * (k1 + k2) + 1j * meeting).real)
    return np.where(under < 0, rates, -under)


def chance(force):
    """Probability that the frequencies meet: of |k1 - k2| < 2 c."""
    width = SPREAD * np.sqrt(2)
    return norm.cdf((2 * force - APART) / width) - norm.cdf((-2 * force - APART) / width)


def inside(interval, force, seeds=100):
    return sum(low <= chance(force) <= high for low, high in map(interval, range(seeds)))


@pytest.mark.parametrize("force", [0.1, 0.2, 0.25])
def test_intervals_of_plain_samples_hold_the_probability(force):
    def interval(seed):
        hits = growth(quasi_random(256, 2, seed), force) > 0
        found = counted(int(hits.sum()), 0, 256)
        return found.low, found.high

    assert inside(interval, force) >= 95


def rare(seed, force, samples=(64, 200)):
    used = []

    def evaluate(scores, _log_weight):
        used.append(len(scores))
        return growth(scores, force)

    density = approach(evaluate, 2, samples[0], seed)
    scores = density.draw(samples[1], np.random.default_rng(1000 + seed))
    found = weighted(np.exp(density.log_weight(scores)), growth(scores, force) > 0, np.zeros(samples[1], bool))
    return found, sum(used) + samples[1]


def test_intervals_of_rare_samples_hold_the_probability():
    """A probability of 1e-3 by less than a fiftieth of the samples that an equal interval takes of the inputs as they
    are.
    """
    force = 0.0316
    assert 5e-4 < chance(force) < 2e-3
    found, used = zip(*(rare(seed, force) for seed in range(100)))
    assert sum(one.low <= chance(force) <= one.high for one in found) >= 95
    values = np.array([one.value for one in found])
    plain = (1 - chance(force)) / chance(force) / (values.std() / chance(force)) ** 2
    assert np.mean(used) < plain / 50


def test_intervals_of_subset_sampling_hold_the_probability():
    """A probability of 1e-3 by levels, at a half of the samples that an equal error takes of the inputs as they are."""
    force, used = 0.0316, []

    def evaluate(scores, _log_level):
        used.append(len(scores))
        return growth(scores, force)

    found = [subset(evaluate, 2, 1500, seed) for seed in range(100)]
    assert sum(one.low <= chance(force) <= one.high for one in found) >= 95
    values = np.array([one.value for one in found])
    assert np.mean(values) == pytest.approx(chance(force), rel=0.15)
    plain = (1 - chance(force)) / chance(force) / (values.std() / chance(force)) ** 2
    assert sum(used) / 100 < plain / 2


@pytest.mark.parametrize(("least", "most", "performance"), [(0.02, 0.03, -1.0), (0.0, 1e-10, None)])
def test_subset_sampling_without_a_hit_tells_what_its_levels_hold(least, most, performance):
    """Four runs of 32 samples that are all alike, and runs that end in a level of 1e-12 far below the event."""

    def evaluate(scores, _log_level):
        return scores[:, 0] - 40.0 if performance is None else np.full(len(scores), performance)

    found = subset(evaluate, 2, 400, 1)
    assert (found.value, found.low) == (0.0, 0.0) and least < found.high < most


@pytest.mark.parametrize(("share", "bound"), [(0.1, 4.0), (0.5, 2.5)])
def test_undecided_samples_of_all_levels_of_subset_sampling_widen_the_interval(share, bound):
    """A share of the inputs, all of which may be of the event; the value is that of the others."""
    performance = lambda z, _: np.where(z[:, 1] > norm.isf(share), np.nan, z[:, 0] - bound)  # noqa: E731
    found = [subset(performance, 2, 1500, seed) for seed in range(20)]
    assert np.mean([one.value for one in found]) == pytest.approx(norm.sf(bound), rel=0.2)
    for one in found:
        assert one.low <= (1 - share) * norm.sf(bound) and one.high >= 0.9 * share


def test_two_regions_are_both_found():
    bound, values = 3.3, []
    for seed in range(20):
        density = approach(lambda z, _w: np.abs(z[:, 0]) - bound, 3, 64, seed)
        scores = density.draw(200, np.random.default_rng(seed))
        values.append(
            weighted(np.exp(density.log_weight(scores)), np.abs(scores[:, 0]) > bound, np.zeros(200, bool)).value
        )
    assert np.mean(values) == pytest.approx(2 * norm.sf(bound), rel=0.15)


def test_undecided_samples_widen_the_interval():
    sure, unsure = counted(10, 0, 100), counted(10, 20, 120)
    assert unsure.low < sure.low and unsure.high > sure.high and unsure.value == 0.1
    weights, hits = np.full(100, 0.5), np.arange(100) < 10
    doubt = np.arange(100) >= 80
    assert weighted(weights, hits, doubt).high > weighted(weights, hits, np.zeros(100, bool)).high


def test_no_hit_of_another_density_says_less_than_none_of_the_inputs():
    """A tenth of the samples is of the inputs: of 160 not 2.3 %, but ten times as much may flutter."""
    density = Shifted(np.array([[4.0, 0.0], [0.0, 0.0]]), np.array([1 - DEFENSIVE, DEFENSIVE]))
    none, sizes = np.zeros(160, bool), []
    for one in (Shifted.none(2), density):
        scores = one.draw(160, np.random.default_rng(2))
        sizes.append(weighted(np.exp(one.log_weight(scores)), none, none).high)
    assert sizes[0] == pytest.approx(counted(0, 0, 160).high, rel=1e-6) and sizes[0] == pytest.approx(0.0228, rel=0.01)
    assert sizes[1] == pytest.approx(0.228, rel=0.02)


@pytest.mark.parametrize("doubtful", [False, True])
def test_a_usual_outcome_of_weighted_samples_is_as_certain_as_the_rare_one(doubtful):
    """All but the 1.35e-3 of the inputs beyond three standard deviations, about which nine tenths of the samples are;
    and with a fifth of the others undecided, of which as many are.
    """
    density, values = Shifted(np.array([[3.0, 0.0], [0.0, 0.0]]), np.array([1 - DEFENSIVE, DEFENSIVE])), []
    for seed in range(10):
        scores = density.draw(160, np.random.default_rng(seed))
        weights, rare = np.exp(density.log_weight(scores)), scores[:, 0] > 3
        undecided = doubtful & ~rare & (scores[:, 1] > 0.84)
        usual, other = weighted(weights, ~rare & ~undecided, undecided), weighted(weights, rare, undecided)
        assert 0 <= usual.low <= usual.value <= usual.high <= 1 and usual.value == pytest.approx(1 - other.value)
        values.append(other.value)
    assert np.mean(values) == pytest.approx(norm.sf(3) * (1.25 if doubtful else 1), rel=0.1)


def test_shares_of_a_linear_function_are_its_squares():
    scores = quasi_random(1024, 4, 3)
    found = shares(scores, scores @ [3.0, 2.0, 1.0, 0.0])
    np.testing.assert_allclose(found, np.array([9, 4, 1, 0]) / 14, atol=0.02)


def test_shares_of_ishigamis_function():
    """Ishigami and Homma 1990 with a = 7, b = 0.1: first-order indices 0.3139, 0.4424 and 0."""
    scores = quasi_random(4096, 3, 1)
    x = np.pi * (2 * norm.cdf(scores) - 1)
    found = shares(scores, np.sin(x[:, 0]) + 7 * np.sin(x[:, 1]) ** 2 + 0.1 * x[:, 2] ** 4 * np.sin(x[:, 0]))
    np.testing.assert_allclose(found, [0.3139, 0.4424, 0.0], atol=0.02)


def test_shares_of_an_outcome_need_no_smoothness():
    scores = quasi_random(1024, 3, 5)
    found = shares(scores, (scores[:, 1] > 1).astype(float))
    assert found[1] > 0.93 and found[[0, 2]].max() < 0.03
