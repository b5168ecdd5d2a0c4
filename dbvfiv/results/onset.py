"""Onsets along one parameter: the result, in memory or in a file."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np

from ..case.parameters import PARAMETERS
from ..record.header import Header, read_header
from ..record.layout import read_texts
from ..record.mesh import MeshData, read_mesh
from ..record.result import Result
from ..studies.onset_point import FINE
from .onset_file import OnsetFile, latest_points, read_rows, row_of_point
from .stability_tables import SCAN

if TYPE_CHECKING:
    from ..model import ValveModel
    from ..studies.onset import OnsetResult


class OnsetResults(Result):
    """Onsets in ascending order of the parameter, and the scan that found them.

    Attributes
    ----------
    points : tuple of dict
        One for each onset, see `stability_tables.ONSETS`.
    values, growth_rates, frequencies : (s,), (s, 4), (s, 4) arrays
        The scan.
    certified : (s,) bool array
        An independent count agrees there.
    parameter : str
    """

    kind = "onset"

    def __init__(self, header: Header, mesh: MeshData, points, scan, **common):
        super().__init__(header, mesh, **common)
        self.points = tuple(dict(row) for row in points)
        scan = sorted(scan, key=lambda row: row["value"])
        self.values = np.array([row["value"] for row in scan])
        self.growth_rates = np.array([row["growth_rates"] for row in scan]).reshape(-1, 4)
        self.frequencies = np.array([row["frequencies"] for row in scan]).reshape(-1, 4)
        self.certified = np.array([bool(row.get("certified")) for row in scan], bool)
        self.parameter = self.case.onset.axis.parameter

    @classmethod
    def of(cls, result: OnsetResult, header: Header, model: ValveModel) -> OnsetResults:
        """From a run that has just ended."""
        points = [row_of_point(p) for p in result.points]
        header = replace(header, complete=not result.interrupted)
        rows = zip(result.values, result.growth_rates, result.frequencies, result.certified)
        scan = [
            {"value": float(v), "growth_rates": g, "frequencies": f, "certified": bool(sure)} for v, g, f, sure in rows
        ]
        return cls(
            header, MeshData.of(model), points, scan, warnings=result.warnings, failures=result.failures, model=model
        )

    @classmethod
    def read(cls, file: h5py.File, path: Path) -> OnsetResults:
        # the second mesh and values without a state belong to the run and not to its result
        scan = {
            row["value"]: row for row in read_rows(file["scan"], SCAN) if row["mesh"] == FINE and not row["failure"]
        }
        return cls(
            read_header(file),
            read_mesh(file),
            latest_points(file),
            scan.values(),
            warnings=read_texts(file, "messages/warnings"),
            failures=read_texts(file, "messages/failures"),
            path=path,
        )

    def save(self, path: str | Path) -> Path:
        rows = zip(self.values, self.growth_rates, self.frequencies, self.certified)
        same = {"mesh": FINE, "failure": ""}
        scan = [{"value": v, "growth_rates": g, "frequencies": f, "certified": sure} | same for v, g, f, sure in rows]
        with OnsetFile(path, self.header, self.mesh) as file:
            file.finish(self.warnings, self.failures, self.complete, self.points, scan)
        return Path(path)

    def summary(self) -> dict[str, Any]:
        return {
            "parameter": self.parameter,
            "points": [self._point(row) for row in self.points],
            "scan": {
                "values": self.values.tolist(),
                "growth_rate": self.growth_rates[:, 0].tolist(),
                "frequency": self.frequencies[:, 0].tolist(),
                "certified": self.certified.tolist(),
            },
            "failures": list(self.failures),
            "warnings": list(self.warnings),
            "interrupted": not self.complete,
        }

    def _point(self, row: dict[str, Any]) -> dict[str, Any]:
        found: dict[str, Any] = {"parameter": self.parameter}
        for name, value in row.items():
            if not name.startswith("sides/"):
                found[name] = _plain(value)
        names = [name for name in row if name.startswith("sides/")]
        for i, side in enumerate(("below", "above")):
            found[side] = {name.split("/")[1]: _plain(row[name][i]) for name in names}
        return found

    def lines(self) -> list[str]:
        unit, scale = PARAMETERS[self.parameter].shown_unit, PARAMETERS[self.parameter].scale
        if not self.points:
            low, high = (self.values[[0, -1]] / scale) if len(self.values) else (math.nan, math.nan)
            if not len(self.values) or not self.certified.all():
                sure = int(self.certified.sum())
                return [
                    f"No onset was found, and none is ruled out: {sure} of {len(self.values)} values from {low:.6g} to "
                    f"{high:.6g} {unit} carry a certificate."
                ]
            state = "unstable" if self.growth_rates[0, 0] > 0 else "stable"
            return [f"No onset: the valve is {state} from {low:.6g} to {high:.6g} {unit}."]
        lines = [
            (
                f"{self.parameter + (f', {unit}' if unit else ''):>16} {'+-':>9} {'Hz':>8}  "
                f"{'':<28}{'below, 1/s':>11}{'above, 1/s':>11}"
            )
        ]
        for row in self.points:
            becomes = "unstable above" if row["gains"] else "stable above"
            which = {"super": "supercritical", "sub": "subcritical"}.get(row["criticality"], row["criticality"])
            words = becomes + (f", {which}" if which else "") if row["edge"] else f"a further mode {becomes}"
            spread = f"{row['uncertainty'] / scale:9.2g}" if math.isfinite(row["uncertainty"]) else " " * 9
            below, above = row["sides/growth_rate"]
            mark = "" if row["confirmed"] else "  not confirmed"
            lines.append(
                f"{row['value'] / scale:16.8g} {spread} {row['frequency']:8.3f}  "
                f"{words:<28}{below:11.4g}{above:11.4g}{mark}"
            )
        return lines


def _plain(value: Any) -> Any:
    if isinstance(value, (str, np.str_)):
        return str(value) or None
    if isinstance(value, np.ndarray):
        return value.tolist()
    value = value.item() if hasattr(value, "item") else value
    return None if isinstance(value, float) and not math.isfinite(value) else value
