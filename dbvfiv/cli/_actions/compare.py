"""Several transient runs in one figure and one table."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ...errors import CaseError
from ...studies.session import load_result
from ...studies.transient.comparison import labels, save_comparison
from .._output import print_json


def compare(files: Sequence[Path], output: Path, as_json: bool) -> None:
    """Draw and print what several transient runs did.

    Raises
    ------
    CaseError
        If a file holds another kind of result.
    """
    results = [load_result(file) for file in files]
    for file, result in zip(files, results):
        if result.kind != "transient":
            raise CaseError(f"{str(file)!r} holds a result of kind {result.kind!r} and not a transient run.")
        result.require_steps()
    path = save_comparison(results, output)
    names = labels(results)
    if as_json:
        print_json(
            {
                "runs": [{"file": str(f), "label": n} | r.summary() for f, n, r in zip(files, names, results)],
                "figure": str(path),
            }
        )
        return
    width = max(len(name) for name in names) + 2
    print(f"{'':<{width}}{'last kg/s':>11}{'lip mm':>9}{'amplitude mm':>14}{'Hz':>8}  verdict")
    for name, result in zip(names, results):
        lip, h = result.verdict["lip_displacement"], result.history
        frequency = "-" if lip["frequency"] is None else f"{lip['frequency']:.3f}"
        print(
            f"{name:<{width}}{h['mass_flow'][-1]:>11.5g}{1e3 * h['lip_displacement'][-1]:>9.4g}"
            f"{1e3 * lip['amplitude']:>14.4g}{frequency:>8}  {result.verdict['verdict']}"
        )
    print(f"Wrote {path}.")
