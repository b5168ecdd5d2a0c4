"""The catalogue sheet against the states it is made of."""

import csv
import os
from types import SimpleNamespace

import pytest

import dbvfiv
from dbvfiv.errors import CaseError
from dbvfiv.studies.case import load_case
from dbvfiv.studies.session import Session
from dbvfiv.studies.steady import require_sheet, sheet_rows
from tests.small_valves import SMALL, settings

OPTIONS = settings(SMALL)
CHANGES = [text.removeprefix("--set=") for text in OPTIONS]


def rows_of(path):
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


@pytest.mark.slow
def test_a_sheet_of_two_sizes_in_units_of_choice(command_line, tmp_path):
    path = tmp_path / "catalogue.csv"
    asked = ("-p", "0.2 m", "-p", "1 m", "--scale", "131 mm", "--scale", 1, "--units", "ft, gpm, in")
    assert command_line("steady", *OPTIONS, *asked, "-o", path).status == 0
    assert [each.name for each in tmp_path.iterdir()] == ["catalogue.csv"]  # and no HDF5
    rows = rows_of(path)
    states = [
        state
        for scale in (0.5, 1.0)
        for state in dbvfiv.load(None, [*CHANGES, f"valve.scale={scale}"]).steady(pressure=["0.2 m", "1 m"]).states
    ]
    assert len(rows) == len(states) == 4
    for row, state in zip(rows, states):
        assert float(row["static head [ft]"]) == pytest.approx(state.head / 0.3048, rel=1e-5)
        assert float(row["flow [gpm]"]) == pytest.approx(state.volume_flow * 60 / 3.785411784e-3, rel=1e-5)
        assert float(row["opening [in]"]) == pytest.approx(state.lip_opening / 0.0254, rel=1e-5)
        assert float(row["jet velocity [m/s]"]) == pytest.approx(state.outlet_velocity, rel=1e-5)
        # K = g H_loss / (v^2 / 2), Kv in m3/h at 1 bar of water
        k = 2 * 9.80665 * 0.3048 * float(row["head loss [ft]"]) / float(row["velocity [m/s]"]) ** 2
        assert float(row["K"]) == pytest.approx(k, rel=1e-4)
    assert float(rows[2]["bore [in]"]) == pytest.approx(2 * float(rows[0]["bore [in]"]), rel=1e-5)
    # lengths twice as large at the same head: four times the flow
    assert float(rows[2]["flow [gpm]"]) == pytest.approx(4 * float(rows[0]["flow [gpm]"]), rel=1e-4)


def test_a_sheet_that_cannot_be_written_is_refused_before_anything_is_solved(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "access", lambda *_: False)
    with pytest.raises(CaseError, match="catalogue.csv' cannot be written: .* may only be read"):
        require_sheet(tmp_path / "catalogue.csv")


@pytest.mark.parametrize("length", [None, 20.0])
def test_static_head_and_pressure_are_those_at_the_flange(length):
    """Behind a line, which takes 0.8 m of 2 m, the head that is asked at its far end stands beside them."""
    hydraulics = SimpleNamespace(flange_velocity=1.0, head_loss=1.25, loss_coefficient=24.5, kv=1.0, cv=1.0)
    case = load_case(None, [] if length is None else [f"upstream.length={length}"])
    flange = 9806.65 * (2.0 if length is None else 1.2)
    state = SimpleNamespace(
        results=SimpleNamespace(case=case), hydraulics=hydraulics, head=2.0, flange_pressure=flange, volume_flow=0.1,
        outlet_velocity=2.0, lip_opening=0.02,
    )  # fmt: skip
    titles, row = sheet_rows([state], case.units)
    told = dict(zip(titles, row))
    assert told["static head [m]"] == pytest.approx(told["static pressure [kPa]"] / 9.80665, rel=1e-5)
    assert told.get("head at the far end [m]") == (None if length is None else 2.0)


def test_a_later_size_of_a_sheet_that_falls_short_is_told(command_line, tmp_path, monkeypatch):
    """The first size is whole; the exit status is that of the second."""
    perform, told = Session.perform, []

    def cut_short(session, *given, **choices):
        result = perform(session, *given, **choices)
        if told.append(result) or len(told) == 2:
            result.record.fail("At 0.2 m: no state.")
        return result

    monkeypatch.setattr(Session, "perform", cut_short)
    path = tmp_path / "catalogue.csv"
    outcome = command_line("steady", *OPTIONS, "-p", "0.2 m", "--scale", 0.5, "--scale", 1, "-o", path)
    assert outcome.status == 1 and len(told) == 2 and len(rows_of(path)) == 2, outcome.err


def test_a_sheet_does_not_take_the_name_of_measured_data(misused, tmp_path):
    path = tmp_path / "tap.csv"
    path.write_text(text := "pressure [kPa], flow [L/s]\n2, 3\n3, 9\n")
    misused("a file that the case reads", "steady", *OPTIONS, "--set", f'steady.measured=["{path}"]', "-o", path)
    assert path.read_text() == text
