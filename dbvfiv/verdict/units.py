"""Units of time as they stand in the headers of recorded data: "time [ms]", "t (us)", "Time, min", "t_ms"."""

from __future__ import annotations

import re

_SPELLINGS = {
    1.0: "s sec secs second seconds",
    1e-3: "ms msec msecs millisec millisecond milliseconds",
    1e-6: "us µs μs usec usecs microsec microsecond microseconds",
    1e-9: "ns nsec nanosecond nanoseconds",
    60.0: "min mins minute minutes",
    3600.0: "h hr hrs hour hours",
}
_SECONDS = {word: factor for factor, words in _SPELLINGS.items() for word in words.split()}
#: A unit that is set off from the name, and one that only follows it.
_SET_OFF = (
    re.compile(r"[\[(<{]\s*([^\])>}]*?)\s*[\])>}]\s*$"),
    re.compile(r"[,/]\s*([^,/]+?)\s*$"),
    re.compile(r"\sin\s+(\S+)\s*$", re.IGNORECASE),
)
_TRAILING = re.compile(r"[\s_.\-]([^\s_.\-]+)$")


def seconds_in(unit: str) -> float:
    """Seconds in a unit of time.

    Parameters
    ----------
    unit : str
        Such as "ms"; brackets around it and its case do not matter.

    Raises
    ------
    ValueError
        One clause, if the unit is none of time.

    Examples
    --------
    >>> seconds_in("[ms]")
    0.001
    """
    word = unit.strip().strip("[](){}<>").strip().lower()
    if word not in _SECONDS:
        raise ValueError(f"{unit.strip()!r} is no unit of time; s, ms, us, ns, min and h are known")
    return _SECONDS[word]


def unit_in_name(name: str) -> str:
    """Unit that the name of a column carries; empty without one.

    What stands in brackets or behind a comma, a slash or "in" is taken for a unit, whether it is known or not; what
    stands behind a blank or an underscore only if it is a unit of time.

    Examples
    --------
    >>> unit_in_name("time [ms]"), unit_in_name("t_us"), unit_in_name("run time")
    ('ms', 'us', '')
    """
    if is_unit_of_time(name):
        return name.strip()
    for pattern in _SET_OFF:
        found = pattern.search(name)
        if found:
            return found[1]
    found = _TRAILING.search(name.strip())
    return found[1] if found and found[1].lower() in _SECONDS else ""


def is_unit_of_time(text: str) -> bool:
    """True where a text, with or without brackets, is a unit of time."""
    return text.strip().strip("[](){}<>").strip().lower() in _SECONDS
