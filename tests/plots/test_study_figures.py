"""Figures of stability, closure and time histories: what they say is what the result holds."""

from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.colors import BoundaryNorm
from PIL import Image

import dbvfiv
from dbvfiv.case import Case
from dbvfiv.errors import CaseError
from dbvfiv.plots import figures_of
from dbvfiv.studies.map import figures as map_figures
from dbvfiv.studies.map.column import MapPlan
from dbvfiv.studies.onset import figures as onset_figures
from dbvfiv.studies.onset.intervals import known_intervals, uncertain_intervals
from dbvfiv.verdict import Series, in_steps


def texts(figure):
    """Everything written into a figure, the ticks left out."""
    found = [figure.get_suptitle(), figure.get_supxlabel()]
    for axes in figure.axes:
        found += [axes.get_title(where) for where in ("left", "right", "center")] + [t.get_text() for t in axes.texts]
        found += [axes.get_xlabel(), axes.get_ylabel()]
    return [text for text in found if text]


# -- modes and sweeps


@pytest.fixture(scope="module")
def modes(coarse_run):
    return coarse_run.states[0].modes(count=4, density=10, alpha=0)


@pytest.fixture(scope="module")
def sweep(coarse_run):
    return coarse_run.states[0].sweep("density=1:1000:6:log", count=3, alpha=0)


def test_captions_of_modes_follow_their_shapes(modes):
    """A share of the motion that travels, measured; not the same sentence under each."""
    drawn = figures_of(modes, only=[f"centre-line-{n}" for n in (1, 2, 3)])
    captions = [drawn[f"centre-line-{n}"].axes[2].get_title("left") for n in (1, 2, 3)]
    assert len(set(captions)) == 3
    for mode, caption in zip(modes.modes, captions):
        if mode.frequency == 0:
            assert "no wave" in caption
            continue
        share = float(caption.split("share ")[1].split(" %")[0])
        motion = mode.shape[modes.mesh.rows[:, 0], 1]
        strong = motion[np.abs(motion) > 0.5 * np.abs(motion).max()] / motion[np.argmax(np.abs(motion))]
        phase = 0.5 * np.degrees(np.ptp(np.angle(strong**2)))  # squared: a standing wave may change its sign
        assert ("a standing wave" in caption) == (share < 10)
        assert phase < 25 or share >= 10, (caption, phase)  # what lags by much does not stand


def test_numbers_of_modes_stand_above_the_winding_and_not_on_it(modes):
    figure = figures_of(modes, only=["winding"])["winding"]
    (axes,) = figure.axes
    figure.canvas.draw()
    frame = axes.get_window_extent()
    numbers = [t for t in axes.texts if t.get_text().isdigit()]
    assert {t.get_text() for t in numbers} == {str(m.number) for m in modes.modes if m.frequency > 0}
    assert all(t.get_window_extent().y0 >= frame.y1 - 1 for t in numbers)
    title = axes.title if axes.get_title("center") else axes._left_title
    assert all(t.get_window_extent().y1 <= title.get_window_extent().y0 + 1 for t in numbers)


def test_crossings_of_sweeps_are_called_interpolated(sweep):
    for name in ("sweep", "root-locus"):
        found = texts(figures_of(sweep, only=[name])[name])
        assert any("interpolated" in text for text in found), name
        marks = [text for text in found if "kg/m³" in text and text.startswith("≈")]
        assert len(marks) == len(sweep.crossings()) > 0


def test_branches_are_told_apart_without_colour(sweep):
    axes = figures_of(sweep, only=["sweep"])["sweep"].axes[0]
    markers = [line.get_marker() for line in axes.lines if line.get_label().isdigit()]
    assert len(markers) == len(sweep.branches) and len(set(markers)) == len(markers)


# -- onsets and maps


def onset_result(values, growth, certified=None):
    case = Case().replace({"onset.over": f"pressure={values[0]:g}:{values[-1] + 1:g}:5"})
    rows = np.stack([growth, *(np.full(len(growth), -100.0 * k) for k in (1, 2, 3))], axis=1)
    point = {"value": 9e3, "frequency": 37.0, "growth_rate": 0.0, "criticality": "super", "uncertainty": 200.0}
    point |= {"edge": True, "gains": False}
    points = [point] if len(values) > 1 else []
    certified = np.ones(len(values), bool) if certified is None else np.array(certified)
    stretches = [known_intervals(values, growth, certified, [p["value"] for p in points], which) for which in (0, 1)]
    return SimpleNamespace(
        case=case,
        parameter="pressure",
        header=SimpleNamespace(name="valve"),
        values=np.array(values),
        growth_rates=rows,
        frequencies=np.full(rows.shape, 37.0),
        points=points,
        stable_intervals=stretches[0],
        unstable_intervals=stretches[1],
        uncertain_intervals=uncertain_intervals(values, certified),
    )


