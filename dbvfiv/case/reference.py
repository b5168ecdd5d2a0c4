"""The reference of all keys: for ``dbvfiv case --explain`` and for ``docs/case-reference.md``.

``python -m dbvfiv.studies.case`` prints the page.
"""

from __future__ import annotations

import difflib
import re
from dataclasses import replace

from ..errors import CaseError
from .describe import KeyInfo, walk
from .materials import KINDS
from .relaxing import Relaxing
from .section import Section

_ANY_KIND = "[materials.NAME] of any kind"

HEAD = """# The case file, key by key

<!-- generated from the field declarations in dbvfiv/case by `make docs`; do not edit -->

A case file is TOML. Quantities are SI numbers or strings with units ("36 kPa", "12 mm", "54 deg", "10 %"); plain
numbers may also be fractions ("3/28"). Pressures are static ones, over that of the surroundings; they may be given as
heads: "2 m" of the fluid of fluid.density, turned into Pa when the case is read, or "2 mH2O" of water (in ranges only
so). Every key has a default except those marked *required*; together the defaults are the 12-inch inline valve. Any
key can be changed for one run with `--set KEY=VALUE`, list elements by their index from 0
(`--set layers.2.angle="45 deg"`).

Materials of one's own are tables `[materials.NAME]` of one of the kinds below; the names CR, SBR, EPDM and fibre are
built in and may be replaced the same way.
"""


def explain(model: type[Section], key: str | None = None) -> list[KeyInfo]:
    """Return the keys of a case that a word stands for: a key, a section, or all of them for None.

    Raises
    ------
    CaseError
        For a key there is not, naming the nearest.
    """
    infos = list(walk(model))
    if key is None:
        return infos
    plain = _plain(key)
    found = [i for i in infos if _plain(i.key) == plain] or [i for i in infos if _plain(i.key).endswith("." + plain)]
    if found:
        found += [i for f in list(found) for i in infos if _plain(i.key).startswith(_plain(f.key) + ".")]
    else:
        found = [i for i in infos if _plain(i.key).startswith(plain + ".")]
    found += [i for i in infos if plain == "materials" and i.key.startswith("materials.NAME") and i not in found]
    if not found:
        near = difflib.get_close_matches(plain, [_plain(i.key) for i in infos], n=1, cutoff=0.0)
        shown = " ".join(key.split())[:60]
        raise CaseError(f"{shown!r} is not a key of the case file; the nearest valid key is {near[0]}.", key=key)
    return _unique(found)


def _plain(key: str) -> str:
    """Drop indices, and write ``materials.NAME(kind)`` as ``materials.kind``."""
    key = re.sub(r"\[\d*\]|\.\d+(?=\.|$)", "", key.strip())
    return re.sub(r"NAME\(([a-z-]+)\)", r"\1", key)


def _unique(found: list[KeyInfo]) -> list[KeyInfo]:
    return list({f.key: f for f in found}.values())


def explanation_text(infos: list[KeyInfo]) -> str:
    """Words for the terminal, a paragraph for each key."""
    return "\n\n".join(_paragraph(info) for info in infos)


def _paragraph(info: KeyInfo) -> str:
    lines = [info.key, f"  {info.description}"]
    if info.type not in ("table", "tables"):
        lines.append(f"  must be: {info.allowed}")
        lines.append("  required" if info.required else f"  default: {info.shown or 'none'}")
    return "\n".join(lines)


def page(model: type[Section]) -> str:
    """The whole of ``docs/case-reference.md``."""
    parts, section = [HEAD], None
    for info in _said_once(list(walk(model))):
        here = _section(info)
        if info.type == "table" and "." not in info.key:
            continue
        if here != section:
            section = here
            parts.append(
                f"\n## {here}\n\n{_intro(here, model)}\n\n| key | default | allowed | meaning |\n|---|---|---|---|\n"
            )
        default = "*required*" if info.required else (f"`{info.shown}`" if info.shown else "none")
        if info.type == "list of tables" and "." not in info.key:
            continue
        allowed = info.allowed.replace("|", "\\|")
        parts.append(f"| `{info.key}` | {default} | {allowed} | {info.description} |\n")
    return "".join(parts)


def _said_once(infos: list[KeyInfo]) -> list[KeyInfo]:
    """Keys in order; those that every kind of material has stand once, behind the kinds."""
    common = {info.key.rpartition(".")[2]: info for info in infos if _section(info) == _ANY_KIND}
    own = [info for info in infos if _section(info) != _ANY_KIND]
    behind = 1 + max(i for i, info in enumerate(own) if info.key.startswith("materials."))
    own[behind:behind] = [replace(info, key=f"materials.NAME.{name}") for name, info in common.items()]
    return own


def _section(info: KeyInfo) -> str:
    if info.key.startswith("materials.NAME") and info.key.rpartition(".")[2] in Relaxing.model_fields:
        return _ANY_KIND
    match = re.match(r"materials\.NAME\(([a-z-]+)\)", info.key)
    return f"[materials.NAME] of kind {match[1]}" if match else f"[{re.split(r'[.[]', info.key)[0]}]"


def _intro(section: str, model: type[Section]) -> str:
    if section == _ANY_KIND:
        return (Relaxing.__doc__ or "").split("\n")[0]
    match = re.fullmatch(r"\[materials\.NAME\] of kind (.*)", section)
    if match:
        return (KINDS[match[1]].__doc__ or "").split("\n")[0]
    return model.model_fields[section.strip("[]")].description or ""
