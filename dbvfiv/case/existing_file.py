"""Files that a case names: relative to it, and there."""

from __future__ import annotations

from pathlib import Path

from pydantic import ValidationInfo


def existing_file(path: Path, info: ValidationInfo) -> Path:
    """Full name of a file that a key names; as it is where files are not to be looked for.

    Raises
    ------
    ValueError
        With a clause that completes "key is given as FILE, ...".
    """
    context = info.context or {}
    if not context.get("check_files", True):
        return path
    path = Path(context.get("folder", ".")) / path
    try:
        found = path.is_file()
    except (OSError, ValueError):  # a name too long, or with a null byte in it
        found = False
    if not found:
        raise ValueError("which does not exist" if not str(path).endswith("/") else "which is not a file")
    return path.resolve()
