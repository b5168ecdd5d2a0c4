"""Figures: they exist, show the numbers of the result, and carry units."""

import matplotlib
import numpy as np
import pytest

import dbvfiv
from dbvfiv.drawing import style
from dbvfiv.drawing.style import log_axis
from dbvfiv.drawing.views import COLOURS, unrolled
from dbvfiv.errors import CaseError
from dbvfiv.record.vtkhdf import faces
from dbvfiv.studies.case import thesis_case
from dbvfiv.studies.steady.figures import is_published

NAMES = {
    "head-discharge",
    "area-discharge",
    "jet-velocity",
    "deflection",
    "lip-shapes",
    "centre-line",
    "passage",
    "deformed",
    "layer-stress",
}


@pytest.fixture(scope="module")
def figures(coarse_run):
    return coarse_run.figures()


def test_every_figure_is_there_and_labelled_with_units(figures):
    assert set(figures) == NAMES
    for name, figure in figures.items():
        labels = [label for axes in figure.axes for label in (axes.get_xlabel(), axes.get_ylabel()) if label]
        assert labels, name
        assert all(any(unit in label for unit in ("mm", "kPa", "kg/s", "m/s", "cm²", "MPa")) for label in labels), (
            labels
        )


def test_curves_hold_the_numbers(figures, coarse_run):
    line = figures["head-discharge"].axes[0].lines[0]
    assert np.allclose(line.get_xdata(), [s.mass_flow for s in coarse_run.states])
    assert np.allclose(line.get_ydata(), [6, 18, 36])
    jet = figures["jet-velocity"].axes[0].lines[0]
    assert np.allclose(jet.get_ydata(), [s.outlet_velocity for s in coarse_run.states])


def test_lips_are_closed_symmetric_curves_of_the_inner_face(figures, coarse_run):
    rest, *moved = figures["lip-shapes"].axes[0].lines
    for line in (rest, *moved):
        x, y = line.get_data()
        assert x[0] == pytest.approx(x[-1]) and y[0] == pytest.approx(y[-1])
        assert x.max() == pytest.approx(-x.min()) and y.max() == pytest.approx(-y.min())
    assert np.ptp(rest.get_ydata()) < 1.0  # mm: a closed lip shows no slot
    mesh, state = coarse_run.mesh, coarse_run.states[-1]
    *_, last, outer = moved
    assert last.get_ydata().max() == pytest.approx(1e3 * faces(mesh, state.nodal)[0][mesh.rows[0], 1].max())
    assert outer.get_ydata().max() - last.get_ydata().max() == pytest.approx(12, abs=0.5)  # the wall
    upper = figures["centre-line"].axes[0]
    assert upper.lines[0].get_ydata()[0] < 0.5 and "Inner" in upper.get_title("left")


def test_pressures_are_said_to_be_static_and_openings_to_be_clear(figures):
    assert figures["head-discharge"].axes[0].get_ylabel() == "Static inlet pressure, kPa"
    assert figures["passage"].axes[0].get_ylabel() == "Static pressure, kPa"
    assert "static" in figures["deformed"].get_suptitle()
    labels = [text.get_text() for text in figures["deflection"].axes[0].get_legend().get_texts()]
    assert "clear lip opening at its middle" in labels


def test_colours_are_perceptual_and_styles_one(figures):
    """Lightness of colour maps of magnitudes rises evenly, as it must in grey print."""
    for name in (style.MAGNITUDE, style.MOTION):
        grey = matplotlib.colormaps[name](np.linspace(0, 1, 64))[:, :3] @ [0.2126, 0.7152, 0.0722]
        assert (np.diff(grey) > 0).all(), name
    assert COLOURS.name == style.MOTION
    titles = [f.axes[0]._left_title for f in figures.values() if not f.get_suptitle()]
    assert all(title.get_text() for title in titles)
    assert {title.get_fontweight() for title in titles} == {"bold"}
    for figure in figures.values():
        if figure.get_suptitle():
            assert figure._suptitle.get_ha() == "left" and figure._suptitle.get_fontweight() == "bold"


