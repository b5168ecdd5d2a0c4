"""Files that a case names (key points, tension tests): kept in the result, so that the model can be rebuilt without
them.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..case.model import Case
from ..runtime import cache_directory


@dataclass(frozen=True)
class Attachment:
    """A file of a case.

    Attributes
    ----------
    path : str
        As the case names it.
    text : str
        Its contents.
    """

    path: str
    text: str

    def place(self) -> str:
        """Name of a file with these contents: the original one, or a copy in the cache folder."""
        if _text(Path(self.path)) == self.text:
            return self.path
        digest = hashlib.sha256(self.text.encode()).hexdigest()[:16]
        copy = cache_directory() / "attachments" / digest / Path(self.path).name
        if _text(copy) != self.text:
            copy.parent.mkdir(parents=True, exist_ok=True)
            copy.write_text(self.text, encoding="utf-8", newline="")
        return str(copy)


def attachments_of(case: Case) -> tuple[Attachment, ...]:
    """The files that a case names, each once."""
    paths = dict.fromkeys(str(path) for path in _paths(case))
    texts = {path: _text(Path(path)) for path in paths}
    return tuple(Attachment(path, text) for path, text in texts.items() if text is not None)


def placed(data: Any, attachments: tuple[Attachment, ...]) -> Any:
    """Plain data of a case with the names of its files replaced by names of files that exist."""
    if isinstance(data, dict):
        return {name: placed(value, attachments) for name, value in data.items()}
    if isinstance(data, list):
        return [placed(value, attachments) for value in data]
    return next((a.place() for a in attachments if a.path == data), data) if isinstance(data, str) else data


def _paths(value: Any) -> Iterator[Path]:
    if isinstance(value, Path):
        yield value
    elif hasattr(type(value), "model_fields"):
        for name in type(value).model_fields:
            yield from _paths(getattr(value, name))
    elif isinstance(value, dict):
        for item in value.values():
            yield from _paths(item)
    elif isinstance(value, (list, tuple)):
        for item in value:
            yield from _paths(item)


def _text(path: Path) -> str | None:
    try:
        return path.read_bytes().decode("utf-8")
    except (OSError, UnicodeDecodeError):
        return None
