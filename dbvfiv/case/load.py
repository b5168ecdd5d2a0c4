"""Validated case from a TOML file and overrides; a failure is one sentence: where, which key, what was given, what is
allowed.

The standard parser gives no positions. This scan knows table headers, keys at
the beginning of a line and multi-line strings, which is all that an error
message needs; inside inline values it points to the line the value begins on.
"""

from __future__ import annotations

import difflib
import re
import tomllib
import typing
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, TypeVar

from pydantic import ValidationError
from pydantic.fields import FieldInfo

from ..errors import CaseError
from ..texts import clause
from .describe import allowed_words, element_model, quantity_of, synonym
from .materials import KINDS, Materials
from .section import BrokenRule, Section

_PART = r"""(?:[A-Za-z0-9_-]+|"[^"\n]*"|'[^'\n]*')"""
_DOTTED = rf"{_PART}(?:\s*\.\s*{_PART})*"
_HEADER = re.compile(rf"\s*(\[\[?)\s*({_DOTTED})\s*\]")
_KEY = re.compile(rf"\s*({_DOTTED})\s*=(.*)")


def _split(dotted: str) -> tuple[str, ...]:
    return tuple(part.strip().strip("\"'") for part in re.findall(_PART, dotted))


def key_lines(text: str) -> dict[tuple[str, ...], int]:
    """Map every key path of a TOML text to its line, counted from 1.

    Elements of arrays of tables carry their index: ``("layers", "0", "angle")``.
    """
    lines: dict[tuple[str, ...], int] = {}
    counts: dict[tuple[str, ...], int] = {}
    table: tuple[str, ...] = ()
    quote = None
    for number, line in enumerate(text.splitlines(), 1):
        if quote:
            if quote in line:
                quote = None
            continue
        header = _HEADER.match(line)
        if header:
            table = _indexed(_split(header[2]), counts)
            if header[1] == "[[":
                index = counts.get(table, -1) + 1
                counts[table] = index
                table += (str(index),)
            _note(lines, table, number)
            continue
        entry = _KEY.match(line)
        if entry:
            _note(lines, table + _split(entry[1]), number)
            quote = next((q for q in ('"""', "'''") if entry[2].count(q) % 2), None)
    return lines


def _indexed(path: tuple[str, ...], counts: dict[tuple[str, ...], int]) -> tuple[str, ...]:
    """Put the current index behind every parent that is an array of tables."""
    full: tuple[str, ...] = ()
    for i, part in enumerate(path):
        full += (part,)
        if full in counts and i < len(path) - 1:
            full += (str(counts[full]),)
    return full


def _note(lines: dict[tuple[str, ...], int], path: tuple[str, ...], number: int) -> None:
    for end in range(1, len(path) + 1):
        lines.setdefault(path[:end], number)


def line_of(path: tuple[str, ...], lines: dict[tuple[str, ...], int]) -> int | None:
    """Line of a key, or of the nearest table that holds it."""
    for end in range(len(path), 0, -1):
        if path[:end] in lines:
            return lines[path[:end]]
    return None


KeyPath = tuple[str, ...]
_BARE_KEY = re.compile(r"[A-Za-z0-9_-]{1,60}")


