"""Pipe conveying fluid: Hopf points of the cantilever, divergence of the clamped pipe.

Critical u and omega at three mass ratios from Galerkin series (14 and 20 modes agree in the
printed digits); the clamped-clamped pipe diverges at u = 2 pi exactly.
"""

import numpy as np
import pytest

from eigen import SearchOptions, certified_spectrum
from tests.systems.beam import fluid_conveying_pipe
from tests.verification.critical import hopf


@pytest.mark.parametrize(
    "mass_ratio, velocity, omega", [(0.1, 4.7499, 14.2171), (0.2, 5.5914, 13.7147), (0.5, 9.3224, 26.4973)]
)
def test_cantilever_flutters(mass_ratio, velocity, omega):
    found, frequency = hopf(
        lambda u: fluid_conveying_pipe(u, mass_ratio, elements=60), 0.97 * velocity, 1.03 * velocity, band=20.0
    )
    # half a unit of the last digit, plus the mesh (2e-5 with 60 elements)
    assert found == pytest.approx(velocity, abs=7e-5)
    assert frequency == pytest.approx(omega, abs=1.5e-4)


def test_clamped_pipe_diverges_at_two_pi():
    def determinant_sign(u):
        return np.linalg.slogdet(fluid_conveying_pipe(u, 0.3, clamped_end=True).K.toarray())[0]

    assert determinant_sign(2 * np.pi * (1 - 1e-6)) == 1
    assert determinant_sign(2 * np.pi * (1 + 1e-6)) == -1


@pytest.mark.parametrize("velocity, unstable", [(0.99 * 2 * np.pi, 0), (1.01 * 2 * np.pi, 1)])
def test_counts_see_divergence(velocity, unstable):
    pencil = fluid_conveying_pipe(velocity, 0.3, elements=16, clamped_end=True)
    pencil = pencil.replace(C=pencil.C + 0.05 * pencil.M)
    result = certified_spectrum(pencil, 4, SearchOptions(max_frequency=40.0))
    assert result.agrees, result.statement
    assert result.unstable_count == unstable
