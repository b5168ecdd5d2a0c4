"""Equations of docstrings for the site: `.. math::` and `:math:` become what the pages write, $$ and $."""

from __future__ import annotations

import re
from textwrap import dedent

from griffe import Extension


class DocstringMath(Extension):
    """Rewrites the equations of every docstring before it is parsed."""

    def on_object(self, *, obj, **_) -> None:
        """Rewrite the docstring of an object that has one."""
        if obj.docstring:
            obj.docstring.value = with_dollars(obj.docstring.value)


def with_dollars(text: str) -> str:
    """A docstring with its equations between dollars."""
    text = re.sub(r":math:`([^`]+)`", r"$\1$", text)
    return re.sub(r"^( *)\.\. math::[ ]*(.*(?:\n(?:\1[ ]+\S.*|[ ]*$))*)", _block, text, flags=re.M)


def _block(found: re.Match) -> str:
    lines = dedent(found[2]).strip()
    if r"\\" in lines or "&" in lines:
        lines = r"\begin{aligned}" + lines + r"\end{aligned}"
    body = " ".join(line.strip() for line in lines.splitlines() if line.strip())
    return f"{found[1]}$${body}$$\n\n"
