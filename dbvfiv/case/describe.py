"""Description of the keys: for messages, ``dbvfiv case --explain`` and ``docs/case-reference.md``.

``python -m dbvfiv.studies.case`` prints the page.
"""

from __future__ import annotations

import difflib
import json
import math
import re
import types
import typing
from collections.abc import Iterator
from dataclasses import dataclass, replace
from datetime import date, time
from functools import cache
from pathlib import Path
from typing import Any, Literal

from pydantic import AfterValidator
from pydantic.fields import FieldInfo

from ..errors import CaseError
from .axis import FORM
from .damping import Relaxing
from .materials import KINDS, Materials
from .quantity import A_DIMENSION, DIMENSION, Quantity
from .section import Described, Section, mark_of


@dataclass(frozen=True)
class KeyInfo:
    """One key of the case file, described."""

    key: str  #: Dotted key; ``[]`` stands for an index, ``NAME`` for a free name.
    #: type, unit, allowed and description: words for people; ``unit`` is empty for what has none.
    type: str
    unit: str
    allowed: str
    description: str
    default: Any  #: SI default, None when there is none; ``shown`` is its text in a case file.
    shown: str
    required: bool  #: Whether the key must be given.


def quantity_of(field: FieldInfo) -> Quantity | None:
    """The physical quantity of a scalar field, or of the elements of a list."""
    described = mark_of(field, Described)
    return (described and described.quantity) or mark_of(field, Quantity)


def element_model(annotation: Any) -> type[Section] | None:
    """The section class that a field holds, directly or in a list."""
    if isinstance(annotation, type) and issubclass(annotation, Section):
        return annotation
    if typing.get_origin(annotation) is tuple:
        return element_model(typing.get_args(annotation)[0])
    return None


def _limits(metadata: list[Any]) -> dict[str, Any]:
    names = ("gt", "ge", "lt", "le", "min_length")
    return {n: getattr(m, n) for m in metadata for n in names if getattr(m, n, None) is not None}


def numeric_limits(field: FieldInfo) -> tuple[float, float]:
    """Bounds of a number that a field holds, SI; infinite where it has none."""
    limits = _limits(field.metadata) | _item_limits(field.annotation)
    return limits.get("ge", limits.get("gt", -math.inf)), limits.get("le", limits.get("lt", math.inf))


def _item_limits(annotation: Any) -> dict[str, Any]:
    meta = [m for a in typing.get_args(annotation) for m in getattr(a, "__metadata__", ())]
    flat = [n for m in meta for n in (m.metadata if isinstance(m, FieldInfo) else [m])]
    return _limits(flat)


_BARE = re.compile(r"[A-Za-z0-9_-]+")


def show_value(value: Any, quantity: Quantity | None) -> str:
    """A value as TOML text, with its unit where it has one."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if quantity is not None and isinstance(value, (int, float)):
        value = quantity.show(value)
    if isinstance(value, (int, float)):
        return repr(value)
    if isinstance(value, (tuple, list)):
        return "[" + ", ".join(show_value(v, quantity) for v in value) + "]"
    if isinstance(value, Section):
        fields = type(value).model_fields
        given = {n: f for n, f in fields.items() if getattr(value, n) is not None}
        pairs = (f"{n} = {show_value(getattr(value, n), quantity_of(f))}" for n, f in given.items())
        return "{ " + ", ".join(pairs) + " }"
    if isinstance(value, dict):
        given = ((name, v) for name, v in value.items() if v is not None)
        pairs = ", ".join(f"{toml_name(name)} = {show_value(v, quantity)}" for name, v in given)
        return f"{{ {pairs} }}" if pairs else "{}"
    return str(value) if isinstance(value, (date, time)) else _quoted(str(value))


def toml_name(name: str) -> str:
    """A key or the name of a table as TOML has it."""
    return name if _BARE.fullmatch(name) else _quoted(name)


def _quoted(text: str) -> str:
    """Text as JSON has it, which leaves the one control character that TOML refuses."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _bounds(limits: dict[str, Any], quantity: Quantity | None) -> str:
    def text(value: Any) -> str:
        if quantity is None or quantity.shown == "":
            return f"{value:g}"
        shown = quantity.show(value)
        if not isinstance(shown, str) or abs(float(shown.split()[0])) > 1e4:
            return f"{value:g} {quantity.si}".strip()
        return shown

    low, high = limits.get("ge", limits.get("gt")), limits.get("le", limits.get("lt"))
    words = []
    if low is not None:
        words.append(("at least " if "ge" in limits else "greater than ") + text(low))
    if high is not None:
        words.append(("at most " if "le" in limits else "less than ") + text(high))
    return " and ".join(words)


