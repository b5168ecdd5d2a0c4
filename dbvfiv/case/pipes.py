"""Pipes: the line in front of the valve with its pump, and what the valve discharges into."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, StrictInt, model_validator

from .parameters import PARAMETERS
from .quantity import Length, Number, Pressure, Quantity
from .section import BrokenRule, Section, key
from .tables import PumpCurve

#: Roughness over diameter up to which the law of fully rough pipes was measured.
_ROUGHEST = 0.05
_LENGTH = PARAMETERS["pipe_length"]


class Pipe(Section):
    """A straight pipe: a rigid column of fluid with friction and losses, or an elastic one."""

    needs = {"elements": "wave_speed"}

    length: Annotated[float, _LENGTH.quantity] = key(..., "Length of the pipe.", gt=0, le=_LENGTH.high)
    diameter: Length | None = key(
        None,
        "Inner diameter of the pipe; where not given that of the valve's flow section at the flange. A change of "
        "section at the flange takes no head: put that of a reducer into loss.",
        gt=0,
        le=100,
    )
    friction: Number = key(
        0.0, "Darcy's friction factor f: f length/diameter velocity heads are lost on the way.", ge=0, le=1
    )
    roughness: Annotated[float, Quantity("m", "mm")] = key(
        0.0,
        "Height of the sand grain roughness, in place of friction: f of Colebrook and White's law in a fully rough "
        "pipe, 1/sqrt(f) = 2 log10(3.7 diameter/roughness), which turbulent flow tends to and which does not change "
        "with speed; laminar flow is not meant.",
        ge=0,
        le=1,
    )
    loss: Number = key(
        0.0,
        "Sum of the loss coefficients K of entrance, bends, valves and reducers, of the velocity head in the pipe.",
        ge=0,
        le=1e6,
    )
    wave_speed: Annotated[float, PARAMETERS["wave_speed"].quantity] | None = key(
        None,
        "Speed of pressure waves in the pipe, for an elastic line with reflections, friction and loss spread evenly "
        "over it; where not given the fluid in it is a rigid column. Water in steel 1000 to 1300 m/s, in plastic 200 "
        "to 500, less with gas in it; the same at every density that is asked for.",
        **PARAMETERS["wave_speed"].limits,
    )
    elements: StrictInt | None = key(
        None,
        "Elements of an elastic line, of fourth degree: one resolves waves up to half a wavelength of it, 1.5e-4 too "
        "high in frequency. Where not given as many as resolve 200 Hz, at most 16.",
        ge=1,
        le=400,
    )

    def check_roughness(self, inlet: float, name: str) -> None:
        """Refuse a roughness that no pipe of its diameter has; `inlet` is the diameter of the valve's inlet, m, and
        `name` the key of the pipe. Raises BrokenRule.
        """
        diameter = inlet if self.diameter is None else self.diameter
        if self.length > 0 and self.roughness > _ROUGHEST * diameter:
            raise BrokenRule(
                f"{name}.roughness",
                f"{1e3 * self.roughness:g} mm in a pipe of {1e3 * diameter:g} mm",
                f"it must be at most {_ROUGHEST:g} of the diameter, {1e3 * _ROUGHEST * diameter:.4g} mm",
            )

    @model_validator(mode="after")
    def _one_friction(self) -> Pipe:
        if self.friction > 0 and self.roughness > 0:
            raise BrokenRule(
                "roughness",
                f"{1e3 * self.roughness:g} mm beside friction = {self.friction:g}",
                "both say how rough the pipe is, so leave one of them out",
            )
        return self


class Upstream(Pipe):
    """A straight pipe in front of the valve, or several in series: rigid columns of fluid with friction and losses."""

    length: Annotated[float, _LENGTH.quantity] = key(
        0.0,
        "Length of the pipe between the flange and its far end, where drive.pressure is given; 0 for no line, whatever "
        "the other keys say.",
        ge=0,
        le=_LENGTH.high,
    )
    pieces: tuple[Pipe, ...] = key(
        (),
        "Pipes in series in place of one, [[upstream.pieces]] from the far end to the flange, each with the keys of "
        "one. Inertances and losses add; waves go from pipe to pipe with the same flow and total pressure at a joint, "
        "and rigid pipes may stand between elastic ones. A joint takes no head: put that of a reducer or a widening "
        "into a loss.",
        max_length=50,
    )
    pump: PumpCurve | None = key(
        None,
        "Curve of a pump at the far end, in place of drive.pressure: a CSV file of flow and head (header flow [L/s], "
        "head [m]; relative to the case file), or rows [[flow, head], ...] in m3/s and m or with units. Between rows "
        "the monotone cubic of Fritsch and Carlson; no result is taken from beyond them.",
    )

    @property
    def pipes(self) -> tuple[Pipe, ...]:
        """All pipes from the far end to the flange; one of no length where there is no line."""
        return self.pieces or (self,)

    @property
    def whole_length(self) -> float:
        """Length of all of them, m."""
        return sum(pipe.length for pipe in self.pipes)

    @property
    def first_wave_speed(self) -> float | None:
        """Wave speed of the first elastic pipe, m/s; None where no pipe is elastic."""
        return next((pipe.wave_speed for pipe in self.pipes if pipe.wave_speed is not None), None)

    @property
    def is_elastic(self) -> bool:
        """True where pressure waves run in the upstream pipe."""
        return self.whole_length > 0 and self.first_wave_speed is not None

    @property
    def has_friction(self) -> bool:
        """True where some pipe segment has wall friction, so that head loss grows with length."""
        return any(pipe.friction > 0 or pipe.roughness > 0 for pipe in self.pipes)

    def check_pipes(self, inlet: float) -> None:
        """Refuse a roughness that no pipe of its diameter has; `inlet` is the diameter of the valve's inlet, m. Raises
        BrokenRule.
        """
        for i, pipe in enumerate(self.pipes):
            pipe.check_roughness(inlet, f"upstream.pieces.{i}" if self.pieces else "upstream")

    @model_validator(mode="after")
    def _one_pipe_or_pieces(self) -> Upstream:
        for name in Pipe.model_fields if self.pieces else ():
            if getattr(self, name) != type(self).model_fields[name].default:
                raise BrokenRule(
                    name,
                    f"{getattr(self, name):g} beside upstream.pieces",
                    "it belongs to a line of one pipe, so give it in a piece",
                )
        return self

    @model_validator(mode="after")
    def _pump_at_the_end_of_a_line(self) -> Upstream:
        if self.pump is not None and not self.whole_length > 0:
            raise BrokenRule(
                "pump", "given without a line", "it stands at the far end of one, so give upstream.length as well"
            )
        return self


class Downstream(Section):
    """Free or submerged discharge, or a pipe in which the valve stands and whose fluid its jet runs into."""

    needs = {"length": "pipe_diameter", "loss": "pipe_diameter", "expansion_loss": "pipe_diameter"}

    pressure: Annotated[Pressure, Field(ge=0, le=PARAMETERS["pressure"].high)] = key(
        0.0,
        "Pressure downstream over that of the surroundings, as a depth too ('1.5 m'): around jet and wall where the "
        "discharge is free or submerged, at the far end of the pipe where there is one. drive.pressure works against "
        "it and has to be greater; what the wall sees is their difference.",
    )
    pipe_diameter: Length | None = key(
        None,
        "Inner diameter of a full pipe in which the valve stands and its jet widens, which recovers pressure; at least "
        "that of the valve's flow section at the flange and twice what its bill goes from the axis. Where not given "
        "the discharge is free or submerged and the energy of the jet is lost.",
        gt=0,
        le=100,
    )
    length: Length = key(
        0.0,
        "Length of that pipe behind the valve: a rigid column that is set in motion with the flow.",
        ge=0,
        le=PARAMETERS["tail_length"].high,
    )
    loss: Number = key(
        0.0,
        "Sum of the loss coefficients K of that pipe up to its far end, friction included, of the velocity head in it. "
        "The end in still water is none of them: the pressure where the stream leaves the pipe is that of the water "
        "around it.",
        ge=0,
        le=1e6,
    )
    expansion_loss: Number | None = key(
        None,
        "Loss of the widening jet over its velocity head, K of Th. 7.2; where not given Borda and Carnot's (1 - r)^2 "
        "with r the section of the jet over that of the pipe, which follows the opening.",
        ge=0,
        le=1,
    )

    def check_pipe(self, inlet: float, reach: float) -> None:
        """Refuse a pipe that the valve does not stand in; `inlet` is the diameter of its flow section at the flange and
        `reach` the distance from the axis to which the bill goes, m. Raises BrokenRule.
        """
        for least, around, why in (
            (inlet, f"a valve with a flow section of {1e3 * inlet:.4g} mm", "for the valve stands in it"),
            (2 * reach, f"a bill that goes {1e3 * reach:.4g} mm from its axis", "or the bill does not go into it"),
        ):
            if self.pipe_diameter is not None and self.pipe_diameter < least:
                raise BrokenRule(
                    "downstream.pipe_diameter",
                    f"{1e3 * self.pipe_diameter:g} mm around {around}",
                    f"it must be at least {1e3 * least:.4g} mm, {why}",
                )
