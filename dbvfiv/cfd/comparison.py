"""Flow in three dimensions beside the one-dimensional law: pressures, flow, recovery, force on the wall, figures."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from ..drawing.style import (
    ACCENT,
    COMPUTED,
    HALO,
    MAGNITUDE,
    PUBLISHED,
    REST,
    colour_bar,
    headline,
    kilopascals,
    new_figure,
    some_of,
)
from .foam import FlowCase, FlowFields

#: Loss of the jet over its velocity head by driving pressure, kPa (Th. Fig. 7-9).
PUBLISHED_LOSS = {18.0: 0.86, 29.0: 0.83, 36.0: 0.79}
#: Change of the inlet pressure over the last fifth of the iterations that counts as settled.
SETTLED = 0.01


@dataclass(frozen=True)
class FlowComparison:
    """Comparison of a computed 3-D flow (CFD) with the flow law, for one steady state.

    Pressures are in Pa over that at the wall of the pipe (or in the room) beside the lip, which is the zero of the flow
    law. They scale with the square of the flow, nearly exactly at these Reynolds numbers, so the rows are given at the
    flow law's pressure at the flange.
    """

    case: FlowCase
    fields: FlowFields
    published: bool = False  #: Whether the valve is that of the thesis, beside whose losses it is set.

    @cached_property
    def back(self) -> float:
        """Pressure at the pipe's wall beside the lip over that at the outlet, Pa."""
        cells = self.case.cells
        return float(self._pressure[cells.beside("outside", -1)[self.case.domain.lip]].mean())

    @cached_property
    def flange(self) -> float:
        """Mean pressure at the flange, Pa, with the flow of the law."""
        return float(np.interp(self.case.domain.rows[-1], self.stations, self.mean_pressure))

    @property
    def law_flange(self) -> float:
        """Pressure at the flange, Pa, by the law."""
        return self.case.state.flange_pressure - self.case.state.outlet_pressure

    @cached_property
    def _pressure(self) -> np.ndarray:
        return self.case.density * self.fields.pressure

    @cached_property
    def stations(self) -> np.ndarray:
        """(s,) places of the middles of the cells along the axis, m, the outlet's first."""
        z = self.case.domain.stations
        return 0.5 * (z[1:] + z[:-1])

    @cached_property
    def mean_pressure(self) -> np.ndarray:
        """(s,) of the passage, before the lip, and of the whole pipe behind it, Pa, by volume."""
        cells = self.case.cells
        inside = (cells.station < self.case.domain.lip) | (cells.part < 2)
        weight = cells.volumes * inside
        count = len(self.stations)
        total = np.bincount(cells.station, weight * self._pressure, count)
        return total / np.bincount(cells.station, weight, count) - self.back

    def _by_row(self, block: str, ring: int, patch: str) -> tuple[np.ndarray, np.ndarray]:
        """Mean pressures (rows - 1,), Pa, and forces in y (rows - 1,), N, of a wall between the rows of the shell; what
        lies between two sections of the mesh is spread evenly.
        """
        domain, cells = self.case.domain, self.case.cells
        beside = cells.beside(block, ring)[domain.lip : domain.flange].ravel()
        corners = cells.points[cells.patches[patch]]
        area = 0.5 * np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])  # (k, 3), out of the fluid
        inwards = np.einsum("ki,ki->k", area, corners.mean(axis=1) - cells.centres[beside]) < 0
        area[inwards] *= -1.0
        pressure = self._pressure[beside] - self.back
        places = domain.stations[domain.lip : domain.flange + 1]
        row = np.repeat(np.arange(len(places) - 1), domain.pattern.around)
        size = np.linalg.norm(area, axis=1)

        def between(values):
            sums = np.concatenate([[0.0], np.cumsum(np.bincount(row, values))])
            return np.diff(np.interp(domain.rows, places, sums))

        return between(size * pressure) / between(size), between(pressure * area[:, 1])

    @cached_property
    def rows(self) -> dict[str, np.ndarray]:
        """By element row of the shell, the lip's first, at the law's pressure at the flange: ``z`` (m), pressures (Pa)
        ``inside``, ``outside``, ``net`` and
        ``law``, forces in y on a quarter (N) ``force`` and ``law_force``.
        """
        scale = self.law_flange / self.flange
        inside, push = (scale * values for values in self._by_row("layer", -1, "inner"))
        outside, pull = (scale * values for values in self._by_row("outside", 0, "outer"))
        law = self.case.state.station_pressure
        law = 0.5 * (law[1:] + law[:-1])
        middle = self.case.faces.middle
        a, b, c, d = middle[:-1, :-1], middle[1:, :-1], middle[1:, 1:], middle[:-1, 1:]
        area = 0.5 * np.cross(c - a, d - b)[..., 1].sum(axis=1)
        z = self.case.domain.rows
        return {
            "z": 0.5 * (z[1:] + z[:-1]),
            "inside": inside,
            "outside": outside,
            "net": inside - outside,
            "law": law,
            "force": push + pull,
            "law_force": law * area,
        }

    @cached_property
    def summary(self) -> dict[str, Any]:
        """Plain SI numbers."""
        case, state = self.case, self.case.state
        flange, law = self.flange, self.law_flange
        area = case.mesh.part.copies * float(case.faces.section_areas()[0])
        jet = state.volume_flow / area
        head = 0.5 * case.density * jet**2
        rows, span = self.rows, np.diff(case.domain.rows)
        worst = int(np.argmax(np.abs(rows["net"] - rows["law"])))
        found = {
            "pressure": state.pressure,
            "mass_flow": state.mass_flow,
            "flange_pressure": flange,
            "law_flange_pressure": law,
            "mass_flow_at_that_pressure": state.mass_flow * float(np.sqrt(law / flange)) if flange > 0 else np.nan,
            "lip_area": area,
            "law_lip_area": state.outlet_area,
            "jet_velocity": jet,
            "mean_difference": float(np.sum(np.abs(rows["net"] - rows["law"]) * span) / span.sum()),
            "largest_difference": float(rows["net"][worst] - rows["law"][worst]),
            "largest_difference_z": float(rows["z"][worst]),
            "opening_force": float(rows["force"].sum()),
            "law_opening_force": float(rows["law_force"].sum()),
            "cells": len(case.cells.cells),
            "iterations": self.fields.iterations,
            "unrest": self.fields.unrest,
            "settled": self.fields.unrest < SETTLED,
        }
        if case.pipe is not None:
            behind = self.stations < case.domain.rows[0]
            recovered = float(self.mean_pressure[behind].max())
            ideal = 1.0 - (area / (0.25 * np.pi * case.pipe**2)) ** 2
            found |= {
                "recovered_pressure": recovered,
                "recovery": recovered / head,
                "loss": ideal - recovered / head,
                "law_loss": (1.0 - area / (0.25 * np.pi * case.pipe**2)) ** 2,
                "published_loss": PUBLISHED_LOSS.get(round(state.pressure / 1e3, 3)) if self.published else None,
            }
        return found

    def lines(self) -> list[str]:
        """The numbers for people."""
        s, rows = self.summary, self.rows
        lines = [
            f"{s['cells']} cells, {s['iterations']} iterations; over the last fifth of them the inlet's pressure "
            f"moved by {100 * s['unrest']:.2g} %" + ("." if s["settled"] else ": not settled, run it further."),
            f"At {s['mass_flow']:.2f} kg/s the flange stands {s['flange_pressure'] / 1e3:.2f} kPa over the water "
            f"beside the lip; the law says {s['law_flange_pressure'] / 1e3:.2f} kPa. At the law's pressure "
            f"{s['mass_flow_at_that_pressure']:.2f} kg/s would flow.",
            f"Passage at the lip: {1e4 * s['lip_area']:.2f} cm2 between the inner faces, {1e4 * s['law_lip_area']:.2f} "
            "in the law.",
        ]
        if "recovery" in s:
            published = "" if s["published_loss"] is None else f", published {s['published_loss']:.2f}"
            lines.append(
                f"Behind the lip {s['recovered_pressure'] / 1e3:.2f} kPa come back, {s['recovery']:.3f} of the jet's "
                f"velocity head: a loss of {s['loss']:.3f} (Borda and Carnot {s['law_loss']:.3f}{published})."
            )
        lines += [
            f"At the law's pressure, by row; force that opens a quarter: {s['opening_force']:.1f} N, "
            f"law {s['law_opening_force']:.1f} N.",
            f"{'z mm':>7}{'inside':>9}{'outside':>9}{'net':>9}{'law kPa':>9}{'force':>9}{'law N':>9}",
        ]
        for i in some_of(list(range(len(rows["z"]))), 13):
            kilo = "".join(f"{rows[name][i] / 1e3:>9.2f}" for name in ("inside", "outside", "net", "law"))
            lines.append(f"{1e3 * rows['z'][i]:>7.0f}{kilo}{rows['force'][i]:>9.2f}{rows['law_force'][i]:>9.2f}")
        return lines

    def document(self) -> dict[str, Any]:
        """Numbers and rows, for JSON."""
        return self.summary | {"rows": {name: values.tolist() for name, values in self.rows.items()}}


