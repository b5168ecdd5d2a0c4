"""Units in which results are read: chosen, or those of the pressure that was given, in tables and sentences."""

import json

import pytest

from dbvfiv.case.units import Units, with_pressure_in
from dbvfiv.cli.terminal import in_units
from dbvfiv.errors import CaseError, SolveError
from dbvfiv.observer import Progress
from dbvfiv.studies.case import load_case
from tests.small_valves import SMALL, settings

COARSE = settings(SMALL)


def test_pressures_are_read_in_the_unit_they_were_given_in():
    case = load_case(None, ["drive.pressure=2 m", "fluid.density=1025"])
    assert case.drive.pressure == pytest.approx(2 * 1025 * 9.80665)
    assert case.units.pressure(case.drive.pressure) == "2 m"
    assert case.units.say("Settled at 20.1036 kPa, between 10.05 to 20.1 kPa, 3.2 mm.") == (
        "Settled at 2 m, between 1 to 2 m, 3.2 mm."
    )
    for other in ("1.3 MPa", "0.0012 Pa s", "12 Pa^2/Hz", "4 kPa/m"):  # none a pressure that is a head
        assert case.units.say(other) == other
    assert load_case(None, ["drive.pressure=10 psi"]).units.pressure(6894.757) == "1 psi"
    assert load_case(None, ["drive.head=6 ft"]).project.units == "ft"
    assert load_case(None, ["drive.head=2"]).project.units == load_case(None, ["drive.head=2 m"]).project.units == "m"
    assert load_case(None, ["drive.pressure=10 kPa"]).project.units == ""


def test_texts_that_are_said_twice_keep_their_digits():
    assert Units("Pa", 1000.0).say("It opens at 6125 Pa.") == "It opens at 6125 Pa."


def test_units_of_choice_stand_before_that_of_the_pressure():
    case = load_case(None, ["drive.pressure=2 m", "project.units=kPa, gpm"])
    assert case.units.pressure(2e3) == "2 kPa"
    other = load_case(None, ["drive.pressure=2 m", "project.units=gpm"]).units
    assert other.pressure(2e3) == "0.2039 m" and other.text == "m, gpm"
    assert case.units.text_of("flow", 3.785411784e-3 / 60) == "1 gpm"
    assert with_pressure_in("psi, ft, gpm", "kPa") == "kPa, ft, gpm"
    assert with_pressure_in("psi, ft, gpm", "m") == "m, gpm"


@pytest.mark.parametrize("units, words", [("furlong", "no unit to choose"), ("m, ft", "second unit")])
def test_units_that_are_none(one_sentence, units, words):
    with pytest.raises(CaseError) as refused:
        load_case(None, [f"project.units={units}"])
    assert words in str(refused.value) and "project.units" in str(refused.value)


def test_a_table_speaks_in_heads_and_json_in_si(command_line):
    asked = ("steady", *COARSE, "-p", "1 m", "--units", "m, gpm")
    outcome = command_line(*asked)
    assert outcome.status == 0, outcome.err
    printed = outcome.out.splitlines()
    document = json.loads(command_line(*asked, "--json").out)
    point = document["points"][0]
    assert point["pressure"] == pytest.approx(9806.65)
    units, row = printed[1].split(), printed[2].split()
    assert units[:4] == ["static", "m", "kg/s", "gpm"]
    assert float(row[0]) == 1.0
    assert float(row[2]) == pytest.approx(point["volume_flow"] * 60 / 3.785411784e-3, rel=1e-3)


def test_warnings_are_told_in_heads_of_the_fluid_that_is_asked_for(command_line, tmp_path):
    """Heads of the case file's own fluid would be a hundred times as low."""
    outcome = command_line("modes", *COARSE, "-p", "40 m", "--density", "10", "-o", tmp_path / "m.h5")
    assert outcome.status == 0, outcome.err
    told = command_line("info", tmp_path / "m.h5").out
    warnings = [
        line.removeprefix("Warning: ") for line in outcome.err.splitlines() if line.startswith("Warning: Heads")
    ]
    assert warnings and "40 m press as 0.4 m of water do" in warnings[0] and warnings[0].partition(" Effect")[0] in told


@pytest.mark.parametrize("name", ["pressure", "sealing"])
def test_pressures_among_the_parameters_have_the_unit_of_pressures(name):
    row = load_case(None, ["project.units=bar"]).units.parameter(name)
    assert (row.shown_unit, row.scale) == ("bar", pytest.approx(1e5))


@pytest.mark.parametrize("kind", [CaseError, SolveError])
def test_a_failure_speaks_in_heads(kind):
    units = load_case(None, ["drive.pressure=2 m"]).units
    with pytest.raises(kind, match="^No equilibrium was found between 1 m, the last one, and 2 m[.]$"), in_units(units):
        raise kind("No equilibrium was found between 9806.65 Pa, the last one, and 19613.3 Pa.")


def test_a_bar_speaks_in_heads():
    class Bar:
        def set_postfix_str(self, text):
            self.text = text

    progress = Progress(say=load_case(None, ["drive.pressure=2 m"]).units.say)
    progress._bar = Bar()
    progress.progress("equilibrium at 9806.65 Pa, 3 iterations")
    assert progress._bar.text == "equilibrium at 1 m, 3 iterations"


@pytest.mark.slow
def test_a_range_of_pressures_makes_a_table_in_their_unit(command_line):
    """Heads go the same way, by the text that was given (test_pressures_are_read_in_the_unit_they_were_given_in)."""
    said = command_line("sweep", *COARSE, "--over", "pressure=0.5 psi:2 psi:2").out.splitlines()
    head = next(i for i, line in enumerate(said) if line.split()[:2] == ["psi", "1/s"])
    assert [float(line.split()[0]) for line in said[head + 1 : head + 3]] == [0.5, 2.0]
    assert any(line.endswith("checked at pressure 0.5, 2 psi.") for line in said), said
