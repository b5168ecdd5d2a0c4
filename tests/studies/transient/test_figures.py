"""Figures and films of time histories: what they say is what the result holds."""

from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image

import dbvfiv
from dbvfiv.errors import CaseError
from dbvfiv.studies.case import thesis_case
from dbvfiv.studies.transient.figures import draw_together, spectra
from dbvfiv.studies.transient.study import Together
from dbvfiv.verdict import Series, in_steps


def texts(figure):
    """Titles and labels of a figure."""
    return [text for axes in figure.axes for text in (axes.get_title("left"), axes.get_xlabel(), axes.get_ylabel())]


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    path = tmp_path_factory.mktemp("run") / "run.h5"
    changes = {"mesh.around": 6, "mesh.along": 8, "transient.duration": 0.04, "drive.pressure": 12e3}
    return dbvfiv.load(thesis_case(), changes).transient(output=path)


def test_the_imbalance_has_an_axis_of_its_own(run):
    figure = run.figures(only=["energies"])["energies"]
    *_, rest = figure.axes
    assert rest.get_ylabel().startswith("Imbalance, ")
    factor = {"J": 1.0, "mJ": 1e3, "µJ": 1e6, "nJ": 1e9}[rest.get_ylabel().split(", ")[1]]
    assert np.allclose(rest.lines[0].get_ydata(), factor * run.history["balance"])
    reach = np.ptp(rest.get_ylim()) / np.ptp(rest.lines[0].get_ydata())
    assert reach < 3.0  # it can be seen
    assert "of the work turned over" in rest.get_title("left")


def test_runs_side_by_side_say_which_verdicts_are_not_certain(run, monkeypatch):
    for decided in (True, False):
        monkeypatch.setitem(run.verdict, "decided", decided)
        legend = [text.get_text() for text in draw_together([run, run], ["one", "two"]).legends[0].get_texts()]
        for line in (*Together([run], ["one"]).lines()[1:], *legend, run.lines()[0]):
            assert ("(not certain)" in line) is not decided, line


def test_spectra_say_their_resolution_and_print_no_more_digits(run, monkeypatch):
    half = 20  # of 40 ms
    fine = 1.0 / Series.of(run.history["time"][half:], run.history["mass_flow"][half:]).duration
    monkeypatch.setitem(run.verdict["lip_opening"], "frequency", 54.98)
    figure = run.figures(only=["spectrum"])["spectrum"]
    assert f"resolution {fine:.2g} Hz" in figure.get_suptitle()
    assert figure.axes[1].get_title("right").endswith(f" {in_steps(54.98, fine)} Hz") and fine > 1
    time = np.append(1e-4 * np.arange(1000), 0.1 + 1e-3 * np.arange(401))  # short steps and long ones, half at 0.25 s
    waves = dict.fromkeys(("mass_flow", "lip_opening"), np.sin(400.0 * time))
    figure = spectra(SimpleNamespace(history={"time": time} | waves, case=run.case, verdict={}))
    assert "resolution 4 Hz" in figure.get_suptitle()
    assert in_steps(54.98, 50.0) == "55" and in_steps(54.98, 0.3) == "55.0" and in_steps(54.983, 0.02) == "54.98"


def test_figures_of_runs_say_clear_opening_and_static_pressure(run):
    drawn = run.figures(only=["history", "phase-portrait", "station-pressures"])
    assert "Clear lip opening, mm" in texts(drawn["history"])
    assert "Velocity of one lip, m/s" in texts(drawn["phase-portrait"])
    assert "Static pressure, kPa" in texts(drawn["station-pressures"])


@pytest.mark.slow
def test_films_of_a_run_take_cycles_and_of_modes_a_mode(run, coarse_run, command_line, tmp_path, misused):
    file, modes = run.path, coarse_run.states[0].modes(count=4, density=10, alpha=0)
    outcome = command_line("plot", file, "-o", tmp_path, "--only", "history", "--animate", 1)
    assert outcome.status == 0, outcome.err
    (film,) = tmp_path.glob("*.gif")
    assert film.name in ("run.gif", "last-cycle.gif")
    with Image.open(film) as picture:
        assert picture.n_frames > 10
    shapes = modes.save(tmp_path / "modes.h5")
    for path, number, words in (
        (file, 500, "--animate 500"),
        (file, 0, "1 or more"),
        (shapes, 40, "40"),
        (coarse_run.path, 1, "does not move"),
    ):
        misused(words, "plot", path, "-o", tmp_path / "new", "--animate", number)
        assert not (tmp_path / "new").exists()  # misuse shows before anything is drawn
    with pytest.raises(CaseError, match="at least 2 frames"):
        run.animate(tmp_path / "one.gif", frames=1)
