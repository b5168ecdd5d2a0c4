"""``dbvfiv info``: what a result file holds."""

from __future__ import annotations

from typing import Annotated

import typer

from ._options import AsJson, ResultFile
from ._output import print_json

ORDER = 60


def command(
    file: ResultFile,
    as_json: AsJson = False,
    case: Annotated[bool, typer.Option("--case", help="Print the case it was computed from, as a case file.")] = False,
) -> None:
    """Summarise a result file: what was run, with which versions, and its numbers. Also while the run goes on."""
    from ..studies.session import load_result

    result = load_result(file)
    header, (around, along) = result.header, result.mesh.shape
    if case and not as_json:
        from ..case.write import case_toml

        print(case_toml(header.case, comments=False), end="")
        return
    if as_json:
        facts = {
            name: getattr(header, name)
            for name in ("kind", "name", "created", "program", "command", "layout", "versions")
        }
        facts["complete"] = result.complete
        mesh = {"around": around, "along": along, "layers": list(result.mesh.layer_names)}
        print_json(facts | {"mesh": mesh, "case": header.case.to_dict() if case else None} | result.summary())
        return
    drive, fluid = header.case.drive, header.case.fluid
    load = (
        f"{fluid.density:g} kg/m3, {fluid.continuity}"
        if drive.kind == "flow"
        else f"uniform pressure {drive.side}, no flow"
    )
    facts = (
        (
            "result",
            (
                f"{header.kind} of {header.name}, "
                f"{'complete' if result.complete else 'not complete: interrupted or still running'}"
            ),
        ),
        ("written", f"{header.created} by {header.program}"),
        ("command", header.command),
        ("versions", ", ".join(f"{name} {version}" for name, version in header.versions.items() if name != "dbvfiv")),
        ("mesh", f"{around} around x {along} along, {len(result.mesh.nodes)} nodes"),
        ("layers", ", ".join(result.mesh.layer_titles()) + " (inside to outside)"),
        ("load", load),
    )
    lines = [f"{name:<10}{value}" for name, value in facts] + ["", *result.lines()]
    notes = [("Warning", text) for text in result.warnings] + [("Failure", text) for text in result.failures]
    lines += [""] * bool(notes) + [f"{kind}: {text}" for kind, text in notes]
    print("\n".join(lines))
