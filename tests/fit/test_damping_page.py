"""Tables of docs/damping.md, to the digits printed."""

from __future__ import annotations

import re
import tomllib

import numpy as np
import pytest

from dbvfiv.materials.prony import fit_constant
from tests.pages import ROOT, agrees, table_of

BAND = (1.0, 200.0)


def test_stiffening():
    for given, *cells in table_of("damping.md", "η").rows[1:]:
        series = fit_constant(float(given), BAND, 4).prony
        two, hundred, *rest = series.modulus(2j * np.pi * np.array([2.0, 100.0, 1.0, 41.0, 200.0])).real
        found = (np.log(hundred / two) / np.log(50.0), 2 / np.pi * float(given), *rest)
        assert all(agrees(cell, number, 0.51) for cell, number in zip(cells, found, strict=True)), (given, cells, found)


@pytest.mark.parametrize("branches", [2, 3, 4, 5, 6])
def test_errors_of_fits(branches):
    head, *rows = table_of("damping.md", "branches").rows
    cells = next(row for row in rows if row[0].strip("*") == str(branches))
    for given, cell in zip(head[1:], cells[1:], strict=True):
        found = fit_constant(float(given.split()[-1]), BAND, branches)
        numbers = re.findall(r"[\d.]+", cell)
        assert numbers
        for printed, number in zip(numbers, (found.largest_error, found.rms_error)):  # of 100 % the largest alone
            assert agrees(printed, 100 * number, 0.51), (branches, given, cell, found.largest_error, found.rms_error)


def test_shipped_loss_factors():
    shipped = tomllib.loads((ROOT / "dbvfiv/materials/loss_factors.toml").read_text())
    shipped.pop("source")
    rows = {row[0]: row[1:3] for row in table_of("damping.md", "name").rows[1:]}
    assert rows.keys() == shipped.keys()
    for name, (value, between) in rows.items():
        assert float(value) == shipped[name]["value"]
        assert [float(end) for end in between.split(" to ")] == shipped[name]["range"]


def test_matches_of_rayleigh_damping(command_line):
    told = command_line("damping", ROOT / "cases/dbv12.toml", "--set", "damping.model=loss factor", "--at", "5,40")
    assert told.status == 0
    found = {line.split()[0]: line.split()[1:] for line in told.out[told.out.index("Rayleigh") :].splitlines()[2:]}
    for name in ("CR", "SBR"):
        row = next(row for row in table_of("damping.md", " | ratio").rows if row[0] == f"{name}, shipped")
        printed = (*row[1].split(" and "), *row[3:])
        pairs = zip(printed, found[name], strict=True)
        assert all(agrees(cell, float(number), 0.51) for cell, number in pairs), (row, found[name])
