"""Branches of equilibria and orbits of ``B(u, mu) u' = F(u, mu)``, and their bifurcations.

A model is a `System`, or is written once as a `JaxSystem`; `continue_branch` follows its equilibria, finds and locates
folds, branch points and Hopf points; `switch_branch`, `continue_fold`, `continue_hopf` and `orbits_from_hopf` go on
from those; `find_orbit` and `continue_orbits` serve periodic orbits, by harmonic balance.

Examples
--------
A stirred reactor (Uppal, Ray & Poore 1974): conversion x and temperature y over the Damkoehler number D.

>>> import jax.numpy as jnp
>>> from continuation import ContinuationOptions, JaxSystem, continue_branch, continue_hopf, orbit_at, orbits_from_hopf
>>> def reactor(u, mu):
...     x, y = u
...     rate = mu["D"] * (1 - x) * jnp.exp(y)
...     return jnp.stack([-x + rate, -y + 14 * rate - mu["b"] * y])
>>> system = JaxSystem(reactor, size=2)

The branch from no conversion, with both eigenvalues at each point, up to D = 0.2: its folds and its Hopf point.

>>> options = ContinuationOptions(eigenvalues=2, limits={"D": (0.0, 0.2), "b": (1.0, 4.0)})
>>> branch = continue_branch(system, [0.0, 0.0], {"D": 0.0, "b": 2.0}, "D", options)
>>> branch.reason
'ended on the limit D = 0.2'
>>> [(special.kind, round(special.mu["D"], 6)) for special in branch.special]
[('fold', 0.105739), ('fold', 0.088932), ('hopf', 0.1309)]
>>> branch.unstable[0], branch.unstable[-1]
(0, 0)

The orbits born there, and the last of them.

>>> hopf, = branch.of_kind("hopf")
>>> round(hopf.values["omega"], 4), hopf.values["criticality"]
(4.0078, 'super')
>>> orbits = orbits_from_hopf(system, hopf, "D", ContinuationOptions(limits={"D": (0.125, 0.2)}))
>>> orbits.reason, orbits.special
('ended on the limit D = 0.125', [])
>>> orbit = orbit_at(system, orbits, -1)
>>> round(orbit.period, 4), orbit.amplitude().round(4), orbit.stable
(1.8642, array([0.0859, 1.0303]), True)

The Hopf point over a second parameter, the removal of heat.

>>> curve = continue_hopf(system, hopf, ("b", "D"), options)
>>> curve.reason
'ended on the limit D = 0.2'
"""

from importlib import import_module

from continuation.branch import Branch, CurvePoint, SpecialPoint
from continuation.branches import continue_branch, switch_branch
from continuation.curves import continue_fold, continue_hopf
from continuation.event_location import Event
from continuation.linear import MatrixLinearisation
from continuation.normal_form import HopfNormalForm, hopf_normal_form
from continuation.options import (
    ContinuationError,
    ContinuationOptions,
    DerivativeMissing,
    NewtonOptions,
    NotABifurcation,
    NotConverged,
    OrbitOptions,
    OutOfDomain,
    Reason,
    SingularSystem,
)
from continuation.problem import equilibrium
from continuation.spectra import Spectrum
from continuation.system import System
from continuation.tracer import Checkpoint, Observer

#: Names whose modules import JAX or compiled kernels, which takes long and which not everyone needs.
_LATE = {
    "JaxSystem": "continuation.jax_system",
    "Orbit": "continuation.orbit_branches",
    "find_orbit": "continuation.orbit_branches",
    "continue_orbits": "continuation.orbit_branches",
    "orbit_at": "continuation.orbit_branches",
    "orbits_from_hopf": "continuation.orbit_branches",
    "resume": "continuation.orbit_branches",
    "special_orbit": "continuation.orbit_branches",
}

__all__ = [
    "Branch",
    "Checkpoint",
    "ContinuationError",
    "ContinuationOptions",
    "CurvePoint",
    "DerivativeMissing",
    "Event",
    "HopfNormalForm",
    "MatrixLinearisation",
    "NewtonOptions",
    "NotABifurcation",
    "NotConverged",
    "Observer",
    "OrbitOptions",
    "OutOfDomain",
    "Reason",
    "SingularSystem",
    "SpecialPoint",
    "Spectrum",
    "System",
    "continue_branch",
    "continue_fold",
    "continue_hopf",
    "equilibrium",
    "hopf_normal_form",
    "switch_branch",
    *_LATE,
]


def __getattr__(name):
    if name in _LATE:
        return getattr(import_module(_LATE[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