def _type_words(field: FieldInfo) -> str:
    described, quantity = mark_of(field, Described), quantity_of(field)
    core, many = _strip_none(field.annotation), typing.get_origin(field.annotation) is tuple
    if described:
        return described.type
    if core is dict or typing.get_origin(core) is dict:
        return "tables"
    if element_model(field.annotation):
        return "list of tables" if many else "table"
    if many:
        return f"list of {DIMENSION[quantity.si]}s" if quantity else "list"
    if typing.get_origin(core) is Literal:
        return "choice"
    if quantity:
        return DIMENSION[quantity.si]
    return {bool: "true or false", int: "integer", str: "text", Path: "file"}.get(core, "text")


def _strip_none(annotation: Any) -> Any:
    if typing.get_origin(annotation) in (types.UnionType, typing.Union):
        rest = [a for a in typing.get_args(annotation) if a is not type(None)]
        if len(rest) == 1:
            return getattr(rest[0], "__origin__", rest[0]) if hasattr(rest[0], "__metadata__") else rest[0]
    return annotation


def allowed_words(field: FieldInfo) -> str:
    """Values that a field allows, as words that complete "it must be ..."."""
    described, quantity, kind = mark_of(field, Described), quantity_of(field), _type_words(field)
    some = "at least one" if _limits(field.metadata).get("min_length") else ""
    if described:
        return described.allowed
    if kind == "choice":
        return " or ".join(repr(a).replace("'", '"') for a in typing.get_args(_strip_none(field.annotation)))
    fixed = {
        "table": "a table",
        "tables": "tables",
        "list of tables": f"a list of {some} table" if some else "a list of tables",
        "file": "the name of a file that can be read",
        "true or false": "true or false",
    }
    if kind in fixed:
        return fixed[kind]
    if kind.startswith("list of"):
        noun = DIMENSION[quantity.si]
        each = _bounds(_item_limits(field.annotation), quantity)
        return (f"a list of {some} {noun}" if some else f"a list of {noun}s") + (f", each {each}" if each else "")
    bounds = _bounds(_limits(field.metadata) | _item_limits(field.annotation), quantity)
    if quantity:
        noun = A_DIMENSION[quantity.si] if quantity.si else "a number"
        return f"{noun} {bounds}".strip()
    if kind == "integer":
        return f"an integer {bounds}".strip()
    if _strip_none(field.annotation) is str and mark_of(field, AfterValidator):
        return FORM
    return "a text that is not empty"


def describe_field(key: str, field: FieldInfo) -> KeyInfo:
    """Describe one declared key."""
    required = field.is_required()
    quantity = quantity_of(field)
    default = None if required else field.default
    shown = "" if default is None or default == {} else show_value(default, quantity)
    return KeyInfo(
        key=key,
        type=_type_words(field),
        unit=quantity.si if quantity else "",
        allowed=allowed_words(field),
        description=field.description or "",
        default=default,
        shown=shown,
        required=required,
    )


@cache
def walk(model: type[Section], prefix: str = "") -> tuple[KeyInfo, ...]:
    """Every key that a case file of this model may hold, in order; list elements and material kinds included."""
    return tuple(_walk(model, prefix))


