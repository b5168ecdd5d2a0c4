"""Friction in the passage: parallel faces, slow and fast, a squeezed film, the steady flow and its derivatives."""

from __future__ import annotations

import numpy as np
import pytest

from dbvfiv.case.parameters import Mu
from dbvfiv.errors import CaseError
from dbvfiv.flow import Channel, FlowMotion
from dbvfiv.flow.terms.gap_friction import MEETING, GapFriction
from dbvfiv.model import ValveModel, linearise
from dbvfiv.model.equilibria import LoadPath
from dbvfiv.studies.case import thesis_case
from dbvfiv.studies.stability.place import is_surrounding
from dbvfiv.studies.stability.walk import StabilityWalk
from eigen import leading_modes
from tests.differences import difference
from tests.flow.test_channel import FLOOR, passage
from tests.flow.test_plug import swaying

#: Parallel faces: width, height, length, m; 21 stations.
WIDTH, HEIGHT, LENGTH = 0.2, 1e-3, 0.3
Z = np.linspace(0.0, LENGTH, 21)


def parallel(
    viscosity: float, height=HEIGHT, storage: float = 0.0, unsteady: bool = True
) -> tuple[Channel, np.ndarray]:
    """A quarter of a gap between parallel faces, and its areas."""
    perimeter = np.full(len(Z), WIDTH / 2)
    terms = (GapFriction(viscosity),)
    area = np.full(len(Z), WIDTH / 2 * height / 2)
    return Channel(Z, 1e-10, storage, terms=terms, perimeter=perimeter, density=1000.0), area


def test_plane_poiseuille_flow():
    """dp/ds = 12 mu U/h^2."""
    law, area = parallel(1.0)
    given = {"inlet": 2e3, "density": 1000.0}
    velocity = law.steady_inner(area, given)[0]
    assert velocity == pytest.approx(2e3 * HEIGHT**2 / (12 * 1.0 * LENGTH), rel=1e-6)
    assert law.steady_pressure(area, 2e3) == pytest.approx(2e3 * Z / LENGTH, rel=1e-6, abs=1e-6)


@pytest.mark.parametrize("bulk, mean", [(10935, 18.62), (125000, 24.1)])
def test_turbulent_channel(bulk, mean):
    """Dean's law, and within 6 per cent computed channels without a model (Moser, Kim & Mansour 1999 at Re_tau 587, Lee
    & Moser 2015 at 5186): bulk velocity over friction velocity at Reynolds numbers by half the height.
    """
    viscosity, height, reynolds = 1e-3, 0.02, 2.0 * bulk
    law, area = parallel(viscosity, height)
    velocity = reynolds * viscosity / (1000.0 * height)
    stress = 0.073 * reynolds**-0.25 * 0.5 * 1000.0 * velocity**2
    drop = 2 * stress / height * LENGTH
    assert law.steady_inner(area, {"inlet": drop, "density": 1000.0})[0] == pytest.approx(velocity, rel=1e-4)
    assert stress == pytest.approx(1000.0 * (velocity / mean) ** 2, rel=0.06)


def test_where_laminar_and_turbulent_flow_meet():
    term = GapFriction(1e-3)
    speed = MEETING * 1e-6 / 0.02
    laminar = 48 * 1e-6 * speed / 0.02**2
    assert float(term.gradient(speed, 0.02, 1e-6)) == pytest.approx(2**0.125 * laminar)
    assert float(term.gradient(-speed, 0.02, 1e-6)) == pytest.approx(-(2**0.125) * laminar)
    assert MEETING == pytest.approx(1800, rel=0.01)


def test_a_squeezed_film():
    """Faces that close on a fluid that can leave at one end only: p = 6 mu (-dh/dt) (L^2 - s^2)/h^3 (Reynolds)."""
    law, area = parallel(0.5, storage=1.0)
    closing = -1e-4
    rate = np.full(len(Z), WIDTH / 2 * closing / 2)
    motion = FlowMotion(area, rate, np.zeros(len(Z)), np.zeros(1), np.zeros(1))
    given = {"inlet": 0.0, "density": 1e-6}
    pressure, residual = law.evaluate(motion, given)
    inlet = -residual[0]  # the pressure at the shut end with which that at the open one vanishes
    s = LENGTH - Z
    expected = 6 * 0.5 * -closing * (LENGTH**2 - s**2) / HEIGHT**3
    assert inlet == pytest.approx(expected[-1], rel=1e-8)
    assert pressure[1:] + inlet == pytest.approx(expected[1:], rel=1e-8, abs=1e-6 * inlet)


def valve_like(viscosity: float = 3e-3, **others) -> tuple[Channel, np.ndarray]:
    """A channel of the shape of a valve's passage, of a thick fluid."""
    z, area = passage()
    return Channel(z, FLOOR, terms=(GapFriction(viscosity),), perimeter=np.full(len(z), 0.2), **others), area


