"""Pages of the site that are no files of docs/: the README as its first page, the notebooks of the gallery, the public
names of each package; and what colours code and draws equations without a network.
"""

from __future__ import annotations

import json
import re
import sys
from importlib import import_module
from pathlib import Path

import mathjax
from mkdocs.structure.files import File, Files
from pygments.formatters import HtmlFormatter

ROOT = Path(__file__).resolve().parent.parent
_RAISED = {"2": "²", "3": "³", "4": "⁴", "-": "⁻", "1": "¹"}
MATHJAX = Path(mathjax.__path__[0]) / "static/mathjax/es5/tex-svg.js"


def on_files(files: Files, config) -> Files:
    """Add the README as index.md, a page for each notebook, colours of code, and MathJax."""
    files.append(File.generated(config, "index.md", content=first_page((ROOT / "README.md").read_text())))
    for notebook in sorted((ROOT / "docs/gallery").glob("*.ipynb")):
        files.append(File.generated(config, f"gallery/{notebook.stem}.md", content=notebook_page(notebook)))
    colours = HtmlFormatter(style="friendly").get_style_defs([".codehilite", ".highlight"])
    files.append(File.generated(config, "assets/code.css", content=colours))
    files.append(File.generated(config, "assets/tex-svg.js", abs_src_path=str(MATHJAX)))
    return files


def on_page_markdown(markdown: str, **_) -> str:
    """Replace `<!-- public names of PACKAGE -->` by a block of mkdocstrings for each name of its `__all__`."""
    return re.sub(r"<!-- public names of (\w+) -->", lambda found: public_names(found[1]), markdown)


def on_post_page(output: str, **_) -> str:
    """Typeset a page: powers and units in text, words of code that break where a reader would break them."""
    parts = re.split(
        r"(<pre.*?</pre>|<code.*?</code>|<script.*?</script>|<[^>]*arithmatex.*?</(?:span|div)>|<[^>]*>)",
        output,
        flags=re.S,
    )
    output = "".join(
        _code(part) if part.startswith("<code") else part if part[:1] == "<" else _text(part) for part in parts
    )
    return re.sub(r"\s+–\s*(?:<div class=\"doc-md-description\">\s*</div>\s*)?(?=</li>)", "", output)


def _text(part: str) -> str:
    """kg/m3 and m^2 with powers raised; a value and its per cent sign on one line."""
    part = re.sub(r"\b(c?m|mm|s|ft)([23])\b", lambda found: found[1] + _RAISED[found[2]], part)
    part = re.sub(r"(?<=[\w)])\^(-1|[234])(?![\w.])", lambda found: "".join(_RAISED[c] for c in found[1]), part)
    part = re.sub(r"(?<=[A-Z])\^T\b", "\N{MODIFIER LETTER CAPITAL T}", part)
    return re.sub(r"(?<=\d) (?=%)", "\N{NO-BREAK SPACE}", part)


def _code(part: str) -> str:
    """Code in a line: it may break behind / _ . = and not within an option; shapes as docstrings write them."""
    part = re.sub(r"\(([\w ]+), shape\(((?:<[^>]*>|[^()<])*)\)((?:, \w+)?)\)", r"\1, shape (\2)\3", part)
    pieces = re.split(r"(<[^>]*>)", part)
    for at, piece in enumerate(pieces):
        if piece[:1] != "<":
            piece = re.sub(r"(?<=[\w\]])([/_.=])(?=\w)", r"\1<wbr>", piece)
            pieces[at] = re.sub(r"(?<![\w-])(--?[a-z][a-z-]*)", r'<span class="option">\1</span>', piece)
    return "".join(pieces)


def first_page(text: str) -> str:
    """The README with links that lead from docs/, those to notebooks to their pages."""
    return re.sub(r"(\]\()docs/", r"\1", text).replace(".ipynb)", ".md)")


def notebook_page(path: Path) -> str:
    """Cells of a notebook as a page, each with the text that it gave, and a link to the file itself."""
    page = []
    for cell in json.loads(path.read_text())["cells"]:
        text = "".join(cell["source"])
        page.append(text if cell["cell_type"] == "markdown" else f"```python\n{text}\n```")
        page += [f"```text\n{''.join(output['text'])}```" for output in cell.get("outputs", [])]
    return "\n\n".join([*page, f"The notebook itself: [{path.name}]({path.name})."])


def public_names(package: str) -> str:
    """Directives of mkdocstrings for the public names of a package, each by the module that defines it."""
    sys.path.insert(0, str(ROOT))
    try:
        module = import_module(package)
        objects = {name: getattr(module, name) for name in sorted(module.__all__, key=str.lower)}
    finally:
        sys.path.remove(str(ROOT))
    own = {name for name, one in objects.items() if str(getattr(one, "__module__", "")).startswith(package)}
    paths = [
        f"{one.__module__}.{one.__qualname__}" if name in own else f"{package}.{name}" for name, one in objects.items()
    ]
    return "\n\n".join(f"::: {path}" for path in paths)
