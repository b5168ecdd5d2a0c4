"""Bills that are moulded shut: the shape without stress, contact at rest, cracking on one curve of equilibria."""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid
from scipy.optimize import brentq

from dbvfiv import load
from dbvfiv.case.parameters import Mu
from dbvfiv.case.quantity import GRAVITY
from dbvfiv.contact import ContactLaw, PlaneContact, tributary_area
from dbvfiv.errors import CaseError, SolveError
from dbvfiv.flow import Channel, FlowMotion
from dbvfiv.model import ValveModel
from dbvfiv.model.build import moulded_share
from dbvfiv.model.classes import linearise_class
from dbvfiv.model.dynamics import linearise
from dbvfiv.model.equilibria import LoadPath, SteadyOptions, first_opening, operating_pressure, sealing_for_cracking
from dbvfiv.model.load_curve import LoadCurve
from dbvfiv.model.newton import EquilibriumSolver, NewtonOptions
from dbvfiv.model.preset import stress_free_shape
from dbvfiv.model.state import parted_width
from dbvfiv.model.symmetry import SYMMETRIES
from dbvfiv.motion import start
from dbvfiv.motion.control import RunOptions
from dbvfiv.motion.start import steady_positions
from dbvfiv.motion.stepper import StepOptions
from dbvfiv.studies.case import load_case, thesis_case
from dbvfiv.studies.stability.derivatives import parameters_of
from dbvfiv.studies.stability.place import design_value, redesigned, require_parameter
from dbvfiv.studies.transient.run import Runner
from eigen import SearchOptions, leading_modes
from tests.systems.pressed import ShellOnPlane
from tests.verification.test_shell_large_displacement import cantilever

#: The 12-inch valve on a mesh that cracks in a second or two.
COARSE = {"mesh.around": 6, "mesh.along": 8, "fluid.continuity": "storage"}
PRESSURE = 800.0


def strip(elements: int, pressure: float):
    """Cantilever of length 10 and bending stiffness 100, and its shape without stress that a pressure flattens."""
    shell, index = cantilever(10.0, elements, planar=True)
    shape = stress_free_shape(shell, np.ones(shell.mesh.element_count), pressure)
    return shell.preset(shape, pressure), shape.nodes[index[:, 0]]


def elastica(pressure: float) -> np.ndarray:
    """Points (k, 2) at even distances of an inextensible strip that an even follower pressure makes flat: there the
    moment is s (L - x)^2/2, so without it the strip has the curvature of that.
    """
    x = np.linspace(0.0, 10.0, 20001)
    turn = cumulative_trapezoid(pressure * (10.0 - x) ** 2 / 200.0, x, initial=0.0)
    return np.stack([cumulative_trapezoid(f(turn), x, initial=0.0) for f in (np.cos, np.sin)], axis=1)


def test_stress_free_shape_is_the_elastica_and_converges_with_the_mesh():
    wanted = elastica(0.4)[-1] * [1.0, -1.0]
    errors = [np.linalg.norm(strip(n, 0.4)[1][-1, [0, 2]] - wanted) for n in (8, 16, 32)]
    assert wanted[1] < -3.0 and errors[1] < 0.01 * abs(wanted[1])
    assert errors[0] > 3.0 * (errors[1] - errors[2]) > 0 and errors[2] < 2e-3 * abs(wanted[1])


@pytest.mark.parametrize("share", [0.2, 0.5, 0.9, 1.1])
def test_strip_against_a_wall_keeps_what_the_fluid_leaves_of_its_pressure(share):
    """A pressure in the strip takes off as much of the even contact pressure, and lifts it off at all of it."""
    sealing = 0.4
    shell, _ = strip(10, sealing)
    area = tributary_area(shell)
    law = ContactLaw(1e11)
    contact = PlaneContact(
        shell, np.arange(len(area)), sealing / 1e11, area, law, axis=2, least_gap=law.gap_at(sealing)
    )
    pressed = ShellOnPlane(shell, contact, 1.0)
    found = EquilibriumSolver(pressed, NewtonOptions(1e-11, 50, "l2")).solve(pressed.rest(), share * sealing)
    state = pressed.contact.state(found.q)
    assert found.converged
    if share > 1:
        assert not state.touching.any() and pressed.nodal(found.q)[-1, 2] > 0
        return
    assert state.pressure == pytest.approx((1 - share) * sealing, abs=1e-6 * sealing)
    assert state.total == pytest.approx((1 - share) * sealing * contact.area.sum(), rel=1e-6)


@pytest.fixture(scope="module")
def model():
    return ValveModel(thesis_case(COARSE | {"valve.sealing_pressure": PRESSURE}))


@pytest.fixture(scope="module")
def path(model):
    return LoadPath(model, SteadyOptions.of(model.case))


