"""Numbers in the README and in tables of the manual that a quick command makes, to the digits printed."""

from __future__ import annotations

import json
import re
import shlex

import numpy as np
import pytest

from dbvfiv.case.quantity import GRAVITY
from tests.pages import ROOT, Table, agrees, table_of

pytestmark = pytest.mark.slow


@pytest.fixture
def given(command_line, monkeypatch):
    """What a command line prints as JSON."""
    monkeypatch.chdir(ROOT)
    known: dict[str, dict] = {}

    def ask(line: str) -> dict:
        if line not in known:
            outcome = command_line(*shlex.split(line)[1:], "--json")
            assert outcome.status == 0, (line, outcome.err)
            known[line] = json.loads(outcome.out)
        return known[line]

    return ask


def made(table: Table, number: int = 0) -> str:
    """A command of the stamp of a table."""
    return [quoted for quoted in table.quoted if quoted.startswith("dbvfiv ")][number]


def numbers(cell: str) -> list[str]:
    """Numbers of a cell as they are printed."""
    return re.findall(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?", cell)


def held(place: object, printed: list[str], found) -> None:
    """Printed numbers are those found, to a unit of the last digit."""
    found = [float(value) for value in np.ravel(found)]
    assert len(printed) == len(found), (place, printed, found)
    wrong = [(digits, value) for digits, value in zip(printed, found) if not agrees(digits, value)]
    assert not wrong, f"{place}: printed and found {wrong}"


def leading_oscillation(modes: list[dict]) -> tuple[float, float]:
    """Growth rate, 1/s, and frequency, Hz, of the first mode that swings."""
    return next((mode["growth_rate"], mode["frequency"]) for mode in modes if mode["frequency"] > 0)


def test_openings_of_the_six_inch_valve(given):
    table = table_of("your-own-valve.md", "static head at the flange")
    points = given(made(table))["points"]
    for row, point in zip(table.rows[1:], points, strict=True):
        told = point["hydraulics"]
        found = (
            point["pressure"] / (1000 * GRAVITY),
            1e3 * point["volume_flow"],
            1e3 * point["lip_opening"],
            told["jet_velocity"],
            told["total_head"],
            told["loss_coefficient"],
            told["kv"],
        )
        held(table.place, [numbers(cell)[0] for cell in row], found)


def test_flows_of_the_quick_start(given, command_line, tmp_path):
    """Of the case that `dbvfiv case --new` writes, on its own mesh; test_tutorials follows the page on a coarse one."""
    text, case = (ROOT / "docs/tutorials/quick-start.md").read_text(), tmp_path / "my.toml"
    said = re.search(r"At 6, 18 and 36 kPa the flow is ([\d.]+), ([\d.]+) and ([\d.]+) kg/s", text)
    assert command_line("case", "--new", case).status == 0
    points = given(f"dbvfiv steady {case} -p '6 kPa' -p '18 kPa' -p '36 kPa'")["points"]
    held("docs/tutorials/quick-start.md", list(said.groups()), [point["mass_flow"] for point in points])


def test_flows_of_the_twelve_inch_valve(given):
    """In the comparison with the thesis, in the README and in the findings."""
    table = table_of("thesis.md", " | 18 kPa")
    rows = {row[0]: [numbers(cell)[0] for cell in row[1:]] for row in table.rows[1:]}
    line = made(table)
    ten = [point["mass_flow"] for point in given(line)["points"]]
    twenty = [point["mass_flow"] for point in given(f'{line} --set materials.strain_level="20 %"')["points"]]
    held(table.place, rows["10 % strain level"], ten)
    held(table.place, rows["20 % strain level"], twenty)
    for page in ("README.md", "docs/findings.md"):
        said = next(text for text in (ROOT / page).read_text().splitlines() if text.startswith("- **Opening.**"))
        said = re.sub(r"at 18, 29 and 36 kPa|the 20 % constants", "", said)
        held(f"{page}, Opening", numbers(said)[:6], [*ten, *twenty])


def test_recovery_in_a_pipe(given):
    table = table_of("evidence/line.md", "static at the flange")
    line = made(table)
    piped, free = given(line)["points"], given(re.sub(r" --set downstream\S+ ?\S*\"", "", line))["points"]
    for row, inside, outside in zip(table.rows[1:], piped, free, strict=True):
        found = (
            outside["mass_flow"],
            inside["mass_flow"],
            inside["hydraulics"]["recovered_pressure"] / 1e3,
            outside["loss_coefficient"],
            inside["loss_coefficient"],
            outside["kv"],
            inside["kv"],
        )
        printed = [
            digits for cell in (row[1], row[2], row[3], row[4], row[5].replace("m3/h", "")) for digits in numbers(cell)
        ]
        held(table.place, printed, found)


def test_heads_behind_a_line(given):
    table = table_of("evidence/line.md", "head in the reservoir | lost in the line")
    for row, point in zip(table.rows[1:], given(made(table))["points"], strict=True):
        told = point["hydraulics"]
        found = (
            told["line_loss"],
            told["flange_pressure"] / 1e3 if "flange_pressure" in told else point["flange_pressure"] / 1e3,
            1e3 * point["volume_flow"],
            point["loss_coefficient"],
            point["kv"],
        )
        held(table.place, [numbers(cell)[0] for cell in row[1:]], found)


@pytest.mark.parametrize("length", ["0.5", "2", "10", "100"])
def test_pipes_in_front(given, length):
    table = table_of("evidence/line.md", "pipe | quasi-steady")
    row = next(row for row in table.rows[1:] if row[0] == f"{length} m")
    said = given(made(table).replace("upstream.length=10", f"upstream.length={length}"))
    for cell, modes in zip(row[1:], (said["modes"], said["other_law"]["modes"]), strict=True):
        if not cell.startswith("none"):
            held(table.place, numbers(cell.replace("1/s", ""))[:2], leading_oscillation(modes))


def test_reference_mode(given):
    """The reference point of the guide to modes."""
    text = (ROOT / "docs/modes.md").read_text()
    said = re.search(r"([-+][\d.]+) 1/s at ([\d.]+) Hz, next ([-−+][\d.]+) 1/s at ([\d.]+) Hz", text)
    told = given('dbvfiv modes cases/dbv12.toml -p "6 kPa" --density 10 --set damping.alpha=0')
    assert told["certificate"]["agrees"] and all(mode["residual"] < 1e-8 for mode in told["modes"])
    found = [value for mode in told["modes"][:2] for value in (mode["growth_rate"], mode["frequency"])]
    held("docs/modes.md", [part.replace("−", "-") for part in said.groups()], found)


def test_classes_of_motion(given):
    table = table_of("modes.md", "inlet pressure")
    for row in table.rows[1:]:
        modes = given(made(table).replace('"1 kPa"', f'"{row[0]}"'))["modes"]
        lowest = [min(m["frequency"] for m in modes if m["symmetry"] == kind) for kind in table.rows[0][1:]]
        held(table.place, list(row[1:]), lowest)
