"""The manual as a site: it builds, no link leads nowhere, and every page is in its contents."""

from __future__ import annotations

import json
import re
import subprocess
import sys

import pytest

from tests.pages import ROOT

DOCS = ROOT / "docs"


@pytest.mark.slow
def test_the_site_builds_without_a_warning(tmp_path):
    build = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", str(tmp_path / "site")]
    done = subprocess.run(build, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    site = tmp_path / "site"
    assert "duckbill valve vibrates" in (site / "index.html").read_text()
    assert (site / "assets/tex-svg.js").stat().st_size > 1e6
    assert not re.search(r'(src|stylesheet"[^>]*href)="https?://', (site / "theory.html").read_text())  # no network
    assert "54 kg/m³" in (site / "findings.html").read_text()  # written kg/m3
    found = {entry["location"].split("#")[0] for entry in _index(site) if "Hopf" in entry["text"]}
    assert {"stability.html", "glossary.html", "api/continuation.html"} <= found
    for word in ("flutter", "chatter", "Shore", "Floquet"):
        assert any(word in entry["text"] for entry in _index(site)), word


def _index(site):
    return json.loads((site / "search/search_index.json").read_text())["docs"]


def test_links_between_pages_lead_to_files():
    for page in DOCS.rglob("*.md"):
        for link in re.findall(r"\]\(([^)#:\s]+)", page.read_text()):
            made = (page.parent / link).with_suffix(".ipynb")  # notebooks of the gallery are pages
            assert (page.parent / link).exists() or made.exists(), f"{page.name}: {link}"


def test_every_page_is_in_the_contents():
    contents = (ROOT / "mkdocs.yml").read_text()
    pages = [str(page.relative_to(DOCS)) for page in DOCS.rglob("*.md")]
    assert [page for page in pages if f": {page}\n" not in contents] == []


def test_files_that_the_guide_to_the_code_names_are_there():
    named = set(re.findall(r"`([\w/]+/[\w/]+\.py)`", (DOCS / "developing.md").read_text()))
    missing = [name for name in named if not any((ROOT / room / name).exists() for room in ("", "dbvfiv"))]
    assert missing == ["dbvfiv/flow/terms/NAME.py"]  # the reader's own


def test_functions_that_the_guide_to_the_code_names_are_there():
    """Those of `eigen`, by module and name, and rooms of the program, of which every one has a row."""
    text = (DOCS / "developing.md").read_text()
    for module, name in re.findall(r"`(\w+)\.(?!py`)(\w+)`", text):
        if (path := ROOT / f"eigen/{module}.py").exists():
            assert re.search(rf"^(def|class) {name}\b", path.read_text(), re.M), f"{module}.{name}"
    rooms = {path.parent.name for path in (ROOT / "dbvfiv").glob("*/__init__.py")}
    table = text.partition("## Rooms")[2].partition("\n## ")[0]
    assert rooms - {name.rpartition("/")[2] for name in re.findall(r"`([\w/]+)/`", table)} == set()


def test_equations_are_numbered_and_known_to_their_modules():
    """Each number stands at one equation, in the table with its modules, and in their docstrings."""
    text = (DOCS / "theory.md").read_text()
    shown = re.findall(r"\\tag\{(T\.\d+)\}", text)
    assert sorted(shown, key=lambda name: int(name[2:])) == [f"T.{n}" for n in range(1, len(shown) + 1)] and shown
    named: dict[str, set[str]] = {}
    for numbers, modules in re.findall(r"^\| (\(T\.[^|]*) \|[^|]*\| ([^|]*) \|$", text, re.M):
        for module in re.findall(r"`([^`]+)`", modules):
            named.setdefault(module, set()).update(re.findall(r"T\.\d+", numbers))
    assert set().union(*named.values()) == set(shown)
    for package in ("dbvfiv", "eigen", "continuation"):
        for path in (ROOT / package).rglob("*.py"):
            said = set(re.findall(r"\((T\.\d+)\)", path.read_text()))
            assert said == named.get(str(path.relative_to(ROOT)), set()), path
