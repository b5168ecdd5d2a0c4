"""Formatting and checks that every file keeps."""

import ast
import re
import subprocess
import sys
import tomllib
from pathlib import Path

from dbvfiv.studies import KINDS

ROOT = Path(__file__).parent.parent


def ruff(*arguments: str) -> subprocess.CompletedProcess:
    return subprocess.run([sys.executable, "-m", "ruff", *arguments, "."], cwd=ROOT, capture_output=True, text=True)


def test_files_are_formatted():
    done = ruff("format", "--check")
    assert done.returncode == 0, done.stdout + done.stderr


def test_checks_pass():
    done = ruff("check", "--output-format", "concise")
    assert done.returncode == 0, done.stdout + done.stderr


def test_doors_open_one_way():
    """Contracts of imports between rooms; see docs/developing.md and pyproject.toml."""
    done = subprocess.run(
        [sys.executable, "-c", "from importlinter.cli import lint_imports_command as run; run()"],
        cwd=ROOT,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0 and "0 broken" in done.stdout, done.stdout + done.stderr


def test_every_study_is_bound_by_the_contracts():
    with open(ROOT / "pyproject.toml", "rb") as file:
        contracts = tomllib.load(file)["tool"]["importlinter"]["contracts"]
    rooms = next(c["modules"] for c in contracts if c["type"] == "independence")
    assert set(rooms) == {f"dbvfiv.studies.{kind}" for kind in KINDS}


def sources() -> list[Path]:
    return [path for package in ("dbvfiv", "eigen", "continuation") for path in (ROOT / package).rglob("*.py")]


def test_modules_are_short():
    for path in sources():
        assert len(path.read_text().splitlines()) <= 600, f"{path} has more than 600 lines"


def test_names_of_a_module_are_defined_once():
    """A second function of one name hides the first, which the linter only tells where that is not used between."""
    for path in sources():
        names = re.findall(r"^(?:def|class) (\w+)", path.read_text(), re.M)
        assert len(names) == len(set(names)), f"{path}: {sorted({n for n in names if names.count(n) > 1})}"


def test_own_modules_are_imported_at_the_top():
    """Inside functions only libraries that are slow to import may be, and in commands what they act with."""
    own = r"^ +from (?:\.|(?:dbvfiv|eigen|continuation)\b).* import"
    for path in sources():
        text = path.read_text()
        if path.parent == ROOT / "dbvfiv" / "cli" or not re.search(own, text, re.M):
            continue
        functions = [n for n in ast.walk(ast.parse(text)) if isinstance(n, ast.FunctionDef)]
        for found in (n for f in functions for n in ast.walk(f) if isinstance(n, ast.ImportFrom)):
            name = found.module or ""
            inside = found.level or name.split(".")[0] in ("dbvfiv", "eigen", "continuation")
            assert not inside, f"{path}:{found.lineno} imports {name} inside a function"
