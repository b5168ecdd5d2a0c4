"""Figures that answer to the pointer: hover values, zoom, turn; drawn by plotly, which comes inside the page."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import plotly.graph_objects as go
from plotly.offline import get_plotlyjs

from ..drawing.views import ValveSkin

if TYPE_CHECKING:
    from ..case.units import Units
    from ..studies.state import State

_LAYOUT = {
    "template": "plotly_white",
    "margin": {"l": 0, "r": 0, "t": 30, "b": 0},
    "font": {"family": "DejaVu Sans, Arial, sans-serif", "size": 13},
    "height": 400,
}
_CONFIG = {"displaylogo": False, "responsive": True}


def library() -> str:
    """The source of the drawing library."""
    return get_plotlyjs()


def valve(state: State, units: Units) -> str:
    """The deformed valve in space, coloured by its displacement."""
    mm, size = units.name("size"), 1.0 / units.factor("size")
    skin = ValveSkin.of(state.results.mesh)
    points = skin.points(state.nodal)[:, [2, 0, 1]] * size
    quads = skin.quads
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    moved = np.tile(np.linalg.norm(state.nodal[:, :3], axis=1)[skin.valve.node], 2) * size
    figure = go.Figure(layout=_LAYOUT)
    figure.add_mesh3d(
        x=_short(points[:, 0]),
        y=_short(points[:, 1]),
        z=_short(points[:, 2]),
        i=triangles[:, 0],
        j=triangles[:, 1],
        k=triangles[:, 2],
        intensity=_short(moved),
        colorscale="Cividis",
        colorbar={"title": f"Displacement, {mm}"},
        flatshading=True,
        hovertemplate="z %{x:.3g}, x %{y:.3g}, y %{z:.3g}<br>displacement %{intensity:.3g} " + f"{mm}<extra></extra>",
    )
    look = {"nticks": 4, "tickfont": {"size": 11}}  # of short axes seen aslant more labels meet
    axes = {f"{axis}axis": {"title": f"{name}, {mm}"} | look for axis, name in zip("xyz", "zxy")}
    figure.update_scenes(aspectmode="data", camera={"eye": {"x": -2.2, "y": -2.3, "z": 1.3}}, **axes)
    return _html(figure, "valve-live")


def _short(values: np.ndarray) -> Any:
    """Numbers with the five digits that a pointer shows, so that the page stays small."""
    return [_rounded(v) for v in values] if np.ndim(values) == 1 else [_short(v) for v in values]


def _rounded(value: float) -> float | None:
    return float(f"{value:.5g}") if np.isfinite(value) else None


def _html(figure: go.Figure, name: str) -> str:
    return figure.to_html(full_html=False, include_plotlyjs=False, div_id=name, config=_CONFIG)
