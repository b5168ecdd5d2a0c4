"""A fluid that is compressed: organ pipe, resonator, nozzles, the incompressible limit, trapped gas, derivatives."""

from __future__ import annotations

import jax
import numpy as np
import pytest
from scipy.optimize import brentq

from dbvfiv.flow import Channel, FlowMotion
from dbvfiv.flow.gas import VAPOUR, GasChannel
from dbvfiv.flow.stepping import FluidState, MovingFluid, packed_size
from dbvfiv.flow.terms.line import Line
from tests.differences import difference
from tests.flow.answers import answer, frequencies
from tests.flow.test_channel import FLOOR, passage
from tests.flow.test_plug import swaying

jax.config.update("jax_enable_x64", True)
DENSITY, SOUND, RATIO = 1.2, 343.0, 1.4
#: No floor to speak of, and an opening that is next to none.
TINY, SHUT = 1e-16, 1e-14


def gas_of(z, floor=FLOOR, sound=SOUND, **keys) -> GasChannel:
    keys = {"reversible": True, "density": DENSITY} | keys
    return GasChannel(Channel(z, floor, 1.0, **keys), sound, RATIO)


def given(inlet: float) -> dict[str, float]:
    return {"inlet": inlet, "density": DENSITY}


def at_rest(law, area: np.ndarray):
    """Operators of the fluid at rest."""
    return law.linearise_still(area, given(0.0), inner=np.zeros(law.inner))


def test_organ_pipe():
    """An odd number of quarter waves with an open and a shut end: a cell of the box scheme holds 2 atan(w h/(2 c)), so
    that frequencies are too high by (k h)^2/12, which is what `resolved` goes by.
    """
    length, step, cells = 0.56, 1e-6, 7
    z = np.concatenate([[0.0], step + np.linspace(0.0, length, cells + 1)])
    law, h = gas_of(z, TINY), length / cells / SOUND
    found = frequencies(at_rest(law, np.concatenate([[SHUT], np.full(cells + 1, 5e-3)])))[:3]
    phase = 0.5 * np.pi * (2 * np.arange(3) + 1)
    assert 2 * cells * np.arctan(0.5 * found * h) == pytest.approx(phase, rel=1e-4)
    assert found[0] * length / SOUND / phase[0] - 1 == pytest.approx((phase[0] / cells) ** 2 / 12, rel=0.02)
    assert (2 * np.pi * law.resolved({}) * h) ** 2 / 12 == pytest.approx(0.01, rel=1e-6)


def test_helmholtz_resonator():
    """omega = c sqrt(a/(V l)) of a volume behind a neck, where both are short: (omega V^(1/3)/c)^2 = 2e-4 here."""
    neck, mouth, wide, depth, step = 0.05, 1e-6, 1e-2, 0.1, 1e-4
    z = np.cumsum([0.0, 0.5 * neck, 0.5 * neck, step, 0.25 * depth, 0.25 * depth, 0.25 * depth, 0.25 * depth, step])
    area = np.concatenate([np.full(3, mouth), np.full(5, wide), [1e-12]])
    found = frequencies(at_rest(gas_of(z, TINY), area))[0]
    assert found == pytest.approx(SOUND * np.sqrt(mouth / (wide * depth * neck)), rel=2e-3)


def isentropic(area, inlet):
    """Pressures (m,), Pa, and mass flow, kg/s, of a nozzle whose outlet is its narrowest section (Shapiro 1953)."""
    base = DENSITY * SOUND**2 / RATIO
    thick = lambda p: DENSITY * (1 + p / base) ** (1 / RATIO)  # noqa: E731
    heat = lambda p: SOUND**2 / (RATIO - 1) * ((1 + p / base) ** (1 - 1 / RATIO) - 1)  # noqa: E731
    jet = np.sqrt(2 * heat(inlet) / (1 - (DENSITY * area[0] / (thick(inlet) * area[-1])) ** 2))
    total, flow = 0.5 * jet**2, DENSITY * jet * area[0]
    missing = lambda p, a: heat(p) + 0.5 * (flow / (thick(p) * a)) ** 2 - total  # noqa: E731
    return np.array([0.0] + [brentq(missing, 0.0, inlet * (1 + 1e-12), (a,), xtol=1e-9) for a in area[1:-1]]), flow, jet


