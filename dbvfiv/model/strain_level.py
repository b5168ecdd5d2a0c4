"""Strain levels of the built-in rubbers that agree with the strains their layers see.

The constants of a tested rubber hold up to the strain they were fitted over, so the level is a guess of the strain that
occurs (Eq. 7.1 guesses it for all rubbers from the arc of the lip). Here it is found: with the constants of a level the
valve is solved, what its layers strain is the next level, until both agree.

A place's strain is that of a tension test with the same first invariant. As Eq. 7.1 asks for the largest strain, the
next level of a rubber is what 99 % of the volume of its layer stays below: the last hundredth lies in the fold of the
side edge, where it grows with every finer mesh. The mean that is reported too is weighted with the energy stored.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from ..case.materials import HIGHEST_LEVEL, LOWEST_LEVEL, RUBBERS
from ..case.model import Case
from ..errors import SolveError
from ..materials.incompressible import plane_stress_invariants
from ..materials.law import MOONEY_RIVLIN
from ..observer import Observer
from .equilibria import LoadPath, SteadyOptions
from .state import SteadyState
from .valve import ValveModel

#: Change of a level from one round to the next that counts as agreement, and rounds before giving up.
AGREED, ROUNDS = 1e-4, 40
#: Share of a layer's volume that strains less than its peak.
PEAK = 0.99


@dataclass(frozen=True)
class LayerLevel:
    """A layer of rubber at one state.

    Attributes
    ----------
    number : int
        From inside to outside, from 1.
    material : str
    level : float
        Strain level whose constants it has; NaN of rubbers that have no levels.
    peak : float
        Strain that `PEAK` of its volume does not reach: the next level.
    mean : float
        Mean strain, weighted with the energy stored.
    """

    number: int
    material: str
    level: float
    peak: float
    mean: float


@dataclass(frozen=True)
class AgreedLevels:
    """Levels that agree with a state.

    Attributes
    ----------
    case : Case
        With the constants of these levels.
    state : SteadyState
    layers : tuple of LayerLevel
    rounds : int
    """

    case: Case
    state: SteadyState
    layers: tuple[LayerLevel, ...]
    rounds: int

    @property
    def levels(self) -> dict[str, float]:
        """Level of each rubber."""
        return {layer.material: layer.level for layer in self.layers if np.isfinite(layer.level)}

    def bounded(self) -> Iterator[str]:
        """Sentences on rubbers whose strain lies beyond the tested levels."""
        for name, level in self.levels.items():
            peak = max(layer.peak for layer in self.layers if layer.material == name)
            if level in (LOWEST_LEVEL, HIGHEST_LEVEL):
                yield (
                    f"{name} strains by up to {100 * peak:.3g} % at {self.state.pressure:.6g} Pa, and its tests go "
                    f"from {100 * LOWEST_LEVEL:g} to {100 * HIGHEST_LEVEL:g} %: it has the constants of "
                    f"{100 * level:g} %."
                )


def agree_levels(
    case: Case, pressure: float, observer: Observer | None = None, first: Mapping[str, float] | None = None
) -> AgreedLevels:
    """Levels of the built-in rubbers in the layers of a case that agree with its steady state at a pressure, Pa.

    Parameters
    ----------
    case : Case
    pressure : float, Pa
    observer : Observer, optional
    first : mapping of str to float, optional
        Levels of the first round by rubber; the lowest tested ones without it.

    Raises
    ------
    SolveError
        If a state is not reached, or the levels do not settle.
    """
    observer = Observer() if observer is None else observer
    names = [name for name in RUBBERS if case.materials.is_built_in(name) and name in {x.material for x in case.layers}]
    levels = {name: (first or {}).get(name, LOWEST_LEVEL) for name in names}
    shape = None
    for count in range(1, ROUNDS + 1):
        found = case.replace(case.materials.at_levels(levels))
        model = ValveModel(found)
        state = _solve(model, pressure, shape, observer)
        layers = tuple(layer_levels(model, state, levels))
        own = _next_levels(layers, names)
        observer.progress(f"strain levels, round {count}: " + ", ".join(f"{n} {100 * x:.4g} %" for n, x in own.items()))
        if all(abs(own[name] - levels[name]) <= AGREED for name in names):
            return AgreedLevels(found, state, layers, count)
        levels, shape = own, state
    raise SolveError(
        f"The strain levels at {pressure:.6g} Pa did not settle in {ROUNDS} rounds: the last ones were "
        f"{', '.join(f'{name} {100 * x:.4g} %' for name, x in levels.items())}."
    )


def _solve(model: ValveModel, pressure: float, shape: SteadyState | None, observer: Observer) -> SteadyState:
    """The state at a pressure, from one of other constants where that serves."""
    options = SteadyOptions.of(model.case)
    if shape is not None:
        path = LoadPath(model, options, observer=observer)
        path.q, path.pressure = shape.q, shape.pressure
        try:
            path.settle()
            return path.go_to(pressure)
        except SolveError:
            pass
    return LoadPath(model, options, observer=observer).go_to(pressure)


def layer_levels(model: ValveModel, state: SteadyState, levels: dict[str, float]) -> Iterator[LayerLevel]:
    """Strains of the layers of rubber at a state."""
    shell, section = model.shell, model.shell.section
    strains, each = shell.strains(state.q), section.points_per_layer
    weights = shell.at_rest.points[..., 1]
    weights = weights if weights.ndim == 1 else weights[:, None]
    volume = (shell.geometry.thickness[:, None] * shell.geometry.area)[:, :, None] * weights
    for i, layer in enumerate(section.layers):
        if layer.law.kind != MOONEY_RIVLIN:
            continue
        own = slice(i * each, (i + 1) * each)
        e = np.moveaxis(strains[:, :, own], -1, 0)
        strain = tension_of(plane_stress_invariants(e).i1_minus_3)
        energy = np.maximum(layer.law.energy(e), 0.0) * volume[:, :, own]
        mean = float(np.average(strain, weights=energy)) if energy.sum() > 0 else 0.0
        order = np.argsort(strain, axis=None)
        filled = np.cumsum(volume[:, :, own].ravel()[order])
        peak = float(strain.ravel()[order][np.searchsorted(filled, PEAK * filled[-1])])
        yield LayerLevel(i + 1, layer.name, levels.get(layer.name, np.nan), peak, mean)


def _next_levels(layers: tuple[LayerLevel, ...], names: list[str]) -> dict[str, float]:
    """Next level of each rubber: the largest peak of its layers, as far as the tests go."""
    return {
        name: float(np.clip(max(x.peak for x in layers if x.material == name), LOWEST_LEVEL, HIGHEST_LEVEL))
        for name in names
    }


def tension_of(i1_minus_3: np.ndarray) -> np.ndarray:
    """Engineering strain of the tension test with a first invariant: the root of stretch^2 + 2/stretch = I1 above 1.

    Examples
    --------
    >>> stretch = 1.25
    >>> round(float(tension_of(stretch**2 + 2 / stretch - 3)), 12)
    0.25
    """
    excess = np.maximum(i1_minus_3, 0.0)
    i1 = 3.0 + excess
    stretch = 2.0 * np.sqrt(i1 / 3.0) * np.cos(np.arccos(-((3.0 / i1) ** 1.5)) / 3.0)
    strain = np.where(excess < 1e-4, np.sqrt(excess / 3.0), stretch - 1.0)  # the cosine loses half the digits near rest
    for _ in range(2):
        rest = strain**2 * (3.0 + strain) / (1.0 + strain) - excess
        slope = 2.0 * (1.0 + strain) - 2.0 / (1.0 + strain) ** 2
        strain = strain - np.divide(rest, slope, out=np.zeros_like(rest), where=slope > 0)
    return np.maximum(strain, 0.0)
