"""Records as instruments write them: units, decimal commas, gaps, missing values, noise; and files that are none."""

import json

import numpy as np
import pytest

from dbvfiv.verdict import Series, judge, spectrum
from dbvfiv.verdict.motion import judge_record
from dbvfiv.verdict.table import read_table

T = np.linspace(0.0, 10.0, 2001)
SINE = 2 + np.sin(2 * np.pi * 3.0 * T)


def text_of(rows, header="", separator=",", decimal="."):
    lines = [separator.join(f"{value:.9g}".replace(".", decimal) for value in row) for row in rows]
    return "\n".join([*([header] if header else []), *lines]) + "\n"


def record(tmp_path, text, encoding="utf-8"):
    file = tmp_path / "record.csv"
    file.write_bytes(text.encode(encoding))
    return file


def judged(command_line, file, *options):
    outcome = command_line("verdict", file, "--json", *options)
    assert outcome.status == 0, outcome.err
    return json.loads(outcome.out)["signals"]


HEADERS = {
    "time [ms],p": 1e-3,
    "t (us),p": 1e-6,
    '"Time, ms",p': 1e-3,
    "Zeit in ms,Druck": 1e-3,
    "t/ms,p/kPa": 1e-3,
    "t_ms,p": 1e-3,
    "Time [µs],p": 1e-6,
    "time (min),p": 60.0,
    "time [s],p": 1.0,
    "run time,p": 1.0,
    "ms,kPa": 1e-3,
    "time,p\n[ms],[kPa]": 1e-3,
    "time,p\nms,kPa": 1e-3,
    "# time [ms], p": 1e-3,
    "Logger 7,\nRate,200 Hz\ntime [ms],p": 1e-3,
}


@pytest.mark.parametrize("header", HEADERS)
def test_units_of_time_in_the_header(tmp_path, header):
    table = read_table(record(tmp_path, text_of(np.column_stack([T / HEADERS[header], SINE])[:20], header)))
    assert table.seconds(0) * table.values[:, 0] == pytest.approx(T[:20]) and len(table.names) == 2


def test_a_unit_may_be_given(command_line, tmp_path):
    file = record(tmp_path, text_of(np.column_stack([1e3 * T, SINE]), "time,p"))
    assert judged(command_line, file, "--time-unit", "ms")[0]["frequency"] == pytest.approx(3.0, rel=1e-5)


@pytest.mark.parametrize("header", ["time [fortnights],p", "time,p\n[steps],[kPa]", "t/T,p"])
def test_units_that_are_none_of_time_are_refused(misused, tmp_path, header):
    misused("no unit of time", "verdict", record(tmp_path, text_of(np.column_stack([T, SINE]), header)))


@pytest.mark.parametrize("separator", [";", "\t", " "])
@pytest.mark.parametrize("encoding", ["utf-8-sig", "latin-1", "utf-16"])
def test_decimal_commas_and_encodings(tmp_path, separator, encoding):
    header, rows = separator.join(["Zeit", "Öffnung"]), np.column_stack([T, SINE])[:20]
    text = text_of(rows, header, separator, ",").replace("\n", "\r\n")
    table = read_table(record(tmp_path, text, encoding))
    assert table.names == ("Zeit", "Öffnung") and table.values == pytest.approx(rows)


def test_blank_lines_and_separators_at_the_end(command_line, tmp_path):
    lines = text_of(np.column_stack([T, SINE]), "t,p").splitlines()
    text = "\n\n".join(line + "," for line in lines[:50]) + "\n,,\n" + "\n".join(lines[50:])
    assert judged(command_line, record(tmp_path, text))[0]["frequency"] == pytest.approx(3.0, rel=1e-5)


BAD = {"NaN": "nan", "": "nothing", "overload": "overload", "1e400": "1e400"}


@pytest.mark.parametrize("cell", BAD)
def test_rows_without_a_number_are_named_or_skipped(command_line, tmp_path, one_sentence, cell):
    lines = text_of(np.column_stack([T, SINE]), "t,p").splitlines()
    for row in (1500, 1800, 1801):
        lines[row] = f"{lines[row].split(',')[0]},{cell}"
    file = record(tmp_path, "\n".join(lines))
    outcome = command_line("verdict", file)
    assert outcome.status == 2 and one_sentence(outcome.err), outcome.err
    assert "line 1501" in outcome.err and BAD[cell] in outcome.err.lower() and "2 more rows" in outcome.err
    assert "--skip-bad" in outcome.err
    (found,) = judged(command_line, file, "--skip-bad")
    assert found["skipped_rows"] == 3 and found["verdict"] == "limit cycle"
    assert found["frequency"] == pytest.approx(3.0, rel=1e-4)
    assert "3 of 2001 rows" in command_line("verdict", file, "--skip-bad").out


