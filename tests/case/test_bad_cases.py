"""Malformed and impossible cases: status 2, one sentence that names the key, no traceback."""

import re
from pathlib import Path

import pytest

LINES = Path(__file__).with_name("bad_cases.txt").read_text().splitlines()
BAD = [tuple(line.replace(r"\n", "\n").split(" => ")) for line in LINES if not line.startswith("# ")]
BAD += [
    (f"[damping]\nalpha = 1{'0' * 400}", "too large"),
    (f"[damping]\nalpha = 1{'0' * 5000}", "not valid TOML"),
    ("[upstream]\npieces = [" + "{ length = 1 }," * 51 + "]", r"upstream\.pieces"),
    ("a = " + "[" * 3000 + "]" * 3000, "."),
]


@pytest.mark.parametrize("text, words", BAD, ids=[words[:40] for _, words in BAD])
def test_a_bad_case_is_refused_in_one_sentence(tmp_path, monkeypatch, command_line, one_sentence, text, words):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bad.toml").write_text(text)
    outcome = command_line("case", "bad.toml")
    assert outcome.status == 2
    assert outcome.out == ""
    assert one_sentence(outcome.err), outcome.err
    assert re.search(words, outcome.err), outcome.err


OVERRIDES = {
    "no equals sign": ("drive.pressure", "KEY=VALUE"),
    "no key": ("=3", "KEY=VALUE"),
    "unknown key": ("drive.presure=3", "drive.pressure"),
    "wrong unit": ("drive.pressure=3 kg", "In an override, drive.pressure"),
    "no such layer": ("layers.7.angle=3", "between 0 and 4"),
    "a layer by name": ("layers.CR.angle=3", "between 0 and 4"),
    "below a number": ("drive.pressure.x=3", "drive.pressure"),
    "empty value": ("drive.pressure=", "drive.pressure"),
    "a table in a value": ("drive.pressure=3\nx=4", "drive.pressure"),
}


@pytest.mark.parametrize("override, words", OVERRIDES.values(), ids=OVERRIDES.keys())
def test_a_bad_override_is_refused_in_one_sentence(command_line, one_sentence, override, words):
    outcome = command_line("case", "--set", override)
    assert outcome.status == 2
    assert one_sentence(outcome.err), outcome.err
    assert re.search(words, outcome.err), outcome.err


@pytest.mark.parametrize("name", ["missing.toml", ".", "a\0b.toml"])
def test_a_file_that_is_no_case(tmp_path, monkeypatch, command_line, one_sentence, name):
    monkeypatch.chdir(tmp_path)
    outcome = command_line("case", name)
    assert outcome.status == 2
    assert one_sentence(outcome.err), outcome.err


def test_a_binary_file_is_no_case(tmp_path, command_line, one_sentence):
    (tmp_path / "x.toml").write_bytes(b"\xff\xfe\x00[valve]")
    outcome = command_line("case", tmp_path / "x.toml")
    assert outcome.status == 2 and one_sentence(outcome.err), outcome.err
