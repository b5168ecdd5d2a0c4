"""Pipes in series: one in pieces is one, organ pipes of two sections, blows at a joint, rigid pipes between elastic."""

from __future__ import annotations

import jax
import numpy as np
import pytest
from scipy.optimize import brentq

from dbvfiv.flow import Channel, FlowMotion
from dbvfiv.flow.elastic_line import DEGREE, ElasticLine
from dbvfiv.flow.stepping import MovingFluid
from dbvfiv.flow.terms.line import Line, PiecedLine
from tests.flow.test_channel import FLOOR, passage
from tests.flow.test_elastic_line import DENSITY, QUARTER, SUPPLY, behind, check_step, shut_frequencies
from tests.flow.waves import Waves, march, unbalanced

jax.config.update("jax_enable_x64", True)


def area_of(diameter):
    return 0.25 * np.pi * diameter**2


def in_series(*parts: Line, speeds, elements=None) -> ElasticLine:
    return ElasticLine(PiecedLine(parts), speeds, elements)


@pytest.mark.slow
def test_a_pipe_in_pieces_is_the_pipe():
    """Any motion of the fluid asks for the same, in pipes that are longer than their own length too; steady flow."""
    keys, rng = {"diameter": 0.2, "friction": 0.02, "reservoir": False}, np.random.default_rng(1)
    pipes = [
        ElasticLine(Line(20.0, **keys), 900.0, 4),
        in_series(Line(5, **keys), Line(15, **keys), speeds=(900.0,) * 2, elements=(1, 3)),
    ]
    laws = [Waves(line, QUARTER) for line in pipes]
    motion = FlowMotion(*rng.standard_normal((3, 1)), *rng.standard_normal((2, pipes[0].size)))
    for length in (20.0, 30.0):
        given = {"inlet": SUPPLY, "density": DENSITY, "pipe_length": length}
        one, other = (np.concatenate(law.evaluate(motion, given)) for law in laws)
        assert other == pytest.approx(one, abs=1e-12 * np.abs(one).max())
        one, other = (law.steady_inner(motion.area, given) for law in laws)
        assert other == pytest.approx(one, rel=1e-12)
    assert pipes[1].places[0] == pytest.approx(pipes[0].places[0])
    assert behind(pipes[1]).resolved({}) == behind(pipes[0]).resolved({})


@pytest.mark.slow
def test_rigid_pieces_add_inertance_and_losses():
    term = PiecedLine([Line(3.0, 0.2, friction=0.03, loss=0.5), Line(2.0, 0.1, loss=1.0), Line(1.0, roughness=1e-4)])
    z, area = passage()
    law, inlet = Channel(z, FLOOR, terms=[term]), 4.0 * area[-1]
    own = np.sqrt(4 * inlet / np.pi)
    ratios = np.array([inlet / area_of(0.2), inlet / area_of(0.1), 1.0])
    inertance = law.linearise_still(area, {"inlet": SUPPLY, "density": 1.0})["S1"][0, 0]
    bare = Channel(z, FLOOR).linearise_still(area, {"inlet": SUPPLY, "density": 1.0})["S1"][0, 0]
    assert bare - inertance == pytest.approx(np.array([3.0, 2.0, 1.0]) @ ratios, rel=1e-12)
    rough = (2 * np.log10(3.7 * own / 1e-4)) ** -2
    zeta = np.array([0.03 * 3.0 / 0.2 + 0.5, 1.0, rough / own])
    assert term.lost_head(area[-1], 1.7) == pytest.approx(0.5 * zeta @ (1.7 * ratios) ** 2, rel=1e-12)
    velocity = law.inlet_velocity(area, SUPPLY, DENSITY)
    jet = velocity * area[-1] / area[0]
    assert SUPPLY / DENSITY == pytest.approx(0.5 * jet**2 + term.lost_head(area[-1], velocity), rel=1e-9)


def roots(function, count: int, top: float) -> np.ndarray:
    """First zeros of a function without poles."""
    grid = np.linspace(1e-6, top, 4000)
    values = np.array([function(x) for x in grid])
    cuts = np.flatnonzero(values[:-1] * values[1:] < 0)[:count]
    return np.array([brentq(function, grid[i], grid[i + 1], xtol=1e-13) for i in cuts])


def test_organ_pipes_of_two_sections():
    """tan(w L1/c1) tan(w L2/c2) = Z2/Z1, Z = c/A, open at its far end and shut at the flange; a rigid pipe between them
    adds w L/A to Z1 tan.
    """
    (l1, d1, c1), (l2, d2, c2), (rigid, d) = (12.0, 0.3, 1000.0), (5.0, 0.15, 400.0), (6.0, 0.2)
    z1, z2 = c1 / area_of(d1), c2 / area_of(d2)

    def dispersion(w):
        x, y = w * l1 / c1, w * l2 / c2
        lump = w * rigid / area_of(d)
        return (z1 * np.sin(x) + lump * np.cos(x)) * np.sin(y) - z2 * np.cos(x) * np.cos(y)

    line = in_series(Line(l1, d1), Line(rigid, d), Line(l2, d2), speeds=(c1, None, c2), elements=(12, None, 12))
    found = shut_frequencies(line)
    assert len(found) == DEGREE * 24
    assert found[:6] == pytest.approx(roots(dispersion, 6, 3000.0), rel=1e-8)


