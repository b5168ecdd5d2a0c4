"""Figures of stability and closure: what they say is what the result holds."""

from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.colors import BoundaryNorm

from dbvfiv.drawing.style import new_figure
from dbvfiv.studies.case import thesis_case
from dbvfiv.studies.map import figures as map_figures
from dbvfiv.studies.map.column import MapColumn, MapPlan
from dbvfiv.studies.map.curves import OnsetCurve
from dbvfiv.studies.map.study import MapResult
from dbvfiv.studies.onset import study as onset_study
from dbvfiv.studies.onset.line import intervals_of
from dbvfiv.studies.stability.samples import Sample
from dbvfiv.studies.stability.verdict import FLUTTERS, NOT_VALID, OUTCOMES, STABLE, UNDECIDED
from dbvfiv.studies.sweep import figures as sweep_figures
from eigen.columns import DIRECT


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
    drawn = modes.figures(only=[f"centre-line-{n}" for n in (1, 2, 3)])
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


def test_the_verdict_stands_below_the_eigenvalues_as_a_sentence(modes):
    caption = modes.figures(only=["eigenvalues"])["eigenvalues"].get_supxlabel()
    assert caption.replace("\n", " ") == modes.sentence


def test_numbers_of_modes_stand_above_the_winding_and_not_on_it(modes):
    figure = modes.figures(only=["winding"])["winding"]
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
        found = texts(sweep.figures(only=[name])[name])
        assert any("interpolated" in text for text in found), name
        marks = [text for text in found if "kg/m³" in text and text.startswith("≈")]
        assert len(marks) == len(sweep.crossings()) > 0


def test_branches_are_told_apart_without_colour(sweep):
    axes = sweep.figures(only=["sweep"])["sweep"].axes[0]
    markers = [line.get_marker() for line in axes.lines if line.get_label().isdigit()]
    assert len(markers) == len(sweep.branches) and len(set(markers)) == len(markers)


def test_the_ground_of_a_sweep_is_red_where_modes_take_turns_and_hatched_where_none_is_known():
    """B is unstable up to 0.6 and A from 0.4 on; at the last value nothing is known."""
    rates = {"A": [-4.0, 6.0, 6.0, np.nan], "B": [6.0, -4.0, -4.0, np.nan]}
    branches = [SimpleNamespace(growth_beyond_rounding=np.array(rate)) for rate in rates.values()]
    result = SimpleNamespace(
        parameter="alpha", axis=SimpleNamespace(log=False), branches=branches, unstable_count=np.array([2, 2, 2, -1])
    )
    result.crossings = lambda: [SimpleNamespace(value=value) for value in (0.4, 0.6)]
    axes = new_figure().add_subplot()
    sweep_figures._shade(axes, result, np.arange(4.0))
    red, hatched = axes.patches
    assert (red.get_x(), red.get_width()) == (0.0, 2.0) and red.get_facecolor()[0] > red.get_facecolor()[2]
    assert (hatched.get_x(), hatched.get_width(), bool(hatched.get_hatch())) == (2.0, 1.0, True)


# -- onsets and maps


def onset_result(values, growth, certified=None):
    case = thesis_case({"onset.over": f"pressure={values[0]:g}:{values[-1] + 1:g}:5"})
    rows = np.stack([growth, *(np.full(len(growth), -100.0 * k) for k in (1, 2, 3))], axis=1)
    point = {"value": 9e3, "frequency": 37.0, "growth_rate": 0.0, "criticality": "super", "uncertainty": 200.0}
    point |= {"confirmed": True}
    point |= {"edge": True, "gains": False}
    points = [point] if len(values) > 1 else []
    certified = np.ones(len(values), bool) if certified is None else np.array(certified)
    states = values, growth > 0, certified, [p["value"] for p in points]
    stretches = [intervals_of(*states, which) for which in (False, True, None)]
    return SimpleNamespace(
        case=case,
        parameter="pressure",
        axis=case.onset.axis,
        header=SimpleNamespace(name="valve"),
        values=np.array(values),
        growth_rates=rows,
        frequencies=np.full(rows.shape, 37.0),
        points=points,
        classes=(),
        stable_intervals=stretches[0],
        unstable_intervals=stretches[1],
        uncertain_intervals=stretches[2],
    )


