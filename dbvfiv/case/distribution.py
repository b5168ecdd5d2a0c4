"""Distributions of uncertain numbers as words: ``normal(1, 0.05)``, ``lognormal(1.2)``, ``uniform(-10 %, 10 %)``.

============================  =========================================================================
``normal(MEAN, SD)``          mean and standard deviation
``lognormal(MEDIAN, FACTOR)`` median, and the factor between it and one standard deviation of its logarithm
``uniform(LOW, HIGH)``        even between two bounds
``samples(V, V, ...)``        each of some values, or of those on the lines of a text file, with the same probability
============================  =========================================================================

Arguments carry units as everywhere in a case. A per cent is of the value that the case has: ``normal(5 %)`` and
``lognormal(1.2)`` lie about that, ``uniform(-10 %, 10 %)`` on both sides of it. Of a number that cases give in per
cent, such as a strain level, it is so as a spread alone: mean, median, bounds and samples are values themselves.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .quantity import Quantity, number_or_text
from .tables import numbered_lines

if TYPE_CHECKING:
    import numpy as np

#: Share of a distribution that may lie where its parameter cannot be: one sample in a million.
ALLOWED = 1e-6
_FORM = re.compile(r"\s*(normal|lognormal|uniform|samples)\s*\((.*)\)\s*", re.DOTALL)
_PERCENT = re.compile(r"\s*([+-]?[\d.]+(?:[eE][+-]?\d+)?)\s*%\s*")
FORMS = (
    'it must be such as "normal(5 %)", "normal(MEAN, SD)", "lognormal(1.2)", "lognormal(MEDIAN, FACTOR)", '
    '"uniform(LOW, HIGH)" or "samples(V, V, ...)"'
)


@dataclass(frozen=True)
class Distribution:
    """Distribution of one number."""

    form: str  #: "normal", "lognormal", "uniform" or "samples".
    #: Mean and standard deviation, median and factor, bounds, or the values in ascending order; SI.
    numbers: tuple[float, ...]

    @classmethod
    def parse(
        cls, text: Any, quantity: Quantity, own: float | None = None, density: float | None = None
    ) -> Distribution:
        """Read a distribution of a quantity whose value in the case is `own`, SI, where it has one number; heads are of
        a fluid with a density, kg/m3. Raises ValueError with a clause that completes "KEY is given as X, ...".
        """
        match = _FORM.fullmatch(text) if isinstance(text, str) else None
        if match is None:
            raise ValueError("which is no distribution")

        def value(part: str) -> float:
            return quantity.parse(number_or_text(part), density)

        form, file = match[1], samples_file(text)
        lines = match[2].split(",") if file is None else (line for _, line in numbered_lines(file))
        parts = [part.strip() for part in lines if part.strip()]
        if form == "samples":
            if len(parts) < 2:
                raise ValueError("which names no file and fewer than two values")
            values = tuple(sorted(map(value, parts)))
            if values[0] == values[-1]:
                raise ValueError("whose values are all the same")
            return cls(form, values)
        if not 1 <= len(parts) <= 2 or (form == "uniform" and len(parts) == 1):
            raise ValueError(f"which has {len(parts)} arguments")
        spreads = parts if quantity.shown != "%" else parts[1:] if form == "normal" else []
        if own is None and (len(parts) == 1 or any(map(_PERCENT.fullmatch, spreads))):
            raise ValueError("which is relative to the value of the case, and that is no one number")
        if form == "lognormal":
            factor = Quantity("").parse(number_or_text(parts[-1]))
            median = own if len(parts) == 1 else value(parts[0])
            if factor <= 1:
                raise ValueError(f"whose factor {factor:g} is not greater than 1")
            if median <= 0:
                raise ValueError(f"whose median {median:g} is not greater than 0")
            return cls(form, (median, factor))
        if form == "normal":
            mean = own if len(parts) == 1 else value(parts[0])
            spread = _of(parts[-1], value, own, 0.0)
            if spread <= 0:
                raise ValueError("whose standard deviation is not greater than 0")
            return cls(form, (mean, spread))
        low, high = (_of(part, value, own, None if quantity.shown == "%" else own) for part in parts)
        if low >= high:
            raise ValueError("whose bounds do not rise")
        return cls(form, (low, high))

    @classmethod
    def is_relative(cls, text: Any, quantity: Quantity, density: float | None = None) -> bool:
        """True for a distribution that counts from the value of the case, or that cannot be read."""
        try:
            cls.parse(text, quantity, None, density)
        except ValueError:
            return True
        return False

    def at(self, normal: np.ndarray) -> np.ndarray:
        """Values whose probability is that of standard normal ones of any shape."""
        import numpy as np  # here as below: keys of a case are read without it

        a, b = self.numbers[0], self.numbers[-1]
        if self.form == "normal":
            return a + b * normal
        if self.form == "lognormal":
            return a * b**normal
        from scipy.special import ndtr

        if self.form == "uniform":
            return a + (b - a) * ndtr(normal)
        values = np.array(self.numbers)
        return values[np.minimum((len(values) * ndtr(normal)).astype(int), len(values) - 1)]

    @property
    def median(self) -> float:
        """Value that is not exceeded in half of all cases."""
        import numpy as np

        return float(self.at(np.zeros(1))[0])

    @property
    def scale(self) -> float:
        """Standard deviation, of a lognormal one towards larger values."""
        import numpy as np

        if self.form in ("normal", "lognormal"):
            return float(self.at(np.ones(1))[0]) - self.median
        return float(np.std(self.numbers)) / (1.0 if self.form == "samples" else np.sqrt(3.0))

    @property
    def spread(self) -> float:
        """Standard deviation to first order in the scores, that of a lognormal one the same to both sides."""
        import numpy as np

        return self.median * float(np.log(self.numbers[1])) if self.form == "lognormal" else self.scale

    def share_outside(self, low: float, high: float) -> float:
        """Probability of values below one bound or above another."""
        import numpy as np
        from scipy.stats import norm, uniform

        a, b = self.numbers[0], self.numbers[-1]
        if self.form == "samples":
            return float(np.mean([not low <= value <= high for value in self.numbers]))
        if self.form == "lognormal":
            ends = (-np.inf if low <= 0 else np.log(low / a), -np.inf if high <= 0 else np.log(high / a))
            below, above = norm.cdf(ends[0] / np.log(b)), norm.sf(ends[1] / np.log(b))
        else:
            own = norm(a, b) if self.form == "normal" else uniform(a, b - a)
            below, above = own.cdf(low), own.sf(high)
        return float(below + above)

    def words(self, quantity: Quantity) -> str:
        """The distribution as a case would hold it."""
        if self.form == "samples":
            return f"samples of {len(self.numbers)} values"
        first, second = map(quantity.amount, self.numbers)
        # a factor has no unit, and a spread in per cent would be one of the value
        if self.form == "lognormal" or (self.form == "normal" and quantity.shown == "%"):
            second = f"{self.numbers[1]:.4g}"
        return f"{self.form}({first}, {second})"


def samples_file(text: str) -> Path | None:
    """File that the text of a distribution names for its samples; None for any other text."""
    match = _FORM.fullmatch(text)
    if match is None or match[1] != "samples":
        return None
    inside = match[2].strip()  # numbers begin with no slash, full names do
    return None if "," in inside and not inside.startswith("/") else Path(inside)


def with_full_names(text: str, folder: Path | None) -> str:
    """Text of a distribution whose samples are in a file, with the full name of that file; any other as it is."""
    match = _FORM.fullmatch(text)
    if match is None or match[1] != "samples" or folder is None:
        return text
    path = folder / match[2].strip()
    try:
        return f"samples({path.resolve()})" if path.is_file() else text
    except OSError:  # many values are no name of a file
        return text


def _of(text: str, value: Callable[[str], float], own: float | None, base: float | None) -> float:
    """A value, or `base` with a per cent of the case's own value on it where there is one."""
    percent = _PERCENT.fullmatch(text)
    if percent is None or base is None:
        return value(text)
    return base + 0.01 * float(percent[1]) * abs(own)
