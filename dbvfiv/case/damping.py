"""Damping: Rayleigh constants of the wall, or viscoelastic materials by loss factors, tables or Prony series."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, StrictInt, model_validator

from .parameters import PARAMETERS
from .quantity import Number, Quantity, Rate, Time, word_or_number
from .section import BrokenRule, Described, FollowingSection, Section, key
from .tables import ExistingFile

#: Materials whose loss factors come with the program.
SHIPPED_LOSSES = ("NR", "SBR", "CR", "EPDM", "NBR", "IIR", "fibre")
#: Ways to say how a material relaxes; one of them at a time.
WAYS = ("loss_factor", "loss_data", "relaxation_data", "prony")
LARGEST_LOSS = 2.0
_COLDEST, _HOTTEST = 100.0, 600.0
_ZERO_CELSIUS = 273.15
_LARGEST_SERIES = 40
_PLAIN, _TIME = Quantity(""), Quantity("s", "s")
#: Scale and zero of units of temperature, in K.
_TEMPERATURES = {
    "k": (1.0, 0.0),
    "degc": (1.0, _ZERO_CELSIUS),
    "°c": (1.0, _ZERO_CELSIUS),
    "degf": (5 / 9, _ZERO_CELSIUS - 160 / 9),
    "°f": (5 / 9, _ZERO_CELSIUS - 160 / 9),
}


def kelvin(value: float, unit: str) -> float:
    """A temperature in K. Raises ValueError: one clause, for a unit that is none of temperature."""
    word = unit.strip().lower()
    word = {"c": "degc", "f": "degf"}.get(word, word)
    if word not in _TEMPERATURES:
        raise ValueError(f"{unit.strip()!r} is no unit of temperature; degC, K and degF are known")
    scale, zero = _TEMPERATURES[word]
    return scale * value + zero


def celsius(temperature: float) -> str:
    """A temperature in K as it stands in messages."""
    return f"{round(temperature - _ZERO_CELSIUS, 2):g} degC"


def _temperature(given: Any) -> float:
    if isinstance(given, str):
        text = given.strip()
        number = text.rstrip("CFKcfkdeg° ")
        try:
            value = kelvin(float(number), text[len(number) :])
        except ValueError:
            raise ValueError("which is no temperature with its unit") from None
    else:
        value = _PLAIN.parse(given)
    if not _COLDEST <= value <= _HOTTEST:
        raise ValueError(f"which is {value:g} K" if math.isfinite(value) else "which is not finite")
    return value


def _series(given: Any) -> Any:
    """((g, tau), ...) of a list of pairs; tau in s or with a unit."""
    if not isinstance(given, Sequence) or isinstance(given, str):
        raise ValueError("which is no list of pairs")
    if not 0 < len(given) <= _LARGEST_SERIES:
        raise ValueError(f"which has {len(given)} pairs")
    pairs = []
    for number, pair in enumerate(given, 1):
        if not isinstance(pair, Sequence) or isinstance(pair, str) or len(pair) != 2:
            raise ValueError(f"whose entry {number} is no pair [g, tau]")
        try:
            strength, time = _PLAIN.parse(pair[0]), _TIME.parse(pair[1])
        except ValueError as error:
            raise ValueError(f"whose pair {number} holds a value {error}") from None
        if strength < 0:
            raise ValueError(
                f"whose pair {number} has the strength {strength:g}: a negative one would give energy away"
            )
        if time <= 0:
            raise ValueError(f"whose pair {number} has the time {time:g} s, which is not positive")
        pairs.append((strength, time))
    return tuple(pairs)


LossFactor = Annotated[
    float | str,
    word_or_number(
        SHIPPED_LOSSES,
        _PLAIN,
        lambda value: 0 <= value <= LARGEST_LOSS,
        "which is no material whose loss factor is known",
    ),
    Described(
        "plain number or text",
        f"a number from 0 to {LARGEST_LOSS:g}, or one of {', '.join(SHIPPED_LOSSES)} for a value that comes with the "
        "program",
        _PLAIN,
    ),
]
Temperature = Annotated[
    float,
    BeforeValidator(_temperature),
    Described(
        "temperature", f'a temperature from {_COLDEST:g} to {_HOTTEST:g} K, such as "20 degC"; a bare number is in K'
    ),
]
Series = Annotated[
    tuple[tuple[float, float], ...],
    BeforeValidator(_series),
    Described(
        "list of pairs",
        'a list of pairs of a strength at least 0 and a time greater than 0 s, such as [[0.1, "10 ms"], [0.1, "1 ms"]]',
    ),
]


class Relaxing(Section):
    """Keys of any material besides the constants of its long-term (equilibrium) law: a factor on them, and its
    viscoelasticity, given in one of several ways.
    """

    stiffness_factor: Number = key(
        1.0, "Factor on all moduli of the material: of a harder or softer batch, or by temperature.", gt=0, le=100
    )
    loss_factor: LossFactor | None = key(
        None,
        "Loss factor (tan delta), the same over damping.band; the name of a material takes the value shipped for it.",
    )
    loss_data: ExistingFile | None = key(
        None,
        "CSV file of tan delta, or of storage and loss modulus, over frequency, with units in its header; relative to "
        "the case file.",
    )
    loss_temperature: Temperature | None = key(
        None, "Which temperature of the table is meant, where loss_data or relaxation_data holds several."
    )
    relaxation_data: ExistingFile | None = key(
        None, "CSV file of the relaxing modulus over time, with units in its header; relative to the case file."
    )
    prony: Series | None = key(
        None, "Prony series [[g, tau], ...]: strengths over the slow modulus and relaxation times, taken as they are."
    )

    @classmethod
    def __pydantic_init_subclass__(cls, **options: Any) -> None:
        """Put the keys of the elastic law before those of viscoelasticity."""
        super().__pydantic_init_subclass__(**options)
        fields = cls.__pydantic_fields__
        for name in Relaxing.model_fields:
            fields[name] = fields.pop(name)

    @model_validator(mode="after")
    def _one_way(self):
        given = self.ways
        if len(given) > 1:
            raise BrokenRule(given[1], f"given beside {given[0]}", f"it must be one of {', '.join(WAYS)} alone")
        if self.loss_temperature is not None and not set(given) & {"loss_data", "relaxation_data"}:
            raise BrokenRule(
                "loss_temperature",
                f"{celsius(self.loss_temperature)} without a table",
                "it must stand beside loss_data or relaxation_data",
            )
        return self

    @property
    def ways(self) -> tuple[str, ...]:
        """Names of the keys by which viscoelasticity is given: one at most in a valid table."""
        return tuple(name for name in WAYS if getattr(self, name) is not None)


_FREQUENCY = Quantity("Hz", "Hz")
_SLOWEST, _FASTEST = 1e-6, 1e6
#: Relaxation times that keep a constant loss factor within some 3 % (docs/damping.md), next to one more.
_PER_DECADE = 1.25
#: Numbers that follow from the model where they are not given: alpha 1/s, beta s, factor on the loss factors.
_DEFAULTS = {
    "rayleigh": {"alpha": 5.0, "beta": 0.003, "loss_factor": 0.0},
    "loss factor": {"alpha": 0.0, "beta": 0.0, "loss_factor": 1.0},
}
#: The parameter that a model does not have.
MEANINGLESS = {"rayleigh": "loss_factor", "loss factor": "beta"}
#: What to do instead of giving it.
_INSTEAD = {
    "rayleigh": "set damping.model to 'loss factor', or leave it out",
    "loss factor": "leave it out, as the materials' loss factors take its place, or set damping.model to 'rayleigh'",
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


class Damping(FollowingSection):
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

    @property
    def relaxes(self) -> bool:
        """True where the materials are viscoelastic (loss factors) instead of Rayleigh damped."""
        return self.model == "loss factor"

    @property
    def meaningless(self) -> str:
        """Name of the parameter that the model does not have."""
        return MEANINGLESS[self.model]

    def lacks(self, name: str) -> str | None:
        """Why a parameter means nothing under the model, as a clause; None where it means something."""
        if name != self.meaningless:
            return None
        return f"{self.meaningless} means nothing with damping.model = {self.model!r}; {_INSTEAD[self.model]}"

    @model_validator(mode="after")
    def _follow_the_model(self) -> Damping:
        """Numbers for the keys that were not given."""
        decades = math.log10(self.band[1] / self.band[0])
        branches = math.ceil(_PER_DECADE * decades - 1e-9) + 1
        self._fill(_DEFAULTS[self.model] | {"branches": branches})
        foreign = self.meaningless
        if getattr(self, foreign):
            given = f"{getattr(self, foreign):g} {PARAMETERS[foreign].quantity.si}".strip()
            raise BrokenRule(foreign, f"{given} with damping.model = {self.model!r}", _INSTEAD[self.model])
        return self
