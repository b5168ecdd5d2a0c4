"""``dbvfiv closure`` on the command line."""

from __future__ import annotations

import json

import pytest

from dbvfiv.studies.session import load_result
from tests.small_valves import SMALL, settings

COARSE = settings({"mesh.around": 6, "mesh.along": 10, "closure.max_step": "5 kPa"})


def test_one_json_document(command_line):
    done = command_line("closure", *settings(SMALL | {"closure.max_step": "5 kPa"}), "-p", "5 kPa", "--json")
    assert done.status == 0, done.err
    document = json.loads(done.out)
    point = document["points"][0]
    assert point["pressure"] == 5000.0 and point["closed"] is True
    assert {"sealed_length", "contact_force", "max_displacement", "lowest_stiffness_eigenvalue"} <= set(point)
    assert document["critical_pressure"] is None


@pytest.mark.slow
def test_both_supports_are_compared(command_line, tmp_path):
    for supports in ("contact", "held-lips"):
        keys = f"closure.supports={supports}"
        done = command_line("closure", *COARSE, "-p", "5 kPa", "--set", keys, "-o", tmp_path / f"{supports}.h5")
        assert done.status == 0, done.err
        assert [state.pressure for state in load_result(tmp_path / f"{supports}.h5").states] == [5e3]
    files = (tmp_path / "contact.h5", tmp_path / "held-lips.h5")
    both = command_line("compare", *files, "-o", tmp_path / "both.png")
    assert both.status == 0 and "held-lips" in both.out and (tmp_path / "both.png").exists()


@pytest.mark.slow
def test_a_wall_that_snaps_is_told_in_a_sentence(command_line, one_sentence):
    thin = {"valve.thickness_factor": 0.25, "closure.arclength": False, "closure.max_step": "0.5 kPa"}
    done = command_line("closure", *COARSE, *settings(thin, {}), "-p", "28 kPa")
    assert done.status == 1
    last = done.err.strip().splitlines()[-1]
    assert one_sentence(last) and "were reached" in last