def test_times_are_in_the_first_column_also_where_channels_have_numbers_for_names(command_line, tmp_path):
    file = record(tmp_path, text_of(np.column_stack([T, SINE, 0 * T]), "time,1,2"))
    found = judged(command_line, file)
    assert [one["name"] for one in found] == ["1", "2"]
    assert found[0]["frequency"] == pytest.approx(3.0, rel=1e-5)


def test_missing_values_of_other_columns_do_not_matter(command_line, tmp_path):
    lines = [f"{t:.6g},{x:.6g},{'' if i % 7 else 1}" for i, (t, x) in enumerate(zip(T, SINE))]
    file = record(tmp_path, "t,p,rare\n" + "\n".join(lines))
    assert judged(command_line, file, "-c", "p")[0]["skipped_rows"] == 0


@pytest.mark.parametrize(
    ("row", "last"),
    [("0.3,#N/A,6", 6.0), ("0.3,#NA,6 # NA", 6.0), ("0.3,5,#n/a", np.nan), ("0.3,5,6#N/A = missing", 6.0)],
)
def test_a_missing_value_of_spreadsheets_is_a_cell_and_no_remark(tmp_path, row, last):
    table = read_table(record(tmp_path, f"t,a,b\n0.1,1,2\n0.2,3,4\n{row}\n"))
    assert table.values[2, 2] == pytest.approx(last, nan_ok=True)
    assert np.isnan(table.values[2, 1]) == row.startswith("0.3,#") and np.isfinite(table.values[:, 0]).all()


@pytest.mark.parametrize("text, words", [("t,p\n0,1\n", "a single sample"), ("t,p\n", "no numbers")])
def test_one_row_and_none(misused, tmp_path, text, words):
    misused(words, "verdict", record(tmp_path, text))


def test_names_with_commas_and_columns_by_number(tmp_path):
    table = read_table(record(tmp_path, '"time, s","lip, mm"\n0,1\n1,2\n'))
    assert table.names == ("time, s", "lip, mm") and table.index("2") == 1 and table.index("lip") == 1
    with pytest.raises(ValueError, match="no column '3'"):
        table.index("3")


def test_a_gap_is_named_and_the_longest_part_judged():
    keep = (T < 2.0) | (T > 3.13)
    verdict = judge(T[keep], SINE[keep])
    assert verdict.name == "limit cycle", verdict.reason
    assert verdict.frequency == pytest.approx(3.0, rel=1e-5)
    assert verdict.judged == (pytest.approx(3.135), 10.0)
    (note,) = verdict.notes
    assert "a gap from 1.995 to 3.135 s" in note and "3.135 to 10 s" in note


def test_a_gap_in_the_middle_of_many_leaves_too_few(command_line):
    keep = np.arange(len(T)) % 40 < 12
    verdict = judge(T[keep], SINE[keep])
    assert verdict.name == "undecided" and "between two gaps" in verdict.reason and "50 gaps" in verdict.notes[0]


def test_uneven_samples_are_said_to_be_interpolated():
    t = np.sort(np.concatenate([np.linspace(0, 10, 3000), np.random.default_rng(5).uniform(0, 10, 2000)]))
    verdict = judge(t, 2 + np.sin(6 * np.pi * t))
    assert verdict.name == "limit cycle" and verdict.period == pytest.approx(1 / 3, rel=1e-6)
    assert "uneven" in verdict.notes[0]
    assert judge(np.round(T, 4), SINE).notes == ()


def test_a_long_record_with_rounded_times_keeps_its_samples_and_its_tones():
    t = np.arange(300_000) / 51_200
    series = Series.of(np.round(t, 6), np.sin(2 * np.pi * 20_000 * t))
    frequency, amplitude = spectrum(series)
    assert len(series.values) > 0.95 * len(t)
    assert frequency[np.argmax(amplitude)] == pytest.approx(20_000, abs=1.0)


NOISE = np.random.default_rng(7).standard_normal(len(T))
COLOURED = np.convolve(NOISE, [0.25, 0.5, 0.25], "same")


@pytest.mark.parametrize("noise", [NOISE, COLOURED, np.round(2 * NOISE) / 2, NOISE[: len(T)] ** 3 / 4])
@pytest.mark.parametrize("strength", [1e-3, 0.01])
def test_a_constant_under_noise_is_steady_and_the_noise_is_named(noise, strength):
    verdict = judge(T, 5 + 5 * strength * noise)
    assert (verdict.name, verdict.decided) == ("steady", True), verdict.reason
    assert "within noise" in verdict.reason
    assert verdict.noise == pytest.approx(5 * strength * noise[-401:].std(), rel=0.01)
    assert verdict.mean == pytest.approx(5, rel=4 * strength / 10)


