"""Scans along a parameter on spectra known in closed form."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from dbvfiv.case.axis import Level
from dbvfiv.errors import JumpError, SolveError
from dbvfiv.studies.case import Case
from dbvfiv.studies.map.column import _crossings
from dbvfiv.studies.onset.line import FoundOnsets
from dbvfiv.studies.onset.search import OnsetSearch
from dbvfiv.studies.stability.dimensions import Variant
from dbvfiv.studies.stability.line import LineOnset
from dbvfiv.studies.stability.samples import Sample
from dbvfiv.studies.stability.scan import Scan, locate
from eigen.certificate import Certificate
from eigen.columns import DIRECT, REDUCED, Cell


def modes(*functions):
    def spectrum(x):
        values = np.array([complex(f(x), 10.0 * (k + 1)) for k, f in enumerate(functions)])
        return values[np.argsort(-values.real)]

    return spectrum


def test_a_single_crossing_is_located_to_rounding():
    scan = Scan(modes(lambda x: x**3 - 2.0, lambda x: -5.0))
    (crossing,) = scan.run(np.linspace(0, 3, 7))
    assert locate(scan, crossing, 1e-13)[0] == pytest.approx(2 ** (1 / 3), rel=1e-11)


def test_every_tongue_is_found_though_all_scan_values_are_stable():
    # two tongues, each narrower than half a step of the scan
    scan = Scan(modes(lambda x: 0.02 - 4 * (x - 1.23) ** 2 if x < 2 else 0.01 - 4 * (x - 3.37) ** 2))
    crossings = scan.run(np.linspace(0, 5, 26))
    found = [locate(scan, c, 1e-12)[0] for c in crossings]
    expected = [1.23 - np.sqrt(0.005), 1.23 + np.sqrt(0.005), 3.37 - np.sqrt(0.0025), 3.37 + np.sqrt(0.0025)]
    assert found == pytest.approx(expected, abs=1e-9)


def test_a_narrow_stable_gap_is_found():
    scan = Scan(modes(lambda x: (x - 0.77) ** 2 - 1e-3), log=False)
    found = [locate(scan, c, 1e-12)[0] for c in scan.run(np.linspace(0, 2, 11))]
    assert found == pytest.approx([0.77 - np.sqrt(1e-3), 0.77 + np.sqrt(1e-3)], abs=1e-9)


def test_a_second_mode_that_becomes_unstable_counts_too():
    scan = Scan(modes(lambda x: x - 1, lambda x: x - 2))
    crossings = scan.run([0.0, 3.0])
    assert [c.index for c in crossings] == [0, 1]
    assert [locate(scan, c, 1e-12)[0] for c in crossings] == pytest.approx([1.0, 2.0])


@pytest.mark.parametrize("unstable, band", [(0, 95.0), (4, np.inf)])
def test_as_many_are_unstable_as_are_counted_up_to_the_band(unstable, band):
    """With loss factors all frequencies are counted; "20 up to 95 Hz" had 12 there."""
    growth = np.array([1.0 + 100.0j, 0.5 + 900.0j]) if unstable else np.array([-1.0 + 100.0j])
    cell = Cell(growth, Certificate(unstable, unstable, True, 0.0, np.inf), REDUCED)
    sample = Sample.of(6e3, cell, SimpleNamespace(claimed=95.0))
    assert (sample.band, sample.verdict.band, sample.unstable) == (band, band, unstable)


def test_crossings_of_all_modes_that_are_kept():
    """Six cross between two values; where only one end lists a mode the interval is uncertain."""
    growth = [lambda x, k=k: x - 1.0 - 0.1 * k for k in range(9)]
    scan = Scan(modes(*growth[:6]))
    found = [locate(scan, c, 1e-12)[0] for c in scan.run([0.0, 3.0])]
    assert found == pytest.approx([1.0, 1.1, 1.2, 1.3, 1.4, 1.5])
    spectrum = modes(*growth)
    scan = Scan(lambda x: spectrum(x)[: 3 if x < 1.0 else 8])
    assert [c.index for c in scan.run([0.0, 3.0])] == [0, 1, 2] and scan.uncertain == [(0.0, 3.0)]


@pytest.mark.parametrize("on, off", [(1.48, 1.52), (1.52, 1.48)])
def test_modes_that_take_each_other_s_place_between_two_values_are_told_apart(on, off):
    scan = Scan(modes(lambda x: off - x, lambda x: x - on))
    crossings = scan.run([0.0, 1.0, 2.0, 3.0])
    assert [locate(scan, c, 1e-12)[0] for c in crossings] == pytest.approx(sorted((on, off)))


def test_modes_that_change_their_order_while_unstable_cost_no_samples():
    scan = Scan(modes(lambda x: 3.0 - x, lambda x: x))
    assert scan.run([0.5, 1.0, 2.0, 2.5]) == [] and len(scan.samples) == 4


def test_missing_states_are_kept_as_sentences():
    def spectrum(x):
        if 1.4 < x < 1.6:
            raise SolveError("No equilibrium.")
        return np.array([complex(x - 3, 1)])

    scan = Scan(spectrum)
    crossings = scan.run(np.linspace(1, 4, 7))
    assert list(scan.failures.values()) == ["No equilibrium."]
    assert locate(scan, crossings[0], 1e-12)[0] == pytest.approx(3.0)


@pytest.mark.parametrize("rate", [lambda x: -1.0 if x < 1.3 else 2.0, lambda x: x - 9.0 if x < 1.3 else x + 9.0])
def test_a_growth_rate_that_jumps_across_zero_is_no_onset(rate):
    scan = Scan(modes(rate))
    (crossing,) = scan.run(np.linspace(0, 3, 7))
    with pytest.raises(JumpError, match="A growth rate jumps between 1.* no mode is neutral there"):
        locate(scan, crossing, 1e-12)


def test_no_crossing_is_claimed_across_a_value_without_a_certificate():
    scan = Scan(modes(lambda x: x - 1.5), certify=lambda x: x < 1.9)
    assert scan.run([0.0, 1.0, 2.0]) == [] and scan.uncertain == [(1.0, 2.0)]
    scan = Scan(modes(lambda x: x - 1.5), certify=lambda x: True)
    assert len(scan.run([0.0, 1.0, 2.0])) == 1 and scan.uncertain == []


def test_the_sign_of_rounding_is_no_crossing():
    """Modes of a wall without damping, and a value of the scan that is an onset itself."""
    rounding = np.random.default_rng(0)
    scan = Scan(modes(*(lambda x: 1e-10 * rounding.choice([-1, 1]) for _ in range(3))))
    assert scan.run(np.linspace(1, 2, 9)) == [] and len(scan.samples) == 9
    scan = Scan(modes(lambda x: x - 1.0 + 1e-10))
    (crossing,) = scan.run([0.0, 1.0, 2.0])
    assert (crossing.low.value, crossing.high.value) == (1.0, 2.0) and locate(scan, crossing, 1e-12)[0] == 1.0


@pytest.mark.parametrize("text, value", [("-2", 1.0), ("-2.5 1/s", 0.5), ("10 %", 3.0 - 1.0 / np.sqrt(0.99))])
def test_levels_of_damping_are_crossed_where_the_mode_has_it(text, value):
    """Growth rate -3 + x at 10 rad/s; of a ratio zeta it is -10 zeta / sqrt(1 - zeta^2)."""
    level, spectrum = Level.parse(text), modes(lambda x: x - 3.0)
    scan = Scan(lambda x: level.shifted(spectrum(x)))
    (crossing,) = scan.run([0.0, 1.2, 2.8])
    assert locate(scan, crossing, 1e-12)[0] == pytest.approx(value)
    assert level.excess(level.eigenvalue(10.0)) == pytest.approx(0.0, abs=1e-12)


class ClosedSearch(OnsetSearch):
    """Onsets over the pressure on a spectrum in closed form; there is no state at some values."""

    def __init__(self, spectrum, values, missing=()):
        self.case = Case().replace({"onset.over": f"pressure={','.join(map(repr, values))}"})
        self.axis, self.spectrum, self.missing = self.case.onset.axis, spectrum, missing
        self.scan = Scan(self._beside)
        model = SimpleNamespace(flow=SimpleNamespace(back=0.0))
        self.walk = SimpleNamespace(built=lambda place: SimpleNamespace(model=model))
        self.line = SimpleNamespace(locate=lambda crossing, rel: LineOnset(*locate(self.scan, crossing, rel), 0.0))

    def _beside(self, value):
        if value in self.missing:
            raise SolveError("No equilibrium.")
        own = self.spectrum(value)
        number = 2 * int((own.real > 0).sum())
        return Sample(value, own, number, number, True, how=DIRECT)

    def critical(self, place, eigenvalue):
        return SimpleNamespace(eigenvalue=eigenvalue)

    def place(self, value):
        return value

    def found(self) -> FoundOnsets:
        points = []
        for crossing in self.scan.run(self.axis.values):
            try:
                points.append(self._located(crossing)[0])
            except SolveError:
                pass
        samples = [self.scan.samples[value] for value in sorted(self.scan.samples)]
        return FoundOnsets(Variant("storage", "SS"), tuple(samples), tuple(points), missed=tuple(self.scan.failures))


def test_of_two_onsets_next_to_each_other_one_is_the_edge():
    found = ClosedSearch(modes(lambda x: x - 10.0, lambda x: x - 10.01), (9.0, 11.0)).found()
    assert [(p.value, p.edge, p.confirmed) for p in found.points] == [
        (pytest.approx(10.0), True, True),
        (pytest.approx(10.01), False, True),
    ]
    assert found.stable_intervals == [(9.0, pytest.approx(10.0))]
    assert found.unstable_intervals == [(pytest.approx(10.0), 11.0)] and not found.uncertain_intervals


@pytest.mark.parametrize("missing", [(2.0,), (1.0, 2.0), (4.0,)])
def test_nothing_is_claimed_beside_a_value_without_a_state(missing):
    found = ClosedSearch(modes(lambda x: -1.0), (1.0, 2.0, 3.0, 4.0), missing).found()
    low, high = min(missing) - 1.0, max(missing) + 1.0
    assert found.uncertain_intervals == [(max(low, 1.0), min(high, 4.0))]
    known = found.stable_intervals
    assert known and all(b <= low or a >= high for a, b in known) and not found.unstable_intervals


def test_nothing_is_claimed_where_the_state_jumps():
    found = ClosedSearch(modes(lambda x: -1.0 if x < 2.3 else 2.0), (1.0, 2.0, 3.0, 4.0)).found()
    ((low, high),) = found.uncertain_intervals
    assert not found.points and 2.0 <= low < 2.3 < high <= 3.0
    assert found.stable_intervals == [(1.0, low)] and found.unstable_intervals == [(high, 4.0)]


def test_a_mode_that_grows_too_slowly_to_be_counted_leaves_the_state_open():
    """Without damping the independent count begins a little right of the axis."""
    values = np.array([0.05 + 94j, -1.0 + 120j])
    one = Sample(1.0, values, 0, 0, True, line=0.1, how=DIRECT)
    assert one.verdict.outcome == "undecided" and not one.verdict.certain
    assert "A mode grows by 0.05 1/s, too slowly to be counted." in one.verdict.reason
    rest = replace(one, eigenvalues=np.array([1e-12 + 94j, -1.0 + 120j]))
    assert rest.verdict.outcome == "stable"
    found = FoundOnsets(Variant("storage", "SS"), (one, replace(one, value=2.0), replace(rest, value=3.0)), ())
    assert found.uncertain_intervals == [(1.0, 3.0)] and not (found.stable_intervals or found.unstable_intervals)


def test_a_mode_that_enters_the_band_costs_a_column_of_a_map_no_cells():
    """The list of growth rates has a jump there, and another mode is neutral at 2.5."""
    scan = Scan(modes(lambda x: -1.0 if x < 1.3 else 2.0, lambda x: x - 2.5))
    follow = lambda crossing, rel, level, scan: LineOnset(*locate(scan, crossing, rel), 0.0)  # noqa: E731
    line = SimpleNamespace(scan=scan, values=(0.0, 1.0, 2.0, 3.0), stays=True, is_reduced=True, locate=follow)
    (onset,) = _crossings(line, Level())
    assert onset[0] == pytest.approx(2.5) and onset[2] == 1.0
