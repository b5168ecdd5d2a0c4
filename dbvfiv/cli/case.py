"""``dbvfiv case`` and ``doctor``: a case file checked, explained or written anew; the machine."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from ..errors import CaseError
from .terminal import AsJson, Override, in_units, print_either, print_json


def case(
    target: Annotated[
        str | None, typer.Argument(metavar="[FILE|KEY]", help="Case file; with --explain a key or a section.")
    ] = None,
    every: Annotated[bool, typer.Option("--all", help="Print every key of the case.")] = False,
    uncertain: Annotated[
        bool, typer.Option("--uncertain", help="Print what `dbvfiv uncertainty` takes for uncertain, and why.")
    ] = False,
    explain: Annotated[bool, typer.Option("--explain", help="Explain KEY, or every key.")] = False,
    new: Annotated[bool, typer.Option("--new", help="Write a commented starter to FILE.")] = False,
    key_points: Annotated[
        Path | None,
        typer.Option("--key-points", metavar="FILE", help="Write the shape of the case as a table of key points."),
    ] = None,
    points: Annotated[
        int, typer.Option("--points", min=6, max=2001, help="Key points between two joints of a profile.")
    ] = 17,
    profiles: Annotated[
        int, typer.Option("--profiles", min=0, max=200, help="Further profiles of key points inside the saddle.")
    ] = 0,
    overrides: Override = None,
    as_json: AsJson = False,
) -> None:
    """Check a case file, print or explain its keys, or write a new one.

    dbvfiv case my.toml                  check it: its sizes, and what contradicts what

    dbvfiv case my.toml --all            print every key

    dbvfiv case --new my.toml            write a commented starter

    dbvfiv case --explain drive.pressure explain one key, a section, or all

    dbvfiv case my.toml --key-points my.csv  write its shape as key points, to edit
    """
    from ..case.write import case_toml
    from ..studies.case import contradictions, load_case

    if explain + new + uncertain + (key_points is not None) > 1:
        raise CaseError("Only one of --explain, --new, --uncertain and --key-points can be given at a time.")
    if explain:
        _explain_keys(target, as_json)
    elif new:
        _write_new(target, overrides, as_json)
    elif key_points is not None:
        _write_key_points(load_case(target, overrides or ()).valve, key_points, points, profiles, as_json)
    elif uncertain:
        from ..studies.inputs import inputs_of

        inputs = inputs_of(load_case(target, overrides or ()))
        print_either({"inputs": [one.summary() for one in inputs]}, (one.words() for one in inputs), as_json)
    elif as_json or every:
        found = load_case(target, overrides or ())
        for sentence in contradictions(found):  # beside the keys, which are what was asked for
            print(f"Warning: {sentence}", file=sys.stderr)
        if as_json:
            print_json(found.to_dict())
        else:
            print(case_toml(found, comments=False), end="")
    else:
        _check(load_case(target, overrides or ()), target or "The 12-inch valve")


def _check(case, name: str) -> None:
    """Print the sizes of a case, and whether its keys fit. Raises CaseError with all that contradicts what."""
    from ..studies.case import contradictions, oddities, unanswered_rating

    found = [*contradictions(case), *unanswered_rating(case)]
    if found:
        raise CaseError(" ".join(found))
    from ..model.equilibria import model_warnings  # compilers, which a mistake need not wait for
    from ..model.sizes import ValveSizes
    from ..studies.session import Session

    with in_units(case.units):
        model = Session(case).described
    print(f"{name} fits.")
    lines = [*ValveSizes.of(model).lines(), *_conditions(case)]
    print("\n".join(f"  {case.units.say(line)}" for line in lines))
    for sentence in (*oddities(case), *map(case.units.say, model_warnings(model))):  # those speak of keys as given
        print(f"Note: {sentence}")
    print("`dbvfiv case FILE --all` prints every key.")


def _conditions(case) -> list[str]:
    """Load, fluid and damping in words."""
    from ..case.quantity import head_of

    fluid, drive, outside = case.fluid, case.drive, case.outside
    lines = []
    if drive.kind == "flow":
        head = head_of(drive.pressure, fluid.density)
        lines.append(
            f"driven by {drive.pressure / 1e3:.4g} kPa, a head of {head:.3g} m"
            if not case.seeks_operating_point
            else "driven by a pump"
        )
        lines.append(
            f"fluid of {fluid.density:g} kg/m3, continuity {fluid.continuity}, outside the wall: {outside.fluid}"
        )
    else:
        lines.append(f"a uniform pressure of {drive.pressure / 1e3:.4g} kPa, no fluid")
    level = case.materials.strain_level
    level = level if isinstance(level, str) else f"{100 * level:g} %"
    lines.append(f"damping by {case.damping.model}, constants {case.materials.constants}, strain level {level}")
    rated = case.closure.rated_pressure
    if rated is not None:
        lines.append(f"rated back pressure {rated / 1e3:.4g} kPa")
    return lines


def _explain_keys(key: str | None, as_json: bool) -> None:
    """Explain a key, a section or everything."""
    from ..case.describe import explain, explanation_text
    from ..case.section import Section
    from ..studies.case import Case

    def plain(default):
        if isinstance(default, tuple):
            return [plain(each) for each in default]
        return default.model_dump(mode="json") if isinstance(default, Section) else default

    found = explain(Case, key)
    names = ("key", "type", "unit", "default", "required", "allowed", "description")
    rows = [{name: getattr(info, name) for name in names} | {"default": plain(info.default)} for info in found]
    print_either({"keys": rows}, [explanation_text(found)], as_json)


def _write_new(target: str | None, overrides: list[str] | None, as_json: bool) -> None:
    """Write a commented starter."""
    from ..case.write import case_toml
    from ..studies.case import load_case

    if target is None:
        raise CaseError("--new needs the name of the file to write, such as my.toml.")
    _write(target, case_toml(load_case(None, overrides or ()), comments=True))
    print_either({"written": target}, [f"Wrote {target}; check it with `dbvfiv case {target}`."], as_json)


def _write_key_points(valve, file: Path, points: int, profiles: int, as_json: bool) -> None:
    """Write the shape of a case as key points."""
    from ..case.describe import quantity_of, show_value
    from ..case.valve import SHAPE
    from ..geometry.surface import key_point_table

    _write(str(file), key_point_table(valve, points, profiles))
    keys = {"key_points": file.name} | ({"key_point_skin": "smooth"} if valve.saddle == "smooth" else {})
    keys |= valve.numbers_beside_key_points(file)
    fields = type(valve).model_fields
    words = ", ".join(f"{name} = {show_value(value, quantity_of(fields[name]))}" for name, value in keys.items())
    told = f"Wrote {file}; edit it and give {words} in [valve] in place of {', '.join(SHAPE)}."
    print_either({"written": str(file)}, [told], as_json)


def _write(target: str, text: str) -> None:
    """Write a new file."""
    try:
        with Path(target).open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError:
        raise CaseError(f"{target!r} exists already and is not overwritten; choose another name.") from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "its name is not valid"
        raise CaseError(f"{target!r} cannot be written ({reason}).") from None


def doctor(as_json: AsJson = False) -> None:
    """Say what was found on this machine, what is missing, and the command that mends it."""
    from ..doctor import examine

    report = examine()
    print_either(report.to_dict(), report.lines(), as_json)
    if not report.healthy:
        raise typer.Exit(1)
