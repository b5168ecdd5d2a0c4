"""``dbvfiv damping``: how much the wall damps, by the case and over frequency."""

from __future__ import annotations

from typing import Annotated

import typer

from ._options import AsJson, CaseFile, Override, PlotFolder, read_case
from ._output import print_json, print_places

ORDER = 12


def command(
    case_file: CaseFile = None,
    at: Annotated[
        str | None,
        typer.Option(
            "--at", metavar="F1,F2", help="Also alpha and beta that match the loss factors at two frequencies, Hz."
        ),
    ] = None,
    plots: PlotFolder = None,
    overrides: Override = None,
    as_json: AsJson = False,
) -> None:
    """How much the wall damps: materials, fits of their loss factors with errors, damping ratio over frequency.

    dbvfiv damping my.toml --set damping.model="loss factor" --at 5,40 --plots figures
    """
    case = read_case(case_file, overrides)
    from ..materials.damping_report import describe_damping, read_frequencies

    frequencies = None if at is None else read_frequencies(at)
    report = describe_damping(case)
    figures = []
    if plots is not None:
        from ..drawing.damping import damping_figure
        from ..drawing.files import draw_figures, write_figures

        drawn = draw_figures({"damping": lambda: damping_figure(report)}, (), "damping of the case")
        figures = write_figures(drawn, plots)
    if as_json:
        print_json(report.summary(frequencies) | {"figures": [str(figure) for figure in figures]})
        return
    print("\n".join(report.lines(frequencies)))
    print_places(None, figures, plots)
