"""Leading modes against dense solutions, and awkward input."""

import numpy as np
import pytest

from eigen import CoupledPencil, SearchOptions, Workspace, leading_modes
from eigen.search import band_sought, holding_shift
from eigen.spectrum import END
from tests.systems.plate_over_channel import plate_over_channel
from tests.systems.random_pencils import dense_eigenvalues, leading_of, random_pencil


@pytest.fixture(scope="module")
def plate():
    return plate_over_channel(5, 8)


@pytest.mark.parametrize("method", ["dense", "krylov"])
@pytest.mark.parametrize("added_mass", [False, True])
@pytest.mark.parametrize("n, m, b", [(40, 0, 0), (40, 5, 0), (40, 6, 1), (30, 5, 2)])
def test_random_pencils_against_dense_solutions(method, added_mass, n, m, b):
    pencil = random_pencil(np.random.default_rng(n + m + b), n, m, b, added_mass=added_mass, density=0.2)
    # a band above all frequencies: random pencils are not ordered by damping
    modes = leading_modes(pencil, 8, SearchOptions(method=method, max_frequency=10.0))
    expected = leading_of(dense_eigenvalues(pencil), 8)
    assert np.abs(expected).max() < 20 * np.pi
    assert modes.status == "complete"
    assert np.abs(modes.eigenvalues - expected).max() < 1e-9 * np.abs(expected).max()
    assert modes.residual.max() < 1e-8
    structure, fluid = pencil.terms(modes.eigenvalues, modes.q, modes.u)
    assert np.linalg.norm(sum(structure)) < 1e-8 * np.linalg.norm(structure[2])
    if b:
        assert np.linalg.norm(sum(fluid)) < 1e-8 * np.linalg.norm(fluid[0])


@pytest.mark.parametrize("density, storage", [(1e-3, True), (10.0, False), (1000.0, True), (2e4, False)])
def test_plate_over_four_decades_of_density_against_dense(storage, density):
    pencil = plate_over_channel(5, 8, density=density, storage=storage)
    assert pencil.order > 300
    modes = leading_modes(pencil, 4, SearchOptions(method="krylov", max_frequency=60.0))
    values = dense_eigenvalues(pencil)
    expected = leading_of(values[values.imag <= 120 * np.pi], 4)
    assert modes.complete_above <= modes.growth_rate[-1]
    assert np.abs(modes.eigenvalues - expected).max() < 1e-6 * np.abs(expected).max()


@pytest.mark.slow
def test_the_leading_modes_depend_neither_on_the_number_nor_on_the_shift(plate):
    few = leading_modes(plate, 4, SearchOptions(max_frequency=40.0))
    for options, count in (
        (SearchOptions(max_frequency=40.0), 8),
        (SearchOptions(shifts=(250.0,), max_frequency=40.0), 4),
        (SearchOptions(shifts=(300.0, 80 + 150j), max_frequency=40.0), 4),
    ):
        other = leading_modes(plate, count, options)
        assert np.abs(other.eigenvalues[:4] - few.eigenvalues).max() < 1e-8 * np.abs(few.eigenvalues).max()
        assert other.complete_above <= few.growth_rate[-1]


def test_the_region_holds_what_it_claims(plate):
    modes = leading_modes(plate, 5, SearchOptions(method="krylov", max_frequency=30.0))
    values = dense_eigenvalues(plate)
    inside = values[
        (values.real >= modes.complete_above)
        & (values.real <= modes.complete_below)
        & (values.imag >= 0)
        & (values.imag <= 60 * np.pi)
    ]
    assert inside.size >= 5
    for value in leading_of(inside, 5):
        assert np.abs(modes.eigenvalues - value).min() < 1e-7 * abs(value)


@pytest.mark.slow
def test_several_shifts_give_no_duplicates(plate):
    modes = leading_modes(plate, 4, SearchOptions(shifts=(200.0, 60 + 100j, 60 + 180j)))
    gaps = np.abs(modes.eigenvalues[:, None] - modes.eigenvalues) + 1e9 * np.eye(len(modes))
    assert gaps.min() > 1e-3
    assert len(modes.shifts) == 3


def test_multiple_eigenvalues_are_all_found():
    # two identical uncoupled oscillators
    K = np.diag([4.0, 4.0, 9.0])
    modes = leading_modes(CoupledPencil(M=np.eye(3), C=0.1 * np.eye(3), K=K), 3, SearchOptions(left=True))
    frequencies = np.sort(np.abs(modes.eigenvalues))
    assert np.allclose(frequencies, [2, 2, 3])
    assert modes.biorthogonality < 1e-10


def test_a_defective_pair_is_reported():
    # (s + 1)^2 = 0: critical damping
    pencil = CoupledPencil(M=np.eye(1), C=[[2.0]], K=[[1.0]])
    modes = leading_modes(pencil, 2, SearchOptions(left=True))
    assert np.abs(modes.eigenvalues + 1).max() < 1e-6
    assert modes.residual.max() < 1e-8
    assert any("defective" in note for note in modes.notes)


