"""Part of the report on hydraulics: opening, flow and head loss."""

from __future__ import annotations

from ...record.states import shown_summary
from .. import live
from ..content import Part, Table, pictures_of
from ..gather import Gathered
from .missing import not_there, said_by

TITLE = "Opening and flow"
_CAPTIONS = {
    "head-discharge": "Pressure over flow; points on a screen answer to the pointer.",
    "area-pressure": "Area at the lip over the pressure, with what was measured.",
    "operating-point": "Where valve, line and pump meet.",
    "passage": "Area, velocity and pressure along the passage.",
    "lip-shapes": "Inner and outer face of the lip.",
    "centre-line": "The wall in the middle of the wide side.",
    "measured-sections": "Sections of the wall as measured and as computed.",
    "measured-centre-line": "The wall in the middle of the wide side, as measured and as computed.",
}


def part(found: Gathered) -> Part:
    """Hydraulics at the driving pressure, and over all pressures."""
    result = found.steady
    if result is None or not result.states:
        return not_there(found, "steady", TITLE)
    state = result.nearest(found.case.drive.pressure)
    columns = shown_summary(found.case)
    shown = [c for c in columns if c.shown is not None and c.name not in ("iterations", "residual")]
    head = tuple(", ".join(p for p in (c.shown.title, c.shown.unit) if p) for c in shown)
    states = sorted(result.states, key=lambda s: s.pressure)
    table = Table(head, tuple(tuple(c.shown.write(s) for c in shown) for s in states))
    worst = max(s.residual for s in result.states)
    trust = (
        f"Equilibrium of all {len(states)} states: unbalanced forces at most {worst:.1e} of the pressure forces, on "
        f"{found.case.mesh.around} x {found.case.mesh.along} elements.",
        *said_by(result),
    )
    pictures = pictures_of(result, _CAPTIONS, {"head-discharge": live.discharge(result, state)})
    return Part("steady", TITLE, opening(found), (table,), pictures, trust, tuple(result.remarks()))


def opening(found: Gathered) -> tuple[str, ...]:
    """Sentence on the flow and the opening at the driving pressure."""
    result = found.steady
    if result is None or not result.states:
        return ()
    state = result.nearest(found.case.drive.pressure)
    return (
        f"At {state.pressure / 1e3:.4g} kPa ({state.head:.3g} m of the fluid) {state.volume_flow * 1e3:.4g} L/s flow "
        f"({state.mass_flow:.4g} kg/s), through lips that stand {state.lip_opening * 1e3:.3g} mm open.",
    )
