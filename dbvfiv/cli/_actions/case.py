"""Check a case file, explain its keys, write a new one."""

from __future__ import annotations

from pathlib import Path

from ...case.reference import explain, explanation_text
from ...case.section import Section
from ...case.write import case_toml
from ...errors import CaseError
from ...geometry import key_point_table
from ...studies.case import Case, load_case
from .._output import print_json


def check(target: str | None, overrides: list[str] | None, as_json: bool) -> None:
    """Check a case and print it."""
    case = load_case(target, overrides or ())
    if as_json:
        print_json(case.to_dict())
    else:
        print(case_toml(case, comments=False), end="")


def write_new(target: str | None, overrides: list[str] | None, as_json: bool) -> None:
    """Write a commented starter; raises `CaseError` where that cannot be."""
    if target is None:
        raise CaseError("--new needs the name of the file to write, such as my.toml.")
    _write(target, case_toml(load_case(None, overrides or ()), comments=True))
    if as_json:
        print_json({"written": target})
    else:
        print(f"Wrote {target}; check it with `dbvfiv case {target}`.")


def write_key_points(
    target: str | None, file: Path, points: int, profiles: int, overrides: list[str] | None, as_json: bool
) -> None:
    """Write the shape of a case as key points; raises `CaseError` where that cannot be."""
    valve = load_case(target, overrides or ()).valve
    _write(str(file), key_point_table(valve, points, profiles))
    instead = ("lip_half_width", "lip_rise", "lip_radius", "cuff_radius", "flange_radius", "saddle")
    smooth = ', key_point_skin = "smooth"' if valve.saddle == "smooth" else ""
    if as_json:
        print_json({"written": str(file)})
    else:
        print(
            f'Wrote {file}; edit it and give key_points = "{file.name}"{smooth} in [valve] in place of '
            f"{', '.join(instead)}."
        )


def _write(target: str, text: str) -> None:
    """Write a new file."""
    try:
        with Path(target).open("x") as file:
            file.write(text)
    except FileExistsError:
        raise CaseError(f"{target!r} exists already and is not overwritten; choose another name.") from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "its name is not valid"
        raise CaseError(f"{target!r} cannot be written ({reason}).") from None


def explain_keys(key: str | None, as_json: bool) -> None:
    """Explain a key, a section or everything."""
    found = explain(Case, key)
    if as_json:
        print_json({"keys": [_as_json(info) for info in found]})
    else:
        print(explanation_text(found))


def _as_json(info) -> dict:
    default = info.default
    if isinstance(default, tuple):
        default = [d.model_dump(mode="json") if isinstance(d, Section) else d for d in default]
    elif isinstance(default, Section):
        default = default.model_dump(mode="json")
    return {
        "key": info.key,
        "type": info.type,
        "unit": info.unit,
        "default": default,
        "required": info.required,
        "allowed": info.allowed,
        "description": info.description,
    }
