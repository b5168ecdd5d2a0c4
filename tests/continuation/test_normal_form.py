"""The first Lyapunov coefficient and the amplitude equation: known values, and what they must not depend on."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from continuation import NotABifurcation, hopf_normal_form
from continuation.amplitude import amplitude_equation
from continuation.first_order import FirstOrderSystem
from continuation.jax_system import JaxSystem
from continuation.normal_form import SystemForms
from tests.continuation.known import bautin, brusselator, stuart_landau, warped_stuart_landau
from tests.systems.following import follow, normal_form_of

MU = {"mu": -0.5, "w": 2.0, "c": 0.7}


def hopf_of(system, u, mu, parameter, low, high):
    (point,) = follow(system, u, mu, parameter, (low, high)).of_kind("hopf")
    return point, normal_form_of(system, point, parameter)


@pytest.mark.parametrize("make", [stuart_landau, warped_stuart_landau])
def test_stuart_landau_also_behind_a_mass_that_depends_on_state_and_parameter(make):
    """z' = (mu + i w) z - (1 + i c) z |z|^2 has c1 = -(1 + i c) per |z|^2; q* q = 1 doubles it."""
    _, form = hopf_of(make(), [0, 0], MU, "mu", -1, 1)
    assert np.isclose(form.omega, 2.0, rtol=1e-12)
    assert np.isclose(form.c1, -2.0 * (1 + 0.7j), rtol=1e-10)
    assert np.isclose(form.crossing, 1.0, rtol=1e-10)
    assert form.criticality == "super" and form.side() == 1
    # The cycle is exactly |z| = sqrt(mu), and turns at w - c mu.
    assert np.isclose(form.amplitude_coefficient(np.array([1.0, 0.0])), 1.0, rtol=1e-10)
    assert np.isclose(form.amplitude_coefficient(), 1.0, rtol=1e-10)
    assert np.isclose(form.frequency(0.3), 2.0 - 0.7 * 0.3, rtol=1e-10)
    assert np.isnan(form.radius(-0.1))


def test_criticality_of_the_mirror_image():
    """Backwards in time a supercritical point is subcritical."""
    plain = stuart_landau()
    system = JaxSystem(lambda u, mu: -plain._residual(u, {**mu, "mu": mu["mu"]}), 2)
    _, form = hopf_of(system, [0, 0], MU, "mu", -1, 1)
    assert form.criticality == "sub" and np.isclose(form.l1, 1.0)
    assert form.side() == 1  # the same cycles, on the same side


def brusselator_numbers(system, u, extra=()):
    _, form = hopf_of(system, u, {"A": 1.0, "B": 1.5}, "B", 0.5, 3.0)
    first = np.eye(len(u))[0]
    return np.array(
        [
            form.omega,
            form.amplitude_coefficient(first),
            form.crossing.real,
            form.crossing.imag,
            form.c1.imag / form.c1.real,
            form.side(),
            form.frequency(0.1),
        ]
    )


@pytest.fixture(scope="module")
def reference():
    return brusselator_numbers(brusselator(), [1.0, 1.5])


def test_constant_mass_changes_nothing_of_substance(reference):
    b = np.array([[2.0, 0.5], [-0.3, 1.0]])
    plain = brusselator()
    system = JaxSystem(lambda u, mu: jnp.asarray(b) @ plain._residual(u, mu), 2, mass=b)
    assert np.allclose(brusselator_numbers(system, [1.0, 1.5]), reference, rtol=1e-9, atol=1e-12)


def test_mass_that_moves_with_state_and_parameter(reference):
    """The equilibrium moves with B here, so the mass does along the branch."""
    plain = brusselator()

    def mass(u, mu, v):
        x, y = u
        return jnp.array([[1 + x**2, mu["B"] * y], [-x * y, 2 + mu["B"] ** 2]]) @ v

    system = JaxSystem(lambda u, mu: mass(u, mu, plain._residual(u, mu)), 2, mass=mass)
    assert np.allclose(brusselator_numbers(system, [1.0, 1.5]), reference, rtol=1e-8, atol=1e-11)


