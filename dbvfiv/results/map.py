"""Stability maps: the result, in memory or in a file."""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np

from ..record.header import Header, read_header
from ..record.layout import Table
from ..record.mesh import MeshData, read_mesh
from ..record.result import Result
from ..studies.map import MapResult, grid
from ..studies.map_checks import Check
from ..studies.map_column import MapColumn, MapPlan
from ..studies.map_curves import OnsetCurve, linked
from .map_file import MapFile, read_columns, read_messages
from .stability_tables import CHECKS, CURVE_POINTS

if TYPE_CHECKING:
    pass

LAWS = {0.0: "quasi-steady", 1.0: "storage"}


class MapResults(Result):
    """Growth rate of the leading mode over two parameters.

    Attributes
    ----------
    plan : MapPlan
        Axes and continuity laws.
    columns : tuple of MapColumn
    curves : tuple of OnsetCurve
    checks : tuple of Check
    """

    kind = "map"

    def __init__(self, header: Header, mesh: MeshData, columns, curves, checks, **common):
        super().__init__(header, mesh, **common)
        self.plan = MapPlan.of(header.case)
        self.columns: tuple[MapColumn, ...] = tuple(sorted(columns, key=lambda c: c.value))
        self.curves: tuple[OnsetCurve, ...] = tuple(curves) or linked(self.plan, self.columns)
        self.checks: tuple[Check, ...] = tuple(checks)

    @classmethod
    def of(cls, result: MapResult, header: Header, mesh: MeshData) -> MapResults:
        """From a run that has just ended."""
        header = replace(header, complete=not result.interrupted)
        return cls(
            header,
            mesh,
            result.columns,
            result.curves,
            result.checks,
            warnings=result.warnings,
            failures=result.failures,
        )

    @classmethod
    def read(cls, file: h5py.File, path: Path) -> MapResults:
        warnings, failures = read_messages(file)
        curves, checks = _curves(file), _checks(file)
        return cls(
            read_header(file),
            read_mesh(file),
            read_columns(file),
            curves,
            checks,
            warnings=warnings,
            failures=failures,
            path=path,
        )

    def save(self, path: str | Path) -> Path:
        with MapFile(path, self.plan, self.header, self.mesh) as file:
            for column in self.columns:
                file.item(column)
            for sentence in self.warnings:
                file.warn(sentence)
            file.conclude(
                MapResult(
                    self.plan, self.columns, self.curves, self.checks, self.failures, self.warnings, not self.complete
                )
            )
        return Path(path)

    def grid(self, name: str) -> np.ndarray:
        """growth_rate, frequency, second, unstable, counted, certified or how on the grid (laws, y, x)."""
        return grid(self.plan, self.columns, name)

    def summary(self) -> dict[str, Any]:
        pictures = [self._picture(i) for i in range(len(self.plan.laws))]
        shared = {
            "x": _axis(self.plan.x),
            "y": _axis(self.plan.y),
            "checks": [{f.name: getattr(check, f.name) for f in fields(check)} for check in self.checks],
            "gaps": list(self.failures),
            "warnings": list(self.warnings),
            "interrupted": not self.complete,
        }
        document = shared | pictures[0]
        if len(pictures) > 1:
            document["laws"] = pictures
        return document

    def _picture(self, law: int) -> dict[str, Any]:
        mine = [curve for curve in self.curves if curve.law == law]
        return {
            "continuity": LAWS.get(self.plan.laws[law], self.plan.laws[law]),
            "growth_rate": self.grid("growth_rate")[law].tolist(),
            "frequency": self.grid("frequency")[law].tolist(),
            "unstable_count": self.grid("unstable")[law].tolist(),
            "unstable_count_independent": self.grid("counted")[law].tolist(),
            "certified": self.grid("certified")[law].astype(bool).tolist(),
            "onset_curves": [curve.points() for curve in mine],
            "onset_frequencies": [curve.frequency.tolist() for curve in mine],
            "onset_curves_exact": [bool(curve.exact) for curve in mine],
        }

    def lines(self) -> list[str]:
        lines = []
        grids = self.grid("unstable"), self.grid("certified"), self.grid("how")
        for i, law in enumerate(self.plan.laws):
            unstable, certified, how = (table[i] for table in grids)
            cells, gaps = unstable.size, int((unstable < 0).sum())
            name = LAWS.get(law, f"blend {law:g}")
            lines.append(
                (
                    f"{name}: {unstable.shape[1]} x {unstable.shape[0]} cells, "
                    f"{int(((unstable > 0) & certified).sum())} unstable, {int(((unstable == 0) & certified).sum())} "
                    f"stable, {int(certified.sum())} of {cells} certified"
                )
                + (f", {int((how == 1).sum())} solved directly" if (how == 1).any() else "")
                + (f", {gaps} in gaps" if gaps else "")
                + "."
            )
            for curve in self.curves:
                if curve.law == i:
                    kind = "exact" if curve.exact else "not exact"
                    lines.append(
                        f"  onset curve, {kind}, {len(curve.x)} points: {self.plan.x.parameter} "
                        f"{min(curve.x):.6g} to {max(curve.x):.6g}, "
                        f"{self.plan.y.parameter} {min(curve.y):.6g} to {max(curve.y):.6g}, "
                        f"{min(curve.frequency):.4g} to {max(curve.frequency):.4g} Hz"
                    )
        if self.checks:
            worst = max(check.error for check in self.checks)
            agreeing = sum(check.agrees for check in self.checks)
            lines.append(
                f"{agreeing} of {len(self.checks)} cells solved again with the full pencil agree; largest "
                f"difference {worst:.1e}."
            )
        return lines


def _axis(axis) -> dict[str, Any]:
    return {"parameter": axis.parameter, "values": list(axis.values), "log": axis.log}


def _curves(file: h5py.File) -> list[OnsetCurve]:
    if "curves" not in file:
        return []
    table = Table(file["curves"], CURVE_POINTS)
    data = {c.name: table.read(c.name) for c in CURVE_POINTS}
    found = []
    for number in np.unique(data["curve"]):
        rows = np.flatnonzero(data["curve"] == number)
        one = {name: data[name][rows] for name in ("x", "y", "frequency")}
        found.append(
            OnsetCurve(
                int(data["law"][rows[0]]),
                **one,
                exact=bool(data["exact"][rows[0]]),
                mismatch=float(data["mismatch"][rows[0]]),
            )
        )
    return found


def _checks(file: h5py.File) -> list[Check]:
    if "checks" not in file:
        return []
    table = Table(file["checks"], CHECKS)
    data = {c.name: table.read(c.name) for c in CHECKS}
    return [Check(**{name: values[i].item() for name, values in data.items()}) for i in range(table.rows)]
