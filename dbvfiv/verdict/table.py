"""Tables of numbers from text files as instruments write them, and units of time in their headers.

Columns are separated by commas, semicolons, tabs or blanks; decimals by points or commas; the text is UTF-8, UTF-16 or
Latin-1. Names may stand above the numbers, with a row of units under them and lines about the measurement before them.
"""

from __future__ import annotations

import csv
import re
from collections import Counter
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

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
    """Seconds in a unit of time. Raises ValueError: one clause, if the unit is none of time.

    Parameters
    ----------
    unit : str
        Such as "ms"; brackets around it and its case do not matter.

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


_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eEdD][+-]?\d+)?")
_MISSING = {"", "nan", "+nan", "-nan", "na", "n/a", "#n/a", "#na", "null", "none", "-", "--", "inf", "+inf", "-inf"}
#: What is said behind the numbers of a line; a missing value as spreadsheets write it, #N/A, is a cell.
_REMARK = re.compile(r"#(?!n/?a[\"\s]*(?:[\t,;]|$|[-+.\d#])).*", re.IGNORECASE)
#: Dates with a time of day, as ISO 8601 and control systems write them.
_DATE = re.compile(r"\d{1,4}[-./]\d{1,2}[-./]\d{1,4}[T ]\s*\d{1,2}:\d{2}")
#: A date and a time of day in columns of their own.
_DAY = re.compile(r"\d{1,4}[-./]\d{1,2}[-./]\d{1,4}")
_CLOCK = re.compile(r"\d{1,2}:\d{2}(:\d{2}([.,]\d+)?)?(\s*[AP]M)?", re.IGNORECASE)
_DAYS = ("%Y-%m-%d", "%Y/%m/%d", "%d.%m.%Y", "%d-%m-%Y")
#: Those that only a whole file tells apart.
_SLASHED, _SLASHES = re.compile(r"\d{1,2}/\d{1,2}/\d{4}(?=[T ])"), ("%m/%d/%Y", "%d/%m/%Y")
_CLOCKS = ("%H:%M:%S.%f", "%H:%M:%S", "%H:%M", "%I:%M:%S %p", "%I:%M:%S.%f %p")
#: Numbers beyond this are no measurement, and their squares would overflow.
_LARGEST = 1e100
#: Ways to read a line: separator (blanks: empty) and decimal sign.
_FORMATS = (("\t", "."), ("\t", ","), (";", "."), (";", ","), (",", "."), ("", "."), ("", ","))
#: Lines from which the way is told.
_LOOKED_AT = 400


@dataclass(frozen=True)
class Table:
    """Columns of numbers."""

    names: tuple[str, ...]  #: From the header, or "column 1", ...
    values: np.ndarray  #: (rows, columns); NaN where a cell holds no number.
    units: tuple[str, ...] = ()  #: From a row of units under the header; empty where there is none.
    #: (rows,) array of int; line of the file that each row stands in.
    lines: np.ndarray = field(default_factory=lambda: np.zeros(0, int))
    #: What stood in cells that hold no number, by row and column.
    texts: dict[tuple[int, int], str] = field(default_factory=dict, repr=False)

    def index(self, wanted: str) -> int:
        """Column by name, part of a name or number from 1. Raises ValueError."""
        exact = [i for i, name in enumerate(self.names) if name.lower() == wanted.lower()]
        part = [i for i, name in enumerate(self.names) if wanted.lower() in name.lower()]
        if exact or (len(part) == 1 and not wanted.isdigit()):
            return (exact or part)[0]
        if wanted.isdecimal() and 1 <= int(wanted) <= len(self.names):
            return int(wanted) - 1
        raise ValueError(f"there is no column {wanted!r}; there are {', '.join(self.names)}")

    def seconds(self, column: int) -> float:
        """Seconds in the unit that a column of times is given in; 1 where neither the header nor a row of units says.
        Raises ValueError if what the header says is no unit of time.
        """
        unit = (self.units[column] if self.units else "") or unit_in_name(self.names[column])
        return seconds_in(unit) if unit.strip() else 1.0

    def bad_rows(self, columns: list[int]) -> np.ndarray:
        """(rows,) whether a cell of these columns holds no finite number."""
        return ~np.isfinite(self.values[:, columns]).all(axis=1)

    def describe_bad(self, columns: list[int]) -> str:
        """One clause about the rows of these columns that hold no number; empty without any."""
        bad = np.flatnonzero(self.bad_rows(columns))
        if not len(bad):
            return ""
        row = int(bad[0])
        column = next(c for c in columns if not np.isfinite(self.values[row, c]))
        text = self.texts.get((row, column), "")
        holds = f"holds {text[:40]!r}" if text.strip() else "holds nothing"
        others = f", and {len(bad) - 1} more rows are like it" if len(bad) > 1 else ""
        return f"line {self.lines[row]} {holds} where column {self.names[column]!r} needs a number{others}"


def read_table(path: str | Path) -> Table:
    """Read a text file of numbers; text after ``#`` and empty lines are skipped. Raises ValueError: one clause: what
    does not fit. Raises OSError if the file cannot be read.

    Returns
    -------
    Table
        Cells that hold no number, such as "NaN", blanks or text, are NaN: see `Table.bad_rows`.
    """
    lines = re.split(r"\r\n|\r|\n", _decoded(Path(path).read_bytes()))
    bodies = [(number, line) for number, line in enumerate(lines, 1) if _REMARK.sub("", line).strip(" \t,;")]
    if not bodies:
        raise ValueError("it holds no numbers")
    separator, decimal = _format_of([_REMARK.sub("", line) for _, line in bodies])
    rows = [(number, _cells(_REMARK.sub("", line), separator)) for number, line in bodies]
    parted = _parted_dates(rows)
    rows = [(number, _joined(cells, parted)) for number, cells in rows]
    days = _days_of({found[0] for _, cells in rows for cell in cells if (found := _SLASHED.match(cell.strip(' "')))})
    numbers = [[_number(cell, decimal, days) for cell in cells] for _, cells in rows]
    first = next((i for i, row in enumerate(numbers) if _is_data(row)), None)
    if first is None:
        raise ValueError(_why_no_data(rows, numbers))
    width = _width(numbers[first:])
    head = [_cells(line, separator) for _, line in bodies[:first]]
    if not head:
        head = [_cells(line.lstrip("# "), separator) for line in lines[: bodies[0][0] - 1] if line.startswith("#")]
    names, units = _header([_joined(cells, parted) for cells in head], width)
    values, texts = np.full((len(rows) - first, width), np.nan), {}
    for i, ((_, cells), row) in enumerate(zip(rows[first:], numbers[first:])):
        fits = len(row) <= width or not any(cell.strip() for cell in cells[width:])
        for j in range(width):
            value = row[j] if fits and j < len(row) else None
            if value is not None and np.isfinite(value):
                values[i, j] = value
            else:
                texts[i, j] = (cells[j] if j < len(cells) else "") if fits else separator.join(cells)
    return Table(names, values, units, np.array([number for number, _ in rows[first:]]), texts)


def _parted_dates(rows: list[tuple[int, list[str]]]) -> int | None:
    """Column of dates beside one of times of day, by most of the rows; None without such."""
    found = Counter(
        at
        for _, cells in rows[:_LOOKED_AT]
        for at, (day, clock) in enumerate(zip(cells, cells[1:]))
        if _DAY.fullmatch(day.strip()) and _CLOCK.fullmatch(clock.strip())
    )
    at, count = found.most_common(1)[0] if found else (None, 0)
    return at if 2 * count > len(rows[:_LOOKED_AT]) else None


def _joined(cells: list[str], at: int | None) -> list[str]:
    """Cells with a column and the next one made one."""
    if at is None or len(cells) < at + 2:
        return cells
    return [*cells[:at], " ".join(cells[at : at + 2]).strip(), *cells[at + 2 :]]


def _why_no_data(rows: list[tuple[int, list[str]]], numbers: list[list[float | None]]) -> str:
    for (line, cells), values in zip(rows, numbers):
        if any(value is not None and np.isfinite(value) for value in values):
            text = next(cell for cell, value in zip(cells, values) if value is None)
            return f"it holds no row of numbers, and line {line} holds {text[:40]!r} where a number is needed"
    return "it holds no numbers"


def _decoded(data: bytes) -> str:
    """Text of a file; what is not UTF-8 is taken for Latin-1, as Windows programs write it."""
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        encodings = ["utf-16"]
    else:
        if b"\0" in data:
            raise ValueError("it is not a text file")
        encodings = ["utf-8-sig", "cp1252", "latin-1"]
    for encoding in encodings:
        try:
            return data.decode(encoding)
        except UnicodeDecodeError:
            continue
    raise ValueError("it is not a text file")


def _cells(line: str, separator: str) -> list[str]:
    if not separator:
        return line.split()
    try:
        return [cell.strip() for cell in next(csv.reader([line.strip(" \r\n")], delimiter=separator))]
    except (csv.Error, StopIteration):
        return [cell.strip().strip('"') for cell in line.strip().split(separator)]


def _days_of(slashed: set[str]) -> tuple[str, ...]:
    """Forms of dates to read a file by: of those with slashes the one that reads more of its dates, of two that read as
    many the one that has them closer together.
    """

    def doubts(form: str) -> tuple[int, float]:
        found = [moment for day in slashed if (moment := _read(day, form)) is not None]
        return len(slashed) - len(found), float(np.ptp(found)) if found else 0.0

    return (*_DAYS, min(_SLASHES, key=doubts))


def _read(text: str, form: str) -> float | None:
    """Seconds since 1970 of a date in a form, None where it is in another one."""
    try:
        return datetime.strptime(text, form).replace(tzinfo=UTC).timestamp()
    except ValueError:
        return None


def _number(cell: str, decimal: str, days: tuple[str, ...] = _DAYS + _SLASHES) -> float | None:
    """Value of a cell; NaN where it says that a value is missing, None where it is text."""
    text = cell.strip().strip('"')
    if text.lower() in _MISSING:
        return np.nan
    if decimal == ",":
        if "." in text and not _DATE.match(text):
            return None
        text = text.replace(",", ".")
    if not _NUMBER.fullmatch(text):
        return _moment(text, days)
    value = float(text.replace("d", "e").replace("D", "e"))
    return value if abs(value) < _LARGEST else None


def _moment(text: str, days: tuple[str, ...]) -> float | None:
    """Seconds since 1970 of a date with a time of day, None where the text is none."""
    if not _DATE.match(text):
        return None
    try:
        found = datetime.fromisoformat(text)
        return (found if found.tzinfo else found.replace(tzinfo=UTC)).timestamp()
    except ValueError:
        pass
    day, _, clock = text.replace("T", " ").partition(" ")
    tried = (_read(f"{day} {clock.strip()}", f"{form} {time}") for form in days for time in _CLOCKS)
    return next((moment for moment in tried if moment is not None), None)


def _is_data(row: list[float | None]) -> bool:
    """True where a row holds numbers and nothing else but missing values."""
    return all(value is not None for value in row) and any(np.isfinite(value) for value in row)


def _format_of(lines: list[str]) -> tuple[str, str]:
    """Separator and decimal sign with which most cells are numbers in rows of one width, as wide as the header."""
    chosen = lines[:_LOOKED_AT]
    best, found = (-1.0,), _FORMATS[4]
    for separator, decimal in _FORMATS:
        if separator and not any(separator in line for line in chosen):
            continue
        cells = [_cells(line, separator) for line in chosen]
        rows = [[_number(cell, decimal) for cell in row] for row in cells]
        data = [i for i, row in enumerate(rows) if _is_data(row)]
        widths = Counter(len(rows[i]) for i in data)
        width, alike = widths.most_common(1)[0] if widths else (0, 0)
        above = cells[: data[0]] if data else []
        titled = any(len(row) == width and re.search("[^\\W\\d]", "".join(row)) is not None for row in above)
        if (separator, decimal, width, titled) == ("", ",", 1, False):
            alike = 0  # "1,2" is two numbers unless a header says otherwise
        score = (alike, titled, width)
        if score > best:
            best, found = score, (separator, decimal)
    return found


def _width(rows: list[list[float | None]]) -> int:
    """Number of columns of most rows; one that is empty everywhere, behind a separator at the end, does not count."""
    data = [row for row in rows if _is_data(row)]
    width = Counter(map(len, data)).most_common(1)[0][0]
    whole = [row for row in data if len(row) == width]
    while width > 1 and all(not np.isfinite(row[width - 1]) for row in whole):
        width -= 1
    return width


def _header(head: list[list[str]], width: int) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Names and units from the lines above the numbers."""
    unnamed = tuple(f"column {i + 1}" for i in range(width))
    fitting = [cells[:width] for cells in head if len(cells) >= width and not any(cells[width:])]
    if not fitting:
        if len(head) == 1 and len(head[0]) > 1:
            raise ValueError(f"its header names {len(head[0])} columns and its rows have {width}")
        return unnamed, ()
    names, units = fitting[-1], []
    if len(fitting) > 1 and _are_units(fitting[-1]):
        names, units = fitting[-2], fitting[-1]
    elif all(_in_brackets(cell) for cell in fitting[-1]):
        names, units = [], fitting[-1]
    titles = tuple(name.strip() or other for name, other in zip(names, unnamed)) if names else unnamed
    return titles, tuple(unit.strip().strip("[](){}<>").strip() for unit in units)


def _are_units(cells: list[str]) -> bool:
    """True where a row reads as units: all in brackets, or short with a unit of time among them."""
    written = [cell.strip() for cell in cells if cell.strip()]
    if not written:
        return False
    if all(_in_brackets(cell) for cell in written):
        return True
    return any(map(is_unit_of_time, cells)) and all(len(cell) <= 8 for cell in written)


def _in_brackets(cell: str) -> bool:
    return len(cell) > 1 and cell[0] + cell[-1] in ("[]", "()", "{}", "<>")
