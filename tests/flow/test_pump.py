"""A pump at the far end of the line: its curve, its slope in the linearised flow, the valve of one degree behind it."""

from __future__ import annotations

import jax
import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

from dbvfiv.case.quantity import GRAVITY
from dbvfiv.flow import Channel
from dbvfiv.flow.elastic_line import ElasticLine, LineChannel
from dbvfiv.flow.gas import GasChannel
from dbvfiv.flow.law import FlowMotion
from dbvfiv.flow.stepping import MovingFluid
from dbvfiv.flow.terms.line import Line
from dbvfiv.flow.terms.pump import Pump, with_static_lift
from eigen import CoupledPencil, certified_spectrum, leading_modes
from tests.flow.test_channel import FLOOR, passage
from tests.flow.test_line import DAMPING, INLET, LENGTH, LIP, MASS, STIFFNESS, WIDTH, one_degree
from tests.verification.critical import hopf

DENSITY, SUPPLY = 998.0, 18e3
FLOWS, HEADS = np.array([0.0, 0.02, 0.05, 0.09]), np.array([3.0, 2.8, 1.9, 0.4])


def test_the_curve_is_that_of_scipy_and_goes_on_along_its_tangent():
    pump, known = Pump(FLOWS, HEADS, DENSITY, SUPPLY), PchipInterpolator(FLOWS, HEADS)
    for flow in np.linspace(0.0, 0.09, 37):
        head, slope = float(pump.curve(flow)), float(jax.grad(pump.curve)(flow))
        assert head == pytest.approx(float(known(flow)), rel=1e-13)
        assert slope == pytest.approx(float(known(flow, 1)), rel=1e-11, abs=1e-10)
    assert float(pump.curve(0.1)) == pytest.approx(HEADS[-1] + 0.01 * float(known(0.09, 1)), rel=1e-12)
    assert float(pump.curve(-0.1)) == pytest.approx(HEADS[0] - 0.1 * float(known(0.0, 1)), rel=1e-12)
    assert pump.holds(0.0) and pump.holds(0.09) and not pump.holds(0.0901)


def test_its_slope_stands_beside_the_velocity():
    """The linearised flow is that without a pump, plus rho g dH/dQ 4 A_in in every pressure; steady flow is its own."""
    z, area = passage()
    given, pump, line = {"inlet": SUPPLY, "density": DENSITY}, Pump(FLOWS, HEADS, DENSITY, SUPPLY), Line(7.0, 0.2, 0.02)
    bare, fed = (Channel(z, FLOOR, 0.4, terms=[line, *pumps]) for pumps in ((), (pump,)))
    ours, theirs = (x.linearise_still(area, given) for x in (fed, bare))
    inner = bare.steady_inner(area, given)
    assert fed.inlet_velocity(area, SUPPLY, DENSITY) == inner[0]
    # with a static lift the steady flow at another pressure than the pump's is one in time, too
    lifted = with_static_lift(fed, area, inner, given)
    for own, off in ((lifted, False), (fed, True)):
        pressure, balance = own.evaluate(FlowMotion.still(area, inner), given)
        left = np.append(np.abs(pressure - own.steady_pressure(area, SUPPLY)), np.abs(balance)).max()
        assert (left > 1e-3 * SUPPLY) == off and (off or left < 1e-8 * SUPPLY)
    assert np.allclose(lifted.linearise_still(area, given)["S0"], ours["S0"], rtol=1e-12)
    slope = DENSITY * GRAVITY * float(jax.grad(pump.curve)(4 * area[-1] * inner[0])) * 4 * area[-1]
    assert slope < 0 and ours["S0"] - theirs["S0"] == pytest.approx(slope, rel=1e-10)
    assert ours["B0"][1:] - theirs["B0"][1:] == pytest.approx(np.full((len(area) - 1, 1), slope), rel=1e-9)


def test_other_densities_see_the_pressures_of_the_pump():
    """At unit density, with velocities scaled by the root of it, the law is the same: what families of pencils use."""
    z, area = passage()
    law = Channel(z, FLOOR, 1.0, terms=[Line(7.0, 0.2, 0.02), Pump(FLOWS, HEADS, DENSITY, SUPPLY)])
    own, unit = (law.linearise_still(area, {"inlet": SUPPLY, "density": rho}) for rho in (DENSITY, 1.0))
    root = np.sqrt(DENSITY)
    for name, power in {"A0": 0, "A1": 1, "A2": 2, "B0": 1, "B1": 2, "S0": 1, "S1": 2}.items():
        assert own[name] == pytest.approx(unit[name] * root**power, rel=1e-9, abs=1e-6)


