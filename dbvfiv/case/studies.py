"""One section for each study: what to compute, and how finely."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import (
    AfterValidator,
    Field,
    StrictBool,
    StrictInt,
    StrictStr,
    ValidationInfo,
    field_validator,
    model_validator,
)

from .axis import Axis, parse_axis
from .drive_table import read_drive_table
from .existing_file import existing_file
from .parameters import PARAMETERS, listed
from .quantity import Frequency, Length, Number, Pressure, Rate, Time
from .section import BrokenRule, Section, key
from .stability_axis import parse_stability_axis


def _readable(text: str) -> str:
    parse_axis(text)
    return text


Range = Annotated[StrictStr, AfterValidator(_readable)]


def _readable_stability(text: str) -> str:
    parse_stability_axis(text)
    return text


StabilityRange = Annotated[StrictStr, AfterValidator(_readable_stability)]
LoadPressure = Annotated[Pressure, Field(**PARAMETERS["pressure"].limits)]


class Steady(Section):
    """Equilibria over a list of pressures."""

    pressures: tuple[LoadPressure, ...] = key(
        (2e3, 6e3, 12e3, 18e3, 24e3, 29e3, 36e3, 50e3),
        "Static inlet pressures of the head-discharge curve.",
        min_length=1,
    )
    tolerance: Number = key(1e-8, "Residual, relative to the load, at which Newton stops.", gt=0, le=1e-2)
    max_iterations: StrictInt = key(30, "Newton iterations of one load step.", ge=1, le=10000)
    min_step: Number = key(1e-4, "Smallest load step, relative to the target, before giving up.", gt=0, le=1)


class Modes(Section):
    """Leading eigenvalues of the coupled state."""

    count: StrictInt = key(10, "How many modes; a conjugate pair is one.", ge=1, le=1000)
    max_frequency: Frequency | None = key(
        None, "Only modes up to this frequency; chosen where damping does not order the modes.", gt=0, le=1e6
    )
    shift: Rate | None = key(None, "Real part of a shift to search near, instead of automatic ones.", ge=-1e6, le=1e6)
    shift_frequency: Frequency = key(0.0, "Frequency of that shift.", ge=0, le=1e6)
    tolerance: Number = key(1e-8, "Largest accepted relative residual of the full pencil.", gt=0, le=1e-2)
    in_vacuo: StrictBool = key(False, "Leave the fluid out: the stressed structure alone.")


class Sweep(Section):
    """Modes tracked along one parameter."""

    over: Range = key("density=1:1000:40:log", "Parameter and its values: PARAMETER=START:STOP:COUNT[:log].")
    count: StrictInt = key(6, "How many leading modes to follow.", ge=1, le=100)
    checks: StrictInt = key(
        3, "Values at which the reduced basis, or the count of unstable modes, is checked.", ge=1, le=50
    )
    tolerance: Number = key(1e-6, "Accepted relative error of the eigenvalues on the reduced basis.", gt=0, le=1e-2)
    least_confidence: Number = key(
        0.6, "A step is halved while the match of a leading mode is less certain than this.", gt=0, lt=1
    )

    @property
    def axis(self) -> Axis:
        """The parsed range."""
        return parse_axis(self.over)


class Sensitivity(Section):
    """How the leading mode answers to parameters."""

    of: tuple[StrictStr, ...] = key(
        (),
        f"Parameters to differentiate by: {listed()}, or of a layer, counted from 1 inside to outside, such as "
        "'layer 3 angle', 'layer 1 thickness' or 'layer 2 c10'; all that the valve has where none is named.",
    )
    mode: StrictInt = key(1, "Number of the mode, by falling growth rate.", ge=1, le=1000)
    step: Number = key(1e-4, "Relative step of the differences.", gt=1e-8, le=1e-2)


class Onset(Section):
    """Where a state loses stability."""

    over: StabilityRange = key(
        "density",
        f"The parameter to move: {listed(notes=True)}; with =START:STOP:COUNT[:log] behind it for another range than "
        "the usual one.",
    )
    tolerance: Number = key(1e-9, "Relative accuracy of a located onset on its mesh.", gt=0, le=1e-3)
    normal_form: StrictBool = key(
        True, "Also the first Lyapunov coefficient, which tells whether cycles are attracting or repelling."
    )
    coarse_mesh: Number = key(
        0.5,
        (
            "Elements of the second mesh over those of the first, for the uncertainty by Richardson's rule; 0 "
            "leaves it out."
        ),
        ge=0,
        lt=1,
    )

    @property
    def axis(self) -> Axis:
        """The parsed range."""
        return parse_stability_axis(self.over)


class StabilityMap(Section):
    """Stability over two parameters."""

    x: StabilityRange = key(
        "pressure=500:50000:64", "Horizontal range: PARAMETER=START:STOP:COUNT[:log]; parameters as in onset.over."
    )
    y: StabilityRange = key("density=1:1000:64:log", "Vertical range, likewise.")
    continuity: Literal["case", "both"] = key("case", "The continuity law of the case, or both laws side by side.")
    curve: StrictBool = key(True, "Put in columns until the onset curves are known everywhere.")
    refine: StrictInt = key(
        2, "How often columns are put in between neighbours with different numbers of onsets.", ge=0, le=6
    )
    checks: StrictInt = key(4, "Cells compared with the full pencil, spread over the map.", ge=0, le=1000)
    workers: StrictInt = key(1, "Processes that share the columns.", ge=1, le=1024)

    @property
    def axes(self) -> tuple[Axis, Axis]:
        """The parsed ranges."""
        return parse_stability_axis(self.x), parse_stability_axis(self.y)


Verdict = Literal["steady", "decaying", "limit cycle", "growing", "closed", "irregular"]


class Transient(Section):
    """A time history."""

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
        1e-4, "Displacement in y of one lip by the push; the clear opening changes by twice that.", gt=0, le=1
    )
    start_file: Path | None = key(None, "Result file of the state to start from, relative to the case file.")
    start_state: StrictInt = key(-1, "Which state of start_file, from 0; negative ones count from the end.")
    ramp: Time = key(0.0, "Time in which the pressure rises from zero; zero applies it at once.", ge=0, le=1e5)
    drive_table: Path | None = key(
        None,
        "CSV of time and pressure used instead of drive.pressure, linear between rows and constant beyond "
        "them; a header may name "
        "units (time [ms], pressure [kPa]); relative to the case file.",
    )
    save_every: Time = key(
        0.0, "Distance in time of full states in the result file; zero keeps none but the last.", ge=0, le=1e5
    )
    restart_every: StrictInt = key(500, "Steps between restart points.", ge=1, le=10_000_000)
    stop_when: tuple[Verdict, ...] = key(
        (),
        "Verdicts that end the run once they are certain: steady, decaying, limit cycle, growing, closed, irregular.",
    )

    @field_validator("drive_table", mode="after")
    @classmethod
    def _find_table(cls, path: Path | None, info: ValidationInfo) -> Path | None:
        context = info.context or {}
        if path is None or not context.get("check_files", True):
            return path
        path = Path(context.get("folder", ".")) / path
        read_drive_table(path)
        return path.resolve()

    @field_validator("start_file", mode="after")
    @classmethod
    def _find_start(cls, path: Path | None, info: ValidationInfo) -> Path | None:
        return path if path is None else existing_file(path, info)

    @model_validator(mode="after")
    def _fits_together(self) -> Transient:
        if self.scheme == "hht" and self.numerical_damping > 1 / 3:
            raise BrokenRule(
                "numerical_damping", f"{self.numerical_damping:g} with scheme = 'hht'", "it must be at most 1/3 there"
            )
        if (self.start == "state") != (self.start_file is not None):
            given = (
                "none with start = 'state'"
                if self.start_file is None
                else f"{str(self.start_file)!r} with start = {self.start!r}"
            )
            raise BrokenRule("start_file", given, "it goes with start = 'state' and only with that")
        if self.ramp and self.drive_table is not None:
            raise BrokenRule(
                "ramp", f"{self.ramp:g} s beside a drive_table", "only one of the two can say how the pressure changes"
            )
        if self.coupling == "staggered" and self.adaptive:
            raise BrokenRule("adaptive", "true with coupling = 'staggered'", "staggered steps are of fixed length")
        return self


class Closure(Section):
    """Back pressure on the outside, no flow."""

    pressures: tuple[LoadPressure, ...] = key(
        (7e3, 14e3, 21e3, 28e3), "Static back pressures, outside over inside.", min_length=1
    )
    rated_pressure: Pressure | None = key(
        None,
        "Back pressure that the safety factor refers to; the largest of pressures without it.",
        **PARAMETERS["pressure"].limits,
    )
    supports: Literal["contact", "held-lips"] = key(
        "contact",
        "Inner faces touching the closing plane, or the simplification of Th. 3.6: duckbill held shut, "
        "mid-surface of the "
        "saddle kept from crossing the plane.",
    )
    start: Literal["rest", "open"] = key(
        "rest", "From the valve at rest, or from the steady flow at open_pressure turned back."
    )
    open_pressure: LoadPressure = key(10e3, "Static inlet pressure of the open start.")
    max_step: LoadPressure = key(1e3, "Largest load step; the stiffness is watched for buckling at each.")
    contact_depth: Length = key(
        3e-6,
        (
            "Depth to which the largest back pressure alone would press the faces into each other, before "
            "multipliers push them apart."
        ),
        gt=0,
        le=1e-3,
    )
    penetration: Length = key(1e-6, "Largest penetration that is left.", gt=0, le=1e-3)
    shut_fraction: Number = key(
        0.2, "A section counts as shut when less than this fraction of the lip's opening at rest is left.", ge=0, lt=1
    )
    eigenvalues: StrictInt = key(4, "Lowest eigenvalues of the tangent stiffness to follow.", ge=1, le=100)
    balance_tolerance: Number = key(
        0.0,
        "Largest error of the energy balance over the work; load steps that miss it are halved as often as "
        "it takes, for the balance alone. 0 reports the "
        "balance of the load steps as they are.",
        ge=0,
        le=1,
    )
    arclength: StrictBool = key(
        True, "Go on along the equilibrium path by arclength when load steps end at a limit point."
    )
    reversal_time: Time = key(
        0.2, "Time in which the drive turns from open_pressure to as much back pressure.", gt=0, le=1e3
    )
    reversal_hold: Time = key(0.2, "Time for which the back pressure is then held.", ge=0, le=1e3)
    reversal_continuity: Literal["storage", "quasi-steady"] = key(
        "storage",
        "Continuity law while the drive turns. Lips that meet push the fluid between them away with "
        "storage; quasi-steady they stop it at once, and the "
        "pressure of the incompressible fluid knows no bounds.",
    )