def test_onsets_say_static_pressure_and_keep_legend_and_title_apart():
    figure = onset_study.onset(onset_result([2e3, 6e3, 9e3, 20e3], np.array([50.0, 20.0, 0.0, -30.0])))
    assert figure.axes[1].get_xlabel() == "Static inlet pressure, kPa"
    figure.canvas.draw()
    (legend,) = figure.legends
    assert legend.get_window_extent().y1 <= figure.axes[1].get_window_extent().y0
    assert any("9 kPa" in text and text.endswith("supercritical") for text in texts(figure))


def test_onsets_that_are_not_confirmed_look_so_and_growth_of_another_class_is_in_the_frame():
    result = onset_result([2e3, 6e3, 9e3, 20e3], np.array([50.0, 20.0, 0.0, -30.0]))
    result.points[0] |= {"criticality": None, "confirmed": False}
    scan = {"values": [2e3, 20e3], "growth_rate": [-5.0, 90.0], "frequency": [40.0, 40.0]}
    result.classes = [{"symmetry": "SA", "scan": scan}]
    figure = onset_study.onset(result)
    assert any(text.endswith("37 Hz\nnot confirmed") for text in texts(figure))
    mark = next(line for line in figure.axes[0].lines if line.get_marker() == "o")
    assert mark.get_markerfacecolor() == "0.75" and figure.axes[0].get_ylim()[1] > 90.0


def test_onsets_shade_what_is_certified_alone_and_hatch_the_rest():
    """Before, everything between two onsets was called unstable or stable by the middle one of its values."""
    values, growth = [2e3, 5e3, 8e3, 15e3, 20e3], np.array([50.0, 30.0, 10.0, -20.0, -30.0])
    figure = onset_study.onset(onset_result(values, growth, [True, True, True, True, False]))
    stretches = {"unstable": [], "uncertain": []}
    for patch in figure.axes[0].patches:
        name = "uncertain" if patch.get_hatch() else "unstable"
        stretches[name].append((patch.get_x(), patch.get_x() + patch.get_width()))
    assert stretches == {"unstable": [(2.0, 9.0)], "uncertain": [(15.0, 20.0)]}
    assert {t.get_text() for t in figure.legends[0].get_texts()} >= {"unstable", "uncertain"}


def test_an_onset_scan_of_one_value_shows_it():
    figure = onset_study.onset(onset_result([6e3], np.array([20.0])))
    line = next(line for line in figure.axes[0].lines if line.get_label() == "leading mode")
    low, high = figure.axes[0].get_xlim()
    assert line.get_marker() == "." and low < line.get_xdata()[0] < high


def test_a_scan_without_a_valid_state_is_drawn_empty():
    figure = onset_study.onset(onset_result([2e3, 6e3], np.array([np.nan, np.nan]), [False, False]))
    assert np.isfinite(figure.axes[0].get_ylim()).all() and not np.isfinite(figure.axes[0].lines[0].get_ydata()).any()


def map_result(certified=None):
    case = thesis_case({"map.x": "pressure=1000:12000:6", "map.y": "density=1:1000:5:log"})
    plan = MapPlan(case)
    shape = (len(plan.laws), 5, 6)
    growth = np.broadcast_to(np.linspace(80, -80, 6) + 0 * np.arange(5)[:, None], shape).copy()
    unstable = np.where(growth > 0, 2, 0)
    grids = {"growth_rate": growth, "frequency": 40.0 + 0.1 * growth, "unstable": unstable, "sealed": np.zeros(shape)}
    grids["certified"] = np.ones(shape, bool) if certified is None else np.broadcast_to(certified, shape)
    decided = np.where(unstable > 0, OUTCOMES.index(FLUTTERS), OUTCOMES.index(STABLE))
    grids["outcome"] = np.where(grids["certified"], decided, OUTCOMES.index(UNDECIDED))
    x = np.full(9, 6500.0) + np.linspace(-500, 500, 9)
    curve = OnsetCurve(0, x, np.geomspace(1, 1000, 9), np.linspace(36, 52, 9), exact=True)
    result = SimpleNamespace(
        plan=plan,
        columns=[SimpleNamespace(failure="")],
        curves=[curve],
        checks=[],
        case=case,
        header=SimpleNamespace(name="valve"),
        moved=("pressure", "density"),
        grid=grids.get,
    )
    result.over_classes = lambda name: result.grid(name)
    return result


