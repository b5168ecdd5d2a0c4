"""Careless and contradictory cases: one sentence each, before anything is solved."""

import time

import pytest

from dbvfiv.studies.case import load_case, require_consistent
from dbvfiv.studies.session import Session

#: What was given, and a word that the sentence must hold; tests/case/bad_cases.txt has what a single key says wrong.
CARELESS = [
    (["drive.pressure=0"], "drive.pressure"),
    (["downstream.pressure=30 kPa"], "nothing flows"),
    (["drive.pressure=2 m", "downstream.pressure=2 m"], "nothing flows"),
    (["outside.fluid=same", "downstream.pressure=5 m"], "nothing flows"),
    (["gravity.direction=+z", "drive.pressure=3 kPa"], "level of the lips above the inlet"),
    (["drive.pressure=20 kPa", "downstream.pressure=12 kPa", "steady.pressures=[2 kPa, 12 kPa]"], "steady.pressures"),
    (["closure.rated_pressure=60 kPa", "closure.pressures=[20 kPa]"], "closure.pressures"),
    (["closure.rated_pressure=10 m", "closure.pressures=[1 m, 2 m]"], "closure.pressures"),
    (
        [
            'valve.wall_map=[{to="210 mm", thickness="12 mm"}, {to="210.2 mm", thickness="15 mm"}, '
            '{to="560 mm", thickness="16 mm"}]'
        ],
        "sliver",
    ),
    (["materials.CR.hardness=120 Shore A"], "CR.hardness is 120 Shore A; a modulus follows from 20 to 80"),
    (["materials.CR.hardness=60 Shore D"], "60 Shore D"),
    (["fluid.sound_speed=343 m/s", "fluid.continuity=storage", "fluid.unsteady=false"], "sound_speed"),
    (["onset.over=pressure=1 kPa:2 kPa"], "not of that form"),
    (["drive.pressure=2"], "a number alone is in Pa"),
    (["closure.rated_pressure=5"], "a number alone is in Pa"),
    (["drive.pressure=3 m", "downstream.pressure=2 m", "report.heads=1 m:3 m:3"], "report.heads begin at 1 m"),
    (["layers.0.material=EPMD"], "the nearest is EPDM"),
    (["outside.depth=3 m"], "downstream.pressure"),
    (["drive.pressure=1000 m"], "strains the round wall at the inlet by"),
    (["report.heads=[1 m, 1000 m]"], "drive.pressure is 1000 m at most"),
    (["closure.rated_pressure=1000 m"], "closure.rated_pressure is 9807 kPa"),
    (["valve.initial_gap=2 in"], "valve.initial_gap"),
    (["report.heads=1 m:10 m"], "START:STOP:COUNT"),
    (["valve.lip_radius=0.1 mm"], "inside the other"),
    (["layers.0.thickness=-1 mm"], 'given as "-1 mm"'),
    (["report.heads=[1, 2]"], "report.heads ends at 2 Pa"),
]


@pytest.mark.parametrize("changes, word", CARELESS, ids=[" ".join(changes)[:50] for changes, _ in CARELESS])
def test_one_sentence_for_a_careless_case(misused, changes, word):
    begin = time.process_time()
    misused(word, "case", *(f"--set={change}" for change in changes))
    assert time.process_time() - begin < 3.0


@pytest.mark.parametrize(
    "arguments",
    [
        ("modes", "--set", "downstream.pressure=30 kPa"),
        ("steady", "-p", "1 m", "--set", "downstream.pressure=2 m"),
        ("map", "--x", "density=1:100:3:log", "--y", "alpha=1:2:2", "--set", "downstream.pressure=30 kPa"),
        ("map", "--x", "pressure=1:4:3", "--y", "density=1:1000:3:log"),
        ("report", "--set", "drive.pressure=1 m", "--set", "downstream.pressure=2 m"),
        ("report", "-o", "my.pdf"),
        ("report", "-o", "my"),
        ("steady", "-o", "run.vtkhdf"),
    ],
)
def test_studies_refuse_contradictions_before_they_solve(misused, monkeypatch, arguments):
    monkeypatch.setattr(Session, "settle", lambda *_: pytest.fail("levels were settled"))
    misused("", *arguments)


SELDOM_MEANT = [
    (["valve.lip_half_width=250 mm"], "half the width of the bill"),
    (["valve.wall_thickness=5 mm", "valve.scale=0.5"], 'valve.wall = "uniform" takes the former'),
    (["layers.2.angle=0.785"], "0.785 rad"),
    (["layers.0.thickness=60 mm"], "scaled until they fill the wall"),
    (["upstream.length=30 m", "upstream.diameter=45 mm"], "45 mm before a valve of 278"),
    (["fluid.density=1"], "a gas, and its jet of 190 m/s"),
    (["fluid.density=1", "drive.head=2"], "2 m press as 0.002 m of water do"),
    (["valve.flange_radius=12 in"], "a pipe of 609.6 mm before a bill that goes 137 mm from its axis"),
    (["valve.scale=12"], "a bore of 3.34 m"),
    (["downstream.pipe_diameter=330 mm", "outside.fluid=same"], "the fluid outside the wall is unbounded"),
]


@pytest.mark.parametrize("changes, word", SELDOM_MEANT)
def test_what_is_seldom_meant_is_noted(command_line, changes, word):
    begin = time.process_time()
    outcome = command_line("case", *(f"--set={change}" for change in changes))
    assert outcome.status == 0 and word in outcome.out
    assert time.process_time() - begin < 3.0


@pytest.mark.slow
def test_a_run_warns_of_what_is_seldom_meant(command_line):
    """Also of a study that solves nothing, beside which it is seen at once."""
    keys = [f"--set={key}" for key in ("mesh.around=6", "mesh.along=8", "drive.kind=uniform", "drive.pressure=100 Pa")]
    outcome = command_line("modes", "--set=valve.scale=12", "--set=modes.in_vacuo=true", *keys)
    assert "a bore of 3.34 m" in outcome.err and "key: valve.scale" in outcome.err, outcome


def test_a_case_that_fits(command_line):
    outcome = command_line("case", "cases/dbv18.toml")
    assert outcome.status == 0 and "fits" in outcome.out.splitlines()[0]
    assert "835 mm long, bill 416 mm wide and 36 mm high" in outcome.out  # 2 x (190 + 18) mm, two lips of 18 mm
    assert "4.771 m3" in outcome.out  # 30 m of 450 mm
    assert "a head of 1 m" in outcome.out and len(outcome.out.splitlines()) < 25


def test_default_back_pressures_reach_one_and_a_half_times_the_rated_one():
    defaults = (7e3, 14e3, 21e3, 28e3)
    assert load_case(None, ("closure.rated_pressure=60 kPa",)).closure.pressures == (*defaults, 60e3, 90e3)
    assert load_case(None, ("closure.rated_pressure=10 kPa",)).closure.pressures == (7e3, 10e3, 14e3, 15e3)
    assert load_case().closure.pressures == defaults
    named = load_case(None, ("closure.rated_pressure=60 kPa",)).replace({"closure.pressures": ["5 kPa"]})
    assert named.closure.pressures == (5e3,)
    require_consistent(named)  # as a report asks, which goes beyond the rated pressure by itself
    late = load_case(None, ("drive.pressure=1 m",)).replace({"closure.rated_pressure": "40 kPa"})
    assert late.closure.pressures == (*defaults, 40e3, 60e3)
    changed = load_case(None, ("closure.rated_pressure=60 kPa",)).replace({"closure.rated_pressure": "40 kPa"})
    assert changed.closure.pressures == (*defaults, 40e3, 60e3)
