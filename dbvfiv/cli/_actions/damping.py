"""Print and plot the damping of a case."""

from __future__ import annotations

from pathlib import Path

from ...drawing.damping import damping_figure
from ...drawing.files import draw_figures, write_figures
from ...materials.damping_report import describe_damping, read_frequencies
from .._output import print_json, print_places
from .study import read_case


def tell(
    case_file: Path | None, overrides: list[str] | None, at: str | None, plots: Path | None, as_json: bool
) -> None:
    """Print materials, fits and damping ratios, and the constants that match at two frequencies.

    Raises
    ------
    CaseError
    """
    case = read_case(case_file, overrides)
    frequencies = None if at is None else read_frequencies(at)
    report = describe_damping(case)
    figures = []
    if plots is not None:
        drawn = draw_figures({"damping": lambda: damping_figure(report)}, (), "damping of the case")
        figures = write_figures(drawn, plots)
    if as_json:
        print_json(report.summary(frequencies) | {"figures": [str(figure) for figure in figures]})
        return
    print("\n".join(report.lines(frequencies)))
    print_places(None, figures, plots)
