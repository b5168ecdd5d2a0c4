"""Material stability of a wall in a state: the least margin of its rubbers, slow and instantaneous, and its place."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..materials.law import MOONEY_RIVLIN
from ..materials.stability import principal_log_strains, stability_margin
from .valve import ValveModel


@dataclass(frozen=True)
class MaterialStability:
    """Worst of all points of rubber in a wall; plies are not judged.

    Attributes
    ----------
    pressure : float
        Of the state, Pa.
    margin : float
        Least share of the stiffness at rest that is kept, of the slow and the instantaneous criterion (see
        `dbvfiv.materials.stability`); 1 for a wall without rubber.
    material : str
        Of the layer of that point.
    place : tuple of float
        Its mid-surface point before the wall moves: x, y, z, m.
    share : float
        Part of the wall's volume whose margin is not positive.
    stretches : tuple of float
        Principal stretches there, ascending; NaN where no sheet has such strains.
    """

    pressure: float
    margin: float
    material: str
    place: tuple[float, float, float]
    share: float
    stretches: tuple[float, float, float]

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
    model : ValveModel
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
