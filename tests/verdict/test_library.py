"""Verdicts on records with known truths: right, with intervals that hold them, and the same for any length."""

import re
from datetime import datetime, timedelta

import numpy as np
import pytest

from dbvfiv.drawing.signal import signal
from dbvfiv.verdict import judge_record
from dbvfiv.verdict.table import read_table
from tests.pages import table_of
from tests.verdict.library import EACH, records

#: Samples up to which a record is judged in `make test`.
SHORT = 9_000


def judged(record):
    return judge_record(record.time, record.values)


def marks(record, verdict):
    """Distance of each known number from what was found, over half its 95 % interval."""
    line = min(verdict.lines, key=lambda one: abs(one["frequency"] - record.truths.get("frequency", 0.0)), default=None)
    found = []
    for name, truth in record.truths.items():
        source, key = (verdict.modulation, "frequency") if name == "modulation" else (line, name)
        if source and source.get(key) is not None and source.get(f"{key}_interval"):
            found.append(abs(source[key] - truth) / source[f"{key}_interval"])
    return found


def test_short_records_are_told_right():
    chosen = [record for record in records(1, seed=1) if len(record.time) < SHORT]
    assert len({record.kind for record in chosen}) >= 12
    wrong = [r.kind for r in chosen if judged(r).name not in r.names]
    assert len(wrong) <= 0.03 * len(chosen), wrong


#: Rows of the table of docs/evidence/time.md by words of their kinds: records told right, of how many, and intervals
#: that hold the truth, of how many.
ROWS = {
    "mains|noise|chaos and broad bands|bursts": (40, 40, 0, 0),
    "two lines 2 % apart|several lines|harmonics|slams": (40, 40, 47, 50),
    "modulated .*": (20, 20, 48, 50),
    "growth": (10, 10, 20, 20),
    "ring-down.*|opening": (40, 40, 112, 120),
    "a mode driven by noise": (10, 10, 3, 3),
    "line.*|clipped line": (59, 60, 109, 118),
}


def test_the_rows_are_those_of_the_page():
    table = table_of("evidence/time.md", "kind | told right")
    printed = [tuple(int(n) for n in re.findall(r"\d+", f"{row[1]} {row[2] or '0 of 0'}")) for row in table.rows[1:]]
    assert sorted(printed) == sorted(ROWS.values())


@pytest.mark.slow
@pytest.mark.random
def test_the_library_is_told_right_and_intervals_hold_the_truth():
    """Row by row, but for one record or interval of each."""
    found = {row: np.zeros(4, int) for row in ROWS}
    for record in records(EACH):
        verdict = judged(record)
        right = verdict.name in record.names
        distances = np.array(marks(record, verdict) if right else [])
        (row,) = (row for row in ROWS if re.fullmatch(row, record.kind))
        found[row] += right, 1, np.count_nonzero(distances <= 1), distances.size
    print("\n" + "\n".join(f"{row}: {tally}" for row, tally in found.items()))
    assert all(np.abs(found[row] - printed).max() <= 1 for row, printed in ROWS.items())


def ring(duration, noise=0.02):
    time = np.arange(0.0, duration, 2e-3)
    values = np.exp(-0.8 * time) * np.sin(2 * np.pi * 12 * time) + noise * np.random.default_rng(2).standard_normal(
        len(time)
    )
    return judge_record(time, values)


@pytest.mark.parametrize("duration", [2.0, 4.0, 10.0, 25.0])
def test_a_ring_down_is_the_same_in_records_of_any_length(duration):
    found = ring(duration)
    (line,) = found.lines
    assert found.name == "decayed" and abs(line["frequency"] - 12) < 1.5 * line["frequency_interval"]
    ratio = 0.8 / np.hypot(0.8, 2 * np.pi * 12)
    assert abs(line["damping_ratio"] - ratio) < 1.5 * line["damping_ratio_interval"] < 0.3 * ratio


def test_a_ring_down_loses_a_share_of_its_amplitude_a_cycle_and_no_more_than_all_of_it():
    time = np.arange(0.0, 4.0, 2e-3)
    values = np.exp(-1.283 * 4 * time) * np.sin(2 * np.pi * 4 * time)
    found = judge_record(time, values + 0.01 * np.random.default_rng(4).standard_normal(len(time)))
    assert found.name == "decayed" and found.amplitude_trend == pytest.approx(np.expm1(-1.283), abs=0.02)
    assert re.search(r"rings down by 7[123] % a cycle", found.reason), found.reason


