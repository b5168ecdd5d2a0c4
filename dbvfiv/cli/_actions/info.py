"""Print the contents of a result file."""

from __future__ import annotations

from pathlib import Path

from ...case.write import case_toml
from ...studies.session import load_result
from .._output import print_json


def tell(file: Path, as_json: bool, case: bool) -> None:
    """Print a summary of a result file, or the case it was computed from."""
    result = load_result(file)
    header, (around, along) = result.header, result.mesh.shape
    if case and not as_json:
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
    settled = [result.record.settled] if result.record.settled else []
    lines = [f"{name:<10}{value}" for name, value in facts] + ["", *result.lines(), *settled]
    notes = [("Warning", text) for text in result.warnings] + [("Failure", text) for text in result.failures]
    lines += [""] * bool(notes) + [f"{kind}: {text}" for kind, text in notes]
    print("\n".join(lines))