@pytest.mark.slow
def test_derivatives_of_the_steady_flow():
    law, area = valve_like(3.0, density=850.0)
    direction = area * np.random.default_rng(2).standard_normal(len(area))
    pressure, slope = law.steady_operator(area, 18e3)
    plain = Channel(law.z, FLOOR).steady_pressure(area, 18e3)
    assert np.abs(pressure - plain).max() > 0.05 * 18e3  # friction matters here
    other = difference(lambda a: law.steady_pressure(a, 18e3), area, direction, 1e-3)
    assert np.abs(slope @ direction - other).max() < 1e-8 * np.abs(other).max()
    by_inlet = (law.steady_pressure(area, 18.01e3) - law.steady_pressure(area, 17.99e3)) / 20.0
    assert law.steady_slope(area, 18e3) == pytest.approx(by_inlet, rel=1e-5, abs=1e-9)


def test_no_pressure_no_flow_and_a_passage_nearly_shut():
    law, area = valve_like()
    assert law.steady_inner(area, {"inlet": 0.0, "density": 850.0}) == pytest.approx(0.0, abs=1e-12)
    assert law.steady_pressure(area, 0.0) == pytest.approx(0.0, abs=1e-9)
    shut = np.concatenate([[-3 * FLOOR, -FLOOR], area[2:]])
    found = law.steady_pressure(shut, 18e3)
    assert np.isfinite(found).all() and found[0] == 0.0 and found[-1] == pytest.approx(18e3)
    assert law.steady_inner(shut, {"inlet": 18e3, "density": 850.0})[0] > 0.0


def test_unit_density_has_the_same_pressures():
    """Speeds larger by the root of the density, viscosity smaller by it."""
    law, area = valve_like(density=850.0)
    inner = law.steady_inner(area, {"inlet": 18e3, "density": 850.0})
    scaled = law.steady_inner(area, {"inlet": 18e3, "density": 1.0} | law.at_unit_density())
    assert scaled == pytest.approx(np.sqrt(850.0) * inner, rel=1e-12)


@pytest.mark.parametrize("given", ["treacle", 0, -1e-3, "1 kPa", True, 11.0, "1e-6 m^2/s"])
def test_bad_viscosities(given):
    with pytest.raises(CaseError, match=r"fluid\.viscosity is given as .* must be"):
        thesis_case({"fluid.viscosity": given})


@pytest.mark.parametrize("given, value", [("none", 0.0), ("water", 1.0016e-3), ("2 mPa s", 2e-3), (0.1, 0.1)])
def test_viscosities(given, value):
    assert thesis_case({"fluid.viscosity": given}).fluid.dynamic_viscosity == pytest.approx(value)


COARSE = {"mesh.around": 8, "mesh.along": 14}


@pytest.mark.slow
def test_wide_openings_lose_little_and_gaps_nearly_all():
    """Friction takes a hundredth of the flow at 18 kPa, and most of it at 100 Pa, through gaps of some hundredths of a
    millimetre; a vanishing viscosity takes nothing.
    """
    flows = {}
    for viscosity in ("none", "water", 1e-9):
        model = ValveModel(thesis_case(COARSE | {"fluid.viscosity": viscosity}))
        path = LoadPath(model)
        flows[viscosity] = [path.go_to(pressure).mass_flow for pressure in (100.0, 18e3)]
    plain, water, thin = (np.array(flows[name]) for name in ("none", "water", 1e-9))
    assert 0.97 < water[1] / plain[1] < 0.995
    assert water[0] < 0.2 * plain[0]
    assert thin[1] == pytest.approx(plain[1], rel=1e-3)


def test_cells_of_a_column_are_those_of_the_full_pencil():
    """Columns know fluids of unit density only. The density moves the steady state, so no study keeps it for others."""
    case = thesis_case(COARSE | {"fluid.viscosity": "water", "fluid.continuity": "storage", "drive.pressure": 600.0})
    assert not is_surrounding(case, "density") and is_surrounding(thesis_case(), "density")
    walk, place = StabilityWalk(case), Mu.of(case).at(density=900.0)
    betas = (1e-3, 2e-3, 3e-3, 5e-3)
    column = walk.column([place.at(beta=beta) for beta in betas])
    assert not column.how.any()
    model = ValveModel(case.replace({"fluid.density": 900.0}))
    linear = linearise(model, LoadPath(model).go_to(600.0).q, 600.0)
    for i, beta in enumerate(betas):
        found = leading_modes(linear.pencil(Mu(density=900.0, alpha=place.alpha, beta=beta)), 2).eigenvalues[0]
        assert column.leading[i].real == pytest.approx(found.real, rel=1e-6)
        assert column.leading[i].imag == pytest.approx(abs(found.imag), rel=1e-6, abs=1e-6)


def test_a_thick_fluid_of_unit_density_sways_as_the_own_one():
    """Parts of a column are those at density 1 times powers of the root of the density."""
    law, area = valve_like(3.0, density=1000.0)
    sway = swaying(law, law.z, area, 18e3)
    own, unit = (sway.fluid_parts(given) for given in ({"density": 1000.0}, {"density": 1.0} | law.at_unit_density()))
    plain = swaying(Channel(law.z, FLOOR), law.z, area, 18e3).fluid_parts({"density": 1000.0})
    assert np.abs(own["A0"]).max() < 0.9 * np.abs(plain["A0"]).max()  # friction matters here
    for power, name in enumerate(("A0", "A1", "A2")):
        size = np.abs(own[name]).max()
        assert np.sqrt(1000.0) ** power * unit[name] == pytest.approx(own[name], rel=1e-9, abs=1e-9 * size)
