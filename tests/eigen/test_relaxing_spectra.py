"""Leading modes of pencils whose stiffness relaxes, against closed forms and dense solutions."""

import numpy as np
import pytest
import scipy.linalg as la
import scipy.sparse as sp

from eigen import CoupledPencil, Relaxation, SearchOptions, TransferBasis, Workspace, certified_spectrum, leading_modes
from eigen.operator import apart_from_creep, edge_of
from eigen.pairs import all_eigenvalues, all_pairs, newton
from tests.systems.beam import beam
from tests.systems.plate_over_channel import plate_over_channel
from tests.systems.random_pencils import dense_eigenvalues
from tests.systems.relaxing import STRENGTHS, TIMES, mode_roots, relaxing_random

BAND = 60.0


def relaxing_beam(elements=40, strengths=STRENGTHS, times=TIMES):
    """A cantilever of one relaxing material, its squares in vacuo, and their modes' own roots that oscillate."""
    parts = beam(elements)
    pencil = CoupledPencil(
        parts.mass,
        sp.csr_matrix(parts.mass.shape),
        parts.bending,
        relaxation=Relaxation([0.7 * parts.bending, 0.3 * parts.bending], [strengths, strengths], times),
    )
    # the inverse problem, in which the low modes are the large ones
    squares = np.sort(1.0 / la.eigvalsh(parts.mass.toarray(), parts.bending.toarray()))
    roots = np.array([r for w in squares for r in mode_roots(w, strengths, times) if r.imag > 0.1 * abs(r)])
    return pencil, squares, roots


def relaxing_plate(across, along, groups=((0.6, 0.15), (0.4, 0.05)), **keywords):
    """The plate over a channel with two materials that relax, and no other damping."""
    pencil, stiffness = plate_over_channel(across, along, beta=0.0, with_parts=True, **keywords)
    relaxation = Relaxation([x * stiffness for x, _ in groups], [[g] * 4 for _, g in groups], TIMES)
    return pencil.replace(relaxation=relaxation)


def leading(values, count, band=np.inf):
    """Leading ones of the eigenvalues that oscillate within a band, rad/s."""
    values = values[(values.imag > 0.1 * np.abs(values)) & (values.imag <= band)]
    return values[np.argsort(-values.real)][:count]


@pytest.mark.parametrize("strengths, times", [((0.4,), (0.02,)), ((0.3, 0.2, 0.5), (1.0, 0.05, 2e-3))])
def test_one_degree_of_freedom(strengths, times):
    stiffness, mass = 900.0, 2.0
    relaxation = Relaxation([[[stiffness]]], [strengths], times)
    pencil = CoupledPencil([[mass]], [[0.8]], [[stiffness]], relaxation=relaxation)
    roots = mode_roots(stiffness / mass, strengths, times, 0.8 / mass)
    assert roots.size == 2 + len(times) == pencil.order
    values = all_eigenvalues(pencil)
    for root in roots[roots.imag >= 0]:
        assert np.abs(values - root).min() < 1e-10 * abs(root)
    modes = leading_modes(pencil, 1, SearchOptions(left=True))
    assert modes.eigenvalues == pytest.approx(leading(roots, 1), rel=1e-10)
    assert modes.residual.max() < 1e-12


@pytest.mark.parametrize("method", ["dense", "krylov"])
def test_each_mode_of_a_beam_has_its_own_equation(method):
    pencil, _, roots = relaxing_beam(10 if method == "dense" else 24)
    modes = leading_modes(pencil, 6, SearchOptions(method=method, max_frequency=BAND, left=True))
    expected = leading(roots, 6, 2 * np.pi * BAND)
    assert modes.status == "complete" and len(modes) == 6
    np.testing.assert_allclose(modes.eigenvalues, expected, rtol=1e-9)
    assert modes.biorthogonality < 1e-7 and modes.residual.max() < 1e-8


def test_a_lower_end_that_is_given_keeps_slow_modes_in_a_wide_band():
    """The slowest mode leads a band of 40 times its frequency, of which it lies below the share that is searched."""
    pencil, _, roots = relaxing_beam(24)
    first = roots[np.argmin(roots.imag)]
    slow = first.imag / (2 * np.pi)
    options = SearchOptions(max_frequency=40 * slow, lowest=0.8 * slow)
    modes = leading_modes(pencil, 6, options)
    assert np.abs(modes.eigenvalues - first).min() < 1e-9 * abs(first)
    assert modes.region.lowest == pytest.approx(2 * np.pi * 0.8 * slow)


@pytest.mark.parametrize("shifts", [(30.0,), (40.0, 10 + 120j)])
def test_any_shift_gives_the_same_modes(shifts):
    pencil, _, roots = relaxing_beam(24)
    modes = leading_modes(pencil, 5, SearchOptions(max_frequency=40.0, shifts=shifts))
    known = [v for v in leading(roots, 99, 80 * np.pi) if modes.region.contains(v)]
    assert len(known) >= 3
    for value in known[: len(modes)]:
        assert np.abs(modes.eigenvalues - value).min() < 1e-9 * abs(value)


