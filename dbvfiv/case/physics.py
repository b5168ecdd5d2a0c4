"""Shell theory, fluids inside and outside, weight, load and supports."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, StrictBool, ValidationInfo, field_validator, model_validator

from .parameters import PARAMETERS
from .quantity import GRAVITY, Density, FaceStiffness, Length, Number, Pressure, Quantity, Stiffness, word_or_number
from .section import BrokenRule, Described, Section, key

#: Viscosities by name, Pa s, at 20 degC: water at 0.1 MPa (IAPWS R12-08), dry air at 0.1 MPa (Lemmon & Jacobsen 2004).
VISCOSITIES = {"none": 0.0, "water": 1.0016e-3, "air": 1.813e-5}
#: Density below which a fluid is a gas, kg/m3.
LIQUID = 300.0
#: That of glycerol and of the heaviest sludges.
_THICKEST = 10.0


Viscosity = Annotated[
    float | str,
    word_or_number(VISCOSITIES, Quantity("Pa s", "mPa s"), lambda value: 0 < value <= _THICKEST, is_word=str.isalpha),
    Described(
        "choice or viscosity", f'"none", "water", "air" or a viscosity greater than 0 and at most {_THICKEST:g} Pa s'
    ),
]

#: A pressure that drives a flow, alone or beside the fluid's own weight.
DrivePressure = Annotated[Pressure, Field(ge=0, le=PARAMETERS["pressure"].high)]
#: A pressure that loads the valve: above zero, and within what the parameter may be.
LoadPressure = Annotated[Pressure, Field(**PARAMETERS["pressure"].limits)]


class Shell(Section):
    """Choices of the shell theory."""

    metric: Literal["first-order", "shifted"] = key(
        "first-order",
        'Through-thickness metric: "first-order" of Budiansky and Sanders (the thesis) gives every layer the length of '
        'the mid-surface; "shifted" gives layers their own length, which is what layers of unlike stiffness want, and '
        "is bounded where the wall folds; runs in time and cycles with loss factors take first-order alone.",
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

    needs = {"heat_capacity_ratio": "sound_speed"}

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
        "Absolute pressure of the surroundings, which vapour_pressure is compared with, and the suction of runs.",
        gt=0,
        le=PARAMETERS["pressure"].high,
    )
    area_floor: Number = key(
        0.05,
        "Smallest flow area, as a fraction of the lip gap area at rest, without the lens of lips that stand apart; "
        "keeps a shut passage finite. Of a bill that is moulded shut it is three quarters.",
        gt=0,
        lt=1,
    )
    separation: Number | None = key(
        None,
        "Share of the velocity head that is lost where the passage widens downstream: 0 for a flow that follows the "
        "wall (the thesis), 1 for a jet that leaves the narrowest section. Where not given 0, and 1 in a bill that is "
        "moulded shut.",
        ge=0,
        le=1,
    )

    @property
    def dynamic_viscosity(self) -> float:
        """Viscosity, Pa s; 0 without any."""
        return VISCOSITIES.get(self.viscosity, self.viscosity)

    @property
    def compressed(self) -> dict[str, float] | None:
        """Speed of sound, m/s, and ratio of the heat capacities of a fluid that is compressed."""
        if self.sound_speed is None:
            return None
        return {"sound_speed": self.sound_speed, "heat_capacity_ratio": self.heat_capacity_ratio}


class Drive(Section):
    """The load."""

    told_by_giving = ("pressure",)

    kind: Literal["flow", "uniform"] = key(
        "flow", "Pressure from the flow through the valve, or one uniform pressure without flow."
    )
    pressure: DrivePressure = key(
        18e3,
        "Static pressure at the flange over that of the surroundings (flow), or the pressure on the wall (uniform). "
        "With a line upstream it is the pressure at its far end: see drive.at. It works against downstream.pressure.",
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

    contact: Literal["stops", "faces"] | None = key(
        None,
        "What keeps the walls from crossing the closing plane y = 0: springs on the displacement of duckbill nodes "
        "(stops, App. A, said by the keys lip_stop...), which let the outer half of the lips cross, or contact of the "
        "inner faces of the whole wall (faces), for which these keys say nothing. Stops where not given; faces for a "
        "bill moulded shut and for lips bowed apart.",
    )
    contact_stiffness: FaceStiffness | None = key(
        None,
        'Pressure over depth with which faces that meet resist, for contact = "faces"; 1e10 Pa/m where not given, '
        "1e9 Pa/m, some modulus over thickness, for a bill moulded shut and lips bowed apart.",
        gt=0,
        le=1e15,
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


#: Along the valve's axis, on which z runs from the lips to the flange: component of gravity over its size.
_ALONG = {"none": 0.0, "-z": -1.0, "+z": 1.0}
_ACROSS = ("x", "+x", "-x", "y", "+y", "-y")


def _direction(given: Any) -> Any:
    if isinstance(given, str) and given.strip() in _ACROSS:
        raise ValueError(
            "which is across the axis, and the part that is computed is symmetric about x = 0 and y = 0, or one of "
            "them, so it carries weight along its axis alone"
        )
    if not isinstance(given, str) or given.strip() not in _ALONG:
        raise ValueError("which is no direction that is known here")
    return given.strip()


Direction = Annotated[str, BeforeValidator(_direction), Described("choice", 'one of "none", "-z", "+z"')]


class Gravity(Section):
    """Weight of the wall, and the pressure of the fluid's levels along a valve that stands upright."""

    direction: Direction = key(
        "none",
        "Where gravity points: none leaves it out, as for a valve that lies; -z to the lips, a valve that discharges "
        "downwards; +z to the flange, one that discharges upwards. The wall then weighs what it does in the fluids on "
        "its sides, and pressures rise with depth, inside by fluid.density, outside by that of outside.fluid. "
        "drive.pressure is then over that of the surroundings at the level of the lips; at the far end of a line it is "
        "referred to the level of the flange, and downstream.pressure to that of the lips.",
    )

    @property
    def is_there(self) -> bool:
        """True where gravity has a direction, so that wall and fluid have weight."""
        return self.direction != "none"

    @property
    def along(self) -> float:
        """Component of gravity along z, m/s2."""
        return GRAVITY * _ALONG[self.direction]


