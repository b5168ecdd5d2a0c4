"""Strain levels over a list of pressures, each from the one before."""

from __future__ import annotations

from collections import Counter
from dataclasses import fields
from typing import Any

from ...case.materials import RUBBERS
from ...errors import CaseError, SolveError
from ...model.material_stability import LayerLevel
from ...model.strain_level import agree_levels, beyond_tests
from ...record.record import GrowingRecord
from ...record.table import TEXT, Column, Shown, TableSpec, printed_head, printed_row
from ...texts import json_value
from ..result import StudyResult
from ..session import Session, Study
from ..state import miss, missed_before

LEVELS = "levels"
_LEVEL = "Strain level whose constants it has; NaN of rubbers without levels"
_PEAK = "Strain that 99 % of its volume does not reach; of tension with the same first invariant"
_MEAN = "Mean strain, weighted with the energy stored"
#: A row for each pressure and layer of rubber, made of a state and one of its layers.
_COLUMNS = (
    Column("pressure", "Pa", "Static inlet pressure", shown=Shown("pressure", "kPa", 10, ".6g")),
    Column("mass_flow", "kg/s", "Whole valve, with levels that agree", shown=Shown("flow", "kg/s", 9, ".5g")),
    Column("layer", "", "Number of the layer, from inside to outside", "i4", Shown("layer", "", 6, "")),
    Column("material", "", "Its rubber", TEXT, Shown("rubber", "", 8, "")),
    Column("level", "", _LEVEL, shown=Shown("level", "%", 8, ".4g")),
    Column("peak", "", _PEAK, shown=Shown("peak", "%", 8, ".4g")),
    Column("mean", "", _MEAN, shown=Shown("mean", "%", 8, ".4g")),
)
_TABLE = TableSpec(LEVELS, _COLUMNS)


def run(session: Session, record: GrowingRecord) -> None:
    """Levels at `levels.pressures`; a pressure that is not reached is a failure, and the list goes on."""
    case = session.case
    if not any(case.materials.is_built_in(layer.material) and layer.material in RUBBERS for layer in case.layers):
        raise CaseError(
            f"No layer is one of the built-in rubbers {', '.join(RUBBERS)}, which alone have strain levels.", "layers"
        )
    layer, kept = record.column(LEVELS, "layer"), record.column(LEVELS, "pressure")
    missed = [note["pressure"] for note in missed_before(record)]
    left = Counter([*kept[layer == layer[:1]].tolist(), *missed])  # as often as asked for: pressures may come back
    levels = last_levels(record)
    record.begin("levels", len(case.levels.pressures))
    for pressure in case.levels.pressures:
        if left[pressure] > 0:
            left[pressure] -= 1
            _tell_beyond_tests(record, pressure)
            continue
        try:
            found = agree_levels(case, pressure, record, levels)
        except SolveError as error:
            miss(record, pressure, error)
            continue
        state = {"pressure": found.state.pressure, "mass_flow": found.state.mass_flow}
        rows = [state | vars(layer) | {"layer": layer.number} for layer in found.layers]
        record.extend(LEVELS, {c.name: [row[c.name] for row in rows] for c in _COLUMNS})  # whole pressures or none
        levels = found.levels
        record.item(found)
        _tell_beyond_tests(record, pressure)


def _tell_beyond_tests(record: GrowingRecord, pressure: float) -> None:
    """Warn of rubbers that strain beyond their tests at a pressure that is kept."""
    names = [field.name for field in fields(LayerLevel)]
    kept = zip(record.column(LEVELS, "pressure"), record.table_rows(_TABLE, ["layer", *names[1:]]))
    layers = [LayerLevel(row.pop("layer"), **row) for place, row in kept if place == pressure]
    record.warn(*beyond_tests(layers, pressure))


def last_levels(record: GrowingRecord) -> dict[str, float] | None:
    """Levels at the last pressure that is kept, which the next one starts from; None if there is none."""
    if not record.rows(LEVELS):
        return None
    pressures, names, levels = (record.column(LEVELS, name) for name in ("pressure", "material", "level"))
    last = pressures == pressures[-1]
    return {str(name): float(level) for name, level in zip(names[last], levels[last]) if level == level}


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
        return self.record.table_rows(_TABLE)

    def summary(self) -> dict[str, Any]:
        return {"points": json_value(self.rows)} | self.ending()

    def lines(self) -> list[str]:
        columns = self.case.units.columns(_COLUMNS)
        return [*printed_head(columns), *(printed_row(columns, row) for row in self.rows)]


STUDY = Study("levels", lambda _mesh: (_TABLE,), run, LevelsResult)
