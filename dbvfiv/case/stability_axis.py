"""Ranges of the parameters that stability is asked over: all of the table, each with its usual range."""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, StrictStr

from .axis import Axis, parse_axis
from .parameters import PARAMETERS


def parse_stability_axis(text: str) -> Axis:
    """Read ``PARAMETER=START:STOP:COUNT[:log]``, or a parameter alone with its usual range.

    Raises
    ------
    ValueError
        With a clause that completes "key is given as X, ...".
    """
    if isinstance(text, str) and text.strip() in PARAMETERS:
        text = PARAMETERS[text.strip()].usual_range
    return parse_axis(text, tuple(PARAMETERS))


def _readable(text: str) -> str:
    parse_stability_axis(text)
    return text


#: A key that holds the text of such a range.
StabilityRange = Annotated[StrictStr, AfterValidator(_readable)]
