"""The manual as data: its tables, the commands that made them, the code blocks of its pages."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
#: What a line under a table begins with that says where its numbers come from.
MADE, CHECKED, TAKEN = "Made by", "Checked by", "Taken from"
_NUMBER = re.compile(r"^[-+±<]?\s*\d|\d\.\d")


@dataclass(frozen=True)
class Table:
    """A table of a page.

    Attributes
    ----------
    page : path
    line : int
        Of its head, counted from 1.
    rows : tuple of tuple of str
        Its head and its rows, without the rule between.
    stamp : str
        The line below it if that says where the numbers come from, else nothing.
    """

    page: Path
    line: int
    rows: tuple[tuple[str, ...], ...]
    stamp: str

    @property
    def place(self) -> str:
        """Page and line, for messages."""
        return f"{self.page.relative_to(ROOT)}:{self.line}"

    @property
    def has_numbers(self) -> bool:
        """Whether four cells or more, beyond the first of each row and short, begin with a number or hold a decimal."""
        cells = [cell.strip("* ") for row in self.rows[1:] for cell in row[1:]]
        return sum(len(cell) < 60 and bool(_NUMBER.search(cell)) for cell in cells) >= 4

    @property
    def quoted(self) -> tuple[str, ...]:
        """What stands between backticks in the stamp."""
        return tuple(re.findall(r"`([^`]+)`", self.stamp))


def pages() -> list[Path]:
    """The README and every page of the manual that a person writes."""
    written = (ROOT / "docs").rglob("*.md")
    return [ROOT / "README.md", *sorted(page for page in written if page.name != "case-reference.md")]


def tables(page: Path) -> list[Table]:
    """Tables of a page, from top to bottom."""
    lines = page.read_text(encoding="utf-8").splitlines()
    found, at = [], 0
    while at < len(lines):
        if not lines[at].startswith("|"):
            at += 1
            continue
        end = at
        while end < len(lines) and lines[end].startswith("|"):
            end += 1
        rows = [tuple(cell.strip() for cell in line.strip().strip("|").split("|")) for line in lines[at:end]]
        below = next((line for line in lines[end : end + 3] if line), "")
        stamp = below if below.startswith((MADE, CHECKED, TAKEN)) else ""
        found.append(Table(page, at + 1, (rows[0], *rows[2:]), stamp))
        at = end
    return found


def blocks(page: Path, language: str = "") -> list[str]:
    """Code blocks of a language, those without a name by default."""
    text = page.read_text(encoding="utf-8")
    return [body for name, body in re.findall(r"^```(\w*)\n(.*?)^```$", text, re.M | re.S) if name == language]


def indented_commands(page: Path) -> list[str]:
    """Command lines that stand in a paragraph of their own, indented by four blanks."""
    lines = page.read_text(encoding="utf-8").splitlines()
    return [line.strip() for line in lines if line.startswith("    dbvfiv ")]


def command_lines(block: str) -> list[str]:
    """Command lines of a block, those continued by a backslash joined, without remarks."""
    lines = block.replace("\\\n", " ").splitlines()
    return [re.sub(r"\s+#\s.*$", "", line).strip() for line in lines if line.strip() and not line.startswith("#")]


def table_of(page: str, head: str) -> Table:
    """The table of a page of docs/ whose head begins with these words.

    Raises
    ------
    LookupError
        If none does.
    """
    for table in tables(ROOT / "docs" / page):
        if " | ".join(table.rows[0]).startswith(head):
            return table
    raise LookupError(f"docs/{page} has no table that begins with {head!r}.")


def agrees(printed: str, found: float, units: float = 1.01) -> bool:
    """Whether a printed number is one that was found, to a unit of its last digit."""
    number = re.search(r"[-+]?\d+(?:\.(\d+))?(?:e([-+]?\d+))?", printed)
    if number is None:
        return False
    last = 10.0 ** (int(number[2] or 0) - len(number[1] or ""))
    return abs(float(number[0]) - found) <= units * last
