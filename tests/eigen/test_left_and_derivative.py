"""Left vectors and eigenvalue derivatives."""

import numpy as np
import pytest

from eigen import (
    CoupledPencil,
    PencilDerivative,
    Relaxation,
    SearchOptions,
    difference,
    eigenvalue_derivative,
    leading_modes,
)
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
@pytest.mark.parametrize("m, b", [(0, 0), (4, 0), (4, 1), (4, 2)])
def test_left_vectors_and_their_scaling(options, m, b):
    check_left_vectors(random_pencil(np.random.default_rng(m + b), 30, m, b), options)


@pytest.mark.parametrize("method", ["dense", "krylov"])
@pytest.mark.parametrize("m, b", [(0, 0), (4, 0), (4, 1), (4, 2)])
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


def changed(pencil, change, step):
    names = [
        n
        for n in ("M", "C", "K", "G", "J", "A0", "A1", "A2", "B0", "B1", "R0", "R1", "R2", "S0", "S1")
        if getattr(change, n) is not None
    ]
    return pencil.replace(**{n: getattr(pencil, n) + step * getattr(change, n) for n in names})


def test_derivative_with_respect_to_every_part():
    rng = np.random.default_rng(4)
    pencil = random_pencil(rng, 10, 3, 2)
    modes = leading_modes(pencil, 3, SearchOptions(left=True))
    for name in ("M", "C", "K", "G", "J", "A0", "A1", "A2", "B0", "B1", "R0", "R1", "R2", "S0", "S1"):
        part = getattr(pencil, name)
        change = PencilDerivative(**{name: rng.standard_normal(part.shape)})
        h = 1e-5
        for i in range(len(modes)):
            predicted = eigenvalue_derivative(pencil, modes.mode(i), change)
            ends = []
            for step in (h, -h):
                values = leading_modes(changed(pencil, change, step), 50).eigenvalues
                ends.append(values[np.argmin(np.abs(values - modes.eigenvalues[i]))])
            assert predicted == pytest.approx((ends[0] - ends[1]) / (2 * h), abs=1e-5 * (1 + abs(predicted)))


def test_derivative_with_respect_to_what_relaxes():
    rng = np.random.default_rng(6)
    pencil = relaxing_random(rng, 10, 3, 2)
    known = pencil.relaxation
    modes = leading_modes(pencil, 4, SearchOptions(left=True))
    strengths, times = (
        rng.uniform(0, 1, known.strengths.shape) * known.strengths,
        rng.uniform(0, 1, known.times.shape) * known.times,
    )
    stiffer = tuple(m @ m for m in known.matrices)
    changes = {
        "strengths": PencilDerivative(strengths=strengths),
        "times": PencilDerivative(times=times),
        "relaxing": PencilDerivative(relaxing=stiffer),
        "by callables": PencilDerivative(relaxing=tuple(m.__matmul__ for m in stiffer)),
    }
    step = 1e-5
    for name, change in changes.items():

        def moved(h):
            matrices = [m + h * x for m, x in zip(known.matrices, stiffer)] if change.relaxing else known.matrices
            other = Relaxation(
                matrices,
                known.strengths + (h * strengths if name == "strengths" else 0),
                known.times + (h * times if name == "times" else 0),
            )
            return pencil.replace(relaxation=other)

        ends = [leading_modes(moved(h), 50).eigenvalues for h in (step, -step)]
        for i, value in enumerate(modes.eigenvalues):
            predicted = eigenvalue_derivative(pencil, modes.mode(i), change)
            up, down = (v[np.argmin(np.abs(v - value))] for v in ends)
            assert predicted == pytest.approx((up - down) / (2 * step), abs=1e-5 * (1 + abs(predicted)))
            whole = difference(moved(-step), moved(step), 2 * step)
            assert eigenvalue_derivative(pencil, modes.mode(i), whole) == pytest.approx(predicted, rel=1e-6, abs=1e-9)
    elastic = pencil.replace(relaxation=None)
    with pytest.raises(ValueError, match="relaxes"):
        mode = leading_modes(elastic, 1, SearchOptions(left=True)).mode(0)
        eigenvalue_derivative(elastic, mode, changes["times"])


def test_derivative_with_callables_and_density():
    base, step = plate_over_channel(4, 8, density=10.0), 1e-4
    more, less = (plate_over_channel(4, 8, density=10.0 + d) for d in (step, -step))
    search = SearchOptions(left=True, method="krylov", max_frequency=40.0)
    modes = leading_modes(base, 3, search)
    change = difference(less, more, 2 * step)
    as_callable = PencilDerivative(
        K=lambda x: 0 * x,
        **{n: getattr(change, n) for n in ("A0", "A1", "A2", "B0", "B1", "R0", "R1", "R2", "S0", "S1")},
    )
    up, down = (leading_modes(p, 3, search).eigenvalues for p in (more, less))
    for i in range(3):
        predicted = eigenvalue_derivative(base, modes.mode(i), change)
        assert predicted == pytest.approx((up[i] - down[i]) / (2 * step), rel=1e-4, abs=1e-5)
        assert eigenvalue_derivative(base, modes.mode(i), as_callable) == pytest.approx(predicted, rel=1e-9)


def test_derivative_needs_left_vectors():
    pencil = CoupledPencil(M=np.eye(1), C=[[0.1]], K=[[1.0]])
    with pytest.raises(ValueError, match="left"):
        eigenvalue_derivative(pencil, leading_modes(pencil, 1).mode(0), PencilDerivative(K=np.eye(1)))
