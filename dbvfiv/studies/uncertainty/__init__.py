"""``dbvfiv uncertainty``: how likely flutter is, and what decides it."""

from __future__ import annotations

from typing import Annotated, Literal

import typer
from pydantic import BeforeValidator, Field, StrictInt, StrictStr, ValidationInfo, field_validator

from ...case.axis import RangeSection, StabilityRange
from ...case.distribution import with_full_names
from ...case.parameters import listed
from ...case.quantity import Number
from ...case.section import Described, flattened, key
from ..request import DensityOption, LawsOption, PressureOption, Request, WorkersOption, over_option
from ..workers import WORKERS_HELP, WorkersKey

ORDER = 31


Correlation = tuple[StrictStr, StrictStr, Annotated[Number, Field(gt=-1, lt=1)]]
Correlations = Annotated[
    tuple[Correlation, ...],
    Described("list of correlations", 'a list of such as ["thickness", "angle", 0.5], numbers between -1 and 1'),
]


class Keys(RangeSection):
    """Probability of flutter and what decides it."""

    over: StabilityRange | None = key(
        None, "Values at which the probability is asked: a range as in onset.over; the state of the case without it."
    )
    samples: StrictInt = key(256, "Samples of the inputs.", ge=16, le=1_000_000)
    seed: StrictInt = key(1, "Number that the samples follow from.", ge=0, le=2**31)
    method: Literal["plain", "rare", "subset"] = key(
        "plain",
        "Samples of the inputs as they are, or, at one state, (rare) about the inputs of a rare flutter, with weights, "
        "or (subset) in levels towards it, which take 10 to 20 times as many and assume nothing of where it lies.",
    )
    continuity: Literal["case", "both"] = key(
        "case", "The flow model of the case, or both models with the same samples."
    )
    inputs: Annotated[
        dict[StrictStr, StrictStr],
        BeforeValidator(flattened),
        Described("tables", 'names and distributions, such as { thickness = "normal(1, 0.03)" }'),
    ] = key(
        {},
        "Distribution of each uncertain number: a parameter (thickness, loss_factor, ...) or a key of the case "
        "(materials.CR.stiffness_factor, valve.initial_gap, ...); without them those shipped for its materials.",
    )
    correlation: Correlations = key(
        (), 'Correlations of normal scores: [["materials.CR.stiffness_factor", "materials.SBR.stiffness_factor", 0.8]].'
    )
    workers: WorkersKey = key(1, WORKERS_HELP)

    @field_validator("inputs")
    @classmethod
    def _with_full_names(cls, given: dict[str, str], info: ValidationInfo) -> dict[str, str]:
        return {name: with_full_names(text, (info.context or {}).get("folder")) for name, text in given.items()}


def command(
    over: Annotated[
        str | None, over_option(f"PARAMETER=START:STOP:COUNT of {listed()}; uncertainty.over without it.")
    ] = None,
    pressure: PressureOption = None,
    density: DensityOption = None,
    law: LawsOption = None,
    samples: Annotated[int | None, typer.Option("--samples", "-n", metavar="N", help="Samples of the inputs.")] = None,
    rare: Annotated[
        bool,
        typer.Option("--rare", help="Weighted samples about a rare flutter, at one state: see uncertainty.method."),
    ] = False,
    workers: WorkersOption = None,
) -> Request:
    """Probability that the valve flutters, with its 95 % interval, where its inputs are known to a spread only, and the
    input that decides it.

    Every sample is a valve of its own with its own steady state, spectrum and count. Samples that are not decided widen
    the interval. Inputs are those of the section uncertainty, else those shipped for rubber, wall and line, with their
    sources; `dbvfiv case FILE --uncertain` prints them.

    With -o every sample is kept at once: `dbvfiv resume` goes on after Ctrl-C or a crash.

    dbvfiv uncertainty cases/dbv12-in-line.toml --over "pressure=0.5 m:4 m:3" --workers 2 -o probability.h5 --plots
    figures
    """
    return Request({"uncertainty.method": "rare" if rare else None})
