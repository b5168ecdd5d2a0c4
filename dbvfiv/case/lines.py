"""Line number of a key in a TOML file.

The standard parser gives no positions. This scan knows table headers, keys at
the beginning of a line and multi-line strings, which is all that an error
message needs; inside inline values it points to the line the value begins on.
"""

from __future__ import annotations

import re

_PART = r"""(?:[A-Za-z0-9_-]+|"[^"\n]*"|'[^'\n]*')"""
_DOTTED = rf"{_PART}(?:\s*\.\s*{_PART})*"
_HEADER = re.compile(rf"\s*(\[\[?)\s*({_DOTTED})\s*\]")
_KEY = re.compile(rf"\s*({_DOTTED})\s*=(.*)")


def _split(dotted: str) -> tuple[str, ...]:
    return tuple(part.strip().strip("\"'") for part in re.findall(_PART, dotted))


def key_lines(text: str) -> dict[tuple[str, ...], int]:
    """Map every key path of a TOML text to its line, counted from 1.

    Elements of arrays of tables carry their index: ``("layers", "0", "angle")``.
    """
    lines: dict[tuple[str, ...], int] = {}
    counts: dict[tuple[str, ...], int] = {}
    table: tuple[str, ...] = ()
    quote = None
    for number, line in enumerate(text.splitlines(), 1):
        if quote:
            if quote in line:
                quote = None
            continue
        header = _HEADER.match(line)
        if header:
            table = _indexed(_split(header[2]), counts)
            if header[1] == "[[":
                index = counts.get(table, -1) + 1
                counts[table] = index
                table += (str(index),)
            _note(lines, table, number)
            continue
        entry = _KEY.match(line)
        if entry:
            _note(lines, table + _split(entry[1]), number)
            quote = next((q for q in ('"""', "'''") if entry[2].count(q) % 2), None)
    return lines


def _indexed(path: tuple[str, ...], counts: dict[tuple[str, ...], int]) -> tuple[str, ...]:
    """Put the current index behind every parent that is an array of tables."""
    full: tuple[str, ...] = ()
    for i, part in enumerate(path):
        full += (part,)
        if full in counts and i < len(path) - 1:
            full += (str(counts[full]),)
    return full


def _note(lines: dict[tuple[str, ...], int], path: tuple[str, ...], number: int) -> None:
    for end in range(1, len(path) + 1):
        lines.setdefault(path[:end], number)


def line_of(path: tuple[str, ...], lines: dict[tuple[str, ...], int]) -> int | None:
    """Line of a key, or of the nearest table that holds it."""
    for end in range(len(path), 0, -1):
        if path[:end] in lines:
            return lines[path[:end]]
    return None
