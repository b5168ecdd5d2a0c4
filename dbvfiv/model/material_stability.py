"""The rubber of a wall in a state: its material stability, and the strains of its layers as those of tension tests.

The stability is the least margin of the rubbers, slow and instantaneous, and its place.

A place's strain is that of a tension test with the same first invariant. The peak of a layer is what 99 % of its volume
stays below: the last hundredth lies in the fold of the side edge, where it grows with every finer mesh. The mean is
weighted with the energy stored.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from ..case.materials import AUTO
from ..materials.energy import MOONEY_RIVLIN, plane_stress_invariants
from ..materials.stability import principal_log_strains, stability_margin
from .state import SteadyState
from .valve import ValveModel


@dataclass(frozen=True)
class MaterialStability:
    """Worst of all points of rubber in a wall; plies are not judged."""

    pressure: float  #: Of the state, Pa.
    #: Least share of the stiffness at rest that is kept, of the slow and the instantaneous criterion (see
    #: `dbvfiv.materials.stability`); 1 for a wall without rubber.
    margin: float
    material: str  #: Of the layer of that point.
    place: tuple[float, float, float]  #: Its mid-surface point before the wall moves: x, y, z, m.
    share: float  #: Part of the wall's volume whose margin is not positive.
    stretches: tuple[float, float, float]  #: Principal stretches there, ascending; NaN where no sheet has such strains.

    @property
    def holds(self) -> bool:
        """True where the material is stable at every point."""
        return self.margin > 0.0

    @property
    def sentence(self) -> str:
        """The verdict; says what to change where it does not hold."""
        stretches = ", ".join(f"{stretch:.3f}" for stretch in self.stretches)
        x, y, z = self.place
        where = f"at ({x:.3f}, {y:.3f}, {z:.3f}) m, principal stretches {stretches}"
        at = f"at {self.pressure:.6g} Pa"
        if self.holds:
            kept = f"{self.material} keeps {self.margin:.2g} of its stiffness"
            return f"The rubber's constants are stable {at}; {kept} {where}."
        return (
            f"The rubber's constants are unstable here: {at} in {100 * self.share:.2g} % of the wall's volume; the "
            f"least stiffness of {self.material} is {self.margin:.2g} of that at rest {where}; take "
            'materials.constants = "stable", another strain level, or constants from `dbvfiv fit`.'
        )


def material_stability(
    model: ValveModel, q: np.ndarray, pressure: float, loss_factor: float | None = None
) -> MaterialStability:
    """Judge the rubber of a wall in a steady state.

    Parameters
    ----------
    q : (n,) array
        Its displacements.
    pressure : float
        Of the state, Pa.
    loss_factor : float, optional
        Factor on the loss factors of all layers; that of the case without it.
    """
    factor = model.case.damping.loss_factor if loss_factor is None else loss_factor
    shell, section = model.shell, model.shell.section
    strains, volume = shell.strains(q), shell.point_volumes
    margins = np.ones(strains.shape[:-1])
    for i, layer in enumerate(section.layers):
        if layer.law.kind == MOONEY_RIVLIN:
            own = slice(i * section.points_per_layer, (i + 1) * section.points_per_layer)
            margins[:, :, own] = stability_margin(layer.law, strains[:, :, own], _instantaneous(layer, factor))
    element, gauss, point = np.unravel_index(np.argmin(margins), margins.shape)
    logs = principal_log_strains(strains[element, gauss, point])
    return MaterialStability(
        pressure=pressure,
        margin=float(margins[element, gauss, point]),
        material=section.layers[point // section.points_per_layer].name,
        place=tuple(float(x) for x in shell.geometry.position[element, gauss]),
        share=float(volume[margins <= 0.0].sum() / volume.sum()),
        stretches=tuple(float(stretch) for stretch in np.exp(logs)),
    )


def _instantaneous(layer, loss_factor: float) -> float:
    """Instantaneous tangent over the slow one of a layer, with a factor on its loss factors."""
    return 1.0 if layer.relaxation is None else 1.0 + sum(layer.relaxation.scaled(loss_factor).strengths)


#: Share of a layer's volume that strains less than its peak.
PEAK = 0.99
#: Strain beyond a settled level that is worth a word.
_BEYOND = 0.03


@dataclass(frozen=True)
class LayerLevel:
    """A layer of rubber at one state."""

    number: int  #: From inside to outside, from 1.
    material: str
    level: float  #: Strain level whose constants it has; NaN of rubbers that have no levels.
    peak: float  #: Strain that `PEAK` of its volume does not reach: the next level.
    mean: float  #: Mean strain, weighted with the energy stored.


def layer_levels(model: ValveModel, q: np.ndarray, levels: Mapping[str, float]) -> Iterator[LayerLevel]:
    """Strains of the layers of rubber at displacements."""
    shell, section = model.shell, model.shell.section
    strains, each = shell.strains(q), section.points_per_layer
    volume = shell.point_volumes
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
    """Sentences on rubbers that strain beyond their levels where these are settled (materials.strain_level = "auto"),
    or told for some of them in tables.
    """
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
            f"{100 * levels[name]:.3g} %, which the case gives or which settled at the largest pressures that it "
            f"names; give a higher strain_level of {name}, or drive.pressure or steady.pressures in the case as high "
            "as the valve is to go."
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