def test_onsets_say_static_pressure_and_keep_legend_and_title_apart():
    figure = onset_figures.onset(onset_result([2e3, 6e3, 9e3, 20e3], np.array([50.0, 20.0, 0.0, -30.0])))
    assert figure.axes[1].get_xlabel() == "Static inlet pressure, kPa"
    figure.canvas.draw()
    (legend,) = figure.legends
    assert legend.get_window_extent().y1 <= figure.axes[1].get_window_extent().y0
    assert any("9 kPa" in text and "supercritical" in text for text in texts(figure))


def test_onsets_shade_what_is_certified_alone_and_hatch_the_rest():
    """Before, everything between two onsets was called unstable or stable by the middle one of its values."""
    values, growth = [2e3, 5e3, 8e3, 15e3, 20e3], np.array([50.0, 30.0, 10.0, -20.0, -30.0])
    figure = onset_figures.onset(onset_result(values, growth, [True, True, True, True, False]))
    stretches = {"unstable": [], "uncertain": []}
    for patch in figure.axes[0].patches:
        name = "uncertain" if patch.get_hatch() else "unstable"
        stretches[name].append((patch.get_x(), patch.get_x() + patch.get_width()))
    assert stretches == {"unstable": [(2.0, 9.0)], "uncertain": [(15.0, 20.0)]}
    assert {t.get_text() for t in figure.legends[0].get_texts()} >= {"unstable", "uncertain"}


def test_an_onset_scan_of_one_value_shows_it():
    figure = onset_figures.onset(onset_result([6e3], np.array([20.0])))
    line = next(line for line in figure.axes[0].lines if line.get_label() == "leading mode")
    low, high = figure.axes[0].get_xlim()
    assert line.get_marker() == "." and low < line.get_xdata()[0] < high


def map_result(certified=None):
    case = Case().replace({"map.x": "pressure=1000:12000:6", "map.y": "density=1:1000:5:log"})
    plan = MapPlan.of(case)
    shape = (len(plan.laws), 5, 6)
    growth = np.broadcast_to(np.linspace(80, -80, 6) + 0 * np.arange(5)[:, None], shape).copy()
    unstable = np.where(growth > 0, 2, 0)
    grids = {"growth_rate": growth, "frequency": 40.0 + 0.1 * growth, "unstable": unstable}
    grids["certified"] = np.ones(shape, bool) if certified is None else np.broadcast_to(certified, shape)
    x = np.full(9, 6500.0) + np.linspace(-500, 500, 9)
    curve = SimpleNamespace(law=0, x=x, y=np.geomspace(1, 1000, 9), frequency=np.linspace(36, 52, 9), exact=True)
    return SimpleNamespace(
        plan=plan,
        columns=[SimpleNamespace(failure="")],
        curves=[curve],
        checks=[],
        case=case,
        header=SimpleNamespace(name="valve"),
        moved=("pressure", "density"),
        grid=grids.get,
    )


def test_a_map_has_one_colour_bar_with_every_band_labelled():
    figure = map_figures.stability_map(map_result())
    bars = [axes for axes in figure.axes if axes.get_label() == "<colorbar>"]
    assert len(bars) == 1 and bars[0].get_ylabel() == "Growth rate of the leading mode, 1/s"
    (mesh,) = [c for c in figure.axes[0].collections if isinstance(c.norm, BoundaryNorm)]
    assert len(bars[0].get_yticklabels()) == len(mesh.norm.boundaries) >= 5
    # the curve carries its frequencies itself
    assert sum(text.endswith(" Hz") for text in texts(figure)) >= 2


def test_words_of_a_map_stand_within_their_region_on_a_ground_of_their_own():
    figure = map_figures.stability_map(map_result())
    figure.canvas.draw()
    axes = figure.axes[0]
    words = {t.get_text(): t for t in axes.texts if t.get_text() in ("stable", "unstable")}
    assert set(words) == {"stable", "unstable"}
    border = axes.transData.transform((6.5, 10))[0]  # kPa
    assert words["unstable"].get_window_extent().x1 < border < words["stable"].get_window_extent().x0
    assert all(t.get_bbox_patch() is not None for t in words.values())


def test_cells_without_a_certificate_are_hatched_and_not_called_stable():
    certified = np.ones((5, 6), bool)
    certified[:, 3:] = False
    figure = map_figures.stability_map(map_result(certified))
    axes = figure.axes[0]
    assert {t.get_text() for t in axes.texts} & {"stable", "unstable"} == {"unstable"}
    assert sum(bool(c.get_hatch()) for c in axes.collections) == 15
    assert any("the others hatched" in text for text in texts(figure))


# -- closure


