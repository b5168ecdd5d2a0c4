"""The case of a page: the keys that were given, as data and as TOML, checked in the words of ``dbvfiv case``."""

from __future__ import annotations

import os
import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..case.describe import quantity_of, show_value, toml_name
from ..case.distribution import samples_file
from ..case.load import held, make_case, parse_toml, put, toml_value
from ..case.physics import LIQUID
from ..case.quantity import GRAVITY
from ..case.section import Section
from ..errors import CaseError
from ..record.files import renamed
from ..studies.case import Case, contradictions, oddities

#: Sizes that bound what a page may ask for: bytes of a case, elements, processes of a run.
LONGEST, ELEMENTS, WORKERS = 200_000, 4000, 2
#: Endings of files beside a case that are no data of it.
NO_DATA = (".toml", ".h5", ".hdf5")
#: Keys of the form by heading: key and label; the rest is edited as text.
FORM: dict[str, tuple[tuple[str, str], ...]] = {
    "Sizes": (
        ("valve.duckbill_length", "Bill length"),
        ("valve.saddle_length", "Saddle length"),
        ("valve.flange_length", "Flange or cuff length"),
        ("valve.lip_half_width", "Half width of the bill"),
        ("valve.lip_radius", "Radius of the side edge"),
        ("valve.flange_radius", "Radius at the flange"),
        ("valve.wall", "Wall"),
        ("valve.thickness_factor", "Wall thickness factor"),
        ("valve.scale", "Scale"),
    ),
    "Installation": (
        ("drive.pressure", "Head or static pressure"),
        ("fluid.density", "Fluid density"),
        ("fluid.continuity", "Flow model"),
        ("upstream.length", "Length of the pipe in front"),
        ("upstream.diameter", "Its diameter"),
        ("upstream.roughness", "Its roughness"),
        ("downstream.pipe_diameter", "Pipe behind: diameter"),
        ("downstream.length", "Pipe behind: length"),
        ("downstream.pressure", "Pressure downstream"),
        ("outside.fluid", "Fluid outside the wall"),
        ("closure.rated_pressure", "Rated back pressure"),
    ),
    "Damping and mesh": (
        ("damping.model", "Damping model"),
        ("damping.loss_factor", "Factor on the loss factors"),
        ("damping.beta", "Stiffness damping"),
        ("materials.strain_level", "Strain level of the rubbers"),
        ("mesh.around", "Elements around"),
        ("mesh.along", "Elements along"),
    ),
}


@dataclass(frozen=True)
class Checked:
    """Outcome of a check."""

    case: Case | None  #: None where the keys give no case.
    #: problems and notes: sentences on what is wrong, and on what is allowed and seldom meant.
    problems: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    key: str = ""  #: Key to blame for the first problem.


def read_sheet(text: str) -> dict[str, Any]:
    """Data of a TOML text. Raises CaseError for a text that is too long, nested too deep, or no TOML."""
    if len(text) > LONGEST:
        raise CaseError(f"The case file has {len(text)} characters; it may have {LONGEST}.")
    try:
        return parse_toml(text, "the case")
    except RecursionError:
        raise CaseError("The case file is nested too deep to be read.") from None


def write_sheet(data: Mapping[str, Any]) -> str:
    """TOML text of the given keys, a table for each section; `read_sheet` gives the same data."""
    lines = _lines({name: value for name, value in data.items() if not isinstance(value, Mapping)})
    for name, value in data.items():
        if isinstance(value, Mapping):
            lines += ["", f"[{toml_name(name)}]", *_lines(value)]
    return "\n".join(lines).lstrip("\n") + "\n"


def _lines(table: Mapping[str, Any]) -> list[str]:
    return [f"{toml_name(name)} = {show_value(value, None)}" for name, value in table.items()]


def given(data: Mapping[str, Any], key: str) -> str:
    """Value of a key as it was given; empty where it was not."""
    value = held(data, key)
    return "" if value is None else value if isinstance(value, str) else show_value(value, None)


def usual_value(section: Section, name: str) -> Any:
    """Value of a key of a section as a case file has it, with its unit."""
    value, quantity = getattr(section, name), quantity_of(type(section).model_fields[name])
    return quantity.show(value) if quantity is not None and isinstance(value, (int, float)) else value


