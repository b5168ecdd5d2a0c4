"""Random valves with fluid outside: spectrum and independent count agree, or the result says that they do not."""

from __future__ import annotations

import numpy as np
import pytest

from dbvfiv.case.parameters import Mu
from dbvfiv.model import ValveModel, linearise, select_search
from dbvfiv.model.equilibria import LoadPath
from dbvfiv.studies.case import thesis_case
from eigen import SearchOptions, certified_spectrum, lowest_frequencies


def random_outside(rng) -> dict[str, object]:
    """Keys of a valve that someone may have under water, in oil or in a pipe."""
    keys = {
        "outside.fluid": "same" if rng.random() < 0.5 else float(10.0 ** rng.uniform(0, 4.2)),
        "outside.lips": str(rng.choice(["closed", "open"])),
        "valve.thickness_factor": float(rng.uniform(0.7, 1.3)),
    }
    if rng.random() < 0.5:
        keys["outside.pipe_diameter"] = float(rng.uniform(0.32, 1.5))
    if rng.random() < 0.4:
        keys["upstream.length"] = float(10.0 ** rng.uniform(-1, 2))
    if rng.random() < 0.3:
        keys |= {"damping.model": "loss factor", "materials.constants": "stable"}
    return keys


def look_at(number: int, seed: int) -> list[str]:
    """States without agreement, as sentences."""
    rng, missed = np.random.default_rng(seed), []
    for i in range(number):
        keys = random_outside(rng)
        pressure, density = float(10.0 ** rng.uniform(2, 4.5)), float(10.0 ** rng.uniform(0, 3.3))
        storage, beta = float(rng.choice([0.0, 1.0])), float(10.0 ** rng.uniform(-4, -2.3))
        model = ValveModel(thesis_case({"mesh.around": 8, "mesh.along": 14} | keys))
        loss = 1.0 if model.relaxation.groups else 0.0
        line = {"pipe_length": keys["upstream.length"]} if "upstream.length" in keys else {}
        conditions = Mu(density=density, alpha=0.0, beta=0.0 if loss else beta, loss_factor=loss, **line)
        pencil = linearise(model, LoadPath(model).go_to(pressure).q, pressure).pencil(conditions.at(storage=storage))
        search = select_search(SearchOptions(), conditions, lambda n: lowest_frequencies(pencil, n), 6)
        found = certified_spectrum(pencil, 6, search.options)
        if not found.agrees:
            missed.append(f"{i}: {pressure:.4g} Pa, {density:.4g} kg/m3, {storage:g}, {keys}: {found.statement}")
    return missed


@pytest.mark.slow
def test_counts_of_some_agree():
    assert not look_at(6, 21)


@pytest.mark.slow
@pytest.mark.random
def test_counts_of_many_agree():
    missed = look_at(200, 22)
    print("\n".join(missed))
    assert len(missed) <= 2  # said, with the reason
