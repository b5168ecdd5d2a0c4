"""``dbvfiv cycle``: what a valve does beyond its onset."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import StrictInt, model_validator

from ...case.axis import RangeSection, StabilityRange
from ...case.parameters import listed
from ...case.quantity import Length, Number
from ...case.section import key
from ...case.tables import ExistingFile
from ..request import DensityOption, PressureOption, over_option, require_start_file

ORDER = 42


class Keys(RangeSection):
    """Branches of limit cycles along one parameter."""

    needs = {"start_cycle": "start_file"}

    over: StabilityRange = key(
        "density=20:60:9",
        "The parameter to move, as in onset.over. Cycles are given at these values, and at those that the branch needs "
        "between them.",
    )
    start: Literal["last", "first", "file"] = key(
        "last",
        "Where the branch starts: at the onset of the largest value of the range, at that of the smallest, or at a "
        "motion of a result file, from which it goes both ways.",
    )
    start_file: ExistingFile | None = key(
        None,
        "Result file of the motion to start from, relative to the case file: of a branch of cycles, or of a run in "
        "time that has settled on a cycle. Its value of the parameter is taken, and all else from this case.",
    )
    start_cycle: StrictInt | None = key(
        None,
        "Which cycle of a branch in start_file, from 0 as they are printed; negative ones count from the end. "
        "Without it the last one; of a branch over another parameter the one nearest to this case's value of that.",
    )
    amplitude: Length = key(
        1e-3, "Displacement of one lip in y, half its swing, of the first cycle, near the onset.", gt=0, le=0.1
    )
    tolerance: Number = key(
        2e-3,
        "Largest share of the motion that its last two harmonics may hold; amplitude and period are then some ten "
        "times as exact.",
        gt=0,
        le=0.1,
    )
    max_harmonics: StrictInt = key(20, "Most harmonics; a branch that needs more ends there.", ge=3, le=100)
    exponents: StrictInt = key(4, "Floquet exponents looked for; 0 leaves stability out.", ge=0, le=20)
    max_step: Number = key(0.5, "Largest step along the branch, a step of one being 10 mm of the lip.", gt=0, le=10)
    max_points: StrictInt = key(100, "Most cycles of the branch.", ge=2, le=100_000)

    @model_validator(mode="after")
    def _starts_somewhere(self) -> Keys:
        require_start_file(self.start, "file", self.start_file)
        return self


def command(
    over: Annotated[
        str | None, over_option(f"PARAMETER=START:STOP:COUNT[:log] of {listed()}; cycle.over without it.")
    ] = None,
    pressure: PressureOption = None,
    density: DensityOption = None,
) -> None:
    """Limit cycles followed from an onset along a parameter: amplitude, frequency, stability.

    The oscillation itself is solved for, as a Fourier series in time with all unknowns of the valve, so nothing has to
    settle. Its Floquet exponents say whether it is stable; where that changes, and where the branch turns back or the
    lips just touch, a special point is located. Unstable cycles are followed as well.

    With -o every cycle is kept at once: `dbvfiv resume` goes on after Ctrl-C or a crash.

    dbvfiv cycle cases/light-fluid.toml --over density=25:60:8 -o cycle.h5 --plots figures
    """
