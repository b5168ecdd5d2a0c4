"""``dbvfiv export``: a result for ParaView, surfaces and bodies of a state for CAD."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from ._later import action
from ._options import AsJson, ResultFile

ORDER = 55


class Format(StrEnum):
    """Kinds of files."""

    vtkhdf = "vtkhdf"
    stl = "stl"
    step = "step"


class Shape(StrEnum):
    """Surfaces and bodies of a state."""

    inner = "inner"
    middle = "middle"
    outer = "outer"
    wall = "wall"
    fluid = "fluid"


def command(
    file: ResultFile,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            metavar="FILE|DIR",
            help="File ending in .vtkhdf, or a folder; beside the result without it. A folder for STL and STEP.",
        ),
    ] = None,
    quarter: Annotated[
        bool, typer.Option("--quarter", help="Only the part that was computed, not the whole valve.")
    ] = False,
    deformed: Annotated[
        bool, typer.Option("--deformed", help="Move the points; without it use 'Warp By Vector' along displacement.")
    ] = False,
    mode: Annotated[
        int | None,
        typer.Option("--mode", metavar="N", help="Of modes: one cycle of mode N, its phases as time steps in s."),
    ] = None,
    format: Annotated[
        Format, typer.Option("--format", help="Fields for ParaView; or one state as triangles (m), or for CAD (mm).")
    ] = Format.vtkhdf,
    shape: Annotated[
        list[Shape] | None,
        typer.Option("--shape", help="Of STL and STEP: this surface or closed body; may be repeated; all without it."),
    ] = None,
    pressure: Annotated[
        str | None,
        typer.Option(
            "--state", "-p", metavar="P", help="Of STL and STEP: the state nearest to this pressure; else the highest."
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Write a result as VTKHDF for ParaView: displacement, rotation, director; thickness, pressure, von Mises stress
    and stretch of each layer. Or one steady state as STL or STEP: inner face, mid-surface and outer face of the wall,
    the wall and the fluid inside as closed bodies.

    The states are the time steps of the file; the "time" that ParaView shows is the inlet pressure in Pa. Of modes it
    is the number of the mode: mode_real, mode_imag and mode_amplitude come with the displacement of the steady state;
    --mode N writes one cycle of that mode instead.
    """
    if format is Format.vtkhdf:
        action("export").export(file, output, quarter, deformed, mode, as_json)
    else:
        action("export").export_shapes(file, output, format.value, shape or (), pressure, quarter, as_json)