#: Of the pipe that is drawn, in lengths of the valve: before the flange and behind the lip.
_BEFORE, _BEHIND = 0.5, 2.0
#: Begin and end of the pipe in which the jet has given back its head, in lengths of the valve behind the lip.
_RECOVERED = 1.4, 5.4


def draw(found: FlowComparison) -> Iterator[tuple[str, Callable[[], Figure]]]:
    """Figures, each with its name."""
    yield "velocity", lambda: velocity(found)
    yield "pressure", lambda: pressure(found)
    yield "rows", lambda: rows(found)


def velocity(found: FlowComparison) -> Figure:
    """Speed in the planes x = 0 and y = 0, and that of the law (compare Fig. 7-8 of the thesis)."""
    case = found.case
    flange, lip = case.domain.rows[[-1, 0]]
    length = flange - lip
    left, right = -1e3 * _BEFORE * length, 1e3 * (1.0 + _BEHIND) * length
    top = 1e3 * min(case.domain.radius, 1.6 * case.domain.bore)
    figure = new_figure(9.6, 5.6)
    axes = figure.subplots(3, 1, sharex=True, height_ratios=[1.0, 1.0, 0.22])
    fastest = float(np.percentile(np.linalg.norm(found.fields.velocity, axis=1), 99.9))
    for panel, side, name in ((axes[0], 0, "y, mm, at x = 0"), (axes[1], -1, "x, mm, at y = 0")):
        for z, across, value in _plane(found, side):
            drawn = panel.pcolormesh(1e3 * (flange - z), 1e3 * across, value, cmap=MAGNITUDE, vmin=0, vmax=fastest)
        panel.set(ylabel=name, ylim=(0, top))
        panel.grid(False)
    place, speed = _law_speed(found)
    axes[2].pcolormesh(
        1e3 * (flange - place), [0, 1], np.tile(speed, (2, 1)), cmap=MAGNITUDE, vmin=0, vmax=fastest, shading="gouraud"
    )
    axes[2].set(xlim=(left, right), yticks=[], xlabel="Distance from the flange, mm, the flow from left to right")
    axes[2].set_ylabel("law", rotation=0, ha="right", va="center")
    axes[2].grid(False)
    colour_bar(figure, drawn, axes, "Speed, m/s")
    headline(figure, f"Flow through {case.name} at {_at(found)}: k-omega SST, and the one-dimensional law below")
    return figure


