"""Strains and stresses of the layers, against what their constants were made for."""

from __future__ import annotations

import numpy as np

from ...drawing.layers import layer_stress
from ...materials.library import law_from_case
from ...materials.stability import StableRange, stable_range
from ..content import Part, Table, picture
from ..gather import Gathered

TITLE = "Strains and stresses in the layers"


def part(found: Gathered) -> Part | None:
    """Largest strains of each layer at the driving pressure and at the highest one computed."""
    result = found.steady
    if result is None or not result.states:
        return None
    state = result.nearest(found.case.drive.pressure)
    highest = max(result.states, key=lambda s: s.pressure)
    levels = found.case.materials.levels({layer.material for layer in found.case.layers})
    rows = []
    for i, name in enumerate(state.layers.names):
        law = law_from_case(found.case, found.case.layers[i].material)
        rows.append((str(i + 1), name, *_of(state, i), *_of(highest, i), _range(stable_range(law))))
    at, top = (f"{s.pressure / 1e3:.4g} kPa" for s in (state, highest))
    head = (
        "layer",
        "material",
        f"stretch at {at}",
        "stress, MPa",
        f"stretch at {top}",
        "stress, MPa",
        "stable stretch, uniaxial",
    )
    told = ", ".join(f"{name} {100 * level:.3g} %" for name, level in levels.items())
    at_levels = f"Rubber constants of the strain levels {told}. " if levels else ""
    sentences = (
        f"{at_levels}Stretches are the smallest and the largest in the plane of a "
        "layer; stresses are von Mises values of the Cauchy stress, the largest in any element. The last column says "
        "between which stretches the constants describe a stable material in tension and compression along one "
        "direction.",
    )
    caption = f"Von Mises stress of the layers at {at}, the wall unrolled."
    return Part(
        "strains",
        TITLE,
        sentences,
        (Table(head, tuple(rows)),),
        (picture("layer-stress", caption, lambda: layer_stress(state)),),
    )


def _of(state, layer: int) -> tuple[str, str]:
    stretch, stress = state.layers.stretch[:, layer], state.layers.von_mises[:, layer]
    return f"{stretch[:, 0].min():.3f} to {stretch[:, 1].max():.3f}", f"{stress.max() / 1e6:.3g}"


def _range(limits: StableRange) -> str:
    low, high = limits.uniaxial
    if low == 0.0 and not np.isfinite(high):
        return "all"
    return f"{low:.3f} to {high:.3f}" if np.isfinite(high) else f"from {low:.3f}"
