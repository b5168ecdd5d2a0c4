"""Strain levels over a list of pressures, each from the one before."""

from __future__ import annotations

from ...case.materials import RUBBERS
from ...errors import CaseError, SolveError
from ...model.strain_level import agree_levels
from ...record.record import GrowingRecord
from ..session import Session
from ..study import Study
from .result import LAYERS, LevelsResult, rows_of, tables_of


def run(session: Session, record: GrowingRecord) -> None:
    """Levels at `levels.pressures`; a pressure that is not reached is a failure, and the list goes on."""
    case = session.case
    if not any(case.materials.is_built_in(layer.material) and layer.material in RUBBERS for layer in case.layers):
        raise CaseError(
            f"No layer is one of the built-in rubbers {', '.join(RUBBERS)}, which alone have strain levels.", "layers"
        )
    kept = record.rows(LAYERS)
    done = {float(pressure) for pressure in record.column(LAYERS, "pressure")}
    levels = levels_of(record, kept)
    record.begin("levels", len(case.levels.pressures))
    for pressure in case.levels.pressures:
        if pressure in done:
            continue
        try:
            found = agree_levels(case, pressure, record, levels)
        except SolveError as error:
            record.fail(str(error))
            continue
        rows = list(rows_of(found))
        record.extend(LAYERS, {name: [row[name] for row in rows] for name in rows[0]})  # whole pressures or none
        levels = found.levels
        record.item(found)
        for sentence in found.bounded():
            record.warn(sentence)


def levels_of(record: GrowingRecord, count: int) -> dict[str, float] | None:
    """Levels at the last pressure that is kept, which the next one starts from; None if there is none."""
    if not count:
        return None
    pressures, names, levels = (record.column(LAYERS, name) for name in ("pressure", "material", "level"))
    last = pressures == pressures[-1]
    return {str(name): float(level) for name, level in zip(names[last], levels[last]) if level == level}


STUDY = Study("levels", tables_of, run, LevelsResult)
