"""Bad files: every one is judged or answered by a sentence, none ends in a traceback."""

import numpy as np
import pytest

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


def answer(command_line, folder, seed):
    rng = np.random.default_rng([11, seed])
    file = folder / "spoiled.csv"
    file.write_bytes(spoiled(rng))
    options = [
        [],
        ["--skip-bad"],
        ["--rate", "100"],
        ["-c", "2"],
        ["--time-unit", "ms"],
        ["--since", "0.1"],
        ["--json"],
    ]
    return command_line("verdict", file, *options[int(rng.integers(len(options)))]), file


def check(command_line, folder, seeds):
    refused = 0
    for seed in seeds:
        told, _ = answer(command_line, folder, seed)
        assert told.status in (0, 2), (seed, told.status, told.err[-400:])
        assert "Traceback" not in told.err and "Warning:" not in told.err, (seed, told.err[-400:])
        if told.status:
            refused += 1
            assert told.err.strip().endswith((".", ")")) and "spoiled.csv" in told.err.replace("\n", ""), (
                seed,
                told.err,
            )
        else:
            assert told.out.strip(), seed
    return refused


def test_bad_files_are_answered_by_sentences(command_line, tmp_path):
    assert 10 < check(command_line, tmp_path, range(60)) < 60


@pytest.mark.slow
def test_no_bad_file_ends_in_a_traceback(command_line, tmp_path):
    assert check(command_line, tmp_path, range(60, 60 + FILES)) > FILES / 4
