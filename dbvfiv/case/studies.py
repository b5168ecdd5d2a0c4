"""One section for each study: what to compute, and how finely."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, Field, StrictBool, StrictInt, StrictStr

from .axis import Axis, parse_axis
from .quantity import Frequency, Length, Number, Pressure, Rate, Time
from .section import Section, key


def _readable(text: str) -> str:
    parse_axis(text)
    return text


Range = Annotated[StrictStr, AfterValidator(_readable)]
LoadPressure = Annotated[Pressure, Field(gt=0, le=1e7)]


class Steady(Section):
    """Equilibria over a list of pressures."""

    pressures: tuple[LoadPressure, ...] = key(
        (2e3, 6e3, 12e3, 18e3, 24e3, 29e3, 36e3, 50e3), "Pressures of the head-discharge curve.", min_length=1
    )
    tolerance: Number = key(1e-8, "Residual, relative to the load, at which Newton stops.", gt=0, le=1e-2)
    max_iterations: StrictInt = key(30, "Newton iterations of one load step.", ge=1, le=10000)
    min_step: Number = key(1e-4, "Smallest load step, relative to the target, before giving up.", gt=0, le=1)


class Modes(Section):
    """Leading eigenvalues of the coupled state."""

    count: StrictInt = key(10, "How many modes; a conjugate pair is one.", ge=1, le=1000)
    max_frequency: Frequency | None = key(None, "Only modes up to this frequency; chosen where damping does not order the modes.", gt=0, le=1e6)
    shift: Rate | None = key(None, "Real part of a shift to search near, instead of automatic ones.", ge=-1e6, le=1e6)
    shift_frequency: Frequency = key(0.0, "Frequency of that shift.", ge=0, le=1e6)
    tolerance: Number = key(1e-8, "Largest accepted relative residual of the full pencil.", gt=0, le=1e-2)
    in_vacuo: StrictBool = key(False, "Leave the fluid out: the stressed structure alone.")


class Sweep(Section):
    """Modes tracked along one parameter."""

    over: Range = key("density=1:1000:40:log", "Parameter and its values: PARAMETER=START:STOP:COUNT[:log].")
    count: StrictInt = key(6, "How many leading modes to follow.", ge=1, le=100)
    checks: StrictInt = key(3, "Values at which the reduced basis, or the count of unstable modes, is checked.", ge=1, le=50)
    tolerance: Number = key(1e-6, "Accepted relative error of the eigenvalues on the reduced basis.", gt=0, le=1e-2)
    least_confidence: Number = key(0.6, "A step is halved while the match of a leading mode is less certain than this.", gt=0, lt=1)

    @property
    def axis(self) -> Axis:
        """The parsed range."""
        return parse_axis(self.over)


class Onset(Section):
    """Where a state loses stability."""

    over: Literal["pressure", "density", "alpha", "beta"] = key("density", "The parameter to move.")


class StabilityMap(Section):
    """Stability over two parameters."""

    x: Range = key("pressure=500:50000:64", "Horizontal range: PARAMETER=START:STOP:COUNT[:log].")
    y: Range = key("density=1:1000:64:log", "Vertical range: PARAMETER=START:STOP:COUNT[:log].")

    @property
    def axes(self) -> tuple[Axis, Axis]:
        """The parsed ranges."""
        return parse_axis(self.x), parse_axis(self.y)


class Transient(Section):
    """A time history."""

    step: Time = key(1e-3, "Time step.", gt=0, le=1e3)
    duration: Time = key(0.5, "Simulated time.", gt=0, le=1e5)
    start: Literal["rest", "steady", "kick"] = key(
        "rest", "From the closed valve at rest, from the steady state, or from the steady state with a push."
    )
    numerical_damping: Number = key(0.0, "Numerical damping of high frequencies.", ge=0, le=0.5)


class Closure(Section):
    """Back pressure on the outside, no flow."""

    pressures: tuple[LoadPressure, ...] = key(
        (7e3, 14e3, 21e3, 28e3), "Back pressures.", min_length=1
    )
    supports: Literal["contact", "held-lips"] = key(
        "contact",
        "Inner faces touching the closing plane, or the simplification of Th. 3.6: duckbill held shut, mid-surface of the "
        "saddle kept from crossing the plane.",
    )
    start: Literal["rest", "open"] = key("rest", "From the valve at rest, or from the steady flow at open_pressure turned back.")
    open_pressure: LoadPressure = key(10e3, "Inlet pressure of the open start.")
    max_step: LoadPressure = key(1e3, "Largest load step; the stiffness is watched for buckling at each.")
    contact_depth: Length = key(
        3e-6,
        "Depth to which the largest back pressure alone would press the faces into each other, before multipliers push them apart.",
        gt=0,
        le=1e-3,
    )
    penetration: Length = key(1e-6, "Largest penetration that is left.", gt=0, le=1e-3)
    shut_fraction: Number = key(
        0.2, "A section counts as shut when less than this fraction of the lip's opening at rest is left.", ge=0, lt=1
    )
    eigenvalues: StrictInt = key(4, "Lowest eigenvalues of the tangent stiffness to follow.", ge=1, le=100)
    arclength: StrictBool = key(True, "Go on along the equilibrium path by arclength when load steps end at a limit point.")
