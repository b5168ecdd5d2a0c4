"""Several runs of one kind in one figure and one table."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

from ...errors import CaseError
from ...studies.closure import comparison as closure
from ...studies.comparing import save_figure
from ...studies.session import load_result
from ...studies.steady import comparison as steady
from ...studies.transient import comparison as transient
from .._output import print_json

#: Kinds of results that can be compared.
_KINDS = ("transient", "steady", "closure")


def compare(files: Sequence[Path], output: Path, as_json: bool) -> None:
    """Draw and print what several runs found.

    Raises
    ------
    CaseError
        If a file holds another kind of result, or they hold several kinds.
    """
    results = [load_result(file) for file in files]
    for file, result in zip(files, results):
        if result.kind not in _KINDS:
            raise CaseError(
                f"{str(file)!r} holds a result of kind {result.kind!r}; {', '.join(_KINDS[:-1])} "
                f"and {_KINDS[-1]} runs can be compared."
            )
        if result.kind != results[0].kind:
            raise CaseError(
                f"{str(file)!r} holds a result of kind {result.kind!r} and {str(files[0])!r} one of kind "
                f"{results[0].kind!r}; runs of one kind can be compared."
            )
    if results[0].kind == "transient":
        _compare_transient(files, results, output, as_json)
    else:
        _compare_states({"steady": steady, "closure": closure}[results[0].kind], files, results, output, as_json)


def _compare_states(
    kind: ModuleType, files: Sequence[Path], results: Sequence[Any], output: Path, as_json: bool
) -> None:
    found = kind.compare(results)
    path = save_figure(lambda: kind.draw(results), output)
    if as_json:
        runs = [{"file": str(f), "label": n} | r.summary() for f, n, r in zip(files, found.labels, results)]
        print_json({"runs": runs, "comparison": found.summary(), "remark": found.remark, "figure": str(path)})
        return
    print("\n".join(found.lines()))
    print(f"Wrote {path}.")


def _compare_transient(files: Sequence[Path], results: Sequence[Any], output: Path, as_json: bool) -> None:
    for result in results:
        result.require_steps()
    path = save_figure(lambda: transient.compare(results), output)
    names = transient.labels(results)
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
