"""Folds and Hopf points with published or closed-form values.

Sources: Brusselator and one-degree valve: closed forms. Lorenz: Sparrow, The Lorenz Equations
(1982), r_H = sigma (sigma + b + 3) / (sigma - b - 1). Bratu: the 1D fold lambda* =
3.513830719 in closed form, the 2D one 6.808124423 (Mohsen, Comput. Math. Appl. 67 (2014) 26).
Pipe conveying fluid: 14 and 20 modes agree; Gregory & Paidoussis (1966).
"""

import numpy as np
import pytest

from continuation import ContinuationOptions, NewtonOptions, Reason, continue_branch, continue_hopf
from tests.systems.bratu import bratu_1d, bratu_chebyshev
from tests.systems.brusselator import brusselator, brusselator_1d
from tests.systems.following import follow, hopf_of
from tests.systems.lorenz import lorenz
from tests.systems.one_degree_valve import one_degree_valve
from tests.systems.pipe import pipe


@pytest.mark.parametrize(("a", "l1"), [(1.0, -1 / 2), (2.0, -1 / 6)])
def test_brusselator(a, l1):
    """Newton's last step squares an error below 1e-8, so rounding is what remains."""
    (point,) = follow(brusselator(), [a, 1.0], {"A": a, "B": a}, "B", (0.0, 8.0)).of_kind("hopf")
    assert np.isclose(point.mu["B"], 1 + a**2, rtol=1e-12)
    assert np.isclose(point.values["omega"], a, rtol=1e-12)
    assert np.isclose(point.values["first_lyapunov_coefficient"], l1, rtol=1e-10)
    assert point.values["criticality"] == "super"


@pytest.mark.slow
def test_brusselator_hopf_curve():
    """B = 1 + A^2 and omega = A over a range of A; l1 at A = 1 and 2 on the way."""
    hopf = hopf_of(brusselator(), [0.5, 1.0], {"A": 0.5, "B": 0.5}, "B", (0.0, 8.0))
    for end, l1 in ((1.0, -1 / 2), (2.0, -1 / 6)):
        curve = continue_hopf(brusselator(), hopf, ("B", "A"), ContinuationOptions(limits={"A": (0.1, end)}))
        a = curve.values("A")
        assert a[-1] == end
        assert np.abs(curve.values("B") - 1 - a**2).max() < 1e-8
        assert np.abs(curve.values("omega") - a).max() < 1e-8
        assert np.isclose(curve.values("l1")[-1], l1, rtol=1e-8)


@pytest.mark.slow
def test_brusselator_in_one_dimension():
    """l_k = 0.513020 k, omega = 2.139509 (A = 2, B = 5.45, D = 0.008, 0.004)."""
    lengths = {}
    for points in (47, 95):
        mu = {"A": 2.0, "B": 5.45, "D1": 0.008, "D2": 0.004, "l": 0.3}
        steps, start = {"step": 0.1, "max_step": 0.3}, np.tile([2.0, 2.725], points)
        branch = follow(brusselator_1d(points), start, mu, "l", (0.2, 1.7), eigenvalues=8, near=2.2j, **steps)
        found = branch.of_kind("hopf")
        lengths[points] = np.array([s.mu["l"] for s in found])
        # Central differences replace k pi by 2/h sin(k pi h/2), and nothing else.
        k, h = np.arange(1, 4), 1 / (points + 1)
        discrete = np.sqrt(0.012 / 0.45) * 2 / h * np.sin(k * np.pi * h / 2)
        assert np.allclose(lengths[points], discrete, rtol=1e-9)
        assert np.allclose([s.values["omega"] for s in found], 2.139509, rtol=0, atol=5e-7)
        assert np.all(np.diff(branch.unstable) >= 0) and branch.unstable[-1] == 6
    # Half the step quarters the error: extrapolated, the printed digits remain.
    limit = (4 * lengths[95] - lengths[47]) / 3
    assert np.allclose(limit, 0.513020 * np.arange(1, 4), rtol=0, atol=1.6e-6)