def _walk(model: type[Section], prefix: str) -> Iterator[KeyInfo]:
    for name, field in model.model_fields.items():
        key = f"{prefix}{name}"
        if model is Materials and name == "named":
            for kind, card in KINDS.items():
                yield from walk(card, f"materials.NAME({kind}).")
            continue
        inner = element_model(field.annotation)
        yield describe_field(key, field)
        if inner:
            many = "[]" if typing.get_origin(field.annotation) is tuple else ""
            yield from walk(inner, f"{key}{many}.")


_ANY_KIND = "[materials.NAME] of any kind"

HEAD = """# The case file, key by key

<!-- generated from the field declarations in dbvfiv/case by `make docs`; do not edit -->

A case file is TOML. Quantities are SI numbers or strings with units ("36 kPa", "12 mm", "54 deg", "10 %"); plain
numbers may also be fractions ("3/28"). Pressures are static ones, over that of the surroundings; they may be given as
heads: "2 m" of the fluid of fluid.density, turned into Pa when the case is read, or "2 mH2O" of water. Every key has a
default except those marked *required*; together the defaults are the 12-inch inline valve. Any key can be changed for
one run with `--set KEY=VALUE`, list elements by their index from 0 (`--set layers.2.angle="45 deg"`). A key that is set
so stands in the place of one of the file that says the same, a `drive.head` in that of a `drive.pressure`.

Materials of one's own are tables `[materials.NAME]` of one of the kinds below; the names CR, SBR, EPDM and fibre are
built in and may be replaced the same way.
"""


#: Words of the trade for what a key holds, written as keys, and the key that holds it.
SYNONYMS = {
    "hardness": "materials.NAME(neo-hookean).shear_modulus",
    "durometer": "materials.NAME(neo-hookean).shear_modulus",
    "shore_a": "materials.NAME(neo-hookean).shear_modulus",
    "pipe_length": "upstream.length",
    "pipe": "upstream.length",
    "back_pressure": "closure.rated_pressure",
    "rated_back_pressure": "closure.rated_pressure",
    "backpressure": "closure.rated_pressure",
    "cracking_pressure": "valve.cracking_head",
    "preload": "valve.sealing_pressure",
    "moulded_shut": "valve.sealing_pressure",
    "submerged": "outside.fluid",
    "submergence": "downstream.pressure",
    "tailwater": "downstream.pressure",
    "nominal_size": "valve.scale",
    "bill_length": "valve.duckbill_length",
    "bill_width": "valve.lip_half_width",
    "bill_height": "valve.wall_map",
    "depth": "downstream.pressure",
    "heads": "steady.pressures",
}


def synonym(key: str) -> str | None:
    """Key that a word of the trade stands for, if there is one."""
    return SYNONYMS.get(re.sub(r"[\s-]+", "_", key.strip().lower()).rpartition(".")[2])


def explain(model: type[Section], key: str | None = None) -> list[KeyInfo]:
    """Return the keys of a case that a word stands for: a key, a section, or all of them for None. Raises CaseError for
    a key there is not, naming the nearest.
    """
    infos = walk(model)
    if key is None:
        return list(infos)
    plain = _plain(key)
    found = [i for i in infos if _plain(i.key) == plain] or [i for i in infos if _plain(i.key).endswith("." + plain)]
    if found:
        found += [i for f in list(found) for i in infos if _plain(i.key).startswith(_plain(f.key) + ".")]
    else:
        found = [i for i in infos if _plain(i.key).startswith(plain + ".")]
    found += [i for i in infos if plain == "materials" and i.key.startswith("materials.NAME") and i not in found]
    if not found:
        near = [synonym(key)] if synonym(key) else []
        near += difflib.get_close_matches(plain, [_plain(i.key) for i in infos], n=1, cutoff=0.0)
        shown = " ".join(key.split())[:60]
        raise CaseError(f"{shown!r} is not a key of the case file; the nearest valid key is {near[0]}.", key=key)
    return list({f.key: f for f in found}.values())


@cache
def _plain(key: str) -> str:
    """Drop indices, and write ``materials.NAME(kind)`` as ``materials.kind``."""
    key = re.sub(r"\[\d*\]|\.\d+(?=\.|$)", "", key.strip())
    return re.sub(r"NAME\(([a-z-]+)\)", r"\1", key)


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
