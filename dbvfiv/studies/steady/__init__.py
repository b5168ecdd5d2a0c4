"""``dbvfiv steady``: equilibria over a list of pressures, and the catalogue sheet of them."""

from __future__ import annotations

import csv
import math
import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any

import typer
from pydantic import StrictInt, ValidationInfo, field_validator

from ...case.axis import parse_axis
from ...case.measured import AREA, DISCHARGE, MEASURED_FILES, SHAPE, TAPS, find_measured
from ...case.model import Case
from ...case.physics import DrivePressure
from ...case.quantity import Number, Quantity, head_of, number_or_text
from ...case.section import Section, key
from ...case.units import Units, factor_of
from ...errors import CaseError
from ..request import Request, is_sheet, pressure_option

ORDER = 20


class Keys(Section):
    """Equilibria over a list of pressures."""

    told_by_giving = ("pressures",)

    pressures: tuple[DrivePressure, ...] = key(
        (2e3, 6e3, 12e3, 18e3, 24e3, 29e3, 36e3, 50e3),
        "Static inlet pressures of the head-discharge curve.",
        min_length=1,
    )
    cracking_area: Number = key(
        2.0,
        "Where the valve counts as cracked: the passage at the lips over that at rest, which is a gap and not nothing.",
        gt=1,
        le=100,
    )
    measured: Annotated[tuple[Path, ...], MEASURED_FILES] = key(
        (),
        "CSV of measured points that figures and tables show beside the computed ones, one file or several, "
        "relative to the case file. The first line names the columns with units: a pressure as drive.pressure has "
        "it, or a head of the fluid, with a flow, the area at the lip or both (pressure [kPa], flow [L/s], area "
        "[cm2]); with points of sections of the wall (pressure [kPa], z [mm], face, x [mm], y [mm]; without z at "
        "the lip, without face on the inner one); or with static pressures along the axis (pressure [kPa], z [mm], "
        "tap [kPa]).",
    )
    tolerance: Number = key(1e-8, "Residual, relative to the load, at which Newton stops.", gt=0, le=1e-2)
    max_iterations: StrictInt = key(30, "Newton iterations of one load step.", ge=1, le=10000)
    min_step: Number = key(1e-4, "Smallest load step, relative to the target, before giving up.", gt=0, le=1)

    @field_validator("measured", mode="before")
    @classmethod
    def _find_measured(cls, given: Any, info: ValidationInfo) -> Any:
        return find_measured(given, info, (DISCHARGE, AREA, SHAPE, TAPS))


Pressures = Annotated[
    list[str] | None,
    pressure_option(
        "Static inlet pressure, '36 kPa', '2 m' or '6 ft' (head of the fluid), '2 mH2O', or a range "
        "'2 kPa:50 kPa:12'; may be repeated."
    ),
]


Sizes = Annotated[
    list[str] | None,
    typer.Option(
        "--scale",
        metavar="S",
        help="Of a sheet: one size, valve.scale as a number or the bore, '100 mm' or '4 in'; repeated for several.",
    ),
]
UnitsOption = Annotated[
    str | None,
    typer.Option(
        "--units", metavar="U,U", help="Units of tables and sheet, 'ft, gpm, ft/s, in'; else m, L/s, m/s, mm."
    ),
]


def command(
    case: Case, pressures: Pressures = None, sizes: Sizes = None, units: UnitsOption = None, output: Path | None = None
) -> Request:
    """Equilibria of the coupled valve: flow, lip area, jet velocity, deflections, layer stresses.

    The pressures are those of --pressure; else steady.pressures of the case, or its drive.pressure where only that is
    given, with --set for instance; else, with a pump, the operating point. Each state is found from the one before.

    Nothing is written unless asked for: -o keeps states, stations and layer stresses in a result file (an earlier
    result of that name is replaced), state by state, so that Ctrl-C keeps what is done and `dbvfiv resume` goes on.
    `dbvfiv plot`, `export` and `info` read it.

    dbvfiv steady cases/dbv12.toml -p "18 kPa" -p "36 kPa" -o dbv12.h5

    A file in .csv or .xlsx takes the catalogue sheet in its place: head, flow, velocities, loss, K, Kv and opening, of
    one size or several.

    dbvfiv steady cases/dbv12.toml -p "0.2 m:5 m:9:log" --scale 0.5 --scale 1 --units "ft, gpm, in" -o catalogue.csv
    """
    changes: dict[str, Any] = {"project.units": units}
    if pressures or not case.meets_pump("steady"):
        asked = _read(pressures, case.fluid.density) if pressures else case.steady_pressures()
        changes["steady.pressures"] = list(asked)
    if not is_sheet(output):
        if sizes:
            raise CaseError("--scale goes with a sheet; name one with -o, such as catalogue.csv.")
        return Request(changes)
    first, *others = [_scale(text, case) for text in sizes] if sizes else [None]
    require_sheet(output)
    return Request(
        changes | {"valve.scale": first},
        sheet=lambda results: write_sheet(output, [state for result in results for state in result.states]),
        variants=tuple({"valve.scale": scale} for scale in others),
    )


