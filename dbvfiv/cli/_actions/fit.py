"""Constants of a rubber from its tests, in print and as a figure."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ...drawing.files import draw_figures, write_figures
from ...drawing.fit import fit_figure
from ...materials.fit_report import describe_fits
from ...materials.loading_cycles import read_tests
from .._output import print_json, print_places
from .material import of_material, strain_of


def tell(
    paths: tuple[Path, Path | None, Path | None],
    how: tuple[Any, ...],
    material: tuple[str, str],
    plots: Path | None,
    as_json: bool,
) -> None:
    """Print and draw what the tests give.

    Parameters
    ----------
    paths : of the tension, planar and biaxial tests
    how : law, terms, constraint, stable_to, error, cycle as given
    material : name and density for the table to paste
    plots : folder for the figure, or None
    as_json : bool

    Raises
    ------
    CaseError
    """
    name, mass = of_material(*material)
    law, terms, constraint, stable_to, error, cycle = how
    far = None if stable_to is None else strain_of("--stable-to", stable_to)
    report = describe_fits(
        read_tests(*paths), law and law.value, terms, constraint.value, far, error.value, cycle.value
    )
    figures = []
    if plots is not None:
        drawn = draw_figures({"fit": lambda: fit_figure(report)}, (), "fit")
        figures = write_figures(drawn, plots)
    if as_json:
        print_json(report.summary(name, mass) | {"figures": [str(figure) for figure in figures]})
        return
    print("\n".join(report.lines(name, mass)))
    print_places(None, figures, plots)
