"""``dbvfiv case``: check a case file, explain its keys, write a new one."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ._options import AsJson, Override
from ._output import print_json

ORDER = 10


def command(
    target: Annotated[
        str | None, typer.Argument(metavar="[FILE|KEY]", help="Case file; with --explain a key or a section.")
    ] = None,
    explain: Annotated[bool, typer.Option("--explain", help="Explain KEY, or every key.")] = False,
    new: Annotated[bool, typer.Option("--new", help="Write a commented starter to FILE.")] = False,
    overrides: Override = None,
    as_json: AsJson = False,
) -> None:
    """Check a case file and print it, explain its keys, or write a new one.

    dbvfiv case my.toml                  check it and print every key

    dbvfiv case --new my.toml            write a commented starter

    dbvfiv case --explain drive.pressure explain one key, a section, or all
    """
    if explain and new:
        from ..errors import CaseError

        raise CaseError("Only one of --explain and --new can be given at a time.")
    if explain:
        _explain(target, as_json)
    elif new:
        _write_new(target, overrides, as_json)
    else:
        _check(target, overrides, as_json)


def _check(target: str | None, overrides: list[str] | None, as_json: bool) -> None:
    from ..case.write import case_toml
    from ..studies.case import load_case

    case = load_case(target, overrides or ())
    if as_json:
        print_json(case.to_dict())
    else:
        print(case_toml(case, comments=False), end="")


def _write_new(target: str | None, overrides: list[str] | None, as_json: bool) -> None:
    from ..case.write import case_toml
    from ..errors import CaseError
    from ..studies.case import load_case

    if target is None:
        raise CaseError("--new needs the name of the file to write, such as my.toml.")
    path = Path(target)
    text = case_toml(load_case(None, overrides or ()), comments=True)
    try:
        with path.open("x") as file:
            file.write(text)
    except FileExistsError:
        raise CaseError(f"{target!r} exists already and is not overwritten; choose another name.") from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "its name is not valid"
        raise CaseError(f"{target!r} cannot be written ({reason}).") from None
    if as_json:
        print_json({"written": target})
    else:
        print(f"Wrote {target}; check it with `dbvfiv case {target}`.")


def _explain(key: str | None, as_json: bool) -> None:
    from ..case.reference import explain, explanation_text
    from ..studies.case import Case

    found = explain(Case, key)
    if as_json:
        print_json({"keys": [_as_json(info) for info in found]})
    else:
        print(explanation_text(found))


def _as_json(info) -> dict:
    from ..case.section import Section

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
