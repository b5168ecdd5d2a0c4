"""Print the machine's solvers and packages, and those that are missing."""

from __future__ import annotations

import typer

from ...doctor import examine
from .._output import print_json


def tell(as_json: bool) -> None:
    """Print what was found; leaves with status 1 where something that is needed is missing."""
    report = examine()
    if as_json:
        print_json(report.to_dict())
    else:
        print("\n".join(_lines(report)))
    if not report.healthy:
        raise typer.Exit(1)


def _lines(report) -> list[str]:
    petsc = report.petsc
    rows = [
        ("dbvfiv", report.dbvfiv),
        ("Python", f"{report.python} ({report.executable})"),
        ("platform", f"{report.platform}, {report.cores} cores"),
        ("PETSc", f"{petsc['petsc'] or 'missing'}, {petsc['scalar'] or 'unknown'} scalars"),
        ("SLEPc", petsc["slepc"] or "missing"),
        ("direct solvers", ", ".join(petsc["solvers"]) or "none"),
        *((name, version or "missing") for name, version in report.packages.items()),
        ("cache", f"{report.cache['folder']} ({report.cache['bytes'] / 1e6:.1f} MB)"),
    ]
    lines = [f"{name:<16}{value}" for name, value in rows]
    for problem in report.problems:
        lines.append(f"{'missing' if problem.fatal else 'note':<16}{problem.what} Remedy: {problem.remedy}")
    lines.append("Everything that is needed is here." if report.healthy else "Something that is needed is missing.")
    return lines