def shown_as(case: Case, name: str, beside: Collection[str] = ()) -> dict[str, Any]:
    """Title, unit and its SI value of a parameter as a page shows it: pressures of liquids as heads, beside other
    densities as those of the fluid of the case.
    """
    row, units = case.units.parameter(name), case.units
    if name != "pressure" or case.fluid.density < LIQUID or (units.text and not units.heads):
        return {"title": row.title, "unit": row.shown_unit, "scale": row.scale}
    scale = units.factor("pressure") if units.heads else GRAVITY * case.fluid.density
    title = f"Head of fluid of {case.fluid.density:g} kg/m³" if "density" in beside else "Head of the fluid"
    return {"title": title, "unit": units.name("pressure") if units.heads else "m", "scale": scale}


def change(data: dict[str, Any], key: str, text: str) -> None:
    """Set a key to what was typed; an empty text takes it away. Raises CaseError."""
    if text.strip():
        Case.make_way(data, {put(Case, data, key, toml_value(text.strip()))})
        return
    place, _, last = key.rpartition(".")
    table = held(data, place)
    if isinstance(table, dict):
        table.pop(last, None)
        Case.take_along(data, {(*place.split("."), last)})


def bring(path: Path, home: Path, anew: bool = True) -> str:
    """Text of a case file, of which the files that it names are put into a folder, under names without theirs. Raises
    CaseError, OSError, UnicodeDecodeError.

    Parameters
    ----------
    path, home : Path
        Case file, and folder.
    anew : bool
        Take the place of files that are there already.
    """
    text, names = path.read_bytes().decode("utf-8-sig"), {}
    data = read_sheet(text)
    for _, value in _leaves(data, ""):
        name = str(samples_file(value) or value) if isinstance(value, str) else ""
        source = path.parent / name
        if name in names or not os.path.isfile(source) or source.suffix.lower() in NO_DATA:
            continue
        kept = source.name if source.name not in names.values() else f"{len(names)}-{source.name}"
        if anew or not (home / kept).exists():
            (home / kept).write_bytes(source.read_bytes())
        names[name] = kept
    return text if all(name == kept for name, kept in names.items()) else write_sheet(renamed(data, names))


def data_files(home: Path) -> list[Path]:
    """Files in a folder that cases may name as data."""
    return sorted(path for path in home.iterdir() if path.is_file() and path.suffix.lower() not in NO_DATA)


def check(data: Mapping[str, Any], folder: Path, text: str = "") -> Checked:
    """Check data for a page: what ``dbvfiv case`` refuses, files outside a folder, and what is too large to run."""
    try:
        stay_inside(data)
        case = make_case(Case, data, folder=folder, source="The case" if text else "", text=text)
        elements = case.mesh.around * case.mesh.along
        if elements > ELEMENTS:
            raise CaseError(
                f"mesh.around and mesh.along make {elements} elements; a page takes {ELEMENTS}.", key="mesh.around"
            )
        problems = tuple(contradictions(case))
        return Checked(None if problems else case, problems, tuple(oddities(case)))
    except CaseError as error:
        return Checked(None, (str(error),), key=error.key or "")
    except Exception as error:  # a case of any content must not end the server
        return Checked(None, (f"The case cannot be read ({type(error).__name__}).",))


def stay_inside(data: Mapping[str, Any], runs: bool = True) -> None:
    """Refuse names of files outside the folder, and processes elsewhere of a case that runs. Raises CaseError."""
    for key, value in _leaves(data, ""):
        if key.endswith("workers") and not runs:
            continue
        if key.endswith("workers") and not (isinstance(value, int) and value <= WORKERS):
            raise CaseError(f"{key} is given as {value!r}; here it must be a number up to {WORKERS}.", key=key)
        for word in re.split(r"[\s,;:|()\[\]'\"=]+", value) if isinstance(value, str) else ():
            parts = re.split(r"[/\\]", word)
            if len(word) > 1 and (parts[0] in ("", "~") and len(parts) > 1 or ".." in parts or "\0" in word):
                raise CaseError(f"{key} is given as {value[:80]!r}; files are named without their folder.", key=key)


def _leaves(value: Any, key: str) -> Iterator[tuple[str, Any]]:
    parts = value.items() if isinstance(value, Mapping) else enumerate(value) if isinstance(value, list) else None
    if parts is None:
        yield key, value
        return
    for name, part in parts:
        yield from _leaves(part, f"{key}.{name}".lstrip("."))
