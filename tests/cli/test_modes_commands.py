"""``dbvfiv modes`` and ``dbvfiv sweep``."""

import json

import pytest

import dbvfiv
from tests.small_valves import THESIS_SET, settings

COARSE = (*THESIS_SET, "--set", "mesh.around=8", "--set", "mesh.along=16", "--set", "damping.alpha=0")


def test_modes_json(command_line):
    outcome = command_line("modes", "cases/dbv12.toml", *COARSE, "-p", "6 kPa", "--density", 10, "--count", 4, "--json")
    assert outcome.status == 0, outcome.err
    document = json.loads(outcome.out)
    modes = document["modes"]
    assert len(modes) == 4 and all(
        set(mode) == {"growth_rate", "frequency", "damping_ratio", "residual", "symmetry"} for mode in modes
    )
    assert [m["growth_rate"] for m in modes] == sorted((m["growth_rate"] for m in modes), reverse=True)
    assert all(m["frequency"] >= 0 and m["residual"] < 1e-8 for m in modes)
    assert document["unstable_count"] == document["unstable_count_independent"] == 2 and document["stable"] is False
    assert (
        document["state"]["pressure"] == 6e3 and document["state"]["density"] == 10 and document["state"]["converged"]
    )


def test_set_and_options_say_the_same(command_line):
    keys = {"drive.pressure": "6 kPa", "fluid.density": 10, "modes.count": 2, "modes.in_vacuo": True}
    by_set = settings(keys, {})
    by_option = ("-p", "6e3 Pa", "--density", "10 kg/m^3", "-n", 2, "--in-vacuo")
    one, other = (json.loads(command_line("modes", *COARSE, *given, "--json").out) for given in (by_set, by_option))
    assert one == other and one["state"]["in_vacuo"]


def test_table_file_figures_and_what_reads_them(command_line, tmp_path):
    file = tmp_path / "m.h5"
    outcome = command_line("modes", *COARSE, "-p", "6 kPa", "--density", 10, "-n", 2, "-o", file)
    assert outcome.status == 0 and "growth rate" in outcome.out and "Flutters" in outcome.out and "m.h5" in outcome.out
    found = dbvfiv.load_result(file)
    assert f"{found.modes[0].growth_rate:.4f}" in outcome.out
    info = command_line("info", file)
    assert info.status == 0 and f"{found.modes[0].growth_rate:.4f}" in info.out
    written = command_line("plot", file, "-o", tmp_path, "--mode", 1, "--only", "centre-line-1", "--json")
    assert json.loads(written.out)["written"] == [str(tmp_path / "centre-line-1.png")]
    assert command_line("export", file, "--mode", 2).status == 0 and (tmp_path / "m-mode2.vtkhdf").exists()
    assert command_line("export", file).status == 0 and (tmp_path / "m.vtkhdf").exists()
    assert command_line("export", file, "--mode", 3).status == 2


def test_at_rest_in_vacuo(command_line):
    document = json.loads(command_line("modes", *COARSE, "-p", 0, "--in-vacuo", "-n", 2, "--json").out)
    assert (
        document["state"]["pressure"] == 0
        and document["stable"] is True
        and 10 < document["modes"][0]["frequency"] < 18
    )


def test_an_equilibrium_that_is_not_found(command_line, one_sentence):
    outcome = command_line(
        "modes", *COARSE, "--set", "steady.max_iterations=2", "--set", "steady.min_step=0.3", "-p", "100 Pa"
    )
    assert outcome.status == 1 and one_sentence(outcome.err.splitlines()[-1]) and "No equilibrium" in outcome.err


def test_sweep_json(command_line, tmp_path):
    outcome = command_line(
        "sweep", *COARSE, "-p", "6 kPa", "--over", "density=1:1000:5:log", "-n", 3, "-o", tmp_path / "s.h5", "--json"
    )
    assert outcome.status == 0, outcome.err
    document = json.loads(outcome.out)
    assert document["parameter"] == "density" and document["values"] == pytest.approx(
        [1, 1000**0.25, 1000**0.5, 1000**0.75, 1000]
    )
    for branch in document["branches"]:
        assert {"id", "growth_rate", "frequency", "confidence"} <= set(branch)
        assert all(len(branch[name]) == 5 for name in ("growth_rate", "frequency", "confidence"))
    assert document["certificate"]["certified"] and not document["interrupted"]
    assert dbvfiv.load_result(tmp_path / "s.h5").summary()["branches"] == document["branches"]


def test_sweep_table_and_figures(command_line, tmp_path):
    outcome = command_line(
        "sweep", *COARSE, "--density", 10, "--over", "pressure=2 kPa:12 kPa:3", "-n", 2, "--plots", tmp_path
    )
    assert outcome.status == 0, outcome.err
    assert "becomes stable near pressure" in outcome.out and "Certified" in outcome.out
    assert {path.name for path in tmp_path.iterdir()} == {"sweep.png", "root-locus.png"}
