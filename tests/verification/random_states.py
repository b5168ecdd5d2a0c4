"""A seeded sampler of steady states and conditions over all a valve may meet, for tests of the eigenvalue search.

Equilibria depend on the pressure alone, so a few dozen pressures carry thousands of states.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from dbvfiv.case.parameters import Mu
from dbvfiv.fit import fit_constant
from dbvfiv.materials.prony import Prony
from dbvfiv.model import LinearisedState, ValveModel, linearise
from dbvfiv.model.equilibria import LoadPath
from dbvfiv.model.relaxing import WallRelaxation
from dbvfiv.studies.case import thesis_case
from eigen import CoupledPencil, Relaxation

LARGEST_LOSS = 2.0


@dataclass(frozen=True)
class RandomState:
    """One state of the sample.

    Attributes
    ----------
    number : int
        Place in the sample.
    linear : LinearisedState
    mu : Mu
    storage : float
        Blend of the continuity laws, 0 quasi-steady to 1 storage.
    relaxation : Relaxation or None
        What relaxes of the wall, where it is not as the model of the steady state has it.
    """

    number: int
    linear: LinearisedState
    mu: Mu
    storage: float
    relaxation: Relaxation | None = None

    @property
    def pencil(self) -> CoupledPencil:
        elastic = self.mu.at(loss_factor=0.0)
        pencil = self.linear.pencil(elastic.at(storage=self.storage))
        return pencil if self.relaxation is None else pencil.replace(relaxation=self.relaxation)

    def __str__(self) -> str:
        c, branches = self.mu, 0 if self.relaxation is None else self.relaxation.branches
        return (
            f"state {self.number}: {self.linear.inlet:.5g} Pa, {c.density:.4g} kg/m3, alpha {c.alpha:.4g} 1/s, "
            f"beta {c.beta:.4g} s, storage {self.storage:.3g}, loss factor {c.loss_factor:.3g} with {branches} times"
        )


def linearised_states(around: int, along: int, pressures, **changes) -> list[LinearisedState]:
    """Steady states of the 12-inch valve on one mesh at ascending pressures, Pa."""
    model = ValveModel(thesis_case({"mesh.around": around, "mesh.along": along, **changes}))
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
        mu = Mu(
            density=float(10.0 ** (-3 + density * np.log10(2e7))),
            alpha=0.0 if kind[0] < 0.3 else float(100.0 * alpha**2),
            beta=0.0 if kind[1] < 0.12 else float(10.0 ** (-6 + 4 * beta)),
        )
        storage = 0.0 if kind[2] < 0.3 else 1.0 if kind[2] < 0.65 else float(blend)
        yield RandomState(i, states[int(place * len(states))], mu, storage)


def relaxing_states(states: list[LinearisedState], number: int, seed: int) -> Iterator[RandomState]:
    """States with random conditions whose materials relax, each by a series of its own.

    Densities, alpha and laws as in `random_states`, without beta. Of the materials some are elastic, most have a
    constant loss factor up to 0.5, fitted over a common random band of 1 to 3 decades by 2 to 6 branches, and some
    have times of their own. The factor on all of them is 0, 1 or any up to 3, as far as no loss factor exceeds 2
    and all series meet it.
    """
    rng = np.random.default_rng([seed, 3])
    for state in random_states(states, number, seed):
        low = 10.0 ** rng.uniform(-1, 1.3)
        band, branches = (low, low * 10.0 ** rng.uniform(1, 3)), int(rng.integers(2, 7))
        groups = state.linear.model.relaxation.groups
        groups = tuple(replace(group, series=_random_series(rng, band, branches)) for group in groups)
        kind, factor = rng.random(), rng.uniform(0, 3)
        wanted = 0.0 if kind < 0.05 else 1.0 if kind < 0.35 else factor
        at = np.geomspace(1e-4, 1e6, 400)
        highest = max(group.series.loss_factor(at).max() for group in groups)
        wanted = min(wanted, LARGEST_LOSS / highest) if highest > 0 else wanted
        wall = WallRelaxation(groups)
        factor = wall.highest(0.0, wanted)
        relaxation = wall.stiffness(factor, lambda: state.linear.relaxing)
        mu = state.mu.at(beta=0.0, loss_factor=factor)
        yield replace(state, mu=mu, relaxation=relaxation)


def _random_series(rng, band: tuple[float, float], branches: int) -> Prony:
    """Elastic, of a constant loss factor over a band, or with any strengths and times."""
    kind, loss, own = rng.random(), rng.uniform(0, 0.5), int(rng.integers(1, 4))
    strengths, times = 10.0 ** rng.uniform(-2, 0.5, own), 10.0 ** rng.uniform(-5, 1, own)
    if kind < 0.1:
        return Prony((0.0,), (1.0,))
    return fit_constant(loss, band, branches).prony if kind < 0.8 else Prony(tuple(strengths), tuple(times))
