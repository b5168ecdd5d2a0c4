"""Malformed and impossible cases: status 2, one sentence that names the key, no traceback."""

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
def test_a_bad_case_is_refused_in_one_sentence(tmp_path, monkeypatch, misused, text, words):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bad.toml").write_text(text)
    misused(words, "case", "bad.toml")


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
def test_a_bad_override_is_refused_in_one_sentence(misused, override, words):
    misused(words, "case", "--set", override)


@pytest.mark.parametrize("name", ["missing.toml", ".", "a\0b.toml", "binary.toml"])
def test_a_file_that_is_no_case(tmp_path, monkeypatch, misused, name):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00[valve]")
    misused("", "case", name)
