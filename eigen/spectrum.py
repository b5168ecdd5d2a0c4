r"""Options and result of an eigenvalue search, and the region of the plane in which it is complete."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

#: Share of a limit point of eigenvalues right of which an eigenvalue is clearly apart from it.
CLEAR = 0.8
#: Share of it at which a search ends: nearer to it no number of restarts helps.
END = 0.97
#: Lowest frequency searched where the stiffness relaxes, over the highest unless it is given, and decay over angular
#: frequency down to which such a search goes at most; slower and more strongly damped motions shade off into
#: relaxation.
LOWEST, SLOPE = 0.05, 0.75


def number_right_of(values: np.ndarray, line: float = 0.0, band: float = math.inf) -> int:
    """Number of eigenvalues right of a line up to a band, Hz, conjugates, of which one is given, counted apart."""
    inside = (values.real > line) & (values.imag <= 2 * np.pi * band)
    return int(np.where(values.imag > 0, 2, 1)[inside].sum())


@dataclass(frozen=True)
class SearchOptions:
    """Options of `leading_modes`.

    Attributes
    ----------
    max_frequency : float or None
        Hz. Only modes up to this frequency are wanted, and completeness is sought for the
        whole band. None: the band reaches to the highest frequency among the leading modes.
        Give a band where damping does not order the modes (undamped structures): without it
        "leading" depends on how far up one looks.
    limit_point : float or None
        1/s, negative. A real number at which infinitely many eigenvalues accumulate, as they do at
        -1/beta under damping proportional to stiffness. No list of leading modes reaches past
        it: the search is for those clearly right of it, and others are given only if they turn up.
    shifts : tuple of complex or None
        Shifts, 1/s, instead of those chosen automatically; real ones cost least.
    tolerance : float
        Largest residual of an accepted pair, see `Spectrum`.
    left : bool
        Also left vectors.
    method : {"auto", "krylov", "dense"}
        "auto" solves pencils of order up to `dense_below` densely and completely.
    dense_below : int
    least : int
        A search for fewer modes than this is carried out for this many, so that the band
        searched does not depend on small differences in the number asked for.
    max_shifts : int
        Automatic shifts at most.
    covered : float
        Hz, up to which a list without a band is complete at least; beside a limit point, as far as that leaves.
    resolved : float
        Hz, up to which the pencil stands for what it is made of, such as the waves of a line of elements; eigenvalues
        above it say nothing and are not counted.
    lowest : float or None
        Hz, from which a search is complete where the stiffness relaxes; by default a share of `max_frequency`.
    inside : float
        Share of a band, or of what is resolved, up to which eigenvalues are counted, clear of those at its end.
    """

    max_frequency: float | None = None
    limit_point: float | None = None
    shifts: tuple[complex, ...] | None = None
    tolerance: float = 1e-8
    left: bool = False
    method: str = "auto"
    dense_below: int = 240
    least: int = 6
    max_shifts: int = 4
    covered: float = 0.0
    resolved: float = math.inf
    lowest: float | None = None
    inside: float = 0.999

    @property
    def whole(self) -> float:
        """Frequency, Hz, up to which a count says all; infinite where everything is resolved."""
        return self.inside * self.resolved

    @property
    def slowest(self) -> float:
        """Angular frequency, rad/s, from which a search is complete where the stiffness relaxes; 0 where not known."""
        if self.lowest is not None:
            return 2 * np.pi * self.lowest
        return LOWEST * 2 * np.pi * (self.max_frequency or 0.0)

    def __post_init__(self):
        if self.max_frequency is not None and not self.max_frequency > 0:
            raise ValueError("max_frequency must be positive, in Hz.")
        if self.limit_point is not None and not -math.inf < self.limit_point < 0:
            raise ValueError("limit_point must be a negative growth rate, in 1/s.")
        if self.method not in ("auto", "krylov", "dense"):
            raise ValueError(f"The method '{self.method}' is unknown; it is 'auto', 'krylov' or 'dense'.")
        if self.shifts is not None:
            if not self.shifts:
                raise ValueError("Give at least one shift, or None for automatic shifts.")
            for s in self.shifts:
                if not (math.isfinite(complex(s).real) and math.isfinite(complex(s).imag)):
                    raise ValueError("Shifts must be finite numbers.")
        if not 0 < self.tolerance < 1:
            raise ValueError("The tolerance must lie between 0 and 1.")
        if self.max_shifts < 1 or self.least < 1:
            raise ValueError("max_shifts and least must be at least 1.")


@dataclass(frozen=True)
class Oval:
    """Disc, with its mirror image, in which a search at one shift has found every eigenvalue.

    Around the shift; of a viscoelastic wall at a real shift it touches the real axis there.

    Attributes
    ----------
    shift : complex
        Centre.
    reach : float
        Radius, 1/s.
    """

    shift: complex
    reach: float

    def interval(self, omega: np.ndarray) -> np.ndarray:
        """Growth rates covered at angular frequencies, shape (k, 2); empty ones are NaN."""
        square = self.reach**2 - (np.abs(np.asarray(omega, float)) - abs(self.shift.imag)) ** 2
        half = np.sqrt(np.where(square >= 0, square, np.nan))
        return np.stack([self.shift.real - half, self.shift.real + half], axis=-1)

    def contains(self, eigenvalue: complex) -> bool:
        """True where a point (or its conjugate) lies in the oval."""
        low, high = self.interval(np.array([complex(eigenvalue).imag]))[0]
        return bool(low <= complex(eigenvalue).real <= high)


@dataclass(frozen=True)
class SearchedRegion:
    """Union of ovals, or the whole plane.

    Attributes
    ----------
    ovals : tuple of Oval
    everything : bool
        True if all eigenvalues of the pencil were found.
    lowest : float
        Angular frequency, rad/s, below which `complete_between` does not look: real eigenvalues crowd there where the
        stiffness relaxes.
    slope : float
        Decay over angular frequency beyond which it does not look either.
    """

    ovals: tuple[Oval, ...] = ()
    everything: bool = False
    lowest: float = 0.0
    slope: float = np.inf

    def contains(self, eigenvalue: complex) -> bool:
        """True where every eigenvalue at this place would have been found."""
        return self.everything or any(o.contains(eigenvalue) for o in self.ovals)

    def complete_between(self, band: float, samples: int = 400) -> tuple[float, float]:
        """Growth rates between which the search is complete up to a frequency.

        Parameters
        ----------
        band : float
            Angular frequency, rad/s.

        Returns
        -------
        low, high : float
            Every eigenvalue with low <= growth rate <= high and |frequency| <= band, within what
            `lowest` and `slope` leave, was found. (inf, -inf) if there is no such strip. To the right of `high` only
            an independent count can tell.
        """
        if self.everything:
            return -np.inf, np.inf
        if not self.ovals:
            return np.inf, -np.inf
        omega = np.linspace(self.lowest, max(band, self.lowest), samples)
        pieces = np.stack([o.interval(omega) for o in self.ovals])  # (ovals, samples, 2)
        seed = max(o.shift.real for o in self.ovals)
        low, high = np.full(samples, seed), np.full(samples, seed)
        inside = np.zeros(samples, bool)
        for _ in self.ovals:  # chains of overlapping intervals, starting at the shift
            for start, end in np.moveaxis(pieces, 2, 1):
                joins = (start <= high) & (end >= low)
                inside |= joins
                low = np.where(joins, np.minimum(low, start), low)
                high = np.where(joins, np.maximum(high, end), high)
        if not inside.all():
            return np.inf, -np.inf
        if np.isfinite(self.slope):
            low = np.where(low <= -self.slope * omega, -np.inf, low)
        return float(low.max()), float(high.min())


#: Arrays with an entry or a column for each eigenpair, and those of its left vector.
PAIRS, LEFT = ("eigenvalues", "q", "u", "residual", "backward_error"), ("left_q", "left_u")


@dataclass(frozen=True)
class Spectrum:
    """Leading eigenpairs of a pencil, sorted by growth rate; a conjugate pair is given once.

    Every pair listed has passed the residual test. Right vectors have a structural part of
    unit 2-norm whose largest component is real and positive. Left vectors w satisfy
    w^H T(lambda) = 0 and are scaled so that w^H T'(lambda) x = 1.

    Attributes
    ----------
    eigenvalues : ndarray, shape (k,)
        Complex, 1/s, imaginary part >= 0.
    q, u : ndarray, shapes (n, k) and (b, k)
        Right vectors: structural part, inner unknowns of the fluid.
    residual : ndarray, shape (k,)
        ||T(lambda) x|| over the sum of the norms of its terms (inertia, damping, stiffness,
        coupling through y, through U); the rows of the fluid are measured apart, by
        (sum |lambda|^k ||R_k J||) ||q|| + (||S_0|| + |lambda| ||S_1||) ||U||, and the larger
        ratio counts. U is kept as an unknown.
    backward_error : ndarray, shape (k,)
        The same with the terms replaced by matrix norms (geometric mean of the 1- and
        infinity-norm) times ||q||: smaller, and the right measure where all terms vanish.
    left_q, left_u : ndarray or None
    biorthogonality : float or None
        Largest off-diagonal |w_i^H (T(l_i) - T(l_j))/(l_i - l_j) x_j| with ones on the diagonal.
    asked : int
        Number of modes asked for.
    status : {"complete", "incomplete"}
        "complete": as many as asked for (or all there are), and none missed in the region.
    complete_above : float
        Growth rate down to which, within `band`, every eigenvalue is listed or was found; where the stiffness
        relaxes also within the lowest frequency and the damping that `region` names.
    complete_below : float
        Upper end of the strip searched; beyond it only the independent count can tell.
    band : float
        Frequency, Hz, up to which `complete_above` holds.
    region : SearchedRegion
    shifts : tuple of complex
    applications : int
        Applications of the shift-and-invert operator.
    refined, rejected : int
        Pairs that needed Newton steps on the full pencil; pairs thrown away.
    notes : tuple of str
        What the caller ought to know, in full sentences.
    """

    eigenvalues: np.ndarray
    q: np.ndarray
    u: np.ndarray
    residual: np.ndarray
    backward_error: np.ndarray
    asked: int
    status: str
    complete_above: float
    complete_below: float
    band: float
    region: SearchedRegion
    shifts: tuple[complex, ...] = ()
    applications: int = 0
    refined: int = 0
    rejected: int = 0
    left_q: np.ndarray | None = None
    left_u: np.ndarray | None = None
    biorthogonality: float | None = None
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        return self.eigenvalues.size

    def __repr__(self) -> str:
        lead = f"leading {complex(self.eigenvalues[0]):.6g} 1/s, " if len(self.eigenvalues) else ""
        worst = f"largest residual {self.residual.max():.1g}" if len(self.residual) else "none found"
        return f"<Spectrum: {len(self.eigenvalues)} of {self.asked} modes, {self.status}, {lead}{worst}>"

    @property
    def growth_rate(self) -> np.ndarray:
        """Real parts, 1/s."""
        return self.eigenvalues.real

    @property
    def frequency(self) -> np.ndarray:
        """Damped frequencies, Hz."""
        return self.eigenvalues.imag / (2 * np.pi)

    @property
    def damping_ratio(self) -> np.ndarray:
        """-Re / |lambda|; +1 or -1 for real eigenvalues, zero for a zero eigenvalue."""
        size = np.abs(self.eigenvalues)
        return -self.eigenvalues.real / np.where(size > 0, size, 1.0)

    @property
    def unstable_count(self) -> int:
        """Number of eigenvalues listed with positive growth rate, conjugates counted apart."""
        return self.count_right_of(0.0)

    def count_right_of(self, line: float) -> int:
        """Number of eigenvalues listed right of a line, conjugates counted apart."""
        return number_right_of(self.eigenvalues, line)

    def mode(self, index: int) -> Mode:
        """One pair."""
        left = self.left_q is not None
        return Mode(
            complex(self.eigenvalues[index]),
            self.q[:, index],
            self.u[:, index],
            self.left_q[:, index] if left else None,
            self.left_u[:, index] if left else None,
        )

    def select(self, chosen) -> Spectrum:
        """Result with some of the pairs."""
        names = PAIRS if self.left_q is None else PAIRS + LEFT
        return replace(self, **{name: getattr(self, name)[..., chosen] for name in names})


@dataclass(frozen=True)
class Mode:
    """One eigenpair.

    Attributes
    ----------
    eigenvalue : complex
    q, u : ndarray, shapes (n,) and (b,)
    left_q, left_u : ndarray or None
        w with w^H T(lambda) = 0, scaled so that w^H T'(lambda) x = 1.
    """

    eigenvalue: complex
    q: np.ndarray
    u: np.ndarray
    left_q: np.ndarray | None = None
    left_u: np.ndarray | None = None

    def __repr__(self) -> str:
        return f"<Mode: eigenvalue {complex(self.eigenvalue):.6g} 1/s, {self.q.size} + {self.u.size} unknowns>"
