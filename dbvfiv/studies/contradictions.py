"""Contradictions between keys of a case that are each allowed, found before minutes are spent on it."""

from __future__ import annotations

from collections.abc import Iterator

from ..errors import CaseError
from .case import Case

#: Studies that need a flow at drive.pressure, unless a parameter that they vary is the pressure.
_AT_DRIVE = ("modes", "sweep", "onset", "map", "cycle", "sensitivity")


def contradictions(case: Case, kind: str | None = None) -> Iterator[str]:
    """Sentences on what contradicts what, for a study or for any.

    Parameters
    ----------
    case : Case
    kind : str, optional
        Study that is about to run; what does not concern it is left out.
    """
    if case.drive.kind == "flow" and not case.seeks_operating_point:
        yield from _nothing_flows(case, kind)
    yield from _slivers(case)
    if kind is None:  # a run may ask for less, and says how far it has looked
        yield from _unanswered_rating(case)


def require_consistent(case: Case, kind: str) -> None:
    """Refuse a case whose keys contradict each other for a study.

    Raises
    ------
    CaseError
        With the first contradiction.
    """
    for sentence in contradictions(case, kind):
        raise CaseError(sentence)


def _nothing_flows(case: Case, kind: str | None) -> Iterator[str]:
    """Drive that is not above what the valve discharges into."""
    back, drive = case.downstream.pressure, case.drive.pressure
    behind = f"downstream.pressure = {_pascal(back)}" if back else "0, the pressure downstream"
    if drive <= back and (kind is None or (kind in _AT_DRIVE and not _varies_pressure(case, kind))):
        if not (kind == "modes" and case.modes.in_vacuo):
            yield (
                f"drive.pressure is {_pascal(drive)}, which is not above {behind}, so nothing flows; give the head of "
                "the flow, or use `dbvfiv closure` for a back pressure."
            )
    asked = case.steady_pressures()
    if kind in (None, "steady") and max(asked) <= back and (asked != (drive,) or kind == "steady"):
        yield (
            f"steady.pressures end at {_pascal(max(asked))}, which is not above {behind}, so nothing flows at any of "
            "them."
        )


def _varies_pressure(case: Case, kind: str) -> bool:
    if kind == "map":
        return "pressure" in (axis.parameter for axis in case.map.axes)
    return kind in ("sweep", "onset") and getattr(case, kind).axis.parameter == "pressure"


def _slivers(case: Case) -> Iterator[str]:
    """Pieces of the wall shorter than half their thickness: slips of a drawing, which elements would follow."""
    if case.valve.wall != "measured":
        return
    begin = 0.0
    for i, piece in enumerate(case.valve.wall_map):
        if 0 < piece.to - begin < 0.5 * piece.thickness and begin < case.valve.length:
            yield (
                f"valve.wall_map.{i} is {1e3 * (piece.to - begin):.3g} mm long and {1e3 * piece.thickness:.3g} mm "
                "thick, a sliver that no shell can follow; join it with its neighbour."
            )
        begin = piece.to


def _unanswered_rating(case: Case) -> Iterator[str]:
    """Back pressures that end below the rated one."""
    rated, largest = case.closure.rated_pressure, max(case.closure.pressures)
    if rated is not None and largest < rated:
        yield (
            f"closure.rated_pressure is {_pascal(rated)} and closure.pressures end at {_pascal(largest)}, so whether "
            f'the valve holds would stay open; give -p "{rated / 1e3:g} kPa" or closure.pressures up to it.'
        )


def _pascal(pressure: float) -> str:
    return f"{pressure / 1e3:.4g} kPa"
