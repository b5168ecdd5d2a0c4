"""The picture of a valve before anything is solved."""

import numpy as np

import dbvfiv
from dbvfiv.case.units import Units
from dbvfiv.drawing.style import put_in_units
from dbvfiv.drawing.views import valve_figure
from dbvfiv.studies.case import thesis_case

OWN = {
    "mesh.around": 8,
    "mesh.along": 12,
    "valve.wall": "uniform",
    "valve.lip_half_width": 0.18,
    "valve.cuff_length": 0.04,
    "valve.scale": 0.5,
    "valve.patches": [{"around_from": 0.9, "extra": 0.004}],
}


def texts(axes):
    return " ".join(text.get_text() for text in axes.texts)


def test_the_picture_shows_measures_wall_and_layers():
    valve = dbvfiv.load(thesis_case(), OWN)
    figure = valve_figure(valve.model)
    by_title = {axes.get_title(loc="left").split(",")[0].split(":")[0]: axes for axes in figure.axes}
    side, plan = by_title["Plane x = 0"], by_title["Plane y = 0"]
    for words in ("duckbill\n105 mm", "saddle\n140 mm", "cuff\n20 mm", "flange\n35 mm"):
        assert words in texts(side)
    wall = 0.5 * (14.38 + 4.0)  # mm, of the side edge
    lip = 2 * 0.5 * (180.0 + 0.5 * 14.38) + wall  # its radius follows from the wall
    assert f"{lip:.4g} mm" in texts(plan)
    layers = by_title["Layers at the middle of the lip"]
    assert "fibre +54°" in texts(layers) and f"{0.5 * 14.38 * 6.35 / 14.3764:.3g} mm" in texts(layers)
    cells = np.concatenate([np.ravel(c.get_array()) for c in by_title["Thickness and mesh"].collections])
    assert np.allclose(np.unique(np.round(cells, 6)), [7.19, 9.19])
    assert "0.5 times as given: 300 mm long" in figure.get_suptitle()
    put_in_units(figure, Units("in", 1000.0))
    assert "duckbill\n4.13 in" in texts(side) and side.get_ylabel() == "y, in"


def test_plot_takes_a_case(tmp_path, command_line):
    (tmp_path / "own.toml").write_text("[mesh]\naround = 6\nalong = 8\n")
    done = command_line("plot", tmp_path / "own.toml", "-o", tmp_path, "--set", "valve.lip_half_width=0.15")
    assert done.status == 0 and (tmp_path / "valve.png").stat().st_size > 20_000
    for option in (("--pressure", "3 kPa"), ("--mode", "1"), ("--animate", "1")):
        refused = command_line("plot", tmp_path / "own.toml", *option)
        assert refused.status == 2 and f"{option[0]} goes with a result file" in refused.err
    assert "no figure 'lips'" in command_line("plot", tmp_path / "own.toml", "--only", "lips").err


def test_a_result_keeps_its_case(coarse_run, command_line, tmp_path):
    refused = command_line("plot", coarse_run.path, "-o", tmp_path, "--set", "fluid.density=3")
    assert refused.status == 2 and "--set goes with a case file" in refused.err
