"""What vouches for a verdict on stability: two routes to the number of unstable eigenvalues."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Certificate:
    """Agreement of a spectrum with an independent count, for a mode list and for a cell of a map alike.

    Attributes
    ----------
    unstable : int
        Eigenvalues right of `line` by the spectrum, conjugates counted apart.
    counted : int
        The same by the argument principle.
    certain : bool
        The count followed its phase everywhere, and what both rest on is accurate enough.
    line : float
        Growth rate counted from, 1/s.
    band : float
        Hz; frequencies up to it were looked at, infinite for all.

    Examples
    --------
    >>> Certificate(2, 2, True).stable, Certificate(0, 2, True).stable, Certificate(0, 0, True).stable
    (False, None, True)
    """

    unstable: int
    counted: int
    certain: bool
    line: float = 0.0
    band: float = np.inf

    @property
    def agrees(self) -> bool:
        """Both routes give the same number, and the count is certain."""
        return self.certain and self.unstable == self.counted

    @property
    def stable(self) -> bool | None:
        """Whether all eigenvalues up to the band decay; None without agreement."""
        return self.unstable == 0 if self.agrees else None

    @property
    def where(self) -> str:
        """The region in words, empty for the whole right half-plane."""
        text = "" if self.line == 0 else f" with a growth rate above {self.line:.4g} 1/s"
        return text + ("" if np.isinf(self.band) else f" up to {self.band:.4g} Hz")
