"""Surroundings that the valve discharges into: free discharge or a downstream pipe."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from .parameters import PARAMETERS
from .quantity import Length, Number, Pressure
from .section import BrokenRule, Section, key


class Downstream(Section):
    """Free or submerged discharge, or a pipe in which the valve stands and whose fluid its jet runs into."""

    pressure: Annotated[Pressure, Field(ge=0, le=PARAMETERS["pressure"].high)] = key(
        0.0,
        "Pressure downstream over that of the surroundings, as a depth too ('1.5 m'): around jet and wall where the "
        "discharge is free or submerged, at the far end of the pipe where there is one. drive.pressure works against "
        "it and has to be greater; what the wall sees is their difference.",
    )
    pipe_diameter: Length | None = key(
        None,
        "Inner diameter of a full pipe in which the valve stands and its jet widens, which recovers pressure; at least "
        "that of the valve's flow section at the flange. Where not given the discharge is free or submerged and the "
        "energy of the jet is lost.",
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

    def check_pipe(self, inlet: float) -> None:
        """Refuse what belongs to a pipe where there is none, and a pipe that the valve does not stand in; `inlet` is
        the diameter of the valve's flow section at the flange, m.

        Raises
        ------
        BrokenRule
        """
        if self.pipe_diameter is not None and self.pipe_diameter < inlet:
            raise BrokenRule(
                "downstream.pipe_diameter",
                f"{1e3 * self.pipe_diameter:g} mm around a valve with a flow section of {1e3 * inlet:.4g} mm",
                f"it must be at least {1e3 * inlet:.4g} mm, for the valve stands in it",
            )

    @model_validator(mode="after")
    def _pipe_has_a_diameter(self) -> Downstream:
        given = {
            "length": f"{self.length:g} m" if self.length else "",
            "loss": f"{self.loss:g}" if self.loss else "",
            "expansion_loss": "" if self.expansion_loss is None else f"{self.expansion_loss:g}",
        }
        for name, text in given.items():
            if text and self.pipe_diameter is None:
                raise BrokenRule(
                    name, f"{text} without pipe_diameter", "it belongs to a pipe downstream, so give pipe_diameter too"
                )
        return self
