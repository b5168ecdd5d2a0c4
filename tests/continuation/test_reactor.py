"""Random branches of the stirred reactor of Uppal, Ray and Poore with default steps, held against closed forms.

Chem. Eng. Sci. 29 (1974) 967-985: ``x' = -x + D (1 - x) exp(y)``, ``y' = -y + B D (1 - x) exp(y) - b y``.  Along the
equilibria ``y = k x`` with ``k = B / (1 + b)`` and ``D = x exp(-k x) / (1 - x)``, so that folds fulfil
``k x (1 - x) = 1`` and Hopf points ``(B x - 1 - b) (1 - x) = 1`` with a positive determinant.
"""

import jax.numpy as jnp
import numpy as np
import pytest

from continuation import ContinuationOptions, OrbitOptions, continue_branch, orbit_at, orbits_from_hopf
from continuation.jax_system import JaxSystem

FIRST = 1e-4


def _residual(u, mu):
    rate = mu["D"] * (1 - u[0]) * jnp.exp(u[1])
    return jnp.stack([-u[0] + rate, -u[1] + mu["B"] * rate - mu["b"] * u[1]])


REACTOR = JaxSystem(_residual, 2)


def _expected(B, b, limit):
    """Kinds and Damköhler numbers of the special points that the branch meets before its limit."""
    k = B / (1 + b)

    def damkoehler(x):
        return x / ((1 - x) * np.exp(k * x))

    folds = [] if k <= 4 else [(1 - r) / 2 for r in (np.sqrt(1 - 4 / k), -np.sqrt(1 - 4 / k))]
    traceless = [x.real for x in np.roots([-B, B + 1 + b, -(2 + b)]) if x.imag == 0 and 0 < x.real < 1]
    hopf = [x for x in traceless if (1 + b - B * x) / (1 - x) + B * x**2 / (1 - x) > 0]
    x = np.linspace(0, 1, 400001)[1:-1]
    after = np.argmax(damkoehler(x) > FIRST)
    beyond = np.flatnonzero(damkoehler(x[after:]) > limit)
    last = x[after + beyond[0]] if beyond.size else 1.0
    met = [("fold", x) for x in folds] + [("hopf", x) for x in hopf]
    return sorted((kind, damkoehler(x)) for kind, x in met if x < last)


def _branch_is_right(seed):
    draw = np.random.default_rng(seed)
    B, b, limit = draw.uniform(5, 25), draw.uniform(0.5, 4), 10 ** draw.uniform(-2.5, 0.5)
    options = ContinuationOptions(eigenvalues=2, limits={"D": (0.0, limit)})
    branch = continue_branch(REACTOR, [0.0, 0.0], {"D": FIRST, "B": B, "b": b}, "D", options)
    assert branch.reason == f"ended on the limit D = {limit:.6g}" and branch.mu(-1)["D"] == limit, (seed, branch.reason)
    assert all(special.located for special in branch.special), (seed, branch.special)
    found = sorted((special.kind, special.mu["D"]) for special in branch.special)
    expected = _expected(B, b, limit)
    assert [kind for kind, _ in found] == [kind for kind, _ in expected], (seed, found, expected)
    assert np.allclose([D for _, D in found], [D for _, D in expected], rtol=0, atol=1e-7), (seed, found, expected)


@pytest.mark.parametrize("seeds", [range(8), pytest.param(range(8, 200), marks=pytest.mark.slow)], ids=str)
def test_branches_meet_their_folds_hopf_points_and_limits(seeds):
    for seed in seeds:
        _branch_is_right(seed)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [9, pytest.param(2, marks=pytest.mark.slow)])
def test_orbits_of_the_reactor_have_the_mean_divergence_for_exponent(seed):
    """Liouville: the exponent of a planar orbit is the mean of the trace along it; towards homoclinic orbits too."""
    draw = np.random.default_rng(seed)
    B, b, limit = draw.uniform(5, 25), draw.uniform(0.5, 4), 10 ** draw.uniform(-2.5, 0.5)
    limits, mu = {"D": (0.0, limit)}, {"D": FIRST, "B": B, "b": b}
    branch = continue_branch(REACTOR, [0.0, 0.0], mu, "D", ContinuationOptions(eigenvalues=2, limits=limits))
    assert branch.of_kind("hopf")
    for hopf in branch.of_kind("hopf"):
        orbits = orbits_from_hopf(
            REACTOR, hopf, "D", ContinuationOptions(limits=limits), OrbitOptions(max_harmonics=40)
        )
        assert all(special.located for special in orbits.special), orbits
        assert orbits.points[0].unstable == (0 if hopf.values["criticality"] == "super" else 1)
        for i in range(0, len(orbits), 2):
            orbit = orbit_at(REACTOR, orbits, i)
            states = orbit(np.linspace(0, orbit.period, 400, endpoint=False))
            trace = np.mean([np.trace(REACTOR.linear(u, orbit.mu).jacobian) for u in states])
            if orbits.unstable[i] >= 0:
                assert np.isclose(orbit.exponents[0].real, trace, rtol=1e-5, atol=1e-7 * orbit.motion.omega)
