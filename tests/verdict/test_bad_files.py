"""Bad files: every one is judged or answered by a sentence, none ends in a traceback."""

import json

import numpy as np
import pytest

pytestmark = pytest.mark.filterwarnings("error::RuntimeWarning")  # numpy's would be printed beside the verdict

HEADS = ("time,p", "t [ms];p [kPa]", "sample,p", "Zeitstempel;Druck [bar]", "time [furlong],p", "", "p", "# time p")
HEADS += ('"time,p', "time,p,q", "t/s x\ns Pa", "Zeit\tDruck", "é,ü", "[s]")
CELLS = ("", *'NaN inf - 1e400 1e-320 abc 1,5 0x10 12:00:00 --5 1e99 ½ "'.split(), "2026-13-45 25:61")
INJURIES = (*(word.encode() for word in 'nan inf - ,, ;; 1e308 1e99 # text 1_0 "'.split()), b"\xb5", b"\0", b"\r", b" ")


def rows(rng):
    """Lines of a record of a few samples, in one of the ways of instruments, and what stands between their cells."""
    count, columns = int(rng.choice([0, 1, 2, 7, 15, 16, 40, 70, 130])), int(rng.integers(1, 4))
    uneven = rng.choice([1.0, 1.0, 1.0, rng.uniform(0.1, 9)], count)
    time = np.cumsum(10.0 ** rng.integers(-6, 6) * rng.choice([1e-3, 0.01, 1.0]) * uneven)
    data = []
    for _ in range(columns):
        values = rng.choice([0.0, 1.0, 1e30, 1e-30]) * np.sin(rng.uniform(0.1, 3) * np.arange(count))
        data.append(values + rng.choice([0.0, 0.1]) * rng.standard_normal(count) + rng.choice([0.0, 5.0]))
    separator = str(rng.choice([",", ";", "\t", " ", ", ", "  "]))
    moments = np.datetime64("2026-03-01T12:00:00") + (1000 * np.minimum(time, 1e9)).astype("timedelta64[ms]")
    first = moments.astype(str) if rng.random() < 0.2 else [f"{t:.6g}" for t in time]
    return [separator.join([a, *(f"{b:.6g}" for b in others)]) for a, *others in zip(first, *data)], separator


def spoiled(rng) -> bytes:
    """A file with one to five faults of those who write it, and up to five injuries by chance."""
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
    encoding = str(rng.choice(["utf-8", "utf-16", "latin-1", "utf-8-sig"]))
    data = bytearray("\n".join(lines).encode(encoding, "replace"))
    for _ in range(int(rng.integers(0, 6)) if rng.random() < 0.5 else 0):
        at, kind = int(rng.integers(0, len(data) + 1)), rng.random()
        if kind < 0.6:
            data[at:at] = INJURIES[int(rng.integers(len(INJURIES)))]
        elif kind < 0.8:
            del data[at : at + int(rng.integers(1, 20))]
        else:
            data[at : at + 1] = rng.integers(0, 256, 3, dtype=np.uint8).tobytes()
    return bytes(data)


def check(command_line, folder, one_sentence, seeds):
    """Files are judged, and the JSON of that holds numbers alone, or answered by one sentence about them."""
    statuses = []
    for seed in seeds:
        rng, file = np.random.default_rng([11, seed]), folder / "spoiled.csv"
        file.write_bytes(spoiled(rng))
        more = [["--rate", "100"], ["-c", "2"], ["--time-unit", "ms"], ["--since", "0.1"], []][int(rng.integers(5))]
        options = [*more, *(name for name in ("--skip-bad", "--json") if rng.random() < 0.5)]
        told = command_line("verdict", file, *options)
        assert told.status in (0, 2), (seed, told)
        assert "Traceback" not in told.err and "Warning" not in told.err, (seed, told.err[-400:])
        if told.status:
            assert one_sentence(told.err) and "spoiled.csv" in told.err, (seed, told.err)
        elif "--json" in options:
            json.loads(told.out, parse_constant=lambda name: pytest.fail(f"{name} in the JSON of {seed}"))
        else:
            assert told.out.strip(), seed
        statuses.append(told.status)
    assert 0.1 * len(seeds) < statuses.count(0) and 0.25 * len(seeds) < statuses.count(2), len(statuses)


def test_bad_files_are_answered_by_sentences(command_line, tmp_path, one_sentence):
    check(command_line, tmp_path, one_sentence, range(40))


@pytest.mark.slow
def test_no_bad_file_ends_in_a_traceback(command_line, tmp_path, one_sentence):
    check(command_line, tmp_path, one_sentence, range(40, 4000))
