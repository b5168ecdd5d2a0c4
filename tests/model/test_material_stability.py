"""Material stability of walls in their steady states."""

from __future__ import annotations

import numpy as np
import pytest

from dbvfiv.materials.stability import stability_margin
from dbvfiv.model import ValveModel
from dbvfiv.model.equilibria import LoadPath, SteadyOptions, state_warnings
from dbvfiv.model.material_stability import material_stability
from tests.small_valves import make_valve

LOSSES = {"damping.model": "loss factor"}


def _state(changes, pressure=12e3):
    model = make_valve(changes)
    state = LoadPath(model, SteadyOptions.of(model.case)).go_to(pressure)
    return model, state, tuple(state_warnings(model, [state]))


def test_published_constants_are_told_with_place_share_and_remedy():
    model, state, warnings = _state({})
    found = material_stability(model, state.q, state.pressure)
    assert not found.holds and found.margin < 0.0 and 0.0 < found.share < 0.5
    assert found.material in ("CR", "SBR", "EPDM") and 0.0 <= found.place[2] <= 0.56
    assert np.prod(found.stretches) == pytest.approx(1.0, rel=1e-12)
    assert found.sentence in warnings
    for words in ("unstable here: at 12000 Pa", "% of the wall's volume", "materials.constants", "dbvfiv fit"):
        assert words in found.sentence


def test_place_and_stretches_are_those_of_the_margin():
    model, state, _ = _state({})
    found = material_stability(model, state.q, state.pressure)
    number = [layer.name for layer in model.shell.section.layers].index(found.material)
    law = model.shell.section.layers[number].law
    ln = np.log(found.stretches)
    sheet = [(np.exp(2 * ln[1]) - 1) / 2, (np.exp(2 * ln[2]) - 1) / 2, 0.0, 0.0, 0.0]
    assert stability_margin(law, sheet) == pytest.approx(found.margin, rel=1e-9)
    near = np.linalg.norm(model.shell.geometry.position - found.place, axis=-1)
    points = slice(number * 2, number * 2 + 2)
    strains = model.shell.strains(state.q)[np.unravel_index(near.argmin(), near.shape)][points]
    assert stability_margin(law, strains).min() == pytest.approx(found.margin, rel=1e-12)


def test_stable_constants_hold_slow_and_in_an_instant():
    model, state, warnings = _state({"materials.constants": "stable", **LOSSES})
    slow, now = (material_stability(model, state.q, state.pressure, factor) for factor in (0.0, None))
    assert slow.holds and now.holds and slow.share == now.share == 0.0
    assert 0.2 < now.margin < slow.margin < 1.0
    assert "stable at 12000 Pa" in now.sentence and not any("unstable here" in sentence for sentence in warnings)
    more = material_stability(model, state.q, state.pressure, 3.0)
    assert more.margin < now.margin


def test_plies_are_not_judged():
    layers = [{"material": "fibre", "thickness": "12 mm"}]
    model, state, _ = _state({}, 2e3)
    plies = ValveModel(model.case.replace({"layers": layers}))
    assert material_stability(plies, state.q, state.pressure).margin == 1.0


def test_share_is_that_of_the_volume():
    model, state, _ = _state({})
    volume = model.shell.point_volumes
    assert volume.sum() == pytest.approx((model.shell.geometry.thickness[:, None] * model.shell.geometry.area).sum())
    lost, each = 0.0, model.shell.section.points_per_layer
    strains = model.shell.strains(state.q)
    for i, layer in enumerate(model.shell.section.layers):
        own = slice(i * each, (i + 1) * each)
        lost += volume[:, :, own][stability_margin(layer.law, strains[:, :, own]) <= 0].sum()
    assert material_stability(model, state.q, state.pressure).share == pytest.approx(lost / volume.sum(), rel=1e-12)
