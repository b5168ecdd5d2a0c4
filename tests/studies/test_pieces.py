"""Studies of a valve behind pipes in series: two equal ones are one, and what belongs to one pipe alone is refused."""

from __future__ import annotations

import numpy as np
import pytest

import dbvfiv
from dbvfiv.errors import CaseError
from dbvfiv.studies.stability.derivatives import parameters_of
from tests.small_valves import load_small
from tests.studies.along import check_sweep
from tests.verification.test_transient_modes import MIXED

STATE = {"drive.pressure": 6e3, "damping.alpha": 0.0, "fluid.density": 100.0}
PIPE = {"diameter": "250 mm", "friction": 0.02}
ONE = {f"upstream.{name}": value for name, value in PIPE.items()} | {"upstream.length": 12.0, "upstream.loss": 2.0}
TWO = {"upstream.pieces": [{"length": 6.0, "loss": 1.0, **PIPE}] * 2}


def with_waves(keys):
    """The same pipe or pipes with waves of 700 m/s in them."""
    if "upstream.pieces" in keys:
        pieces = [piece | {"wave_speed": 700.0, "elements": 2} for piece in keys["upstream.pieces"]]
        return {"upstream.pieces": pieces}
    return keys | {"upstream.wave_speed": 700.0, "upstream.elements": 4}


@pytest.mark.slow
@pytest.mark.parametrize("elastic", [False, True], ids=["rigid", "elastic"])
def test_two_equal_pieces_are_one_pipe(elastic):
    lines = [with_waves(keys) if elastic else keys for keys in (ONE, TWO)]
    one, two = (load_small(STATE, keys, {"steady.cracking_area": 2.0}) for keys in lines)
    states = [valve.steady(pressure=6e3) for valve in (one, two)]
    for name in ("mass_flow", "line_loss", "flange_pressure", "lip_opening"):
        assert getattr(states[1], name) == pytest.approx(getattr(states[0], name), rel=1e-8)
    assert states[1].line_loss > 0
    modes = [[complex(m.growth_rate, m.frequency) for m in valve.modes(count=6).modes] for valve in (one, two)]
    assert modes[1] == pytest.approx(modes[0], rel=1e-8)
    run = {"transient.start": "kick", "transient.step": 5e-4, "transient.duration": 0.01}
    first, second = (load_small(STATE, keys, run).transient().history["lip_displacement"] for keys in lines)
    swing = np.ptp(first)
    assert swing > 0 and np.abs(second - first).max() < 1e-8 * np.abs(first).max()


@pytest.mark.slow
def test_derivatives_by_the_pieces_add_up_to_those_by_one_pipe():
    one, two = (load_small(STATE, with_waves(keys)) for keys in (ONE, TWO))
    whole = one.sensitivity(["pipe_length", "wave_speed"]).sensitivities
    names = [f"upstream.pieces.{i}.{name}" for name in ("length", "wave_speed") for i in (0, 1)]
    found = [each.derivative for each in two.sensitivity(names).sensitivities]
    assert found[0] + found[1] == pytest.approx(2 * whole[0].derivative, rel=1e-4)
    assert found[2] + found[3] == pytest.approx(whole[1].derivative, rel=1e-4)


@pytest.mark.slow
def test_over_the_density_waves_keep_their_speeds():
    """Studies over the density reduce the line at unit density."""
    check_sweep((STATE, MIXED), "density=20:100:3:log", "fluid.density", (-1,))


def test_no_one_pipe_to_change():
    valve = load_small(STATE, MIXED)
    for over in ("pipe_length=1:50:5:log", "wave_speed=100:1000:5:log"):
        name = over.split("=")[0]
        with pytest.raises(CaseError, match=f"no one {name} to change.*3 pieces"):
            valve.onset(over)
        assert name not in parameters_of(valve.model)


def test_pieces_from_a_file(tmp_path, command_line):
    path = tmp_path / "line.toml"
    path.write_text(
        "[mesh]\naround = 6\nalong = 8\n[materials]\nstrain_level = '10 %'\n[drive]\nhead = '1 m'\n"
        "[[upstream.pieces]]\nlength = '15 m'\ndiameter = '400 mm'\nroughness = '0.1 mm'\n"
        "[[upstream.pieces]]\nlength = '5 m'\ndiameter = '300 mm'\nloss = 0.3\n"
    )
    out = command_line("steady", path)
    assert out.status == 0 and "line loss" in out.out
    case = dbvfiv.load(path).case
    assert case.upstream.whole_length == 20.0 and case.from_dict(case.to_dict()) == case