def test_an_oscillation_that_died_into_noise_is_steady():
    t = np.linspace(0.0, 10.0, 10001)
    noise = np.random.default_rng(1).standard_normal(len(t))
    verdict = judge(t, 3 + np.exp(-t) * np.sin(6 * np.pi * t) + 0.01 * noise)
    assert verdict.name == "steady" and verdict.noise == pytest.approx(0.01, rel=0.1)


def test_much_noise_is_irregular_and_says_so():
    verdict = judge(T, 5 + NOISE)
    assert verdict.name == "irregular" and "too much to call it steady" in verdict.reason


@pytest.mark.parametrize(
    "values",
    [
        5 + 0.02 * np.sin(2 * np.pi * 3 * T) + 0.01 * NOISE,
        5 + 0.01 * np.sin(2 * np.pi * 40 * T) * np.sin(2 * np.pi * 0.37 * T) + 0.004 * NOISE,
        5 + 0.01 * np.cumsum(NOISE) / 20,
        5 + 0.01 * NOISE + 0.01 * T,
    ],
    ids=["line", "beats", "walk", "ramp"],
)
def test_motion_under_noise_is_not_steady(values):
    assert judge(T, values).name != "steady"


def test_a_system_that_moves_is_not_steady_within_noise():
    assert judge(T, 5 + 0.01 * NOISE, residual=0.5).name != "steady"


@pytest.mark.parametrize("frequency, duration, noise", [(3000.0, 4e-3, 0.01), (3000.0, 4e-3, 0.0), (250.0, 0.06, 0.01)])
def test_a_record_that_the_mains_are_too_slow_for_has_none(frequency, duration, noise):
    """Short of five cycles of the mains every line lay within their reach, and was called so."""
    t = np.linspace(0.0, duration, 400)
    found = judge_record(t, np.sin(2 * np.pi * frequency * t) + noise * np.random.default_rng(2).standard_normal(400))
    assert (found.name, found.decided) == ("limit cycle", True)
    assert found.frequency == pytest.approx(frequency, rel=1e-3)


@pytest.mark.parametrize("detrend", [True, False])
@pytest.mark.parametrize("values, certain", [(np.exp, True), (lambda t: 3 * t + 1, False), (lambda t: t * t, False)])
def test_what_grows_without_oscillating_grows(values, certain, detrend):
    """Rounding, which a polynomial leaves of itself, is no motion."""
    t = np.linspace(0.0, 10.0, 2000)
    found = judge_record(t, values(t), detrend=detrend)
    assert (found.name, found.decided) == ("growing", certain)


def test_few_samples_have_their_size():
    found = judge_record(np.arange(8.0), np.arange(8.0) % 2)
    assert (found.name, found.mean, found.amplitude, found.rms) == ("undecided", 0.5, 0.5, 0.5)


@pytest.mark.parametrize("frequency, phase", [(7.407, 0.021), (7.602, 0.242), (6.654, 0.447), (4.548, 0.21)])
def test_cycles_that_are_no_sines_neither_ring_down_nor_grow(frequency, phase):
    """Open for 0.3 of each cycle: multiples leaked into the rate of the one oscillation that was fitted."""
    time = np.arange(0.0, 4.0, 2e-3)
    share = (frequency * time + phase) % 1
    open_ = np.where(share < 0.3, np.sin(np.pi * share / 0.3), 0.0)
    found = judge_record(time, open_ + 0.01 * np.random.default_rng(1).standard_normal(time.size))
    assert found.name == "limit cycle" and found.frequency == pytest.approx(frequency, rel=1e-3)


def test_a_slow_ring_down_with_multiples_is_one():
    time = np.arange(0.0, 4.0, 2e-3)
    ring = np.exp(-0.05 * time) * (np.sin(2 * np.pi * 7.4 * time) + 0.5 * np.sin(4 * np.pi * 7.4 * time + 1))
    found = judge_record(time, ring + 0.01 * np.random.default_rng(1).standard_normal(time.size))
    assert found.name == "decayed" and found.lines[0]["rate"] == pytest.approx(-0.05, rel=0.05)


@pytest.mark.parametrize("noise", [0.0, 0.01])
@pytest.mark.parametrize("kind", ["spikes", "saw"])
def test_cycles_of_many_multiples_are_limit_cycles(kind, noise):
    """More multiples than are sought made them irregular."""
    time = np.arange(0.0, 10.0, 1e-3)
    share = 5.03 * time % 1
    values = np.exp(-(((share - 0.5) / 0.02) ** 2)) if kind == "spikes" else 2 * share - 1
    found = judge_record(time, values + noise * np.random.default_rng(3).standard_normal(time.size))
    assert found.name == "limit cycle" and found.decided and found.frequency == pytest.approx(5.03, rel=1e-3)
