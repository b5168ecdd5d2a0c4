"""Periodic orbits of a discretised equation against one steady state of it."""

from __future__ import annotations

import numpy as np

from continuation import ContinuationOptions, continue_branch, equilibrium, orbits_from_hopf
from tests.systems.brusselator import brusselator_1d

from .registry import Row, benchmark, medians, seconds

#: Nodes of the Brusselator on a line, two unknowns each.
NODES = 64


@benchmark("orbits")
def orbits():
    """A branch of orbits of the Brusselator with diffusion, 128 unknowns, with their Floquet exponents."""
    system, limits = brusselator_1d(NODES), {"l": (0.45, 0.6)}
    mu = {"A": 2.0, "B": 5.45, "D1": 0.008, "D2": 0.004, "l": 0.48}
    rest = np.tile([2.0, 2.725], NODES)
    options = ContinuationOptions(eigenvalues=4, near=2.2j, limits=limits)
    hopf = continue_branch(system, rest, mu, "l", options).of_kind("hopf")[0]
    steady = medians({"steady": lambda: equilibrium(system, 1.01 * rest, mu)}, 5)["steady"]
    whole, branch = seconds(lambda: orbits_from_hopf(system, hopf, "l", ContinuationOptions(limits=limits)))
    taken = whole / len(branch)
    most = int(branch.values("harmonics").max())
    yield Row(
        "one orbit with its Floquet exponents over one steady state from a guess",
        taken / steady,
        target=1000.0,
        note=f"{taken:.2f} s for each of {len(branch)} orbits of at most {most} harmonics; {branch.reason}",
    )
