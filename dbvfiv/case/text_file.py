"""Text files that keys of a case name."""

from __future__ import annotations

from pathlib import Path


def read_text_file(path: Path, encoding: str | None = "utf-8-sig") -> str:
    """Text of a file; in UTF-8, without the mark that some programs put in front, unless told otherwise.

    Raises
    ------
    ValueError
        With a clause that completes "KEY is given as FILE, ...".
    """
    try:
        return Path(path).read_text(encoding=encoding)
    except (FileNotFoundError, NotADirectoryError):
        raise ValueError("which does not exist") from None
    except UnicodeDecodeError:
        raise ValueError("which is not a text file") from None
    except (OSError, ValueError) as error:
        raise ValueError(f"which cannot be read ({getattr(error, 'strerror', None) or 'bad name'})") from None
