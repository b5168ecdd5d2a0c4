"""Strains of the layers of rubber, as those of tension tests.

A place's strain is that of a tension test with the same first invariant. The peak of a layer is what 99 % of its volume
stays below: the last hundredth lies in the fold of the side edge, where it grows with every finer mesh. The mean is
weighted with the energy stored.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from ..case.materials import AUTO
from ..materials.law import MOONEY_RIVLIN, plane_stress_invariants
from .state import SteadyState
from .valve import ValveModel

#: Share of a layer's volume that strains less than its peak.
PEAK = 0.99
#: Strain beyond a settled level that is worth a word.
_BEYOND = 0.03


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


def layer_levels(model: ValveModel, q: np.ndarray, levels: Mapping[str, float]) -> Iterator[LayerLevel]:
    """Strains of the layers of rubber at displacements."""
    shell, section = model.shell, model.shell.section
    strains, each = shell.strains(q), section.points_per_layer
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


def beyond_levels(model: ValveModel, states: Iterable[SteadyState]) -> Iterator[str]:
    """Sentences on rubbers that strain beyond levels that were settled (materials.strain_level = "auto")."""
    materials = model.case.materials
    levels = materials.levels({layer.material for layer in model.case.layers})
    worst: dict[str, tuple[float, float]] = {}
    for state in states if materials.strain_level == AUTO else ():
        for layer in layer_levels(model, state.q, levels):
            if layer.peak > max(layer.level + _BEYOND, worst.get(layer.material, (0.0, 0.0))[0]):
                worst[layer.material] = layer.peak, state.pressure
    for name, (peak, pressure) in worst.items():
        yield (
            f"{name} strains by up to {100 * peak:.3g} % at {pressure:.6g} Pa and has the constants of "
            f"{100 * levels[name]:.3g} %, settled at the largest pressures that the case names; give drive.pressure or "
            "steady.pressures in the case as high as the valve is to go."
        )


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