def test_steady_nozzle():
    z, _ = passage()
    area, law = np.linspace(2e-3, 1.2e-2, len(z)), gas_of(z, TINY)
    for inlet in (2e3, 36e3, 80e3):
        expected, flow, jet = isentropic(area, inlet)
        assert law.steady_pressure(area, inlet) == pytest.approx(np.append(expected, inlet), rel=1e-9, abs=1e-5)
        assert law.steady_velocities(area, inlet, DENSITY)[0] == pytest.approx(jet, rel=1e-12)
        inside = law.inlet_density(area, inlet, DENSITY) * law.inlet_velocity(area, inlet, DENSITY) * area[-1]
        assert inside == pytest.approx(flow, rel=1e-11)
    assert jet < SOUND
    nothing = law.steady_inner(area, given(0.0))
    assert not np.any(nothing)


def test_gas_that_sways_with_the_wall_has_its_own_density_and_mass_flow():
    """Coriolis force by the mass flow, mass by the densities of the nozzle; nearly incompressible as a liquid."""
    z, _ = passage()
    area, law = np.linspace(2e-3, 1.2e-2, len(z)), gas_of(z, TINY)
    pressure, flow, _ = isentropic(area, 36e3)
    thick = DENSITY * (1 + np.append(pressure, 36e3) * RATIO / (DENSITY * SOUND**2)) ** (1 / RATIO)
    assert thick[-1] > 1.2 * DENSITY
    for density in (DENSITY, 1.0):  # at another one speeds follow its root
        parts = swaying(law, z, area, 36e3).fluid_parts({"density": density})
        assert -parts["A1"][0, 0] == pytest.approx(flow * np.sqrt(density / DENSITY), rel=1e-9)
        a, b = area[:-1], area[1:]
        cells = np.diff(z) / 6 * (thick[:-1] * (2 * a + b) + thick[1:] * (a + 2 * b))
        assert -parts["A2"].sum() == pytest.approx(cells.sum() * density / DENSITY, rel=1e-9)
    plain, stiff = Channel(z, TINY, 1.0, reversible=True, density=DENSITY), gas_of(z, TINY, 1e6)
    one, two = (swaying(each, z, area, 36e3).fluid_parts({"density": DENSITY}) for each in (plain, stiff))
    for name, values in one.items():
        assert two[name] == pytest.approx(values, rel=1e-6, abs=1e-6 * np.abs(values).max())


@pytest.mark.parametrize("inside, within", [(False, 1e-12), (True, 4e-3)])
def test_choked_nozzle(inside, within):
    """rho* c* A*: at the outlet, whose pressure rises, and at a throat inside."""
    z = np.linspace(0.0, 0.5, 9)
    area = np.interp(z, [0.0, 0.25, 0.5], [4e-3, 2e-3, 1.2e-2]) if inside else np.linspace(2e-3, 1.2e-2, 9)
    law = gas_of(z, TINY)
    for inlet in (90e3, 300e3):
        velocity = law.inlet_velocity(area, inlet, DENSITY)
        thick = law.inlet_density(area, inlet, DENSITY)
        sound = SOUND * (thick / DENSITY) ** (0.5 * (RATIO - 1))
        rest = 1 + 0.5 * (RATIO - 1) * (velocity / sound) ** 2
        still = thick * rest ** (1 / (RATIO - 1)), sound * np.sqrt(rest)  # density and speed of sound at rest
        critical = still[0] * still[1] * (2 / (RATIO + 1)) ** (0.5 * (RATIO + 1) / (RATIO - 1)) * area.min()
        assert thick * velocity * area[-1] == pytest.approx(critical, rel=within)
    outlet = law.steady_pressure(area, 300e3)[0]
    assert outlet == 0.0 if inside else outlet > 90e3


def test_incompressible_limit():
    """Steady flow and small motions become those of `Channel` with storage, by (1/c)^2."""
    z, area = passage()
    channel, s = Channel(z, FLOOR, 1.0, density=DENSITY), 20.0 + 250.0j
    steady, expected = channel.steady_pressure(area, 6e3), answer(channel.linearise_still(area, given(6e3)), s)
    gaps = []
    for sound in (1e3, 1e4, 1e5):
        law = gas_of(z, sound=sound)
        found = answer(law.linearise_still(area, given(6e3)), s)
        gaps.append(
            [
                np.abs(law.steady_pressure(area, 6e3)[1:] / steady[1:] - 1).max(),
                np.abs(found - expected)[1:].max() / np.abs(expected).max(),
            ]
        )
    ratios = np.array(gaps[:-1]) / np.array(gaps[1:])
    assert ratios == pytest.approx(np.full((2, 2), 100.0), rel=0.05)
    assert np.max(gaps[-1]) < 1e-5