@pytest.mark.parametrize("speed", [None, 500.0])
def test_fluid_at_rest_in_front_of_a_seal_has_the_head_of_no_flow(speed):
    """All of it is the pressure of still fluid, none of it that of moving fluid, which does work on areas alone."""
    z, area = passage()
    area[:3] = 1e-6
    line, pump = Line(7.0, 0.2, 0.02), Pump(FLOWS, HEADS, DENSITY, SUPPLY)
    law, head = Channel(z, FLOOR, 1.0, terms=[line, pump]), DENSITY * GRAVITY * HEADS[0]
    inner = np.zeros(1)
    if speed is not None:
        law = LineChannel(Channel(z, FLOOR, 1.0), law, ElasticLine(line, speed, 3, pump))
        inner = np.append(np.zeros(13), np.full(12, head / DENSITY / (line.section(area[-1])[1] * speed)))
    fluid = MovingFluid(law, DENSITY, lambda area: 2).facing(area, np.zeros(len(z)), SUPPLY)
    pressure, rest = fluid.law.evaluate(FlowMotion.still(area, inner), {"inlet": SUPPLY, "density": DENSITY})
    assert abs(head / SUPPLY - 1) > 0.5 and np.abs(rest).max() < 1e-9 * head
    wanted = pytest.approx(Channel(z, FLOOR).steady_pressure(area, head), abs=1e-5 * head)
    assert pressure == wanted and fluid.still(area, SUPPLY)[0] == wanted


def test_gas_at_rest_in_front_of_a_seal_has_the_enthalpy_of_the_head_of_no_flow():
    z, _ = passage()
    pump, given = Pump(FLOWS, 500.0 * HEADS, 1.2, 2e3), {"inlet": 2e3, "density": 1.2}
    law = GasChannel(Channel(z, FLOOR, 1.0, terms=[Line(7.0, 0.2, 0.02), pump]), 343.0)
    given = law.values(given)
    rest = law.at_seal(np.full(len(z), 0.01), given)["inlet"]
    gained = law.enthalpy(law.compression(rest, given), given) - law.supply(given)[0]
    assert float(gained) == pytest.approx(GRAVITY * 500.0 * HEADS[0] - 2e3 / 1.2, rel=1e-9)
    assert rest > 1.2 * GRAVITY * 500.0 * HEADS[0] * 1.04  # by pressures alone


def plug(face: float, steep: float) -> tuple[CoupledPencil, float, float]:
    """The plug of `tests.flow.test_line` behind a pump of a straight curve, Pa s/m in the velocity; with B and r."""
    line = Line(LENGTH, reservoir=False)
    _, velocity = one_degree(face, line)
    flow, unit = 4 * INLET * velocity, DENSITY * GRAVITY
    flows = np.array([0.5, 1.5]) * flow
    heads = SUPPLY / unit - steep * (flows / (4 * INLET) - velocity) / unit
    pencil, _ = one_degree(face, line, Pump(flows, heads, DENSITY, SUPPLY))
    ratio = INLET / LIP
    rate = (velocity * (ratio**2 - 1.0) + steep / DENSITY) / LENGTH
    return pencil, face * WIDTH * DENSITY * (ratio * velocity) ** 2 / LIP, rate


@pytest.mark.parametrize("steep", [0.0, 2e4, 2e6])
def test_a_steep_pump_changes_the_onset_as_the_closed_form_says(steep):
    """(m s^2 + c s + k)(s + r) = B (s + d): the pump adds its slope to r and to d; with d = 0 the known onset."""
    m, c, k = MASS, DAMPING, STIFFNESS
    lost = steep / DENSITY / LENGTH
    pencil, strength, rate = plug(2e-6, steep)
    roots = np.roots([m, c + m * rate, k + c * rate - strength, k * rate - strength * lost])
    found = leading_modes(pencil, 3).eigenvalues
    for root in roots[roots.imag >= 0]:
        assert np.abs(found - root).min() < 1e-8 * abs(root)
    _, unit, r = plug(1.0, steep)
    # omega^2 = k r - B d over c + m r, and k + c r - B
    onset = (k * r * m - (k + c * r) * (c + m * r)) / (m * lost - (c + m * r))
    omega2 = (k * r - onset * lost) / (c + m * r)
    if omega2 > 0:
        strength, omega = hopf(lambda s: plug(s / unit, steep)[0], 0.1 * onset, 3.0 * onset)
        near = 1e-7 if steep else 1e-8
        assert strength == pytest.approx(onset, rel=near) and omega**2 == pytest.approx(omega2, rel=near)
        if not steep:
            assert onset == pytest.approx(k + c * r - m * k * r / (c + m * r), rel=1e-9)
        assert certified_spectrum(plug(1.01 * onset / unit, steep)[0], 2).unstable_count == 2
        assert certified_spectrum(plug(0.99 * onset / unit, steep)[0], 2).unstable_count == 0
    else:  # the valve diverges first, where the constant of the cubic, k r - B d, vanishes
        static = k * r / lost
        counts = [certified_spectrum(plug(share * static / unit, steep)[0], 2).unstable_count for share in (0.99, 1.01)]
        assert counts == [0, 1]
