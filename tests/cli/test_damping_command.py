"""``dbvfiv damping``: what it prints, draws and refuses; parameters that the model of damping lacks."""

import json

import numpy as np
import pytest

import dbvfiv
from dbvfiv.drawing.materials import damping_figure
from dbvfiv.studies.case import thesis_case
from tests.small_valves import THESIS_SET

LOSS = ("--set", "damping.model=loss factor")
COARSE = (*THESIS_SET, "--set", "mesh.around=6", "--set", "mesh.along=8")


def test_loss_factors_of_the_12_inch_valve(command_line):
    outcome = command_line("damping", *LOSS, "--at", "5,40")
    assert outcome.status == 0 and outcome.err == ""
    lines = outcome.out.splitlines()
    assert lines[0].startswith("Loss factors, layer by layer, times 1") and "4 branches over 1 to 200 Hz" in lines[0]
    row = next(line for line in lines if line.startswith("SBR "))
    assert row.split()[1:3] == ["2.6", "%"] and row.endswith("tan delta 0.175, shipped for SBR (0.1 to 0.25)")
    matched = lines[next(i for i, line in enumerate(lines) if "Eq. 5.5" in line) :]
    assert "ratio at 5 Hz" in matched[1] and "ratio at 40 Hz" in matched[1]
    report = dbvfiv.load(thesis_case(), {"damping.model": "loss factor"}).damping()
    assert report.matches((5.0, 40.0))[1]["ratios"][0] == pytest.approx(0.175 / 2, rel=0.03)  # half of SBR's


def test_json_holds_the_same_from_python(command_line):
    document = json.loads(
        command_line("damping", *LOSS, "--set", "damping.loss_factor=2", "--json", "--at", "0.5,41").out
    )
    report = dbvfiv.load(thesis_case(), {"damping.model": "loss factor", "damping.loss_factor": 2}).damping()
    assert [m["name"] for m in document["materials"]] == ["CR", "SBR", "fibre", "EPDM"]
    for entry, material in zip(document["materials"], report.materials):
        np.testing.assert_allclose(
            entry["damping_ratio"], report.material_ratio(material, document["frequencies"]), rtol=1e-12
        )
    assert document["warning"].startswith("0.5 Hz lies outside") and document["materials"][0]["largest_error"] < 0.03


def test_rayleigh_damping_over_frequency(command_line):
    outcome = command_line("damping", *THESIS_SET, "--set", "damping.alpha=0", "--at", "1,10")
    assert outcome.status == 0 and outcome.out.startswith("Rayleigh damping, alpha = 0 1/s, beta = 0.003 s.")
    document = json.loads(command_line("damping", *THESIS_SET, "--set", "damping.alpha=0", "--json").out)
    np.testing.assert_allclose(
        document["rayleigh_ratio"], 0.003 * np.pi * np.array(document["frequencies"]), rtol=1e-12
    )


def test_a_figure_shows_data_fit_and_band(command_line, tmp_path):
    (tmp_path / "t.csv").write_text("frequency [Hz], tan delta\n0.5, 0.1\n5, 0.12\n50, 0.15\n500, 0.2\n")
    (tmp_path / "my.toml").write_text("[damping]\nmodel='loss factor'\n[materials.CR]\nloss_data='t.csv'\n")
    outcome = command_line("damping", tmp_path / "my.toml", "--plots", tmp_path / "figures")
    assert outcome.status == 0 and (tmp_path / "figures" / "damping.png").stat().st_size > 10_000

    upper, lower = damping_figure(dbvfiv.load(tmp_path / "my.toml").damping()).axes
    assert [0.5, 5, 50, 500] in [list(line.get_xdata()) for line in upper.lines]
    edges = {float(line.get_xdata()[0]) for line in upper.lines if len(set(line.get_xdata())) == 1}
    assert edges == {1.0, 200.0} and "CR: fit within" in upper.get_legend().get_texts()[0].get_text()


@pytest.mark.parametrize("name, model", [("loss_factor", "rayleigh"), ("beta", "loss factor")])
@pytest.mark.parametrize("study", ["sweep", "onset", "map", "sensitivity"])
def test_what_the_model_lacks_is_nothing_to_move(misused, study, name, model):
    span = f"{name}=0.001:0.1:3"
    options = {
        "sweep": ("--over", span, "-p", "1 kPa"),
        "onset": ("--over", span, "-p", "1 kPa"),
        "map": ("--y", span, "--x", "pressure=1000:2000:2"),
        "sensitivity": ("--of", name, "-p", "1 kPa"),
    }[study]
    both = f"{name}.*damping.model = '{model}'|damping.model = '{model}'.*{name}"
    misused(both, study, *COARSE, "--set", f"damping.model={model}", *options)


def test_the_worked_case(command_line):
    """Its table is made up, and says so."""
    outcome = command_line("damping", "cases/loss-factor.toml", "--json")
    materials = {entry["name"]: entry for entry in json.loads(outcome.out)["materials"]}
    assert materials["SBR"]["source"] == "tan delta measured, tan-delta.csv at 20 degC"
    assert materials["SBR"]["damping_ratio"][-1] > 1.3 * materials["SBR"]["damping_ratio"][0]
    assert all(entry["largest_error"] < 0.035 for entry in materials.values())
    with open("cases/tan-delta.csv") as file:
        assert "SYNTHETIC" in file.readline()
