"""Damaged case files: each is read or refused in one sentence, and what is read can be written again."""

from __future__ import annotations

import random
import re

import numpy as np
import pytest

from dbvfiv.case.describe import walk
from dbvfiv.case.parameters import PARAMETERS
from dbvfiv.case.write import case_toml
from dbvfiv.errors import CaseError
from dbvfiv.geometry.valve_mesh import valve_mesh
from dbvfiv.studies.case import Case, load_case

KEYS = [info.key for info in walk(Case)]
NAMES = sorted({key.replace("[]", "").split(".")[-1].split("(")[0] for key in KEYS})
LINES = case_toml(Case(), comments=False).splitlines()
UNITS = "kPa Pa mm m cm deg rad % kg/m^3 1/s Hz N/m s ms m^2 mH2O cmH2O degC bar psi L/s m^3/h".split()
UNITS += ["m**", "m**9**9", "/", "()", "µm", "°", "H2O"]
WORDS = ["flow", "uniform", "true", "storage", "CR", "ruled", "smooth", "steel", "", "nan", "inf", "é", "x" * 500]
WORDS += ["../..", "."]
NUMBERS = [
    0, 1, -1, 2, 7, 10**9, 10**400, -(10**30), 0.0, -0.0, 1e-300, 5e-324, 1e300, 1.7e308, 1e-9, 0.1, 0.5, 3.14, 1e6,
]  # fmt: skip


def scalar(r: random.Random) -> str:
    """A value as it might stand behind an equals sign."""
    kind = r.randrange(10)
    number = r.choice([*NUMBERS, r.uniform(-10, 10), 10 ** r.uniform(-12, 12), r.randrange(1000)])
    if kind <= 2:
        return repr(number)
    if kind <= 5:
        blank = r.choice(["", " ", "  ", "_", "\\t"])
        return f'"{number}{blank}{r.choice(UNITS)}"'
    if kind == 6:
        return f'"{r.choice(WORDS)}"'
    if kind == 7:
        return r.choice(
            ["true", "false", "nan", "-inf", "+inf", "1979-05-27", "07:32:00", "0x1F", "1_000", "'", '"""', "=", ""]
        )
    if kind == 8:
        name = r.choice([*PARAMETERS, "mass", ""])
        span = ":".join(str(r.choice([*NUMBERS[:6], 1, 10, "1 kPa", "x", ""])) for _ in range(r.randrange(5)))
        return f'"{name}={span}{r.choice(["", ":log", ":lin", ":"])}"'
    return f'"{number}/{r.choice([0, 1, 3, 1e-300, "x"])}"'


def value(r: random.Random, depth: int = 0) -> str:
    """A scalar, a list or a table, nested now and then."""
    kind = r.randrange(8)
    if kind == 0 and depth < 60:
        inner = value(r, depth + 1) if r.random() < 0.9 else "["
        return "[" * r.choice([1, 1, 1, 2, 40]) + inner + "]" * r.choice([1, 1, 1, 2, 40])
    if kind == 1 and depth < 4:
        return "[" + ", ".join(value(r, depth + 1) for _ in range(r.randrange(4))) + "]"
    if kind == 2 and depth < 4:
        return "{ " + ", ".join(f"{r.choice(NAMES)} = {value(r, depth + 1)}" for _ in range(r.randrange(4))) + " }"
    return scalar(r)


def near(r: random.Random, line: str) -> str:
    """A line with its first number multiplied, as somebody might who tries another valve."""
    return re.sub(r"\d+(\.\d+)?", lambda found: f"{float(found[0]) * r.choice([0.5, 0.9, 1, 1.1, 2]):g}", line, count=1)


def damaged(r: random.Random) -> str:
    """A case file with up to six slips among other values; some begin with every key, some with none."""
    lines = list(LINES) if r.random() < 0.6 else []
    for at in r.sample(range(len(lines)), r.randrange(4) if lines else 0):
        lines[at] = near(r, lines[at])
    for _ in range(r.choice([0, 0, 1, 2, 3, 4, 5, 6])):
        at = r.randrange(len(lines) + 1)
        keyed = [i for i, line in enumerate(lines) if " = " in line and line[0] not in "# "]
        what = r.randrange(10)
        if what <= 4 and keyed:
            at = r.choice(keyed)
            lines[at] = f"{lines[at].split(' = ')[0]} = {value(r)}"
        elif what == 5 and keyed:
            at = r.choice(keyed)
            lines[at] = lines[at].replace("=", r.choice(["", "==", ":", "= ="]), 1)
        elif what == 6 and lines:
            lines[at - 1] = "".join(c for c in lines[at - 1] if r.random() > 0.1)
        elif what == 7:
            header = r.choice([*Case.model_fields, "materials.A", "materials.CR", "valve.wall_map", "a.b.c", ""])
            lines.insert(at, r.choice(["[{}]", "[[{}]]", "[{}", "[ {} ]"]).format(header))
        elif what == 8 and len(lines) > 2:
            del lines[at - 1]
        else:
            key = r.choice([r.choice(NAMES), r.choice(KEYS).replace("[]", "").split("(")[0], '"é "', "a" * 300])
            lines.insert(at, f"{key} = {value(r)}")
    return "\n".join(lines)


def judged(text: str, overrides: list[str], path, one_sentence) -> bool:
    """Read a file; nothing but a case or a sentence may come of it. Whether it was a case."""
    path.write_text(text, encoding="utf-8")
    try:
        case = load_case(path, overrides)
    except CaseError as error:
        assert one_sentence(str(error)), str(error)
        return False
    assert case.steady_pressures()
    path.write_text(case_toml(case), encoding="utf-8")
    assert load_case(path) == case
    assert Case.from_dict(case.to_dict()) == case
    case = case.replace({"mesh.around": 4, "mesh.along": 8})
    try:
        mesh = valve_mesh(case.valve, case.mesh)
    except ValueError as error:
        assert one_sentence(str(error)), str(error)
    else:
        assert np.isfinite(mesh.nodes).all() and np.isfinite(mesh.wall_deduction).all()
    return True


def fuzz(seeds: range, path, one_sentence) -> None:
    read = 0
    for seed in seeds:
        r = random.Random(seed)
        text = damaged(r)
        keys = [r.choice(KEYS).replace("[]", ".0").split("(")[0] for _ in range(r.choice([0, 0, 1, 2]))]
        overrides = [f"{key}={value(r)}" for key in keys]
        try:
            read += judged(text, overrides, path, one_sentence)
        except Exception as error:
            raise AssertionError(f"seed {seed} with overrides {overrides}:\n{text}") from error
    assert read > len(seeds) / 100, f"{read} of {len(seeds)} were read"


def test_a_hundred_damaged_files(tmp_path, one_sentence):
    fuzz(range(100), tmp_path / "case.toml", one_sentence)


@pytest.mark.slow
@pytest.mark.random
@pytest.mark.parametrize("first", range(100, 10_000, 990))
def test_ten_thousand_damaged_files(tmp_path, one_sentence, first):
    fuzz(range(first, first + 990), tmp_path / "case.toml", one_sentence)
