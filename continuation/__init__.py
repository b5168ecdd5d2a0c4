"""Branches of equilibria and orbits of ``B(u, mu) u' = F(u, mu)``, and their bifurcations."""

from continuation.branch import Branch, CurvePoint, SpecialPoint
from continuation.branches import continue_branch, resume, switch_branch
from continuation.curves import continue_fold, continue_hopf, resume_curve
from continuation.errors import (
    ContinuationError,
    DerivativeMissing,
    NotABifurcation,
    NotConverged,
    OutOfDomain,
    SingularSystem,
)
from continuation.events import Event
from continuation.linear import MatrixLinearisation
from continuation.newton import Deflation, NewtonResult, equilibrium
from continuation.normal_form import HopfNormalForm, fold_coefficient, hopf_normal_form
from continuation.observers import Checkpoint, Observer
from continuation.options import ContinuationOptions, NewtonOptions
from continuation.system import Linearisation, Parameters, Spectrum, System, SystemBase

__all__ = [
    "Branch", "Checkpoint", "ContinuationError", "ContinuationOptions", "CurvePoint",
    "Deflation", "DerivativeMissing", "Event", "HopfNormalForm", "JaxSystem", "Linearisation",
    "MatrixLinearisation", "NewtonOptions", "NewtonResult", "NotABifurcation", "NotConverged",
    "Observer", "OutOfDomain", "Parameters", "SingularSystem", "SpecialPoint", "Spectrum", "System",
    "SystemBase", "continue_branch", "continue_fold", "continue_hopf", "equilibrium",
    "fold_coefficient", "hopf_normal_form", "resume", "resume_curve", "switch_branch",
]


def __getattr__(name):
    # JAX takes long to import and not every system is written in it.
    if name == "JaxSystem":
        from continuation.jax_system import JaxSystem

        return JaxSystem
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
