"""The commands transient, resume, verdict and compare."""

import json
from dataclasses import replace
from types import SimpleNamespace

import h5py
import numpy as np
import pytest

from dbvfiv.cli.results import _signals_of_run
from dbvfiv.errors import CaseError
from dbvfiv.studies import session
from dbvfiv.studies.recognition import candidates_of
from dbvfiv.studies.transient.study import TransientResult
from dbvfiv.verdict import judge
from tests.small_valves import SMALL, settings

SHORT = settings(SMALL | {"transient.duration": 0.02, "transient.save_every": 0.005})


def test_transient_and_what_reads_it(command_line, tmp_path):
    path, figures = tmp_path / "run.h5", tmp_path / "figures"
    outcome = command_line("transient", *SHORT, "-o", path, "--plots", figures, "--json")
    assert outcome.status == 0, outcome.err
    document = json.loads(outcome.out)
    for key in ("verdict", "amplitude", "frequency", "mean", "cycles_observed", "periodicity_error", "steps", "time"):
        assert key in document
        assert key in document["mass_flow"] or key in ("steps", "time")
        assert key in document["lip_opening"] or key in ("steps", "time")
        assert key in document["lip_displacement"] or key in ("steps", "time")
    assert document["steps"] == 20 and document["time"] == pytest.approx(0.02)
    drawn = {p.name for p in figures.iterdir()}
    names = ("history", "phase-portrait", "spectrum", "centre-line-cycle", "energies", "lip-wave")
    assert {f"{name}.png" for name in names} <= drawn
    assert command_line("info", path).status == 0
    outcome = command_line("resume", path, "--duration", "25 ms", "--json")
    assert json.loads(outcome.out)["steps"] == 25
    outcome = command_line("compare", path, path, "-o", tmp_path / "both.png")
    assert outcome.status == 0 and (tmp_path / "both.png").exists()
    outcome = command_line("verdict", path, "--json")
    assert [s["name"] for s in json.loads(outcome.out)["signals"]] == ["mass_flow", "lip_opening"]


@pytest.mark.slow
def test_animation(command_line, tmp_path):
    assert command_line("transient", *SHORT, "--plots", tmp_path, "--animate", tmp_path / "run.gif").status == 0
    assert (tmp_path / "run.gif").read_bytes()[:3] == b"GIF"


def write(path, t, *columns, header=""):
    np.savetxt(path, np.column_stack([t, *columns]), delimiter=",", header=header, comments="")
    return path


def test_verdict_of_csv(command_line, tmp_path):
    """Two signals whose names look alike in files have one each."""
    t = np.linspace(0, 10, 2001)
    file = write(
        tmp_path / "a.csv", t, 2 + np.sin(20 * t), np.exp(-0.5 * t) * np.cos(20 * t), header="t,lift (in),lift_in"
    )
    outcome = command_line("verdict", file, "--json", "--plots", tmp_path / "figures")
    lift, drag = json.loads(outcome.out)["signals"]
    assert (lift["name"], lift["verdict"]) == ("lift (in)", "limit cycle")
    assert lift["frequency"] == pytest.approx(20 / (2 * np.pi), rel=1e-6)
    assert (lift["mean"], lift["amplitude"], lift["rms"]) == pytest.approx((2, 1, np.sqrt(0.5)), rel=1e-3)
    assert (lift["smallest"], lift["largest"]) == pytest.approx((1, 3), abs=1e-3)
    assert lift["peaks"][0]["frequency"] == pytest.approx(20 / (2 * np.pi), abs=0.1)
    assert drag["verdict"] == "decayed"
    assert {p.name for p in (tmp_path / "figures").iterdir()} == {"lift-in.png", "lift-in-2.png"}
    outcome = command_line("verdict", file, "-c", "lift_in")
    assert outcome.out.startswith("lift_in: decayed")


def test_columns_of_a_run_have_numbers_too():
    history = {name: np.zeros(3) for name in ("time", "mass_flow", "lip_opening")}
    run = SimpleNamespace(history=history)
    assert [signal.name for signal in _signals_of_run(run, ["2", "lip_opening"])] == ["mass_flow", "lip_opening"]
    with pytest.raises(CaseError, match="no column '4'"):
        _signals_of_run(run, ["4"])


def test_a_run_is_judged_as_it_judged_itself(monkeypatch, command_line, tmp_path):
    """From where its drive holds still, and by what it knows beside each signal."""
    t = np.linspace(0.0, 4.0, 2001)
    rings = np.minimum(t / 0.5, 1.0) * (1.0 + 0.1 * np.sin(50.0 * t))
    held, moving = t >= 0.5, judge(t[t >= 0.5], rings[t >= 0.5])
    told = replace(moving, name="chatters", reason="Faces meet again and again.")
    known = {
        "verdict": "chatters",
        "mass_flow": told.summary(),
        "lip_opening": told.summary(),
        "chatter": {"rate": 2.0},
    }
    run = SimpleNamespace(kind="transient", verdict=known)
    run.history = {"time": t, "mass_flow": rings, "lip_opening": rings, "lip_displacement": rings}
    run.judged_from = TransientResult.judged_from.fget(run)
    monkeypatch.setattr(session, "load_result", lambda _: run)
    h5py.File(tmp_path / "r.h5", "w").close()

    def found(*options):
        document = json.loads(command_line("verdict", tmp_path / "r.h5", *options, "--json").out)
        return {one.pop("name"): one for one in document["signals"]}

    for name, one in found().items():
        assert {key: one[key] for key in known[name]} == known[name], name
    (other,) = found("-c", "lip_displacement").values()
    assert other["verdict"] == "limit cycle" and other["smallest"] == rings[held].min()
    (whole,) = found("-c", "mass_flow", "--since", 0).values()
    assert whole["verdict"] != "chatters" and whole["smallest"] == 0.0
    (candidate,) = candidates_of(run, 0.02)
    assert candidate.frequency == pytest.approx(50.0 / (2 * np.pi), rel=1e-3)


def test_verdict_without_times(command_line, tmp_path):
    file = tmp_path / "one.txt"
    np.savetxt(file, np.sin(2 * np.pi * 5 * np.arange(4000) / 500))
    outcome = command_line("verdict", file, "--rate", 500, "--json")
    assert json.loads(outcome.out)["signals"][0]["frequency"] == pytest.approx(5, rel=1e-6)


@pytest.mark.parametrize(
    "text, words",
    [
        ("", "no numbers"),
        ("1,2\n3\n", "line 2"),
        ("t,x\n1,a\n", "line 2"),
        ("0,1\n0,2\n1,3\n", "do not increase"),
        ("1\n2\n3\n", "--rate"),
    ],
)
def test_verdict_refuses_in_one_sentence(misused, tmp_path, text, words):
    file = tmp_path / "bad.csv"
    file.write_text(text)
    misused(words, "verdict", file)
