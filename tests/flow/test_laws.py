"""Any law: what follows from its definition, tried on laws with none, one and three unknowns."""

from __future__ import annotations

from functools import partial

import jax
import numpy as np
import pytest

from dbvfiv.flow import Channel, FlowMotion, FlowParameter, FlowTerm, UniformLoad
from dbvfiv.flow import law as laws
from dbvfiv.flow.law import solve_steady
from tests.differences import difference
from tests.flow.test_channel import FLOOR, passage
from tests.flow.vessel import Vessel

GIVEN = {"inlet": 18e3, "density": 850.0}


def vessel():
    return Vessel(Channel(passage()[0], FLOOR, 0.7), capacity=3e-7, resistance=1.5)


class Searched(Channel):
    """A channel whose steady flow is found by Newton's method."""

    steady = solve_steady


@pytest.mark.slow
def test_closed_form_of_the_channel_is_the_root_of_its_equations():
    """Pressures, velocity and their derivatives up to the third by Newton's method on the definition alone."""
    z, area = passage()
    channel = Channel(z, FLOOR)
    searched = Searched(z, FLOOR)
    assert searched.steady_inner(area, GIVEN) == pytest.approx(channel.steady_inner(area, GIVEN), rel=1e-13)
    directions = tuple(0.3 * area * np.random.default_rng(1).standard_normal((3, len(z))))
    parameters = channel.values(GIVEN)

    def further(known, way, x):
        values, slopes = jax.jvp(known, (x,), (way,))
        return *values, slopes[-1]

    def with_derivatives(law):
        found = lambda x: (law.steady(x, parameters)[0],)  # noqa: E731
        for direction in directions:
            found = partial(further, found, direction)
        return jax.jit(found)(area)

    for order, (ours, closed) in enumerate(zip(*map(with_derivatives, (searched, channel)), strict=True)):
        assert np.abs(ours - closed).max() <= 1e-12 * np.abs(closed).max(), order
    nearly_shut = np.concatenate([[-3 * FLOOR], area[1:]])
    assert searched.steady_pressure(nearly_shut, 1.0) == pytest.approx(channel.steady_pressure(nearly_shut, 1.0))


@pytest.mark.slow
def test_steady_flow_through_a_vessel():
    _, area = passage()
    law = vessel()
    velocity, inside, through = law.steady_inner(area, GIVEN)
    open_ = law.open_area(area)
    assert through * area[-1] == pytest.approx(velocity * area[-1])
    assert inside == pytest.approx(18e3 - 0.5 * 850 * 1.5 * velocity**2)
    assert inside == pytest.approx(0.5 * 850 * velocity**2 * ((open_[-1] / open_[0]) ** 2 - 1))
    assert law.steady_pressure(area, 18e3) == pytest.approx(law.law.steady_pressure(area, inside))
    pressure, slope = law.steady_operator(area, 18e3)
    direction = area * np.random.default_rng(2).standard_normal(len(area))
    other = difference(lambda a: law.steady_pressure(a, 18e3), area, direction, 1e-3)
    assert np.abs(slope @ direction - other).max() < 1e-8 * np.abs(other).max()


def test_where_there_is_no_steady_flow_none_is_returned():
    """Lips wider than the inlet: an ideal fluid would run ever faster."""
    z, area = passage()
    law = Searched(z, FLOOR)
    assert np.isnan(law.steady_inner(area[::-1], GIVEN)).all()
    assert np.isnan(law.steady_pressure(area[::-1], 18e3)[1:]).all()


@pytest.mark.parametrize(
    "law", [vessel(), Channel(passage()[0], FLOOR, 0.3), UniformLoad(9, 1.0)], ids=lambda law: law.inner
)
def test_linearisation_of_any_law(law):
    _, area = passage()
    generator = np.random.default_rng(3)
    m, l = law.count, law.inner
    motion = FlowMotion(
        area,
        0.02 * generator.standard_normal(m),
        0.5 * generator.standard_normal(m),
        np.array([1.7, 6e3, 2.1])[:l],
        np.array([4.0, 1e4, -2.0])[:l],
    )
    found = law.linearise(motion, GIVEN)
    directions = (area, 0.02 * np.ones(m), 0.5 * np.ones(m), np.abs(motion.inner), np.abs(motion.inner_rate))
    shapes = {"A": (m, m), "B": (m, l), "R": (l, m), "S": (l, l)}
    assert {name: part.shape for name, part in found.items()} == {name: shapes[name[0]] for name in found}
    for i, (upper, lower) in enumerate((("A0", "R0"), ("A1", "R1"), ("A2", "R2"), ("B0", "S0"), ("B1", "S1"))):
        direction = directions[i] * generator.standard_normal(len(directions[i]))

        def moved(x):
            return np.concatenate(law.evaluate(FlowMotion(*motion[:i], x, *motion[i + 1 :]), GIVEN))

        slope = difference(moved, motion[i], direction, 1e-3)
        product = np.concatenate([found[upper] @ direction, found[lower] @ direction])
        assert np.abs(product - slope).max(initial=0.0) <= 1e-8 * max(np.abs(slope).max(initial=0.0), 1.0)


def test_laws_are_compiled_once_for_each_kind():
    z, area = passage()
    Channel(z, FLOOR).steady_operator(area, 1e3)
    kinds = laws._steady_operator._cache_size()
    for density in (1.0, 2.0):
        Channel(1.1 * z, 2 * FLOOR, 0.4).steady_operator(density * area, 2e3)
    assert laws._steady_operator._cache_size() == kinds


def test_parameters_are_named_and_missing_ones_are_told():
    law = vessel()
    assert law.names == ("inlet", "density", "storage", "capacity", "resistance")
    assert law.values(GIVEN | {"alpha": 3.0})["storage"] == 0.7
    with pytest.raises(ValueError, match="'density'"):
        law.values({"inlet": 1.0})


class Laminar(FlowTerm):
    def head(self, stream, parameters):
        return stream.inner[0]


class SecondDensity(FlowTerm):
    @property
    def parameters(self):
        return (FlowParameter("density", "kg/m3", "of something else", 1.0),)


def test_terms_that_do_not_fit_are_refused():
    z, _ = passage()
    with pytest.raises(ValueError, match="square of the speeds.*Laminar"):
        Channel(z, FLOOR, terms=[Laminar()])
    with pytest.raises(ValueError, match="'density'"):
        Channel(z, FLOOR, terms=[SecondDensity()])
