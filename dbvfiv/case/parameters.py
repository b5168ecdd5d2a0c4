"""The parameters of a valve in its fluid, declared once.

Keys of the case, ranges, sweeps, onsets, maps, sensitivities, figures, tables and help texts read this table; a new
parameter is one row here and what it does in the model.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from .quantity import Quantity


@dataclass(frozen=True)
class Parameter:
    """One row of the table."""

    name: str  #: As it stands in ranges, results and arguments of the Python interface.
    key: str  #: Key of the case that holds it.
    quantity: Quantity  #: SI unit of its values.
    #: title and symbol: what figures, tables and formulas call it; the symbol is empty where there is none.
    title: str
    usual: tuple[float, float, int]  #: Start, stop and count of the range taken where only the name is given; SI.
    #: low and high: values that can be computed, SI.
    low: float = 0.0
    high: float = math.inf
    low_included: bool = True  #: Whether `low` itself can be.
    symbol: str = ""
    #: shown_unit and scale: float; unit in figures and tables, and what a value is divided by to be in it.
    shown_unit: str = ""
    scale: float = 1.0
    log: bool = False  #: Whether the usual range has logarithmic steps.
    swept: bool = False  #: Whether modes are tracked along it.
    note: str = ""  #: Added to the name in lists, where the name alone does not say what it is.
    #: Whether the steady state changes with it. Those that do not are surroundings: the linearised structure stays. The
    #: length of a line with friction does change it, although it stands among those: see
    #: `dbvfiv.studies.stability.place.is_surrounding`.
    moves_equilibrium: bool = False
    design: bool = False  #: Whether the model is built anew for each value.
    #: Its name in `dbvfiv.model.forms.ValveForms`; its own where not given, none for parameters of the design.
    system_name: str = ""

    def __post_init__(self) -> None:
        if not self.system_name and not self.design:
            object.__setattr__(self, "system_name", self.name)

    @property
    def surrounding(self) -> bool:
        """True for a parameter that leaves the steady state and the linearised structure as they are."""
        return not self.moves_equilibrium

    @property
    def words(self) -> str:
        """Title and symbol."""
        return f"{self.title} {self.symbol}".strip()

    @property
    def label(self) -> str:
        """Title, symbol and unit, for the axis of a figure."""
        return f"{self.words}, {self.shown_unit}" if self.shown_unit else self.words

    @property
    def usual_range(self) -> str:
        """The usual range as it would be written."""
        start, stop, count = self.usual
        return f"{self.name}={start:g}:{stop:g}:{count}" + (":log" if self.log else "")

    @property
    def limits(self) -> dict[str, float]:
        """Limits of the case's key, as `section.key` takes them."""
        return {"ge" if self.low_included else "gt": self.low, "le": self.high}

    def amount(self, value: float, digits: int = 6) -> str:
        """A value with its unit, "6 kPa"."""
        return f"{value / self.scale:.{digits}g} {self.shown_unit}".strip()

    def span(self, low: float, high: float) -> str:
        """Two values with their unit, "1 to 6 kPa"."""
        return f"{low / self.scale:.6g} to {self.amount(high)}"

    def named(self, value: float) -> str:
        """A value behind the name, "pressure = 6 kPa"."""
        return f"{self.name} = {self.amount(value)}"

    def text(self, value: float) -> str:
        """A value for people, "6 kPa" or "α = 5 1/s"."""
        return f"{self.symbol} = {self.amount(value)}" if self.symbol else self.amount(value)


