"""Fold and Hopf curves in two parameters against closed forms."""

import jax.numpy as jnp
import numpy as np
import pytest

from continuation import Branch, ContinuationOptions, NotABifurcation, Reason, continue_fold, continue_hopf, resume
from continuation.jax_system import JaxSystem
from tests.continuation.known import bautin, bogdanov_takens, brusselator, cusp
from tests.systems.following import follow, hopf_of


@pytest.fixture(scope="module")
def cusp_fold():
    return follow(cusp(), [-1.5], {"a": -2.0, "b": 1.0}, "a", (-2.0, 2.0), eigenvalues=0).of_kind("fold")[0]


@pytest.fixture(scope="module")
def takens():
    return follow(bogdanov_takens(), [-1.2, 0.0], {"b1": -0.3, "b2": -1.0, "s": -1.0}, "b1", (-0.5, 2.0), max_step=0.1)


def test_fold_curve_through_a_cusp(cusp_fold):
    curve = continue_fold(cusp(), cusp_fold, ("a", "b"), ContinuationOptions(direction=-1, limits={"b": (-1.0, 3.0)}))
    a, b = curve.values("a"), curve.values("b")
    assert np.abs(27 * a**2 - 4 * b**3).max() < 1e-9
    (point,) = curve.of_kind("cusp")
    assert abs(point.mu["a"]) < 1e-9 and abs(point.mu["b"]) < 1e-9
    # It starts at b = 1, passes the tip and leaves on the other side through b = 3.
    assert a[0] > 0 > a[-1] and b[-1] == 3.0 and curve.reason == "ended on the limit b = 3"


def test_fold_curve_through_a_bogdanov_takens_point(takens):
    fold = takens.of_kind("fold")[0]
    curve = continue_fold(
        bogdanov_takens(), fold, ("b1", "b2"), ContinuationOptions(limits={"b2": (-2.0, 2.0)}, eigenvalues=2)
    )
    assert np.abs(curve.values("b2") ** 2 - 4 * curve.values("b1")).max() < 1e-9
    (point,) = curve.of_kind("bogdanov-takens")
    assert abs(point.mu["b1"]) < 1e-9 and abs(point.mu["b2"]) < 1e-9
    # The other eigenvalue is s x = b2 / 2: the count changes sign at the point.
    assert np.all((curve.unstable == 1) == (curve.values("b2") > 0))


def test_hopf_curve_ends_at_the_bogdanov_takens_point(takens):
    hopf = takens.of_kind("hopf")[0]
    curve = continue_hopf(bogdanov_takens(), hopf, ("b1", "b2"), ContinuationOptions(limits={"b2": (-2.0, 2.0)}))
    assert curve.reason == "stopped at: bogdanov-takens"
    w = curve.values("omega")
    assert np.all(w > 0)  # the mirror image behind the point is left out
    assert np.abs(w**2 + curve.values("b2")).max() < 1e-9
    assert np.abs(curve.values("b1")).max() < 1e-9
    (point,) = curve.of_kind("bogdanov-takens")
    assert abs(point.mu["b1"]) < 1e-9 and abs(point.mu["b2"]) < 1e-8
    # From there the fold curve starts too.
    fold = continue_fold(bogdanov_takens(), point, ("b1", "b2"), ContinuationOptions(limits={"b2": (-2.0, 2.0)}))
    assert np.abs(fold.values("b2") ** 2 - 4 * fold.values("b1")).max() < 1e-9
    assert fold.values("b2")[-1] == 2.0


def test_generalised_hopf_point():
    hopf = hopf_of(bautin(), [0, 0], {"mu": -0.5, "nu": -0.5}, "mu", (-1, 1))
    curve = continue_hopf(bautin(), hopf, ("mu", "nu"), ContinuationOptions(limits={"nu": (-1, 1)}))
    # c1 = nu per |z|^2, twice that with q* q = 1.
    assert np.allclose(curve.values("l1"), 2 * curve.values("nu"), rtol=0, atol=1e-10)
    (point,) = curve.of_kind("generalised hopf")
    assert abs(point.mu["nu"]) < 1e-9
    # From there the curve starts too, of an equilibrium that stays where it is.
    other = continue_hopf(bautin(), point, ("mu", "nu"), ContinuationOptions(limits={"nu": (-1, 1)}, direction=-1))
    assert other.values("nu")[-1] == -1 and np.abs(other.values("mu")).max() < 1e-9


