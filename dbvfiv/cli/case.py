"""``dbvfiv case``: check a case file, explain its keys, write a new one."""

from __future__ import annotations

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
    overrides: Override = None,
    as_json: AsJson = False,
) -> None:
    """Check a case file and print it, explain its keys, or write a new one.

    dbvfiv case my.toml                  check it and print every key

    dbvfiv case --new my.toml            write a commented starter

    dbvfiv case --explain drive.pressure explain one key, a section, or all
    """
    if explain and new:
        raise CaseError("Only one of --explain and --new can be given at a time.")
    act = action("case")
    if explain:
        act.explain_keys(target, as_json)
    elif new:
        act.write_new(target, overrides, as_json)
    else:
        act.check(target, overrides, as_json)
