"""Layers of limited extent: filler plies that the wall has on a part of it only."""

from __future__ import annotations

import numpy as np
import pytest

import dbvfiv
from dbvfiv.case.write import case_toml
from dbvfiv.errors import CaseError
from dbvfiv.model import ValveModel
from dbvfiv.motion.equations import ValveMotion
from dbvfiv.shell.recovery import layer_fields
from dbvfiv.studies.case import load_case, thesis_case
from tests.differences import difference

MESH = {"mesh.around": 6, "mesh.along": 8}
RUBBER = {"material": "CR", "thickness": 0.006}
PLY = {"material": "fibre", "thickness": 0.001, "angle": 30.0}


def model_of(*layers, **more) -> ValveModel:
    return ValveModel(thesis_case(MESH | {"layers": list(layers)} | more))


def random_state(model: ValveModel) -> np.ndarray:
    return 2e-4 * np.random.default_rng(3).standard_normal(model.size)


@pytest.mark.slow
def test_each_part_is_the_wall_of_its_layers():
    """A valve with a filler on its inlet half has there the elements of one wall and before it those of the other."""
    breaks = {"mesh.breaks": [0.35]}
    with_ply, without = model_of(RUBBER, PLY, RUBBER, **breaks), model_of(RUBBER, RUBBER, **breaks)
    mixed = model_of(RUBBER, PLY | {"begin": 0.35}, RUBBER)
    assert np.array_equal(mixed.mesh.nodes, without.mesh.nodes)
    behind = mixed.mesh.element_z > 0.35
    assert 0 < behind.sum() < len(behind)
    fields = mixed.shell._element_unknowns(random_state(mixed))
    energies = [np.asarray(m.shell.energies.energy(fields)) for m in (mixed, with_ply, without)]
    assert energies[0][behind] == pytest.approx(energies[1][behind], rel=1e-12)
    assert energies[0][~behind] == pytest.approx(energies[2][~behind], rel=1e-12)


@pytest.mark.slow
def test_compiled_loops_follow_the_energy():
    """Force of a mixed wall against automatic differentiation, its tangent against differences; at rest the parts of
    the rubbers that relax are all of it.
    """
    part = PLY | {"begin": 0.2, "end": 0.45, "around_from": 0.4}
    shell = model_of(RUBBER, part, RUBBER, **{"damping.model": "loss factor"}).shell
    q = 2e-4 * np.random.default_rng(3).standard_normal(shell.size)
    force, data = shell.force_and_tangent(q)
    exact = shell._scatter(np.asarray(shell.energies.force(shell._element_unknowns(q))))
    assert force == pytest.approx(exact, abs=1e-11 * np.abs(exact).max())
    assert shell.force(q) == pytest.approx(force, abs=1e-12 * np.abs(force).max())
    slope = difference(shell.force, q, q[::-1], 1e-2)
    assert shell.dofs.matrix(data) @ q[::-1] == pytest.approx(slope, abs=1e-7 * np.abs(slope).max())
    relaxing, whole = shell.relaxing_tangents(0 * q), shell.force_and_tangent(0 * q)[1]
    assert len(relaxing) == 2 and sum(relaxing) == pytest.approx(whole, abs=1e-11 * np.abs(whole).max())


def test_layers_that_are_not_there_have_no_strains_and_no_mass():
    mixed = model_of(RUBBER, PLY | {"begin": 0.3}, RUBBER)
    found = layer_fields(mixed.shell, random_state(mixed))
    before = mixed.mesh.element_z < 0.3
    assert np.all(found.von_mises[before, 1] == 0) and np.all(found.von_mises[~before, 1] > 0)
    assert np.all(found.von_mises[:, [0, 2]] > 0)
    density = mixed.shell.at_rest.inertia[:, 0]
    assert density[before] == pytest.approx(1300.0) and density[~before] == pytest.approx((12 * 1300 + 1270) / 13)


@pytest.mark.slow
def test_steady_modes_and_motion_know_fillers():
    """A ply in the saddle stiffens it; modes are counted twice, energies of both loops agree, rubbers relax in time."""
    stable = MESH | {"materials.constants": "stable"}  # published ones have lost material stability at 6 kPa
    filler = [RUBBER, PLY | {"begin": 0.21, "end": 0.49}, RUBBER]
    plain = dbvfiv.load(thesis_case(), stable | {"layers": [RUBBER, RUBBER]}).steady(pressure=6e3)
    valve = dbvfiv.load(thesis_case(), stable | {"layers": filler, "damping.model": "loss factor"})
    state = valve.steady(pressure=6e3)
    assert state.mass_flow < 0.98 * plain.mass_flow
    certificate = state.modes(density=10.0).certificate
    assert certificate.unstable_count == certificate.unstable_count_independent
    model = valve.model
    assert ValveMotion(model).energies(state.q, 0.0 * state.q)[1] == pytest.approx(
        model.shell.energy(state.q), rel=1e-10
    )
    run = valve.transient("0.006 s", pressure="6 kPa")
    assert np.all(np.isfinite(run.history["mass_flow"])) and len(run.history["mass_flow"]) > 5


def test_fillers_scale_and_are_written(tmp_path):
    changes = {"layers": [RUBBER, PLY | {"begin": "100 mm", "end": "300 mm", "around_to": 0.5}, RUBBER]}
    case = thesis_case(MESH | changes)
    for comments in (True, False):
        (tmp_path / "case.toml").write_text(case_toml(case, comments))
        assert load_case(tmp_path / "case.toml") == case
    one, two = ValveModel(case), ValveModel(case.replace({"valve.scale": 3}))
    assert np.array_equal(one.shell.zones.of_element, two.shell.zones.of_element)
    assert len(one.shell.zones.presence) == 2


BAD = {
    "beyond the valve": ([RUBBER, PLY | {"begin": 0.7}], "layers.1.begin is 0.7 m; the valve ends at 0.56 m"),
    "backwards": ([RUBBER, PLY | {"begin": 0.3, "end": 0.1}], "layers.1.end is 0.1 m; it must lie behind"),
    "a hole": ([RUBBER | {"begin": 0.1}, PLY | {"begin": 0.2}], "layers is a list with 0 at z = 0 m"),
    "a hole around": ([RUBBER | {"around_to": 0.5}], "layers is a list with 0 at z = 0 m and 0.5 of the section"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_fillers(name, refused):
    layers, words = BAD[name]
    with refused(CaseError, match=words):
        thesis_case({"layers": layers})