def _scale(text: str, case: Case) -> float:
    """Factor valve.scale of a size that is given as a factor or as the bore of its flange."""
    given = number_or_text(text)
    try:
        scale = given if isinstance(given, float) else Quantity("m", "mm").parse(given) / case.valve.as_given.bore
    except ValueError as error:
        raise CaseError(f"--scale is given as {text!r}, {error}; it must be a factor or a bore.") from None
    if not 1e-3 <= scale <= 1e3:
        raise CaseError(f"--scale is given as {text!r}, {scale:.3g} times the valve; it must be within 0.001 and 1000.")
    return scale


def _read(texts: Iterable[str], density: float) -> Iterable[float | str]:
    for text in texts:
        if ":" in text:
            yield from _range(text, density)
        else:
            yield number_or_text(text)


def _range(text: str, density: float) -> tuple[float, ...]:
    try:
        return parse_axis(f"pressure={text}", density=density).values
    except ValueError as error:
        raise CaseError(
            f"--pressure is given as {text!r}, {error}; a range is START:STOP:COUNT, with ':log' behind it for "
            f"logarithmic steps."
        ) from None


@dataclass(frozen=True)
class SheetColumn:
    """A column of the sheet; heads and pressures but `FAR` are those at the flange."""

    title: str
    kind: str  #: Quantity whose unit can be chosen, a key of `dbvfiv.case.units.UNITS`; empty for one of fixed unit.
    unit: str  #: Unit where none is chosen.
    #: From a steady `State` of a result to the number, in SI units where there is a kind.
    value: Callable[[Any], float]


COLUMNS = (
    SheetColumn("bore", "size", "mm", lambda s: s.results.case.valve.bore),
    SheetColumn("static head", "head", "m", lambda s: head_of(s.flange_pressure, s.results.case.fluid.density)),
    SheetColumn("static pressure", "pressure", "kPa", lambda s: s.flange_pressure),
    SheetColumn("flow", "flow", "L/s", lambda s: s.volume_flow),
    SheetColumn("velocity", "velocity", "m/s", lambda s: s.hydraulics.flange_velocity),
    SheetColumn("jet velocity", "velocity", "m/s", lambda s: s.outlet_velocity),
    SheetColumn("head loss", "head", "m", lambda s: s.hydraulics.head_loss),
    SheetColumn("K", "", "", lambda s: s.hydraulics.loss_coefficient),
    SheetColumn("Kv", "", "m3/h", lambda s: s.hydraulics.kv),
    SheetColumn("Cv", "", "gpm", lambda s: s.hydraulics.cv),
    SheetColumn("opening", "size", "mm", lambda s: s.lip_opening),
)
#: Column behind the bore, of a valve behind a line.
FAR = SheetColumn("head at the far end", "head", "m", lambda s: s.head)


def require_sheet(path: Path) -> None:
    """Refuse a sheet that cannot be written before anything is computed. Raises CaseError."""
    if path.suffix.lower() == ".xlsx" and find_spec("openpyxl") is None:
        raise CaseError(
            f"{str(path)!r} needs the package openpyxl (pip install 'dbvfiv[report]'); a name in .csv does not."
        )
    if path.is_dir() or not path.absolute().parent.is_dir():
        raise CaseError(f"{str(path)!r} cannot be written: it is a folder, or its folder does not exist.")
    if not os.access(path if path.exists() else path.absolute().parent, os.W_OK):
        raise CaseError(f"{str(path)!r} cannot be written: its folder, or a file of that name, may only be read.")


def sheet_rows(states: Sequence[Any], units: Units) -> list[list[str | float | None]]:
    """Head line and one row for each state that flows; a number that is not finite is left blank."""
    far = [FAR] if any(state.results.case.has_line for state in states) else []
    columns = [*COLUMNS[:1], *far, *COLUMNS[1:]]
    names = [_unit(column, units) for column in columns]
    factors = [factor_of(column.kind, name) if column.kind else 1.0 for column, name in zip(columns, names)]
    rows: list[list[str | float | None]] = [
        [f"{column.title} [{name}]" if name else column.title for column, name in zip(columns, names)]
    ]
    for state in states:
        if state.hydraulics is not None:
            values = (column.value(state) / factor for column, factor in zip(columns, factors))
            rows.append([float(f"{value:.6g}") if math.isfinite(value) else None for value in values])
    return rows


def _unit(column: SheetColumn, units: Units) -> str:
    """Unit of a column; pressures have one of their own beside heads."""
    if not column.kind or (column.kind == "pressure" and units.heads):
        return column.unit
    return units.name(column.kind)


def write_sheet(path: Path, states: Sequence[Any]) -> Path:
    """Write the sheet in the units of its case; one of that name is replaced."""
    rows = sheet_rows(states, states[0].results.case.units if states else Units("", 1.0))
    if path.suffix.lower() == ".csv":
        with path.open("w", newline="", encoding="utf-8") as file:
            csv.writer(file).writerows(rows)
        return path
    from openpyxl import Workbook  # optional

    book = Workbook()
    book.active.title = "steady"
    for row in rows:
        book.active.append(row)
    book.save(path)
    return path
