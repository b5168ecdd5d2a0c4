"""The independent count against dense spectra."""

import numpy as np
import pytest
import scipy.sparse as sp

from eigen import (
    CoupledPencil,
    Relaxation,
    SearchOptions,
    TransferBasis,
    certified_spectrum,
    leading_modes,
    unstable_count,
)
from eigen.certificate import response_error
from tests.systems.plate_over_channel import plate_over_channel
from tests.systems.random_pencils import dense_eigenvalues, random_pencil
from tests.systems.relaxing import STRENGTHS, TIMES, relaxing_random


def random_case(rng, relaxing=False):
    m = int(rng.integers(0, 4))
    size = int(rng.integers(1, 9)), m, int(rng.integers(0, 3)) if m else 0
    if relaxing:
        own = {"groups": int(rng.integers(1, 4)), "branches": int(rng.integers(1, 5))}
    else:
        own = {"added_mass": rng.random() < 0.5}
    own |= {
        "unsymmetric": rng.random() < 0.6,
        "damping": rng.choice(["general", "positive", "none", "mass"]),
        "scale": 10 ** rng.uniform(-3, 1),
    }
    if relaxing:
        return relaxing_random(rng, *size, **own)
    return random_pencil(rng, *size, **own, algebraic=rng.random() < 0.2)


@pytest.mark.parametrize("seed, relaxing", [(0, False), (1, False), (100, True), (101, True)])
def test_counts_of_random_pencils(seed, relaxing):
    rng = np.random.default_rng(seed)
    uncertain = 0
    for _ in range(60):
        pencil = random_case(rng, relaxing)
        count = unstable_count(pencil)
        if not count.certain:
            assert count.notes
            uncertain += 1
            continue
        assert count.number == int(np.sum(dense_eigenvalues(pencil).real > count.line))
        assert count.distance < 0.2 or relaxing
        assert count.largest_increment < np.pi / 3 or relaxing
    assert uncertain <= 2


def test_of_a_relaxing_stiffness_that_is_not_passive_a_part_makes_the_reference():
    relaxation = Relaxation([np.diag([1.0, -0.4]), [[0.0, 0.3], [-0.3, 0.0]]], [[0.5], [1.0]], [0.7])
    for damping in (0.0, 0.01):
        pencil = CoupledPencil(np.eye(2), damping * np.eye(2), np.diag([1.0, 0.3]), relaxation=relaxation)
        count = unstable_count(pencil)
        assert count.certain and count.number == int(np.sum(dense_eigenvalues(pencil).real > count.line)) > 0


def with_times(pencil):
    return pencil.replace(relaxation=pencil.relaxation.replace(pencil.relaxation.strengths, [0.1, 1.0, 10.0]))


@pytest.mark.parametrize("line, relaxing", [(-0.5, False), (-0.1, False), (0.3, False), (-0.02, True), (0.3, True)])
def test_lines_beside_the_axis(line, relaxing):
    rng = np.random.default_rng(9 if relaxing else 8)
    for _ in range(10):
        pencil = with_times(relaxing_random(rng, 6, 2, 1)) if relaxing else random_pencil(rng, 6, 2, 1)
        count = unstable_count(pencil, line=line)
        assert count.certain
        assert count.number == int(np.sum(dense_eigenvalues(pencil).real > line))
    if relaxing:
        with pytest.raises(ValueError, match="creep"):
            unstable_count(pencil, line=-0.2)


@pytest.mark.slow
@pytest.mark.parametrize("storage, density", [(False, 10.0), (True, 1000.0)])
def test_certificate_where_the_stiffness_relaxes(storage, density):
    elastic, stiffness = plate_over_channel(5, 8, beta=0.0, storage=storage, density=density, with_parts=True)
    pencil = elastic.replace(relaxation=Relaxation([stiffness], [STRENGTHS], TIMES))
    result = certified_spectrum(pencil, 4, SearchOptions(max_frequency=40.0), dense=100)
    assert result.agrees, result.statement
    values = dense_eigenvalues(pencil)
    inside = np.abs(values.imag) <= 2 * np.pi * result.count.band
    assert result.unstable_count == int(np.sum(values.real[inside] > result.count.line))
    assert result.response_error < 1e-4


