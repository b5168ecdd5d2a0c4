"""Short texts: numbers and words in sentences, values for JSON, and what `repr` shows of objects that hold arrays and
other objects.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterable, Mapping, Sequence, Set
from dataclasses import asdict, fields, is_dataclass
from itertools import islice
from typing import Any

#: Lines of a text, columns of a line, characters of one value.
LINES, COLUMNS, VALUE = 10, 118, 60


def digits(value: float, count: int = 3, sign: str = "") -> str:
    """Significant digits of a number, a large one without a power of ten; sign "+" shows that of a positive one too.

    Examples
    --------
    >>> digits(99.7, 2), digits(1234.5, sign="+"), digits(0.01234, 2)
    ('100', '+1230', '0.012')
    """
    shown = float(f"{value:.{count}g}")
    return f"{shown:{sign}.0f}" if 10.0 ** (count - 1) <= abs(shown) < 1e9 else f"{shown:{sign}.{count}g}"


def listed(words: Iterable[str]) -> str:
    """Words of a sentence, "a, b and c"."""
    found = list(words)
    return f"{', '.join(found[:-1])} and {found[-1]}" if len(found) > 1 else "".join(found)


def clause(text: str) -> str:
    """Text as a sentence can quote it: printable, on one line, without a full stop that would look like its end."""
    return " ".join("".join(c if c.isprintable() else " " for c in text).split()).replace(". ", "., ")


def json_value(value: Any) -> Any:
    """A value as JSON has it: arrays become lists, numbers that are not finite null."""
    if hasattr(value, "tolist"):  # numpy and JAX arrays and scalars
        value = value.tolist()
    if isinstance(value, complex):
        return {"re": json_value(value.real), "im": json_value(value.imag)}
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {str(k): json_value(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [json_value(v) for v in value]
    if value is None or isinstance(value, (bool, int, str)):
        return value
    if is_dataclass(value):
        return json_value(asdict(value))
    if hasattr(value, "to_dict"):
        return json_value(value.to_dict())
    return str(value)


def short_repr(thing: Any) -> str:
    """Type and fields of a dataclass or a section of a case, at most `LINES` lines: arrays by shape, objects by type.

    The ``__repr__`` of a class, or given to a dataclass by `shortly`.
    """
    names = [f.name for f in fields(thing) if f.repr] if is_dataclass(thing) else list(type(thing).model_fields)
    told = ", ".join(f"{name} {_value(getattr(thing, name))}" for name in names)
    lines = textwrap.wrap(f"<{type(thing).__name__}: {told}>", COLUMNS, subsequent_indent="  ", break_long_words=False)
    return "\n".join([*lines[: LINES - 1], "  ...>"] if len(lines) > LINES else lines)


def shortly(kind):
    """Give a dataclass the text of `short_repr`."""
    kind.__repr__ = short_repr
    return kind


def _value(value: Any) -> str:
    if value is None or isinstance(value, bool):
        return str(value)
    if isinstance(value, (int, float, complex)):
        return f"{value:.6g}"
    shape = getattr(value, "shape", None)
    if shape is not None:
        return f"{value:.6g}" if shape == () else f"array {shape}"
    if isinstance(value, str):
        return repr(value if len(value) <= VALUE else value[: VALUE - 3] + "...")
    if isinstance(value, (Mapping, Set, Sequence)):
        if isinstance(value, Mapping):
            inner = (f"{_value(name)}: {_value(held)}" for name, held in value.items())
        else:
            inner = map(_value, value)
        text = ", ".join(islice(inner, VALUE))
        return f"({text})" if len(text) <= VALUE else f"{len(value)} of them"
    return type(value).__name__
