"""The page for a person: every part there, nothing fetched, nothing computed twice, failures said."""

from __future__ import annotations

import base64
import html
import io
import json
import re

import numpy as np
import pytest
from PIL import Image

from dbvfiv.studies.case import load_case
from tests.small_valves import THESIS_SET

SMALL = (
    *THESIS_SET,
    "--set",
    "mesh.around=8",
    "--set",
    "mesh.along=14",
    "--set",
    'steady.pressures=["2 kPa", "6 kPa"]',
    "--set",
    "onset.coarse_mesh=0",
)
LIGHT = ("--set", "drive.pressure=6 kPa", "--set", "fluid.density=75", "--set", "damping.alpha=0")

#: What the slow test in a browser has besides.
LEFT_OUT = [word for run in ("onset", "cycle", "closure") for word in ("--without", run)]


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A report of a state that flutters, without back pressure; the outcome of its command and the page."""
    from dbvfiv.cli import run

    page = tmp_path_factory.mktemp("report") / "page.html"
    arguments = ["report", *SMALL, *LIGHT, "--cells", "4", *LEFT_OUT, "-o", str(page)]
    assert run(arguments) == 0
    return arguments, page


def test_every_part_is_there(made):
    text = made[1].read_text()
    for name in ("valve", "steady", "modes", "classes", "damping", "onset", "map", "closure", "strains", "case"):
        assert f'<section id="{name}">' in text
    assert "Unstable under quasi-steady continuity" in text
    assert "It was left out." in text
    assert "this installation" in text


def test_the_case_on_the_page_is_the_case(made, tmp_path):
    (tmp_path / "again.toml").write_text(
        html.unescape(re.search(r"<pre>([^<]*)</pre></details>", made[1].read_text())[1])
    )
    case = load_case(tmp_path / "again.toml")
    assert (case.drive.pressure, case.fluid.density, case.mesh.around) == (6e3, 75.0, 8)


def test_pictures_are_in_the_page_and_nothing_is_fetched(made):
    text = made[1].read_text()
    page = re.sub(r"<script>.*?</script>", "", text, flags=re.DOTALL)
    assert not re.search(r"""(src|href)=["']?(https?:)?//""", page)
    images = re.findall(r'src="data:image/png;base64,([^"]+)"', page)
    assert len(images) >= 8
    for image in images:
        picture = Image.open(io.BytesIO(base64.b64decode(image)))
        assert picture.width > 300 and len(np.unique(np.asarray(picture.convert("L")))) > 20  # more than an empty frame
    numbers = [int(n) for n in re.findall(r"<figcaption>Figure (\d+)\.", page)]
    assert numbers == list(range(1, len(numbers) + 1))
    assert {"valve-live", "discharge-live", "map-live-0", "map-live-1"} <= set(
        re.findall(r'id="([\w-]+-live[\w-]*)"', page)
    )


def test_a_remark_is_made_once(made):
    page = made[1].read_text()
    warnings = re.findall(r"^Warning: .*$", page, flags=re.MULTILINE)
    assert warnings and len(warnings) == len(set(warnings))


@pytest.mark.slow
def test_a_second_report_computes_nothing(made, command_line):
    arguments, page = made
    folder = page.with_suffix("")
    before = {path.name: path.stat().st_mtime_ns for path in folder.iterdir()}
    assert set(before) == {f"dbv12-{run}.h5" for run in ("steady", "modes", "classes", "map")}
    outcome = command_line(*arguments, "--json")
    assert outcome.status == 0
    answers = json.loads(outcome.out)
    assert [one["question"] for one in answers["answers"]][:2] == [
        "How far does it open, what flows?",
        "Does it vibrate?",
    ]
    assert answers["missing"] == dict.fromkeys(("onset", "cycle", "closure"), "It was left out.")
    assert {path.name: path.stat().st_mtime_ns for path in folder.iterdir()} == before


@pytest.mark.slow
def test_a_run_that_gives_nothing_is_said_and_the_rest_is_there(command_line, one_sentence, tmp_path):
    page = tmp_path / "page.html"
    without = [word for name in ("modes", "classes", "map", "closure") for word in ("--without", name)]
    outcome = command_line(
        "report", *SMALL, "--set", "drive.kind=uniform", "--set", "drive.pressure=2 kPa", *without, "-o", page
    )
    assert outcome.status == 1
    assert one_sentence(outcome.err.strip().splitlines()[-1])
    text = page.read_text()
    assert "There is no result." in text and '<section id="steady">' in text


@pytest.mark.parametrize(
    "arguments, words",
    [
        (("--without", "mode"), "none of steady, modes, classes"),
        (("--cells", "2"), "cells"),
        (("-o", "/proc/none/page.html", "--without", "steady"), "cannot be written"),
    ],
)
def test_bad_arguments(command_line, one_sentence, arguments, words):
    outcome = command_line("report", *SMALL, *arguments)
    assert outcome.status == 2 and one_sentence(outcome.err) and words in outcome.err
