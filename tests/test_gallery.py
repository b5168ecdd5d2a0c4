"""Notebooks of the gallery: valid and short, with the texts that their cells gave; a slow test runs each of them.

``python -m tests.test_gallery`` runs them all and stores the texts anew.
"""

from __future__ import annotations

import os
import re
import tempfile
from pathlib import Path

import nbformat
import numpy as np
import pytest
from nbclient import NotebookClient

from tests.pages import ROOT

NOTEBOOKS = sorted((ROOT / "docs/gallery").glob("*.ipynb"))
NUMBER = re.compile(r"[-+]?\d+\.?\d*(?:e[-+]?\d+)?")


def run(path, folder):
    """The notebook run in a folder that has the cases; of its outputs the texts on standard output and the values."""
    (Path(folder) / "cases").symlink_to(ROOT / "cases")
    notebook = nbformat.read(path, 4)
    NotebookClient(notebook, timeout=1800, resources={"metadata": {"path": str(folder)}}).execute()
    notebook.metadata.language_info = {"name": "python"}  # not the Python of this machine
    for cell in notebook.cells:
        if cell.cell_type == "code":
            cell.execution_count = None
            cell.metadata.pop("execution", None)
            kept = [output for output in cell.outputs if output.get("name") != "stderr"]
            cell.outputs = [nbformat.v4.new_output("stream", text=text_of(kept))] if kept else []
    return notebook


def text_of(outputs) -> str:
    """Printed text and value of a cell, without colours and folders of this machine."""
    texts = [output.get("text") or output.get("data", {}).get("text/plain", "") for output in outputs]
    return re.sub(r"PosixPath\('([^']*)'\)", r"'\1'", "\n".join(text.rstrip("\n") for text in texts)) + "\n"


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebooks_are_valid_and_short(path):
    notebook = nbformat.read(path, 4)
    nbformat.validate(notebook)
    code = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert sum(len(cell.source.splitlines()) for cell in code) < 80
    outputs = [output for cell in code for output in cell.outputs]
    assert outputs and all(output.output_type == "stream" and len(output.text) < 1200 for output in outputs)
    assert not any(cell.execution_count for cell in code) and "/tmp" not in path.read_text()
    assert f": gallery/{path.stem}.md\n" in (ROOT / "mkdocs.yml").read_text()


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebooks_run_and_give_what_is_stored(path, tmp_path, monkeypatch):
    """Their own assertions hold the numbers to their digits; what is shown is what comes out, to a thousandth."""
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    for found, stored in zip(run(path, tmp_path).cells, nbformat.read(path, 4).cells, strict=True):
        if found.cell_type == "code":
            now, then = (text_of(cell.outputs) for cell in (found, stored))
            assert NUMBER.sub("#", now) == NUMBER.sub("#", then)
            assert np.allclose(
                *([float(n) for n in NUMBER.findall(text)] for text in (now, then)), rtol=1e-3, atol=1e-9
            )


if __name__ == "__main__":
    os.environ["PYTHONPATH"] = str(ROOT)
    for path in NOTEBOOKS:
        with tempfile.TemporaryDirectory() as folder:
            nbformat.write(run(path, folder), path)
