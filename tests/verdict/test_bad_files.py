"""Bad files: every one is judged or answered by a sentence, none ends in a traceback."""

import json

import numpy as np
import pytest

from tests.verdict.test_record import text_of

FILES = 2000
HEADS = (
    "time,p",
    "t [ms];p [kPa]",
    "sample,p",
    "Zeitstempel;Druck [bar]",
    "time [furlong],p",
    "",
    "p",
    "# time p",
    '"time,p',
)
CELLS = (
    "",
    "NaN",
    "inf",
    "-",
    "1e400",
    "1e-320",
    "abc",
    "1,5",
    "0x10",
    "12:00:00",
    "2026-13-45 25:61",
    "--5",
    "1e99",
    "½",
    '"',
)


def rows(rng):
    """Lines of a record of a few samples, in one of the ways of instruments."""
    count = int(rng.choice([0, 1, 2, 7, 15, 16, 40, 70, 130]))
    time = np.cumsum(rng.choice([1e-3, 0.01, 1.0]) * rng.choice([1.0, 1.0, 1.0, rng.uniform(0.1, 9)], count))
    values = rng.choice([0.0, 1.0, 1e30, 1e-30]) * np.sin(rng.uniform(0.1, 3) * np.arange(count))
    values = values + rng.choice([0.0, 0.1]) * rng.standard_normal(count) + rng.choice([0.0, 5.0])
    separator = rng.choice([",", ";", "\t", " "])
    moments = np.datetime64("2026-03-01T12:00:00") + (1000 * time).astype("timedelta64[ms]")
    first = moments.astype(str) if rng.random() < 0.2 else [f"{t:.6g}" for t in time]
    return [f"{a}{separator}{b:.6g}" for a, b in zip(first, values)], separator


def spoiled(rng):
    """Bytes of a file with one to five faults."""
    lines, separator = rows(rng)
    lines = [str(rng.choice(HEADS)), *lines]
    for _ in range(rng.integers(1, 6)):
        at = int(rng.integers(len(lines)))
        fault = rng.integers(9)
        if fault == 0:
            lines[at] = separator.join([*lines[at].split(separator)[:-1], str(rng.choice(CELLS))])
        elif fault == 1:
            lines[at] = str(rng.choice(CELLS))
        elif fault == 2:
            lines[at] += separator + str(rng.choice(CELLS))
        elif fault == 3:
            lines.insert(at, lines[at])  # a time twice
        elif fault == 4:
            del lines[at:]
            lines = lines or [""]
        elif fault == 5:
            lines[at:] = lines[at:][::-1]
        elif fault == 6:
            lines = [separator.join(reversed(line.split(separator))) for line in lines]
        elif fault == 7:
            lines[at] = lines[at].replace(separator, "|")
        else:
            lines = [line.replace(".", ",") for line in lines]
    data = bytearray("\n".join(lines).encode(rng.choice(["utf-8", "utf-16", "latin-1"]), "replace"))
    for _ in range(int(rng.choice([0, 0, 1, 20]))):
        if data:
            data[int(rng.integers(len(data)))] = int(rng.integers(256))
    return bytes(data)


def injured(rng) -> bytes:
    """A record with a few random injuries of its bytes."""
    count = int(rng.integers(0, 120))
    columns = int(rng.integers(1, 4))
    t = np.cumsum(rng.uniform(0.5, 1.5, count) if rng.random() < 0.3 else np.full(count, 1.0)) * 10.0 ** rng.integers(
        -6, 6
    )
    data = [t] + [rng.normal(size=count) * 10.0 ** rng.integers(-9, 9) + rng.normal() for _ in range(columns - 1)]
    separator = rng.choice([",", ";", "\t", " ", ", ", "  "])
    decimal = rng.choice([".", ","]) if separator.strip() != "," else "."
    header = rng.choice(["", "time,p,q", "time [ms];p;q", "# a b", "t/s x\ns Pa", "Zeit\tDruck", "é,ü", '"a', "[s]"])
    text = text_of(np.column_stack(data), str(header), str(separator), str(decimal))
    encoding = rng.choice(["utf-8", "latin-1", "utf-8-sig", "utf-16"])
    raw = bytearray(text.encode(str(encoding), "replace"))
    words = [
        b"nan",
        b"inf",
        b"-",
        b",,",
        b";;",
        b"1e308",
        b"1e99",
        b"\n\n",
        b"#",
        b'"',
        b"\xb5",
        b"\0",
        b"\r",
        b"text",
        b"1_0",
        b" ",
    ]
    for _ in range(int(rng.integers(0, 6))):
        at = int(rng.integers(0, len(raw) + 1))
        kind = rng.random()
        if kind < 0.6:
            raw[at:at] = words[int(rng.integers(len(words)))]
        elif kind < 0.8:
            del raw[at : at + int(rng.integers(1, 20))]
        else:
            raw[at:at] = rng.integers(0, 256, 3, dtype=np.uint8).tobytes()
    return bytes(raw)


OPTIONS = (
    [],
    ["--skip-bad"],
    ["--rate", "100"],
    ["-c", "2"],
    ["--time-unit", "ms"],
    ["--since", "0.1"],
    ["--json"],
    ["--skip-bad", "--json"],
    ["--rate", "10", "--skip-bad", "--json"],
)


def check(command_line, one_sentence, file, make, seeds):
    """Judge or refuse every file in a sentence; a fair share of both."""
    outcomes = {0: 0, 2: 0}
    for seed in seeds:
        rng = np.random.default_rng([11, seed])
        file.write_bytes(make(rng))
        options = OPTIONS[int(rng.integers(len(OPTIONS)))]
        told = command_line("verdict", file, *options)
        assert told.status in outcomes, (seed, told.status, told.err[-400:])
        assert "Traceback" not in told.err and "Warning" not in told.err, (seed, told.err[-400:])
        if told.status:
            assert one_sentence(told.err) and file.name in told.err.replace("\n", ""), (seed, told.err)
        elif "--json" in options:
            json.loads(told.out, parse_constant=lambda name: pytest.fail(f"{name} in the JSON of {seed}"))
        else:
            assert told.out.strip(), seed
        outcomes[told.status] += 1
    assert min(outcomes.values()) > 0.1 * len(seeds), outcomes


@pytest.mark.parametrize("make", [spoiled, injured])
def test_bad_files_are_answered_by_sentences(command_line, one_sentence, tmp_path, make):
    check(command_line, one_sentence, tmp_path / "spoiled.csv", make, range(55))


@pytest.mark.slow
@pytest.mark.parametrize("make", [spoiled, injured])
def test_no_bad_file_ends_in_a_traceback(command_line, one_sentence, tmp_path, make):
    check(command_line, one_sentence, tmp_path / "spoiled.csv", make, range(55, FILES))