@pytest.fixture(scope="module")
def closure():
    changes = {"mesh.around": 6, "mesh.along": 10, "closure.max_step": "5 kPa", "closure.start": "open"}
    return dbvfiv.load(changes=changes | {"closure.eigenvalues": 2}).closure(["2 kPa", 9e3])


def test_the_contact_map_reaches_to_its_maximum_and_says_it(closure):
    figure = figures_of(closure, only=["contact-map"])["contact-map"]
    mesh = figure.axes[0].collections[0]
    largest = [s.contact_pressure.max() / s.pressure for s in closure.states if s.contact_nodes]
    assert mesh.norm.vmax == pytest.approx(max(largest))
    for ratio, axes in zip(largest, figure.axes):
        assert f"largest {ratio:.3g} times" in axes.get_title("left")


def test_the_closure_curve_has_no_lines_but_its_own(closure):
    figure = figures_of(closure, only=["closure-curve"])["closure-curve"]
    buckled = len(closure.buckling[:1])
    for axes in figure.axes:
        upright = [line for line in axes.lines if len(set(line.get_xdata())) == 1 and len(line.get_xdata()) == 2]
        assert len(upright) == buckled
        dots = [line for line in axes.lines if line.get_marker() == "o"]
        assert dots and np.allclose(dots[0].get_xdata(), [s.pressure / 1e3 for s in closure.states])


def test_two_measures_of_opening_stand_on_two_axes(closure):
    left, right = figures_of(closure, only=["reversal"])["reversal"].axes
    assert "Flow area" in left.get_ylabel() and "passage between the inner faces" in right.get_ylabel()
    assert np.nanmin(right.lines[0].get_ydata()) > 0


def test_side_views_show_the_faces(closure):
    figure = figures_of(closure, only=["side-views"])["side-views"]
    axes = figure.axes[0]
    wall = next(c for c in axes.collections if c.get_label() == "wall")
    upper, lower = (path.vertices for path in wall.get_paths())
    at_lip = upper[np.isclose(upper[:, 0], upper[:, 0].min(), atol=2.0), 1]
    assert at_lip.min() < 1.0 and at_lip.max() == pytest.approx(12, abs=1.0)  # no slot of 12 mm between the lips
    assert np.allclose(lower[:, 1], -upper[:, 1])


# -- runs in time


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    path = tmp_path_factory.mktemp("run") / "run.h5"
    changes = {"mesh.around": 6, "mesh.along": 8, "transient.duration": 0.04, "drive.pressure": 12e3}
    return dbvfiv.load(changes=changes).transient(output=path)


def test_the_imbalance_has_an_axis_of_its_own(run):
    figure = figures_of(run, only=["energies"])["energies"]
    *_, rest = figure.axes
    assert rest.get_ylabel().startswith("Imbalance, ")
    factor = {"J": 1.0, "mJ": 1e3, "µJ": 1e6, "nJ": 1e9}[rest.get_ylabel().split(", ")[1]]
    assert np.allclose(rest.lines[0].get_ydata(), factor * run.history["balance"])
    reach = np.ptp(rest.get_ylim()) / np.ptp(rest.lines[0].get_ydata())
    assert reach < 3.0  # it can be seen
    assert "of the work turned over" in rest.get_title("left")


def test_spectra_say_their_resolution_and_print_no_more_digits(run, monkeypatch):
    half = len(run.history["time"]) // 2
    fine = 1.0 / Series.of(run.history["time"][half:], run.history["mass_flow"][half:]).duration
    monkeypatch.setitem(run.verdict["lip_opening"], "frequency", 54.98)
    figure = figures_of(run, only=["spectrum"])["spectrum"]
    assert f"resolution {fine:.2g} Hz" in figure.get_suptitle()
    assert figure.axes[1].get_title("right").endswith(f" {in_steps(54.98, fine)} Hz") and fine > 1
    assert in_steps(54.98, 50.0) == "55" and in_steps(54.98, 0.3) == "55.0" and in_steps(54.983, 0.02) == "54.98"


def test_figures_of_runs_say_clear_opening_and_static_pressure(run):
    drawn = figures_of(run, only=["history", "phase-portrait", "station-pressures"])
    assert "Clear lip opening, mm" in texts(drawn["history"])
    assert "Velocity of one lip, m/s" in texts(drawn["phase-portrait"])
    assert "Static pressure, kPa" in texts(drawn["station-pressures"])


def test_films_of_a_run_take_cycles_and_of_modes_a_mode(run, modes, coarse_run, command_line, tmp_path, one_sentence):
    file = run.path
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
        outcome = command_line("plot", path, "-o", tmp_path / "new", "--animate", number)
        assert outcome.status == 2 and words in outcome.err and one_sentence(outcome.err), outcome.err
        assert not (tmp_path / "new").exists()  # misuse shows before anything is drawn
    with pytest.raises(CaseError, match="at least 2 frames"):
        run.animate(tmp_path / "one.gif", frames=1)
