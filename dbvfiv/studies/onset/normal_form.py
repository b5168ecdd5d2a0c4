"""Super- or subcritical: the Hopf normal form of a located onset."""

from __future__ import annotations

import numpy as np

from continuation.normal_form import hopf_normal_form, hopf_normal_form_of

from ...case.parameters import DESIGN, PARAMETERS, Mu
from ...model.memory_forms import ValveMemoryForms
from ...model.system import ValveSystem
from ..case import Case
from ..stability.place import rebuilder
from ..stability.walk import StabilityWalk


def system_of(case: Case, walk: StabilityWalk, place: Mu) -> ValveSystem:
    """The valve as a System of `continuation` at a place."""
    model = walk.built(place.only(*(name for name in place if name not in DESIGN))).model
    return ValveSystem(model, rebuilder(case), walk.search(place).options)


def normal_form(case: Case, walk: StabilityWalk, place: Mu, mode, parameter: str | None = None):
    """Hopf normal form at a located onset, a `continuation.HopfNormalForm`.

    Raises
    ------
    ContinuationError
        If the eigenvalue is not simple.
    """
    mu = place.for_system()
    omega = abs(complex(mode.eigenvalue).imag)
    follows = parameter and not (parameter == "density" and case.gravity.is_there)  # whose levels it would leave out
    name = PARAMETERS[parameter].system_name or None if follows else None
    system = system_of(case, walk, place)
    model = system.model(mu)
    if place.loss_factor and model.relaxation.groups:
        forms = ValveMemoryForms(model, walk.equilibrium(place), mu)
        return hopf_normal_form_of(forms, omega, np.concatenate([mode.q, mode.u]), name)
    u = system.state(walk.equilibrium(place), mu)
    vector = np.concatenate([mode.q, 1j * omega * mode.q, mode.u])
    return hopf_normal_form(system, u, mu, omega, vector, name)
