"""A case as TOML text, with or without comments; reading it back gives the same case."""

from __future__ import annotations

import textwrap
import typing
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from .. import __version__
from .describe import allowed_words, element_model, quantity_of, show_value, toml_name
from .materials import Materials
from .section import Section

_WIDTH = 110

HEAD = """# A case of dbvfiv: a duckbill valve, its material, the fluid and the load.
#
# Quantities are SI numbers or strings with units: 18e3 or "18 kPa", 0.012 or "12 mm", "54 deg", "10 %".
{}
# `dbvfiv case FILE` checks the file, `dbvfiv case --explain KEY` explains a key.
"""

OWN_MATERIAL = """
# Further materials, or replacements of CR, SBR, EPDM and fibre, are tables [materials.NAME], for instance (a table of
# CR, SBR, EPDM or fibre that holds loss_factor alone leaves the material as it is)
#
# [materials.silicone]
# kind = "mooney-rivlin"  # also yeoh, softening, ogden, neo-hookean, isotropic, orthotropic, halpin-tsai, fit, shipped
# c10 = "0.3 MPa"
# c01 = "0.1 MPa"
# density = "1150 kg/m^3"
# loss_factor = 0.1          # or loss_data, relaxation_data, prony; for damping.model = "loss factor"
"""


def case_toml(case: Section, comments: bool = True, about: str = "") -> str:
    """Return the case as TOML.

    Parameters
    ----------
    case : Section
        Of any model: every section that it has is written.
    comments : bool
        Put description and allowed values above each key.
    about : str
        Sentence for the head of a text with comments.
    """
    said = "\n".join(_commented(f"{_defaults_said(case)} {about}"))
    parts = [HEAD.format(said)] if comments else [f"# dbvfiv {__version__}: every key of this case"]
    for name, field in type(case).model_fields.items():
        value = getattr(case, name)
        if name == "drive" and getattr(case, "seeks_operating_point", False):
            value = value.model_copy(update={"pressure": None})  # it is where valve and pump meet
        if comments:
            parts.append(f"\n# ---- {field.description}")
        if isinstance(value, tuple):
            parts.extend(_tables(name, value, comments))
            continue
        parts.append(f"[{name}]" if comments else f"\n[{name}]")
        parts.extend(_keys(value, comments))
        if isinstance(value, Materials):
            for own, card in value.named.items():
                parts.append(f"\n[materials.{toml_name(own)}]")
                parts.extend(_keys(card, comments))
            if comments:
                parts.append(OWN_MATERIAL.rstrip("\n"))
    return "\n".join(parts) + "\n"


def write_case(case: Section, path: Path) -> None:
    """Write a case without comments into a file, whose folder is made where there is none."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(case_toml(case, comments=False) + "\n", encoding="utf-8")


def _defaults_said(case: Section) -> str:
    """Sentence on the keys of a case that are not at their defaults."""
    usual = type(case)()
    others = [
        f"{name}.{key}" if isinstance(section, Section) else name
        for name, section in case
        for key in (type(section).model_fields if isinstance(section, Section) else [""])
        if _differs(section, getattr(usual, name), key)
    ]
    but_for = f", but for {', '.join(others)}" if others else ""
    return (
        "Every key is optional; delete what you do not change. All have their defaults here, the 12-inch inline valve"
        f"{but_for}."
    )


def _differs(section: Any, usual: Any, key: str) -> bool:
    """True where a key of a section, or a list in its place, differs from its usual value."""
    if not key:
        return section != usual
    return key not in getattr(section, "following", ()) and getattr(section, key) != getattr(usual, key)


def _tables(name: str, items: tuple[Section, ...], comments: bool) -> Iterator[str]:
    """An array of tables; the keys are explained at its first element only."""
    for i, item in enumerate(items):
        yield f"[[{name}]]" if comments and i == 0 else f"\n[[{name}]]"
        yield from _keys(item, comments and i == 0)


def _keys(section: Section, comments: bool) -> Iterator[str]:
    given = getattr(section, "as_given", section)
    for name, field in type(section).model_fields.items():
        if name == "named" and isinstance(section, Materials):
            continue
        value = getattr(given, name)
        if comments:
            yield from _comment(field)
        follows = name in getattr(section, "following", ())
        if value is None or (follows and name == getattr(section, "meaningless", None)):
            if comments:
                yield f'# {name} = "..."'
            continue
        mark = "# " if follows or (name in section.told_by_giving and name not in section.model_fields_set) else ""
        yield f"{mark}{name} = {_value(value, field)}"


def _comment(field: Any) -> Iterator[str]:
    words = field.description or ""
    if element_model(field.annotation) is None:
        words = f"{words} [{allowed_words(field)}]"
    elif typing.get_origin(field.annotation) is tuple and not field.is_required() and not field.default:
        words = f"{words} Each is a table of {', '.join(element_model(field.annotation).model_fields)}."
    yield from _commented(words)


def _commented(words: str) -> Iterator[str]:
    """Lines of a comment."""
    for line in textwrap.wrap(words, _WIDTH - 2):
        yield f"# {line}"


def _value(value: Any, field: Any) -> str:
    if value and typing.get_origin(field.annotation) is tuple and element_model(field.annotation):
        rows = "".join(f"    {show_value(item, None)},\n" for item in value)
        return f"[\n{rows}]"
    return show_value(value, quantity_of(field))
