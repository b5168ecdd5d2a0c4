"""Names of files that commands are given."""

from __future__ import annotations

from ...record.files import check_writable

__all__ = ["check_writable"]
