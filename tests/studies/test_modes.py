"""Leading modes of a state: right numbers, a verdict that is proven or withheld, refusals in sentences."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
import scipy.linalg as la

import dbvfiv
from dbvfiv.case.parameters import Mu
from dbvfiv.errors import CaseError, JumpError, SolveError
from dbvfiv.model import ValveModel
from dbvfiv.model.dynamics import linearise
from dbvfiv.model.equilibria import LoadPath, rest_state
from dbvfiv.model.residual import ValveResidual
from dbvfiv.observer import Observer
from dbvfiv.studies.case import thesis_case
from dbvfiv.studies.modes import Keys
from dbvfiv.studies.modes import search as modes_search
from dbvfiv.studies.modes.search import critical_damping_factor, run_modes
from dbvfiv.studies.stability.line import ParameterLine
from dbvfiv.studies.stability.verdict import Verdict
from dbvfiv.studies.stability.walk import StabilityWalk
from eigen.pairs import acceptable, all_eigenvalues
from tests.small_valves import SMALL

LIGHT = Mu(density=10.0, alpha=0.0, beta=0.003)
WATER = Mu(density=1000.0, alpha=5.0, beta=0.003)


def test_the_shift_of_a_case_has_its_frequency_in_hertz():
    assert Keys(shift=-5.0, shift_frequency="20 Hz").shifts == (complex(-5.0, 40.0 * np.pi),)
    assert thesis_case().modes.shifts is None


@pytest.fixture(scope="module")
def flutter(model, state):
    return run_modes(model, state, LIGHT)


def test_a_light_fluid_flutters_at_a_small_opening(flutter):
    """One pair to the right, found by both routes, near the thesis's flutter (Th. ch. 7; 36.3 Hz on the fine mesh)."""
    assert flutter.stable is False and flutter.certificate.agrees
    assert flutter.certificate.unstable_count == flutter.certificate.unstable_count_independent == 2
    first = flutter.eigenvalues[0]
    assert first.real > 10 and 33 < first.imag / (2 * np.pi) < 39
    assert (flutter.eigenvalues.real[1:] < 0).all()


@pytest.mark.slow
def test_water_is_damped(model):
    path = LoadPath(model)
    for pressure in (2e3, 6e3, 18e3, 50e3):
        found = run_modes(model, path.go_to(pressure), WATER)
        assert found.stable is True and found.certificate.unstable_count_independent == 0, pressure


def test_sorted_once_each_and_accurate(flutter):
    values = flutter.eigenvalues
    assert (np.diff(values.real) <= 0).all() and (values.imag >= 0).all()
    assert flutter.spectrum.residual.max() < 1e-8
    assert len(set(np.round(values, 6))) == len(values)


def test_against_all_eigenvalues_of_a_small_valve():
    """Dense QZ of the whole first-order pencil on a mesh that allows it, for both continuity laws."""
    for continuity in ("quasi-steady", "storage"):
        small = ValveModel(thesis_case({"mesh.around": 4, "mesh.along": 8, "fluid.continuity": continuity}))
        at = LoadPath(small).go_to(4e3)
        found = run_modes(small, at, LIGHT, Keys(count=4))
        every = la.eigvals(*linearise(small, at.q, 4e3).pencil(LIGHT).first_order())
        every = every[np.isfinite(every) & (every.imag >= -1e-9)]
        leading = every[np.argsort(-every.real)][: len(found.eigenvalues)]
        assert np.allclose(found.eigenvalues, leading, rtol=1e-6), continuity


def test_the_motion_satisfies_the_time_dependent_equations(model, state, flutter):
    """The time-dependent residual along Re(shape exp(lambda t)) vanishes to first order in the amplitude."""
    dofs = model.shell.dofs
    mode = flutter.modes[0]
    value, inlet, q = mode.eigenvalue, mode.inlet_velocity, dofs.restrict(mode.shape)
    steady = model.flow.inlet_velocity(state.station_area, state.pressure, LIGHT.density)

    residual = ValveResidual(model)

    def left(size):
        moved = [size * (value**k * q).real for k in range(3)]
        motion = state.q + moved[0], moved[1], moved[2], steady + size * inlet.real, size * (value * inlet).real
        force, outlet = np.split(residual.value(motion, {"inlet": state.pressure, **LIGHT}), [model.size])
        unit = np.linalg.norm(dofs.matrix(model.mass(state.q)) @ moved[2])
        return np.linalg.norm(force) / unit, abs(outlet[0]) / state.pressure

    (force, outlet), (half_force, half_outlet) = left(1e-6), left(5e-7)
    assert force < 5e-3 and outlet < 1e-5
    assert half_force == pytest.approx(force / 2, rel=0.1) and half_outlet == pytest.approx(outlet / 4, rel=0.1)