def test_shift_on_an_eigenvalue_is_moved_and_said():
    K = np.diag(np.arange(1.0, 41.0) ** 2)
    K[0, 0] = -4.0
    pencil = CoupledPencil(M=np.eye(40), C=0.0 * np.eye(40), K=K)
    modes = leading_modes(pencil, 3, SearchOptions(shifts=(2.0,), method="krylov"))
    assert modes.eigenvalues[0] == pytest.approx(2.0, abs=1e-10)
    assert any("sits on an eigenvalue" in note for note in modes.notes)


def test_singular_stiffness():
    K = np.diag(np.arange(60.0) ** 2)
    modes = leading_modes(
        CoupledPencil(M=np.eye(60), C=0.1 * np.eye(60), K=K), 3, SearchOptions(method="krylov", max_frequency=0.5)
    )
    assert modes.eigenvalues[0] == pytest.approx(0.0, abs=1e-9)
    assert np.allclose(modes.growth_rate[1:3], -0.05)


def test_zero_damping():
    K = np.diag(np.arange(1.0, 81.0) ** 2)
    modes = leading_modes(
        CoupledPencil(M=np.eye(80), C=np.zeros((80, 80)), K=K),
        4,
        SearchOptions(method="krylov", max_frequency=4.5 / (2 * np.pi)),
    )
    assert np.allclose(np.sort(modes.eigenvalues.imag), [1, 2, 3, 4])
    assert np.abs(modes.growth_rate).max() < 1e-8


def test_more_modes_than_there_are():
    pencil = random_pencil(np.random.default_rng(5), 6, 2, 1)
    for method in ("dense", "krylov"):
        modes = leading_modes(pencil, 50, SearchOptions(method=method))
        values = dense_eigenvalues(pencil)
        assert len(modes) == np.sum(values.imag >= 0)
        assert modes.status == "complete"
        assert any("no more" in note for note in modes.notes)
        assert modes.complete_above == -np.inf


@pytest.mark.slow
def test_two_hundred_modes_of_an_undamped_plate():
    pencil = plate_over_channel(6, 12, beta=0.0, density=1e-3, follower=0.0)
    modes = leading_modes(pencil, 200, SearchOptions(left=False))
    assert len(modes) == 200
    assert modes.residual.max() < 1e-8
    expected = np.sort(np.abs(dense_eigenvalues(pencil).imag))
    for value in modes.eigenvalues[modes.eigenvalues.imag > 0]:
        assert np.abs(expected - value.imag).min() < 1e-5 * abs(value)


def test_fewer_than_asked_in_the_band_is_said(plate):
    modes = leading_modes(plate, 30, SearchOptions(max_frequency=10.0))
    assert modes.status == "incomplete"
    assert len(modes) < 30
    assert any("30 modes were asked for" in note for note in modes.notes)


def test_a_workspace_serves_one_pencil_after_another(plate):
    workspace = Workspace()
    other = plate_over_channel(5, 8, density=200.0, beta=2e-3)
    small = random_pencil(np.random.default_rng(1), 50, 3, 1)
    for pencil in (plate, other, small, plate):
        modes = leading_modes(pencil, 3, SearchOptions(method="krylov"), workspace=workspace)
        fresh = leading_modes(pencil, 3, SearchOptions(method="krylov"))
        assert np.allclose(modes.eigenvalues, fresh.eigenvalues, rtol=1e-9)


@pytest.mark.parametrize(
    "parts, message",
    [
        ({"M": np.eye(2), "C": np.eye(3), "K": np.eye(2)}, "has shape"),
        ({"M": np.eye(2), "C": np.eye(2), "K": np.diag([1.0, np.nan])}, "not finite"),
        ({"M": np.eye(2), "C": np.eye(2), "K": 1j * np.eye(2)}, "must be real"),
        ({"M": np.eye(2), "C": np.eye(2), "K": np.eye(2), "G": np.ones((2, 1))}, "give both or neither"),
        (
            {
                "M": np.eye(2),
                "C": np.eye(2),
                "K": np.eye(2),
                "G": np.ones((2, 1)),
                "J": np.ones((1, 2)),
                "S0": [[1.0]],
                "B0": np.ones((1, 2)),
            },
            "B0",
        ),
    ],
)
def test_wrong_pencils_are_refused(parts, message):
    with pytest.raises(ValueError, match=message):
        CoupledPencil(**parts)


@pytest.mark.parametrize(
    "wrong",
    [
        {"max_frequency": -1.0},
        {"method": "fast"},
        {"shifts": ()},
        {"tolerance": 0.0},
        {"shifts": (np.inf,)},
        {"max_shifts": 0},
    ],
)
def test_wrong_options_are_refused(wrong):
    with pytest.raises(ValueError):
        SearchOptions(**wrong)


def test_zero_modes_are_refused(plate):
    with pytest.raises(ValueError, match="at least 1"):
        leading_modes(plate, 0)


def test_a_disc_through_the_limit_point_holds_the_band():
    """From its centre on the real axis the corner of the band and of the growth rate is as far as the limit point."""
    options, growth = SearchOptions(max_frequency=400.0, limit_point=-300.0), -20.0
    centre = holding_shift(options, growth)
    corner = complex(growth, band_sought(options))
    assert abs(corner - centre) == pytest.approx(centre + END * 300.0) and centre > 0
    assert holding_shift(SearchOptions(limit_point=-300.0), growth) == 0.0
