"""Damping of the wall: viscoelastic materials, or Rayleigh's two constants."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, PrivateAttr, StrictInt, model_serializer, model_validator

from .described import Described
from .parameters import PARAMETERS
from .quantity import Number, Quantity, Rate, Time
from .section import BrokenRule, Section, key

_FREQUENCY = Quantity("Hz", "Hz")
_SLOWEST, _FASTEST = 1e-6, 1e6
#: Relaxation times that keep a constant loss factor within some 3 % (docs/damping.md), next to one more.
_PER_DECADE = 1.25
#: Numbers that follow from the model where they are not given: alpha 1/s, beta s, factor on the loss factors.
_DEFAULTS = {
    "rayleigh": {"alpha": 5.0, "beta": 0.003, "loss_factor": 0.0},
    "loss factor": {"alpha": 0.0, "beta": 0.0, "loss_factor": 1.0},
}
#: What a model does not have, and what to do instead.
_FOREIGN = {
    "rayleigh": ("loss_factor", "set damping.model to 'loss factor', or leave it out"),
    "loss factor": (
        "beta",
        "leave it out, as the materials' loss factors take its place, or set damping.model to 'rayleigh'",
    ),
}


def _band(given: Any) -> tuple[float, float]:
    if not isinstance(given, Sequence) or isinstance(given, str):
        raise ValueError("which is no list of two frequencies")
    if len(given) != 2:
        raise ValueError(f"which has {len(given)} entries")
    low, high = (_frequency(entry) for entry in given)
    if low >= high:
        raise ValueError("whose first frequency is not below its second")
    return low, high


def _frequency(given: Any) -> float:
    try:
        value = _FREQUENCY.parse(given)
    except ValueError as error:
        raise ValueError(f"whose entry {given!r} is one {error}") from None
    if not _SLOWEST <= value <= _FASTEST:
        raise ValueError(f"whose entry {value:g} Hz is out of range")
    return value


Band = Annotated[
    tuple[Annotated[float, _FREQUENCY], Annotated[float, _FREQUENCY]],
    BeforeValidator(_band),
    Described(
        "two frequencies",
        f"a list of two frequencies from {_SLOWEST:g} to {_FASTEST:g} Hz, the lower one first, such as "
        '["1 Hz", "200 Hz"]',
    ),
]


class Damping(Section):
    """Damping alpha M and materials that relax, or Rayleigh damping C = alpha M + beta K.

    `alpha`, `beta`, `loss_factor` and `branches` hold numbers also where they were not given.
    """

    model: Literal["rayleigh", "loss factor"] = key(
        "loss factor",
        "Damping by the loss factors of the materials, layer by layer (loss factor), or proportional to mass and "
        "stiffness (rayleigh, the thesis).",
    )
    alpha: Rate | None = key(
        None,
        "Factor of the mass matrix; where not given 0 with loss factor and 5 1/s with rayleigh.",
        **PARAMETERS["alpha"].limits,
    )
    beta: Time | None = key(
        None,
        "Factor of the structure's tangent stiffness, with rayleigh alone; 0.003 s where not given.",
        **PARAMETERS["beta"].limits,
    )
    loss_factor: Number | None = key(
        None,
        "Factor on the loss factors of all materials, with loss factor alone; 1 where not given, 0 leaves them "
        "elastic.",
        **PARAMETERS["loss_factor"].limits,
    )
    band: Band = key((1.0, 200.0), "Frequencies over which loss factors hold: series are fitted over this band.")
    branches: StrictInt | None = key(
        None,
        "Number of relaxation times fitted over the band; where not given 5 for every 4 decades and one more, 4 over 1 "
        "to 200 Hz.",
        ge=1,
        le=20,
    )
    _following: frozenset[str] = PrivateAttr(frozenset())

    @property
    def following(self) -> frozenset[str]:
        """Keys that were not given and follow from the model."""
        return self._following

    @property
    def relaxes(self) -> bool:
        """True where the materials are viscoelastic (loss factors) instead of Rayleigh damped."""
        return self.model == "loss factor"

    @property
    def meaningless(self) -> str:
        """Name of the parameter that the model does not have."""
        return _FOREIGN[self.model][0]

    def lacks(self, name: str) -> str | None:
        """Why a parameter means nothing under the model, as a clause; None where it means something."""
        if name != self.meaningless:
            return None
        return f"{self.meaningless} means nothing with damping.model = {self.model!r}; {_FOREIGN[self.model][1]}"

    @model_serializer(mode="wrap")
    def _leave_what_follows(self, handler: Any) -> dict[str, Any]:
        """Without the numbers that follow, so that they follow anew after a change."""
        return {name: None if name in self._following else value for name, value in handler(self).items()}

    @model_validator(mode="after")
    def _fill(self) -> Damping:
        """Numbers for the keys that were not given."""
        before = self._following  # damping is checked again when it becomes part of a case
        decades = math.log10(self.band[1] / self.band[0])
        branches = math.ceil(_PER_DECADE * decades - 1e-9) + 1
        numbers = _DEFAULTS[self.model] | {"branches": branches}
        self._following = frozenset(name for name in numbers if getattr(self, name) is None or name in before)
        self.__dict__.update({name: numbers[name] for name in self._following})
        foreign, remedy = _FOREIGN[self.model]
        if getattr(self, foreign):
            value = PARAMETERS[foreign].quantity.si
            raise BrokenRule(
                foreign, f"{getattr(self, foreign):g} {value}".strip() + f" with damping.model = {self.model!r}", remedy
            )
        return self