def test_algebraic_constraint_with_singular_mass(reference):
    """The reaction rate x^2 y as an unknown with 0 = x^2 y - s."""

    def residual(u, mu):
        x, y, s = u
        return jnp.stack([mu["A"] - (mu["B"] + 1) * x + s, mu["B"] * x - s, x**2 * y - s])

    system = JaxSystem(residual, 3, mass=np.diag([1.0, 1.0, 0.0]))
    assert np.allclose(brusselator_numbers(system, [1.0, 1.5, 1.5]), reference, rtol=1e-9, atol=1e-12)


def test_other_coordinates(reference):
    """A nonlinear change y = s - x^2/3 moves every derivative and no invariant."""
    plain = brusselator()

    def residual(u, mu):
        x, s = u
        f = plain._residual(jnp.stack([x, s - x**2 / 3]), mu)
        return jnp.stack([f[0], f[1] + 2 * x / 3 * f[0]])

    numbers = brusselator_numbers(JaxSystem(residual, 2), [1.0, 1.5 + 1 / 3])
    assert np.allclose(numbers, reference, rtol=1e-9, atol=1e-12)


def test_phase_and_size_of_the_vectors_do_not_matter():
    system = brusselator()
    point, form = hopf_of(system, [1.0, 1.5], {"A": 1.0, "B": 1.5}, "B", 0.5, 3.0)
    again = hopf_normal_form(system, point.u, point.mu, form.omega, 7j * form.q)
    assert np.isclose(again.l1, form.l1, rtol=1e-11)
    assert np.isclose(np.vdot(again.q, again.q), 1.0)
    assert np.isclose(np.vdot(again.p, again.q), 1.0)
    with pytest.raises(ValueError, match="name a parameter"):
        again.amplitude_coefficient()


def test_second_order_motion_satisfies_the_equation_to_third_order():
    """u(t) from q, h20, h11 leaves a defect of order radius^3."""
    system = brusselator()
    point, form = hopf_of(system, [1.0, 1.5], {"A": 1.0, "B": 1.5}, "B", 0.5, 3.0)
    defects = []
    for radius in (2e-2, 1e-2):
        t = np.linspace(0, 2 * np.pi, 33)
        h = 1e-4
        rate = (form.orbit(radius, t + h) - form.orbit(radius, t - h)) / (2 * h) * form.omega
        force = np.array([system.residual(u, point.mu) for u in form.orbit(radius, t)])
        defects.append(np.abs(rate - force).max())
    assert 2.7 < np.log2(defects[0] / defects[1]) < 3.3


def test_linear_system_is_degenerate():
    system = JaxSystem(lambda u, mu: jnp.stack([mu["mu"] * u[0] - u[1], u[0] + mu["mu"] * u[1]]), 2)
    _, form = hopf_of(system, [0, 0], {"mu": -0.5}, "mu", -1, 1)
    assert form.criticality == "degenerate"
    assert form.amplitude_coefficient() == np.inf


def test_what_is_no_hopf_point_is_refused():
    system = bautin()
    with pytest.raises(NotABifurcation, match="positive frequency"):
        hopf_normal_form(system, [0, 0], {"mu": 0.0, "nu": 0.0}, 0.0, np.ones(2))
    nilpotent = JaxSystem(lambda u, mu: jnp.stack([-u[1] + u[2], u[0] + u[3], -u[3], u[2]]), 4)
    with pytest.raises(NotABifurcation, match="not simple"):
        q = np.array([1, -1j, 0, 0])
        hopf_normal_form(nilpotent, np.zeros(4), {}, 1.0, q)


def amplitude_of(system, mu, eigenvalue, unit=1.0):
    periodic, rest = FirstOrderSystem(system), np.zeros(2)
    forms = SystemForms(system, rest, mu)
    return amplitude_equation(forms, lambda m: -periodic.residual(m, mu), eigenvalue, [1, -1j], [1.0, 0.0], unit)


