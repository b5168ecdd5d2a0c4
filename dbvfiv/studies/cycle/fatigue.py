"""Ranges of strain and stress in each layer over a period, for fatigue."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...shell.recovery import layer_fields
from ..orbits.orbit import Orbit

#: Instants of a period at which layers are looked at.
INSTANTS = 16


@dataclass(frozen=True, eq=False)
class LayerRanges:
    """Ranges over a period, of element values as `dbvfiv.shell.recovery.LayerFields` has them.

    Attributes
    ----------
    names : tuple of str
        Layers, inside to outside.
    strain : (ne, nl) array
        Largest range of the five strains in the layer's axes.
    stress : (ne, nl) array, Pa
        Largest range of the five stresses there.
    von_mises : (ne, nl) array, Pa
        Largest von Mises stress of the period.
    place : (ne, 3) array, m
        Middles of the elements, at rest.
    """

    names: tuple[str, ...]
    strain: np.ndarray
    stress: np.ndarray
    von_mises: np.ndarray
    place: np.ndarray

    def largest(self) -> list[dict[str, Any]]:
        """Largest ranges of strain and of stress of each layer, and their positions."""
        found = []
        for number, name in enumerate(self.names):
            strain, stress = self.strain[:, number], self.stress[:, number]
            at_strain, at_stress = int(np.argmax(strain)), int(np.argmax(stress))
            found.append(
                {
                    "layer": name,
                    "strain_range": float(strain[at_strain]),
                    "strain_position": self.place[at_strain].tolist(),
                    "stress_range": float(stress[at_stress]),
                    "stress_position": self.place[at_stress].tolist(),
                    "largest_von_mises": float(self.von_mises[:, number].max()),
                }
            )
        return found


def layer_ranges(orbit: Orbit) -> LayerRanges:
    """Ranges of strain and stress of a cycle."""
    shell, size = orbit.model.shell, orbit.model.size
    phases = 2 * np.pi * np.arange(INSTANTS) / INSTANTS
    fields = [layer_fields(shell, q) for q in orbit.motion.at(phases)[:, :size]]
    strain, stress = (np.stack([getattr(field, name) for field in fields]) for name in ("strain", "stress"))
    return LayerRanges(
        fields[0].names,
        np.ptp(strain, axis=0).max(axis=-1),
        np.ptp(stress, axis=0).max(axis=-1),
        np.max([field.von_mises for field in fields], axis=0),
        shell.mesh.nodes[shell.mesh.quads].mean(axis=1),
    )
