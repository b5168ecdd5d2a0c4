"""The table of parameters: every reader agrees with it."""

import pickle

import numpy as np
import pytest

from dbvfiv.case.axis import parse_stability_axis
from dbvfiv.case.describe import allowed_words, walk
from dbvfiv.case.parameters import DESIGN, PARAMETERS, SURROUNDINGS, SWEPT, SYSTEM_NAMES, Mu, listed
from dbvfiv.errors import CaseError
from dbvfiv.model.build import build_section
from dbvfiv.studies.case import Case, load_case, thesis_case
from dbvfiv.studies.session import KEYWORDS, Session, named_changes
from dbvfiv.studies.stability.place import design_value, redesigned


@pytest.mark.parametrize("row", PARAMETERS.values(), ids=PARAMETERS)
def test_every_parameter_has_its_place_in_the_case(row):
    keys = {info.key: info for info in walk(Case)}
    assert row.key in keys
    if row.swept:
        assert keys[row.key].unit == row.quantity.si


@pytest.mark.parametrize("row", PARAMETERS.values(), ids=PARAMETERS)
def test_usual_range_is_one(row):
    axis = parse_stability_axis(row.name)
    assert (axis.values[0], axis.values[-1], len(axis.values)) == row.usual
    assert axis.log == row.log and axis.key == row.key


@pytest.mark.parametrize("name", ["density", "alpha", "beta"])
def test_limits_of_keys_are_those_of_the_table(name):
    row = PARAMETERS[name]
    assert thesis_case({row.key: row.high}) is not None
    with pytest.raises(CaseError, match="at most"):
        thesis_case({row.key: row.high * 1.01})
    section, key = row.key.split(".")
    words = allowed_words(type(getattr(Case(), section)).model_fields[key])
    assert ("at least" in words) == row.low_included


def test_ranges_end_where_the_key_does():
    # 40000 kg/m3 is no density of a case and was one of an axis
    with pytest.raises(CaseError, match="whose range is not within 0 to 30000"):
        Case().replace({"onset.over": "density=1:40000:5"})
    with pytest.raises(CaseError, match="whose range is not within"):
        Case().replace({"sweep.over": "pressure=1 kPa:11 MPa:5"})
    with pytest.raises(CaseError, match="whose range is not within 0 to 1"):
        Case().replace({"onset.over": "storage=0:2:5"})


def test_groups():
    lines = ("pipe_length", "tail_length", "wave_speed")
    assert SURROUNDINGS == ("density", "alpha", "beta", "loss_factor", "storage", *lines)
    assert DESIGN == ("thickness", "angle", "strain", "sealing")
    assert SWEPT == ("pressure", "density", "alpha", "beta", "loss_factor", *lines)
    assert SYSTEM_NAMES == ("inlet", *SURROUNDINGS)


def test_a_case_has_every_parameter_of_load_and_surroundings():
    mu = Mu.of(thesis_case())
    assert mu == Mu(pressure=18e3, density=1000.0, storage=0.0, alpha=5.0, beta=0.003, loss_factor=0.0)
    assert set(mu.at(angle=30).for_system()) == {*SYSTEM_NAMES, "angle"}


def test_plies_beyond_a_right_angle_are_those_of_half_a_turn():
    """Plies at 54 and 126 degrees are turned as those at 54 and -54, and one at 180 stays along the axis."""
    layers = [{"material": "fibre", "thickness": 1e-3, "angle": angle} for angle in (54.0, 126.0, -126.0, 180.0)]
    case = thesis_case({"layers": layers})
    assert [layer.angle for layer in redesigned(case, {"angle": 40.0}).layers] == [40.0, -40.0, 40.0, 180.0]
    own, again = (build_section(each).plane_stiffness for each in (case, redesigned(case, {"angle": 54.0})))
    assert design_value(case, "angle") == 54.0 and again == pytest.approx(own, rel=1e-12, abs=1e-6 * np.abs(own).max())


def test_words():
    assert PARAMETERS["pressure"].label == "Static inlet pressure, kPa"
    assert PARAMETERS["alpha"].label == "Mass damping α, 1/s"
    assert PARAMETERS["thickness"].label == "Wall thickness factor"
    assert PARAMETERS["pressure"].text(6e3) == "6 kPa"
    assert PARAMETERS["beta"].text(0.003) == "β = 0.003 s"
    assert listed(SWEPT) == "pressure, density, alpha, beta, loss_factor, pipe_length, tail_length or wave_speed"
    assert "strain (level of the rubbers)" in listed(notes=True)


@pytest.mark.parametrize("command", ["sweep", "onset", "map"])
def test_help_lists_the_table(command_line, command):
    words = " ".join(command_line(command, "--help").out.replace("│", " ").split())
    assert listed(SWEPT if command == "sweep" else PARAMETERS) in words


@pytest.mark.parametrize("given", [("--density", 10), ("--over", "pressure=1e3:2e3:3", "-p", "6 kPa")])
@pytest.mark.parametrize("command", ["sweep", "onset", "cycle"])
def test_what_a_range_moves_is_given_no_value(misused, command, given):
    over = [] if command == "sweep" or "--over" in given else ["--over", "density=1:1000:4"]
    misused(f"{command}.over", command, *over, *given)


def test_arguments_of_the_python_interface():
    assert {name: KEYWORDS[name] for name in SWEPT} == {name: PARAMETERS[name].key for name in SWEPT}
    session = Session(load_case(None))
    for kind, name, value in (("onset", "symmetry", "all"), ("response", "max_frequency", 20.0), ("sweep", "count", 2)):
        case = session.prepared(kind, named_changes({name: value}, kind)).case
        assert getattr(getattr(case, kind), name) == value and case.modes == session.case.modes
    known = named_changes({"density": 10.0, "in_vacuo": True, "beta": None}, "modes")
    assert known == {"fluid.density": 10.0, "modes.in_vacuo": True}


def test_a_parameter_point_holds_what_the_valve_has():
    mu = Mu.of(Case().replace({"upstream.length": "20 m", "upstream.diameter": "0.3 m", "outside.fluid": "same"}))
    assert mu["pipe_length"] == mu.pipe_length == 20.0 and mu.pipes == {"pipe_length": 20.0}
    assert "tail_length" not in mu and mu.tail_length == 0.0 and mu.design == {}
    moved = mu.at(density=1.2, thickness=0.9)
    assert (moved.density, moved.design, mu.density) == (1.2, {"thickness": 0.9}, 1000.0)
    assert moved.at(density=1000.0).only(*mu) == mu and hash(moved.at(density=1000.0).only(*mu)) == hash(mu)
    assert pickle.loads(pickle.dumps(mu)) == mu
    system = moved.for_system()
    assert (system["inlet"], system["wave_speed"], system["thickness"]) == (mu.pressure, 0.0, 0.9)
    with pytest.raises(ValueError, match="'desity' is no parameter"):
        mu.at(desity=1.0)
    with pytest.raises(AttributeError):
        mu.density = 2.0