def test_a_basis_for_materials_that_relax_unlike_each_other():
    """Shapes of modes change along the frequency where one half of the plate stiffens and the other hardly does."""
    elastic, stiffness = plate_over_channel(7, 14, beta=0.0, with_parts=True)
    weight = np.sqrt(np.linspace(0.0, 1.0, elastic.n))
    halves = [sp.diags(w) @ stiffness @ sp.diags(w) for w in (weight, np.sqrt(1 - weight**2))]
    pencil = elastic.replace(relaxation=Relaxation(halves, [[0.4] * 4, [0.03] * 4], TIMES))
    result = certified_spectrum(pencil, 4, SearchOptions(max_frequency=40.0))
    assert result.agrees, result.statement
    assert result.response_error < 1e-4
    plain = pencil.projected(TransferBasis(pencil).V)
    for frequency in (5.0, 15.0, 30.0):
        assert response_error(pencil, plain, [frequency]) < 0.05


def test_counts_within_a_band():
    rng = np.random.default_rng(12)
    for _k in range(40):
        pencil = random_case(rng)
        values = dense_eigenvalues(pencil)
        band = 0.5
        line = unstable_count(pencil).line
        count = unstable_count(pencil, band=band)
        if np.abs(np.abs(values.imag[values.real > line]) - 2 * np.pi * band).min(initial=1.0) < 1e-3:
            continue  # on the edge of the band
        inside = (values.real > count.line) & (np.abs(values.imag) <= 2 * np.pi * band)
        assert count.certain and count.number == int(inside.sum())


def test_an_undamped_plate_is_counted_in_the_band_of_its_spectrum():
    pencil = plate_over_channel(5, 10, beta=0.0)
    result = certified_spectrum(pencil, 8, SearchOptions(max_frequency=40.0), dense=100)
    assert result.agrees, result.statement
    assert result.count.band < 40.0 and "Hz" in result.statement
    values = dense_eigenvalues(pencil)
    inside = (values.real > result.count.line) & (np.abs(values.imag) <= 2 * np.pi * result.count.band)
    assert result.unstable_count == int(inside.sum())


def test_a_structure_unstable_by_itself_is_counted():
    # a circulatory force flutters, a negative stiffness diverges; no coupling at all
    K = np.array([[1.0, 0.5, 0], [-0.5, 1.0, 0], [0, 0, -2.0]])
    count = unstable_count(CoupledPencil(M=np.eye(3), C=0.1 * np.eye(3), K=K))
    assert count.certain and count.number == 3


def test_poles_of_the_fluid_in_the_right_half_plane_are_no_trouble():
    # the fluid alone grows: (s - 2) U = s q; weakly coupled, so U's eigenvalue stays near 2
    pencil = CoupledPencil(
        M=[[1.0]], C=[[0.2]], K=[[1.0]], G=[[1.0]], J=[[1.0]], B0=[[0.01]], R1=[[-1.0]], S0=[[-2.0]], S1=[[1.0]]
    )
    assert unstable_count(pencil).number == 1


@pytest.mark.parametrize("velocity, storage, density", [(3.0, True, 10.0), (8.0, False, 2.0), (5.0, True, 1000.0)])
def test_large_pencils_by_basis(velocity, storage, density):
    pencil = plate_over_channel(5, 10, inlet_velocity=velocity, storage=storage, density=density)
    result = certified_spectrum(pencil, 4, dense=100)
    assert result.agrees, result.statement
    assert result.unstable_count == int(np.sum(dense_eigenvalues(pencil).real > result.count.line))
    assert result.response_error < 1e-4


@pytest.mark.parametrize("gaining", ["K", "C"])
def test_what_grows_beyond_a_basis_is_not_certified_as_stable(gaining):
    """The 24 modes nearest to zero know nothing of the last one, which diverges or is driven by its damping."""
    squares = np.diag(np.arange(1.0, 81.0) ** 2)
    parts = {"M": np.eye(80), "C": 0.1 * np.eye(80), "K": squares}
    steady = certified_spectrum(CoupledPencil(**parts), 3, SearchOptions(method="krylov"), dense=30)
    assert steady.stable and steady.agrees
    parts[gaining] = parts[gaining].copy()
    parts[gaining][-1, -1] = -1e6 if gaining == "K" else -5.0
    found = certified_spectrum(CoupledPencil(**parts), 3, SearchOptions(method="krylov"), dense=30)
    whole = certified_spectrum(CoupledPencil(**parts), 3, SearchOptions(method="krylov", left=True))
    assert whole.stable is False and whole.agrees and whole.spectrum.biorthogonality < 1e-6
    lacking = gaining == "K" or np.isinf(found.certificate.band)
    assert found.stable is not True if lacking else 2 * np.pi * found.certificate.band < 80