def test_pressures_and_areas_belong_to_the_mode(model, state, flutter):
    """Areas by finite difference of the deformed rows; no pressure at the outlet."""
    size = 1e-6
    for mode in flutter.modes:
        shape, areas, pressures = mode.shape, mode.area, mode.pressure
        moved = model.rows.areas(model.nodal(state.q) + size * shape.real) - model.rows.areas(
            model.nodal(state.q) - size * shape.real
        )
        assert np.allclose(moved / (2 * size), areas.real, atol=1e-6 * np.abs(areas).max())
        assert abs(pressures[0]) < 1e-9 * np.abs(pressures).max()


def test_shapes_are_scaled_to_their_largest_displacement(flutter):
    for shape in (mode.shape for mode in flutter.modes):
        phases = np.exp(1j * np.linspace(0, 2 * np.pi, 721))
        reach = max(np.linalg.norm((shape[:, :3] * phase).real, axis=1).max() for phase in phases)
        assert reach == pytest.approx(1.0, abs=1e-6)
        assert np.linalg.norm(shape[:, :3].real, axis=1).max() == pytest.approx(1.0, abs=1e-6)  # at phase zero


@pytest.mark.parametrize("conditions", [LIGHT, WATER])
def test_the_number_asked_for_changes_nothing(model, state, conditions):
    few, many = (run_modes(model, state, conditions, Keys(count=count)).eigenvalues for count in (3, 6))
    assert np.allclose(few, many[: len(few)], rtol=1e-8)


def test_another_shift_gives_the_same(model, state, flutter):
    keys = Keys(count=4, shift=250.0, shift_frequency=75.0 / np.pi)
    assert np.allclose(run_modes(model, state, LIGHT, keys).eigenvalues[:3], flutter.eigenvalues[:3], rtol=1e-8)


def test_in_vacuo_at_rest(model):
    """Undamped modes of the structure come by frequency, have no growth, and damp as beta omega^2 / 2 once damping is
    there.
    """
    rest = rest_state(model)
    free = run_modes(model, rest, Mu(density=1000.0, alpha=0.0, beta=0.0), Keys(count=6, in_vacuo=True))
    omega = free.eigenvalues.imag
    assert (np.diff(omega) > 0).all() and np.abs(free.eigenvalues.real).max() < 1e-6 * omega[0]
    assert 10 < omega[0] / (2 * np.pi) < 18 and free.stable is True
    assert any("stiffness damping" in note for note in free.notes)
    beta = 1e-4
    damped = run_modes(model, rest, Mu(density=1000.0, alpha=0.0, beta=beta), Keys(count=3, in_vacuo=True))
    expected = -beta * omega[:3] ** 2 / 2 + 1j * omega[:3] * np.sqrt(1 - (beta * omega[:3] / 2) ** 2)
    assert np.allclose(damped.eigenvalues, expected, rtol=1e-6)


def test_the_verdict_is_withheld_where_the_counts_disagree(model, state, flutter):
    """A band that leaves the flutter out: nothing unstable is listed, the independent count sees it, and the mode that
    it sees is named as the whole search has it.
    """
    told, listener = [], Observer()
    listener.warn = told.append
    found = run_modes(model, state, LIGHT, Keys(count=3, max_frequency=25.0), listener)
    assert found.certificate.unstable_count == 0 and found.stable is None
    assert told and found.verdict.outcome == "undecided"
    first = flutter.eigenvalues[0]
    assert f"{first.imag / (2 * np.pi):.4g} Hz by {first.real:.3g} 1/s; modes.max_fr" in found.verdict.reason


