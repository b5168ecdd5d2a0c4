"""Samples of a posterior, emulators, what is confounded and what a further measurement leaves, against closed forms."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import norm

from dbvfiv.case.axis import parse_point
from dbvfiv.case.distribution import ALLOWED, Distribution
from dbvfiv.case.quantity import GRAVITY, Quantity
from dbvfiv.studies.identify.learning import Emulator, Learned, Learning, expected_variance, sample_posterior
from dbvfiv.studies.identify.search import Search, _some
from dbvfiv.studies.identify.study import IdentifyResult, distribution_text
from dbvfiv.studies.identify.valves import Measured, _each_once, follow, least_damping, onsets, stretch

SLOPES = np.array([[1.0, 0.8, 0.0, 0.0], [0.0, 0.3, 1.0, 0.0]])
DATA = np.array([1.2, -0.4])


@pytest.mark.parametrize("error", [0.3, 0.02, 2e-4])
def test_posterior_and_evidence_of_a_linear_model(error):
    error = np.array([error, 0.3])

    def linear(z):
        return norm.logpdf((DATA - z @ SLOPES.T) / error).sum(axis=1) - np.log(error).sum()

    z, evidence = sample_posterior(linear, 4, 2000, 1)
    precision = np.eye(4) + SLOPES.T @ np.diag(error**-2.0) @ SLOPES
    covariance = np.linalg.inv(precision)
    mean = covariance @ SLOPES.T @ (DATA / error**2)
    spread = np.sqrt(np.diag(covariance))
    assert np.abs((z.mean(axis=0) - mean) / spread).max() < 0.12
    np.testing.assert_allclose(z.std(axis=0) / spread, 1.0, atol=0.08)
    own = SLOPES @ SLOPES.T + np.diag(error**2)
    expected = -0.5 * DATA @ np.linalg.solve(own, DATA) - 0.5 * np.linalg.slogdet(2 * np.pi * own)[1]
    assert evidence == pytest.approx(expected, abs=0.25)


def test_valves_of_a_long_round_are_all_different():
    """A valve that stands twice is predicted by itself, without an error."""
    search = object.__new__(Search)
    search.plan = SimpleNamespace(case=SimpleNamespace(identify=SimpleNamespace(seed=1, round=1500)))
    z, _ = search._sampled(SimpleNamespace(log_likelihood=lambda z: -0.5 * z[:, 0] ** 2, dimension=2), 0)
    assert len(np.unique(_some(z, 1500), axis=0)) == 1500


def test_both_regions_of_a_posterior_have_their_weights():
    """Posterior of a measurement of |z|, with a prior slope from a second one: weights by the densities of both."""

    def two(z):
        return norm.logpdf(np.abs(z[:, 0]), 1.5, 0.03) + norm.logpdf(z[:, 0], 2.0, 3.0)

    z, _ = sample_posterior(two, 2, 2000, 3)
    ratio = norm.pdf(1.5, 2.0, 3.0) / (norm.pdf(1.5, 2.0, 3.0) + norm.pdf(-1.5, 2.0, 3.0))
    assert np.mean(z[:, 0] > 0) == pytest.approx(ratio, abs=0.05)


def test_an_emulator_is_exact_of_trends_and_knows_its_error():
    random = np.random.default_rng(2)
    points, other = random.standard_normal((60, 5)), random.standard_normal((400, 5))
    values = lambda x: np.column_stack([1 + x @ np.arange(5.0), np.exp(0.2 * x[:, 0] * x[:, 1])])  # noqa: E731
    emulator = Emulator(points, values(points))
    off = emulator(other) - values(other)
    assert np.abs(off[:, 0]).max() < 1e-6
    known, true = np.quantile(np.abs(emulator.left[:, 1]), 0.68), np.quantile(np.abs(off[:, 1]), 0.68)
    assert 0.5 < known / true < 2.0 and true < 0.5 * values(other)[:, 1].std()


def test_inputs_that_only_a_sum_is_known_of_are_confounded():
    random = np.random.default_rng(4)
    size = 0.05
    along, across = size * random.standard_normal(4000), random.standard_normal(4000)
    z = np.column_stack([along + across, along - across, random.standard_normal(4000) * np.sqrt(2)]) / np.sqrt(2)
    learned = Learned(z)
    assert learned.confounded() == [(0, [1]), (1, [0])]
    variance = 0.5 * (1 + size**2)
    assert learned.inflation[0] == pytest.approx(variance * 0.5 * (1 + size**-2), rel=0.05)
    assert learned.directions()[0][0] == pytest.approx(size, rel=0.05)
    assert np.abs(learned.directions()[0][1]) == pytest.approx([np.sqrt(0.5), np.sqrt(0.5), 0.0], abs=0.02)


@pytest.mark.parametrize("size", [1.0, 0.05])
def test_inputs_that_are_correlated_before_are_told_by_their_own_scores(size):
    """Scores t = L z of a correlation of 0.8, of whose half sum (t1 + t2)/2 records leave a share of the spread."""
    root, random = np.linalg.cholesky([[1.0, 0.8], [0.8, 1.0]]), np.random.default_rng(4)
    total, apart = size * np.sqrt(0.9) * random.standard_normal(8000), np.sqrt(0.1) * random.standard_normal(8000)
    learned = Learned(np.column_stack([total + apart, total - apart]), root)
    variances = 0.9 * size**2, 0.1
    correlation = (variances[0] - variances[1]) / sum(variances)
    assert learned.correlation[0, 1] == pytest.approx(correlation, abs=0.02)
    assert learned.inflation[0] == pytest.approx(1 / (1 - correlation**2), rel=0.05)
    assert learned.confounded() == ([] if size == 1.0 else [(0, [1]), (1, [0])])
    best, combined = learned.directions()[0]
    assert best == pytest.approx(size, rel=0.05)
    if size < 1.0:  # of unit variance before: (t1 + t2)/2 over sqrt(0.9)
        assert np.abs(combined) == pytest.approx([0.5 / np.sqrt(0.9)] * 2, abs=0.02)


def test_the_variance_left_by_a_further_measurement():
    """Variance of z1 left by a measurement of z1 + z2 with a standard error s: 1 - 1 / (2 + s^2)."""
    z = np.random.default_rng(5).standard_normal((20000, 2))
    left = expected_variance(z[:, :1], z.sum(axis=1)[:, None], np.array([0.5]))
    assert left[0] == pytest.approx(1 - 1 / 2.25, abs=0.01)


def test_onsets_next_to_the_present_value():
    values = np.geomspace(1.0, 16.0, 5)
    damping = np.array([[-1.0, -1.0, 1.0, 2.0, -1.0], [1.0, 1.0, 1.0, 1.0, 1.0], [1.0, -1.0, -1.0, -1.0, 1.0]])
    below, above, present = onsets(values, damping, 4.0)
    assert 2.0 < below[0] < 4.0 and 8.0 < above[0] < 16.0 and present[0] == pytest.approx(1.0)
    assert np.isnan([below[1], above[1]]).all()
    assert 1.0 < below[2] < 2.0 and 8.0 < above[2] < 16.0 and present[2] < 0
    assert np.isnan(onsets(values, damping, 16.0)[1]).all()


@pytest.mark.parametrize("ends", [[4.0], [4.0, 4.0, 4.0, np.nan]])
def test_flutter_at_the_last_record_ends_and_does_not_begin(ends):
    """Samples that flutter at 2 kPa, up to 4 kPa, and one that flutters beyond 4 kPa."""
    damping = np.array([[-1.0, -1.0, 1e-12, 1.0] if end == 4.0 else [1.0, 1.0, 1.0, -1.0] for end in ends])
    values = np.geomspace(1e3, 8e3, 4)
    found = object.__new__(IdentifyResult)
    places = SimpleNamespace(parameter="pressure", now=2e3, values=values, head=lambda *_: "")
    vars(found).update(_onsets=onsets(values, damping, 2e3), places=places, values=values)
    now, begins, over = found.onset["flutters_now"], found.onset["above"], found.onset["ends"]["above"]
    assert now == over["probability"] == np.mean(np.array(ends) == 4.0) and begins["probability"] == 1 - now
    assert over["interval"] == pytest.approx([4e3, 4e3], rel=1e-2) and found.onset["ends"]["below"]["median"] is None
    said = found._onset_said()
    assert said[0] == f"It flutters at the last record with a probability of {100 * now:.0f} %."
    assert any(line.startswith("Above the last record flutter ends at 4") for line in said)
    assert "Flutter ends nowhere below 2 kPa up to 1 kPa." in said
    assert any("Above the last record flutter begins" in line for line in said) == (now < 1.0)
    assert now == 1.0 or 4e3 < begins["median"] < 8e3


@pytest.mark.parametrize(
    ("lost", "now", "run"),
    [
        ([], 2.5, (0, 4)),
        ([3], 2.5, (0, 3)),
        ([0, 3], 2.0, (1, 3)),
        ([3], 4.0, (0, 3)),
        ([1, 3], 4.0, None),
        ([2], 2.5, None),
    ],
)
def test_a_run_of_values_ends_where_too_few_samples_are_known(lost, now, run):
    known = np.ones((5, 4), bool)
    known[1:, lost] = False
    found = stretch(np.array([1.0, 2.0, 4.0, 8.0]), now, known, 2)
    assert (found.start, found.stop) == (run or (0, 0))


def test_a_value_without_a_state_leaves_the_onset_between_the_others():
    """Damping of 1 % at 2 kPa and -1 % at 4 kPa, and no valve at 8 kPa."""
    scores = np.linspace(-2.0, 2.0, 12)[:, None]
    ratio = np.array([0.01, -0.01, np.nan]) * (1.0 + 0.1 * scores)
    modes = {
        place: (np.pad(1j - row[:, None], ((0, 0), (0, 11)), constant_values=np.nan), 0)
        for place, row in enumerate(ratio.T)
    }
    inputs = [SimpleNamespace(distribution=SimpleNamespace(form="normal"))]
    asked = SimpleNamespace(identify=SimpleNamespace(error=0.0, damping_error=0.0))
    plan = SimpleNamespace(inputs=inputs, scores_of=lambda z: z, case=asked)
    places = SimpleNamespace(values=(2e3, 4e3, 8e3), now=2.5e3, ranged=[0, 1, 2])
    learning = Learning(plan, places, [], scores, np.zeros(12, int), modes, np.full((12, 2), np.nan))
    z = np.zeros((50, 3))
    damping = learning.damping_over_range(z, 1)
    assert damping.shape == (50, 2) and learning.values.tolist() == [2e3, 4e3]
    _, above, present = learning.onsets(z, damping, 1)
    assert above == pytest.approx(np.sqrt(8.0) * 1e3, rel=1e-2) and (present > 0).all()
    found = object.__new__(IdentifyResult)
    places.parameter, places.head = "pressure", lambda *_: ""
    vars(found).update(_onsets=learning.onsets(z, damping, 1), places=places, values=learning.values)
    assert found.onset["range"] == [2e3, 4e3]
    assert any(line.startswith("Damping is known from 2 kPa to 4 kPa: too few") for line in found._onset_said())


def test_two_modes_of_a_later_column_are_two_beside_one_broad_line():
    broad, first, second = (Measured(0, f, e) for f, e in ((20.0, 1.0), (19.5, 0.05), (20.5, 0.05)))
    assert _each_once([broad], [first, second], 0.0) == [first, second] == _each_once([first, second], [broad], 0.0)


@pytest.mark.parametrize(("present", "names"), [(0.01, ["onset above"]), (-0.01, ["end above"])])
def test_a_further_measurement_is_sought_for_where_flutter_begins_or_ends(present, names):
    found, above = object.__new__(IdentifyResult), np.array([4.0, 5.0, np.nan])
    learning = SimpleNamespace(further=lambda _samples, targets: targets)
    learned, onsets_ = SimpleNamespace(confounded=list), (np.full(3, np.nan), above, np.full(3, present))
    vars(found).update(learned=learned, learning=learning, samples=np.zeros((3, 3)), _onsets=onsets_)
    assert list(found.further) == names
    np.testing.assert_array_equal(found.further[names[0]], above)


def test_a_head_of_a_record_is_one_of_the_density_beside_it():
    for text in ("pressure=1 m, density=1025", "density=1025, pressure=1 m"):
        assert parse_point(text, 1000.0) == {"pressure": pytest.approx(1025 * GRAVITY), "density": 1025.0}
    assert [*parse_point("pressure=1 m, density=1025", 1000.0)] == ["pressure", "density"]


def test_modes_are_followed_by_their_shapes():
    eigenvalues = np.array([[-1 + 20j, -2 + 30j, -5.0], [-3 + 28j, -1 + 22j, np.nan]])
    alike = np.zeros((2, 3, 3))
    alike[0, 0, 0] = alike[0, 1, 1] = alike[1, 0, 1] = 0.9
    alike[1, 1, 0] = 0.1
    found = follow(eigenvalues, alike)
    assert found[:, 0, 0] * 2 * np.pi == pytest.approx([20, 22])
    assert np.isnan(found[1, 1]).all() and found[0, 1, 1] == pytest.approx(2 / abs(-2 + 30j))
    assert least_damping(eigenvalues) == pytest.approx([1 / abs(-1 + 20j), 1 / abs(-1 + 22j)])


@pytest.mark.parametrize("text", ["normal(2, 0.1)", "lognormal(2, 1.3)", "uniform(1, 3)", "samples(1, 2, 4, 8)"])
def test_a_posterior_is_written_as_a_distribution(text):
    prior = Distribution.parse(text, Quantity(""))
    random = np.random.default_rng(6)
    for scores in (0.4 + 0.3 * random.standard_normal(4000), np.abs(random.standard_normal(4000))):
        found = Distribution.parse(distribution_text(prior, scores), Quantity(""))
        ask = np.linspace(-1.5, 1.5, 7)
        expected = prior.at(np.quantile(scores, norm.cdf(ask)))
        if prior.form != "samples":
            np.testing.assert_allclose(found.at(ask), expected, rtol=0.02)
        else:
            assert set(found.numbers) <= set(prior.numbers)


@pytest.mark.parametrize(("text", "limits"), [("normal(1, 0.2)", (0.0, 10.0)), ("lognormal(1, 1.3)", (0.28, 10.0))])
def test_a_posterior_lies_where_its_number_can_be(text, limits):
    """As the prior does: two standard deviations below, at two thirds of the width, a normal form goes beyond 0."""
    prior = Distribution.parse(text, Quantity(""))
    scores = -2 + 0.65 * np.random.default_rng(6).standard_normal(4000)
    found = Distribution.parse(distribution_text(prior, scores, limits), Quantity(""))
    assert prior.share_outside(*limits) <= ALLOWED and found.share_outside(*limits) <= ALLOWED
    assert found.median == pytest.approx(prior.at(np.array([-2.0]))[0], rel=0.02)


@pytest.mark.parametrize(
    ("text", "value", "share"), [("samples(1, 2, 4, 8)", 4.0, 2.5 / 4), ("samples(-1, 0, 1)", 0.0, 0.5)]
)
def test_a_posterior_of_one_value_is_written_as_a_narrow_distribution(text, value, share):
    prior = Distribution.parse(text, Quantity(""))
    scores = norm.ppf(share) + 0.01 * np.random.default_rng(6).standard_normal(400)
    found = Distribution.parse(distribution_text(prior, scores), Quantity(""))
    assert found.at(np.array([-2.0, 0.0, 2.0])) == pytest.approx([value] * 3, rel=1e-5, abs=1e-5) and found.scale > 0
