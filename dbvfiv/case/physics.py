"""Shell theory, fluid, load and supports."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, StrictBool, ValidationInfo, field_validator, model_validator

from .described import Described
from .parameters import PARAMETERS
from .quantity import GRAVITY, Density, FaceStiffness, Number, Pressure, Quantity, Stiffness
from .section import BrokenRule, Section, key

#: Viscosities by name, Pa s, at 20 degC: water at 0.1 MPa (IAPWS R12-08), dry air at 0.1 MPa (Lemmon & Jacobsen 2004).
VISCOSITIES = {"none": 0.0, "water": 1.0016e-3, "air": 1.813e-5}
#: That of glycerol and of the heaviest sludges.
_THICKEST = 10.0


def _viscosity(given: Any) -> float | str:
    if isinstance(given, str) and given.strip() in VISCOSITIES:
        return given.strip()
    if isinstance(given, str) and given.strip().isalpha():
        raise ValueError("which is no word that is known here")
    value = Quantity("Pa s", "mPa s").parse(given)
    if not 0.0 < value <= _THICKEST:
        raise ValueError("which is out of range")
    return value


Viscosity = Annotated[
    float | str,
    BeforeValidator(_viscosity),
    Described(
        "choice or viscosity", f'"none", "water", "air" or a viscosity greater than 0 and at most {_THICKEST:g} Pa s'
    ),
]

#: A pressure that loads the valve: above zero, and within what the parameter may be.
LoadPressure = Annotated[Pressure, Field(**PARAMETERS["pressure"].limits)]


class Shell(Section):
    """Choices of the shell theory."""

    metric: Literal["first-order", "shifted"] = key(
        "first-order",
        'Through-thickness metric: "first-order" of Budiansky and Sanders (the thesis) gives every layer the length of '
        'the mid-surface; "shifted" gives layers their own length, which is what layers of unlike stiffness want, and '
        "is bounded where the wall folds.",
    )
    shear_correction_plies: Number = key(5 / 6, "Transverse-shear factor of fibre plies.", gt=0, le=1.5)
    shear_correction_rubber: Number = key(1.0, "Transverse-shear factor of all other layers.", gt=0, le=1.5)
    mass: Literal["averaged", "consistent"] = key(
        "averaged",
        "Mass of an element: the mean of that of its shape functions and of the same lumped at the nodes (averaged), "
        "whose errors of frequencies are a third or less; or that of its shape functions alone (consistent, earlier "
        "versions).",
    )


class Fluid(Section):
    """The fluid and its conservation laws."""

    density: Density = key(1000.0, "Mass density.", **PARAMETERS["density"].limits)
    continuity: Literal["quasi-steady", "storage"] = key(
        "storage",
        "dA/dt + d(AU)/dz = 0 (storage), which conserves volume under moving walls, or A U the same at every station "
        "(quasi-steady, the thesis).",
    )
    unsteady: StrictBool = key(True, "Keep the unsteady term of Bernoulli's equation.")
    viscosity: Viscosity = key(
        "none",
        "Viscosity of the fluid, which then loses head to the walls of the passage, laminar in narrow gaps and "
        "turbulent in wide ones: none (the thesis), water (1.0016 mPa s) or air (0.01813 mPa s), both at 20 degC, or "
        "a number.",
    )
    sound_speed: Annotated[float, Quantity("m/s", "m/s")] | None = key(
        None,
        "Speed of sound in the fluid in the valve at the pressure around the jet, for a gas, or a liquid, that is "
        "compressed: 343 m/s in air, 1480 m/s in water at 20 degC. Where not given the fluid is incompressible (the "
        'thesis). Needs continuity = "storage".',
        ge=10,
        le=1e5,
    )
    heat_capacity_ratio: Number = key(
        1.4,
        "Ratio of the specific heats of a gas with a sound_speed, which is compressed isentropically: 1.4 for air, 1.3 "
        "for natural gas and steam. Its absolute pressure around the jet is density sound_speed^2 over it. For liquids "
        "the exponent of Tait's equation, 7.15 for water, which says nothing at the pressures of a valve.",
        ge=1.01,
        le=10,
    )
    vapour_pressure: Annotated[float, Quantity("Pa", "kPa")] | None = key(
        None,
        "Absolute pressure at which a liquid with a sound_speed boils: 2339 Pa for water at 20 degC. Pressures in the "
        "valve end there and cavities fill and empty. Where not given the liquid bears any tension.",
        ge=0,
        le=PARAMETERS["pressure"].high,
    )
    ambient_pressure: Annotated[float, Quantity("Pa", "kPa")] = key(
        101325.0,
        "Absolute pressure of the surroundings, which vapour_pressure is compared with.",
        gt=0,
        le=PARAMETERS["pressure"].high,
    )
    area_floor: Number = key(
        0.05, "Smallest flow area, as a fraction of the lip gap area at rest; keeps a shut passage finite.", gt=0, lt=1
    )

    @property
    def dynamic_viscosity(self) -> float:
        """Viscosity, Pa s; 0 without any."""
        return VISCOSITIES.get(self.viscosity, self.viscosity)


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
    head: Annotated[float, Quantity("m", "m")] | None = key(
        None,
        "The same as a head of the fluid, in place of pressure: rho g times it, with the density of the case. It is "
        "turned into that pressure where the case is read, which stays where another density is asked for.",
        gt=0,
        le=1e7,
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

    @model_validator(mode="before")
    @classmethod
    def _head_is_a_pressure(cls, data: Any, info: ValidationInfo) -> Any:
        if not isinstance(data, Mapping) or data.get("head") is None:
            return data
        if "pressure" in data:
            raise BrokenRule(
                "head",
                f"{data['head']!r} beside pressure = {data['pressure']!r}",
                "both say what drives the flow, so leave one of them out",
            )
        try:
            head = Quantity("m", "m").parse(data["head"])
        except ValueError:
            return data  # refused where it stands
        density = (info.context or {}).get("density")
        if density is None or not 0 < head <= PARAMETERS["pressure"].high / (density * GRAVITY):
            return data
        kept = {name: value for name, value in data.items() if name != "head"}
        return kept | {"pressure": float(f"{density * GRAVITY * head:.15g}")}

    @field_validator("head", mode="after")
    @classmethod
    def _head_was_turned(cls, head: float | None, info: ValidationInfo) -> None:
        if head is None:
            return None
        density = (info.context or {}).get("density")
        if density is None:
            raise ValueError("and the density of the fluid is not known")
        raise ValueError(f"which is more than the {PARAMETERS['pressure'].high / 1e6:g} MPa that drive.pressure may be")


class Supports(Section):
    """Contact condition of the lips: one-sided stops, or contact of the inner faces."""

    contact: Literal["stops", "faces"] = key(
        "stops",
        "What keeps the walls from crossing the closing plane y = 0: springs on the displacement of duckbill nodes "
        "(stops, App. A, said by the keys lip_stop...), which let the outer half of the lips cross, or contact of the "
        "inner faces of the whole wall (faces), for which these keys say nothing.",
    )
    contact_stiffness: FaceStiffness = key(
        1e10, 'Pressure over depth with which faces that meet resist, for contact = "faces".', gt=0, le=1e15
    )
    rebound: Number = key(
        0.5,
        'Rebound resilience of the wall, for contact = "faces": the share of the energy stored in the contact that '
        "faces get back when they part in a run in time. Some 0.4 to 0.6 for the rubbers of valves (ISO 4662); 1 loses "
        "nothing, 0 is a dead blow.",
        ge=0,
        le=1,
    )
    lip_stop: StrictBool = key(True, "Keep the duckbill from crossing the closing plane y = 0.")
    lip_stop_stiffness: Stiffness = key(1e8, "Stiffness of each one-sided spring.", gt=0, le=1e15)
    lip_stop_columns: Literal["inner-half", "all"] = key(
        "inner-half", "Columns of duckbill nodes with a stop: those next to the centre, or all."
    )
