"""Buckling under outside pressure: the ring's closed forms, and a snapping arch followed past its limit points."""

from __future__ import annotations

from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from dbvfiv.errors import SolveError
from dbvfiv.model.load_curve import LoadCurve
from dbvfiv.model.load_steps import LoadStepOptions, LoadSteps
from dbvfiv.model.newton import NewtonOptions
from dbvfiv.observer import Observer
from dbvfiv.shell import Shell, ShellMesh
from dbvfiv.studies.closure.buckling import BucklingWatch, follow_past_limits, stiffness_spectrum
from tests.shell.structures import grid, isotropic_section
from tests.systems.pressed import ShellOnPlane

E, NU, RADIUS, WALL, WIDTH = 5e6, 0.3, 0.1, 1e-3, 0.02
#: Bending stiffness of a strip that cannot strain along the axis.
EI = E / (1 - NU**2) * WALL**3 / 12


def _ring(elements: int, radius: float = RADIUS) -> ShellOnPlane:
    """Quarter of a long cylinder, symmetric about two planes, without strain along its axis: it may ovalise."""
    place = lambda u, v: (radius * np.sin(0.5 * np.pi * u), radius * np.cos(0.5 * np.pi * u), -WIDTH * v)  # noqa: E731
    patch = grid(elements, 1, place)
    planes = [(patch.index[0], 0), (patch.index[-1], 1)]
    mesh = ShellMesh.build(patch.nodes, patch.quads, WALL, planes=planes)
    assert mesh.directors[0] == pytest.approx([0, 1, 0])  # outwards, so that the pressure of sign -1 acts from outside
    free = np.ones((mesh.node_count, 5), bool)
    free[:, [2, 3]] = False  # the first rotation turns the director along the axis
    free[np.ix_(patch.index[0], [0, 4])] = False
    free[np.ix_(patch.index[-1], [1, 4])] = False
    return ShellOnPlane(Shell(mesh, isotropic_section(E, NU, WALL), free))


def _options(step=np.inf) -> LoadStepOptions:
    return LoadStepOptions(NewtonOptions(1e-9, 30), 1e-8, max_step=step)


@cache
def _critical(elements: int) -> tuple[float, ShellOnPlane, object]:
    model = _ring(elements)
    watch = BucklingWatch(model, _options(), lambda q, p: stiffness_spectrum(model, q, p, 3))
    steps = LoadSteps(model, _options(), accepted=watch.see)
    for p in np.array([0.5, 2.5, 2.9, 3.2]) * EI / RADIUS**3:
        steps.reach(p)
    assert len(watch.found) == 1
    return watch.found[0].pressure * RADIUS**3 / EI, model, watch.found[0]


def test_a_ring_under_outside_follower_pressure_buckles_at_three_ei_over_r_cubed():
    values = [_critical(n)[0] for n in (16, 32, 64)]
    errors = np.abs(np.array(values) - 3.0)
    assert values == pytest.approx([3.0154, 3.0036, 3.0006], abs=1e-4)  # docs/evidence/closure.md
    assert np.all(errors[1:] < 0.35 * errors[:-1]), values
    _, model, found = _critical(16)
    shape = model.nodal(found.shape)[:, :3]
    angle = np.arctan2(model.mesh.nodes[:, 0], model.mesh.nodes[:, 1])
    radial = np.einsum("ni,ni->n", shape, model.mesh.directors)
    assert found.kind == "bifurcation"
    assert abs(np.corrcoef(radial, np.cos(2 * angle))[0, 1]) > 0.9999


def test_the_pressure_of_a_closed_ring_has_a_potential():
    """Nothing of the loaded surface ends freely, so the tangent is symmetric and both lowest eigenvalues are one."""
    _, model, found = _critical(16)
    spectrum = stiffness_spectrum(model, found.q, 0.9 * found.pressure, 3)
    assert spectrum.asymmetry < 1e-12
    assert spectrum.symmetric_values == pytest.approx(spectrum.values.real, rel=1e-6)
    assert np.abs(spectrum.values.imag).max() == 0.0


def _arch(elements: int = 24, radius=0.5, angle=0.5, wall=0.01) -> ShellOnPlane:
    """Half of a shallow arch clamped at its end, symmetric about its crown."""
    place = lambda u, v: (radius * np.sin(angle * u), radius * np.cos(angle * u), -WIDTH * v)  # noqa: E731
    patch = grid(elements, 1, place)
    mesh = ShellMesh.build(patch.nodes, patch.quads, wall, planes=[(patch.index[0], 0)])
    free = np.ones((mesh.node_count, 5), bool)
    free[:, [2, 3]] = False
    free[np.ix_(patch.index[0], [0, 4])] = False
    free[patch.index[-1]] = False
    return ShellOnPlane(Shell(mesh, isotropic_section(E, NU, wall), free))


