"""Branches of equilibria and orbits of ``B(u, mu) u' = F(u, mu)``, and their bifurcations.

A model fulfils `System` (or is written once as a `JaxSystem`); `continue_branch` follows its
equilibria, finds and locates folds, branch points and Hopf points; `switch_branch`,
`continue_fold`, `continue_hopf` and `orbits_from_hopf` go on from those; `find_orbit` and
`continue_orbits` serve periodic orbits, by harmonic balance.

Examples
--------
>>> import jax.numpy as jnp
>>> from continuation import ContinuationOptions, JaxSystem, continue_branch, continue_hopf
>>> brusselator = JaxSystem(lambda u, mu: jnp.stack([
...     mu["A"] - (mu["B"] + 1) * u[0] + u[0]**2 * u[1], mu["B"] * u[0] - u[0]**2 * u[1]]), 2)
>>> branch = continue_branch(brusselator, [1.0, 1.0], {"A": 1.0, "B": 1.0}, "B",
...     ContinuationOptions(eigenvalues=2, limits={"B": (0.0, 4.0)}))
>>> hopf, = branch.of_kind("hopf")
>>> round(hopf.mu["B"], 9), round(hopf.values["omega"], 9), hopf.values["criticality"]
(2.0, 1.0, 'super')
>>> curve = continue_hopf(brusselator, hopf, ("B", "A"),
...     ContinuationOptions(limits={"A": (0.5, 2.0)}))
>>> bool(abs(curve.values("B") - 1 - curve.values("A")**2).max() < 1e-8)
True
"""

from importlib import import_module

from continuation.branch import Branch, CurvePoint, SpecialPoint
from continuation.branches import continue_branch, resume, switch_branch
from continuation.curves import continue_fold, continue_hopf, resume_curve
from continuation.event_location import Event
from continuation.linear import MatrixLinearisation
from continuation.normal_form import HopfNormalForm, fold_coefficient, hopf_normal_form
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

__all__ = [
    "Branch",
    "Checkpoint",
    "ContinuationError",
    "ContinuationOptions",
    "CurvePoint",
    "DerivativeMissing",
    "Event",
    "HopfNormalForm",
    "JaxSystem",
    "MatrixLinearisation",
    "NewtonOptions",
    "NotABifurcation",
    "NotConverged",
    "Observer",
    "Orbit",
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
    "continue_orbits",
    "equilibrium",
    "find_orbit",
    "fold_coefficient",
    "hopf_normal_form",
    "orbit_at",
    "orbits_from_hopf",
    "resume",
    "resume_curve",
    "resume_orbits",
    "special_orbit",
    "switch_branch",
]

_LATE = {
    "JaxSystem": "continuation.jax_system",
    "Orbit": "continuation.orbits",
    "find_orbit": "continuation.orbits",
    "continue_orbits": "continuation.orbit_branches",
    "orbit_at": "continuation.orbit_branches",
    "orbits_from_hopf": "continuation.orbit_branches",
    "resume_orbits": "continuation.orbit_branches",
    "special_orbit": "continuation.orbit_branches",
}


def __getattr__(name):
    # JAX and compiled kernels take long to import, and not everyone needs them.
    if name in _LATE:
        return getattr(import_module(_LATE[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