def test_an_unstable_pair_is_proof(model, state):
    """Without stiffness damping the band holds some of the unstable modes: unstable, though the counts differ."""
    found = run_modes(model, state, Mu(density=10.0, alpha=5.0, beta=0.0), Keys(count=3))
    assert found.certificate.unstable_count > 0 and found.stable is False


@pytest.mark.slow
def test_the_critical_damping_is_sought_among_factors_that_the_materials_reach():
    """Ten times the factor is beyond the branches; from both sides of the critical one it is the same."""
    keys = {f"materials.{name}.loss_factor": 1.0 for name in ("CR", "SBR", "EPDM")}
    keys |= {"materials.strain_level": 0.1, "fluid.density": 10.0, "fluid.continuity": "quasi-steady"}
    critical = {}
    for factor, outcome in ((0.244, "flutters"), (0.3, "stable")):
        valve = dbvfiv.load(None, SMALL | keys | {"drive.pressure": 6e3, "damping.loss_factor": factor})
        verdict = valve.modes().verdict
        assert verdict.outcome == outcome
        critical[outcome] = factor * verdict.critical_damping_factor
    assert 2.0 < valve.model.relaxation.highest(0.244, 2.44) < 2.44
    assert critical["flutters"] == pytest.approx(critical["stable"], rel=1e-3)


@pytest.mark.parametrize(
    "rates, outcome, beta, found",
    [
        (lambda beta: -1.0, "stable", 1e-3, (np.nan, 0.05)),
        (lambda beta: 1.0, "flutters", 1e-3, (np.nan, 10.0)),
        (lambda beta: 0.3e-3 - beta, "stable", 1e-3, (0.3, np.nan)),
        (lambda beta: -1.0, "stable", 0.0, (np.nan, np.nan)),  # nothing to take away
        (lambda beta: -1.0, "flutters", 1e-3, (np.nan, np.nan)),  # another verdict than that of the full matrices
        (lambda beta: np.nan if beta < 0.2e-3 else -1.0, "stable", 1e-3, (np.nan, 0.22361)),
        (lambda beta: jump() if beta == 0.3e-3 else 0.3e-3 - beta, "stable", 1e-3, (np.nan, np.nan)),
    ],
)
def test_damping_that_was_looked_at_is_told_from_damping_that_was_not(monkeypatch, rates, outcome, beta, found):
    assert sought_of(monkeypatch, rates, outcome, beta, True) == pytest.approx(found, rel=1e-4, nan_ok=True)


@pytest.mark.parametrize(
    "holds, ends, found",
    [(20.0, 4.0, (3e-4, np.nan)), (2.0, 1.8, (3e-4, np.nan)), (3.5, 4.0, (np.nan, 3.5)), (1.2, 4.0, (np.nan, 1.2))],
)
def test_the_critical_damping_is_sought_as_far_as_the_rubber_holds(monkeypatch, holds, ends, found):
    """Flutter that ends at factors beyond is not told."""
    told = sought_of(monkeypatch, lambda loss: ends - loss, "flutters", 1.0, True, holds=holds)
    assert told == pytest.approx(found, rel=0.01, nan_ok=True) and not told[1] > holds


@pytest.mark.parametrize("forces, rate, sought", [(0, -1.0, 0.05), (0, 1.0, np.nan), (3, -1.0, np.nan)])
def test_a_wall_that_no_fluid_couples_is_looked_at_with_the_least_damping(monkeypatch, forces, rate, sought):
    found = sought_of(monkeypatch, lambda beta: rate, "stable", 1e-3, False, forces)
    assert found == pytest.approx((np.nan, sought), nan_ok=True)


def jump():
    raise JumpError("The leading mode enters the list.")