@pytest.mark.slow
def test_pressures_at_rest_rise_as_those_of_a_slow_flow():
    """Equilibria of a wall begin there; without the derivative their curve turned at its first step."""
    z, area = passage()
    law = gas_of(z)
    values = law.values(given(0.0))
    slope = jax.jacfwd(lambda inlet: law.steady(area, {**values, "inlet": inlet})[0])
    np.testing.assert_allclose(slope(0.0), slope(2.0), rtol=1e-3)
    assert slope(0.0)[-1] == pytest.approx(1.0, rel=1e-12)


def test_a_fluid_of_unit_density_that_is_compressed_alike():
    """Same pressures at speeds that are larger by the root of the density, which stability over a plane goes by."""
    z, area = passage()
    law = gas_of(z)
    one = law.linearise_still(area, {"inlet": 20e3, "density": 1.0} | law.at_unit_density())
    own = law.linearise_still(area, given(20e3))
    s, root = 30.0 + 200.0j, np.sqrt(DENSITY)
    answers = answer(own, s), answer(one, root * s)
    assert answers[0] == pytest.approx(answers[1], rel=1e-9, abs=1e-9 * np.abs(answers[0]).max())


# -- in time


def march(law, area_at, inner, inlet, step, count, rate=1.5):
    """States of the fluid in a passage whose areas and rates are functions of time."""
    fluid = MovingFluid(law, DENSITY)
    state = fluid.moving(area_at(0.0), np.zeros(law.count), inner, inlet)
    for i in range(count):
        new = area_at((i + 1) * step)
        flow = fluid.step(state, None, step, 1.0, rate, inlet).at(new, new)
        state = flow.state()
    return fluid, state, flow


def energy(fluid, area, inner) -> float:
    return sum(fluid.energies(area, inner).values())


def test_trapped_gas_is_an_adiabatic_spring():
    """p V^gamma is kept where a passage shut at both ends shrinks to an eighth."""
    z = np.linspace(0.0, 0.2, 9)
    law, period = gas_of(z, TINY), 0.5
    full = np.full(len(z), 5e-3)
    full[[0, -1]] = SHUT

    def area_at(t):
        share = 1.0 - 0.4375 * (1.0 - np.cos(np.pi * t / period))
        change = -0.4375 * np.pi / period * np.sin(np.pi * t / period)
        area, rate = full * share, full * change
        area[[0, -1]], rate[[0, -1]] = SHUT, 0.0
        return area, rate

    _, state, flow = march(law, area_at, np.zeros(law.inner), 0.0, period / 50, 50)
    base = DENSITY * SOUND**2 / RATIO
    assert flow.pressure[2:-2] == pytest.approx(base * (8.0**RATIO - 1.0), rel=1e-4)
    held = np.sum(state.held[2 * law.count :])
    assert held == pytest.approx(np.sum(0.5 * np.diff(z) * (full[1:] + full[:-1])), rel=1e-6)


@pytest.mark.parametrize("rate, order", [(1.5, 2.0), (1.0, 1.0)])
def test_order_and_energy_in_time(rate, order):
    """What a step does is of second order, of first where momentum is lost, and so is what it takes of the energy. The
    books close to rounding with any step.
    """
    z, area = passage()
    law, period = gas_of(z), 0.2
    inner = law.steady_inner(area, given(6e3))
    shape = np.linspace(0.3, 0.0, len(z))

    def area_at(t):
        x = 2 * np.pi * t / period
        return area * (1 + 0.5 * shape * (1 - np.cos(x))), area * np.pi / period * shape * np.sin(x)

    found = []
    for count in (25, 50, 100, 200):
        fluid, state, _ = march(law, area_at, inner, 6e3, 0.5 * period / count, count, rate)
        gained = energy(fluid, area_at(0.5 * period)[0], state.inner) - energy(fluid, area, inner)
        supply, *gone = state.books
        assert abs(gained - supply + sum(gone)) < 1e-12 * supply  # whatever the step
        found.append(np.append(state.inner, state.books / supply))
    gaps = [np.abs(x - found[-1]).max() for x in found[:-1]]
    # against the finest run of four: (1 - 1/64)/(1/16 - 1/64) for second order and (1 - 1/8)/(1/4 - 1/8) for first
    assert gaps[0] / gaps[2] == pytest.approx({2.0: 21.0, 1.0: 7.0}[order], rel=0.3)
    by_step = np.array([x[-2] for x in found])
    assert by_step[:-1] / by_step[1:] == pytest.approx(2.0**order, rel=0.02)
    assert found[-1][-1] == pytest.approx(found[0][-1], rel=0.02)  # what the cells take does not depend on the step


