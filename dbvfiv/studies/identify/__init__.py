"""``dbvfiv identify``: what measured records say of a valve, and how far it is from flutter."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from pydantic import Field, StrictInt, StrictStr

from ...case.axis import Point, RangeSection, StabilityRange
from ...case.model import Case
from ...case.parameters import listed
from ...case.quantity import Frequency, Number
from ...case.section import Section, key
from ...case.tables import ExistingFile
from ...errors import CaseError
from ..request import DensityOption, LawOption, Request, WorkersOption, over_option
from ..workers import WORKERS_HELP, WorkersKey

ORDER = 34


class MeasuredRecord(Section):
    """A record of the valve's vibration, or a mode that was measured."""

    file: ExistingFile | None = key(None, "CSV of times and values: a ring-down, or motion that noise drives.")
    column: StrictStr = key("", "Column of the values by name or number from 1; all by default.")
    rate: Annotated[Frequency, Field(gt=0)] | None = key(None, "Sampling rate, where no column holds times.")
    at: Point = key("", "Where it was taken: 'pressure=1 m', or several, 'pressure=1 m, density=1025'.")
    frequency: Annotated[Frequency, Field(gt=0)] | None = key(None, "Of a measured mode, in place of a file.")
    frequency_interval: Annotated[Frequency, Field(gt=0)] | None = key(None, "Half its 95 % interval.")
    damping_ratio: Annotated[Number, Field(gt=-1, lt=1)] | None = key(None, "Of that mode.")
    damping_ratio_interval: Annotated[Number, Field(gt=0, lt=1)] | None = key(None, "Half its 95 % interval.")


class Keys(RangeSection):
    """Identification of the valve by measured records."""

    records: tuple[MeasuredRecord, ...] = key((), "Measured records and modes, each with where it was taken.")
    over: StabilityRange | None = key(
        None,
        "Values at which the onset is sought and a further measurement may be: a range as in onset.over; pressures "
        "about those of the records without it.",
    )
    error: Annotated[Number, Field(ge=0, lt=1)] = key(
        0.01, "Half the 95 % interval of computed frequencies that no input explains, relative."
    )
    damping_error: Annotated[Number, Field(ge=0, lt=1)] = key(0.05, "The same of computed damping ratios.")
    samples: StrictInt = key(64, "Valves that are computed before the records are looked at.", ge=8, le=100_000)
    round: StrictInt = key(32, "Further valves a round, drawn from what the records leave.", ge=4, le=10_000)
    rounds: StrictInt = key(
        3,
        "Rounds at most before one over the whole range; they end where the measurement is the larger error.",
        ge=1,
        le=20,
    )
    seed: StrictInt = key(1, "Number that the samples follow from.", ge=0, le=2**31)
    workers: WorkersKey = key(1, WORKERS_HELP)


def command(
    case: Case,
    records: Annotated[
        list[Path] | None,
        typer.Argument(metavar="[RECORD.csv ...]", help="Measured records; identify.records without them."),
    ] = None,
    at: Annotated[
        list[str] | None,
        typer.Option("--at", metavar="NAME=VALUE", help="Where each was taken, 'pressure=1 m'; in their order."),
    ] = None,
    column: Annotated[
        list[str] | None, typer.Option("--column", "-c", metavar="NAME", help="Column of each, or of all.")
    ] = None,
    over: Annotated[str | None, over_option(f"PARAMETER=START:STOP:COUNT of {listed()}: where flutter begins.")] = None,
    density: DensityOption = None,
    law: LawOption = None,
    samples: Annotated[int | None, typer.Option("--samples", "-n", metavar="N", help="Valves computed first.")] = None,
    posterior: Annotated[
        Path | None,
        typer.Option("--case", metavar="FILE.toml", help="Write the case with what was learned as its uncertainty."),
    ] = None,
    workers: WorkersOption = None,
) -> Request:
    """Loss factors, modulus, line and other uncertain inputs as measured records have them, and where flutter begins,
    with 95 % intervals.

    The inputs are those of `uncertainty`. Ring-downs and motion under noise give frequency and damping of modes; each
    is any of the computed modes, the likelier the better it fits. Inputs that the records cannot tell apart are named,
    with the measurement that would.

    With -o every valve is kept at once: `dbvfiv resume` goes on after Ctrl-C or a crash.

    dbvfiv identify my.toml tap.csv flow.csv --at "pressure=1 m" --at "pressure=2 m" --case known.toml -o i.h5
    """
    if not records and (at or column):
        raise CaseError("--at and --column say where records were taken; no record is given.")
    places, columns = _each(at, records, "--at"), _each(column, records, "--column")
    given = [{"file": str(f.resolve()), "at": p, "column": c} for f, p, c in zip(records or (), places, columns)]
    return Request({"identify.records": given or None}, {"posterior": posterior})


def _each(given: list[str] | None, records: list[Path] | None, name: str) -> list[str]:
    """An option for each record: none, one for all, or as many as records."""
    count = len(records or ())
    found = list(given or [""])
    if len(found) not in (1, count):
        raise CaseError(f"{name} is given {len(found)} times for {count} records; give it once, or for each.")
    return found * count if len(found) == 1 else found