#: Words in place of a density.
WORDS = ("none", "same")
#: Least diameter of the pipe over that of the flange's outer face.
CLEARANCE = 1.02
_DENSITY = PARAMETERS["density"]


OutsideFluid = Annotated[
    float | str,
    word_or_number(WORDS, _DENSITY.quantity, lambda value: _DENSITY.low < value <= _DENSITY.high),
    Described("choice or density", f'"none", "same" or a density greater than 0 and at most {_DENSITY.high:g} kg/m^3'),
]


class Outside(Section):
    """Still fluid around the wall; its pressure in motion is that of potential flow on the deformed outer face."""

    needs = {"pipe_diameter": "fluid", "lips": "fluid"}

    fluid: OutsideFluid = key(
        "none",
        "Fluid outside the wall, which moves with it as added mass: none, the same as inside (it follows "
        "fluid.density, in sweeps, onsets and maps over it too), or one of a fixed density.",
    )
    pipe_diameter: Length | None = key(
        None,
        "Inner diameter of a rigid round pipe around the valve, on its axis, open to the fluid on both sides some way "
        "off; where not given the fluid is unbounded, and the line in front goes on as a rigid tube of the flange's "
        "outer face.",
        gt=0,
        le=100,
    )

    lips: Literal["closed", "open"] = key(
        "closed",
        "What the fluid outside finds between the lips: a rigid lid (closed), or an opening that it may pass, at the "
        "outlet pressure of the flow (open).",
    )

    @property
    def is_there(self) -> bool:
        """True where fluid surrounds the valve."""
        return self.fluid != "none"

    def density(self, inside: float) -> float:
        """Density outside for one inside, kg/m3; zero where there is none."""
        return 0.0 if self.fluid == "none" else inside if self.fluid == "same" else float(self.fluid)

    @property
    def fixed_density(self) -> float:
        """Density that does not follow the one inside, kg/m3; zero where there is none."""
        return 0.0 if isinstance(self.fluid, str) else float(self.fluid)

    @property
    def words(self) -> str:
        """Description of the surrounding fluid, in words that follow a sentence's subject; empty without any."""
        if not self.is_there:
            return ""
        fluid = "the same fluid" if self.fluid == "same" else f"fluid of {self.fixed_density:g} kg/m3"
        place = "unbounded" if self.pipe_diameter is None else f"in a pipe of {1e3 * self.pipe_diameter:g} mm"
        lips = ", lips open to it" if self.lips == "open" else ""
        return f"with {fluid} outside, {place}{lips}"

    def check_pipe(self, outer: float) -> None:
        """Refuse a pipe that the valve does not go into; `outer` is the largest diameter of its outer face, m. Raises
        BrokenRule.
        """
        if self.is_there and self.pipe_diameter is not None and self.pipe_diameter < CLEARANCE * outer:
            raise BrokenRule(
                "outside.pipe_diameter",
                f"{1e3 * self.pipe_diameter:g} mm around a valve of {1e3 * outer:.4g} mm",
                f"it must be at least {CLEARANCE:g} times that, {1e3 * CLEARANCE * outer:.4g} mm, for the fluid "
                "between them to be resolved",
            )