def test_slopes_of_a_step():
    z, area = passage()
    law = gas_of(z)
    fluid, generator = MovingFluid(law, DENSITY), np.random.default_rng(2)
    rate, a = 0.02 * generator.standard_normal(len(z)), area * generator.uniform(-1, 1, len(z))
    for inner in (law.steady_inner(area, given(6e3)), np.zeros(law.inner)):
        state = fluid.moving((area, rate), np.zeros(len(z)), inner, 6e3)
        step = fluid.step(state, None, 1e-3, 1.0, 1.5, -4e3 if not inner.any() else 6e3)
        flow = step.at((area, rate), (area, rate))
        assert (flow.speed.min() < 0) == (not inner.any())  # drawn in, or outwards
        by_area = flow.slopes(0.0)
        expected = difference(lambda x: step.at((x, rate), (x, rate)).pressure, area, a, 1e-4)
        assert np.abs(by_area @ a - expected).max() < 1e-6 * np.abs(expected).max()
        assert np.array_equal(flow.slopes(1e3), by_area)  # mass is differenced: rates of the areas are not asked for


@pytest.mark.slow
def test_a_steady_flow_stays():
    z, area = passage()
    law = gas_of(z, terms=[Line(5.0, None, 0.02, 0.0, 0.5)])
    inner = law.steady_inner(area, given(6e3))
    assert np.abs(law.evaluate(FlowMotion.still(area, inner), given(6e3))[1]).max() < 1e-8
    _, state, _ = march(law, lambda t: (area, np.zeros_like(area)), inner, 6e3, 1e-3, 3)
    assert state.inner == pytest.approx(inner, rel=1e-10)
    assert len(state.packed) == packed_size(law.count, law.inner)
    again = FluidState.unpacked(state.packed)
    assert all(np.array_equal(getattr(again, name), getattr(state, name)) for name in vars(state))


def test_what_lips_draw_in_is_no_faster_than_sound():
    """A low pressure inside draws in rho* c* A of the air at rest outside, within what the loss beyond sound adds."""
    z = np.linspace(0.0, 0.3, 9)
    area = np.linspace(1e-4, 5e-3, 9)
    law = gas_of(z, TINY)
    inner = np.zeros(law.inner)
    inner[law.count :] = -SOUND  # a quarter of the pressure outside, less than the critical one
    inlet = DENSITY * SOUND**2 / RATIO * np.expm1(-RATIO)
    area_at = lambda t: (area, np.zeros_like(area))  # noqa: E731
    fluid, state, _ = march(law, area_at, inner, inlet, 2e-5, 10)
    critical = DENSITY * SOUND * (2 / (RATIO + 1)) ** (0.5 * (RATIO + 1) / (RATIO - 1)) * area[0]
    drawn = -fluid.readings(area, state.inner)[0]
    assert 0.9 * critical < drawn < 1.3 * critical


# -- a liquid that boils

LIQUID, WAVES, BOILS = 1000.0, 1000.0, -100e3


def liquid_of(z) -> GasChannel:
    return GasChannel(Channel(z, TINY, 1.0, reversible=True, density=LIQUID), WAVES, 7.15, BOILS)


def test_a_liquid_that_boils_keeps_its_pressure():
    """dp = rho dw and dp/drho = c^2 in the liquid and where it boils; half of it vapour, its pressure has fallen by
    rho_0 c_v^2/2, 500 Pa here.
    """
    law, given_here = liquid_of(np.linspace(0.0, 0.2, 9)), {**law_values(), "inlet": 0.0}
    limit = float(law.compression(BOILS, given_here))
    for sigma in (0.3 * limit, 5.0 * limit, -0.7 * WAVES):
        thick = LIQUID * np.exp(sigma / WAVES)
        slopes = [float(jax.grad(part)(sigma, given_here)) for part in (law.pressure, law.enthalpy)]
        speed = WAVES if sigma > limit else VAPOUR * WAVES
        assert slopes[0] == pytest.approx(thick * slopes[1], rel=1e-12)
        assert slopes[0] == pytest.approx(thick * speed**2 / WAVES, rel=2e-3)  # liquid: Tait's exponent
    assert float(law.pressure(limit, given_here)) == pytest.approx(BOILS, rel=1e-12)
    assert 0.0 < BOILS - float(law.pressure(-0.7 * WAVES, given_here)) < 0.6 * LIQUID * (VAPOUR * WAVES) ** 2


