"""Ranges of a parameter as one word: ``density=1:1000:40:log``, ``pressure=0.5 kPa:50 kPa:64``."""

from __future__ import annotations

import math
from dataclasses import dataclass

from .quantity import Quantity

PARAMETERS = {
    "pressure": Quantity("Pa", "kPa"),
    "density": Quantity("kg/m^3", "kg/m^3"),
    "alpha": Quantity("1/s", "1/s"),
    "beta": Quantity("s", "s"),
}
KEYS = {
    "pressure": "drive.pressure",
    "density": "fluid.density",
    "alpha": "damping.alpha",
    "beta": "damping.beta",
}
FORM = 'PARAMETER=START:STOP:COUNT, with ":log" behind it for logarithmic steps'
_LARGEST = 100_000


@dataclass(frozen=True)
class Axis:
    """A parameter and the values it takes.

    Attributes
    ----------
    parameter : str
        "pressure", "density", "alpha" or "beta", whose ``key`` is that of the case; studies of stability know more, see
        `stability_axis`.
    values : tuple of float
        SI values from start to stop.
    log : bool
        Whether they are spaced logarithmically.
    """

    parameter: str
    values: tuple[float, ...]
    log: bool = False

    @property
    def key(self) -> str:
        return KEYS[self.parameter]


def parse_axis(text: str, quantities: dict[str, Quantity] = PARAMETERS) -> Axis:
    """Read ``PARAMETER=START:STOP:COUNT[:log]`` for one of the parameters that have a quantity.

    Raises
    ------
    ValueError
        With a clause that completes "key is given as X, ...".
    """
    if not isinstance(text, str):
        raise ValueError("which is not a text")
    name, equals, span = text.partition("=")
    name, parts = name.strip(), [part.strip() for part in span.split(":")]
    if name not in quantities:
        raise ValueError(f"whose parameter is none of {', '.join(quantities)}")
    log = parts[-1] in ("log", "lin") and parts.pop() == "log"
    if not equals or len(parts) != 3:
        raise ValueError("which is not of that form")
    start, stop = (_value(quantities[name], part) for part in parts[:2])
    if not parts[2].isascii() or not parts[2].isdigit() or len(parts[2]) > 6 or not 2 <= int(parts[2]) <= _LARGEST:
        raise ValueError(f"whose count is not between 2 and {_LARGEST}")
    if start >= stop:
        raise ValueError("whose start is not below its stop")
    if start < 0 or (start == 0 and (log or name in ("density", "pressure"))):
        raise ValueError("whose start is not greater than 0")
    count = int(parts[2])
    if log:
        ratio = math.log(stop / start)
        values = [start * math.exp(ratio * i / (count - 1)) for i in range(count)]
    else:
        values = [start + (stop - start) * i / (count - 1) for i in range(count)]
    return Axis(name, (*values[:-1], stop), log)


def _value(quantity: Quantity, text: str) -> float:
    try:
        return quantity.parse(float(text))
    except ValueError:
        return quantity.parse(text)
