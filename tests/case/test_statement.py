"""Aims and constraints as sentences."""

import pytest

from dbvfiv.case.parameters import PARAMETERS
from dbvfiv.case.quantity import GRAVITY
from dbvfiv.case.statement import Quantity, parse_span, parse_statement


def test_an_aim_and_constraints_are_read():
    aim = parse_statement("loss coefficient at 2 m down", True, 1000.0)
    assert (aim.quantity, aim.sign, aim.bounds, aim.span) == ("loss coefficient", -1.0, (), False)
    assert aim.pressures == pytest.approx([2e3 * GRAVITY])
    span = parse_statement("margin  from 0.1 m to 5 m at least 5 %", False, 1000.0)
    assert span.span and span.bounds == (0.05,) and span.sign == 1.0 and len(span.pressures) == 6
    assert span.pressures[0] == pytest.approx(100 * GRAVITY) and span.pressures[-1] == pytest.approx(5e3 * GRAVITY)
    assert len(span.between(13)) == 13 and 5e3 in span.asked_also_at(5e3).pressures
    front = parse_statement("flow at 20 kPa, 30 kPa and 2 m at least 10 L/s:20 L/s:3", False, 1000.0)
    assert front.bounds == pytest.approx((0.01, 0.015, 0.02)) and len(front.pressures) == 3
    assert parse_statement("mass at most 12 kg", False).bounds == (12.0,)
    assert parse_span("30 deg:70 deg", Quantity("deg")) == (30.0, 70.0)
    assert parse_span("0.1 m:0.2 m", PARAMETERS["sealing"].quantity, 1000.0) == pytest.approx((980.665, 1961.33))


@pytest.mark.parametrize(
    ("text", "aim", "words"),
    [
        ("loss at 2 m down", True, "cannot be read"),
        ("margin at 2 m at least 5 %", True, "which is a constraint"),
        ("flow at 2 m up", False, "which is an aim"),
        ("margin at least 5 %", False, "names no head"),
        ("mass at 2 m at most 3 kg", False, "that of the wall"),
        ("flow from 3 m to 3 m up", True, "must be greater than 0, and rise"),
        ("flow at 2 m at least 3 m", False, "not a volume flow"),
        ("flow at 2 m at least 1 L/s:2 L/s", False, "FIRST:LAST:COUNT"),
        ("flow at 2 m at least", False, "cannot be read"),
        ("margin at 2 m at least 5", False, "bound is 500 %; a share"),
    ],
)
def test_what_cannot_be_read_is_said(text, aim, words):
    with pytest.raises(ValueError, match=words):
        parse_statement(text, aim, 1000.0)


def test_seals_is_a_gap_left_under_back_pressure():
    found, gap = (
        parse_statement(f"{text} at 2 m{end}", False, 1000.0)
        for text, end in (("seals", ""), ("gap left", " at most 5 %"))
    )
    assert found.quantity == gap.quantity == "gap left" and found.pressures == gap.pressures == (-19613.3,)
    assert found.text == "seals at 2 m" and gap.bounds == (0.05,) and found.sign < 0


def test_bounds_must_rise():
    with pytest.raises(ValueError, match="do not rise"):
        parse_span("1.4:0.7", Quantity(""))