def test_a_gas_has_no_pressure_below_none():
    """A vapour pressure further below that around the jet than its absolute pressure is met nowhere."""
    z = np.linspace(0.0, 0.2, 9)
    absolute = DENSITY * SOUND**2 / RATIO
    boils = GasChannel(Channel(z, TINY, 1.0, reversible=True, density=DENSITY), SOUND, RATIO, -1.2 * absolute)
    values = boils.values(given(0.0))
    for sigma in (-2.0 * SOUND, 0.0, 0.3 * SOUND):
        for name in ("pressure", "enthalpy"):
            part, plain = getattr(boils, name), getattr(gas_of(z, TINY), name)
            assert float(part(sigma, values)) == pytest.approx(float(plain(sigma, values)), rel=1e-12)
            slope = jax.grad(lambda rho, part=part: part(sigma, {**values, "density": rho}))(DENSITY)
            assert np.isfinite(slope)


def law_values() -> dict[str, float]:
    return {"density": LIQUID, "sound_speed": WAVES, "heat_capacity_ratio": 7.15}


@pytest.mark.slow
def test_column_separation():
    """A valve that is shut in a line of length L (Wylie and Streeter 1993; Bergant, Simpson and Tijsseling 2006): the
    pressure rises by rho c U for 2 L/c, falls to that of the vapour, and the column leaves the valve at a speed that
    each 2 L/c changes by 2 (P_0 - p_v)/(rho c). The cavity's largest volume and the time it closes at are those of the
    closed form.
    """
    length, section, velocity, supply, cells, step = 10.0, 5e-3, 0.5, 200e3, 80, 5e-5
    z = np.concatenate([[0.0, 1e-3], 1e-3 + np.linspace(0.0, length, cells + 1)[1:]])
    law, full = liquid_of(z), np.full(len(z), section)
    outlet = section * velocity / np.sqrt(2 * supply / LIQUID + velocity**2)
    stop, turn = 0.4 * length / WAVES, 2 * length / WAVES

    def area_at(t):
        x, area, rate = min(t / stop, 1.0), full.copy(), 0.0 * full
        area[0] = max(0.5 * outlet * (1.0 + np.cos(np.pi * x)), 1e-13)
        rate[0] = -0.5 * outlet * np.pi / stop * np.sin(np.pi * x) if x < 1 else 0.0
        return area, rate

    given_here = {"inlet": supply, "density": LIQUID}
    fluid = MovingFluid(law, LIQUID)
    state = fluid.moving(area_at(0.0), 0 * full, law.steady_inner(area_at(0.0)[0], given_here), supply)
    limit = np.exp(BOILS / (LIQUID * WAVES**2))
    share, history = section * np.gradient(z[1:]), []
    for i in range(round(2.9 * turn / step)):
        new = area_at((i + 1) * step)
        flow = fluid.step(state, None, step, 1.0, 1.5, supply).at(new, new)
        state = flow.state()
        hollow = np.maximum(1.0 - np.exp(state.inner[law.count :] / WAVES) / limit, 0.0)
        history.append((flow.pressure[1], flow.pressure.min(), np.sum(hollow * share)))
    time = step * np.arange(1, len(history) + 1)
    pressure, lowest, volume = np.array(history).T
    plateau = pressure[(time > 0.4 * turn) & (time < turn)]
    assert plateau == pytest.approx(supply + LIQUID * WAVES * velocity, rel=0.01)
    assert lowest.min() > 1.001 * BOILS
    drop = (supply - BOILS) / (LIQUID * WAVES)
    away, back = velocity - drop, 3 * drop - velocity  # speeds of the column in the second and the third 2 L/c
    assert volume.max() == pytest.approx(away * section * turn, rel=0.03)
    closed = time[np.flatnonzero(volume > 0.01 * volume.max())[-1]]
    assert closed - 0.5 * stop == pytest.approx(2 * turn + away / back * turn, rel=0.03)