def sentence(
    error: ValidationError,
    model: type[Section],
    source: str,
    lines: dict[KeyPath, int],
    overridden: tuple[KeyPath, ...],
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
        given = _with_unit(problem["input"], field) if problem["type"] in _OUT_OF_BOUNDS else problem["input"]
        body = f"{_dotted(path)} is given as {_show(given)}{reason}; it must be {allowed}."
    line = line_of(path, lines)
    if any(path[: len(o)] == o or o[: len(path)] == path for o in overridden):
        line, where = None, "In an override, "
    elif source and line:
        where = f"{source}, line {line}: "
    else:
        where = f"{source}: " if source else ""
    return CaseError(where + body, key=_dotted(path), line=line)


def _resolve(loc: tuple[Any, ...], case: type[Section]) -> tuple[KeyPath, type[Section] | None, Any]:
    """Key path as a user writes it, the section it is in, and its field if it has one."""
    path: KeyPath = ()
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
        if isinstance(part, int) or (model is None and isinstance(field, FieldInfo)):
            continue  # an element of a list, or an entry of a mapping of the user's own names: keep its own field
        owner, field = model, None
        if model is not None:
            field = model.model_fields.get(part)
            model = element_model(field.annotation) if field is not None else None
    return path, owner, field


def _dotted(path: KeyPath) -> str:
    """The key as TOML would write it; what is no bare key is quoted."""
    return ".".join(p if _BARE_KEY.fullmatch(p) else f'"{_clean(p)}"' for p in path)


def _unknown(path: KeyPath, owner: type[Section] | None, model: type[Section]) -> str:
    key = path[-1]
    names = [n for n in (owner.model_fields if owner else {}) if n != "named"]
    if owner is Materials:
        names += ["NAME"]
    place = ".".join(path[:-1])
    close = difflib.get_close_matches(key.lower(), names, n=1, cutoff=0.6)
    nearest = synonym(key) or _elsewhere(key, model) or (".".join(filter(None, (place, close[0]))) if close else None)
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


#: Kinds of error of a number that was read, SI, and is too small or too large.
_OUT_OF_BOUNDS = ("greater_than", "greater_than_equal", "less_than", "less_than_equal")


def _with_unit(value: Any, field: Any) -> Any:
    """A number, SI, in the unit of its field; a text as it is, and a number too large for one."""
    is_plain = isinstance(value, float) and abs(value) < 1e15
    quantity = quantity_of(field) if field is not None and is_plain else None
    return value if quantity is None else quantity.show(value)


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
    return f'"{_clean(value)}"' if isinstance(value, str) else _clean(str(value))


def _clean(text: str) -> str:
    """A clause that is short."""
    text = clause(text)
    return text if len(text) <= 60 else text[:57] + "..."


_LARGEST_FILE = 10_000_000
Model = TypeVar("Model", bound=Section)


#: Changes of keys: texts as after ``--set``, or values by keys.
Overrides = Iterable[str] | Mapping[str, Any]


def read_case_file(model: type[Model], path: str | Path | None = None, overrides: Overrides = ()) -> Model:
    """Read and check a case file. Raises CaseError: one sentence: which key, in which line, what was given, what is
    allowed.

    Parameters
    ----------
    model : type
        The sections that the file may hold.
    path : path, optional
        TOML file; without it the 12-inch valve of the defaults.
    overrides : iterable of str, or mapping
        ``"drive.pressure=18 kPa"``; list elements by index from 0, ``"layers.2.angle=45"``.

    Returns
    -------
    Model
    """
    data, text, name, folder = {}, "", "", Path(".")
    if path is not None:
        name, folder = str(path), Path(path).parent
        text = _read(path)
        data = parse_toml(text, name)
    overridden = set()
    if isinstance(overrides, Mapping):
        overridden |= {put(model, data, dotted, plain(value)) for dotted, value in overrides.items()}
        overrides = ()
    for override in overrides:
        overridden.add(_apply(model, data, override))
    model.make_way(data, overridden)
    return make_case(model, data, folder=folder, source=name, text=text, overridden=overridden)


def make_case(
    model: type[Model],
    data: Mapping[str, Any],
    *,
    folder: Path = Path("."),
    source: str = "",
    text: str = "",
    overridden: Iterable[tuple[str, ...]] = (),
    check_files: bool = True,
) -> Model:
    """Validate plain data as it comes out of a TOML file. Raises CaseError.

    Parameters
    ----------
    model : type
        The sections that a case may hold.
    data : mapping
        Sections by name.
    folder : Path
        Where relative file names start.
    source, text : str
        Name and text of the file, for messages with line numbers.
    overridden : iterable of tuple of str
        Key paths that did not come from the file.
    check_files : bool
        Whether the files that the case names must exist.
    """
    context = {"folder": folder, "check_files": check_files}
    try:
        return model.model_validate(dict(data), context=context)
    except ValidationError as error:
        raise sentence(error, model, source, key_lines(text), tuple(overridden)) from None
    except RecursionError:
        raise CaseError(f"{source or 'The case'} is nested too deeply to be a case.") from None


def _read(path: str | Path) -> str:
    path = Path(path)
    try:
        if path.is_dir():
            raise CaseError(f"{str(path)!r} is a folder and not a case file.")
        if path.stat().st_size > _LARGEST_FILE:
            raise CaseError(f"{str(path)!r} is larger than 10 MB, which no case file is.")
        return path.read_bytes().decode("utf-8-sig")
    except FileNotFoundError:
        raise CaseError(f"The case file {str(path)!r} does not exist.") from None
    except UnicodeDecodeError:
        raise CaseError(f"{str(path)!r} is not a case file, because it is not UTF-8 text.") from None
    except CaseError:
        raise
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "its name is not valid"
        raise CaseError(f"The case file {str(path)!r} cannot be read ({reason}).") from None


def parse_toml(text: str, name: str = "") -> dict[str, Any]:
    """Parse TOML. Raises CaseError with the line of the slip."""
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # over-long integers come as plain ValueError
        place = re.search(r"\(at line (\d+), column \d+\)", str(error))
        reason = re.sub(r"\s*\(at [^)]*\)\s*$", "", str(error)).rstrip(".") or "nested too deeply"
        line = int(place[1]) if place else None
        if "at end of document" in str(error):
            line = max(1, len(text.splitlines()))
        where = f"{name}, line {line}" if line else (name or "The text")
        raise CaseError(f"{where} is not valid TOML: {reason}.", line=line) from None


def _apply(model: type[Section], data: dict[str, Any], override: str) -> tuple[str, ...]:
    key, equals, value = override.partition("=")
    if not equals or not key.strip():
        raise CaseError(f'The override {override!r} is not of the form KEY=VALUE, such as drive.pressure="18 kPa".')
    return put(model, data, key.strip(), toml_value(value.strip()))


def toml_value(text: str) -> Any:
    """Value of a text that is TOML, such as "8" or "[1e3, 2e3]"; any other text as it is (``18 kPa``, ``storage``), and
    a list of such texts (``[1 m, 2 m]``) as a list.
    """
    try:
        parsed = tomllib.loads(f"value = {text}")
    except (ValueError, RecursionError):
        if re.fullmatch(r"\s*[+-]?(\d+\.|\.\d+)\s*", text):  # numbers anywhere but in TOML
            return float(text)
        plain = re.fullmatch(r"\s*\[([^][{}\"'=]*)\]\s*", text)
        return [part.strip() for part in plain[1].split(",")] if plain else text
    return parsed["value"] if set(parsed) == {"value"} else text


def key_path(dotted: str) -> tuple[str, ...]:
    """The parts of a key as an override writes it; one with a dot in it stands in quotes."""
    return _split(dotted) if {*dotted} & {*"'\""} else tuple(part.strip() for part in dotted.split("."))


def plain(value: Any) -> Any:
    """Numbers and lists of Python for those of numpy."""
    if isinstance(value, Mapping):
        return {name: plain(each) for name, each in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(each) for each in value]
    return value.tolist() if hasattr(value, "tolist") else value


def held(data: Any, dotted: str) -> Any:
    """Value of plain data under a key; None where that is no key of tables and lists in tables."""
    for part in key_path(dotted):
        if isinstance(data, list):
            data = data[int(part)] if part.isdecimal() and int(part) < len(data) else None
        else:
            data = data.get(part) if isinstance(data, Mapping) else None
    return data


def put(model: type[Section], data: dict[str, Any], dotted: str, value: Any) -> tuple[str, ...]:
    """Set ``data["a"]["b"] = value`` for ``"a.b"``; lists are entered by index. Raises CaseError when a list has no
    such element, or a value stands where a table is needed.

    A list that the data does not hold yet starts from its default in the model.
    """
    path = key_path(dotted)
    target: Any = data
    for depth, part in enumerate(path):
        here = ".".join(path[: depth + 1])
        last = depth == len(path) - 1
        if isinstance(target, list):
            if not (part.isascii() and part.isdigit() and len(part) < 6 and int(part) < len(target)):
                raise CaseError(
                    f"{dotted} names no element of {'.'.join(path[:depth])}; "
                    f"the index must be between 0 and {len(target) - 1}.",
                    key=dotted,
                )
            part = int(part)
        elif not isinstance(target, dict):
            raise CaseError(f"{here} does not exist, because {'.'.join(path[:depth])} is not a table.", key=dotted)
        elif not last and part not in target:
            target[part] = _default(model, path[: depth + 1])
        if last:
            target[part] = value
        else:
            target = target[part]
    return path


def _default(model: type[Section], path: tuple[str, ...]) -> Any:
    """The default of a list (so that an element can be changed), an empty table otherwise."""
    value: Any = model()
    for part in path:
        value = getattr(value, part, None) if part in getattr(type(value), "model_fields", {}) else None
    if not isinstance(value, tuple):
        return {}
    return [item.model_dump(mode="json", exclude_none=True) if hasattr(item, "model_dump") else item for item in value]
