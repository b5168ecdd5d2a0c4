"""The program in a process of its own."""

from __future__ import annotations

import subprocess
import sys
from typing import Any

#: Ctrl-C is heard also where whoever runs the tests ignores it, as shells let their background jobs do.
_START = (
    "import signal, sys; signal.signal(signal.SIGINT, signal.default_int_handler);"
    "signal.signal(signal.SIGTERM, signal.SIG_DFL);"
    "from dbvfiv.__main__ import main; main()"
)


def start(*arguments: object, **options: Any) -> subprocess.Popen:
    """Start ``dbvfiv`` with its streams as pipes of text."""
    return subprocess.Popen(
        [sys.executable, "-c", _START, *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        **options,
    )
