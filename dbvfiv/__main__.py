"""``dbvfiv`` and ``python -m dbvfiv``."""

from __future__ import annotations

import sys

from .cli import run


def main() -> None:
    """Run the command line and leave with its exit status."""
    sys.exit(run(sys.argv[1:], leaving=True))


if __name__ == "__main__":
    main()
