"""The search on problems whose optima are known in closed form, from several starts; failures are steps back."""

import numpy as np
import pytest
from scipy.optimize import brentq

from dbvfiv.case.statement import parse_statement
from dbvfiv.errors import SolveError
from dbvfiv.studies.design.problem import AtHead, DesignProblem, Variable, smooth_margin
from dbvfiv.studies.design.search import Search, starts_of

HEAD = 1e4


class Analytic(DesignProblem):
    """A problem whose valve is a function of the values of its variables."""

    def __init__(self, variables, function):
        self.variables, self.function = variables, function

    def at(self, values, pressure, margin):
        values, slopes = self.function(np.array(values), pressure)
        return AtHead(values, {name: np.array(slope) for name, slope in slopes.items()})


def search(problem, aim, *constraints):
    tried = []
    texts = [parse_statement(text, False, 1000.0) for text in constraints]
    return Search(problem, parse_statement(aim, True, 1000.0), texts, tried.append), tried


def two_throats(x, _pressure):
    """Mass a + b of a nozzle of two throats in series, whose flow is 1/sqrt(1/a^2 + 1/b^2); none below 0.9 of each."""
    if x.min() < 0.9:
        raise SolveError("The nozzle is shut.")
    flow = 1 / np.sqrt((1 / x**2).sum())
    return {"mass": x.sum(), "flow": flow}, {"mass": np.ones(2), "flow": flow**3 / x**3}


@pytest.mark.parametrize("start", range(5))
def test_two_throats_of_a_nozzle_become_equal(start):
    """Least mass for a flow: a = b = sqrt(2), from every start; those that are shut step back towards the case."""
    problem = Analytic((Variable("a", 0.5, 4.0, 3.5, "m"), Variable("b", 0.5, 4.0, 1.2, "m")), two_throats)
    found, tried = search(problem, "mass down", f"flow at {HEAD} Pa at least 1 m^3/s")
    design = found.from_start(starts_of(problem, 8)[start], 60)
    assert design.holds and design.values == pytest.approx((2**0.5, 2**0.5), rel=2e-3)
    assert design.aim == pytest.approx(8**0.5, rel=1e-3) and len(tried) < 60


def two_hills(x, _pressure):
    """A flow with a hill at x = 1 and a lower one at x = 4."""
    hills = np.array([2.0, 0.7]) * np.exp(-((x[0] - np.array([1.0, 4.0])) ** 2))
    return {"mass": x[0], "flow": hills.sum()}, {
        "mass": [1.0],
        "flow": [(-2 * (x[0] - np.array([1.0, 4.0])) * hills).sum()],
    }


@pytest.mark.parametrize("start", [0.0, 0.5, 0.55, 0.6, 0.7, 0.8, 1.0])
def test_a_start_from_which_no_constraint_can_be_held_steps_back(start):
    """The lower hill is below the bound: up there a run ends, or by rounding does not and is given half the valves."""
    problem = Analytic((Variable("x", 0.0, 5.0, 1.2, "m"),), two_hills)
    found, tried = search(problem, "mass down", f"flow at {HEAD} Pa at least 1 m^3/s")
    design = found.from_start(np.array([start]), 60)
    assert design.holds and design.values[0] == pytest.approx(1 - np.log(2) ** 0.5, abs=1e-3) and len(tried) < 60


#: Squared frequencies of two modes of a panel of unit thickness, 1/s2, and their damping, 1/s.
FIRST, SECOND, DAMPING = 100.0, 400.0, 2.0


def panel(x, load):
    """Two modes of a panel of thickness h that a flow couples: stiffness falls as h^3, mass as h, and the flow's forces
    are skew; lambda^2 + g lambda + kappa = 0 with kappa of [[w1 h^2, p/h], [-p/h, w2 h^2]].
    """

    def eigenvalues(h):
        mean, half = 0.5 * (FIRST + SECOND) * h**2, 0.5 * (SECOND - FIRST) * h**2
        kappa = mean + np.array([-1, 1]) * np.sqrt(complex(half**2 - (load / h) ** 2))
        return -0.5 * DAMPING + np.sqrt(0.25 * DAMPING**2 - kappa)

    (h,), step = x, 1e-6
    here = eigenvalues(h)
    slopes = (eigenvalues(h + step) - eigenvalues(h - step)) / (2 * step)
    value, coefficients = smooth_margin(here)
    return {"mass": h, "margin": value}, {"mass": [1.0], "margin": [(coefficients @ slopes).real]}