@pytest.mark.parametrize("make", [stuart_landau, warped_stuart_landau])
def test_amplitude_equation_of_a_known_cycle(make):
    """|z|^2 = mu, frequency w - c mu; a mass that depends on the state leaves the orbit as it is."""
    found = amplitude_of(make(), {"mu": 0.1, "w": 2.0, "c": 0.7}, 0.1 + 2j)
    assert np.isclose(found.amplitude, np.sqrt(0.1), rtol=5e-4) and found.attracts
    assert np.isclose(found.frequency, 2.0 - 0.07, rtol=2e-4)
    assert abs(found.amplitude / np.sqrt(0.1) - 1) <= found.residual < 2e-3


@pytest.mark.parametrize("mu, nu, square, attracts", [(-0.05, 0.5, 0.1381966, False), (0.05, -0.5, 0.0854102, True)])
def test_amplitude_equation_to_fifth_order(mu, nu, square, attracts):
    """mu + nu r^2 - r^4 = 0."""
    found = amplitude_of(bautin(), {"mu": mu, "nu": nu}, mu + 1j)
    assert np.isclose(found.amplitude**2, square, rtol=1e-6) and found.attracts is attracts
    assert np.isclose(found.frequency, 1.0, rtol=1e-9)


def test_a_cycle_whose_truncated_series_has_another_slope_attracts():
    """0.9 = x (1 + 3 x)/(1 + 2 x) with x = r^2, that is x + x^2 - 2 x^3 + ...: its Pade sum is exact."""

    def residual(u, mu):
        r2 = u @ u
        a = mu["mu"] - r2 * (1 + 3 * r2) / (1 + 2 * r2)
        return jnp.stack([a * u[0] - u[1], u[0] + a * u[1]])

    found = amplitude_of(JaxSystem(residual, 2), {"mu": 0.9}, 0.9 + 1j)
    assert np.isclose(found.amplitude**2, (0.8 + np.sqrt(11.44)) / 6, rtol=1e-2) and found.attracts


def test_amplitude_equation_sees_through_coordinates():
    """w = u + Q(u) moves on a circle of known radius; u does not, and its swing is that of the inverse."""

    def bent(u):
        x, y = u[0], u[1]
        return jnp.stack([x + 0.3 * x**2 - 0.2 * x * y + 0.1 * y**3, y + 0.4 * y**2 + 0.15 * x**2 * y])

    def residual(u, mu):
        x, y = w = bent(u)
        r2 = w @ w
        a, b = mu["mu"] - r2 + 0.6 * r2**2, 2 - 0.7 * r2
        return jnp.stack([a * x - b * y, b * x + a * y])

    system = JaxSystem(residual, 2, mass=lambda u, mu, c: jax.jvp(bent, (u,), (c,))[1])
    errors = []
    for mu in (0.02, 0.08):
        square = (1 - np.sqrt(1 - 2.4 * mu)) / 1.2
        phases = 2 * np.pi * np.arange(2000) / 2000
        circle = u = np.sqrt(square) * np.array([np.cos(phases), np.sin(phases)])
        for _ in range(60):
            u = circle - (np.array(bent(u)) - u)
        found = amplitude_of(system, {"mu": mu}, mu + 2j, 0.5)
        errors.append(abs(np.ptp(found.extremes()) / np.ptp(u[0]) - 1))
        assert errors[-1] < 2e-4 and 0.05 * found.residual < errors[-1] < 2 * found.residual
        assert np.isclose(found.frequency, 2 - 0.7 * square, rtol=5e-5)
    assert errors[1] > 4 * errors[0]


def test_amplitude_equation_without_a_cycle():
    found = amplitude_of(stuart_landau(), {"mu": -0.1, "w": 2.0, "c": 0.7}, -0.1 + 2j)
    # terms of higher order are rounding here: on some processors they have a root far off, which its residual refuses
    assert np.isnan(found.amplitude) and found.residual == np.inf or found.residual > 1e6
    with pytest.raises(NotABifurcation, match="observed quantity"):
        amplitude_equation(None, None, 2j, [1, -1j], [0.0, 0.0], 1.0)
