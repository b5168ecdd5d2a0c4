"""A seeded sampler of steady states and conditions over all a valve may meet, for tests of the eigenvalue search.

Equilibria depend on the pressure alone, so a few dozen pressures carry thousands of states.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from dbvfiv.model import Conditions, LinearisedState, ValveModel, linearise
from dbvfiv.model.equilibria import LoadPath
from dbvfiv.studies.case import Case
from eigen import CoupledPencil


@dataclass(frozen=True)
class RandomState:
    """One state of the sample.

    Attributes
    ----------
    number : int
        Place in the sample.
    linear : LinearisedState
    conditions : Conditions
    storage : float
        Blend of the continuity laws, 0 quasi-steady to 1 storage.
    """

    number: int
    linear: LinearisedState
    conditions: Conditions
    storage: float

    @property
    def pencil(self) -> CoupledPencil:
        return self.linear.pencil(self.conditions, storage=self.storage)

    def __str__(self) -> str:
        c = self.conditions
        return (
            f"state {self.number}: {self.linear.inlet:.5g} Pa, {c.density:.4g} kg/m3, alpha {c.alpha:.4g} 1/s, "
            f"beta {c.beta:.4g} s, storage {self.storage:.3g}"
        )


def linearised_states(around: int, along: int, pressures, **changes) -> list[LinearisedState]:
    """Steady states of the 12-inch valve on one mesh at ascending pressures, Pa."""
    model = ValveModel(Case().replace({"mesh.around": around, "mesh.along": along, **changes}))
    path = LoadPath(model)
    return [linearise(model, path.go_to(float(p)).q, float(p)) for p in np.sort(pressures)]


def random_pressures(number: int, seed: int) -> np.ndarray:
    """Pressures from 0.05 to 60 kPa, one from each of as many equal parts on a logarithmic scale."""
    rng = np.random.default_rng([seed, 1])
    part = (np.arange(number) + rng.random(number)) / number
    return 50.0 * (60e3 / 50.0) ** part


def random_states(states: list[LinearisedState], number: int, seed: int) -> Iterator[RandomState]:
    """States with random conditions at random pressures of those given.

    Densities from 1e-3 to 2e4 kg/m3, alpha from 0 to 100 1/s, beta 0 or from 1e-6 to 1e-2 s, each law alone and blends.
    The sample of a seed begins with the sample of a smaller number.
    """
    rng = np.random.default_rng([seed, 2])
    for i in range(number):
        place, density, alpha, beta = rng.random(4)
        kind = rng.random(3)
        blend = rng.random()
        conditions = Conditions(
            density=float(10.0 ** (-3 + density * np.log10(2e7))),
            alpha=0.0 if kind[0] < 0.3 else float(100.0 * alpha**2),
            beta=0.0 if kind[1] < 0.12 else float(10.0 ** (-6 + 4 * beta)),
        )
        storage = 0.0 if kind[2] < 0.3 else 1.0 if kind[2] < 0.65 else float(blend)
        yield RandomState(i, states[int(place * len(states))], conditions, storage)