@pytest.mark.slow
def test_the_unit_of_time_does_not_matter_to_a_hopf_curve():
    plain, options = brusselator(), ContinuationOptions(limits={"A": (0.5, 2.0)})
    lengths = []
    for unit in (1.0, 1e-3):
        system = JaxSystem(lambda u, mu, unit=unit: unit * plain._residual(u, mu), 2)
        hopf = hopf_of(system, [1.0, 1.0], {"A": 1.0, "B": 1.0}, "B", (0.5, 4.0))
        curve = continue_hopf(system, hopf, ("B", "A"), options)
        assert curve.reason.kind is Reason.LIMIT and curve.values("A")[-1] == 2.0
        lengths.append(len(curve))
    assert max(lengths) - min(lengths) <= 2


def test_zero_hopf_point_and_counts():
    """A Hopf pair and, decoupled, a real eigenvalue a."""

    def residual(u, mu):
        x, y, z = u
        return jnp.stack([mu["mu"] * x - y - x**3, x + mu["mu"] * y, mu["a"] * z - z**3])

    system = JaxSystem(residual, 3)
    hopf = hopf_of(system, np.zeros(3), {"mu": -0.5, "a": -0.6}, "mu", (-1, 1))
    curve = continue_hopf(system, hopf, ("mu", "a"), ContinuationOptions(limits={"a": (-1, 1)}, eigenvalues=3))
    (point,) = curve.of_kind("zero-hopf")
    assert abs(point.mu["a"]) < 1e-9
    assert np.array_equal(curve.unstable, (curve.values("a") > 0).astype(int))


def test_curve_with_a_turning_point_in_both_parameters():
    """Hopf at mu^2 + nu^2 = 1: an isolated island of instability, closed in the plane."""

    def residual(u, mu):
        g = 1 - mu["mu"] ** 2 - mu["nu"] ** 2
        return jnp.stack([g * u[0] - 2 * u[1] - u[0] ** 3, 2 * u[0] + g * u[1]])

    system = JaxSystem(residual, 2)
    points = follow(system, np.zeros(2), {"mu": -2.0, "nu": 0.1}, "mu", (-2, 2)).of_kind("hopf")
    assert len(points) == 2
    curve = continue_hopf(system, points[0], ("mu", "nu"), ContinuationOptions(max_step=0.2))
    assert curve.reason.kind is Reason.CLOSED
    assert np.abs(curve.values("mu") ** 2 + curve.values("nu") ** 2 - 1).max() < 1e-9
    # It passes through the other point: the same curve, not another.
    angle = np.unwrap(np.arctan2(curve.values("nu"), curve.values("mu")))
    assert abs(angle[-1] - angle[0]) > 0.95 * 2 * np.pi


def test_curves_are_saved_and_resumed(tmp_path, cusp_fold):
    options = ContinuationOptions(direction=-1, limits={"b": (-1.0, 3.0)})
    whole = continue_fold(cusp(), cusp_fold, ("a", "b"), options)
    part = continue_fold(
        cusp(), cusp_fold, ("a", "b"), ContinuationOptions(direction=-1, limits={"b": (-1.0, 3.0)}, max_points=9)
    )
    assert part.reason.kind is Reason.POINTS
    part.save(tmp_path / "curve.h5")
    longer = resume(cusp(), Branch.load(tmp_path / "curve.h5"), options)
    assert len(longer) == len(whole)
    assert np.allclose(longer.values("a"), whole.values("a"), rtol=0, atol=1e-8)
    assert len(longer.of_kind("cusp")) == 1
    assert longer.plot().get_ylabel() == "b"


def test_wrong_starts_are_refused(cusp_fold, takens):
    with pytest.raises(NotABifurcation, match="hopf curve starts at"):
        continue_hopf(cusp(), cusp_fold, ("a", "b"))
    with pytest.raises(ValueError, match="two different parameters"):
        continue_fold(cusp(), cusp_fold, ("a", "a"))
