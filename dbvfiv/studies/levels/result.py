"""Strain levels: what their file holds and what can be read off them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ...model.strain_level import AgreedLevels
from ...record.mesh import MeshData
from ...record.table import TEXT, Column, Shown, TableSpec, printed_head, printed_row
from ..result import StudyResult

LAYERS = "levels"


def _percent(name: str):
    return lambda row: f"{100 * row[name]:.4g}"


_COLUMNS = (
    Column(
        "pressure",
        "Pa",
        "Static inlet pressure",
        shown=Shown("pressure", "kPa", 10, lambda row: f"{row['pressure'] / 1e3:.6g}"),
    ),
    Column(
        "mass_flow",
        "kg/s",
        "Of the whole valve, with the levels that agree",
        shown=Shown("flow", "kg/s", 9, lambda row: f"{row['mass_flow']:.5g}"),
    ),
    Column(
        "layer",
        "",
        "Number of the layer, from inside to outside",
        "i4",
        shown=Shown("layer", "", 6, lambda row: str(int(row["layer"]))),
    ),
    Column("material", "", "Its rubber", TEXT, shown=Shown("rubber", "", 8, lambda row: str(row["material"]))),
    Column(
        "level",
        "",
        "Strain level whose constants it has; NaN of rubbers without levels",
        shown=Shown("level", "%", 8, _percent("level")),
    ),
    Column(
        "peak",
        "",
        "Strain that 99 % of its volume does not reach; of tension with the same first invariant",
        shown=Shown("peak", "%", 8, _percent("peak")),
    ),
    Column("mean", "", "Mean strain, weighted with the energy stored", shown=Shown("mean", "%", 8, _percent("mean"))),
)
_TABLE = TableSpec(LAYERS, _COLUMNS)


def tables_of(mesh: MeshData) -> tuple[TableSpec, ...]:
    """The table of a result."""
    return (_TABLE,)


def rows_of(found: AgreedLevels) -> Iterator[dict[str, Any]]:
    """A row for each layer of rubber."""
    for layer in found.layers:
        yield {
            "pressure": found.state.pressure,
            "mass_flow": found.state.mass_flow,
            "layer": layer.number,
            "material": layer.material,
            "level": layer.level,
            "peak": layer.peak,
            "mean": layer.mean,
        }


class LevelsResult(StudyResult):
    """Levels that agree with the strains of the layers.

    Examples
    --------
    >>> found = dbvfiv.load().levels(["18 kPa", "36 kPa"])                                      # doctest: +SKIP
    >>> [(row["pressure"], row["material"], row["level"]) for row in found.rows]                # doctest: +SKIP
    """

    kind = "levels"

    @property
    def rows(self) -> list[dict[str, Any]]:
        """A row for each pressure and layer of rubber, SI; strains as fractions."""
        return [row | {"layer": int(row["layer"])} for row in self.record.table_rows(_TABLE)]

    def summary(self) -> dict[str, Any]:
        plain = [
            {name: None if isinstance(x, float) and np.isnan(x) else x for name, x in row.items()} for row in self.rows
        ]
        return {"points": plain}

    def lines(self) -> list[str]:
        return [*printed_head(_COLUMNS), *(printed_row(_COLUMNS, row) for row in self.rows)]