def sought_of(monkeypatch, rates, outcome, own, reduced, forces=3, holds=None):
    """Multiples of the damping of a wall whose mode grows by a function of beta; of its loss factor where its rubber
    holds up to one.
    """

    class Line(ParameterLine):
        is_reduced, column = reduced, SimpleNamespace(model=SimpleNamespace())

        def locate(self, crossing, accuracy, scan):
            return SimpleNamespace(value=0.3e-3, residual=0.0 * rates(0.3e-3))

        def spectrum(self, value):
            return np.array(eigenvalues(self.place(value)))

    def eigenvalues(place):
        rate = rates(place.beta or place.loss_factor)
        return [] if np.isnan(rate) else [rate + 30j]

    Line.column.model.eigenvalues = eigenvalues
    monkeypatch.setattr(modes_search, "ParameterLine", Line)
    family = SimpleNamespace(forces=np.zeros((9, forces)))
    model = SimpleNamespace(relaxation=SimpleNamespace(highest=lambda _, most: most))
    walk = SimpleNamespace(case=None, family=lambda _: family, built=lambda _: SimpleNamespace(model=model))
    walk.refusal = lambda place: "unstable" if place.loss_factor > holds else ""
    walk.holding = partial(StabilityWalk.holding, walk)
    place = Mu({"beta" if holds is None else "loss_factor": own}, alpha=5.0)
    return critical_damping_factor(walk, place, Verdict(outcome, ""))


@pytest.mark.slow
def test_the_critical_damping_of_a_mode_beyond_the_list():
    """With less damping the first to flutter is a mode at 250 Hz, which the reduced operator of the lower ones has by
    0.6 % and no search up to their frequencies meets: neutral among all eigenvalues.
    """
    pipes = (
        {"length": 37.12, "diameter": 0.2028},
        {"length": 0.7186, "diameter": 0.5552, "loss": 5.964},
        {"length": 3.790, "diameter": 0.3538, "friction": 0.06356},
    )
    keys = {
        "mesh.around": 6,
        "mesh.along": 8,
        "fluid.density": 305.8,
        "fluid.continuity": "quasi-steady",
        "valve.thickness_factor": 0.8873,
        "upstream.pieces": pipes,
        "drive.at": "line",
        "drive.pressure": 454.5,
        "downstream.pipe_diameter": 0.7397,
        "downstream.length": 3.584,
        "damping.alpha": 0.0,
        "damping.beta": 3.8145e-4,
    }
    valve = dbvfiv.load(thesis_case(), keys)
    factor = valve.modes().verdict.critical_damping_factor
    linear, place = linearise(valve.model, LoadPath(valve.model).go_to(454.5).q, 454.5), Mu.of(valve.case)

    def growth(beta):
        every = all_eigenvalues(linear.pencil(place.at(beta=beta)))
        return every[every.imag > 1.0].real.max()

    beside = [growth(share * factor * place.beta) for share in (0.999, 1.001)]
    assert beside[0] > 0 > beside[1] and max(np.abs(beside)) < 0.5, (factor, beside)
    # a reduced operator that errs by more than the mode grows, and a search that ends below it, certify nothing
    shares = (0.68, 0.76, 0.82, 0.88, 0.94, 0.983, 1.03, 3.02)
    walk = StabilityWalk(valve.case, model=valve.model)
    cells = walk.column([place.at(beta=share * factor * place.beta) for share in shares]).cells
    assert [cell.certificate.stable for cell in cells] == [share > 1 for share in shares]


@pytest.mark.parametrize("density", [1e-3, 2e4])
def test_extreme_densities(model, state, density):
    found = run_modes(model, state, LIGHT.at(density=density))
    spectrum = found.spectrum
    assert found.certificate.agrees and acceptable(spectrum.residual, spectrum.backward_error, 1e-8).all()
    assert all(note.endswith(".") for note in found.notes)


def test_a_uniform_pressure_has_no_fluid(state):
    shut = ValveModel(thesis_case({"mesh.around": 8, "mesh.along": 16, "drive.kind": "uniform"}))
    found = run_modes(shut, LoadPath(shut).go_to(500.0), WATER, Keys(count=2))
    assert np.isnan(found.modes[0].pressure).all() and found.stable is True


def test_refusals(model, state, refused):
    with refused(SolveError) as caught:
        run_modes(model, replace(state, converged=False), LIGHT)
    assert "has not converged" in str(caught.value)
    with refused(SolveError) as caught:
        run_modes(model, replace(state, q=1.01 * state.q), LIGHT)
    assert "no equilibrium of this model" in str(caught.value)
    with pytest.raises(SolveError) as caught:
        run_modes(model, replace(state, q=state.q[:-1]), LIGHT)
    assert "another mesh" in str(caught.value)
    with refused(CaseError):
        run_modes(model, rest_state(model), LIGHT)
