"""Stresses of the layers on the unrolled wall."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from .axes import colour_bar, headline
from .style import MAGNITUDE, PUBLISHED, kilopascals, new_figure
from .views import unrolled


def draw(result: Any, pressure: float | None = None) -> Iterator[tuple[str, Callable[[], Figure]]]:
    """Figures of a steady result, each with its name; of the highest pressure unless another is chosen."""
    state = result.nearest(pressure if pressure is not None else max(s.pressure for s in result.states))
    yield "layer-stress", lambda: layer_stress(state)


def layer_stress(state: Any) -> Figure:
    """Von Mises stress of each layer over the part that is computed, unrolled: arc length from the centre against the
    axis (compare Fig. 7-12 of the thesis).
    """
    mesh = state.results.mesh
    arc, z = unrolled(mesh)
    values = state.layers.von_mises.T / 1e6
    figure, panels = layer_panels(mesh, values, "Stress, MPa")
    for number, (axes, stress) in enumerate(zip(panels, values)):
        side = ", inside" if number == 0 else ", outside" if number == len(values) - 1 else ""
        axes.set_title(axes.get_title(loc="left") + side, loc="left", fontsize=10)
        peak = int(np.argmax(stress))
        middle = [0.25 * (f[:-1, :-1] + f[1:, :-1] + f[:-1, 1:] + f[1:, 1:]).ravel()[peak] * 1e3 for f in (arc, z)]
        axes.plot(*middle, "+", color=PUBLISHED, ms=9, mew=1.6)
        axes.set_title(axes.get_title(loc="right"), loc="right", fontsize=9, color=PUBLISHED)
        axes.set_xlim(arc.min() * 1e3, arc.max() * 1e3)
    headline(figure, f"Von Mises stress in the layers at {kilopascals(state.pressure)} (largest in each element)")
    return figure


def layer_panels(mesh, values: np.ndarray, label: str) -> tuple[Figure, list]:
    """A panel for each layer with its values (layers, elements) over the unrolled part, the largest written above.

    Parameters
    ----------
    mesh : the mesh of the result, with its layers
    label : of the colour bars
    """
    arc, z = unrolled(mesh)
    columns = min(3, len(values))
    rows = -(-len(values) // columns)
    figure = new_figure(3.2 * columns, 4.1 * rows + 0.4)
    panels = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
    for number, (axes, title, of_layer) in enumerate(zip(panels, mesh.layer_titles(), values)):
        shape = (mesh.shape[1], mesh.shape[0])
        image = axes.pcolormesh(arc * 1e3, z * 1e3, of_layer.reshape(shape), cmap=MAGNITUDE, vmin=0.0, rasterized=True)
        colour_bar(figure, image, axes, label, pad=0.03)
        axes.set_title(f"{number + 1}  {title}", loc="left", fontsize=10)
        axes.set_title(f"max {of_layer.max():.3g}", loc="right", fontsize=9)
        axes.grid(False)
        axes.tick_params(labelbottom=True, labelleft=True)
        if number % columns == 0:
            axes.set_ylabel("Distance from the lip z, mm")
        if number + columns >= len(values):
            axes.set_xlabel("Arc from the centre, mm")
    for axes in panels[len(values) :]:
        axes.set_visible(False)
    return figure, list(panels[: len(values)])
