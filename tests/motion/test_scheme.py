"""Members of the generalised-alpha family on equations of one unknown with exact solutions."""

import numpy as np
import pytest

from dbvfiv.motion.scheme import SCHEMES, scheme

MEMBERS = [("generalised-alpha", nd) for nd in (0.0, 0.1, 0.3, 0.5)] + [
    ("hht", 0.0),
    ("hht", 0.1),
    ("hht", 0.3),
    ("newmark", 0.0),
    ("newmark", 0.2),
]


def amplification(s, omega_h, beta_h=0.0):
    """(4, 4) matrix of a step of M a + beta F' + F = 0, F = omega^2 q, for (q, h v, h^2 a, last difference of F)."""
    w = omega_h**2
    columns = []
    for q, v, a, rate in np.eye(4):

        def residual(new):
            q1 = q + v + (0.5 - s.beta) * a + s.beta * new
            force, old = w * q1, w * q
            weighted_rate = rate + s.rate * ((force - old) - rate)
            return a + (1 - s.alpha_m) * (new - a) + old + s.now * (force - old) + beta_h * weighted_rate

        at_zero = residual(0.0)
        new = -at_zero / (residual(1.0) - at_zero)
        q1 = q + v + (0.5 - s.beta) * a + s.beta * new
        columns.append([q1, v + (1 - s.gamma) * a + s.gamma * new, new, w * (q1 - q)])
    return np.array(columns).T


def radius(matrix):
    return np.abs(np.linalg.eigvals(matrix)).max()


@pytest.mark.parametrize("name, nd", MEMBERS)
@pytest.mark.parametrize("beta_h", [0.0, 0.1, 3.0, 30.0])
def test_every_step_is_stable(name, nd, beta_h):
    s = scheme(name, nd)
    for omega_h in np.logspace(-3, 5, 60):
        assert radius(amplification(s, omega_h, beta_h)) <= 1 + 1e-7


@pytest.mark.parametrize("nd", [0.0, 0.1, 0.25, 0.5])
def test_numerical_damping_sets_the_spectral_radius(nd):
    expected = (1 - nd) / (1 + nd)
    assert radius(amplification(scheme("generalised-alpha", nd), 1e6)) == pytest.approx(expected, rel=2e-3)
    assert scheme("generalised-alpha", nd).gamma == pytest.approx(0.5 + nd)
    if nd <= 1 / 3:
        s = scheme("hht", nd)
        assert radius(amplification(s, 1e6)) == pytest.approx(expected, rel=2e-3)
        assert s.gamma == pytest.approx(0.5 + nd)


@pytest.mark.parametrize("name, nd, order", [(n, d, 1 if n == "newmark" and d else 2) for n, d in MEMBERS])
def test_order_of_the_eigenvalues(name, nd, order):
    beta, omega = 0.02, 1.0
    exact = np.roots([1.0, beta * omega**2, omega**2])
    exact = exact[np.argmax(exact.imag)]
    errors = []
    for h in (0.1, 0.05):
        factors = np.linalg.eigvals(amplification(scheme(name, nd), omega * h, beta / h)).astype(complex)
        values = np.log(factors[np.abs(factors) > 1e-6]) / h
        errors.append(np.abs(values - exact).min())
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.15)


@pytest.mark.parametrize(
    "name, nd", [("generalised-alpha", 0.6), ("generalised-alpha", -0.1), ("hht", 0.4), ("euler", 0.0)]
)
def test_what_is_no_member_is_refused(name, nd):
    with pytest.raises(ValueError):
        scheme(name, nd)
    assert "euler" not in SCHEMES
