"""Constants of a rubber from its tests, in print and as a figure."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from ...case.quantity import Quantity
from ...drawing.files import draw_figures, write_figures
from ...drawing.fit import fit_figure
from ...errors import CaseError
from ...materials.fit_report import describe_fits
from ...materials.loading_cycles import read_tests
from .._output import print_json, print_places

_STRAIN, _DENSITY = Quantity("", "%"), Quantity("kg/m^3", "kg/m^3")


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
    name, density = material
    if not re.fullmatch(r"[A-Za-z0-9_-]+", name):
        raise CaseError(f"--name {name!r} must be of letters, digits, - and _, to stand in a case file.")
    law, terms, constraint, stable_to, error, cycle = how
    far = None if stable_to is None else _positive("--stable-to", stable_to, _STRAIN, "a strain greater than 0: 30 %")
    mass = _positive("--density", density, _DENSITY, "a density greater than 0: 1300 kg/m^3")
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


def _positive(option: str, text: str, quantity: Quantity, wanted: str) -> float:
    """A quantity in SI units."""
    try:
        value = quantity.parse(text)
    except ValueError as error:
        raise CaseError(f"{option} is given as {text!r}, {error}; it must be {wanted}.") from None
    if not 0.0 < value < float("inf"):
        raise CaseError(f"{option} is given as {text!r}; it must be {wanted}.")
    return value
