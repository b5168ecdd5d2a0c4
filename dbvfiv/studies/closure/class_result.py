"""Buckling into classes of motion that the path does not have, as a record holds it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ...model.symmetry import EQUILIBRIA, symmetry_named
from ...record.record import Record

#: Kinds of notes: lowest eigenvalues of one equilibrium, and a state that buckles.
LOWEST, BUCKLED_CLASS = "class stiffness", "class buckling"


@dataclass(frozen=True)
class ClassBuckling:
    """Buckling of the wall in one symmetry class.

    Attributes
    ----------
    symmetry : str
    pressures, lowest : tuples of float, Pa, 1/s2
        Lowest stiffness eigenvalue along the path.
    buckling : tuple of dict
        kind, pressure, eigenvalue of the states that buckle, by pressure.
    """

    symmetry: str
    pressures: tuple[float, ...]
    lowest: tuple[float, ...]
    buckling: tuple[dict[str, Any], ...]

    @property
    def critical_pressure(self) -> float | None:
        """Lowest pressure, Pa, at which the wall buckles in this class."""
        return min((found["pressure"] for found in self.buckling), default=None)

    def summary(self) -> dict[str, Any]:
        """Plain numbers for JSON."""
        softest = min(range(len(self.lowest)), key=self.lowest.__getitem__)
        return {
            "symmetry": self.symmetry,
            "motion": symmetry_named(self.symmetry).words,
            "buckling": list(self.buckling),
            "critical_pressure": self.critical_pressure,
            "softest": {"pressure": self.pressures[softest], "lowest_stiffness_eigenvalue": self.lowest[softest]},
            "path": {"pressure": list(self.pressures), "lowest_eigenvalue": list(self.lowest)},
        }

    @property
    def sentence(self) -> str:
        """Sentence on buckling in the class, or on its least stiffness."""
        motion = f"class {self.symmetry} ({symmetry_named(self.symmetry).words})"
        if self.buckling:
            return f"Buckling in {motion} at {self.critical_pressure / 1e3:.6g} kPa."
        softest = min(range(len(self.lowest)), key=self.lowest.__getitem__)
        share = self.lowest[softest] / self.lowest[0]
        return (
            f"No buckling in {motion} up to {max(self.pressures) / 1e3:.4g} kPa; the stiffness is least at "
            f"{self.pressures[softest] / 1e3:.4g} kPa, {share:.0%} of that at the start."
        )


def read_classes(record: Record, table: str) -> tuple[ClassBuckling, ...]:
    """Classes of the walk whose points are kept in a table; none where they were not asked for."""
    seen = {note["pressure"]: note["lowest"] for note in record.notes(LOWEST) if note["table"] == table}
    keys = ("kind", "pressure", "eigenvalue")
    buckled = {
        (note["symmetry"], round(note["pressure"], 3)): {key: note[key] for key in keys}
        for note in record.notes(BUCKLED_CLASS)
        if note["table"] == table
    }
    found = []
    for name in next(iter(seen.values()), ()):
        pressures = sorted(seen)
        lowest = tuple(seen[p][name] for p in pressures)
        own = sorted((b for (symmetry, _), b in buckled.items() if symmetry == name), key=lambda b: b["pressure"])
        found.append(ClassBuckling(name, tuple(pressures), lowest, tuple(own)))
    return tuple(found)


def first_buckling(
    critical: float | None, classes: tuple[ClassBuckling, ...], own: str = EQUILIBRIA
) -> dict[str, Any] | None:
    """Lowest pressure at which the wall buckles in any class, Pa, and the class; `critical` is that of the path, whose
    class is `own`.
    """
    found = [(c.critical_pressure, c.symmetry) for c in classes if c.critical_pressure is not None]
    found += [] if critical is None else [(critical, own)]
    pressure, name = min(found, default=(None, None))
    return None if pressure is None else {"pressure": pressure, "symmetry": name}