def test_a_map_of_all_classes_shows_the_motion_that_decides():
    """The opening lips decay everywhere; the lips sway and grow in the left half, which nobody certifies in row 0."""
    keys = {"map.x": "pressure=1000:6000:6", "map.y": "density=1:1000:2:log", "map.symmetry": "all"}
    case = thesis_case(keys)
    plan = MapPlan(case)
    columns = []
    for k, across in enumerate(plan.across.values):
        cells = {}
        for part in range(len(plan.parts)):
            sways = part == 1 and k < 3
            values, number = np.array([complex(7.0 if sways else -3.0 - part, 200.0)]), 2 * sways
            cells[part] = [
                Sample(y, values, number, number, bool(part or j), how=DIRECT) for j, y in enumerate(plan.along.values)
            ]
        columns.append(MapColumn(across, 0, cells, np.zeros((0, 5))))
    result = map_result()
    result.plan, result.case, result.columns, result.curves = plan, case, columns, []
    for name in ("grid", "over_classes", "_by_class", "_leading"):
        setattr(result, name, partial(getattr(MapResult, name), result))
    figure = map_figures.stability_map(result)
    colours = np.ma.filled(figure.axes[0].collections[0].get_array(), np.nan)
    assert np.array_equal(colours, [[7.0] * 3 + [np.nan] * 3, [7.0] * 3 + [-3.0] * 3], equal_nan=True)
    assert {t.get_text() for t in figure.axes[0].texts} >= {"stable", "unstable"}
    assert any("9 of 12 cells certified by two counts in classes SS, SA, AS, AA" in text for text in texts(figure))


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


def test_cells_that_are_not_valid_are_hatched_named_and_in_no_colour_scale():
    result = map_result()
    grid = result.grid
    invalid = np.zeros(grid("outcome").shape, bool)
    invalid[..., :2] = True
    changed = {
        "outcome": np.where(invalid, OUTCOMES.index(NOT_VALID), grid("outcome")),
        "certified": grid("certified") & ~invalid,
        "unstable": np.where(invalid, -1, grid("unstable")),
        "growth_rate": np.where(invalid, np.nan, grid("growth_rate")),
    }
    result.grid = lambda name: changed.get(name, grid(name))
    figure = map_figures.stability_map(result)
    axes = figure.axes[0]
    assert {t.get_text() for t in axes.texts} >= {"not valid", "stable"}
    assert sum(bool(c.get_hatch()) for c in axes.collections) == 10
    assert any("constants of the rubber do not hold there" in text for text in texts(figure))


def test_sealed_cells_are_named_and_stand_apart_from_the_other_stable_ones():
    result = map_result()
    grid, sealed = result.grid, np.zeros(result.grid("sealed").shape)
    sealed[..., 4:] = 1.0
    result.grid = lambda name: sealed if name == "sealed" else grid(name)
    axes = map_figures.stability_map(result).axes[0]
    assert {t.get_text() for t in axes.texts} >= {"sealed", "stable", "unstable"}
    (flat,) = [c for c in axes.collections if getattr(c.cmap, "N", 0) == 1]
    assert flat.get_array().count() == 10


def test_cells_without_a_certificate_are_hatched_and_not_called_stable():
    certified = np.ones((5, 6), bool)
    certified[:, 3:] = False
    figure = map_figures.stability_map(map_result(certified))
    axes = figure.axes[0]
    assert {t.get_text() for t in axes.texts} & {"stable", "unstable"} == {"unstable"}
    assert sum(bool(c.get_hatch()) for c in axes.collections) == 15
    assert any("the others hatched" in text for text in texts(figure))