_PER_SECOND, _SECONDS, _METRES = Quantity("1/s", "1/s"), Quantity("s", "s"), Quantity("m", "m")
_MOVED = {"log": True, "swept": True}
_DESIGNED = {"moves_equilibrium": True, "design": True}
# fmt: off
_TABLE = (
    Parameter("pressure", "drive.pressure", Quantity("Pa", "kPa", head=True), "Static inlet pressure",
              (300.0, 36000.0, 61), 0.0, 1e7, False, shown_unit="kPa", scale=1e3, moves_equilibrium=True,
              system_name="inlet", **_MOVED),
    Parameter("density", "fluid.density", Quantity("kg/m^3", "kg/m^3"), "Fluid density", (0.5, 2000.0, 61),
              0.0, 30000.0, False, shown_unit="kg/m³", **_MOVED),
    Parameter("alpha", "damping.alpha", _PER_SECOND, "Mass damping", (0.0, 40.0, 41), 0.0, 1e6, symbol="α",
              shown_unit="1/s", swept=True),
    Parameter("beta", "damping.beta", _SECONDS, "Stiffness damping", (0.0002, 0.02, 61), 0.0, 1e3, symbol="β",
              shown_unit="s", **_MOVED),
    Parameter("loss_factor", "damping.loss_factor", Quantity(""), "Factor on the loss factors", (0.25, 3.0, 45),
              0.0, 10.0, symbol="κ", note="factor on the loss factors of all materials", **_MOVED),
    Parameter("storage", "fluid.continuity", Quantity(""), "Flow model (0 quasi-steady, 1 storage)",
              (0.0, 1.0, 21), 0.0, 1.0, note="blend of the flow models, 0 quasi-steady to 1 storage"),
    Parameter("pipe_length", "upstream.length", _METRES, "Length of the pipe upstream", (0.5, 100.0, 41),
              0.0, 1e5, False, symbol="L", shown_unit="m", note="of the line upstream", **_MOVED),
    Parameter("tail_length", "downstream.length", _METRES, "Length of the pipe downstream", (0.5, 100.0, 41),
              0.0, 1e5, False, symbol="L₂", shown_unit="m", note="of the pipe downstream", **_MOVED),
    Parameter("wave_speed", "upstream.wave_speed", Quantity("m/s", "m/s"), "Wave speed in the pipe upstream",
              (100.0, 1400.0, 27), 1.0, 1e7, symbol="c", shown_unit="m/s", note="in an elastic line upstream",
              **_MOVED),
    Parameter("thickness", "valve.thickness_factor", Quantity(""), "Wall thickness factor", (0.6, 1.4, 17),
              0.05, 10.0, note="factor of the wall thickness", **_DESIGNED),
    Parameter("angle", "layers", Quantity("deg", "deg"), "Fibre angle", (20.0, 80.0, 25), 0.0, 90.0,
              shown_unit="degrees", note="of the plies, degrees", **_DESIGNED),
    Parameter("strain", "materials.strain_level", Quantity("", "%"), "Strain level of the rubbers", (0.1, 0.6, 21),
              0.1, 0.6, note="level of the rubbers", **_DESIGNED),
    Parameter("sealing", "valve.sealing_pressure", Quantity("Pa", "kPa", head=True), "Sealing pressure of the bill",
              (200.0, 3000.0, 15), 0.0, 1e7, False, shown_unit="kPa", scale=1e3,
              note="pressure of a bill that is moulded shut", **_DESIGNED),
)
# fmt: on

#: Every parameter by its name.
PARAMETERS = {row.name: row for row in _TABLE}
#: Names of those along which modes are tracked.
SWEPT = tuple(row.name for row in _TABLE if row.swept)
#: Names in `dbvfiv.model.forms.ValveForms` of those of load and surroundings, for which no model is built anew.
SYSTEM_NAMES = tuple(row.system_name for row in _TABLE if not row.design)
#: Names of those that leave the steady state as it is.
SURROUNDINGS = tuple(row.name for row in _TABLE if row.surrounding)
#: Names of those for which the model is built anew.
DESIGN = tuple(row.name for row in _TABLE if row.design)
#: Names of those of the pipes in front of the valve and behind it.
PIPES = tuple(row.name for row in _TABLE if row.key.startswith(("upstream.", "downstream.")))
#: Density of the fluid outside where it is fixed, kg/m3: part of a parameter point, and no parameter to move.
OUTSIDE = "outside"


