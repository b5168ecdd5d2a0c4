"""Truncated Fourier series: coefficients, samples over one period, and filters in time.

Columns of coefficients are 1, sqrt(2) cos(k tau), sqrt(2) sin(k tau), k = 1..H, at phases tau = 2 pi i / N.  With an
odd N > 2 H samples and coefficients are tied exactly, and so are rates.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np

from continuation.options import require

#: Samples for each harmonic: with three, products of two series keep all harmonics of the series free of aliasing.
OVERSAMPLING = 3


class Harmonics:
    """Series of H harmonics on N equally spaced samples.

    Parameters
    ----------
    count : int
        H.
    samples : int, optional
        N, odd and above 2 H; the first above 3 H by default.

    Examples
    --------
    >>> h = Harmonics(2)
    >>> h.samples, h.size
    (7, 5)
    """

    def __init__(self, count: int, samples: int | None = None):
        require(count >= 1, f"A series needs at least one harmonic, not {count}.")
        samples = (OVERSAMPLING * count + 1) | 1 if samples is None else samples
        require(samples % 2 == 1 and samples > 2 * count, "The number of samples must be odd and above 2 H.")
        self.count, self.samples, self.size = int(count), int(samples), 2 * int(count) + 1

    @cached_property
    def phases(self) -> np.ndarray:
        """(N,) phases, rad."""
        return 2 * np.pi * np.arange(self.samples) / self.samples

    @cached_property
    def basis(self) -> np.ndarray:
        """(N, 2 H + 1): samples from coefficients."""
        return self.basis_at(self.phases)

    def basis_at(self, phases) -> np.ndarray:
        """(len, 2 H + 1): values of the basis at phases, rad."""
        angles = np.outer(np.asarray(phases, float), np.arange(1, self.count + 1))
        out = np.empty((len(angles), self.size))
        out[:, 0] = 1.0
        out[:, 1::2], out[:, 2::2] = np.sqrt(2) * np.cos(angles), np.sqrt(2) * np.sin(angles)
        return out

    def evaluate(self, coefficients: np.ndarray) -> np.ndarray:
        """Samples (N, ...) of coefficients (2 H + 1, ...)."""
        return np.tensordot(self.basis, coefficients, 1)

    def project(self, samples: np.ndarray) -> np.ndarray:
        """Coefficients (2 H + 1, ...) of samples (N, ...)."""
        return np.tensordot(self.basis.T, samples, 1) / self.samples

    def rate(self, coefficients: np.ndarray) -> np.ndarray:
        """Coefficients of the derivative by the phase."""
        k = np.arange(1, self.count + 1).reshape((-1,) + (1,) * (coefficients.ndim - 1))
        out = np.zeros_like(coefficients)
        out[1::2], out[2::2] = k * coefficients[2::2], -k * coefficients[1::2]
        return out

    def complex(self, coefficients: np.ndarray) -> np.ndarray:
        """c_k (H + 1, ...) in x = c_0 + 2 Re sum c_k exp(i k tau) of real coefficients."""
        first = coefficients[:1].astype(complex)
        return np.concatenate([first, (coefficients[1::2] - 1j * coefficients[2::2]) / np.sqrt(2)])

    def real(self, harmonics: np.ndarray) -> np.ndarray:
        """Undo `complex`."""
        out = np.empty((self.size, *harmonics.shape[1:]))
        out[0] = harmonics[0].real
        out[1::2], out[2::2] = np.sqrt(2) * harmonics[1:].real, -np.sqrt(2) * harmonics[1:].imag
        return out

    def two_sided(self, coefficients: np.ndarray) -> np.ndarray:
        """c_k (2 H + 1, ...), k = -H..H, of coefficients that may be complex."""
        cosine, sine = coefficients[1::2] / np.sqrt(2), coefficients[2::2] / np.sqrt(2)
        return np.concatenate([(cosine + 1j * sine)[::-1], coefficients[:1], cosine - 1j * sine])

    def resized(self, coefficients: np.ndarray) -> np.ndarray:
        """Coefficients of another number of harmonics made to fit: cut off, or followed by zeros."""
        out = np.zeros((self.size, *coefficients.shape[1:]), coefficients.dtype)
        kept = min(self.size, len(coefficients))
        out[:kept] = coefficients[:kept]
        return out


class Rates:
    """Functions of d/dt applied to samples of motions ``exp(shift t)`` times a periodic function.

    Parameters
    ----------
    omega : float
        Angular frequency.
    shift : complex
        A Floquet exponent; zero for periodic motions.
    """

    def __init__(self, harmonics: Harmonics, omega: float, shift: complex = 0.0):
        self.harmonics, self.omega = harmonics, float(omega)
        self.shift = shift.real if not np.imag(shift) else complex(shift)
        self._known: dict = {}
        self._turns: dict = {}

    def filter(self, function: Callable[[np.ndarray], np.ndarray] | int) -> np.ndarray:
        """(N, N) matrix of a function of d/dt, or of an integer power of it; real for a real shift."""
        if function not in self._known:
            n = self.harmonics.samples
            values = self._values(function, np.fft.fftfreq(n, 1.0 / n))
            matrix = np.fft.ifft(values[:, None] * np.fft.fft(np.eye(n), axis=0), axis=0)
            self._known[function] = matrix if np.iscomplexobj(self.shift) else np.ascontiguousarray(matrix.real)
        return self._known[function]

    def apply(self, function, samples: np.ndarray) -> np.ndarray:
        """A function of d/dt, or a power of it, applied to samples (N, ...)."""
        if isinstance(function, int) and function == 0:
            return samples
        return np.tensordot(self.filter(function), samples, 1)

    def _values(self, function, multiples: np.ndarray) -> np.ndarray:
        """A function of d/dt at multiples of the frequency."""
        s = 1j * self.omega * multiples + self.shift
        return s**function if isinstance(function, int) else np.asarray(function(s))

    def _turn(self, function) -> tuple[np.ndarray, np.ndarray]:
        """a_k, b_k (H + 1,) of what it makes of cosines, a cos + b sin, and of sines, a sin - b cos."""
        if function not in self._turns:
            k = np.arange(self.harmonics.count + 1)
            ahead, behind = self._values(function, k), self._values(function, -k)
            a, b = 0.5 * (ahead + behind), 0.5j * (ahead - behind)
            self._turns[function] = (a, b) if np.iscomplexobj(self.shift) else (a.real, b.real)
        return self._turns[function]

    def act(self, function, coefficients: np.ndarray) -> np.ndarray:
        """Coefficients of a function of d/dt, or of a power of it, applied to those (2 H + 1, ...) of a motion."""
        if isinstance(function, int) and function == 0:
            return coefficients
        a, b = (x.reshape((-1,) + (1,) * (coefficients.ndim - 1)) for x in self._turn(function))
        cosine, sine = coefficients[1::2], coefficients[2::2]
        out = np.empty(coefficients.shape, np.result_type(a, coefficients))
        out[0] = a[0] * coefficients[0]
        out[1::2], out[2::2] = a[1:] * cosine - b[1:] * sine, b[1:] * cosine + a[1:] * sine
        return out

    def matrix(self, function) -> np.ndarray:
        """(2 H + 1, 2 H + 1): `act` on coefficients."""
        return self.act(function, np.eye(self.harmonics.size))
