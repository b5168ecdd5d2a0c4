"""Viscous flow in three dimensions through a computed shape."""

from __future__ import annotations

import json
from pathlib import Path

from ...case.downstream import Downstream
from ...case.quantity import number_or_text
from ...cfd.comparison import FlowComparison
from ...cfd.fields import read_fields
from ...cfd.figures import draw
from ...cfd.flow_case import WATER_VISCOSITY, FlowCase
from ...cfd.run import run_openfoam
from ...drawing.files import draw_figures, write_figures
from ...errors import CaseError
from .._output import print_json, print_places
from .._progress import Progress
from .states import chosen_state

#: Numbers of a run, beside its case.
NUMBERS = "comparison.json"


def compute(
    file: Path,
    folder: Path,
    pressure: str | None,
    how: tuple[str | None, float, int],
    run: bool,
    plots: Path | None,
    as_json: bool,
) -> None:
    """Write, run and read the flow through a state; `how` is pipe, fineness and iterations.

    Raises
    ------
    CaseError
        If the state cannot be meshed or the folder not be used.
    SolveError
        If OpenFOAM is missing or fails.
    """
    state = chosen_state(file, pressure)
    result, (pipe, fineness, iterations) = state.results, how
    if not state.volume_flow > 0:
        raise CaseError(f"Nothing flows in the state at {state.pressure:g} Pa of {str(file)!r}.")
    width = result.case.downstream.pipe_diameter if pipe is None else _diameter(pipe)
    density = state.mass_flow / state.volume_flow
    viscosity = result.case.fluid.dynamic_viscosity / density or WATER_VISCOSITY
    case = FlowCase(result.header.name, result.mesh, state, density, width, fineness, iterations, viscosity)
    case.write(folder)
    if not run:
        written = {"written": str(folder), "cells": len(case.cells.cells)}
        print_json(written) if as_json else print(f"Wrote {folder}: {written['cells']} cells; run Allrun in it.")
        return
    run_openfoam(folder, iterations, Progress(quiet=as_json))
    found = FlowComparison(case, read_fields(folder, len(case.cells.cells)))
    (folder / NUMBERS).write_text(json.dumps(found.document(), indent=1) + "\n")
    figures = []
    if plots is not None:
        figures = write_figures(draw_figures(dict(draw(found)), (), "flow"), plots)
    if as_json:
        print_json(found.document() | {"figures": [str(figure) for figure in figures]})
        return
    print("\n".join(found.lines()))
    print_places(folder, figures, plots)


def _diameter(text: str) -> float | None:
    """Diameter of a pipe, m; None for a free jet.

    Raises
    ------
    CaseError
    """
    if text.strip().lower() == "free":
        return None
    try:
        return Downstream(pipe_diameter=number_or_text(text)).pipe_diameter
    except ValueError:
        raise CaseError(
            f"--pipe is given as {text!r}; it must be a length greater than 0 and at most 100 m, such as '330 mm', or "
            "free."
        ) from None
