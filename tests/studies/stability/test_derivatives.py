"""Derivatives of eigenvalues, flow, opening, loss and mass against valves that were changed and solved anew."""

import numpy as np
import pytest

from dbvfiv.case.parameters import Mu
from dbvfiv.errors import CaseError, SolveError
from dbvfiv.model import ValveModel, linearise
from dbvfiv.model.equilibria import find_equilibrium
from dbvfiv.model.newton import EquilibriumSolver, NewtonOptions
from dbvfiv.studies.case import load_case, thesis_case
from dbvfiv.studies.stability.derivatives import (
    Neighbourhood,
    Sensitivity,
    _inward,
    changed,
    parameters_of,
    require_number,
)
from eigen import SearchOptions, leading_modes
from tests.small_valves import SMALL

RAYLEIGH = Mu(density=10.0, alpha=1.0, beta=0.003)
NEAR_RAYLEIGH = {"limit_point": -1 / 0.003}
LOSSY = Mu(density=10.0, alpha=1.0, beta=0.0, loss_factor=1.0)
IN_BAND = {"max_frequency": 100.0}
OUTSIDE = {"outside.fluid": "same", "outside.pipe_diameter": "330 mm", "fluid.continuity": "storage"}
MODES = 2


def beside(changes, mu, options):
    model = ValveModel(thesis_case(changes))
    q = find_equilibrium(model, 6e3).q
    found = leading_modes(linearise(model, q, 6e3).pencil(mu), MODES + 1, SearchOptions(left=True, **options))
    return Neighbourhood(model, q, 6e3, mu, [found.mode(i) for i in range(MODES)])


@pytest.fixture(scope="module")
def valve():
    return beside({"mesh.around": 8, "mesh.along": 14}, RAYLEIGH, NEAR_RAYLEIGH)


@pytest.fixture(scope="module")
def lossy():
    changes = {"damping.model": "loss factor", "materials.constants": "stable"}
    return beside({"mesh.around": 8, "mesh.along": 14} | changes, LOSSY, IN_BAND)


