"""Layers of limited extent: filler plies that the wall has on a part of it only."""

from __future__ import annotations

import numpy as np
import pytest

import dbvfiv
from dbvfiv.case import CaseError
from dbvfiv.case.write import case_toml
from dbvfiv.model import ValveModel
from dbvfiv.motion.equations import ValveMotion
from dbvfiv.shell.recovery import layer_fields
from dbvfiv.studies.case import load_case, thesis_case

MESH = {"mesh.around": 6, "mesh.along": 10}
RUBBER = {"material": "CR", "thickness": 0.006}
PLY = {"material": "fibre", "thickness": 0.001, "angle": 30.0}


def model_of(*layers, **more) -> ValveModel:
    return ValveModel(thesis_case(MESH | {"layers": list(layers)} | more))


def random_state(model: ValveModel) -> np.ndarray:
    return 2e-4 * np.random.default_rng(3).standard_normal(model.size)


@pytest.mark.slow
def test_a_filler_everywhere_is_a_layer():
    """Zones change nothing where each has all layers: forces, tangents, mass and their higher derivatives."""
    whole = model_of(RUBBER, PLY, RUBBER)
    zoned = model_of(RUBBER, PLY | {"around_from": 0.0}, RUBBER)
    q = random_state(whole)
    for name in ("residual", "structure"):
        one, two = (getattr(m.tangent(q, 6e3), name) for m in (whole, zoned))
        assert two == pytest.approx(one, rel=1e-12, abs=1e-12 * np.abs(one).max())
    assert zoned.mass(q) == pytest.approx(whole.mass(q), rel=1e-14)
    assert zoned.shell.energy(q) == pytest.approx(whole.shell.energy(q), rel=1e-13)
    one, two = (m.shell.second(q, q, q) for m in (whole, zoned))
    assert two == pytest.approx(one, abs=1e-11 * np.abs(one).max())


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


def test_compiled_loops_follow_the_energy():
    """Force and tangent of a mixed wall against automatic differentiation; also where rubbers relax."""
    mixed = model_of(RUBBER, PLY | {"begin": 0.2, "end": 0.45, "around_from": 0.4}, RUBBER)
    shell, q = mixed.shell, random_state(mixed)
    force, data = shell.force_and_tangent(q)
    unknowns = shell._element_unknowns(q)
    exact = shell._scatter(np.asarray(shell.energies.force(unknowns)))
    assert force == pytest.approx(exact, abs=1e-11 * np.abs(exact).max())
    assert shell.force(q) == pytest.approx(force, abs=1e-12 * np.abs(force).max())
    slopes = np.zeros_like(data)
    shell._scatter_matrix(np.asarray(shell.energies.tangent(unknowns)), slopes)
    assert data == pytest.approx(slopes, abs=1e-11 * np.abs(slopes).max())
    lossy = model_of(
        RUBBER, PLY | {"begin": 0.2, "end": 0.45, "around_from": 0.4}, RUBBER, **{"damping.model": "loss factor"}
    )
    for i, part in enumerate(lossy.shell.relaxing_tangents(q)):
        share = np.zeros(3)
        share[list(lossy.shell.section.relaxing[i].layers)] = 1.0
        exact = np.zeros_like(part)
        lossy.shell._scatter_matrix(np.asarray(lossy.shell.energies.material_tangent(unknowns, share)), exact)
        assert part == pytest.approx(exact, abs=1e-11 * np.abs(exact).max())


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
