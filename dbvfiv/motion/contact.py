"""Contact of the inner faces in motion: what a step asks of it, by the valve's free unknowns.

Equation (T.27) of docs/theory.md.
"""

from __future__ import annotations

import numpy as np

from ..contact import ContactStep, Rebound
from ..model import ValveModel
from ..model.faces import FaceContact
from ..model.linear import DirectFactor
from .outside import MovingOutside


class FaceStep:
    """Contact in a step that starts from positions (n,); see `dbvfiv.contact.step.ContactStep`.

    Parameters
    ----------
    faces : FaceContact
    q : (n,) array
    h : float, s
    rebound : float
        Share of the stored energy that parting faces get back.
    """

    def __init__(self, faces: FaceContact, q: np.ndarray, h: float, rebound: float):
        self._faces = faces
        self._step = ContactStep(faces.plane, faces.nodal(q), h, Rebound(rebound))

    def force(self, q: np.ndarray) -> np.ndarray:
        """Internal force (n,) over a step that ends at positions (n,)."""
        return self._step.force(self._faces.nodal(q))

    def add_tangent(self, q: np.ndarray, values: np.ndarray, weight: float) -> None:
        """Add a multiple of its derivative to values (nnz,)."""
        self._step.add_tangent(self._faces.nodal(q), values, weight)

    def stored(self, q: np.ndarray) -> float:
        """Energy gained by the contact up to positions (n,), J of the part."""
        return self._step.stored(self._faces.nodal(q))


class MassSolver:
    """Accelerations that a force gives the wall, with the added mass of fluid outside.

    Parameters
    ----------
    model : ValveModel
    """

    def __init__(self, model: ValveModel):
        self._model = model
        self._factor = DirectFactor(*model.shell.dofs.pattern)

    def solve(self, q: np.ndarray, force: np.ndarray, outside: MovingOutside | None = None) -> np.ndarray:
        """Accelerations (n,) at positions (n,) by a force (n,)."""
        factor = self._factor
        factor.values[:] = self._model.mass(q)
        factor.refactor()
        if outside is None:
            return factor.solve(force)
        none = np.zeros(0)
        return outside.correction(lambda f, _: (factor.solve(f), none), 1.0).solve(force, none)[0]
