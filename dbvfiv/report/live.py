"""Figures that answer to the pointer: hover values, zoom, turn; drawn by plotly, which comes inside the page."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import plotly.graph_objects as go
from plotly.offline import get_plotlyjs

from ..case.parameters import PARAMETERS
from ..drawing.style import COMPUTED, PUBLISHED
from ..drawing.views import ValveSkin

if TYPE_CHECKING:
    from ..studies.map.study import MapResult
    from ..studies.state import State
    from ..studies.steady.study import SteadyResult

_LAYOUT = {
    "template": "plotly_white",
    "margin": {"l": 64, "r": 16, "t": 40, "b": 56},
    "font": {"family": "DejaVu Sans, Arial, sans-serif", "size": 13},
    "height": 460,
}
_FLOW = "%{x:.4g} L/s at %{y:.4g} m<extra></extra>"
_CONFIG = {"displaylogo": False, "responsive": True}


def library() -> str:
    """The source of the drawing library."""
    return get_plotlyjs()


def discharge(result: SteadyResult, chosen: State) -> str:
    """Head over flow, with what belongs to each state under the pointer."""
    states = sorted(result.states, key=lambda state: state.pressure)
    flow, head = [1e3 * s.volume_flow for s in states], [s.head for s in states]
    said = [
        f"{s.pressure / 1e3:.4g} kPa<br>{s.mass_flow:.4g} kg/s<br>lip opening {1e3 * s.lip_opening:.3g} mm<br>"
        f"jet {s.outlet_velocity:.3g} m/s"
        for s in states
    ]
    figure = go.Figure(layout=_LAYOUT)
    figure.add_scatter(
        x=flow,
        y=head,
        text=said,
        mode="lines+markers",
        name="computed",
        line={"color": COMPUTED},
        hovertemplate=_FLOW.replace("<extra>", "<br>%{text}<extra>"),
    )
    figure.add_scatter(
        x=[1e3 * chosen.volume_flow],
        y=[chosen.head],
        mode="markers",
        name="this installation",
        marker={"color": PUBLISHED, "size": 14, "symbol": "star"},
        hovertemplate=_FLOW,
    )
    figure.update_xaxes(title="Flow, L/s", rangemode="tozero")
    figure.update_yaxes(title="Head, m of the fluid", rangemode="tozero")
    return _html(figure, "discharge-live")


def valve(state: State) -> str:
    """The deformed valve in space, coloured by its displacement."""
    skin = ValveSkin.of(state.results.mesh)
    points = skin.points(state.nodal)[:, [2, 0, 1]] * 1e3
    quads = skin.quads
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    size = np.tile(np.linalg.norm(state.nodal[:, :3], axis=1)[skin.valve.node], 2) * 1e3
    figure = go.Figure(layout=_LAYOUT | {"height": 560})
    figure.add_mesh3d(
        x=_short(points[:, 0]),
        y=_short(points[:, 1]),
        z=_short(points[:, 2]),
        i=triangles[:, 0],
        j=triangles[:, 1],
        k=triangles[:, 2],
        intensity=_short(size),
        colorscale="Cividis",
        colorbar={"title": "Displacement, mm"},
        flatshading=True,
        hovertemplate="z %{x:.0f} mm, x %{y:.0f} mm, y %{z:.0f} mm<br>displacement %{intensity:.2f} mm<extra></extra>",
    )
    axes = {"xaxis": {"title": "z, mm"}, "yaxis": {"title": "x, mm"}, "zaxis": {"title": "y, mm"}}
    figure.update_scenes(aspectmode="data", camera={"eye": {"x": -1.3, "y": -1.4, "z": 0.8}}, **axes)
    return _html(figure, "valve-live")


def stability_map(result: MapResult, law: int, here: tuple[float, float] | None) -> str:
    """One law's map: growth rate and frequency of each cell under the pointer, onset curves, this installation."""
    x, y = (_values(axis) for axis in (result.plan.x, result.plan.y))
    certified = result.grid("certified")[law].astype(bool)
    growth = np.where(certified, result.grid("growth_rate")[law], np.nan)
    frequency = result.grid("frequency")[law]
    top = float(np.nanquantile(np.abs(growth), 0.9)) if np.isfinite(growth).any() else 1.0
    names = [_title(axis.parameter) for axis in (result.plan.x, result.plan.y)]
    figure = go.Figure(layout=_LAYOUT)
    figure.add_heatmap(
        x=x,
        y=y,
        z=_short(growth),
        customdata=_short(frequency),
        zmin=-top,
        zmax=top,
        colorscale="RdBu_r",
        colorbar={"title": "Growth rate<br>of the leading<br>mode, 1/s"},
        hovertemplate=f"{names[0]} %{{x:.4g}}<br>{names[1]} %{{y:.4g}}<br>"
        "%{z:.4g} 1/s at %{customdata:.4g} Hz<extra></extra>",
    )
    for curve in (c for c in result.curves if c.law == law):
        points = np.array(curve.points())
        scales = [PARAMETERS[axis.parameter].scale for axis in (result.plan.x, result.plan.y)]
        figure.add_scatter(
            x=_short(points[:, 0] / scales[0]),
            y=_short(points[:, 1] / scales[1]),
            text=[f"{f:.4g} Hz" for f in curve.frequency],
            mode="lines",
            line={"color": "black"},
            showlegend=False,
            hovertemplate="onset, %{text}<extra></extra>",
        )
    if here is not None:
        figure.add_scatter(
            x=[here[0]],
            y=[here[1]],
            mode="markers",
            name="this installation",
            showlegend=False,
            marker={"color": "#ffd700", "size": 15, "symbol": "star", "line": {"color": "black", "width": 1.5}},
            hovertemplate="this installation<extra></extra>",
        )
    for update, axis, name, values in (
        (figure.update_xaxes, result.plan.x, names[0], x),
        (figure.update_yaxes, result.plan.y, names[1], y),
    ):
        ends = [min(values), max(values)]
        update(title=name, type="log" if axis.log else "linear", range=np.log10(ends).tolist() if axis.log else ends)
    return _html(figure, f"map-live-{law}")


def _values(axis) -> list[float]:
    return (np.asarray(axis.values) / PARAMETERS[axis.parameter].scale).tolist()


def _title(name: str) -> str:
    row = PARAMETERS[name]
    return f"{row.title}, {row.shown_unit}" if row.shown_unit else row.title


def _short(values: np.ndarray) -> Any:
    """Numbers with the five digits that a pointer shows, so that the page stays small."""
    return [_rounded(v) for v in values] if np.ndim(values) == 1 else [_short(v) for v in values]


def _rounded(value: float) -> float | None:
    return float(f"{value:.5g}") if np.isfinite(value) else None


def _html(figure: go.Figure, name: str) -> str:
    return figure.to_html(full_html=False, include_plotlyjs=False, div_id=name, config=_CONFIG)