def test_faces_press_evenly_at_rest_in_the_shape_that_is_drawn(model):
    state, valve = model.contact.state(model.rest()), model.case.valve
    nodes = model.mesh.nodes[model.contact.nodes]
    inside = (nodes[:, 0] < 0.7 * valve.lip_half_width) & (nodes[:, 2] < 0.7 * valve.moulded_length)
    assert np.count_nonzero(inside) > 5
    assert state.pressure[inside] == pytest.approx(PRESSURE, rel=0.03)
    assert np.abs(model.nodal(model.rest())[:, :3]).max() < valve.initial_gap
    beyond = model.mesh.nodes[:, 1] - model.shell.stress_free.nodes[:, 1]
    assert beyond[model.mesh.centre_line[0]] > 5e-3  # the lips cross without contact


def test_the_curve_of_equilibria_begins_sealed_at_rest(model, path):
    rest = path.go_to(model.flow.back)
    assert rest.is_sealed and rest.stops > 10
    assert rest.q == pytest.approx(model.rest(), abs=1e-9)


def test_faces_that_cross_at_rest_leave_nothing_open(model):
    model.rest()
    crossed = copy(model)
    crossed.__dict__.pop("_film", None)
    crossed.rows = SimpleNamespace(areas=lambda nodal: model.rows.areas(nodal) - 1e-4)
    at_rest = crossed.rows.areas(model.nodal(model.rest()))
    assert at_rest.min() < 0 and not crossed.is_open(at_rest) and crossed.mass_flow(at_rest, PRESSURE) == 0.0
    assert crossed.is_open(at_rest + 1e-3)


def test_overlap_and_force_give_the_pressure_that_they_belong_to(model):
    node = model.mesh.centre_line[0]
    overlap = float(model.mesh.nodes[node, 1] - model.shell.stress_free.nodes[node, 1])
    force = PRESSURE * model.case.valve.moulded_length
    for name, value in (("overlap", overlap), ("sealing_force", force)):
        other = ValveModel(thesis_case(COARSE | {f"valve.{name}": value}))
        assert other.shell.closing_pressure == pytest.approx(PRESSURE, rel=1e-6)


def test_a_shorter_moulded_length_presses_there_only():
    case = thesis_case(COARSE | {"valve.sealing_pressure": PRESSURE, "valve.moulded_length": "80 mm"})
    model = ValveModel(case)
    share = moulded_share(model.mesh, case).reshape(model.mesh.shape[::-1])[:, 0]
    length = np.diff(model.mesh.z)
    assert share @ length == pytest.approx(0.08, rel=1e-12)
    state = model.contact.state(model.rest())
    z = model.mesh.nodes[model.contact.nodes, 2]
    assert np.median(state.pressure[z < 0.04]) == pytest.approx(PRESSURE, rel=0.03)
    assert state.pressure[z > 0.1].max() < 0.3 * PRESSURE


def test_an_overlap_of_zero_is_no_preset():
    plain, zero = (ValveModel(thesis_case(COARSE | more)) for more in ({}, {"valve.overlap": 0.0}))
    assert zero.contact is None and not zero.case.separation and zero.case.valve.initial_gap == 1e-4
    found = [LoadPath(model).go_to(4e3) for model in (plain, zero)]
    assert np.array_equal(found[0].q, found[1].q) and found[0].mass_flow == found[1].mass_flow


@pytest.mark.slow
def test_sealed_below_cracking_and_open_above_whatever_the_order(model, path):
    pressures = (0.6 * PRESSURE, 3.0 * PRESSURE, 2.0 * PRESSURE)
    rising = {p: path.go_to(p) for p in sorted(pressures)}
    other = LoadPath(ValveModel(model.case), SteadyOptions.of(model.case))
    for pressure in (pressures[2], pressures[0]):
        found = other.go_to(pressure)
        assert found.q == pytest.approx(rising[pressure].q, abs=1e-7)
    sealed, most, part = (rising[p] for p in pressures)
    assert sealed.is_sealed and sealed.outlet_velocity == sealed.outlet_area == sealed.volume_flow == 0.0
    assert sealed.stops > 10 and sealed.hydraulics is None and sealed.lip_opening == 0.0
    assert most.mass_flow > part.mass_flow > 0 and most.lip_opening > part.lip_opening
    for state in (most, part):  # one flow at the flange and at the lips
        whole = 4 * model.flow.open_area(state.station_area) * state.station_velocity
        assert whole[[0, -1]] == pytest.approx(np.full(2, state.volume_flow), rel=1e-9)
    cracks = first_opening(model, 2.0)
    assert PRESSURE < cracks < 2.0 * PRESSURE


@pytest.mark.slow
def test_pressure_falls_along_the_passage_and_nowhere_below_that_around_the_jet(model, path):
    """A throat without area does not suck itself shut: what separates behind it recovers nothing."""
    for pressure in (0.6 * PRESSURE, 1.2 * PRESSURE, 3.0 * PRESSURE):
        found = path.go_to(pressure).station_pressure
        assert np.all(np.diff(found) >= -1e-9 * pressure) and found[0] >= -1e-9 * pressure


