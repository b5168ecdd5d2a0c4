"""The parts of a report, in the order they are read; each makes a `Part` from what was gathered, or nothing."""

from . import closure, cycle, damping, hydraulics, strains, valve, vibration

#: Functions from `Gathered` to a `Part`, or to None where there is nothing to say.
PARTS = (
    valve.part,
    hydraulics.part,
    vibration.modes,
    vibration.classes,
    damping.part,
    vibration.onset,
    vibration.map,
    cycle.part,
    closure.part,
    strains.part,
)

__all__ = ["PARTS"]
