"""Keys of a case changed from Python: values as they are, of numpy, or texts as after ``--set``."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping
from typing import Any

from ..errors import CaseError
from .model import Case

#: What `dbvfiv.load` and `Valve.replace` take.
Changes = Mapping[str, Any] | Iterable[str] | str

_FORM = """a mapping such as {"drive.pressure": "18 kPa"} or texts such as "drive.pressure=18 kPa\""""


def change_case(case: Case, changes: Changes) -> Case:
    """A case with some keys changed.

    Parameters
    ----------
    case : Case
    changes : mapping, text or iterable of texts
        ``{"drive.pressure": "18 kPa", "mesh.around": 8}``, or ``"drive.pressure=18 kPa"`` as after ``--set``.

    Raises
    ------
    CaseError
        One sentence: which key, what was given, what is allowed.
    """
    wanted = _as_mapping(changes)
    while True:
        try:
            return case.replace(wanted)
        except CaseError as error:
            other = _read(wanted.get(error.key))
            if other is None:
                raise
            try:
                case.replace({error.key: other})
            except CaseError:
                raise error from None
            wanted[error.key] = other


def _as_mapping(changes: Changes) -> dict[str, Any]:
    if isinstance(changes, Mapping):
        pairs = list(changes.items())
    elif isinstance(changes, Iterable):
        pairs = [_pair(text) for text in ([changes] if isinstance(changes, str) else changes)]
    else:
        raise CaseError(f"Changes are given as {changes!r}; they must be {_FORM}.")
    for key, _ in pairs:
        if not isinstance(key, str):
            raise CaseError(f"A key to change is given as {key!r}; it must be a text such as 'drive.pressure'.")
    return {key.strip(): _plain(value) for key, value in pairs}


def _pair(text: Any) -> tuple[str, str]:
    key, equals, value = text.partition("=") if isinstance(text, str) else ("", "", "")
    if not equals or not key.strip():
        raise CaseError(f"A change is given as {text!r}; changes must be {_FORM}.")
    return key.strip(), value.strip()


def _plain(value: Any) -> Any:
    """Numbers and lists of Python for those of numpy."""
    if isinstance(value, (list, tuple)):
        return [_plain(each) for each in value]
    return value.tolist() if hasattr(value, "tolist") else value


def _read(value: Any) -> Any:
    """Value of a text that is TOML, such as "8" or "[1e3, 2e3]"; None for any other text."""
    if not isinstance(value, str):
        return None
    try:
        found = tomllib.loads(f"value = {value}")
    except (ValueError, RecursionError):
        return None
    return found["value"] if set(found) == {"value"} else None
