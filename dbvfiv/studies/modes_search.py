"""How leading modes of the valve are searched for: what the damping says about where they end."""

from __future__ import annotations

from dataclasses import replace

from eigen import SearchOptions, TransferBasis

from ..model.dynamics import Conditions

#: Share of the limit point right of which eigenvalues count as leading modes; the search of `eigen` takes the same.
CLEAR = 0.8
#: Room above the structural frequencies that a band is made of.
_ROOM = 1.05


def limit_point(conditions: Conditions) -> float | None:
    """Growth rate at which infinitely many eigenvalues accumulate under stiffness damping, 1/s."""
    return -1.0 / conditions.beta if conditions.beta > 0 else None


def suited(
    search: SearchOptions, conditions: Conditions, basis: TransferBasis, count: int
) -> tuple[SearchOptions, tuple[str, ...]]:
    """Search options that suit the damping, and sentences about them.

    Stiffness damping orders modes by frequency until they reach the limit point -1/beta. Without it growth rates of
    high modes do not fall, so that "leading" has a meaning within a band of frequencies only: one that holds as many
    structural frequencies as modes are wanted.

    Parameters
    ----------
    search : SearchOptions
        What was asked for; a band that it names is kept.
    conditions : Conditions
    basis : TransferBasis
        For the structural frequencies of the state.
    count : int
        Modes wanted.
    """
    known = basis.structural_frequencies
    highest = float(known[min(count, len(known)) - 1])
    if conditions.beta > 0:
        return replace(search, limit_point=limit_point(conditions)), ()
    if search.max_frequency is not None:
        return search, ()
    band = _ROOM * highest
    sentence = (
        f"Without stiffness damping growth rates do not order the modes, so the search covers the band up "
        f"to {band:.4g} Hz, which holds "
        f"{min(count, len(known))} structural frequencies in vacuo; modes.max_frequency chooses another."
    )
    return replace(search, max_frequency=band), (sentence,)