class Mu(Mapping[str, float]):
    """Parameter point: values in SI units by the names of the table; immutable and hashable. Raises ValueError for a
    name that is not in the table.

    A value reads as an item or an attribute. A parameter that the valve does not have is not held (a pipe that is not
    there, loss factors of an elastic wall), and reads as 0 as an attribute; one of the design is held only where it is
    not the case's own.

    Parameters
    ----------
    values : mapping, optional
    named : float
        Further values by their names.

    Examples
    --------
    >>> mu = Mu(density=1000.0, beta=3e-3)
    >>> mu.at(density=1.2).density, mu["beta"], mu.pipe_length
    (1.2, 0.003, 0.0)
    """

    __slots__ = ("_hash", "_values")

    def __init__(self, values: Mapping[str, float] | None = None, /, **named: float):
        given = {**(values or {}), **named}
        unknown = [name for name in given if name not in PARAMETERS and name != OUTSIDE]
        if unknown:
            raise ValueError(f"{unknown[0]!r} is no parameter; known are {', '.join((*PARAMETERS, OUTSIDE))}.")
        object.__setattr__(self, "_values", {name: float(value) for name, value in given.items()})
        object.__setattr__(self, "_hash", hash(frozenset(self._values.items())))

    @classmethod
    def of(cls, case: Any) -> Mu:
        """Parameter point of a case."""
        fluid, damping = case.fluid, case.damping
        given = {
            "pressure": case.drive.pressure,
            "density": fluid.density,
            "storage": float(fluid.continuity == "storage"),
            "alpha": damping.alpha,
            "beta": damping.beta,
            "loss_factor": damping.loss_factor,
        }
        there = {
            "pipe_length": case.upstream.whole_length if case.has_line else None,
            "tail_length": case.downstream.length if case.has_tail else None,
            "wave_speed": case.upstream.first_wave_speed if case.has_waves else None,
            OUTSIDE: case.outside.fixed_density,
        }
        return cls(given | {name: value for name, value in there.items() if value})

    def at(self, **values: float) -> Mu:
        """Parameter point with some values changed."""
        return Mu(self._values, **values)

    def only(self, *names: str) -> Mu:
        """Part of the parameter point under some names; those not held are left out."""
        return Mu({name: self._values[name] for name in names if name in self._values})

    @property
    def pipes(self) -> dict[str, float]:
        """Parameters of the pipes in front and behind that are held."""
        return {name: self._values[name] for name in PIPES if name in self._values}

    @property
    def damping(self) -> str:
        """Name of the first damping that the wall has, of loss factors, beta and alpha; empty without any."""
        return next((name for name in ("loss_factor", "beta", "alpha") if self._values.get(name, 0.0) > 0), "")

    @property
    def design(self) -> dict[str, float]:
        """Parameters of the design that are not the case's own."""
        return {name: value for name, value in self._values.items() if name in DESIGN}

    def for_system(self) -> dict[str, float]:
        """Parameters by the names of `dbvfiv.model.forms.ValveForms`, 0 for what the valve does not have."""
        own = {PARAMETERS[name].system_name or name: value for name, value in self._values.items() if name != OUTSIDE}
        return dict.fromkeys(SYSTEM_NAMES, 0.0) | own

    def __getitem__(self, name: str) -> float:
        return self._values[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def __getattr__(self, name: str) -> float:
        if name in PARAMETERS or name == OUTSIDE:
            return self._values.get(name, 0.0)
        raise AttributeError(name)

    def __setattr__(self, name: str, value: Any) -> None:
        raise AttributeError("A parameter point does not change; `at` gives another one.")

    def __hash__(self) -> int:
        return self._hash

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Mu) and self._values == other._values

    def __reduce__(self):
        return Mu, (self._values,)

    def __repr__(self) -> str:
        return f"Mu({', '.join(f'{name}={value!r}' for name, value in self._values.items())})"


def listed(names: Iterable[str] = tuple(PARAMETERS), notes: bool = False) -> str:
    """Names as words of a sentence, "pressure, density, alpha or beta"; with what they are where `notes` are asked."""
    words = [
        f"{name} ({PARAMETERS[name].note})" if notes and PARAMETERS[name].note else PARAMETERS[name].name
        for name in names
    ]
    return ", ".join(words[:-1]) + f" or {words[-1]}" if len(words) > 1 else words[0]
