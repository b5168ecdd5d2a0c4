"""``dbvfiv case``: check a case file, explain its keys, write a new one."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..errors import CaseError
from ._later import action
from ._options import AsJson, Override

ORDER = 10


def command(
    target: Annotated[
        str | None, typer.Argument(metavar="[FILE|KEY]", help="Case file; with --explain a key or a section.")
    ] = None,
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
    """Check a case file and print it, explain its keys, or write a new one.

    dbvfiv case my.toml                  check it and print every key

    dbvfiv case --new my.toml            write a commented starter

    dbvfiv case --explain drive.pressure explain one key, a section, or all

    dbvfiv case my.toml --key-points my.csv  write its shape as key points, to edit
    """
    if explain + new + (key_points is not None) > 1:
        raise CaseError("Only one of --explain, --new and --key-points can be given at a time.")
    act = action("case")
    if explain:
        act.explain_keys(target, as_json)
    elif new:
        act.write_new(target, overrides, as_json)
    elif key_points is not None:
        act.write_key_points(target, key_points, points, profiles, overrides, as_json)
    else:
        act.check(target, overrides, as_json)