@pytest.mark.slow
def test_a_rigid_piece_at_an_end_is_its_inertance():
    """At the far end it hangs between the reservoir and the waves, at the flange between them and the valve."""
    length, speed, d = 10.0, 500.0, 0.2
    far = in_series(Line(4.0, d), Line(length, d), speeds=(None, speed), elements=(None, 16))
    function = lambda w: np.cos(w * length / speed) - w * 4.0 / speed * np.sin(w * length / speed)  # noqa: E731
    assert shut_frequencies(far)[:4] == pytest.approx(roots(function, 4, 1000.0), rel=1e-8)
    near = in_series(Line(length, d), Line(4.0, d), speeds=(speed, None), elements=(4, None))
    ratio, still = 4 * QUARTER / area_of(d), np.zeros(near.size)
    motion = FlowMotion(np.zeros(1), np.ones(1), np.zeros(1), still, still)  # the flange is accelerated, from rest
    pressures = [
        Waves(line, QUARTER).evaluate(motion, {"inlet": 0.0, "density": DENSITY})[0][0]
        for line in (near, ElasticLine(Line(length, d), speed, 4))
    ]
    assert pressures[1] - pressures[0] == pytest.approx(DENSITY * 4.0 * ratio, rel=1e-10)


@pytest.mark.slow
def test_a_blow_at_a_change_of_section():
    """It goes on as 2 Z1/(Z1 + Z2) of itself and comes back as (Z1 - Z2)/(Z1 + Z2), Z = c/A (Wylie and Streeter)."""
    (l1, c1), (l2, c2), d2, wider = (20.0, 800.0), (20.0, 1000.0), 0.25, 0.4
    line = in_series(Line(l1, wider), Line(l2, d2), speeds=(c1, c2), elements=(24, 24))
    waves = MovingFluid(Waves(line, QUARTER), DENSITY)
    velocity, rise, step = 1e-2, 0.15 * l2 / c2, l2 / c2 / 200
    flange = lambda t: -0.5 * velocity * (1.0 - np.cos(np.pi * min(1.0, t / rise)))  # noqa: E731
    pressure, states = march(waves, flange, step, 560, 0.0, np.zeros(line.size))
    z1, z2 = c1 / area_of(wider), c2 / area_of(d2)
    blow = c2 * 4 * QUARTER / area_of(d2) * velocity
    assert (pressure / DENSITY)[40:380] == pytest.approx(blow, rel=5e-3)
    back = (z1 - z2) / (z1 + z2)
    time = (np.arange(560) + 0.5) * step * c2 / l2
    late = (pressure / DENSITY)[(time > 2.4) & (time < 2.75)]
    assert late.mean() == pytest.approx((1 + 2 * back) * blow, rel=5e-3)
    then = states[330]  # 1.65 of the way: the blow is past the joint by 0.65 of a pipe
    segments = line.segments(QUARTER, waves.parameters(0.0))
    head = (then.inner[line.size // 2 :].reshape(48, -1) * np.array(segments.ratio * segments.speed)[:, None])[:, 0]
    passed = head[16:34]
    assert passed == pytest.approx(2 * z1 / (z1 + z2) * blow, rel=0.01)


@pytest.mark.slow
def test_what_a_step_solves_is_the_law():
    """The books hold what becomes of the energy, and a steady flow meets the law too."""
    _, area = passage()
    parts = [
        Line(2.0, 0.3, loss=0.7),
        Line(4.0, 0.2, friction=0.03),
        Line(1.0, 0.25, loss=1.1),
        Line(3.0, roughness=1e-4),
    ]
    line = in_series(
        *parts, Line(0.5, 0.1, loss=0.2), speeds=(None, 800.0, None, 500.0, None), elements=(None, 2, None, 1, None)
    )
    check_step(line, area[-1])
    law, given, velocity = Waves(line, area[-1]), {"inlet": SUPPLY, "density": DENSITY}, np.array([1.7])
    waves = MovingFluid(law, DENSITY)
    states = march(waves, lambda t: 1.7 + 30.0 * t, 1e-3, 20, SUPPLY, theta=0.6, rate=1.1)[1]
    assert unbalanced(waves, states) < 1e-12
    _, rest = law.evaluate(FlowMotion.still(velocity, law.steady_inner(velocity, given)), given)
    assert np.abs(rest).max() < 1e-9 * SUPPLY
