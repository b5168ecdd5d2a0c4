"""Words of the field in all that a user reads: messages, help of commands, the report, guides and tutorials."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parent.parent
#: Word that is none of the field -> what the field says.
WORDS = {
    r"continuity laws?|laws? of continuity": "flow model",
    r"class(es)? of motion": "symmetry class",
    r"runs? away|runaway": "static instability (divergence)",
    r"relaxing wall|what relaxes": "viscoelastic wall",
    r"apart from creep": "relaxation spectrum",
    r"pencil famil\w+": "parameter-separable operator",
    r"small models?": "reduced-order model",
    r"winding": "argument-principle count",
    r"vouch\w*|certificates? (of|for|that)|(lack|carry|carries) a certificate": "stability verdict, eigenvalue count",
    r"would do|\boval\b|coverage": "search region, completeness check",
    r"laden|outside the wall added": "added mass, wetted modes",
    r"books": "energy budget",
    r"slow law": "long-term response",
    r"\bweb\b": "neutral curve",
    r"way on\b|\bshield\b": "checkpoint, restart",
    r"drawers?": "figures",
    r"phase counts?|cell counts?": "argument-principle count",
    r"level pressures?": "hydrostatic head",
}
WRONG = re.compile(rf"\b(?:{'|'.join(WORDS)})\b", re.IGNORECASE)


def messages(path: Path) -> Iterator[tuple[int, str]]:
    """Sentences that a module may print: texts of several words but for docstrings, and the help of commands."""
    tree = ast.parse(path.read_text())
    inside = set()
    for node in ast.walk(tree):
        if isinstance(node, (ast.FunctionDef, ast.ClassDef, ast.Module)) and node.body:
            first = node.body[0]
            shown = isinstance(node, ast.FunctionDef) and (node.name == "command" or path.parent.name == "cli")
            if isinstance(first, ast.Expr) and not shown:
                inside.add(id(first.value))
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in inside:
            if " " in node.value.strip():
                yield node.lineno, " ".join(node.value.split())


def readings() -> Iterator[tuple[str, str]]:
    """Places and texts that a user reads; of modules those alone that have a word in question somewhere."""
    pages = [*(ROOT / "docs" / "tutorials").glob("*.md"), ROOT / "docs" / "report.md", ROOT / "README.md"]
    for path in (*pages, ROOT / "dbvfiv" / "report" / "page.html"):
        yield path.name, " ".join(path.read_text().split())
    for path in sorted((ROOT / "dbvfiv").rglob("*.py")):
        text = re.sub(r"""["']\s+f?["']""", "", path.read_text())  # what stands on several lines in one
        if WRONG.search(" ".join(text.split())):
            yield from ((f"{path.relative_to(ROOT)}:{line}", text) for line, text in messages(path))


def test_what_is_read_is_in_the_words_of_the_field():
    said = [(place, found[0], text[:120]) for place, text in readings() if (found := WRONG.search(text))]
    assert not said, f"The field has other words, see WORDS: {said}"