def test_every_panel_has_numbers_at_its_ticks(figures):
    for name in ("passage", "layer-stress", "centre-line"):
        figure = figures[name]
        figure.canvas.draw()
        for axes in figure.axes:
            if axes.get_visible() and axes.get_label() != "<colorbar>":
                for axis in (axes.xaxis, axes.yaxis):
                    assert any(label.get_text() for label in axis.get_ticklabels() if label.get_visible()), name


def test_short_logarithmic_axes_have_numbers():
    figure = style.new_figure()
    axes = figure.add_subplot()
    axes.plot([5.2, 8.7], [1, 2])
    axes.set_xlim(5.2, 8.7)
    log_axis(axes.xaxis, 5.2, 8.7)
    figure.canvas.draw()
    inside = [t.get_text() for t in axes.get_xticklabels() if 5.2 <= t.get_position()[0] <= 8.7 and t.get_text()]
    assert len(inside) >= 2 and axes.get_xscale() == "log"


def test_one_panel_for_each_layer(figures, coarse_run):
    titles = [axes.get_title("left") for axes in figures["layer-stress"].axes if axes.get_title("left")]
    assert titles == ["1  CR, inside", "2  SBR", "3  fibre +54°", "4  fibre -54°", "5  EPDM, outside"]
    arc, z = unrolled(coarse_run.mesh)
    # the flange is a quarter circle of radius 0.13919 m (App. A), its polygon a little shorter
    assert arc[-1, -1] == pytest.approx(0.5 * np.pi * 0.13919, rel=5e-3) and z[-1, 0] == pytest.approx(0.56)


def test_published_points_only_on_the_reference_valve(figures, coarse_run):
    lines = figures["head-discharge"].axes[0].lines
    assert len(lines) == 2 and np.allclose(lines[1].get_xdata(), [47.88, 75.52, 90.82])
    assert is_published(thesis_case()) and is_published(thesis_case({"materials.strain_level": "20 %"}))
    for changes in (
        {"valve.lip_half_width": 0.1},
        {"fluid.density": 10},
        {"drive.kind": "uniform"},
        {"valve.thickness_factor": 1.1},
    ):
        assert not is_published(thesis_case(changes)), changes


def test_a_single_state_and_a_chosen_pressure(tmp_path, coarse_run):
    alone = coarse_run.only(coarse_run.states[0]).figures()
    assert set(alone) == NAMES
    for name in ("head-discharge", "area-discharge", "deflection"):
        axes = alone[name].axes[0]
        (x,), (y,) = axes.lines[0].get_data()
        assert axes.lines[0].get_marker() not in (None, "None", ""), name
        assert axes.get_xlim()[0] <= x < 0.97 * axes.get_xlim()[1] and axes.get_ylim()[0] <= y < axes.get_ylim()[1]
    chosen = coarse_run.figures(only=["deformed"], pressure=17e3)
    assert "18 kPa" in chosen["deformed"].get_suptitle()


def test_no_flow_no_curves_of_the_flow(coarse_valve):
    shut = coarse_valve.replace({"drive.kind": "uniform"}).steady(pressure=[500.0])
    assert set(shut.figures()) == NAMES - {"head-discharge", "area-discharge", "jet-velocity", "passage"}


@pytest.mark.parametrize(
    "format, head, names", [("png", b"\x89PNG", ["head-discharge", "passage"]), ("svg", b"<?xml", ["head-discharge"])]
)
def test_files(tmp_path, coarse_run, format, head, names):
    written = dbvfiv.load_result(coarse_run.path).plot(tmp_path / "new" / "folder", format, only=names)
    assert [path.name for path in written] == [f"{name}.{format}" for name in names]
    assert all(path.read_bytes().startswith(head) for path in written)


def test_refusals_are_sentences(tmp_path, coarse_run, refused):
    (tmp_path / "file").write_text("")
    for call in (
        lambda: coarse_run.plot(tmp_path, "gif", only=["head-discharge"]),
        lambda: coarse_run.plot(tmp_path, only=["portrait"]),
        lambda: coarse_run.plot(tmp_path / "file", only=["head-discharge"]),
        lambda: coarse_run.only().plot(tmp_path),
    ):
        with refused(CaseError):
            call()