def test_lorenz():
    sigma, b, r = 10.0, 8 / 3, 10.0
    x = np.sqrt(b * (r - 1))
    mu = {"sigma": sigma, "b": b, "r": r}
    (point,) = follow(lorenz(), [x, x, r - 1], mu, "r", (2.0, 30.0), step=0.5, max_step=3.0).of_kind("hopf")
    critical = sigma * (sigma + b + 3) / (sigma - b - 1)
    assert np.isclose(point.mu["r"], critical, rtol=1e-11)
    assert abs(point.mu["r"] - 24.7368) < 5e-5
    assert np.isclose(point.values["omega"] ** 2, 2 * sigma * (sigma + 1) * b / (sigma - b - 1), rtol=1e-11)
    assert point.values["criticality"] == "sub"


def test_lorenz_pitchfork_at_one():
    mu = {"sigma": 10.0, "b": 8 / 3, "r": 0.2}
    (point,) = follow(lorenz(), np.zeros(3), mu, "r", (0.1, 2.0)).of_kind("branch point")
    assert abs(point.mu["r"] - 1.0) < 1e-10


def _fold(system, tolerance):
    branch = continue_branch(
        system,
        np.zeros(system.size),
        {"lambda": 0.0},
        "lambda",
        ContinuationOptions(
            step=0.5,
            max_step=1.0,
            max_points=30,
            stop_at=frozenset({"fold"}),
            branch_points=False,
            newton=NewtonOptions(tolerance=tolerance),
        ),
    )
    (point,) = branch.of_kind("fold")
    return point.mu["lambda"]


def test_bratu_in_one_dimension():
    """Fourth-order differences on two grids, extrapolated."""
    coarse, fine = _fold(bratu_1d(63), 1e-9), _fold(bratu_1d(127), 1e-9)
    assert abs(fine - 3.513830719) < 1e-8
    assert abs(fine + (fine - coarse) / 15 - 3.513830719) < 5e-10


def test_bratu_in_two_dimensions():
    """Order 20, 22, 24 give 6.80812442 245, 260, 258: half a digit of the printed value."""
    assert abs(_fold(bratu_chebyshev(22), 1e-8) - 6.808124423) < 6e-10


def test_one_degree_valve():
    mu = {"m": 1.0, "c": 0.1, "k": 1.0, "r": 0.5, "B": 0.0}
    system = one_degree_valve()
    (point,) = follow(system, np.zeros(3), mu, "B", (-1.0, 1.0)).of_kind("hopf")
    assert abs(point.mu["B"] - 0.216667) < 5e-7 and abs(point.values["omega"] - 0.912871) < 5e-7
    curve = continue_hopf(
        system, point, ("B", "r"), ContinuationOptions(limits={"r": (0.05, 3.0)}, eigenvalues=3), lyapunov=False
    )
    r = curve.values("r")
    assert np.allclose(curve.values("B"), 1 + 0.1 * r - r / (0.1 + r), rtol=0, atol=1e-8)
    assert np.allclose(curve.values("omega") ** 2, r / (0.1 + r), rtol=0, atol=1e-8)
    assert set(curve.unstable) == {0}
    opening = follow(system, np.zeros(3), mu, "B", (-5.0, 1.0), direction=-1)
    assert not opening.special and set(opening.unstable) == {0}


@pytest.mark.slow
def test_pipe_conveying_fluid_along_the_hopf_curve():
    """One curve through all tabulated mass ratios and the S-bend near 0.295 between them."""
    system = pipe(14)
    mu = {"beta": 0.1, "u": 3.0}
    (point,) = follow(system, np.zeros(28), mu, "u", (3.0, 6.0), branch_points=False).of_kind("hopf")
    assert abs(point.mu["u"] - 4.7499) < 5.1e-5 and abs(point.values["omega"] - 14.2171) < 5.1e-5
    for beta, velocity, omega in ((0.2, 5.5914, 13.7147), (0.5, 9.3224, 26.4973)):
        curve = continue_hopf(
            system,
            point,
            ("u", "beta"),
            ContinuationOptions(
                limits={"beta": (0.05, beta)}, step=0.1, max_step=2.0, eigenvalues=28, parameter_scales={"beta": 0.05}
            ),
            lyapunov=False,
        )
        assert curve.reason.kind is Reason.LIMIT
        assert abs(curve.values("u")[-1] - velocity) < 5.1e-5
        assert abs(curve.values("omega")[-1] - omega) < 5.1e-5
        assert curve.unstable[-1] == 0
    # Within the bend there are three thresholds for one mass ratio.
    assert np.any(np.diff(curve.values("beta")) < 0)
