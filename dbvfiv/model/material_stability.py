"""Material stability of the rubber at every layer point of a steady state, long-term and instantaneous."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..materials.law import MOONEY_RIVLIN
from ..materials.stability import stability_margin
from .valve import ValveModel


@dataclass(frozen=True)
class MaterialStability:
    """Least material stability margin over the wall."""

    margin: float
    sentence: str = ""

    @property
    def holds(self) -> bool:
        return self.margin > 0


def material_stability(model: ValveModel, q: np.ndarray, loss_factor: float) -> MaterialStability:
    """Judge the material stability of a state q (n,) with a factor on the loss factors of all materials."""
    shell, section = model.shell, model.shell.section
    strains, each = shell.strains(q), section.points_per_layer
    least, name = np.inf, ""
    for i, layer in enumerate(section.layers):
        if layer.law.kind == MOONEY_RIVLIN:
            margin = float(stability_margin(layer.law, strains[:, :, i * each : (i + 1) * each].reshape(-1, 5)).min())
            if margin < least:
                least, name = margin, layer.name
    return MaterialStability(least, f"The rubber's constants are unstable here: {name}." if least <= 0 else "")
