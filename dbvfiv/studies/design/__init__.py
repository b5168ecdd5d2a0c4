"""``dbvfiv design``: a better valve within bounds."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from pydantic import AfterValidator, BeforeValidator, StrictInt, StrictStr, field_validator

from ...case.quantity import Number
from ...case.section import Described, Section, flattened, key
from ...case.statement import AIM, CONSTRAINT, parse_statement
from ..request import DensityOption, Request

ORDER = 32
#: A density for checks of the form; heads are pressures of the case's own fluid.
_ANY = 1000.0


def _readable(aim: bool) -> AfterValidator:
    def read(text: str) -> str:
        if text or not aim:
            parse_statement(text, aim, _ANY)
        return text

    return AfterValidator(read)


class Keys(Section):
    """A better valve within bounds."""

    variables: Annotated[
        dict[StrictStr, StrictStr],
        BeforeValidator(flattened),
        Described("tables", 'names and bounds, such as { thickness = "0.7:1.4" }'),
    ] = key(
        {},
        "Bounds of each number that may change: a parameter (thickness, angle, ...) or a key of the case "
        '("valve.saddle_length", "layers.2.angle", "materials.SBR.stiffness_factor"), as LOW:HIGH.',
    )
    aim: Annotated[StrictStr, _readable(aim=True), Described("text", AIM)] = key(
        "",
        "What is made better, 'up' or 'down', at heads but for the mass. The margin is the least damping ratio, that "
        "of 95 % of valves with uncertainty.inputs; the gap left is the narrowest section under a back pressure over "
        "the gap of the lips at rest, of lips that stand apart that of lips in touch.",
    )
    constraints: tuple[Annotated[StrictStr, _readable(aim=False), Described("list", CONSTRAINT)], ...] = key(
        (), "What must hold; one may have bounds FIRST:LAST:COUNT, for a front of designs."
    )
    starts: StrictInt = key(1, "Designs to start from: the case itself, then others between the bounds.", ge=1, le=100)
    evaluations: StrictInt = key(
        40,
        "Valves that a start may try, and as many again, three times at most, as heads or reserves are added.",
        ge=2,
        le=10_000,
    )
    finer: Number = key(1.5, "Elements each way, over those of the case, on which a design is verified.", ge=1, le=4)

    @field_validator("constraints")
    @classmethod
    def _one_front(cls, texts: tuple[str, ...]) -> tuple[str, ...]:
        if sum(len(parse_statement(text, False, _ANY).bounds) > 1 for text in texts) > 1:
            raise ValueError("in which more than one constraint has several bounds")
        return texts


def command(
    aim: Annotated[
        str | None, typer.Option("--aim", metavar="TEXT", help="What is made better: design.aim without it.")
    ] = None,
    constraint: Annotated[
        list[str] | None,
        typer.Option("--constraint", metavar="TEXT", help="What must hold; may be repeated; design.constraints."),
    ] = None,
    vary: Annotated[
        list[str] | None,
        typer.Option("--vary", metavar="NAME=LOW:HIGH", help="A number that may change; may be repeated."),
    ] = None,
    density: DensityOption = None,
    starts: Annotated[int | None, typer.Option("--starts", metavar="N", help="Designs to start from.")] = None,
    cases: Annotated[
        Path | None, typer.Option("--cases", metavar="FOLDER", help="Write the case file of each design there.")
    ] = None,
) -> Request:
    """A better valve: numbers of the case between bounds, so that an aim is reached and constraints hold.

    Gradients are exact, modes in reach count together, and every design found is verified by counted verdicts on a
    finer mesh. Valves without a steady state are steps back. The margin is the least damping ratio of the modes.

    With -o every state is kept at once: `dbvfiv resume` goes on after Ctrl-C or a crash.

    dbvfiv design cases/dbv12-in-line.toml --vary thickness=0.7:1.4 --vary "angle=30 deg:70 deg" --aim "loss coefficient
    at 2 m down" --constraint "margin from 0.2 m to 4 m at least 5 %" -o design.h5 --cases designs
    """
    pairs = [text.partition("=") for text in vary or ()]
    changes = {
        "design.constraints": list(constraint) if constraint else None,
        "design.variables": {name.strip(): bounds.strip() for name, _, bounds in pairs} if pairs else None,
    }
    return Request(changes, {"cases": cases})