class _Snapping:
    """One unknown u that holds the pressure u^3 - 6 u^2 + 10 u, which falls between u = 2 -+ sqrt(2/3)."""

    size, length_unit, load_unit, weight = 1, 1.0, 1e-3, None
    flow, mesh = SimpleNamespace(back=0.0), SimpleNamespace(nodes=np.eye(2, 3, 1))
    shell = SimpleNamespace(
        mesh=SimpleNamespace(thickness=np.ones(1), node_count=1),
        dofs=SimpleNamespace(free=np.ones((1, 5), bool), restrict=lambda nodal: nodal[0, :1]),
    )

    @staticmethod
    def rest():
        return np.zeros(1)

    @staticmethod
    def residual(q, pressure):
        return q**3 - 6 * q**2 + 10 * q - pressure

    @staticmethod
    def tangent(q, _pressure):
        return 3 * q**2 - 12 * q + 10

    @staticmethod
    def pressure_derivative(_q, _pressure):
        return -np.ones(1)

    @staticmethod
    def apply(tangent, x):
        return tangent * x

    apply_transposed = apply

    @staticmethod
    def force_scale(_q, _pressure):
        return 1.0

    @staticmethod
    def rounding(_q, _tangent):
        return 1e-14

    @staticmethod
    def factor():
        return SimpleNamespace()

    @staticmethod
    def refactor(factor, tangent):
        factor.solve = factor.solve_transposed = lambda x: x / tangent


@pytest.mark.parametrize(("start", "target"), [(8.0, 2.0), (2.0, 8.0)])
def test_a_curve_passes_both_limit_points_on_its_way_down_as_on_its_way_up(start, target):
    only = [next(x.real for x in np.roots([1, -6, 10, -p]) if abs(x.imag) < 1e-9) for p in (start, target)]
    curve = LoadCurve(_Snapping(), NewtonOptions(), Observer(), (start, np.array(only[:1])))
    curve.extend(target)
    assert curve.pressures[-1] == pytest.approx(target) and curve.states[-1] == pytest.approx(only[1])
    turns = 2.0 + np.sqrt(2 / 3) * np.array([1.0, -1.0] if target < start else [-1.0, 1.0])
    found = [state.pressure for state in curve.limit_states()]
    assert found == pytest.approx(turns**3 - 6 * turns**2 + 10 * turns, rel=1e-6)


def test_a_state_that_is_settled_already_has_no_slope_of_the_last_try():
    steps = LoadSteps(_Snapping(), _options())
    steps.reach(1.0)
    steps.slope = None
    assert steps.settle().iterations == 0 and steps.slope is None


@pytest.mark.slow
def test_an_arch_snaps_at_a_limit_point_and_is_followed_beyond_it():
    model = _arch()
    lowest = []
    see = lambda p, q: lowest.append((p, stiffness_spectrum(model, q, p, 2).lowest))  # noqa: E731
    steps = LoadSteps(
        model, LoadStepOptions(NewtonOptions(1e-9, 30), 1e-6, max_step=20.0, largest_jump=1e-3), accepted=see
    )
    target = 8000.0
    with pytest.raises(SolveError):
        steps.reach(target)
    path = follow_past_limits(LoadCurve(model, NewtonOptions(), Observer(), (steps.pressure, steps.q)), target)
    assert path.reached and path.points[-1][0] == pytest.approx(target)
    assert len(path.limits) % 2 == 0 and len(path.limits) >= 2
    top, bottom = path.limits[0], path.limits[1]
    assert top.pressure >= steps.pressure and bottom.pressure < top.pressure
    assert abs(top.eigenvalue) < 1e-6 * lowest[0][1] and abs(bottom.eigenvalue) < 1e-6 * lowest[0][1]
    # the square of the lowest eigenvalue falls to zero in proportion to the pressure that is still to come
    (pa, a), (pb, b) = lowest[-2], lowest[-1]
    assert pa + (pb - pa) * a**2 / (a**2 - b**2) == pytest.approx(top.pressure, rel=1e-4)
    # load steps back from beyond, with the pressure falling, end at the other limit point
    back = LoadSteps(
        model, LoadStepOptions(NewtonOptions(1e-9, 30), 1e-6, largest_jump=1e-3, max_step=200.0), *path.points[-1]
    )
    if bottom.pressure > 0:
        with pytest.raises(SolveError):
            back.reach(0.5 * bottom.pressure)
        assert back.pressure == pytest.approx(bottom.pressure, rel=1e-3)
        curve = LoadCurve(model, NewtonOptions(), Observer(), (back.pressure, back.q))
        fallen = follow_past_limits(curve, 0.5 * bottom.pressure)
        assert fallen.reached and fallen.points[-1][0] == pytest.approx(0.5 * bottom.pressure)
        assert fallen.limits[0].pressure == pytest.approx(bottom.pressure, rel=1e-6)
