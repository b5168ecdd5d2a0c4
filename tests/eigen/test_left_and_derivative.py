"""Left vectors and eigenvalue derivatives."""

import numpy as np
import pytest

from eigen import CoupledPencil, SearchOptions, eigenvalue_derivative, leading_modes
from eigen.operator import FLUID_PARTS
from tests.systems.plate_over_channel import plate_over_channel
from tests.systems.random_pencils import random_pencil
from tests.systems.relaxing import relaxing_random


def full_matrix(pencil, s):
    A, B, R, S = pencil.fluid_at(s)
    G, J = pencil.G.toarray(), pencil.J.toarray()
    D = (s * s * pencil.M + s * pencil.C + pencil.K).toarray()
    if pencil.relaxation is not None:
        D = D + sum(x * m.toarray() for x, m in zip(pencil.relaxation.factors(s), pencil.relaxing))
    return np.block([[D - G @ A @ J, -G @ B], [R @ J, S]])


@pytest.mark.parametrize(
    "options",
    [
        SearchOptions(left=True, method="dense", max_frequency=10.0),
        SearchOptions(left=True, method="krylov", max_frequency=10.0),
        SearchOptions(left=True, method="krylov", shifts=(0.5 + 2j, 8.0)),
    ],
)
@pytest.mark.parametrize("m, b", [(0, 0), (4, 1), (4, 2)])
def test_left_vectors_and_their_scaling(options, m, b):
    check_left_vectors(random_pencil(np.random.default_rng(m + b), 30, m, b), options)


@pytest.mark.parametrize("method", ["dense", "krylov"])
@pytest.mark.parametrize("m, b", [(0, 0), (4, 1), (4, 2)])
def test_left_vectors_where_the_stiffness_relaxes(method, m, b):
    pencil = relaxing_random(np.random.default_rng(m + b), 30, m, b, scale=0.1)
    check_left_vectors(pencil, SearchOptions(left=True, method=method, max_frequency=10.0))


def check_left_vectors(pencil, options):
    modes = leading_modes(pencil, 5, options)
    assert len(modes) >= 3
    assert modes.biorthogonality < 1e-8
    for i in range(len(modes)):
        mode = modes.mode(i)
        x, w = np.r_[mode.q, mode.u], np.r_[mode.left_q, mode.left_u]
        T = full_matrix(pencil, mode.eigenvalue)
        assert np.linalg.norm(w.conj() @ T) < 1e-8 * np.linalg.norm(T) * np.linalg.norm(w)
        h = 1e-4 * abs(mode.eigenvalue)
        slope = (full_matrix(pencil, mode.eigenvalue + h) - full_matrix(pencil, mode.eigenvalue - h)) / (2 * h)
        assert w.conj() @ slope @ x == pytest.approx(1.0, abs=1e-8)
        assert np.linalg.norm(mode.q) == pytest.approx(1.0)


def difference(mode, low, high, step):
    """(dT) x from two pencils a step apart."""
    x = mode.eigenvalue, mode.q, mode.u
    return tuple((b - a) / step for a, b in zip(low.apply(*x), high.apply(*x)))


@pytest.mark.parametrize("relaxing", [False, True])
def test_derivatives_with_respect_to_every_part(relaxing):
    rng, step = np.random.default_rng(4), 1e-5
    pencil = relaxing_random(rng, 10, 3, 2) if relaxing else random_pencil(rng, 10, 3, 2)
    modes = leading_modes(pencil, 3, SearchOptions(left=True))
    changes = [{name: rng.standard_normal(getattr(pencil, name).shape)} for name in ("M", "C", "K", "G", "J")]
    changes += [{name: rng.standard_normal(getattr(pencil, name).shape)} for name in FLUID_PARTS]
    ends = [
        [pencil.replace(**{n: getattr(pencil, n) + h * x for n, x in one.items()}) for h in (-step, step)]
        for one in changes
    ]
    if relaxing:
        own = pencil.relaxation
        for name, turn in (("strengths", 0.5), ("times", -0.3)):
            scaled = [{name: getattr(own, name) * (1 + h * turn)} for h in (-step, step)]
            kept = {"strengths": own.strengths, "times": own.times}
            ends.append([pencil.replace(relaxation=own.replace(**kept | one)) for one in scaled])
    for low, high in ends:
        below, above = (leading_modes(p, 50).eigenvalues for p in (low, high))
        for i, value in enumerate(modes.eigenvalues):
            mode = modes.mode(i)
            predicted = eigenvalue_derivative(pencil, mode, difference(mode, low, high, 2 * step))
            down, up = (v[np.argmin(np.abs(v - value))] for v in (below, above))
            assert predicted == pytest.approx((up - down) / (2 * step), abs=1e-5 * (1 + abs(predicted)))


def test_derivative_by_the_density():
    base, step = plate_over_channel(4, 8, density=10.0), 1e-4
    less, more = (plate_over_channel(4, 8, density=10.0 + d) for d in (-step, step))
    search = SearchOptions(left=True, method="krylov", max_frequency=40.0)
    modes = leading_modes(base, 3, search)
    up, down = (leading_modes(p, 3, search).eigenvalues for p in (more, less))
    for i in range(3):
        mode = modes.mode(i)
        predicted = eigenvalue_derivative(base, mode, difference(mode, less, more, 2 * step))
        assert predicted == pytest.approx((up[i] - down[i]) / (2 * step), rel=1e-4, abs=1e-5)


def test_derivative_needs_left_vectors():
    mode = leading_modes(pencil := CoupledPencil(M=np.eye(1), C=[[0.1]], K=[[1.0]]), 1).mode(0)
    with pytest.raises(ValueError, match="left"):
        eigenvalue_derivative(pencil, mode, (mode.q, mode.u))


def test_a_defective_eigenvalue_has_no_derivative():
    pencil = CoupledPencil(M=[[1.0]], C=[[2.2]], K=[[1.21]])  # (s + 1.1)^2
    mode = leading_modes(pencil, 1, SearchOptions(left=True)).mode(0)
    with pytest.raises(ValueError, match="defective"):
        eigenvalue_derivative(pencil, mode, (mode.eigenvalue * mode.q, mode.u))
