"""Check that a command's options do not fix a parameter that a range of the case varies."""

from __future__ import annotations

from collections.abc import Mapping

from ...case.parameters import PARAMETERS
from ...errors import CaseError


def refuse_moved(ranges: Mapping[str, str], **given: str | None) -> None:
    """Refuse a value for a parameter that a range moves.

    Parameters
    ----------
    ranges : mapping
        From the keys of the case that hold ranges to those.
    given
        Values of parameters as the command line has them; None where there is none.

    Raises
    ------
    CaseError
    """
    for key, text in ranges.items():
        name = text.partition("=")[0].strip()
        if name in PARAMETERS and given.get(name) is not None:
            raise CaseError(
                f"--{name} is given as {given[name]!r}, but {key} = {text!r} moves the {name}; one of them has to go."
            )