def test_more_unstable_modes_than_asked_for():
    K = np.diag([-1.0, -2.0, -3.0, 4.0])
    result = certified_spectrum(CoupledPencil(M=np.eye(4), C=0.1 * np.eye(4), K=K), 1)
    assert result.agrees and result.unstable_count == 3 and len(result.spectrum) >= 3


def test_undamped_structure_uses_a_line_beside_the_axis():
    pencil = CoupledPencil(M=np.eye(3), C=np.zeros((3, 3)), K=np.diag([1.0, 4.0, 9.0]))
    count = unstable_count(pencil)
    assert count.line > 0 and count.number == 0 and count.certain


def test_rounding_is_no_proof_of_instability():
    """Gyroscopic forces alone leave all eigenvalues on the axis, a free chain one at zero."""
    gyroscopic = CoupledPencil(M=np.eye(2), C=[[0.0, 2.0], [-2.0, 0.0]], K=np.diag([1.0, 2.0]))
    found = certified_spectrum(gyroscopic, 2)
    assert found.stable and found.count.line > 0 and found.count.certain and found.count.number == 0
    for n in (4, 5, 6, 8, 10):
        stiffness = 2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
        stiffness[0, 0] = stiffness[-1, -1] = 1.0
        chain = CoupledPencil(M=np.eye(n), C=0.1 * np.eye(n), K=stiffness)
        assert certified_spectrum(chain, 2).stable is None
        modes = leading_modes(chain, 3, SearchOptions(method="krylov", shifts=(0.5, 0.8)))
        assert np.sum(np.abs(modes.eigenvalues) < 1e-9) == 1


def test_an_eigenvalue_on_the_line_is_uncertain():
    pencil = CoupledPencil(M=np.eye(1), C=[[0.0]], K=[[1.0]], G=[[1.0]], J=[[1.0]], A0=[[-0.5]])
    count = unstable_count(pencil, line=0.0)
    assert not count.certain and count.notes


def test_a_mass_that_is_not_positive_is_refused():
    with pytest.raises(ValueError, match="positive definite"):
        unstable_count(CoupledPencil(M=np.diag([1.0, -1.0]), C=np.eye(2), K=np.eye(2)))


def test_an_eigenvalue_at_zero_is_said_and_ends_the_refinement():
    """A coupling that leaves a constant free: the count cannot be certain, and must not go on for ever."""
    pencil = CoupledPencil(
        M=np.eye(2),
        C=0.1 * np.eye(2),
        K=np.diag([1.0, 4.0]),
        G=np.ones((2, 1)),
        J=np.ones((1, 2)),
        B0=[[1.0]],
        S1=[[1.0]],
    )
    count = unstable_count(pencil)
    assert not count.certain
    assert count.evaluations < 500
    assert any("on the line" in note for note in count.notes)


def test_a_relaxing_part_that_is_not_positive_is_counted_without_other_damping():
    """The reference has to be damped all the same, or its zeros lie on the line."""
    rng = np.random.default_rng(5)
    stiffness = np.diag(np.linspace(1.0, 8.0, 10) ** 2)
    for push in (0.0, 0.5, 3.0):
        root = rng.standard_normal((10, 10))
        part = 0.1 * root @ root.T
        part -= (np.linalg.eigvalsh(part)[0] + 0.05) * np.eye(10)  # lowest eigenvalue -0.05
        turn = np.zeros((10, 10))
        turn[0, 1], turn[1, 0] = push, -push
        relaxation = Relaxation([1e6 * part], [[0.3, 0.2]], [1e-3, 5e-5])  # frequencies as of a valve, not of one
        pencil = CoupledPencil(np.eye(10), np.zeros((10, 10)), 1e6 * (stiffness + turn), relaxation=relaxation)
        count = unstable_count(pencil)
        assert count.certain, count.notes
        assert count.number == int(np.sum(dense_eigenvalues(pencil).real > 0))


@pytest.mark.parametrize("damping, stiffness", [(1000.0, 1.0), (1000.0, 1e-2), (40.0, 1.0)])
def test_two_motions_that_grow_slowly_are_counted(damping, stiffness):
    """Far below typical frequencies their phases turn back and forth within what once was the first interval."""
    K = np.diag([-stiffness, -1.5 * stiffness, 90.0, 100.0, 120.0, 150.0])
    count = unstable_count(CoupledPencil(M=np.eye(6), C=damping * np.eye(6), K=K))
    assert (count.number, count.certain) == (2, True)
