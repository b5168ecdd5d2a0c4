"""Families of pencils: one linearised structure under many conditions."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Hashable, Mapping
from typing import Any, NamedTuple

import numpy as np

from .operator import CoupledPencil, Relaxation, edge_of
from .options import CLEAR, LOWEST, SLOPE, SearchOptions


class Condition(NamedTuple):
    """What may differ between the pencils of a family.

    Attributes
    ----------
    inertia : float
        The coupling is a polynomial in sqrt(inertia) lambda, once its inner unknowns are scaled: what the density of a
        fluid does.
    alpha, beta : float
        Damping C = alpha M + beta D, 1/s and s.
    law : hashable
        Which coupling parts.
    loss : float
        Factor on the loss factors of the stiffness that relaxes; zero leaves it elastic.
    """

    inertia: float
    alpha: float
    beta: float
    law: Hashable = 0.0
    loss: float = 0.0

    @property
    def damping(self) -> tuple[float, float, float]:
        """What the structure alone depends on."""
        return self.alpha, self.beta, self.loss


class PencilFamily(ABC):
    """Structure and coupling at one state; what `FamilyReduction` and `ColumnSolver` ask for.

    Attributes
    ----------
    mass, damping, stiffness : (n, n) real sparse matrices
        M, D and K; C = alpha M + beta D.
    forces : (n, m) real sparse matrix G
    slope : (m, n) real sparse matrix J
    added : int
        Number of coupling forces, the last ones, that are inertia alone: the structure swings with that mass, not with
        its own.
    model : callable
        The `FamilyReduction` made last of it, None when nobody holds that any more.
    """

    added: int = 0
    model: Callable[[], Any | None] = staticmethod(lambda: None)
    mass: object
    damping: object
    stiffness: object
    forces: object
    slope: object

    @abstractmethod
    def parts(self, law: Hashable) -> dict[str, np.ndarray]:
        """A0 to S1 of `CoupledPencil` at inertia 1; the same object for the same law."""

    @abstractmethod
    def pencil(self, condition: Condition) -> CoupledPencil:
        """The full pencil; its inner unknowns may be scaled differently."""

    @abstractmethod
    def search(self, condition: Condition) -> SearchOptions:
        """What is searched in the spectrum: limit point and band."""

    def relaxation(self, loss: float) -> Relaxation | None:
        """What relaxes under a factor on the loss factors: the same matrices for every factor, in one order, and the
        same object for the same factor; None where nothing does.
        """
        return None

    def lowest(self, count: int) -> np.ndarray:
        """Lowest frequencies of the undamped structure, Hz, ascending; none without a small model that has them."""
        model = self.model()
        return np.zeros(0) if model is None else model.lowest_frequencies(count)

    def coupling_at(self, s: complex, condition: Condition):
        """A, B, R, S (s) with the inner unknowns scaled."""
        p, z = self.parts(condition.law), s * np.sqrt(condition.inertia)
        return (
            p["A0"] + z * (p["A1"] + z * p["A2"]),
            p["B0"] + z * p["B1"],
            p["R0"] + z * (p["R1"] + z * p["R2"]),
            p["S0"] + z * p["S1"],
        )

    def reach(self, condition: Condition) -> Reach:
        """Where leading modes of a condition lie."""
        options = self.search(condition)
        floor = -np.inf if options.limit_point is None else CLEAR * options.limit_point
        band = np.inf if options.max_frequency is None else 2 * np.pi * options.max_frequency
        return Reach(floor, band, edge_of(self.relaxation(condition.loss)))


class Reach(NamedTuple):
    """Growth rates above `floor` (1/s) and angular frequencies up to `band` (rad/s).

    Left of `creep` (1/s), which is minus infinity where nothing relaxes, what oscillates hardly or slowly does not
    count; see `eigen.operator` and `eigen.search`.
    """

    floor: float
    band: float
    creep: float = -np.inf

    def is_mode(self, values: np.ndarray) -> np.ndarray:
        """Which eigenvalues are no creep: right of it, or decaying no faster, and oscillating no slower, than a search
        for modes reaches.
        """
        values = np.asarray(values)
        lowest = LOWEST * self.band if np.isfinite(self.band) else 0.0
        high = np.abs(values.imag)
        return (values.real > self.creep) | ((-values.real <= SLOPE * high) & (high >= lowest))

    def leading(self, values: np.ndarray) -> np.ndarray:
        """Eigenvalues of the upper half-plane in reach, sorted by growth rate.

        Where none lies above the floor the largest of all is given, which then is close to the limit point.
        """
        upper = values[(values.imag >= 0) & (values.imag <= self.band)]
        upper = upper[self.is_mode(upper)]
        kept = upper[upper.real > self.floor]
        if not kept.size and upper.size:
            kept = upper[[int(np.argmax(upper.real))]]
        return kept[np.argsort(-kept.real)]


def bordered(parts: Mapping[str, np.ndarray]) -> np.ndarray:
    """[-A, -B; R, S] of the parts of a coupling, for each power of the scaled eigenvalue, (3, k + b, k + b)."""
    k, b = len(parts["A0"]), len(parts["S0"])
    out = np.zeros((3, k + b, k + b))
    for power in range(3):
        out[power, :k, :k], out[power, k:, :k] = -parts[f"A{power}"], parts[f"R{power}"]
        if power < 2:
            out[power, :k, k:], out[power, k:, k:] = -parts[f"B{power}"], parts[f"S{power}"]
    return out
