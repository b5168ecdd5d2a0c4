"""Ranges and pressures as words: ``density=1:1000:40:log``, ``pressure=0.5 kPa:50 kPa:64``, ``length=1,10,30 m``."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, Any

from pydantic import AfterValidator, StrictStr, ValidationInfo

from ..errors import CaseError
from .parameters import DESIGN, PARAMETERS, SWEPT, Parameter
from .quantity import number_or_text, unit_behind
from .section import Described, Section

FORM = 'PARAMETER=START:STOP:COUNT, with ":log" behind it for logarithmic steps, or PARAMETER=VALUE,VALUE,...'
_LARGEST = 100_000
#: Parameters that say where something was measured.
PLACES = tuple(name for name in PARAMETERS if name not in DESIGN)


@dataclass(frozen=True)
class Axis:
    """A parameter and the values it takes."""

    parameter: str  #: Name of one of `dbvfiv.case.parameters.PARAMETERS`.
    values: tuple[float, ...]  #: SI values, rising.
    log: bool = False  #: Whether they are spaced logarithmically.

    @property
    def key(self) -> str:
        """Key of the case that holds the parameter."""
        return PARAMETERS[self.parameter].key


def parse_axis(text: str, names: Iterable[str] = SWEPT, density: float | None = None) -> Axis:
    """Read ``PARAMETER=START:STOP:COUNT[:log]`` or ``PARAMETER=VALUE,VALUE,...`` for one of the parameters named;
    pressures may be heads of a fluid whose density, kg/m3, is given. Raises ValueError with a clause that completes
    "key is given as X, ...".
    """
    if not isinstance(text, str):
        raise ValueError("which is not a text")
    name, equals, span = text.partition("=")
    name, parts = name.strip(), [part.strip() for part in span.split(":")]
    if name not in names:
        raise ValueError(f"whose parameter is none of {', '.join(names)}")
    row = PARAMETERS[name]
    log = parts[-1] in ("log", "lin") and parts.pop() == "log"
    listed = len(parts) == 1 and "," in parts[0]
    if not equals or (len(parts) != 3 and not listed):
        raise ValueError("which is not of that form")
    spans = parts[0].split(",") if listed else parts[:2]
    values = [_value(row, part, density) for part in spans]
    units = [unit_behind(part) for part, value in zip(spans, values) if value]
    if "" in units and any(unit and _value(row, f"1 {unit}", density) != 1.0 for unit in units):
        raise ValueError("which has a unit at some of its values alone")
    if not listed and (not re.fullmatch("[0-9]{1,6}", parts[2]) or not 2 <= int(parts[2]) <= _LARGEST):
        raise ValueError(f"whose count is not between 2 and {_LARGEST}")
    if any(first >= second for first, second in pairwise(values)):
        raise ValueError("whose values do not rise" if listed else "whose start is not below its stop")
    start, stop = values[0], values[-1]
    if start < 0 or (start == 0 and (log or not row.low_included)):
        raise ValueError(f"whose start is {'below' if row.low_included and not log else 'not greater than'} 0")
    if start < row.low or stop > row.high:
        raise ValueError(f"whose range is not within {row.low:g} to {row.high:g}")
    if listed:
        return Axis(name, tuple(values), log)
    steps = range(int(parts[2]))
    if log:
        ratio = math.log(stop / start)
        values = [start * math.exp(ratio * i / steps[-1]) for i in steps]
    else:
        values = [start + (stop - start) * i / steps[-1] for i in steps]
    return Axis(name, (*values[:-1], stop), log)


def write_axis(given: Any) -> Any:
    """Text of a range that is given as ``{"density": [1, 10, 100]}``; anything else as it is. Raises CaseError for a
    mapping that is not of one parameter and two or more values.
    """
    if not isinstance(given, Mapping):
        return given
    values = [] if len(given) != 1 else next(iter(given.values()))
    values = values.tolist() if hasattr(values, "tolist") else values
    if not isinstance(values, Sequence) or isinstance(values, str) or len(values) < 2:
        raise CaseError(f'A range is given as {given!r}; it must be {FORM}, or such as {{"density": [1, 10, 100]}}.')
    return f"{next(iter(given))}={','.join(map(str, values))}"


def _value(row: Parameter, text: str, density: float | None) -> float:
    try:
        return row.quantity.parse(float(text))
    except ValueError:
        return row.quantity.parse(text, density)


def parse_point(text: str, density: float | None = None) -> dict[str, float]:
    """Read ``PARAMETER=VALUE, ...``, SI values by name; a pressure may be a head of a fluid of the density, kg/m3, that
    is given, or that stands beside it. Raises ValueError with a clause that completes "key is given as X, ...".
    """
    found: dict[str, float] = {}
    parts = [[piece.strip() for piece in part.partition("=")] for part in filter(str.strip, text.split(","))]
    for name, equals, given in sorted(parts, key=lambda part: part[0] != "density"):
        if name not in PLACES or not equals:
            raise ValueError("which is not of that form")
        if name in found:
            raise ValueError(f"which gives {name} twice")
        row = PARAMETERS[name]
        value = _value(row, given, found.get("density", density))
        if not row.low <= value <= row.high or (value == row.low and not row.low_included):
            above = "" if row.low_included else "more than "
            ends = f"{above}{row.low:g} to {row.high:g} {row.quantity.si}".rstrip()
            raise ValueError(f"whose {name} is not within {ends}")
        found[name] = value
    return {name: found[name] for name, *_ in parts}


def parse_stability_axis(text: str, density: float | None = None) -> Axis:
    """Read a range as `parse_axis` does, or a parameter alone with its usual range. Raises ValueError with a clause
    that completes "key is given as X, ...".
    """
    if isinstance(text, str) and text.strip() in PARAMETERS:
        text = PARAMETERS[text.strip()].usual_range
    return parse_axis(text, tuple(PARAMETERS), density)


class RangeSection(Section):
    """Section of a study over a range, its key ``over``, or at the state of the case where there is none."""

    @property
    def axis(self) -> Axis | None:
        """The parsed range."""
        return None if self.over is None else parse_stability_axis(self.over)

    @property
    def parameter(self) -> str:
        """Parameter of the range; the pressure where there is none."""
        return "pressure" if self.axis is None else self.axis.parameter


def _needs_density(parse: Callable[..., Any], text: str) -> bool:
    """True for the text of a range in heads of the fluid."""
    try:
        parse(text)
    except ValueError:
        return True
    return False


def _readable(parse: Callable[..., Any]) -> AfterValidator:
    """Validator of a text that a function can read, heads of the fluid in a range as pressures."""

    def check(text: str, info: ValidationInfo) -> str:
        axis = parse(text, density=(info.context or {}).get("density"))
        if not isinstance(axis, Axis) or not _needs_density(parse, text):
            return text
        log = ":log" if axis.log else ""
        if "," in text:
            return f"{axis.parameter}={','.join(f'{value!r} Pa' for value in axis.values)}{log}"
        return f"{axis.parameter}={axis.values[0]!r} Pa:{axis.values[-1]!r} Pa:{len(axis.values)}{log}"

    return AfterValidator(check)


#: Keys that hold the text of a range along which modes are tracked, and of any range.
Range = Annotated[StrictStr, _readable(parse_axis)]
StabilityRange = Annotated[StrictStr, _readable(parse_stability_axis)]
#: A key that holds the text of values of parameters.
Point = Annotated[
    StrictStr, _readable(parse_point), Described("text", f"such as 'pressure=1 m', of {', '.join(PLACES)}")
]


_PRESSURE = PARAMETERS["pressure"]
_ALLOWED = (
    f"it must be a pressure of at least 0 kPa and at most {_PRESSURE.high / 1e3:g} kPa, such as '36 kPa', or a head "
    "of the fluid, such as '2 m'"
)


def read_pressures(given: Iterable[Any], name: str, density: float | None = None) -> tuple[float, ...]:
    """Pressures in Pa from numbers and texts with units, heads of a fluid of that density, kg/m3, included. Raises
    CaseError for anything that is not a pressure from 0 to 10 MPa; `name` says in the sentence where it was given.
    """
    found = []
    for value in given:
        try:
            pressure = _PRESSURE.quantity.parse(number_or_text(value), density)
        except ValueError as error:
            raise CaseError(f"{name} is given as {value!r}, {error}; {_ALLOWED}.") from None
        if not 0 <= pressure <= _PRESSURE.high:
            raise CaseError(f"{name} is given as {value!r}; {_ALLOWED}.")
        found.append(pressure)
    if not found:
        raise CaseError(f"{name} is an empty list; it needs at least one pressure.")
    return tuple(found)


def is_single(pressure: Any) -> bool:
    """True for one pressure, whatever it is; False for several, and where none is given."""
    if pressure is None:
        return False
    return isinstance(pressure, str) or not isinstance(pressure, Iterable) or getattr(pressure, "ndim", None) == 0


@dataclass(frozen=True)
class Level:
    """Damping that a mode has where it crosses a contour; of neutral modes none."""

    rate: float = 0.0  #: 1/s; growth rate.
    ratio: float = 0.0  #: Damping ratio, of its own besides a rate of zero.

    @classmethod
    def parse(cls, text: str) -> Level:
        """Level of a text: a growth rate, "-2" or "-2 1/s", or a damping ratio, "5 %". Raises ValueError."""
        ratio = text.strip().endswith("%")
        try:
            number = float(text.strip().removesuffix("%").removesuffix("1/s"))
        except ValueError:
            number = math.nan
        if (ratio and not 0.0 < number < 100.0) or not math.isfinite(number) or number == 0.0:
            raise ValueError(f"in which {text!r} is neither a growth rate, '-2', nor a damping ratio, '5 %'")
        return cls(ratio=number / 100.0) if ratio else cls(number)

    @property
    def words(self) -> str:
        """The level with its unit."""
        return f"{100 * self.ratio:g} %" if self.ratio else f"{self.rate:g} 1/s"

    def excess(self, values):
        """Growth rates of eigenvalues beyond the level, 1/s."""
        return values.real - self.rate + self.ratio * abs(values)

    def shifted(self, values):
        """Array of eigenvalues with their excess as growth rate, the largest first."""
        moved = self.excess(values) + 1j * values.imag
        return moved[(-moved.real).argsort(kind="stable")]

    def eigenvalue(self, omega: float) -> complex:
        """Eigenvalue at the level with an imaginary part, rad/s."""
        return complex(self.rate - self.ratio * omega / math.sqrt(1.0 - self.ratio**2), omega)
