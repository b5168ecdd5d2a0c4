"""Part of the report on the limit cycle that the vibration grows into."""

from __future__ import annotations

from ...case.parameters import PARAMETERS, Mu
from ..content import Part, Table, pictures_of
from ..gather import Gathered
from .missing import said_by

TITLE = "What it grows into"
_CAPTIONS = {
    "branch": "Amplitude and frequency of the cycle; dashed where it is unstable.",
    "envelope": "Between which displacements the lip moves.",
    "centre-line-cycle": "The middle of the wide side over a cycle.",
}


def part(found: Gathered) -> Part | None:
    """The limit cycle from its onset to this state; nothing where the state is stable."""
    result = found.cycle
    if result is None or not result.points:
        why = found.missing.get("cycle", "The branch ended before its first cycle was found.")
        return None if "cycle" in found.not_asked else Part("cycle", TITLE, (f"There is no result. {why}",))
    row = PARAMETERS[result.parameter]
    rows = tuple(
        (
            f"{p.value / row.scale:.5g}",
            f"{1e3 * p.amplitude:.4g}",
            f"{p.frequency:.5g}",
            f"{1e3 * p.lip_least:.3g} to {1e3 * p.lip_largest:.3g}",
            {True: "yes", False: "no", None: "not asked"}[p.stable],
        )
        for p in result.points
    )
    head = (
        f"{row.title}, {row.shown_unit}".rstrip(", "),
        "amplitude of a lip, mm",
        "frequency, Hz",
        "lip from .. to, mm",
        "stable",
    )
    trust = (*result.remarks(), *said_by(result))
    return Part("cycle", TITLE, cycles(found), (Table(head, rows),), pictures_of(result, _CAPTIONS), trust)


def cycles(found: Gathered) -> tuple[str, ...]:
    """The cycle at this state, in a sentence."""
    result = found.cycle
    if result is None or not result.points:
        return ()
    row, here = PARAMETERS[result.parameter], Mu.of(found.case)[result.parameter]
    point = result.nearest(here)
    if abs(point.value - here) > 1e-6 * abs(here):
        return (
            f"Its limit cycle was followed to {row.text(point.value)} and not to {row.text(here)}: {result.reason}.",
        )
    kind = {True: "A stable", False: "An unstable", None: "A"}[point.stable]
    size = f"{1e3 * point.amplitude:.3g} mm of each lip, half its swing"
    return (f"{kind} limit cycle of {size}, at {point.frequency:.4g} Hz.",)
