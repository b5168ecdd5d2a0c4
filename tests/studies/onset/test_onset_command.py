"""The command onset: JSON keys, result file, figure."""

import json

import pytest

from dbvfiv.cli import run
from dbvfiv.studies.session import load_result
from tests.small_valves import settings

PLAIN = {"onset.normal_form": False, "onset.coarse_mesh": 0}
SETTINGS = settings({"mesh.around": 8, "mesh.along": 16, "damping.alpha": 0} | PLAIN, {})


@pytest.fixture(scope="module")
def outcome(tmp_path_factory):
    folder = tmp_path_factory.mktemp("onset")
    path = folder / "onset.h5"
    import contextlib
    import io

    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        kept = "--json", "-o", str(path), "--plots", str(folder)
        status = run(["onset", "--over", "density=1:1000:15:log", "--set=drive.pressure=6 kPa", *SETTINGS, *kept])
    return status, json.loads(out.getvalue()), path


def test_keys_that_scripts_rely_on(outcome):
    status, document, _ = outcome
    assert status == 0
    (point,) = document["points"]
    assert {
        "parameter",
        "value",
        "frequency",
        "growth_rate",
        "criticality",
        "first_lyapunov_coefficient",
        "uncertainty",
    } <= set(point)
    assert point["parameter"] == "density" and point["confirmed"] and point["criticality"] is None
    assert point["below"]["unstable_count"] == point["below"]["unstable_count_independent"] == 2


def test_the_file_says_the_same(outcome):
    _, document, path = outcome
    result = load_result(path)
    assert result.complete and result.summary()["points"] == document["points"]
    assert result.summary()["scan"] == document["scan"]
    again = load_result(result.save(path.with_name("again.h5")))
    assert again.summary()["points"] == document["points"]
    assert "stable above" in "\n".join(result.lines())


def test_figure(outcome):
    assert (outcome[2].parent / "onset.png").stat().st_size > 10_000


def test_the_command_says_what_is_fixed(command_line, misused, outcome):
    options = settings({"mesh.around": 6, "mesh.along": 10} | PLAIN)
    done = command_line("onset", "--over", "alpha=0:40:3", *options, "-p", "4 kPa", "--density", 10)
    assert done.status == 0, done.err
    assert done.out.startswith("At 4 kPa static, 10 kg/m³, quasi-steady, β = 0.003 s; class SS alone (")
    _, document, path = outcome
    assert document["fixed"]["pressure"] == 6e3 and "density" not in document["fixed"]
    (figure,) = load_result(path).figures().values()
    assert "6 kPa static" in figure.axes[0].get_title("left")
    misused("onset.over", "onset", "--over", "density", "--density", 10)
    misused("Workers belong to maps", "resume", path, "--workers", 2)
