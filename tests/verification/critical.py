"""Critical parameters of small pencils by bracketing, and zeros of analytic functions, for the verification tests."""

import numpy as np
from scipy.optimize import brentq

from eigen import SearchOptions, leading_modes


def leading(pencil, band=None, count=1):
    """Leading eigenvalue up to a frequency in Hz; every one of them is computed."""
    modes = leading_modes(pencil, count, SearchOptions(max_frequency=band, method="dense"))
    assert modes.status == "complete", modes.notes
    return modes.eigenvalues[0]


def hopf(pencil_at, low, high, band=None):
    """Parameter at which the leading growth rate vanishes, and the angular frequency."""
    root = brentq(lambda x: leading(pencil_at(x), band).real, low, high, xtol=1e-10, rtol=1e-13)
    return root, leading(pencil_at(root), band).imag


def coalescence(pencil_at, low, high):
    """Parameter at which the two lowest undamped frequencies meet, and that frequency.

    (omega_2^2 - omega_1^2)^2 passes through zero there linearly, so its root is sharp where
    that of the growth rate is not.
    """

    def lowest_two(x):
        pencil = pencil_at(x)
        values = np.linalg.eigvals(np.linalg.solve(pencil.M.toarray(), pencil.K.toarray()))
        return values[np.argsort(np.abs(values))[:2]].astype(complex)

    root = brentq(lambda x: (lambda v: ((v[1] - v[0]) ** 2).real)(lowest_two(x)), low, high, xtol=1e-12, rtol=1e-14)
    omega = np.sqrt(lowest_two(root).mean().real)
    # the package's own eigenvalues say the same
    modes = leading_modes(pencil_at(root * (1 + 1e-6)), 1, SearchOptions(max_frequency=omega / 4))
    assert abs(modes.eigenvalues[0].imag - omega) < 1e-3 * omega
    assert modes.eigenvalues[0].real > 0
    return root, omega


def root(function, start: complex) -> complex:
    """Zero of an analytic function by the secant method."""
    a, b = start * (1 + 1e-6), start
    fa, fb = function(a), function(b)
    for _ in range(60):
        if abs(b - a) <= 1e-14 * abs(b) or fa == fb:
            return b
        a, b, fa = b, b - fb * (b - a) / (fb - fa), fb
        fb = function(b)
    raise AssertionError(f"no root near {start}")