@pytest.mark.parametrize("start", [0.0, 0.5, 1.0])
def test_the_thinnest_panel_that_does_not_flutter(start):
    """kappa = a + b i is neutral where b^2 = g^2 a: (p/h)^2 = (h^2 (w2 - w1)/2)^2 + g^2 h^2 (w1 + w2)/2."""
    load = 150.0
    neutral = brentq(
        lambda h: (load / h) ** 2 - (0.5 * (SECOND - FIRST) * h**2) ** 2 - DAMPING**2 * 0.5 * (FIRST + SECOND) * h**2,
        0.3,
        3.0,
    )
    problem = Analytic((Variable("h", 0.4, 3.0, 1.0, "m"),), panel)
    found, _ = search(problem, "mass down", f"margin at {load} Pa at least 0.01 %")
    design = found.from_start(np.array([start]), 80)
    # the margin has a vertical tangent where the frequencies meet, just beside
    assert design.holds and design.aim == pytest.approx(neutral, rel=6e-3)


def bump(x, pressure):
    """Margin that falls in a narrow valley over the head, at log10 p = 4.3, which thickness lifts."""
    dip = 0.04 * np.exp(-(((np.log10(pressure) - 4.3) / 0.05) ** 2))
    return {"mass": x[0], "margin": 0.06 - dip / x[0]}, {"mass": [1.0], "margin": [dip / x[0] ** 2]}


def test_a_span_of_heads_is_held_between_those_asked_first():
    problem = Analytic((Variable("h", 0.5, 3.0, 1.0, "m"),), bump)
    found, _ = search(problem, "mass down", "margin from 10 kPa to 40 kPa at least 4 %")
    design = found.from_start(np.array([0.2]), 60)
    assert len(found.constraints[0].pressures) > 6
    deepest = max(0.04 * np.exp(-(((np.log10(p) - 4.3) / 0.05) ** 2)) for p in found.constraints[0].between(13))
    assert design.holds and design.values[0] == pytest.approx(deepest / 0.02, rel=2e-2)


#: Valleys of a margin, each at one of the heads between those of a span that are asked first, by a variable of its own.
VALLEYS = 5


def valleys(x, pressure):
    """Margin with narrow valleys over the head, the first the deepest, each of which one thickness lifts."""
    looked = np.log10(parse_statement(SPANNED, False, 1000.0).between(13))[[1, 3, 5, 7, 9]]
    dips = (0.04 - 1e-3 * np.arange(VALLEYS)) * np.exp(-(((np.log10(pressure) - looked) / 0.01) ** 2))
    return {"mass": x.sum(), "margin": 0.06 - (dips / x).sum()}, {"mass": np.ones(VALLEYS), "margin": dips / x**2}


SPANNED = "margin from 10 kPa to 40 kPa at least 4 %"


def test_a_design_that_fails_at_a_head_added_last_does_not_hold():
    problem = Analytic(tuple(Variable(f"x{i}", 0.5, 3.0, 1.0, "m") for i in range(VALLEYS)), valleys)
    found, _ = search(problem, "mass down", SPANNED)
    design = found.from_start(np.full(VALLEYS, 0.2), 60)
    least = min(valleys(np.array(design.values), p)[0]["margin"] for p in found.constraints[0].between(13))
    assert least < 0.03 and not design.holds and design.violation == pytest.approx((0.04 - least) / 0.06, rel=1e-4)


def test_a_design_that_was_found_is_not_lost_where_heads_are_added():
    """As many valves held as may be tried, and all of them fail at the new head."""
    problem = Analytic((Variable("h", 0.5, 3.0, 1.0, "m"),), bump)
    found, _ = search(problem, "mass down", SPANNED)
    design = found.from_start(np.array([0.2]), 2)
    assert design is not None and not design.holds and design.values[0] < 1.9


def fading(x, pressure):
    """A valve that has no state at a head between those asked first, but for thick walls that are never tried."""
    if np.isclose(pressure, parse_statement(SPANNED, False, 1000.0).between(13)[1]) and x[0] < 2.9:
        raise SolveError("There is no state.")
    return {"mass": x[0], "margin": 0.06}, {"mass": [1.0], "margin": [0.0]}


def test_a_design_without_a_state_between_the_heads_asked_does_not_hold():
    problem = Analytic((Variable("h", 0.5, 3.0, 1.0, "m"),), fading)
    found, _ = search(problem, "mass down", SPANNED)
    design = found.from_start(np.array([0.2]), 20)
    assert design.values[0] == pytest.approx(0.5) and design.violation == np.inf and not design.holds


def test_a_gap_that_is_nothing_at_the_start_still_counts():
    """A section that is shut up to a thickness: the bound and its value at the start are both 0."""

    def gap(x, _pressure):
        return {"mass": x[0], "gap left": max(x[0] - 1.0, 0.0)}, {"mass": [1.0], "gap left": [float(x[0] > 1.0)]}

    problem = Analytic((Variable("h", 0.5, 3.0, 0.8, "m"),), gap)
    found, _ = search(problem, "mass up", "gap left at 5 m at most 0 %")
    design = found.from_start(problem.start, 40)
    assert design.holds and 0.8 < design.values[0] <= 1.0 + 1e-4
