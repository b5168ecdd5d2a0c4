"""Flow in three dimensions beside the one-dimensional law: pressures, flow, recovery, force on the wall."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from .flow_case import FlowCase
from .foam import FlowFields

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

    Attributes
    ----------
    case : FlowCase
    fields : FlowFields
    """

    case: FlowCase
    fields: FlowFields

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

    def _wall(self, block: str, ring: int, patch: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Pressures (k,), area vectors (k, 3) out of the fluid and places (k, 3) of the faces of a wall, section by
        section.
        """
        domain, cells = self.case.domain, self.case.cells
        beside = cells.beside(block, ring)[domain.lip : domain.flange].ravel()
        corners = cells.points[cells.patches[patch]]
        area = 0.5 * np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
        centre = corners.mean(axis=1)
        inwards = np.einsum("ki,ki->k", area, centre - cells.centres[beside]) < 0
        area[inwards] *= -1.0
        return self._pressure[beside] - self.back, area, centre

    def _by_row(self, block: str, ring: int, patch: str) -> tuple[np.ndarray, np.ndarray]:
        """Mean pressures (rows - 1,), Pa, and forces in y (rows - 1,), N, between the rows of the shell; what lies
        between two sections of the mesh is spread evenly.
        """
        pressure, area, _ = self._wall(block, ring, patch)
        domain = self.case.domain
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
                "published_loss": PUBLISHED_LOSS.get(round(state.pressure / 1e3, 3)),
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
        count = len(rows["z"])
        for i in np.unique(np.linspace(0, count - 1, min(count, 13)).round().astype(int)):
            kilo = "".join(f"{rows[name][i] / 1e3:>9.2f}" for name in ("inside", "outside", "net", "law"))
            lines.append(f"{1e3 * rows['z'][i]:>7.0f}{kilo}{rows['force'][i]:>9.2f}{rows['law_force'][i]:>9.2f}")
        return lines

    def document(self) -> dict[str, Any]:
        """Numbers and rows, for JSON."""
        return self.summary | {"rows": {name: values.tolist() for name, values in self.rows.items()}}
