"""Parameters of stability studies: besides load, fluid and damping the blend of the continuity laws and the design."""

from __future__ import annotations

from .axis import PARAMETERS, Axis, parse_axis
from .quantity import Quantity

STABILITY_PARAMETERS = PARAMETERS | {
    "storage": Quantity(""),
    "thickness": Quantity(""),
    "angle": Quantity("deg", "deg"),
    "strain": Quantity("", "%"),
}
#: Values that make sense, both ends included.
LIMITS = {"storage": (0.0, 1.0), "thickness": (0.05, 10.0), "angle": (0.0, 90.0), "strain": (0.1, 0.6)}
#: Where onset is looked for when only the parameter is named.
USUAL = {
    "pressure": "pressure=300:36000:61:log",
    "density": "density=0.5:2000:61:log",
    "alpha": "alpha=0:40:41",
    "beta": "beta=0.0002:0.02:61:log",
    "storage": "storage=0:1:21",
    "thickness": "thickness=0.6:1.4:17",
    "angle": "angle=20:80:25",
    "strain": "strain=0.1:0.6:21",
}


def parse_stability_axis(text: str) -> Axis:
    """Read ``PARAMETER=START:STOP:COUNT[:log]``, or a parameter alone with its usual range.

    Raises
    ------
    ValueError
        With a clause that completes "key is given as X, ...".
    """
    if isinstance(text, str) and text.strip() in USUAL:
        text = USUAL[text.strip()]
    axis = parse_axis(text, STABILITY_PARAMETERS)
    low, high = LIMITS.get(axis.parameter, (0.0, float("inf")))
    if axis.values[0] < low or axis.values[-1] > high:
        raise ValueError(f"whose range is not within {low:g} to {high:g}")
    return axis