def test_limit_points_bound_the_pressures_with_several_equilibria(model, path):
    path.go_to(3.0 * PRESSURE)
    limits = path.curve.limits()
    assert len(limits) >= 2 and all(high.pressure > low.pressure for high, low in zip(limits[::2], limits[1::2]))
    high, low = limits[0], limits[1]
    assert high.highest and not low.highest
    assert len(path.curve.passages(0.5 * (high.pressure + low.pressure))) >= 3
    assert len(path.curve.passages(0.5 * PRESSURE)) == 1


class Snap(LoadCurve):
    """The curve P = 3 u - u^3, known at some u, with a limit point at u = 1."""

    def __post_init__(self):
        points = [self.point(u) for u in self.model]
        self.model = SimpleNamespace(flow=SimpleNamespace(back=0.0))
        self._settle = lambda guess, pressure: SimpleNamespace(q=guess)
        self._branch = SimpleNamespace(points=points, values=lambda name: np.array([point.z[-1] for point in points]))

    @staticmethod
    def point(u: float):
        along = np.array([1.0, 3.0 - 3.0 * u**2])
        return SimpleNamespace(z=np.array([u, 3.0 * u - u**3]), tangent=along / np.linalg.norm(along))

    def _tracer(self, ahead=None):
        def root(before, after, function, _):
            return self.point(brentq(lambda u: function(self.point(u)), before.z[0], after.z[0]))

        return SimpleNamespace(root=root)


def test_a_load_rises_over_a_limit_point_only_to_what_lies_behind_it():
    """An opening before the curve turns asks for its own pressure, wherever the curve is known."""
    curve = Snap((0.0, 0.6, 0.95, 1.0001, 1.3), NewtonOptions(), None)
    for u, pressure, within in ((0.9, 1.971, 1e-9), (0.99, 2.97 - 0.99**3, 1e-9), (1.2, 2.0, 0.02)):
        found, q = curve.first(lambda q, u=u: q[0] - u)
        assert q[0] == pytest.approx(u) and found == pytest.approx(pressure, rel=within)


def test_what_is_told_of_a_curve_does_not_depend_on_how_far_it_is_known():
    """Limit points above what is asked were told in a process that had asked for more before."""
    curve = Snap((0.0, 0.6, 0.95, 1.0001, 1.3), NewtonOptions(), None)
    assert curve.limits(1.5) == [] and [limit.highest for limit in curve.limits(2.5)] == [True]
    assert [len(curve.passages(1.8, highest)) for highest in (1.9, 2.5)] == [1, 2]


@pytest.mark.slow
@pytest.mark.parametrize("head", [0.09, 0.35])
def test_cracking_head_that_is_asked_for_is_found(model, head):
    """Heads, m, of the range of the trade. The wall presses no harder than 2.6 kPa, which the search for the largest
    one meets.
    """
    case = model.case.replace({"valve.sealing_pressure": None, "valve.cracking_head": head})
    sealing = sealing_for_cracking(case, 2.0)
    other = ValveModel(model.case.replace({"valve.sealing_pressure": sealing}))
    drive = case.fluid.density * 9.80665 * head
    LoadPath(other, SteadyOptions.of(case)).go_to(1.4 * drive)
    assert first_opening(other, 2.0) == pytest.approx(drive, rel=0.01)


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"valve.overlap": 1e-3, "valve.sealing_pressure": 1e3}, "valve.overlap is 0.001 beside sealing_pressure"),
        ({"valve.overlap": 1e-3, "supports.contact": "stops"}, "supports.contact is 'stops' for a bill"),
        ({"valve.lip_rise": "20 mm", "supports.contact": "stops"}, "is .stops. for lips that are bowed"),
        ({"valve.overlap": 1e-3, "valve.lip_rise": "20 mm"}, "lips that leave a lens"),
        ({"valve.moulded_length": "300 mm"}, "must be at most duckbill_length"),
    ],
)
def test_presets_that_cannot_be_are_refused_in_a_sentence(keys, words):
    with pytest.raises(CaseError, match=words):
        thesis_case(keys)


@pytest.mark.parametrize(
    "keys",
    [
        {"valve.lip_radius": "9 mm", "valve.duckbill_wall_deduction": "6 mm"},
        {"valve.patches": [{"end": "60 mm", "thickness": "6 mm"}]},
        {"valve.wall_map": [{"to": "50 mm", "thickness": "14 mm"}, {"to": "560 mm", "thickness": "12 mm"}]},
    ],
)
def test_a_bill_whose_faces_do_not_touch_as_drawn_is_not_moulded_shut(keys):
    with pytest.raises(CaseError, match=r"touch as drawn, and at z = .* mm these leave .* mm"):
        ValveModel(thesis_case({**COARSE, "valve.sealing_pressure": 800.0, **keys}))


