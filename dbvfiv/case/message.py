"""One sentence for whatever is wrong with a case: where, which key, what was given, what is allowed."""

from __future__ import annotations

import difflib
import re
import typing
from typing import Any

from pydantic import ValidationError

from ..errors import CaseError
from .describe import allowed_words, element_model
from .lines import line_of
from .materials import KINDS, Materials
from .section import BrokenRule, Section

Path = tuple[str, ...]
_BARE_KEY = re.compile(r"[A-Za-z0-9_-]{1,60}")


def sentence(
    error: ValidationError,
    model: type[Section],
    source: str,
    lines: dict[Path, int],
    overridden: tuple[Path, ...],
) -> CaseError:
    """Turn a validation error of a case of the given model into a ``CaseError``.

    An unknown key goes first: what else is wrong often follows from it.
    """
    problems = error.errors(include_url=False)
    problem = next((p for p in problems if p["type"] == "extra_forbidden"), problems[0])
    path, owner, field = _resolve(problem["loc"], model)
    cause = (problem.get("ctx") or {}).get("error")
    if isinstance(cause, BrokenRule):
        path += tuple(cause.key.split("."))
        body = f"{_dotted(path)} is {cause.given}; {cause.allowed}."
    elif problem["type"] == "extra_forbidden":
        body = _unknown(path, owner, model)
    elif problem["type"] == "missing":
        body = (
            f"{_dotted(path)} is missing; it must be {allowed_words(field)}."
            if field
            else f"{_dotted(path)} is missing."
        )
    elif problem["type"] in ("union_tag_invalid", "union_tag_not_found"):
        given = problem["input"].get("kind") if isinstance(problem["input"], dict) else None
        path += ("kind",)
        is_given = "is missing" if given is None else f"is given as {_show(given)}"
        body = f"{_dotted(path)} {is_given}; it must be one of {', '.join(KINDS)}."
    else:
        reason = f", {cause}" if isinstance(cause, ValueError) else ""
        allowed = allowed_words(field) if field is not None else "a table of the case"
        body = f"{_dotted(path)} is given as {_show(problem['input'])}{reason}; it must be {allowed}."
    line = line_of(path, lines)
    if any(path[: len(o)] == o or o[: len(path)] == path for o in overridden):
        line, where = None, "In an override, "
    elif source and line:
        where = f"{source}, line {line}: "
    else:
        where = f"{source}: " if source else ""
    return CaseError(where + body, key=_dotted(path), line=line)


def _resolve(loc: tuple[Any, ...], case: type[Section]) -> tuple[Path, type[Section] | None, Any]:
    """Key path as a user writes it, the section it is in, and its field if it has one."""
    path: Path = ()
    model: type[Section] | None = case
    owner, field, in_named = model, None, False
    for part in loc:
        if in_named and isinstance(part, str) and model is None and part in KINDS and len(path) >= 2:
            model, in_named = KINDS[part], False
            continue
        if model is Materials and part == "named":
            model, in_named, field = None, True, None
            continue
        path += (str(part),)
        if isinstance(part, int):  # an element of a list: keep the list's own field
            continue
        owner, field = model, None
        if model is not None:
            field = model.model_fields.get(part)
            model = element_model(field.annotation) if field is not None else None
    return path, owner, field


def _dotted(path: Path) -> str:
    """The key as TOML would write it; what is no bare key is quoted."""
    return ".".join(p if _BARE_KEY.fullmatch(p) else f'"{_clean(p, quoted=True)}"' for p in path)


def _unknown(path: Path, owner: type[Section] | None, model: type[Section]) -> str:
    key = path[-1]
    names = [n for n in (owner.model_fields if owner else {}) if n != "named"]
    if owner is Materials:
        names += ["NAME"]
    place = ".".join(path[:-1])
    close = difflib.get_close_matches(key.lower(), names, n=1, cutoff=0.6)
    nearest = _elsewhere(key, model) or (".".join(filter(None, (place, close[0]))) if close else None)
    if nearest:
        hint = f"the nearest valid key is {nearest}"
    else:
        hint = f"{_dotted(path[:-1]) or 'a case'} may hold {', '.join(names)}"
    return f"{_dotted(path)} is not a key of the case file; {hint}."


def _elsewhere(key: str, case: type[Section]) -> str | None:
    """The key's namesake in another section, for keys put in the wrong table."""
    for section, field in case.model_fields.items():
        model = element_model(field.annotation)
        if model and key in model.model_fields and typing.get_origin(field.annotation) is not tuple:
            return f"{section}.{key}"
    return None


def _show(value: Any) -> str:
    """Given value, short and on one line, for an error message."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, dict):
        return "a table"
    if isinstance(value, (list, tuple)):
        return f"a list of {len(value)}" if value else "an empty list"
    if isinstance(value, int) and abs(value) >= 10**15:
        return "a very large integer"
    text = f'"{_clean(value, quoted=True)}"' if isinstance(value, str) else _clean(str(value), quoted=True)
    return text


def _clean(text: str, quoted: bool = False) -> str:
    """Printable, short, and without a full stop that would look like the end of the sentence."""
    text = "".join(c if c.isprintable() else " " for c in str(text))
    text = " ".join(text.split()).replace(". ", "., ") if quoted else " ".join(text.split())
    return text if len(text) <= 60 else text[:57] + "..."