@pytest.mark.parametrize("n, m, b", [(40, 0, 0), (40, 5, 0), (40, 6, 1), (30, 5, 2)])
def test_random_pencils_against_dense_solutions(n, m, b):
    rng = np.random.default_rng(n + m + b)
    pencil = relaxing_random(rng, n, m, b, scale=0.1, damping="positive")
    values = dense_eigenvalues(pencil)
    everything = leading_modes(pencil, 8, SearchOptions(method="dense", max_frequency=10.0))
    expected = values[(values.imag >= 0) & apart_from_creep(pencil, values)]
    expected = expected[np.argsort(-expected.real)][:8]
    np.testing.assert_allclose(everything.eigenvalues, expected, rtol=1e-8)
    modes = leading_modes(pencil, 8, SearchOptions(method="krylov", max_frequency=10.0, left=True))
    assert modes.residual.max() < 1e-8 and modes.biorthogonality < 1e-7
    inside = [v for v in expected if v.imag > modes.region.lowest and -v.real < modes.region.slope * v.imag]
    for value in inside:
        if value.real >= modes.complete_above:
            assert np.abs(modes.eigenvalues - value).min() < 1e-8 * abs(value)
    for value in modes.eigenvalues:
        assert np.abs(values - value).min() < 1e-8 * abs(value)


@pytest.mark.parametrize("storage, density", [(True, 1e-3), (False, 10.0), (True, 1000.0)])
def test_plate_over_decades_of_density_against_dense(storage, density):
    pencil = relaxing_plate(4, 7, density=density, storage=storage)
    modes = leading_modes(pencil, 4, SearchOptions(method="krylov", max_frequency=60.0))
    values = dense_eigenvalues(pencil)
    values = values[(values.imag >= 0) & (values.imag <= 120 * np.pi) & apart_from_creep(pencil, values)]
    looked_at = (values.imag >= modes.region.lowest) & (-values.real <= modes.region.slope * values.imag)
    expected = leading(values[looked_at], 4)
    assert modes.complete_above <= expected[-1].real
    for value in expected:
        assert np.abs(modes.eigenvalues - value).min() < 1e-8 * abs(value)


def test_a_branch_whose_time_vanishes_is_stiffness_damping():
    beta, time = 2e-3, 1e-9
    parts = beam(40)
    zero = sp.csr_matrix(parts.mass.shape)
    relaxation = Relaxation([parts.bending], [[beta / time]], [time])
    fast = CoupledPencil(parts.mass, zero, parts.bending, relaxation=relaxation)
    rayleigh = CoupledPencil(parts.mass, beta * parts.bending, parts.bending)
    search = SearchOptions(max_frequency=30.0, method="krylov")
    a, b = (leading_modes(p, 4, search).eigenvalues for p in (fast, rayleigh))
    np.testing.assert_allclose(a, b, rtol=1e-6)
    # the crowd of creep is the limit point of stiffness damping
    assert edge_of(fast.relaxation) == pytest.approx(-0.8 / beta, rel=1e-6)


@pytest.mark.slow
def test_creep_is_no_mode_but_divergence_is():
    stiffness = np.diag(np.linspace(1.0, 60.0, 80) ** 2)
    relaxation = Relaxation([stiffness], [[0.3, 0.2]], [1.0, 0.05])
    push = sp.csr_matrix(([1.0], ([0], [0])), (80, 1))
    for load, real in ((0.5, 0), (0.98, 1), (1.02, 1), (1.5, 1)):
        pencil = CoupledPencil(
            np.eye(80), 0.01 * np.eye(80), stiffness, push, push.T.tocsr(), A0=[[load]], relaxation=relaxation
        )
        for method in ("dense", "krylov"):
            result = certified_spectrum(pencil, 6, SearchOptions(max_frequency=1.6, method=method))
            modes = result.spectrum
            assert result.agrees and result.unstable_count == (load > 1), result.statement
            found = modes.eigenvalues[modes.eigenvalues.imag == 0]
            assert found.size == real
            values = dense_eigenvalues(pencil)
            for value in found:
                assert np.abs(values - value).min() < 1e-8 * abs(value)


def test_a_note_says_where_was_searched():
    modes = leading_modes(relaxing_plate(4, 7), 30, SearchOptions(max_frequency=20.0, method="krylov"))
    assert len(modes) < 30 and modes.status == "incomplete"
    assert any("between 1 and 20 Hz" in note and "damping ratio below 0.6" in note for note in modes.notes)


@pytest.mark.parametrize("storage, density", [(False, 10.0), (True, 1000.0)])
def test_a_large_plate_against_newton_from_a_small_model(storage, density):
    pencil = relaxing_plate(14, 24, storage=storage, density=density)
    workspace = Workspace()
    modes = leading_modes(pencil, 6, SearchOptions(max_frequency=60.0), workspace=workspace)
    basis = TransferBasis(pencil)
    values, q, u, _, _ = all_pairs(pencil.projected(basis.V), left=False)
    checked = 0
    for i in np.flatnonzero((values.imag > modes.region.lowest) & (values.imag < 100 * np.pi) & (values.real > -40)):
        start = values[i], basis.V @ q[:, i], u[:, i]
        value, _, _, residual, _ = newton(pencil, *start, workspace=workspace, tolerance=1e-12, steps=6)
        if residual < 1e-8 and value.real > max(modes.complete_above, modes.growth_rate[-1]):
            assert np.abs(modes.eigenvalues - value).min() < 1e-8 * abs(value)
            checked += 1
    assert checked >= 2