def shut_channel(count: int):
    """Inertia (m, m) of still fluid of 900 kg/m3 between the flange and a seal at 0.1 m, in sections of 20 cm2 that end
    at 0.5 m, stations z, and lengths; a film of 0.1 cm2 is left before the seal.
    """
    z, seal = np.linspace(0.0, 0.5, count + 1), count // 5
    law, area = Channel(z, 1e-9, storage=1.0).shut(seal), np.where(np.arange(len(z)) < seal, 1e-5, 2e-3)
    lengths, given = law.work_lengths(area), {"inlet": 1e3, "density": 900.0}

    def added(**more) -> tuple[np.ndarray, np.ndarray]:
        found = law.linearise_still(area, given | more, np.zeros(1))
        kept = np.linalg.solve(found["S1"], np.hstack([found["R1"], found["R2"]]))  # nothing passes the seal
        return tuple(np.hstack([found["A1"], found["A2"]]) - found["B1"] @ kept), found["B0"]

    (moved, ahead) = added()
    rate, acceleration = np.split(np.array(moved), 2, axis=1)
    assert not rate.any() and not ahead.any() and not acceleration[:seal].any() and not acceleration[:, :seal].any()
    assert not np.any(added(storage=0.0)[0])  # no fluid is displaced under the quasi-steady flow model
    return acceleration, z, lengths


def test_moving_fluid_in_front_of_a_seal_keeps_its_energy():
    """Work of its pressures on areas in any motion is what comes in at the inlet less the kinetic energy gained."""
    random, z = np.random.default_rng(3), np.cumsum(np.append(0.0, np.random.default_rng(2).uniform(0.02, 0.08, 9)))
    area, rate, acceleration = random.uniform(1e-3, 3e-3, 10), *random.normal(0.0, 1e-2, (2, 10))
    law, density = Channel(z, 1e-3, storage=1.0).shut(3), 900.0
    front = np.diff(z)[3:]
    spans = np.concatenate([np.zeros(3), 0.5 * (np.append(front, 0.0) + np.append(0.0, front))])

    def kinetic(time: float) -> float:
        at = area + time * rate + 0.5 * time**2 * acceleration, rate + time * acceleration
        speed = np.asarray(law.speeds_of(*at, np.zeros(1), {"storage": 1.0}))
        return 0.5 * density * np.sum(spans * np.asarray(law.open_area(at[0])) * speed**2)

    speed = np.asarray(law.speeds_of(area, rate, np.zeros(1), {"storage": 1.0}))
    inner = law.with_displaced(area, rate, np.zeros(1))
    motion = FlowMotion(area, rate, acceleration, inner, np.zeros(1))
    pressure, _ = law.evaluate(motion, {"inlet": 1e3, "density": density})
    still, _ = law.evaluate(FlowMotion.still(area, np.zeros(1)), {"inlet": 1e3, "density": density})
    work = law.work_lengths(area) * rate @ (pressure - still)
    entering = 0.5 * density * inner[0] ** 2 * inner[0] * float(law.open_area(area[-1]))
    gained = (kinetic(1e-5) - kinetic(-1e-5)) / 2e-5
    assert not speed[:4].any() and abs(gained) > 1e-9
    assert work == pytest.approx(entering - gained, rel=1e-6)


@pytest.mark.slow
def test_a_fluid_that_hardly_yields_is_one_that_does_not_in_front_of_a_seal():
    """Waves of 100 km/s: eigenvalues to 1e-8."""
    found = []
    for keys in ({}, {"fluid.sound_speed": 1e5}):
        model = ValveModel(thesis_case(COARSE | {"valve.sealing_pressure": PRESSURE, "drive.pressure": 480.0} | keys))
        state = LoadPath(model).go_to(480.0)
        linear = linearise(model, state.q, state.pressure)
        assert linear.seal is not None
        found.append(leading_modes(linear.pencil(Mu.of(model.case)), 4, SearchOptions(max_frequency=60.0)).eigenvalues)
    assert found[1] == pytest.approx(found[0], rel=1e-8)


