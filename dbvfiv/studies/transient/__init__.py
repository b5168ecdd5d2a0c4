"""``dbvfiv transient``: a time history and its verdict."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import StrictBool, StrictInt, model_validator

from ...case.quantity import Length, Number, Time
from ...case.section import BrokenRule, Section, key
from ...case.tables import ExistingFile, read_drive_table, readable_file
from ...errors import CaseError
from ..request import AnimationOption, Request, require_start_file

ORDER = 40

Verdict = Literal["steady", "decaying", "limit cycle", "growing", "closed", "chatters", "irregular"]


class Keys(Section):
    """A time history."""

    needs = {"start_state": "start_file"}

    step: Time = key(1e-3, "Time step; with adaptive steps the first and the largest one.", gt=0, le=1e3)
    duration: Time = key(0.5, "Simulated time.", gt=0, le=1e5)
    start: Literal["rest", "steady", "kick", "state"] = key(
        "rest",
        "From the closed valve at rest, from the steady state at the pressure of the first instant, from "
        "that state with a push along an "
        "eigenvector, or from a state of a result file.",
    )
    numerical_damping: Number = key(
        0.0,
        (
            "Numerical damping of high frequencies: what the parameter gamma exceeds 1/2 by in the scheme; at "
            "most 1/3 with hht."
        ),
        ge=0,
        le=0.5,
    )
    scheme: Literal["generalised-alpha", "hht", "newmark"] = key(
        "generalised-alpha", "Member of the family of time integration schemes."
    )
    coupling: Literal["monolithic", "staggered"] = key(
        "monolithic",
        (
            "Wall and fluid solved together, or the thesis's program: pressures of the last state on the wall, "
            "backward differences in the fluid."
        ),
    )
    adaptive: StrictBool = key(False, "Let the local error choose the steps.")
    local_error: Length = key(1e-6, "Local error of the displacements that adaptive steps aim at.", gt=0, le=1)
    smallest_step: Number = key(1 / 4096, "Smallest step before giving up, as a fraction of step.", gt=0, le=1)
    tolerance: Number = key(
        1e-4,
        "Correction left in a step, relative to what the accelerations move the wall in it, at which iterations stop.",
        gt=0,
        le=0.1,
    )
    kick_mode: StrictInt = key(
        1, "Which oscillating mode the push follows, counted by growth rate from 1.", ge=1, le=100
    )
    kick_opening: Length = key(
        1e-4,
        "Displacement in y of one lip by the push; the clear opening changes by twice that. Of a sealed bill, that of "
        "the wall where it moves most.",
        gt=0,
        le=1,
    )
    start_file: ExistingFile | None = key(None, "Result file of the state to start from, relative to the case file.")
    start_state: StrictInt = key(-1, "Which state of start_file, from 0; negative ones count from the end.")
    ramp: Time = key(0.0, "Time in which the pressure rises from zero; zero applies it at once.", ge=0, le=1e5)
    drive_table: Annotated[Path, readable_file(read_drive_table)] | None = key(
        None,
        "CSV of time and pressure used instead of drive.pressure, linear between rows and constant beyond "
        "them; a header may name "
        "units (time [ms], pressure [kPa]); relative to the case file.",
    )
    save_every: Time = key(
        0.0, "Distance in time of full states in the result file; zero keeps the first and the last.", ge=0, le=1e5
    )
    restart_every: StrictInt = key(
        500, "Steps between restart points; of adaptive steps at least 20.", ge=1, le=10_000_000
    )
    stop_when: tuple[Verdict, ...] = key(
        (),
        "Verdicts that end the run once they are certain: steady, decaying, limit cycle, growing, closed, chatters, "
        "irregular.",
    )

    @property
    def drive_rows(self) -> list[tuple[float, float]]:
        """Times, s, and pressures, Pa, of `drive_table`; empty without one. Raises CaseError if it cannot be read any
        more.
        """
        if self.drive_table is None:
            return []
        try:
            return read_drive_table(self.drive_table)
        except ValueError as error:
            said = f'transient.drive_table is given as "{self.drive_table}", {error}.'
            raise CaseError(said, key="transient.drive_table") from None

    @model_validator(mode="after")
    def _fits_together(self) -> Keys:
        if self.scheme == "hht" and self.numerical_damping > 1 / 3:
            raise BrokenRule(
                "numerical_damping", f"{self.numerical_damping:g} with scheme = 'hht'", "it must be at most 1/3 there"
            )
        require_start_file(self.start, "state", self.start_file)
        if self.ramp and self.drive_table is not None:
            raise BrokenRule(
                "ramp", f"{self.ramp:g} s beside a drive_table", "only one of the two can say how the pressure changes"
            )
        if self.coupling == "staggered" and self.adaptive:
            raise BrokenRule("adaptive", "true with coupling = 'staggered'", "staggered steps are of fixed length")
        if self.step > self.duration:
            raise BrokenRule("step", f"{self.step:g} s", f"it must be at most transient.duration = {self.duration:g} s")
        return self


def command(animate: AnimationOption = None) -> Request:
    """Time history of the coupled valve and a verdict: steady, decaying, limit cycle, growing, closed, chatters or
    irregular.

    How the run starts, what drives it, its steps and what ends it are keys of the section transient; `dbvfiv case
    --explain transient` lists them. With -o everything is kept while the run goes on; `dbvfiv resume` continues it
    after Ctrl-C or a crash.

    dbvfiv transient cases/dbv12.toml --set transient.start=kick --set fluid.density=10 -o run.h5
    """

    def further(result: Any) -> list[Path]:
        return [result.animate(animate)] if animate is not None and result.drawable else []

    return Request(further=further)
