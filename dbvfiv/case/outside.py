"""The fluid outside the wall."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator

from .described import Described
from .parameters import PARAMETERS
from .quantity import Length
from .section import BrokenRule, Section, key

#: Words in place of a density.
WORDS = ("none", "same")
#: Least diameter of the pipe over that of the flange's outer face.
CLEARANCE = 1.02
_DENSITY = PARAMETERS["density"]


def _fluid(given: Any) -> Any:
    if isinstance(given, str) and given.strip() in WORDS:
        return given.strip()
    if isinstance(given, str) and not any(c.isdigit() for c in given):
        raise ValueError("which is no word that is known here")
    value = _DENSITY.quantity.parse(given)
    if not _DENSITY.low < value <= _DENSITY.high:
        raise ValueError("which is out of range")
    return value


OutsideFluid = Annotated[
    float | str,
    BeforeValidator(_fluid),
    Described("choice or density", f'"none", "same" or a density greater than 0 and at most {_DENSITY.high:g} kg/m^3'),
]


class Outside(Section):
    """Still fluid around the wall; its pressure in motion is that of potential flow on the deformed outer face."""

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
        """Refuse a pipe that the valve does not go into; `outer` is the largest diameter of its outer face, m.

        Raises
        ------
        BrokenRule
        """
        if self.is_there and self.pipe_diameter is not None and self.pipe_diameter < CLEARANCE * outer:
            raise BrokenRule(
                "outside.pipe_diameter",
                f"{1e3 * self.pipe_diameter:g} mm around a valve of {1e3 * outer:.4g} mm",
                f"it must be at least {CLEARANCE:g} times that, {1e3 * CLEARANCE * outer:.4g} mm, for the fluid "
                "between them to be resolved",
            )
