"""A wall that relaxes in the linearised valve."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dbvfiv.case.parameters import Mu
from dbvfiv.materials.prony import Prony
from dbvfiv.model import ValveModel, linearise
from dbvfiv.model.build import build_section
from dbvfiv.shell import Section
from dbvfiv.studies.case import thesis_case

from .conftest import SMALL

RUBBER, PLY = Prony((0.3, 0.1), (1e-3, 1e-2)), Prony((0.05, 0.02), (1e-2, 0.1))


def relaxing_valve(**changes) -> ValveModel:
    """A small valve of which rubbers relax by one series, plies by another."""
    case = thesis_case(SMALL | {key.replace("__", "."): value for key, value in changes.items()})
    plain = build_section(case)
    layers = (replace(x, relaxation=PLY if x.law.kind == 0 else RUBBER) for x in plain.layers)
    return ValveModel(case, Section(tuple(layers), plain.points_per_layer))


@pytest.fixture(scope="module")
def valve() -> ValveModel:
    return relaxing_valve()


@pytest.fixture(scope="module")
def state(valve, make_state):
    return linearise(valve, make_state(valve, 0.01), 6e3)


def test_groups_share_their_times(valve):
    branches = valve.relaxation.branches(1.0)
    assert branches.times.tolist() == [1e-3, 1e-2, 0.1]
    assert branches.strengths.tolist() == [[0.3, 0.1, 0.0], [0.0, 0.05, 0.02]]
    assert branches.groups == tuple(group.name for group in valve.shell.section.relaxing)


def test_a_factor_scales_the_loss_factors(valve):
    half = valve.relaxation.branches(0.5)
    series = Prony(tuple(half.strengths[0, :2]), RUBBER.times)
    assert series.loss_factor(30.0) == pytest.approx(0.5 * RUBBER.loss_factor(30.0), rel=0.05)
    assert not valve.relaxation.branches(0.0)


def test_pencils_carry_what_relaxes(state):
    wet = state.pencil(Mu(density=10.0, alpha=5.0, beta=0.0, loss_factor=1.0))
    dry = state.pencil(Mu(density=10.0, alpha=5.0, beta=0.0, loss_factor=1.0), fluid=False)
    assert wet.branches == dry.branches == 3
    for pencil in (wet, dry):
        for found, expected in zip(pencil.relaxing, state.relaxing, strict=True):
            assert abs(found - expected).max() == 0.0
    assert state.relaxing is state.relaxing
    assert state.pencil(Mu(density=10.0, alpha=5.0, beta=0.0)).relaxation is None


def test_the_material_part_is_less_than_the_tangent_of_a_stressed_wall(state):
    material = sum(state.relaxing)
    assert 1e-4 < abs(material - state.structure).max() / abs(material).max() < 0.5


def test_a_system_has_the_same_pencil(valve, state):
    mu = {"inlet": 6e3, "density": 10.0, "storage": 0.0, "alpha": 5.0, "beta": 0.0, "loss_factor": 1.0}
    speed = valve.flow.steady_inner(valve.rows.areas(valve.nodal(state.q)), mu)
    found, expected = (
        linearise(valve, state.q, 6e3, mu, speed).pencil(mu),
        state.pencil(Mu(density=10.0, alpha=5.0, beta=0.0, loss_factor=1.0)),
    )
    assert np.array_equal(found.relaxation.strengths, expected.relaxation.strengths)
    assert all(abs(a - b).max() == 0.0 for a, b in zip(found.relaxing, expected.relaxing, strict=True))
    assert abs(found.K - expected.K).max() < 1e-12 * abs(expected.K).max()