@pytest.mark.parametrize("drift", [0.0, 0.5])
def test_a_line_under_noise_on_a_drifting_level_is_a_line(drift):
    time = np.arange(0.0, 8.0, 2e-3)
    values = np.sin(2 * np.pi * 38.3 * time) + drift * time + np.random.default_rng(4).standard_normal(len(time))
    found = judge_record(time, values)
    assert found.name == "limit cycle" and found.frequency == pytest.approx(38.3, abs=0.01)
    assert found.lines[0]["amplitude"] == pytest.approx(1.0, abs=0.05) and found.noise == pytest.approx(1.0, rel=0.05)


@pytest.mark.parametrize("growth", [2.0, 6.0])
def test_growth_has_its_amplitude_at_the_end_and_the_interval_of_that_at_the_start(growth):
    time = np.arange(0.0, 8.0, 2e-3)
    u, noise = time / time[-1] - 1, 0.02
    values = np.exp(growth * u) * np.sin(2 * np.pi * 12 * time)
    found = judge_record(time, values + noise * np.random.default_rng(4).standard_normal(len(time)))
    (line,) = found.lines
    assert found.name == "growing" and found.amplitude == pytest.approx(1.0, rel=0.05)
    assert abs(line["amplitude"] - np.exp(-growth)) < 1.5 * line["amplitude_interval"]
    # by Fisher's information of the logarithm of the amplitude at the end and of the growth
    moments = [np.mean(np.exp(2 * growth * u) * u**k) for k in range(3)]
    spread = np.linalg.inv([moments[:2], moments[1:]])
    half = 1.96 * noise * np.sqrt(2 / len(time) * (spread[0, 0] - 2 * spread[0, 1] + spread[1, 1]))
    assert line["amplitude_interval"] / line["amplitude"] == pytest.approx(half, rel=0.4)


@pytest.mark.parametrize("detrend", [True, False])
@pytest.mark.parametrize(("cycles", "decided"), [(2.5, False), (6.3, False), (14.2, True)])
def test_few_cycles_of_a_line_are_one_line_and_not_decided(cycles, decided, detrend):
    time = np.linspace(0.0, 1.0, 1000)
    values = np.sin(2 * np.pi * cycles * time) + 0.02 * np.random.default_rng(4).standard_normal(len(time))
    found = judge_record(time, values, detrend=detrend)
    assert (found.name, found.decided, found.cycles) == ("limit cycle", decided, int(cycles)), found.reason
    assert found.frequency == pytest.approx(cycles, rel=0.02) and len(found.lines) == 1
    assert decided or f"Only {int(cycles)} cycles have been seen" in found.reason


def test_lines_of_two_and_three_times_a_frequency_are_a_cycle_of_that_frequency():
    time = np.arange(0.0, 4.0, 1e-3)
    values = np.sin(2 * np.pi * 42 * time) + 0.6 * np.sin(2 * np.pi * 63 * time)
    found = judge_record(time, values + 0.05 * np.random.default_rng(4).standard_normal(len(time)))
    assert found.name == "limit cycle" and found.frequency == pytest.approx(21, abs=0.01) and found.cycles == 83
    assert [line["called"] for line in found.lines] == ["", "3 times 21 Hz"]
    assert found.harmonics[:3, 0] == pytest.approx([0, 1, 0.6], abs=0.02)


def test_a_drifting_level_makes_no_harmonics():
    time = np.arange(0.0, 4.0, 1e-3)
    values = np.sin(2 * np.pi * 10.3 * time) + 5 * time + 1e-3 * np.random.default_rng(4).standard_normal(len(time))
    found = judge_record(time, values)
    assert found.name == "limit cycle" and found.harmonics[0, 0] == pytest.approx(1.0, abs=0.01)
    assert found.harmonics[1:, 0].max() < 0.01


def test_a_level_without_noise_is_no_oscillation():
    time = np.arange(0.0, 10.0, 2e-3)
    assert judge_record(time, 5 - 3 * np.exp(-time / 2)).name == "decaying"
    assert judge_record(time, np.full(len(time), 5.0)).name == "steady"


