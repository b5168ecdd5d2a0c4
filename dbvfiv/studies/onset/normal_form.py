"""Super- or subcritical: the Hopf normal form of a located onset."""

from __future__ import annotations

import numpy as np

from continuation.normal_form import hopf_normal_form_of

from ...case.parameters import DESIGN, PARAMETERS, Mu
from ...model.forms import ValveForms
from ..case import Case
from ..stability.place import models_of
from ..stability.walk import StabilityWalk


def normal_form(case: Case, walk: StabilityWalk, place: Mu, mode, parameter: str | None = None):
    """Hopf normal form at a located onset, a `continuation.HopfNormalForm`.

    Raises
    ------
    ContinuationError
        If the eigenvalue is not simple.
    """
    mu = place.for_system()
    follows = parameter and not (parameter == "density" and case.gravity.is_there)  # whose levels it would leave out
    name = PARAMETERS[parameter].system_name or None if follows else None
    own = walk.built(place.only(*(name for name in place if name not in DESIGN))).model
    forms = ValveForms(models_of(case, own)(mu), walk.equilibrium(place), mu)
    return hopf_normal_form_of(forms, abs(complex(mode.eigenvalue).imag), np.concatenate([mode.q, mode.u]), name)
