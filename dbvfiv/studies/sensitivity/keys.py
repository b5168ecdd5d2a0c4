"""The section sensitivity of the case file."""

from __future__ import annotations

from pydantic import StrictInt, StrictStr

from ...case.parameters import listed
from ...case.quantity import Number
from ...case.section import Section, key


class Keys(Section):
    """Derivatives of an eigenvalue by parameters."""

    of: tuple[StrictStr, ...] = key(
        (),
        f"Parameters to differentiate by: {listed()}, or of a layer, counted from 1 inside to outside, such as "
        "'layer 3 angle', 'layer 1 thickness' or 'layer 2 mu_0'; all that the valve has where none is named.",
    )
    mode: StrictInt = key(1, "Number of the mode, by falling growth rate.", ge=1, le=1000)
    step: Number = key(1e-4, "Relative step of the differences.", gt=1e-8, le=1e-2)
