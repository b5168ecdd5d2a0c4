"""Shell theory, fluid, load and supports."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, StrictBool, field_validator

from .parameters import PARAMETERS
from .quantity import Density, Number, Pressure, Stiffness
from .section import Section, key

#: A pressure that loads the valve: above zero, and within what the parameter may be.
LoadPressure = Annotated[Pressure, Field(**PARAMETERS["pressure"].limits)]


class Shell(Section):
    """Choices of the shell theory."""

    metric: Literal["first-order", "true"] = key(
        "first-order",
        'Through-thickness metric, one of two words: "first-order" of Budiansky and Sanders, or "true", the exact one '
        "(refused where half the wall exceeds the radius of the mid-surface).",
    )
    shear_correction_plies: Number = key(5 / 6, "Transverse-shear factor of fibre plies.", gt=0, le=1.5)
    shear_correction_rubber: Number = key(1.0, "Transverse-shear factor of all other layers.", gt=0, le=1.5)

    @field_validator("metric", mode="before")
    @classmethod
    def _name_the_true_one(cls, given: Any) -> Any:
        """The word "true" is easily written without quotes."""
        return "true" if given is True else given


class Fluid(Section):
    """The fluid and its conservation laws."""

    density: Density = key(1000.0, "Mass density.", **PARAMETERS["density"].limits)
    continuity: Literal["quasi-steady", "storage"] = key(
        "quasi-steady",
        "A U the same at every station (quasi-steady, the thesis), or dA/dt + d(AU)/dz = 0 (storage), which conserves "
        "volume under moving walls and is what predictions should rest on; new case files have it.",
    )
    unsteady: StrictBool = key(True, "Keep the unsteady term of Bernoulli's equation.")
    area_floor: Number = key(
        0.05, "Smallest flow area, as a fraction of the lip gap area at rest; keeps a shut passage finite.", gt=0, lt=1
    )


class Drive(Section):
    """The load."""

    kind: Literal["flow", "uniform"] = key(
        "flow", "Pressure from the flow through the valve, or one uniform pressure without flow."
    )
    pressure: Pressure = key(
        18e3,
        "Static pressure at the flange over that of the surroundings (flow), or the pressure on the wall (uniform). "
        "With a line upstream it is the pressure at its far end: see drive.at. It works against downstream.pressure.",
        ge=0,
        le=PARAMETERS["pressure"].high,
    )
    at: Literal["reservoir", "line"] = key(
        "reservoir",
        "What drive.pressure is with a line upstream: that of a reservoir at rest at its far end, a total pressure "
        "from which the velocity head at the flange and all losses go off (reservoir), or the static pressure in the "
        "line at its far end, as a gauge there has it; without losses, in a line as wide as the inlet, it is that at "
        "the flange (line). Without a line it says nothing.",
    )
    side: Literal["inside", "outside"] = key("inside", "Which side of the wall a uniform pressure acts on.")
    unloaded_edge: Number = key(
        3 / 28,
        "Fraction of the columns, counted from the side edge of the duckbill, that carries no pressure.",
        ge=0,
        lt=1,
    )


class Supports(Section):
    """One-sided stops of the lips."""

    lip_stop: StrictBool = key(True, "Keep the duckbill from crossing the closing plane y = 0.")
    lip_stop_stiffness: Stiffness = key(1e8, "Stiffness of each one-sided spring.", gt=0, le=1e15)
    lip_stop_columns: Literal["inner-half", "all"] = key(
        "inner-half", "Columns of duckbill nodes with a stop: those next to the centre, or all."
    )
