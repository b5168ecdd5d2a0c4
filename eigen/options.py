"""What a search for leading modes can be told."""

from __future__ import annotations

import math
from dataclasses import dataclass

#: Share of a limit point of eigenvalues right of which an eigenvalue is clearly apart from it.
CLEAR = 0.8
#: Lowest frequency searched where the stiffness relaxes, over the highest, and decay over angular frequency down to
#: which such a search goes at most; slower and more strongly damped motions shade off into relaxation.
LOWEST, SLOPE = 0.05, 0.75


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
    krylov_tolerance : float
        Relative tolerance of the Krylov method.
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
    max_pairs : int
        Eigenvalues sought at one shift at most.
    """

    max_frequency: float | None = None
    limit_point: float | None = None
    shifts: tuple[complex, ...] | None = None
    tolerance: float = 1e-8
    krylov_tolerance: float = 1e-12
    left: bool = False
    method: str = "auto"
    dense_below: int = 240
    least: int = 6
    max_shifts: int = 4
    max_pairs: int = 500

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
        if not (0 < self.krylov_tolerance < 1 and 0 < self.tolerance < 1):
            raise ValueError("Tolerances must lie between 0 and 1.")
        if self.max_shifts < 1 or self.max_pairs < 1 or self.least < 1:
            raise ValueError("max_shifts, max_pairs and least must be at least 1.")
