"""The Python interface."""

import numpy as np
import pytest

import dbvfiv
from dbvfiv.errors import CaseError, SolveError
from dbvfiv.studies.case import thesis_case


def test_one_pressure_gives_a_state(coarse_valve, coarse_run):
    state = coarse_valve.steady(pressure="18 kPa")
    assert state.pressure == 18e3 and state.mass_flow == pytest.approx(coarse_run.states[1].mass_flow, rel=1e-6)
    assert state.model is coarse_valve.model
    assert coarse_valve.steady(pressure=np.float64(500)).pressure == 500


def test_several_give_a_result(coarse_valve):
    result = coarse_valve.steady(pressure=["500 Pa", 1000])
    assert [state.pressure for state in result.states] == [500, 1000] and result.nearest(900).pressure == 1000
    assert result.case.fluid.density == 1000


def test_load_takes_a_file_and_changes(tmp_path):
    (tmp_path / "mine.toml").write_text("[fluid]\ndensity = 10")
    valve = dbvfiv.load(tmp_path / "mine.toml", {"mesh.around": 8})
    assert (valve.name, valve.case.fluid.density, valve.case.mesh.around) == ("mine", 10, 8)
    assert valve.replace({"fluid.density": "1.2 kg/m^3"}).case.fluid.density == 1.2


def test_failures_are_raised(coarse_valve, refused):
    with pytest.raises(SolveError) as caught:
        coarse_valve.replace({"steady.max_iterations": 2, "steady.min_step": 0.3}).steady(pressure=100)
    assert "No equilibrium" in str(caught.value)
    for pressure in (-1, float("nan"), "3 mm", [], True, None.__class__):
        with pytest.raises(CaseError):
            coarse_valve.steady(pressure=pressure)
    with refused(CaseError):
        dbvfiv.load(thesis_case(), {"shell.metric": "true"})


def test_nothing_else_is_offered():
    with pytest.raises(AttributeError):
        dbvfiv.laod


def test_pressures_are_those_of_the_command_line():
    """Only drive.pressure given: one state at it, as `dbvfiv steady --set drive.pressure=...` gives."""
    valve = dbvfiv.load(thesis_case(), {"mesh.around": 8, "mesh.along": 16, "drive.pressure": "4 kPa"})
    assert [state.pressure for state in valve.steady().states] == [4e3]
