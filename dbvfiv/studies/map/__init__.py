"""``dbvfiv map``: stability over two parameters."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import typer
from pydantic import StrictBool, StrictInt, StrictStr, field_validator, model_validator

from ...case.axis import Axis, Level, StabilityRange, parse_stability_axis
from ...case.parameters import listed
from ...case.section import BrokenRule, Section, key
from ..request import ClassesOption, Request, WorkersOption, pressure_option
from ..workers import WORKERS_HELP, WorkersKey

ORDER = 30


class Keys(Section):
    """Stability over two parameters."""

    x: StabilityRange = key(
        "pressure=500:50000:64", "Horizontal range: PARAMETER=START:STOP:COUNT[:log]; parameters as in onset.over."
    )
    y: StabilityRange = key("density=1:1000:64:log", "Vertical range, likewise.")
    continuity: Literal["case", "both"] = key("case", "The flow model of the case, or both models side by side.")
    curve: StrictBool = key(
        True,
        "Put in columns until the onset curves are known everywhere; false also leaves out onsets between cells that "
        "have steady states of their own.",
    )
    refine: StrictInt = key(
        2, "How often columns are put in between neighbours with different numbers of onsets.", ge=0, le=6
    )
    checks: StrictInt = key(4, "Cells compared with the full pencil, spread over the map.", ge=0, le=1000)
    contours: tuple[StrictStr, ...] = key(
        (), 'Curves of constant damping of the leading mode: growth rates, "-2" (1/s), or damping ratios, "5 %".'
    )
    samples: StrictInt = key(
        0,
        "Samples of the inputs of uncertainty in each column, for bands of the probability of flutter; 0 for none.",
        ge=0,
        le=1_000_000,
    )
    workers: WorkersKey = key(1, WORKERS_HELP)
    cycles: StrictBool = key(
        False,
        "Follow limit cycles from the onsets of each column of the grid, as the section cycle says: their amplitude in "
        "each cell.",
    )
    amplitude: StrictBool = key(
        False,
        "The same by the amplitude equation of the mode near onset, which costs no branch; branches where its residual "
        "is too large.",
    )
    symmetry: Literal["SS", "all"] = key(
        "SS",
        "Symmetry classes looked at: SS is that of the model, all adds those in which the lips sway in y (SA), the "
        "valve sways sideways in x (AS) and twists (AA), cell by cell.",
    )

    @property
    def axes(self) -> tuple[Axis, Axis]:
        """The parsed ranges."""
        return parse_stability_axis(self.x), parse_stability_axis(self.y)

    @property
    def levels(self) -> tuple[Level, ...]:
        """The parsed contours."""
        return tuple(map(Level.parse, self.contours))

    @field_validator("contours", mode="before")
    @classmethod
    def _read_contours(cls, given: Any) -> Any:
        return [part.strip() for part in given.split(",")] if isinstance(given, str) else given

    @field_validator("contours")
    @classmethod
    def _readable_contours(cls, texts: tuple[str, ...]) -> tuple[str, ...]:
        for text in texts:
            Level.parse(text)
        return texts

    @model_validator(mode="after")
    def _two_parameters(self) -> Keys:
        x, y = self.axes
        if x.parameter == y.parameter:
            raise BrokenRule("y", f"{self.y!r}", f"it must range over another parameter than map.x = {self.x!r}")
        return self


_RANGE = f"PARAMETER=START:STOP:COUNT[:log] of {listed()}"


def command(
    x: Annotated[
        str | None, typer.Option("--x", metavar="RANGE", help=f"Horizontal axis, {_RANGE}; map.x without it.")
    ] = None,
    y: Annotated[
        str | None, typer.Option("--y", metavar="RANGE", help="Vertical axis, likewise; map.y without it.")
    ] = None,
    pressure: Annotated[str | None, pressure_option("Static inlet pressure where no axis moves it.")] = None,
    density: Annotated[
        str | None, typer.Option("--density", metavar="RHO", help="Fluid density where no axis moves it.")
    ] = None,
    both: Annotated[bool, typer.Option("--both", help="Both flow models side by side.")] = False,
    workers: WorkersOption = None,
    symmetry: ClassesOption = None,
    contours: Annotated[
        str | None,
        typer.Option("--contours", metavar="LEVELS", help='Curves of constant damping: "-2,-5" (1/s) or "2 %,5 %".'),
    ] = None,
    samples: Annotated[
        int | None,
        typer.Option("--samples", "-n", metavar="N", help="Samples of uncertain inputs for bands of probability."),
    ] = None,
    cycles: Annotated[
        bool, typer.Option("--cycles", help="Amplitude of the limit cycle in each cell that has one.")
    ] = False,
    amplitude: Annotated[
        bool, typer.Option("--amplitude", help="The same, without branches of cycles near the onsets.")
    ] = False,
) -> Request:
    """Growth rate of the leading mode over two parameters, with the exact onset curves.

    Every cell carries two counts of its unstable modes, by eigenvalues and by the argument principle; where they
    disagree it is uncertain, and hatched. Some cells are solved again with the full matrices (map.checks). Columns are
    put in where onsets appear or vanish (map.refine), and until the onset curves are known between them too; every
    point of a curve is neutral by the full matrices (map.curve).

    With --symmetry all the cells are asked in every symmetry class too, and the most unstable one is named.

    With --contours=-2,-5 curves are drawn on which the leading mode has these growth rates, or damping ratios ("2 %"),
    found and corrected like the onset curves.

    With --samples=64 the inputs of the section uncertainty vary, and curves are drawn on which 5, 50 and 95 % of the
    valves flutter.

    With --cycles branches of limit cycles are followed from the onsets of each column, as the section cycle of the case
    says; that takes seconds a cell. With --amplitude the amplitude equation of the mode (invariant manifold, to seventh
    order) answers near onset, and branches only where its residual is too large.

    With -o every finished column is kept at once: `dbvfiv resume` goes on after Ctrl-C or a crash. Columns are shared
    among processes of this machine (--workers 4), of mpiexec, or of a Dask cluster (--workers tcp://host:8786).

    dbvfiv map cases/dbv12.toml --x "pressure=0.5 kPa:20 kPa:64" --y density=1:1000:64:log --workers 2 -o map.h5 --plots
    figures
    """
    return Request({"map.continuity": "both" if both else None})
