"""The studies of a report run, and the page is written."""

from __future__ import annotations

import sys
from pathlib import Path

from ...errors import CaseError, SolveError
from ...report import Runs, gather, write_page
from ...report.gather import RUNS
from ...report.page import answers
from .._output import print_json
from .._progress import Progress
from .study import read_case


def report(
    case_file: Path | None,
    output: Path | None,
    folder: Path | None,
    cells: int,
    workers: int,
    without: tuple[str, ...],
    overrides: list[str] | None,
    as_json: bool,
) -> None:
    """Make the page and say its answers.

    Raises
    ------
    CaseError
    SolveError
        If a study gave no result; the page, with what there is, is written.
    """
    for name in without:
        if name not in RUNS:
            raise CaseError(f"--without is given as {name!r}, which is none of {', '.join(RUNS)}.")
    case = read_case(case_file, overrides)
    name = case_file.stem if case_file else "dbv12"
    page = output or Path(f"{name}-report.html")
    runs = Runs(cells=cells, workers=workers, leave_out=without)

    def told(kind: str) -> Progress:
        if not as_json:
            print(f"{kind} ...", file=sys.stderr, flush=True)
        return Progress(quiet=as_json)

    found = gather(case, name, folder or page.with_suffix(""), runs, told)
    write_page(found, page)
    failed = {kind: why for kind, why in found.missing.items() if kind not in found.not_asked}
    said = answers(found)
    if as_json:
        print_json(
            {"page": str(page), "answers": [{"question": q, "sentences": s} for q, s in said], "missing": found.missing}
        )
    else:
        for question, sentences in said:
            print("\n".join([question, *(f"  {line}" for line in sentences if line)]))
        print(f"Page in {page}.")
    if failed:
        raise SolveError("; ".join(f"no result of {kind}: {why}" for kind, why in failed.items()))
