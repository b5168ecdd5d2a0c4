"""A steady state as results hold it: what a user reads off it, its shape, its layers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .layout import TEXT, Column

if TYPE_CHECKING:
    from ..model import ValveModel
    from ..studies.state import SteadyState
    from .modes import ModesResults
    from .steady import SteadyResults
    from .sweep import SweepResults

#: What a user reads off a state; the names are the keys of the JSON output.
SUMMARY = (
    Column("pressure", "Pa", "Static pressure at the flange, over that of the surroundings"),
    Column("head", "m", "The same as a head of the fluid"),
    Column("mass_flow", "kg/s", "Mass flow of the whole valve"),
    Column("volume_flow", "m^3/s", "Volume flow of the whole valve"),
    Column("outlet_area", "m^2", "Flow area at the lip, whole valve"),
    Column("outlet_velocity", "m/s", "Jet velocity at the lip"),
    Column("max_displacement", "m", "Largest displacement of the mid-surface"),
    Column("max_displacement_position", "m", "Where it occurs, position at rest"),
    Column("lip_opening", "m", "Full clear opening between the inner faces of both lips at x = z = 0"),
    Column("lip_displacement", "m", "Displacement in y of the mid-surface of one lip at x = z = 0"),
    Column("stops", "", "Lip stops in contact", "i8"),
    Column("converged", "", "Whether the residual fell below the tolerance", "bool"),
    Column("iterations", "", "Newton iterations over all load steps that led here", "i8"),
    Column("load_steps", "", "Load steps that led here", "i8"),
    Column("residual", "", "Unbalanced force over pressure force"),
    Column("rounding", "", "Relative residual that rounding alone explains"),
    Column("reason", "", "Why the iteration ended", TEXT),
)
#: Fields of a state.
FIELDS = (
    Column("nodal", "m, rad", "Displacements ux uy uz and two rotations of each node"),
    Column("station_area", "m^2", "Flow area of a quarter at each row"),
    Column("station_velocity", "m/s", "Velocity at each row"),
    Column("station_pressure", "Pa", "Static pressure at each row"),
)
#: Layers, inside to outside, in their own axes.
LAYERS = (
    Column("layers/strain", "", "Green-Lagrange strain E11 E22 2E12 2E13 2E23, element mean"),
    Column("layers/stress", "Pa", "Second Piola-Kirchhoff stress S11 S22 S12 S13 S23, element mean"),
    Column("layers/von_mises", "Pa", "Von Mises value of the Cauchy stress, largest in the element"),
    Column("layers/stretch", "", "Smallest and largest principal stretch in the plane of the layer"),
)


@dataclass(frozen=True)
class LayerData:
    """Element values of each layer, inside to outside; see `dbvfiv.shell.recovery`.

    Attributes
    ----------
    names : tuple of str
    strain : (ne, nl, 5)
    stress : (ne, nl, 5) Pa
    von_mises : (ne, nl) Pa
    stretch : (ne, nl, 2)
    """

    names: tuple[str, ...]
    strain: np.ndarray
    stress: np.ndarray
    von_mises: np.ndarray
    stretch: np.ndarray


def layers_of(model: ValveModel, q: np.ndarray) -> LayerData:
    """Strains and stresses of a state (n,) of a model."""
    from ..shell.recovery import layer_fields

    return LayerData(**vars(layer_fields(model.shell, q)))


@dataclass(frozen=True, eq=False)
class State:
    """An equilibrium; flow and areas are those of the whole valve, station data those of a quarter.

    Attributes
    ----------
    pressure : float, Pa
        Static, at the flange.
    head : float, m
        The same as a head of the fluid.
    mass_flow : float, kg/s
    volume_flow : float, m3/s
    outlet_area : float, m2
    outlet_velocity : float, m/s
    max_displacement : float, m
    max_displacement_position : (3,) tuple, m, at rest
    lip_opening, lip_displacement : float, m
        Full clear opening between the lips, and displacement of one of them, at x = z = 0.
    stops, converged, iterations, load_steps, residual, rounding, reason
        See `dbvfiv.studies.state.SteadyState`.
    nodal : (nn, 5) m and rad
    station_area, station_velocity, station_pressure : (m,) m2, m/s, Pa
    results : SteadyResults
        The run it belongs to.

    Examples
    --------
    >>> state = dbvfiv.load().steady(pressure=36e3)     # doctest: +SKIP
    >>> state.mass_flow, state.layers.von_mises.max()   # doctest: +SKIP
    """

    pressure: float
    head: float
    mass_flow: float
    volume_flow: float
    outlet_area: float
    outlet_velocity: float
    max_displacement: float
    max_displacement_position: tuple[float, float, float]
    lip_opening: float
    lip_displacement: float
    stops: int
    converged: bool
    iterations: int
    load_steps: int
    residual: float
    rounding: float
    reason: str
    nodal: np.ndarray = field(repr=False)
    station_area: np.ndarray = field(repr=False)
    station_velocity: np.ndarray = field(repr=False)
    station_pressure: np.ndarray = field(repr=False)
    results: SteadyResults = field(repr=False)
    _read_layers: Callable[[], LayerData] = field(repr=False)

    @cached_property
    def layers(self) -> LayerData:
        """Strains and stresses of the layers."""
        return self._read_layers()

    @property
    def model(self) -> ValveModel:
        """The coupled model it is a state of."""
        return self.results.model

    @cached_property
    def q(self) -> np.ndarray:
        """Free unknowns (n,) of the model."""
        return self.model.shell.dofs.restrict(self.nodal)

    def solution(self) -> SteadyState:
        """The state as studies take it, to start from for instance."""
        from ..studies.state import SteadyState

        fields = [c.name for c in SUMMARY] + [c.name for c in FIELDS if c.name != "nodal"]
        return SteadyState(q=self.q, **{name: getattr(self, name) for name in fields})

    def summary(self) -> dict[str, Any]:
        """Plain SI numbers for JSON."""
        return {c.name: _plain(getattr(self, c.name)) for c in SUMMARY}

    def modes(
        self, *, count: int | None = None, output: str | Path | None = None, observer: Any = None, **changes: Any
    ) -> ModesResults:
        """Leading modes of this state; fluid and damping may differ from those it was found with, see
        `dbvfiv.api.Valve.modes`.

        Examples
        --------
        >>> state.modes(density=1.2, alpha=0).plot("figures")     # doctest: +SKIP
        """
        from ..api_modes import changed, modes_of

        return modes_of(changed(self._valve(), changes, {"modes.count": count}), self, output, observer)

    def sweep(
        self,
        over: str | None = None,
        *,
        count: int | None = None,
        output: str | Path | None = None,
        observer: Any = None,
        **changes: Any,
    ) -> SweepResults:
        """Modes of this state tracked along density, alpha or beta, such as "density=1:1000:40:log"; see
        `dbvfiv.api.Valve.sweep`.
        """
        from ..api_modes import changed, sweep_of

        return sweep_of(
            changed(self._valve(), changes, {"sweep.over": over, "sweep.count": count}), self, output, observer
        )

    def _valve(self):
        from ..api import Valve

        header = self.results.header
        return Valve(header.rebuildable_case().replace({"drive.pressure": self.pressure}), header.name)

    def plot(self, folder: str | Path = ".", format: str = "png") -> list[Path]:
        """Write the figures of this state alone."""
        return self.results.only(self).plot(folder, format)

    def save(self, path: str | Path) -> Path:
        """Write a result file with this state alone."""
        return self.results.only(self).save(path)

    def export(self, path: str | Path, quarter: bool = False, deformed: bool = False) -> Path:
        """Write this state for ParaView."""
        return self.results.only(self).export(path, quarter, deformed)


def _plain(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value
