"""Modes followed along a parameter: crossings, veerings, real pairs that merge and split."""

import numpy as np
import pytest

from eigen import CoupledPencil, Relaxation, SearchOptions, TrackOptions, track
from tests.systems.beam import fluid_conveying_pipe
from tests.systems.plate_over_channel import plate_over_channel
from tests.systems.relaxing import mode_roots


def oscillators(p, coupling=0.0):
    """Two oscillators whose stiffnesses cross at p = 1; coupled, they veer."""
    K = np.array([[1.0 + p, coupling], [coupling, 3.0 - p]])
    return CoupledPencil(M=np.eye(2), C=0.02 * np.eye(2), K=K)


def test_modes_cross_without_swapping():
    branches = track(oscillators, np.linspace(0, 2, 12), TrackOptions(count=2, margin=0))
    assert branches.ids.size == 2
    omega = np.abs(branches.eigenvalues)
    rising = omega[np.argmin(omega[:, 0])]
    assert np.allclose(rising**2, 1 + branches.values, rtol=1e-8)
    assert branches.confidence.min() > 0.8


def test_modes_veer_without_crossing():
    branches = track(lambda p: oscillators(p, 0.05), np.linspace(0, 2, 12), TrackOptions(count=2, margin=0))
    assert branches.ids.size == 2
    upper, lower = branches.eigenvalues.imag[np.argsort(-branches.eigenvalues.imag[:, 0])]
    assert (upper > lower).all()
    # a coarse step over the veering is halved, and followed
    assert branches.solves > 12


def test_real_modes_merge_into_a_pair_and_split_again():
    def pencil(p):  # damping ratio falls through one and rises again
        return CoupledPencil(M=np.eye(1), C=[[2 * (0.6 + (p - 1) ** 2)]], K=[[1.0]])

    values = np.linspace(0, 2, 21)
    branches = track(pencil, values, TrackOptions(count=2, margin=0))
    assert branches.ids.size == 2
    assert np.isfinite(branches.eigenvalues.real).all()
    zeta = 0.6 + (values - 1) ** 2
    oscillating = zeta < 1 - 1e-9
    assert np.allclose(branches.frequency[:, oscillating], np.sqrt(1 - zeta[oscillating] ** 2) / (2 * np.pi))
    assert np.allclose(branches.frequency[:, zeta > 1 + 1e-9], 0.0)
    # before and after, one row each of the slow and the fast decay
    for column in (0, -1):
        slow = -zeta[column] + np.sqrt(zeta[column] ** 2 - 1)
        assert np.isclose(np.sort(branches.growth_rate[:, column])[-1], slow)


def test_modes_along_the_strength_of_relaxation():
    """Each mode keeps to the roots of its own equation while its damping grows from nothing to a fifth."""
    stiffness = np.diag([1.0, 4.0, 9.0])
    times = [10.0, 1.0, 0.1]

    def pencil(p):
        relaxation = Relaxation([stiffness], [[p, p, p]], times)
        return CoupledPencil(M=np.eye(3), C=np.zeros((3, 3)), K=stiffness, relaxation=relaxation)

    values = np.linspace(0.0, 0.4, 9)
    branches = track(pencil, values, TrackOptions(count=3, margin=0))
    assert branches.ids.size == 3 and branches.confidence.min() > 0.8
    squares = np.round(np.abs(branches.eigenvalues[:, 0]) ** 2)
    assert sorted(squares) == [1.0, 4.0, 9.0]
    for row, square in zip(branches.eigenvalues, squares):
        for value, p in zip(row, values):
            roots = mode_roots(square, [p] * 3, times)
            assert np.abs(roots - value).min() < 1e-9


def test_cantilever_pipe_to_flutter():
    search = SearchOptions(method="dense", max_frequency=40.0)
    values = np.linspace(0.5, 6.5, 25)
    branches = track(
        lambda u: fluid_conveying_pipe(u, 0.2, elements=10), values, TrackOptions(count=4, margin=1, search=search)
    )
    # each branch is smooth: second differences stay small against the values
    for row in branches.eigenvalues:
        known = row[np.isfinite(row)]
        if known.size > 4:
            assert np.abs(np.diff(known, 2)).max() < 0.25 * np.abs(known).max()
    assert np.nanmax(branches.growth_rate[:, -1]) > 0  # flutters above u = 5.59
    assert np.nanmax(branches.growth_rate[:, 0]) < 0


@pytest.mark.slow
def test_plate_over_density():
    matrices = plate_over_channel(5, 10)

    def pencil(density):
        other = plate_over_channel(5, 10, density=density)
        return other.replace(M=matrices.M, C=matrices.C, K=matrices.K, G=matrices.G, J=matrices.J)

    values = np.geomspace(1.0, 50.0, 8)
    seen = []
    branches = track(
        pencil,
        values,
        TrackOptions(count=3, margin=3, search=SearchOptions(max_frequency=40.0)),
        observer=lambda value, solves: seen.append(value),
    )
    assert seen == list(values)
    fine = track(
        pencil, np.geomspace(1.0, 50.0, 22), TrackOptions(count=3, margin=3, search=SearchOptions(max_frequency=40.0))
    )
    # the same modes lead to the same ends, in three times as many steps
    whole = np.isfinite(branches.eigenvalues).all(axis=1)
    assert whole.sum() >= 3
    for row in branches.eigenvalues[whole]:
        partner = np.argmin(np.abs(fine.eigenvalues[:, 0] - row[0]))
        assert fine.eigenvalues[partner, -1] == pytest.approx(row[-1], rel=1e-6)


@pytest.mark.parametrize("wrong", [{"count": 0}, {"margin": -1}, {"least_confidence": 1.5}])
def test_wrong_options_are_refused(wrong):
    with pytest.raises(ValueError):
        TrackOptions(**wrong)
