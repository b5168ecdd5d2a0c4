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
    done = {float(pressure) for pressure in record.column(LAYERS, "pressure")}
    record.begin("levels", len(case.levels.pressures))
    start = None
    for pressure in case.levels.pressures:
        if pressure in done:
            continue
        try:
            start = agree_levels(case, pressure, record, start)
        except SolveError as error:
            record.fail(str(error))
            continue
        for row in rows_of(start):
            record.append(LAYERS, row)
        record.item(start)
        for sentence in start.bounded():
            record.warn(sentence)


STUDY = Study("levels", tables_of, run, LevelsResult)