@pytest.fixture(scope="module")
def in_water():
    """Water on both sides; the mass of all motions outside is kept, so that nothing is left out of the eigenvalues."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("dbvfiv.model.outside.KEPT", 44)
        yield beside({"mesh.around": 6, "mesh.along": 8} | OUTSIDE, RAYLEIGH.at(density=1e3), NEAR_RAYLEIGH)


def solved(near, name, value, options):
    """Eigenvalues near those of the modes, and the performance, of the valve with one number changed."""
    model, pressure, mu = changed(near.model, near.pressure, near.mu, name, value)
    q = EquilibriumSolver(model, NewtonOptions(tolerance=1e-12)).solve(near.q, pressure).q
    values = leading_modes(linearise(model, q, pressure).pencil(mu), 6, SearchOptions(**options)).eigenvalues
    own = [values[np.argmin(abs(values - mode.eigenvalue))] for mode in near.modes]
    return np.array([*own, *Neighbourhood(model, q, pressure, mu).performance.values()])


def check(near, name, options, accuracy):
    found = near.slope(name)
    unit = abs(found.value) or 1.0
    differences = [
        (solved(near, name, found.value + h, options) - solved(near, name, found.value - h, options)) / (2 * h)
        for h in (1e-3 * unit, 2e-3 * unit)
    ]
    direct = (4 * differences[0] - differences[1]) / 3
    sizes = np.abs([*(mode.eigenvalue for mode in near.modes), *near.performance.values()]) / unit
    slopes = np.array([*found.eigenvalues, *found.performance.values()])
    assert np.all(abs(slopes - direct) <= accuracy * sizes), name


@pytest.mark.parametrize(
    "name",
    [
        *("pressure", "density", "alpha", "beta", "storage", "thickness", "angle", "layer 3 angle"),
        *("layer 1 thickness", "layer 2 c10", "layer 4 e1", "valve.lip_half_width", "valve.wall_map.0.thickness"),
    ],
)
def test_derivatives_are_those_of_changed_valves(valve, name):
    check(valve, name, NEAR_RAYLEIGH, 1e-6)


@pytest.mark.parametrize("name", ["valve.duckbill_length", "valve.saddle_length"])
def test_lengths_move_the_rows_of_the_mesh(valve, name):
    """The law of the rows is piecewise linear, so the mesh moves smoothly but for its small kinks."""
    check(valve, name, NEAR_RAYLEIGH, 1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["loss_factor", "pressure", "density", "thickness", "layer 2 mu_0", "layer 3 angle"])
def test_derivatives_of_a_wall_that_relaxes(lossy, name):
    """Through the change that the equilibrium makes to what relaxes, too."""
    check(lossy, name, IN_BAND, 1e-6)
    assert {"loss_factor", "alpha"} <= set(parameters_of(lossy.model))
    assert "beta" not in parameters_of(lossy.model)


@pytest.mark.parametrize("name", ["pressure", "density", "thickness", "angle"])
def test_derivatives_in_water(in_water, name):
    """The mass of the fluid outside changes with shape, thickness and state; changed valves choose anew which panels
    see each other by exact integrals, which moves their eigenvalues by some 1e-8 of themselves.
    """
    check(in_water, name, NEAR_RAYLEIGH, 3e-5)


def test_a_pipe_around_the_wall_changes_its_modes_alone(in_water):
    """It moves no steady state, and is so near that steps of a thousandth leave differences of 1e-3 of themselves."""
    check(in_water, "outside.pipe_diameter", NEAR_RAYLEIGH, 5e-4)
    found = in_water.slope("outside.pipe_diameter")
    assert abs(found.derivative) > 50 and not any(found.performance.values())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("changes", "name"),
    [
        ({"valve.lip_rise": 0.0133477, "mesh.inertia": "parabolic"}, "valve.lip_half_width"),  # columns on the bend
        ({"downstream.pipe_diameter": 0.4, "downstream.loss": 1.0}, "tail_length"),  # a chamber without length behind
    ],
)
def test_derivatives_of_bowed_lips_and_of_a_discharge(changes, name):
    check(beside({"mesh.around": 6, "mesh.along": 8} | changes, RAYLEIGH, NEAR_RAYLEIGH), name, NEAR_RAYLEIGH, 1e-6)


def test_at_the_end_of_its_range_a_parameter_is_stepped_inward(valve):
    """The strain level of 10 %, below which no rubber was tested."""
    found = valve.slope("strain")
    h = 1e-3
    here, near, far = (solved(valve, "strain", 0.1 + k * h, NEAR_RAYLEIGH)[0] for k in (0, 1, 2))
    assert found.value == 0.1 and found.derivative == pytest.approx((4 * near - 3 * here - far) / (2 * h), rel=1e-3)


@pytest.mark.parametrize(
    ("name", "value", "inward"),
    [
        ("upstream.loss", 0.0, 1),
        ("valve.lip_rise", 0.0, 1),
        ("fluid.separation", 1.0, -1),
        ("fluid.separation", 0.5, 0),
        ("damping.alpha", 0.0, 1),
        ("materials.CR.loss_factor", 2.0, -1),
        ("upstream.length", 0.0, 0),  # no line, and not one of no length
        ("alpha", 0.0, 0),
        ("strain", 0.1, 1),
        ("thickness", 1.0, 0),
    ],
)
def test_keys_end_where_the_case_says(name, value, inward):
    assert _inward(thesis_case(), name, value, 2e-5) == inward


def test_one_sided_differences_of_a_jump_are_none():
    """Differences of a smooth function change little from one step to two; of a jump by a half, of a root by 0.3."""

    def steps(f, h=2e-5):
        return (Sensitivity("loss", 0.0, (f(k * h) / (k * h),), {"flow": 1.0}) for k in (1, 2))

    sizes = np.array([1.0, 1.0])
    alike = [near.is_like(far, sizes) for near, far in map(steps, (lambda x: 3 * x + x**2, lambda x: 1e-3, np.sqrt))]
    assert alike == [True, False, False]


def test_sizes_before_the_scale_are_differentiated_by(valve):
    """A valve at another scale has the same elasticities of its sizes where nothing else has a size."""
    small = Neighbourhood(ValveModel(valve.model.case.replace({"valve.scale": 0.5})), 0.0 * valve.q, 0.0, RAYLEIGH)
    mass = [near.slope("valve.lip_half_width").performance["mass"] for near in (valve, small)]
    assert mass[1] == pytest.approx(mass[0] / 8, rel=1e-6)


def test_the_pressure_has_the_derivatives_of_its_key(valve):
    key, own = valve.slope("drive.pressure"), valve.slope("pressure")
    assert own.derivative != 0 and own.performance["flow"] > 0
    assert (key.value, key.eigenvalues, key.performance) == (own.value, own.eigenvalues, own.performance)


def test_the_flow_goes_with_the_inverse_root_of_the_density():
    """By the parameter, which leaves the model alone, and by the key, with which it is built anew; of a valve held at
    rest.
    """
    model = ValveModel(thesis_case(SMALL))
    near = Neighbourhood(model, np.zeros(model.size), 6e3, Mu.of(model.case))
    for name in ("density", "fluid.density"):
        found = near.slope(name)
        assert found.performance["flow"] * found.value == pytest.approx(-0.5 * near.performance["flow"], rel=1e-6)


def test_only_what_a_valve_has_is_a_parameter(valve):
    assert {"angle", "strain", "storage", "layer 3 angle", "valve.saddle_length"} <= set(parameters_of(valve.model))
    own = {"kind": "neo-hookean", "shear_modulus": "1 MPa", "density": 1200}
    case = valve.model.case.replace({"materials.own": own, "layers": [{"material": "own", "thickness": 0.01}]})
    assert not {"angle", "strain"} & set(parameters_of(ValveModel(case)))


def test_an_unknown_parameter_is_named(valve):
    with pytest.raises(CaseError, match="'colour'.*layer 1 thickness"):
        valve.slope("colour")


def test_an_ogden_rubber_is_differentiated_by_what_it_has_one_of(refused):
    own = {"kind": "ogden", "mu": [0.6e6, -0.01e6], "alpha": [1.3, -2.0], "density": 1300.0}
    changes = {"materials.own": own, "layers": [{"material": "own", "thickness": 0.01}]}
    model = ValveModel(thesis_case(SMALL | changes))
    known = [name for name in parameters_of(model) if name.startswith("layer")]
    assert known == ["layer 1 thickness", "layer 1 angle", "layer 1 density"]
    with refused(CaseError, match="'layer 1 mu', by which nothing of this valve can be differentiated"):
        require_number(model, "layer 1 mu")


def test_a_small_constant_is_stepped_by_a_share_of_the_modulus():
    """A step of 2e-5 Pa beside moduli of 1 MPa gave rounding, one of 0.02 Pa 2 % of it."""
    card = {"kind": "softening", "mu_inf": 3e5, "mu_0": 1e6, "x_0": 0.01, "c": 1e6, "density": 1300.0}
    flows = []
    for own in ({}, {"c_3": 1e3}, {"c_3": 1e5}):
        case = {"materials.CR": card | own, "mesh.around": 6, "mesh.along": 8}
        flows.append(beside(case, RAYLEIGH, NEAR_RAYLEIGH).slope("layer 1 c_3"))
    for one in flows[:2]:
        for name in ("flow", "loss_coefficient"):
            assert one.performance[name] == pytest.approx(flows[2].performance[name], rel=2e-3)
        assert one.eigenvalues == pytest.approx(flows[2].eigenvalues, rel=2e-3)


@pytest.mark.slow
def test_a_wall_that_ends_on_a_joint_has_no_derivative_by_its_end():
    """Central differences of one step were a jump over the step: five times as large with a fifth of it."""
    valve = beside(SMALL, RAYLEIGH, NEAR_RAYLEIGH)
    with pytest.raises(SolveError, match="next to it is another valve"):
        valve.slope("valve.wall_map.0.to")
    assert np.isfinite(valve.slope("valve.wall_map.1.to").growth_rate)


def test_a_rule_between_keys_ends_a_range_as_a_limit_does():
    case = load_case("cases/dbv4-moulded.toml")
    assert _inward(case, "valve.moulded_length", case.valve.duckbill_length, 1e-5) == -1
    assert _inward(case, "valve.moulded_length", 0.9 * case.valve.duckbill_length, 1e-5) == 0
