"""Structures that relax and lose stability by themselves: real unstable eigenvalues against closed forms."""

import numpy as np
import pytest
import scipy.linalg as la
import scipy.sparse as sp

from eigen import CoupledPencil, Relaxation, SearchOptions, certified_spectrum
from eigen.inertia import SymmetricLU
from eigen.negative_stiffness import negative_motions
from eigen.response import Determinant
from tests.systems.random_pencils import dense_eigenvalues
from tests.systems.relaxing import mode_roots, relaxing_random

STRENGTHS, TIMES = (0.6, 0.4), (1.0, 0.05)


def oscillators_that_relax(squares, shares) -> CoupledPencil:
    """Independent oscillators, mixed two by two, whose stiffness relaxes by a share each, and a weak push."""
    n = squares.size
    angle = 0.3 + np.arange(n // 2)
    c, s = np.cos(angle), np.sin(angle)
    turn = sp.bmat([[sp.diags(c), sp.diags(s)], [sp.diags(-s), sp.diags(c)]]).tocsr()
    mixed = [turn @ sp.diags(values) @ turn.T for values in (squares, squares * shares)]
    push = turn[:, :1]
    return CoupledPencil(
        sp.identity(n, format="csr"),
        0.0 * sp.identity(n, format="csr"),
        mixed[0],
        push,
        push.T.tocsr(),
        A0=[[1e-3]],
        relaxation=Relaxation([mixed[1]], [STRENGTHS], TIMES),
    )


@pytest.mark.parametrize("dense_below", [98, 400])
def test_oscillators_that_run_away_one_by_one(dense_below, monkeypatch):
    monkeypatch.setattr(Determinant, "dense_below", dense_below)
    squares = np.linspace(1.0, 60.0, 100) ** 2
    squares[[30, 60, 90]] = 100.0**2, 300.0**2, 1000.0**2
    shares = np.ones(100)
    shares[[30, 60, 90]] = -1.5, -1.3, -1.9
    pencil = oscillators_that_relax(squares, shares)
    roots = [r for i in (30, 60, 90) for r in mode_roots(squares[i], STRENGTHS, TIMES, share=shares[i])]
    expected = np.sort([r.real for r in roots if r.real > 0 and r.imag == 0])
    assert expected.size == 6 and expected[-1] > 500.0
    result = certified_spectrum(pencil, 4, SearchOptions(max_frequency=1.6, method="krylov"))
    assert result.agrees and result.unstable_count == 6, result.statement
    modes = result.spectrum
    np.testing.assert_allclose(np.sort(modes.eigenvalues[modes.growth_rate > 0]), expected, rtol=1e-8)
    assert modes.residual.max() < 1e-8 and result.stable is False


def test_signs_of_pivots_are_the_inertia():
    rng = np.random.default_rng(3)
    for n in (1, 7, 40):
        matrix = sp.random(n, n, 0.2, random_state=rng) + sp.diags(rng.standard_normal(n))
        matrix = (matrix + matrix.T).tocsc()
        factor = SymmetricLU(matrix)
        assert factor.negative == int(np.sum(la.eigvalsh(matrix.toarray()) < 0))
        right = rng.standard_normal(n)
        np.testing.assert_allclose(matrix @ factor.solve(right), right, atol=1e-8)


@pytest.mark.parametrize("seed", range(4))
def test_the_space_has_the_inertia_of_the_structure_at_every_place(seed):
    """Between neighbours among the real unstable eigenvalues, of random structures whose parts are of either sign."""
    rng = np.random.default_rng(seed)
    pencil = relaxing_random(rng, 30, 0, 0, scale=0.1, damping="positive")
    pencil = pencil.replace(
        K=(pencil.K + pencil.K.T) * 0.5,
        relaxation=Relaxation(
            [part - 0.4 * abs(part).max() * sp.diags(rng.random(30)) for part in pencil.relaxing],
            *(getattr(pencil.relaxation, name) for name in ("strengths", "times")),
        ),
    )
    space = negative_motions(pencil)
    values = dense_eigenvalues(pencil)
    real = np.sort(values.real[(values.real > 0) & (np.abs(values.imag) < 1e-9 * np.abs(values))])
    assert real.size >= 2 and space.shape[1] < 30
    ends = np.concatenate([[0.5 * real[0]], real, [2.0 * real[-1]]])
    for s in np.sqrt(ends[:-1] * ends[1:]):
        relaxed = sum(x * part for x, part in zip(pencil.relaxation.factors(s), pencil.relaxing))
        full = (s * s * pencil.M + s * pencil.C + pencil.K + relaxed).toarray()
        full = 0.5 * (full + full.T)
        number = int(np.sum(la.eigvalsh(full) < 0))
        assert int(np.sum(la.eigvalsh(space.T @ full @ space) < 0)) == number, (s, real)


def test_nothing_runs_away_where_all_that_relaxes_is_positive():
    rng = np.random.default_rng(1)
    pencil = relaxing_random(rng, 20, 2, 1)
    pencil = pencil.replace(K=(pencil.K + pencil.K.T) * 0.5 + 50.0 * sp.identity(20))
    assert negative_motions(pencil).shape == (20, 0)
    assert negative_motions(pencil.replace(relaxation=None)).shape == (20, 0)
