"""Dimensions of a study besides its parameters: flow model and symmetry class.

A study asks for variants, the class of the equilibria under the flow model of the case first. It finds the same in each
of them, by the same function, and keeps it in the same tables, whose rows and notes name the variant.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from ...errors import CaseError
from ...model.symmetry import (
    HALF_SYMMETRIES,
    SYMMETRIES,
    Symmetry,
    asks_for_equilibria,
    chosen_symmetries,
    equilibria_of,
    symmetry_named,
)
from ...record.table import Column
from ..case import Case

QUASI_STEADY, STORAGE = "quasi-steady", "storage"
_WHY = (
    "storage conserves volume under moving walls (what they displace has to go somewhere) and agrees with the water "
    "tunnel of the thesis, in which water was stable from 2 to 50 kPa, so a prediction should rest on it; quasi-steady "
    "reproduces the thesis's own calculations"
)
#: Classes of motion by their numbers in tables.
CLASS_NAMES = (*SYMMETRIES, *HALF_SYMMETRIES)
#: Columns that name the variant of a row.
VARIANT = (
    Column("continuity", "", "Blend of the flow models, 0 quasi-steady, 1 storage"),
    Column("symmetry", "", f"Symmetry class: {', '.join(f'{i} {name}' for i, name in enumerate(CLASS_NAMES))}", "i8"),
)
_WORDS = {True: "stable", False: "unstable", None: "undecided"}


class Variant(NamedTuple):
    """One flow model and one symmetry class."""

    continuity: str
    symmetry: str  #: Name of the class, see `dbvfiv.model.symmetry`.

    @property
    def storage(self) -> float:
        """Blend of the flow models, a parameter."""
        return float(self.continuity == STORAGE)

    @property
    def motion(self) -> Symmetry:
        return symmetry_named(self.symmetry)

    @property
    def row(self) -> dict[str, float]:
        """Its part of a row of a table, the columns `VARIANT`."""
        return {"continuity": self.storage, "symmetry": CLASS_NAMES.index(self.symmetry)}

    def prefix(self, own: Variant) -> str:
        """Beginning of a sentence about it; empty for the variant of the case."""
        if self == own:
            return ""
        return f"Under {self.continuity}: " if self.symmetry == own.symmetry else f"In class {self.symmetry}: "


def own_variant(case: Case) -> Variant:
    """Variant of the equilibria of a case."""
    return Variant(case.fluid.continuity, equilibria_of(case.part).name)


def variants(case: Case, study: str) -> list[Variant]:
    """Variants that a study is asked for by its keys `symmetry` and `continuity`, those of the case's flow model first.
    Raises CaseError if two flow models are asked for where none is at work.
    """
    own, *other = flow_models(case, study)
    found = [Variant(own, motion.name) for motion in chosen_symmetries(getattr(case, study).symmetry, case.part)]
    return [*found, *(Variant(law, equilibria_of(case.part).name) for law in other)]


def flow_models(case: Case, study: str) -> list[str]:
    """Flow models that a study is asked for by its key `continuity`, that of the case first. Raises CaseError if two
    are asked for where none is at work.
    """
    law = case.fluid.continuity
    if getattr(getattr(case, study), "continuity", "case") != "both":
        return [law]
    _require_two_laws(case, study)
    return [law, QUASI_STEADY if law == STORAGE else STORAGE]


def _require_two_laws(case: Case, study: str) -> None:
    """Refuse to compare flow models where none is at work, or where they do not differ. Raises CaseError."""
    keys, without = getattr(case, study), ""
    if not case.continuity:
        without = "drive.kind is 'uniform'" if case.drive.kind != "flow" else "fluid.unsteady is false"
    if getattr(keys, "in_vacuo", False):
        without = "modes.in_vacuo leaves the fluid out"
    why = f"{without}, so that no flow model is at work" if without else ""
    if not why and case.is_compressed:
        why = "a fluid that is compressed (fluid.sound_speed) stores mass, and the quasi-steady model does not"
    axes = getattr(keys, "axes", (getattr(keys, "axis", None),))
    if not why and any(axis is not None and axis.parameter == "storage" for axis in axes):
        why = f"{'an axis' if study == 'map' else f'{study}.over'} moves the flow model itself"
    if not why and study == "uncertainty" and "storage" in case.uncertainty.inputs:
        why = "uncertainty.inputs moves the flow model itself"
    if why:
        said = f"{study}.continuity is given as 'both', but {why}; it must be 'case' then."
        raise CaseError(said, key=f"{study}.continuity")
    if study == "modes" and not asks_for_equilibria(keys.symmetry):
        own = equilibria_of(case.part).name
        raise CaseError(
            f"modes.continuity is given as 'both' with modes.symmetry = {keys.symmetry!r}, but the laws differ in "
            f"class {own} alone, since no other motion changes areas; modes.symmetry must be {own!r} then.",
            key="modes.continuity",
        )


def leading_class(names: Sequence[str], rates: np.ndarray, frequencies: np.ndarray) -> dict[str, Any]:
    """Growth rate, frequency and symmetry class of the most unstable motion at each of several places.

    Parameters
    ----------
    names : sequence of str
        Classes, that of the equilibria first; a place where its growth rate is NaN is a gap, its class None.
    rates, frequencies : (classes, ...) arrays, 1/s, Hz

    Examples
    --------
    >>> leading_class(["SS", "SA"], np.array([[1.0, -1.0], [0.5, 2.0]]), np.zeros((2, 2)))["symmetry"]
    ['SS', 'SA']
    """
    gap = np.isnan(rates[0])
    first = np.argmax(np.where(np.isnan(rates), -np.inf, rates), axis=0)
    found = {
        name: np.where(gap, np.nan, np.take_along_axis(table, first[None], axis=0)[0]).tolist()
        for name, table in (("growth_rate", rates), ("frequency", frequencies))
    }
    return found | {"symmetry": np.where(gap, None, np.array(names, object)[first]).tolist()}


def certified_in_all(certified: np.ndarray, unstable: np.ndarray) -> np.ndarray:
    """Places (...) whose outcome is certified from bool tables (classes, ...): in all classes, or in one that is
    unstable.
    """
    return certified.all(axis=0) | (certified & unstable).any(axis=0)


def compare_states(own: str, stable: bool | None, other: str, other_stable: bool | None) -> str:
    """Sentence on what two laws say about one state."""
    if stable == other_stable and stable is not None:
        return f"Both flow models find the state {_WORDS[stable]}."
    said = f"{_WORDS[stable]} under {own}, {_WORDS[other_stable]} under {other}"
    if None in (stable, other_stable):
        return f"The flow models cannot be compared: {said}."
    return f"The flow models disagree: {said}. Of the two, {_WHY}."


def compare_ranges(name: str, disagreements: Iterable[tuple[float, float, str]], unit: str, scale: float) -> str:
    """Sentence on the stretches (start, stop, law that is stable) of a parameter in which two laws disagree."""
    found = [
        f"from {low / scale:.4g} to {high / scale:.4g} {unit}".strip() + f" (stable under {law} alone)"
        for low, high, law in disagreements
    ]
    if not found:
        return f"Both flow models say the same about stable or not wherever both are certain along {name}."
    return f"The flow models disagree over {name} {', '.join(found)}. Of the two, {_WHY}."