@pytest.mark.slow
def test_still_fluid_behind_a_seal_is_the_mass_of_what_the_wall_displaces():
    """Sections that widen alike by dA/dt from the seal s on: -rho/(2 a) [(l - s)^2 - (z - s)^2] per acceleration, with
    an energy of rho (l - s)^3/(6 a) (dA/dt)^2 but for the square of a cell; symmetric, so that it feeds no motion.
    """
    count = 20
    acceleration, z, lengths = shut_channel(count)
    widening = np.where(z > 0.1 - 1e-9, 1.0, 0.0)
    wanted = -900.0 / (2 * 2e-3) * (0.4**2 - (z - 0.1) ** 2)
    work = lengths[:, None] * acceleration
    assert work == pytest.approx(work.T, abs=1e-12 * np.abs(work).max())
    assert np.linalg.eigvalsh(work)[-1] <= 1e-12 * np.abs(work).max()
    inside = slice(count // 5 + 1, -1)
    assert (acceleration @ widening)[inside] == pytest.approx(wanted[inside], rel=2.0 / count, abs=1e-2)
    error = -0.5 * widening @ work @ widening / (900.0 * 0.4**3 / (6 * 2e-3)) - 1.0
    assert abs(error) == pytest.approx(0.5 / (0.8 * count) ** 2, rel=0.05)


@pytest.mark.slow
def test_motions_of_a_lightly_pressed_bill_begin_at_rest():
    """Pressures that are small against the wall's stiffness leave more to rounding than a run's start would ask for."""
    case = thesis_case({"mesh.around": 12, "mesh.along": 20, "valve.sealing_pressure": 120.0})
    model, pressure = ValveModel(case), 36.0
    state, q = LoadPath(model).go_to(pressure), steady_positions(model, pressure)
    unbalanced = [float(np.linalg.norm(model.residual(found, pressure))) for found in (state.q, q)]
    assert unbalanced[1] <= min(unbalanced[0], 1.001 * model.rounding(q, model.tangent(q, pressure)))


@pytest.mark.slow
def test_a_curve_of_small_loads_takes_no_shorter_steps_for_rounding():
    """The load's thousandth, which residuals are measured against, is near what rounding leaves on this mesh."""
    keys = {"mesh.around": 12, "mesh.along": 20, "valve.sealing_pressure": 0.02, "fluid.density": 3.0}
    model, pressure = ValveModel(thesis_case(keys)), 1000.0
    path = LoadPath(model)
    state = path.go_to(pressure)
    assert len(path.curve.pressures) < 50
    assert np.linalg.norm(model.residual(state.q, pressure)) < 1e-8 * model.force_scale(state.q, pressure)


@pytest.mark.slow
@pytest.mark.parametrize("sound_speed", [None, pytest.param(343.0, marks=pytest.mark.slow)])
def test_a_curve_begins_at_any_pressure_downstream(model, sound_speed):
    """Also at one greater than the thousandth of the load that residuals are measured against."""
    keys = {"valve.sealing_pressure": 10.0, "downstream.pressure": 14.0, "fluid.density": 1.2}
    backed, free = (
        ValveModel(model.case.replace(keys | {"fluid.sound_speed": sound_speed} | more))
        for more in ({}, {"downstream.pressure": 0.0})
    )
    states = LoadPath(backed).go_to(1014.0), LoadPath(free).go_to(1000.0)
    assert states[0].q == pytest.approx(states[1].q, rel=1e-3, abs=1e-8)


def test_a_bill_that_no_preset_lets_crack_so_early_says_when_it_does(model):
    case = model.case.replace({"valve.sealing_pressure": None, "valve.cracking_head": "1 mm"})
    with pytest.raises(SolveError, match=r"Pressed by no more than .* Pa it takes .* m"):
        sealing_for_cracking(case, 2.0)


def test_forces_in_front_of_a_seal_do_work_on_the_areas(model):
    """Nodes of a row that carry no pressure have their part too."""
    random = np.random.default_rng(5)
    nodal = model.nodal(1e-3 * random.standard_normal(model.size))
    lengths = random.uniform(0.01, 0.1, model.stations)
    wanted = model.rows.jacobian(nodal).T.toarray() * lengths
    np.testing.assert_allclose(model.forces_on_areas(nodal, lengths).toarray(), wanted, rtol=1e-14, atol=0.0)


@pytest.mark.parametrize("storage", [0.0, 1.0])
@pytest.mark.parametrize("symmetry", SYMMETRIES)
def test_a_sealed_bill_is_stable_in_every_class_and_flow_model(model, path, storage, symmetry):
    state = path.go_to(0.6 * PRESSURE)
    linear = linearise_class(model, state.q, state.pressure, SYMMETRIES[symmetry])
    mu = Mu.of(model.case).at(storage=storage, pressure=state.pressure, alpha=0.0, beta=1e-3)
    pencil = linear.pencil(mu)
    found = leading_modes(pencil, 4, SearchOptions())
    assert linear.seal is not None and np.all(found.eigenvalues.real < 0)


def test_contact_holds_up_to_the_amplitude_at_which_the_first_face_parts_or_meets(model, path):
    state = path.go_to(1.6 * PRESSURE)
    shape = np.random.default_rng(1).normal(size=(len(model.mesh.nodes), 5)) * model.shell.dofs.free
    reach = model.contact_reach(state.q, shape)

    def changes(size: float) -> bool:
        both = (model.contact.state(state.q + sign * size * model.shell.dofs.restrict(shape)) for sign in (1, -1))
        return any(np.any(found.touching != model.contact.state(state.q).touching) for found in both)

    assert not changes(0.97 * reach) and changes(1.03 * reach)


@pytest.mark.slow
def test_faces_that_graze_have_a_spectrum_on_either_side(model, path):
    """A state at which a face just parts is named. Held faces raise the frequencies of the structure, and where the
    contact law has no stiffness yet the parted side is the state's own.
    """
    plane, pressures = model.contact, (1.4e3, 2.2e3)

    def room(pressure: float, face: int) -> float:
        return float(model.contact.state(path.go_to(pressure).q).gap[face] - plane.law.rounding)

    at_ends = [model.contact.state(path.go_to(p).q).gap > plane.law.rounding for p in pressures]
    face = int(np.flatnonzero(~at_ends[0] & at_ends[1])[0])
    pressure = float(brentq(room, *pressures, args=(face,), xtol=1e-3))
    told = [
        load(model.case.replace({"modes.in_vacuo": True, "modes.count": 4, "drive.pressure": p, "damping.beta": beta}))
        for p, beta in ((pressure, 0.0), (4e3, 0.0), (pressure, 0.05))
    ]
    graze, away, damped = (valve.modes().summary() for valve in told)
    sides, own = graze["classes"][0]["grazing"], np.array([mode["frequency"] for mode in graze["modes"]])
    assert sides["faces"] >= 1 and any(note.startswith("Grazing: ") for note in graze["notes"])
    parted, held = (np.array([mode["frequency"] for mode in sides[name]]) for name in ("parted", "held"))
    assert parted == pytest.approx(own, rel=1e-3) and np.all(parted <= own * (1 + 1e-9))
    assert np.all(held >= own * (1 - 1e-9)) and np.max(held / own) > 1.001
    assert "grazing" not in away["classes"][0]
    assert damped["modes"] == [] and any("no mode is listed with them parted" in note for note in damped["notes"])


CASES = Path(__file__).parents[2] / "cases"
#: Heads, m, and the cracking heads that the trade promises, psi.
HEADS, CRACKING = np.geomspace(0.02, 5.0, 14), (0.1, 0.5)


@pytest.mark.slow
@pytest.mark.parametrize("size", [4, 12, 36])
def test_cases_of_the_trade_seal_at_rest_and_crack_in_its_range(size):
    """Over heads from 2 cm to 5 m: sealed, then a flow that rises with the head and nowhere faster than its sixth power
    between two open states, which is how fast lips part.
    """
    model = ValveModel(load_case(CASES / f"dbv{size}-moulded.toml").replace({"mesh.around": 10, "mesh.along": 20}))
    path, weight = LoadPath(model, SteadyOptions.of(model.case)), model.case.fluid.density * GRAVITY
    rest = path.go_to(model.flow.back)
    assert rest.is_sealed and rest.stops > 10
    states = [path.go_to(model.flow.back + weight * head) for head in HEADS]
    cracks = first_opening(model, 2.0) - model.flow.back
    assert CRACKING[0] < cracks / 6894.76 < CRACKING[1]
    flow = np.array([state.mass_flow for state in states])
    open_ = flow > 0
    assert not flow[weight * HEADS < 0.85 * cracks].any() and np.all(open_[weight * HEADS > cracks])
    rise = np.diff(np.log(flow[open_])) / np.diff(np.log(HEADS[open_]))
    assert np.all(rise > 0) and np.all(rise[1:] < 6.0)
    assert all(state.outlet_velocity == 0.0 for state, flows in zip(states, open_) if not flows)


@pytest.mark.slow
@pytest.mark.random
@pytest.mark.parametrize("seed", range(300))
def test_random_presets_open_without_a_jump_in_flow_that_no_limit_point_explains(seed):
    """Random bills and heads: states that are found are sealed or open, the flow rises with the head, and a sealed
    bill is stable; what is not found is said in a sentence.
    """
    random = np.random.default_rng(seed)
    keys = {
        "valve.sealing_pressure": float(10 ** random.uniform(2.0, 3.6)),
        "valve.moulded_length": float(random.uniform(0.08, 0.21)),
        "valve.thickness_factor": float(random.uniform(0.8, 1.3)),
        "fluid.continuity": str(random.choice(["storage", "quasi-steady"])),
    }
    try:
        model = ValveModel(thesis_case(COARSE | keys))
    except SolveError as error:  # too soft for such a preset
        assert str(error).endswith(".")
        return
    path = LoadPath(model, SteadyOptions.of(model.case))
    flows = []
    for pressure in np.sort(10 ** random.uniform(2.0, 4.3, 6)):
        try:
            state = path.go_to(float(pressure))
        except SolveError as error:
            assert str(error).endswith(".")
            break
        flows.append(state.mass_flow)
        if state.is_sealed:
            linear = linearise_class(model, state.q, state.pressure, next(iter(SYMMETRIES.values())))
            mu = Mu.of(model.case).at(pressure=state.pressure, beta=1e-3)
            assert np.all(leading_modes(linear.pencil(mu), 3, SearchOptions()).eigenvalues.real < 0)
    assert flows and np.all(np.diff(flows) >= 0)


def test_back_pressure_starts_from_the_faces_that_press_on_each_other():
    """The work of the back pressure is what the wall and its contact store."""
    valve = load(thesis_case(COARSE | {"valve.sealing_pressure": PRESSURE, "closure.rated_pressure": "2 kPa"}))
    (state,) = valve.closure(pressure=2e3).states
    assert state.closed and state.energy_balance < 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("size", [6, 18])
def test_faces_of_few_elements_press_on_each_other_before_the_back_pressure(size):
    """Contact as hard as the back pressure asks for is not met from the drawn shape on most such meshes."""
    keys = {"mesh.around": 5, "mesh.along": 10, "closure.pressures": [28e3], "closure.arclength": False}
    (state,) = load(load_case(CASES / f"dbv{size}-moulded.toml").replace(keys)).closure().states
    assert state.closed and state.energy_balance < 1e-3


def test_a_run_from_rest_begins_without_a_velocity(model, monkeypatch):
    monkeypatch.setattr(start, "consistent_state", lambda motion, time, q, v, *_: (q, v))
    (q, v), *_ = start.first_state(SimpleNamespace(model=model), model.case, 0.0, None)
    assert model.case.transient.start == "rest" and q.any() and not v.any()


def test_sealing_pressure_is_a_parameter_of_a_bill_that_is_moulded_shut_alone(model):
    assert "sealing" in parameters_of(model) and "sealing" not in parameters_of(ValveModel(thesis_case(COARSE)))
    assert redesigned(model.case, {"sealing": 5e2}).valve.sealing_pressure == 5e2
    by_force = load_case(CASES / "dbv36-moulded.toml")  # 945 N/m
    require_parameter(by_force, "sealing")
    assert design_value(by_force, "sealing") == pytest.approx(1500.0)
    by_overlap = thesis_case(COARSE | {"valve.overlap": "1 mm"})
    require_parameter(by_overlap, "sealing")
    assert design_value(by_overlap, "sealing") is None
    assert redesigned(by_overlap, {"sealing": 5e2}).valve.overlap is None


def test_a_pump_whose_curve_meets_a_jump_of_the_flow_has_no_operating_point(monkeypatch):
    keys = {"upstream.length": 5.0, "upstream.pump": [[0.0, 0.3], [2e-3, 0.1]]}
    model = ValveModel(thesis_case(COARSE | keys))
    jump = lambda _, pressure: SimpleNamespace(volume_flow=0.0 if pressure < 2e3 else 1.5e-3)  # noqa: E731
    monkeypatch.setattr(LoadPath, "go_to", jump)
    with pytest.raises(SolveError, match="at 2000 Pa the valve's flow jumps from 0 to 1.5 L/s"):
        operating_pressure(model)


def test_a_pump_is_asked_from_the_pressure_behind_it_on(monkeypatch):
    """A valve that takes 1 L/s for each kPa over the 5 m behind it: 12 m - 2 m for each L/s meet it in between."""
    keys = {"upstream.length": 5.0, "upstream.pump": [[0.0, 12.0], [4e-3, 4.0]], "downstream.pressure": "5 m"}
    model = ValveModel(thesis_case(COARSE | keys))
    back = model.flow.back

    def go_to(_, pressure):
        assert pressure > back
        return SimpleNamespace(volume_flow=1e-6 * (pressure - back))

    monkeypatch.setattr(LoadPath, "go_to", go_to)
    unit = 1000.0 * GRAVITY
    assert back == pytest.approx(5.0 * unit)
    assert operating_pressure(model) == pytest.approx(back + 7.0 * unit / (1.0 + 2e-3 * unit), rel=1e-9)
    monkeypatch.setattr(LoadPath, "go_to", lambda *_: SimpleNamespace(volume_flow=0.0))  # a bill that stays sealed
    assert operating_pressure(model) == pytest.approx(12.0 * unit, rel=1e-12)
    with pytest.raises(SolveError, match="does not overcome"):
        operating_pressure(ValveModel(model.case.replace({"downstream.pressure": "13 m"})))


def test_lips_that_are_pressed_across_each_other_are_shut(model):
    area = model.rows.areas(model.nodal(model.rest()))
    assert model.is_open(area + 1e-3)
    for least in (0.0, -1e-6):
        pressed = np.where(area == area.min(), least, area)
        assert not model.is_open(pressed) and model.seal(pressed) is not None


@pytest.mark.parametrize("begin", [0.0, -1.0])
def test_the_middle_of_the_lips_parts_as_wide_on_a_half_as_on_a_quarter(begin):
    x = np.linspace(begin, 1.0, 5 if begin == 0.0 else 9)
    nodes = np.stack([x, 0.0 * x, 0.0 * x], axis=1)
    touching = {"rest": np.ones(len(x), bool), "now": x != 0.0}
    contact = SimpleNamespace(
        nodes=np.arange(len(x)), count=len(x), state=lambda q: SimpleNamespace(touching=touching[q])
    )
    mesh = SimpleNamespace(rows=np.arange(len(x))[None], nodes=nodes, part=SimpleNamespace(is_quarter=begin == 0.0))
    model = SimpleNamespace(mesh=mesh, contact=contact, rest=lambda: "rest")
    assert parted_width(model, "now") == pytest.approx((0.25, 2.0))


@pytest.mark.slow
def test_energy_closes_on_a_smooth_run_through_cracking(tmp_path):
    """Half a second from a sealed bill to one that is open, in water that the wall displaces; the faces keep some. The
    step in which faces part or meet has the law before it, so that one halving does not tell an order: steps of 10, 5,
    2.5 and 1.25 ms leave 6.5e-6, 2.0e-6, 8.9e-7 and 1.8e-7 of the work.
    """
    share, off = np.linspace(0.0, 1.0, 101), []
    table = tmp_path / "rise.csv"
    rows = zip(0.5 * share, 1e3 + 600.0 * (1.0 - np.cos(np.pi * share)))
    table.write_text("time [s], pressure [Pa]\n" + "".join(f"{t:.9g}, {p:.12g}\n" for t, p in rows))
    for count in (100, 400):
        keys = {"transient.start": "steady", "transient.duration": 0.6, "transient.drive_table": str(table)}
        keys |= {"transient.step": 0.5 / count, "damping.alpha": 5.0, "damping.beta": 1e-3}
        model = ValveModel(thesis_case(COARSE | keys | {"valve.sealing_pressure": PRESSURE}))
        options = replace(RunOptions.of(model.case), step=StepOptions(tolerance=1e-8, floor=1e-13))
        h = Runner(model, options).start().history
        assert h["stops"][0] == 10 and h["stops"][-1] == 0 and h["contact_loss"][-1] > 0
        off.append(np.abs(h["balance"]).max() / h["pressure_work"].max())
    assert off[1] < 3e-7 and 8.0 < off[0] / off[1] < 16.0


@pytest.mark.slow
@pytest.mark.parametrize("rise, step, duration", [(0.4, 2.5e-3, 4.0), (1e-4, 5e-4, 1.6)])
def test_a_bill_opens_by_a_slow_and_a_sudden_head_and_is_closed_after_it(tmp_path, rise, step, duration):
    """It opens above its cracking pressure and not before, and shuts again without chatter. A blow fills the bill first
    and throws its lips apart then, which steps of 2.5 ms do not resolve: 14 mm in place of 6. What is caught behind the
    lips leaves through the film until 1.23 s; then the sealed bill rings.
    """
    table = tmp_path / "head.csv"
    table.write_text(f"time [s], pressure [Pa]\n0, 300\n{rise}, 2200\n0.6, 2200\n{0.6 + 0.5 * rise}, 300\n")
    keys = {"transient.start": "steady", "transient.duration": duration, "transient.step": step, "damping.alpha": 5.0}
    keys |= {"damping.beta": 1e-3, "transient.drive_table": str(table), "valve.sealing_pressure": PRESSURE}
    run = Runner(ValveModel(thesis_case(COARSE | keys))).start()
    h = run.history
    open_ = h["lip_opening"] > 1e-4
    first, last = (h["time"][np.flatnonzero(open_)[i]] for i in (0, -1))
    assert h["inlet_pressure"][open_][0] > 1500.0 and 0.6 < last < 1.0
    assert (first > 0.3) == (rise > 0.3) and 3e-3 < h["lip_opening"].max() < 8e-3
    shut = run.verdict.name == "closed" and run.verdict.decided
    assert not run.verdict.chatter and (shut if rise > 0.3 else not h["mass_flow"][h["time"] > 1.3].any())
    assert np.abs(h["balance"]).max() < 2e-4 * h["pressure_work"].max()


def test_a_sealed_bill_makes_no_waves_under_a_load_without_a_fluid(model):
    bare = ValveModel(model.case.replace({"drive.kind": "uniform", "drive.pressure": 0.6 * PRESSURE}))
    linear = linearise(bare, bare.rest(), 0.6 * PRESSURE)
    assert linear.seal is not None and linear.resolved(Mu.of(bare.case)) == np.inf


@pytest.mark.slow
@pytest.mark.parametrize(
    "law",
    [
        {"fluid.continuity": "quasi-steady"},
        *(pytest.param(x, marks=pytest.mark.slow) for x in ({}, {"fluid.unsteady": False})),
    ],
)
def test_a_sealed_bill_is_closed_in_time_and_moves_no_further(law):
    """At 0.6 of the sealing pressure; the film that rough faces leave burst it open within 8 ms when it carried a flow,
    quasi-steady.
    """
    keys = {"transient.start": "steady", "transient.duration": 0.04, "transient.step": 2e-3, "drive.pressure": 480.0}
    keys |= {"valve.sealing_pressure": PRESSURE}
    result = load(thesis_case(COARSE | keys | law)).transient()
    assert result.summary()["verdict"] == "closed" and not result.history["mass_flow"].any()
    assert np.ptp(result.history["lip_displacement"]) < 1e-7


@pytest.mark.slow
def test_a_bill_chatters_behind_a_pump_that_gives_less_than_the_smallest_opening_takes():
    """From rest: the fluid in front of the seal is still until the faces part, which then meet again and again.

    In 0.2 s they meet 8 times since the still fluid has the head of the pump at zero flow (more than 10 times before):
    too few to judge. They do 23 times in 0.4 s and 53 times in 0.8 s, the later half at 61 and 74 Hz.
    """
    keys = {"upstream.pump": [[0.0, 0.5], [5e-4, 0.3], [4e-3, 0.0]], "fluid.continuity": "quasi-steady"}
    keys |= {"outside.fluid": "none", "outside.pipe_diameter": None, "transient.duration": 0.4}
    run = load(load_case(CASES / "dbv12-moulded.toml").replace(COARSE | keys)).transient()
    found, flow = run.summary(), run.history["mass_flow"]
    assert found["verdict"] == "chatters" and found["decided"]
    assert found["chatter"]["shuttings"] > 10 and found["chatter"]["impact_speed"] > 0.1
    assert not flow[:3].any() and flow.max() > 0.3
