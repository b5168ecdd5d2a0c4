"""From a TOML file and overrides to a validated case of a given model; every failure is one sentence."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, TypeVar

from pydantic import ValidationError

from ..errors import CaseError
from .lines import key_lines
from .message import sentence
from .section import Section

_LARGEST_FILE = 10_000_000
Model = TypeVar("Model", bound=Section)


def read_case_file(model: type[Model], path: str | Path | None = None, overrides: Iterable[str] = ()) -> Model:
    """Read and check a case file.

    Parameters
    ----------
    model : type
        The sections that the file may hold.
    path : path, optional
        TOML file; without it the 12-inch valve of the defaults.
    overrides : iterable of str
        ``"drive.pressure=18 kPa"``; list elements by index from 0, ``"layers.2.angle=45"``.

    Returns
    -------
    Model

    Raises
    ------
    CaseError
        One sentence: which key, in which line, what was given, what is allowed.
    """
    data, text, name, folder = {}, "", "", Path(".")
    if path is not None:
        name, folder = str(path), Path(path).parent
        text = _read(path)
        data = parse_toml(text, name)
    overridden = set()
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
    """Validate plain data as it comes out of a TOML file.

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

    Raises
    ------
    CaseError
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
    """Parse TOML.

    Raises
    ------
    CaseError
        With the line of the slip.
    """
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
    return put(model, data, key.strip(), _value(value.strip()))


def _value(text: str) -> Any:
    """An override's value: TOML where it is TOML, otherwise the text itself (``18 kPa``, ``storage``)."""
    try:
        parsed = tomllib.loads(f"value = {text}")
    except (ValueError, RecursionError):
        return text
    return parsed["value"] if set(parsed) == {"value"} else text


def key_path(dotted: str) -> tuple[str, ...]:
    """The parts of a key as an override writes it."""
    return tuple(part.strip() for part in dotted.strip().split("."))


def put(model: type[Section], data: dict[str, Any], dotted: str, value: Any) -> tuple[str, ...]:
    """Set ``data["a"]["b"] = value`` for ``"a.b"``; lists are entered by index.

    A list that the data does not hold yet starts from its default in the model.

    Raises
    ------
    CaseError
        When a list has no such element, or a value stands where a table is needed.
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
    return [item.model_dump(mode="json") if hasattr(item, "model_dump") else item for item in value]
