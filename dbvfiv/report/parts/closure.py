"""Part of the report on closure: back pressure at which the valve shuts, and its margins."""

from __future__ import annotations

from ..content import Part, Table, pictures_of
from ..gather import Gathered
from .missing import not_there, said_by

TITLE = "Shutting under back pressure"
_CAPTIONS = {
    "closure-curve": "How the passage shuts as the back pressure rises.",
    "side-views": "The shut valve from the side.",
    "contact-map": "Where the faces meet.",
    "measured-passage": "The passage left, as measured and as computed.",
    "measured-sections": "Sections of the wall as measured and as computed.",
    "measured-centre-line": "The wall in the middle of the wide side, as measured and as computed.",
    "buckling-shape": "The shape into which the wall buckles.",
}


def part(found: Gathered) -> Part:
    """States under back pressure."""
    result = found.closure
    if result is None or not result.states:
        return not_there(found, "closure", TITLE)
    rows = tuple(
        (
            f"{s.pressure / 1e3:.4g}",
            "yes" if s.closed else "no",
            f"{s.sealed_length * 1e3:.4g}",
            f"{s.contact_force:.4g}",
            f"{s.max_displacement * 1e3:.4g}",
        )
        for s in result.states
    )
    head = ("back pressure, kPa", "shut", "sealed length, mm", "contact force, N", "largest displacement, mm")
    return Part(
        "closure",
        TITLE,
        shutting(found),
        (Table(head, rows),),
        pictures_of(result, _CAPTIONS),
        (*result.remarks(), *said_by(result)),
    )


def shutting(found: Gathered) -> tuple[str, ...]:
    """Sentence on closure: whether the valve shuts under the largest back pressure computed."""
    result = found.closure
    if result is None or not result.states:
        return ()
    last = max(result.states, key=lambda s: s.pressure)
    how = "shuts" if last.closed else "does not shut"
    sentence = (
        f"Under {last.pressure / 1e3:.4g} kPa of back pressure it {how}, sealed over {last.sealed_length * 1e3:.3g} mm."
    )
    return (sentence,) if result.safety is None else (sentence, result.safety.sentence)