def _plane(found: FlowComparison, side: int) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Places along and across, m, and speeds of the cells beside a plane of symmetry, block by block."""
    cells, start = found.case.cells, 0
    speed = np.linalg.norm(found.fields.velocity, axis=1)
    for name, block in cells.blocks.items():
        l, m, n = block.shape
        values = speed[start : start + l * m * n].reshape(l, m, n)
        start += l * m * n
        if name == "core" and side:  # along the opening the core's columns are counted the other way
            nodes, values = block.nodes[:, :, 0], values[:, :, 0]
        else:
            nodes, values = block.nodes[:, side], values[:, side]
        points = cells.points[nodes]
        yield points[..., 2], points[..., 0 if side else 1], values


def _law_speed(found: FlowComparison) -> tuple[np.ndarray, np.ndarray]:
    """Places and speeds of the law, and of its jet behind the lip."""
    z, speed = found.case.domain.rows, found.case.state.station_velocity
    length = z[-1] - z[0]
    place = np.concatenate([[z[0] - _BEHIND * length], z, [z[-1] + _BEFORE * length]])
    return place, np.concatenate([speed[:1], speed, speed[-1:]])


def pressure(found: FlowComparison) -> Figure:
    """Mean pressure along pipe, valve and pipe (compare Fig. 7-9 of the thesis)."""
    case, s = found.case, found.summary
    flange, lip = case.domain.rows[[-1, 0]]
    figure = new_figure(7.2, 4.2)
    axes = figure.add_subplot()
    scale = found.law_flange / found.flange
    axes.plot(1e3 * (flange - found.stations), 1e-3 * scale * found.mean_pressure, color=COMPUTED, label="k-omega SST")
    law = case.state.station_pressure
    axes.plot(1e3 * (flange - case.domain.rows), 1e-3 * law, color=ACCENT, label="one-dimensional law")
    if "recovery" in s:
        head = 0.5 * case.density * s["jet_velocity"] ** 2 * scale
        ideal = 1.0 - (s["lip_area"] / (0.25 * np.pi * case.pipe**2)) ** 2
        ends = 1e3 * (flange - lip) * (1.0 + np.array(_RECOVERED))
        for loss, look, name in (
            (s["law_loss"], {"color": REST, "lw": 4.0, "alpha": 0.6}, "jet that widens as Borda and Carnot have it"),
            (s["published_loss"], {"color": PUBLISHED, "ls": "--"}, "the thesis's recovery"),
        ):
            if loss is not None:
                axes.plot(ends, np.full(2, 1e-3 * (ideal - loss) * head), label=name, **look)
    axes.axvspan(0.0, 1e3 * (flange - lip), color="0.95", zorder=0)
    axes.text(500.0 * (flange - lip), axes.get_ylim()[1], "valve", ha="center", va="top", path_effects=HALO)
    axes.set(xlabel="Distance from the flange, mm", ylabel="Mean pressure over that beside the lip, kPa")
    axes.legend()
    axes.set_title(f"Pressure along the pipe at {_at(found)}", loc="left", weight="bold")
    return figure


def rows(found: FlowComparison) -> Figure:
    """Pressures on the wall by row, and their difference from the law."""
    figure = new_figure(7.2, 5.2)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=[2, 1])
    r = found.rows
    z = 1e3 * r["z"]
    above.plot(z, 1e-3 * r["inside"], color=COMPUTED, label="inner face, k-omega SST")
    above.plot(z, 1e-3 * r["outside"], color=COMPUTED, ls=":", label="outer face, k-omega SST")
    above.plot(z, 1e-3 * r["law"], color=ACCENT, label="one-dimensional law")
    above.set_ylabel("Pressure, kPa")
    above.legend()
    below.plot(z, 1e-3 * (r["net"] - r["law"]), color=COMPUTED)
    below.axhline(0.0, color=REST, lw=0.8)
    below.set(xlabel="z from the lip, mm", ylabel="Net, less the law, kPa")
    headline(figure, f"Pressure on the wall with {_at(found)} at the flange")
    return figure


def _at(found: FlowComparison) -> str:
    return kilopascals(found.case.state.pressure)
