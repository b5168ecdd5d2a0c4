"""The first Lyapunov coefficient of systems with memory, against that of the same system with its memory as states."""

import itertools

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import brentq

from continuation import NotABifurcation, hopf_normal_form
from continuation.jax_system import JaxSystem
from continuation.normal_form import Motion, hopf_normal_form_of

#: Spring force k x + k2 x^2 + k3 x^3 with Maxwell branches, and a cubic spring of its own that does not relax.
SPRING, OWN = (4.0, 1.7, -2.3), 0.8
STRENGTHS, TIMES = np.array([0.6, 0.3]), np.array([0.4, 3.0])


def relaxing_oscillator():
    """m = 1, x'' + c x' + own x^3 + S + sum h_j = 0 with h_j' + h_j / tau_j = g_j S'(x) x' as states."""

    def residual(u, mu):
        x, v, h = u[0], u[1], u[2:]
        stress = SPRING[0] * x + SPRING[1] * x**2 + SPRING[2] * x**3
        rate = (SPRING[0] + 2 * SPRING[1] * x + 3 * SPRING[2] * x**2) * v
        force = -mu["c"] * v - OWN * x**3 - mu["stiff"] * stress - h.sum()
        return jnp.concatenate([jnp.stack([v, force]), STRENGTHS * mu["stiff"] * rate - h / TIMES])

    return JaxSystem(residual, 2 + len(TIMES))


class Scalar:
    """A pencil of one unknown at a rate."""

    def __init__(self, value):
        self.value = value

    def matvec(self, x):
        return self.value * x

    def solve(self, rhs):
        return rhs / self.value

    rmatvec, solve_transpose = matvec, solve


class Oscillator:
    """The same by what it makes of motions exp(s t); states are (x, v, h), so that norms are the same."""

    def __init__(self, c, stiff=1.0):
        self.c, self.stiff, self.rest = c, stiff, np.zeros(2 + len(TIMES))

    def branch(self, s):
        return STRENGTHS * s * TIMES / (1 + s * TIMES)

    def pencil(self, s):
        relaxed = SPRING[0] * self.stiff * (1 + self.branch(s).sum())
        return Scalar(s**2 + self.c * s + relaxed)

    def slope(self, motion):
        s = motion.rate
        relaxed = SPRING[0] * self.stiff * (STRENGTHS * TIMES / (1 + s * TIMES) ** 2).sum()
        return (2 * s + self.c + relaxed) * motion.vector

    def second(self, a, b):
        return 2 * SPRING[1] * self.stiff * (1 + self.branch(a.rate + b.rate).sum()) * a.vector * b.vector

    def third(self, a, b, c):
        relaxed = SPRING[2] * self.stiff * (1 + self.branch(a.rate + b.rate + c.rate).sum())
        return 6 * (OWN + relaxed) * a.vector * b.vector * c.vector

    def state(self, motion):
        x, s = motion.vector, motion.rate
        return np.concatenate([x, s * x, SPRING[0] * self.stiff * self.branch(s) * x])

    def parameter_slope(self, name):
        return np.zeros(1)

    def mixed(self, motion, name):
        s = motion.rate
        factor = {"c": s, "stiff": SPRING[0] * (1 + self.branch(s).sum())}[name]
        return factor * motion.vector


@pytest.fixture(scope="module")
def point():
    """Negative damping at which the oscillator with its branches is neutral, and the eigenpair there."""
    system = relaxing_oscillator()

    def leading(c):
        matrix = np.array(system._jacobian(np.zeros(4), {"c": c, "stiff": 1.0}))
        values, vectors = np.linalg.eig(matrix)
        i = np.argmax(values.imag)
        return values[i], vectors[:, i], matrix

    c = brentq(lambda c: leading(c)[0].real, -3.0, 0.0, xtol=1e-15)
    value, right, matrix = leading(c)
    values, left = np.linalg.eig(matrix.T)
    return system, c, value.imag, right, left[:, np.argmin(abs(values - value))].conj()


@pytest.mark.parametrize("parameter", ["c", "stiff"])
def test_the_coefficient_is_that_with_the_memory_as_states(point, parameter):
    system, c, omega, right, left = point
    whole = hopf_normal_form(system, np.zeros(4), {"c": c, "stiff": 1.0}, omega, right, parameter)
    found = hopf_normal_form_of(Oscillator(c), omega, right[:1], parameter)
    assert found.c1 == pytest.approx(whole.c1, rel=1e-10)
    assert found.l1 == pytest.approx(whole.l1, rel=1e-10) and found.criticality == whole.criticality
    assert found.crossing == pytest.approx(whole.crossing, rel=1e-10)
    turn = np.vdot(found.q, whole.q)
    assert abs(turn) == pytest.approx(1.0, rel=1e-12)
    # second-order states of a branch follow its stress, of which the form of the state knows the linear part alone
    assert found.h20[:2] * turn**2 == pytest.approx(whole.h20[:2], rel=1e-9)
    assert found.h11[:2] == pytest.approx(whole.h11[:2], rel=1e-9, abs=1e-12)


def test_a_memory_left_out_of_the_second_order_shows(point):
    """The comparison notices the memory of products of motions, not of the linear part alone."""
    system, c, omega, right, left = point
    whole = hopf_normal_form(system, np.zeros(4), {"c": c, "stiff": 1.0}, omega, right)
    forms = Oscillator(c)
    forms.second = lambda a, b: 2 * SPRING[1] * a.vector * b.vector
    assert abs(hopf_normal_form_of(forms, omega, right[:1]).c1 / whole.c1 - 1) > 0.01


def test_phase_and_size_of_the_vector_do_not_matter(point):
    _, c, omega, right, _ = point
    found = hopf_normal_form_of(Oscillator(c), omega, right[:1])
    again = hopf_normal_form_of(Oscillator(c), omega, (3 - 4j) * right[:1])
    assert again.c1 == pytest.approx(found.c1, rel=1e-12) and np.linalg.norm(again.q) == pytest.approx(1.0)


def test_what_is_no_hopf_point_is_refused(point):
    with pytest.raises(NotABifurcation, match="positive frequency"):
        hopf_normal_form_of(Oscillator(point[1]), 0.0, np.ones(1))


def test_the_motion_to_second_order_leaves_a_defect_of_third_order(point):
    """x = z q + z^2 h20 / 2 + |z|^2 h11 with all pairs of its parts put into the forms."""
    _, c, omega, right, _ = point
    forms = Oscillator(c)
    form = hopf_normal_form_of(forms, omega, right[:1])
    s, z = 1j * omega, 1e-3
    q, h20, h11 = form.q[:1], form.h20[:1], form.h11[:1]
    parts = [Motion(s, z * q), Motion(-s, z * q.conj()), Motion(0.0, z**2 * h11)]
    parts += [Motion(2 * s, z**2 * h20 / 2), Motion(-2 * s, z**2 * h20.conj() / 2)]
    defect = {}
    for part in parts:
        defect[part.rate] = defect.get(part.rate, 0) + forms.pencil(part.rate).matvec(part.vector)
    for a, b in itertools.product(parts[:2], repeat=2):
        defect[a.rate + b.rate] = defect.get(a.rate + b.rate, 0) + 0.5 * forms.second(a, b)
    assert max(abs(x[0]) for x in defect.values()) < 1e-6 * z**2
