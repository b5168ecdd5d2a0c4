"""Both continuity laws side by side: which the other one is, and what is said where they disagree."""

from __future__ import annotations

from collections.abc import Iterable

from ...errors import CaseError
from ..case import Case

QUASI_STEADY, STORAGE = "quasi-steady", "storage"
_WHY = (
    "storage conserves volume under moving walls (what they displace has to go somewhere) and agrees with the water "
    "tunnel of the thesis, in which water was stable from 2 to 50 kPa, so a prediction should rest on it; quasi-steady "
    "reproduces the thesis's own calculations"
)
_WORDS = {True: "stable", False: "unstable", None: "undecided"}


def other_law(case: Case) -> str:
    """The continuity law that a case does not use."""
    return QUASI_STEADY if case.fluid.continuity == STORAGE else STORAGE


def require_two_laws(case: Case, study: str, without: str = "") -> None:
    """Refuse to compare laws where none is at work; `without` says why where the study knows.

    Raises
    ------
    CaseError
    """
    if not without and not case.continuity:
        without = "drive.kind is 'uniform'" if case.drive.kind != "flow" else "fluid.unsteady is false"
    if without:
        raise CaseError(
            f"{study}.continuity is given as 'both', but {without}, so that no continuity law is at work; it must be "
            "'case' then.",
            key=f"{study}.continuity",
        )


def compare_states(own: str, stable: bool | None, other: str, other_stable: bool | None) -> str:
    """Sentence on what two laws say about one state."""
    if stable == other_stable and stable is not None:
        return f"Both continuity laws find the state {_WORDS[stable]}."
    said = f"{_WORDS[stable]} under {own}, {_WORDS[other_stable]} under {other}"
    if None in (stable, other_stable):
        return f"The continuity laws cannot be compared: {said}."
    return f"The continuity laws disagree: {said}. Of the two, {_WHY}."


def compare_ranges(name: str, disagreements: Iterable[tuple[float, float, str]], unit: str, scale: float) -> str:
    """Sentence on the stretches (start, stop, law that is stable) of a parameter in which two laws disagree."""
    found = [
        f"from {low / scale:.4g} to {high / scale:.4g} {unit}".strip() + f" (stable under {law} alone)"
        for low, high, law in disagreements
    ]
    if not found:
        return f"Both continuity laws say the same about stable or not wherever both are certain along {name}."
    return f"The continuity laws disagree over {name} {', '.join(found)}. Of the two, {_WHY}."