@pytest.mark.parametrize(
    ("form", "separator", "decimal", "day"),
    [
        ("%d.%m.%Y %H:%M:%S.%f", ";", ",", 14),
        ("%m/%d/%Y,%H:%M:%S.%f", ",", ".", 14),
        ("%m/%d/%Y %I:%M:%S.%f %p", ",", ".", 14),
        ("%Y-%m-%d;%H:%M:%S.%f", ";", ".", 14),
        ("%d/%m/%Y %H:%M:%S.%f", ",", ".", 5),
        ("%d/%m/%Y,%H:%M:%S.%f", ",", ".", 12),
    ],
)
def test_dates_of_control_systems_are_read(form, separator, decimal, day, tmp_path):
    """Dates with the day before a slash, over the midnights after which they were in another month."""
    start = datetime(2026, 3, day, 23 if "%d/%m" in form else 11, 59, 59)
    head = "stamp" if separator not in form else f"date{separator}time"
    rows = [f"{head}{separator}p [bar]"]
    for k in range(100):
        stamp = (start + timedelta(milliseconds=20 * k)).strftime(form)
        rows.append(f"{stamp}{separator}{np.sin(0.2 * np.pi * k):.6f}".replace(".", decimal if decimal == "," else "."))
    text = "\n".join(rows).replace("14,03,2026", "14.03.2026")
    (tmp_path / "scada.csv").write_text(text)
    table = read_table(tmp_path / "scada.csv")
    assert len(table.names) == 2 and table.names[1] == "p [bar]" and table.seconds(0) == 1.0
    assert np.diff(table.values[:, 0]) == pytest.approx(0.02, abs=1e-6)
    assert table.values[:, 1] == pytest.approx(np.sin(0.2 * np.pi * np.arange(100)), abs=1e-6)


def test_dates_and_numbered_samples_are_read(command_line, tmp_path):
    time = np.arange(0.0, 6.0, 0.01)
    values = np.sin(2 * np.pi * 5 * time)
    moments = np.datetime64("2026-03-01T12:00:00.000") + (1000 * time).round().astype("timedelta64[ms]")
    (tmp_path / "iso.csv").write_text("\n".join(["when,p", *(f"{m},{v:.8f}" for m, v in zip(moments, values))]))
    (tmp_path / "numbered.csv").write_text("\n".join(["sample,p", *(f"{i},{v:.8f}" for i, v in enumerate(values))]))
    told = command_line("verdict", tmp_path / "iso.csv")
    assert told.status == 0 and "limit cycle" in told.out and "5 +- " in told.out
    (tmp_path / "winter.csv").write_text("when,p\n2026-10-25T02:59:59+02:00,1\n2026-10-25T02:00:00+01:00,2\n")
    assert np.diff(read_table(tmp_path / "winter.csv").values[:, 0]) == [1.0]
    asked = command_line("verdict", tmp_path / "numbered.csv")
    assert asked.status == 2 and "give their rate with --rate" in asked.err
    assert "5 +- " in command_line("verdict", tmp_path / "numbered.csv", "-c", "p", "--rate", "100").out


def test_bursts_are_irregular_and_no_noise():
    time = np.arange(0.0, 6.0, 2e-3)
    values = 0.15 * np.random.default_rng(3).standard_normal(len(time))
    for begin in (0.4, 1.9, 2.6, 4.1):
        after = np.maximum(time - begin, 0.0)
        values += np.exp(-6.0 * after) * np.sin(2 * np.pi * 25 * after)
    found = judge_record(time, values)
    assert found.name == "irregular" and "come back" in found.reason
    assert judge_record(time[:200], values[:200]).name in ("steady", "irregular")  # before the first of them


@pytest.mark.parametrize("rail", [0.6, 0.9])
def test_a_clipped_line_has_the_amplitude_it_had_before(rail):
    time = np.arange(0.0, 4.0, 1e-3)
    values = np.sin(2 * np.pi * 113.3 * time) + 0.05 * np.random.default_rng(6).standard_normal(len(time))
    (line,) = judge_record(time, np.clip(values, -rail, rail)).lines
    assert abs(line["amplitude"] - 1) < 1.5 * line["amplitude_interval"] < 0.02


def test_the_figure_has_the_envelope_ten_cycles_labels_and_a_phase_portrait():
    time = np.arange(0.0, 6.0, 2e-3)
    noise = 0.02 * np.random.default_rng(2).standard_normal(len(time))
    ring = np.exp(-0.8 * time) * np.sin(2 * np.pi * 12 * time) + noise
    upper, zoom, lower, portrait = signal("ring", time, ring, judge_record(time, ring)).axes
    swing = upper.lines[-2]  # above the level
    assert swing.get_ydata() == pytest.approx(np.exp(-0.8 * swing.get_xdata()), abs=0.05)
    assert np.ptp(zoom.lines[0].get_xdata()) == pytest.approx(10 / 12, abs=0.01)
    assert [text.get_text() for text in lower.texts] == ["12 Hz"]
    radius = np.hypot(portrait.lines[0].get_xdata(), portrait.lines[0].get_ydata() / (2 * np.pi * 12))
    assert radius[0] > 0.85 and radius[-1] < 0.65
    for values in (np.full(len(time), 5.0), 5 - 3 * np.exp(-time / 2), noise, np.where(time > 3, 1.0, 0.0)):
        assert signal("other", time, values, judge_record(time, values)).axes[2].get_xlim()[1] > 0
    assert signal("short", time[:3], ring[:3], judge_record(time[:3], ring[:3])).axes
