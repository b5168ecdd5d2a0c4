"""Pages of the site that are no files of docs/: the README as its first page, with its links seen from there."""

from __future__ import annotations

import re
from pathlib import Path

from mkdocs.structure.files import File, Files

ROOT = Path(__file__).resolve().parent.parent


def on_files(files: Files, config) -> Files:
    """Add the README as index.md."""
    files.append(File.generated(config, "index.md", content=first_page((ROOT / "README.md").read_text())))
    return files


def first_page(text: str) -> str:
    """The README with links that lead from docs/."""
    return re.sub(r"(\]\()docs/", r"\1", text)
