"""``dbvfiv doctor``: what this machine offers and what is missing."""

from __future__ import annotations

from ._later import action
from ._options import AsJson

ORDER = 90


def command(as_json: AsJson = False) -> None:
    """Say what was found on this machine, what is missing, and the command that mends it."""
    action("doctor").tell(as_json)
