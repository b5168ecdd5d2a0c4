"""Branch switching at simple branch points."""

import jax.numpy as jnp
import numpy as np
import pytest

from continuation import ContinuationOptions, NotABifurcation, continue_branch, switch_branch
from continuation.jax_system import JaxSystem
from tests.continuation.known import pitchfork, transcritical
from tests.systems.following import follow

OPTIONS = ContinuationOptions(eigenvalues=2, limits={"mu": (-1.0, 1.0)}, max_step=0.3)


def test_pitchfork():
    system = pitchfork()
    trunk = continue_branch(system, np.zeros(2), {"mu": -1.0, "e": 0.0}, "mu", OPTIONS)
    (point,) = trunk.of_kind("branch point")
    assert abs(point.mu["mu"]) < 1e-10
    ends = []
    for side in (1, -1):
        branch = switch_branch(system, point, "mu", OPTIONS, side)
        x, mu = branch.states[:, 0], branch.values()
        assert np.abs(x**2 - mu).max() < 1e-8
        assert np.all(np.abs(x) > 1e-3)
        assert set(branch.unstable) == {0}
        ends.append(branch.states[-1, 0])
    assert np.allclose(sorted(ends), [-1.0, 1.0])


def test_transcritical():
    system = transcritical()
    trunk = continue_branch(system, np.zeros(2), {"mu": -1.0}, "mu", OPTIONS)
    (point,) = trunk.of_kind("branch point")
    for side in (1, -1):
        branch = switch_branch(system, point, "mu", OPTIONS, side)
        assert np.abs(branch.states[:, 0] - branch.values()).max() < 1e-9
        # Exchange of stability: the branch x = mu is stable for mu > 0.
        assert np.all((branch.unstable == 0) == (branch.values() > 0))
    # A limit nearer than a first step is the end of the branch that goes there.
    near = ContinuationOptions(limits={"mu": (-1.0, 1e-3)})
    ends = sorted(switch_branch(system, point, "mu", near, side).values()[-1] for side in (1, -1))
    assert ends == [-1.0, 1e-3]


def test_a_branch_far_from_the_unit_of_the_first():
    """(u - 5)(r - (u - 5)/10): the state rests at 5 on the first branch, and is 5 + 10 r on the other."""
    system = JaxSystem(lambda u, mu: (u - 5.0) * (mu["r"] - (u - 5.0) / 10), 1)
    options = ContinuationOptions(limits={"r": (-1.0, 1.0)})
    (point,) = continue_branch(system, [5.0], {"r": -1.0}, "r", options).special
    for side in (1, -1):
        branch = switch_branch(system, point, "r", options, side)
        assert np.allclose(branch.states[:, 0], 5 + 10 * branch.values(), rtol=0, atol=1e-7)
        assert abs(branch.values()[-1]) == 1.0


@pytest.mark.slow
def test_points_on_both_sides_of_the_buckled_column_tree():
    """Euler's elastica, discrete: buckling at the closed-form loads, switch to the first."""
    n = 6

    def residual(u, mu):
        # Hinged links with rotational springs; angles u, load p: gradient of the energy.
        bend = jnp.diff(jnp.concatenate([jnp.zeros(1), u]))
        moment = jnp.concatenate([bend[:-1] - bend[1:], bend[-1:]])
        return mu["p"] * jnp.sin(u) - moment

    system = JaxSystem(residual, n)
    # K has the eigenvalues 4 sin^2((2k-1) pi / (4 n + 2)) of a fixed-free chain.
    exact = 4 * np.sin((2 * np.arange(1, 3) - 1) * np.pi / (4 * n + 2)) ** 2
    options = ContinuationOptions(limits={"p": (0.0, 0.6)}, step=0.02, max_step=0.05, eigenvalues=n)
    trunk = continue_branch(system, np.zeros(n), {"p": 0.0}, "p", options)
    points = trunk.of_kind("branch point")
    assert np.allclose([s.mu["p"] for s in points], exact, rtol=1e-9)
    buckled = switch_branch(system, points[0], "p", options)
    assert np.all(np.abs(buckled.states[:, -1]) > 1e-3)
    assert np.all(buckled.values() >= exact[0] - 1e-9)  # supercritical
    assert set(buckled.unstable) == {0}


def test_only_located_branch_points_will_do():
    system = pitchfork()
    trunk = follow(system, np.zeros(2), {"mu": -1.0, "e": 0.0}, "mu", (-1.0, 1.0), branch_points=False)
    with pytest.raises(NotABifurcation, match="zero eigenvalue"):
        switch_branch(system, trunk.special[0], "mu", OPTIONS)
