"""Stability verdict on one steady state: the same object from every study that makes one.

The verdict rests on a list of eigenvalues and on the independent count of the unstable ones (argument principle). It
holds up to a frequency: small models resolve no modes above it, so "stable" names that frequency. An unstable
eigenvalue whose pair satisfies the full equations is proof by itself. A wall whose rubber has lost material stability
gives no verdict on vibration at all: its constants do not describe the rubber at these strains.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from eigen.certificate import Certificate

from ...case.parameters import PARAMETERS
from ...texts import digits, json_value, shortly

STABLE, FLUTTERS, DIVERGES, NOT_VALID, UNDECIDED = "stable", "flutters", "diverges", "not valid", "undecided"
#: Outcomes, the one that decides about several motions of a state first.
OUTCOMES = (NOT_VALID, DIVERGES, FLUTTERS, UNDECIDED, STABLE)
#: Beginning of the reason of a verdict on a bill whose faces hold each other.
SEALED = "Sealed, so that nothing flows."
#: Size of a growth rate over that of its eigenvalue below which its sign is that of rounding.
NEUTRAL = 1e-9


@shortly
@dataclass(frozen=True)
class Verdict:
    """Stability of one steady state."""

    #: "stable"; "flutters": an oscillating mode grows; "diverges": a motion grows without oscillating; "not valid": the
    #: rubber's constants are unstable here; "undecided".
    outcome: str
    reason: str  #: One sentence.
    #: growth_rate and frequency: 1/s, Hz; of the leading oscillating mode, of a valve that diverges those of the motion
    #: that does (0 Hz); NaN if unknown.
    growth_rate: float = np.nan
    frequency: float = np.nan
    #: Of the least damped oscillating mode that is listed, of more modes by `modes` than by studies over parameters;
    #: NaN if unknown.
    damping_ratio: float = np.nan
    #: Factor on the loss factors, or on beta, at which flutter would begin or end; NaN where none is known.
    critical_damping_factor: float = np.nan
    #: The list and the independent count agree; always so where nothing was searched because the constants fail.
    certain: bool = False
    band: float = np.inf  #: Hz; frequency up to which modes were looked for; infinite for all.
    #: Last factor on that damping that was looked at where none down to it, or up to it, makes the difference; NaN
    #: where one does and where that is not known.
    damping_sought: float = np.nan

    @classmethod
    def of(
        cls,
        eigenvalues,
        unstable: int,
        counted: int,
        certain: bool,
        *,
        proven: bool = True,
        line: float = 0.0,
        band: float = np.inf,
        statement: str = "",
        sealed: bool = False,
    ) -> Verdict:
        """Verdict from a list of leading eigenvalues and the independent count.

        Parameters
        ----------
        eigenvalues : array_like, complex, 1/s
            Leading ones, a conjugate pair given once.
        unstable, counted : int
            Unstable eigenvalues by the list and by the argument principle, conjugates counted apart.
        certain : bool
            The count followed its phase everywhere, and what both rest on is accurate enough.
        proven : bool
            The eigenvalues satisfy the full equations, so that an unstable one is proof without the count.
        line : float, 1/s
            Growth rate counted from.
        band : float, Hz
        statement : str
            What to say of the two counts instead of the standard sentence.
        sealed : bool
            The faces of a bill that is moulded shut hold each other.

        Examples
        --------
        >>> Verdict.of([5 + 60j, -3 + 80j], 2, 2, True).outcome
        'flutters'
        >>> Verdict.of([], 0, 0, True).outcome
        'undecided'
        >>> Verdict.of([0.05 + 94j], 0, 0, True, line=0.1).outcome
        'undecided'
        """
        values = np.asarray(eigenvalues, complex)
        values = values[np.isfinite(values.real)]
        agrees = certain and unstable == counted
        growing = values.real > np.maximum(line, NEUTRAL * np.abs(values))
        high = np.abs(values.imag[growing]) / (2 * np.pi)
        number = np.where(high > 0, 2, 1)
        if unstable > number[high <= band].sum():  # the counts tell of more than the band
            band = max(band, high.max(initial=0.0))
        if not statement:
            statement = Certificate(unstable, counted, certain, line, band).beside(int(number[high > band].sum()))
        statement = f"{SEALED} {statement}" if sealed else statement
        if not values.size:
            return cls(UNDECIDED, f"No mode was found in the search, which says nothing of the state. {statement}")
        modes = oscillates(values)
        still = values[growing & ~modes]
        measures = {"certain": bool(agrees), "band": float(band)} | _of_modes(values[modes])
        if growing.any() and (agrees or proven):
            if still.size:
                rate = float(still.real.max())
                measures |= {"growth_rate": rate, "frequency": 0.0}
                also = " An oscillating mode grows besides." if (growing & modes).any() else ""
                reason = f"A motion grows by {rate:.4g} 1/s without oscillating.{also} {statement}"
                return cls(DIVERGES, reason, **measures)
            return cls(FLUTTERS, statement, **measures)
        if growing.any() or not agrees or counted:
            return cls(UNDECIDED, statement, **measures)
        slow = values.real[values.real > NEUTRAL * np.abs(values)]
        if slow.size:  # of a wall without damping, left of the line that was counted from
            reason = f"{statement} A mode grows by {slow.max():.4g} 1/s, too slowly to be counted."
            return cls(UNDECIDED, reason, **measures | {"certain": False})
        return cls(STABLE, statement, **measures)

    def open_above(self, said: str) -> Verdict:
        """The verdict on a state that is stable up to the end of a band above which a count finds more, as `said`."""
        return replace(self, outcome=UNDECIDED, reason=f"{self.reason} {said}", certain=False)

    @classmethod
    def not_valid(cls, sentence: str) -> Verdict:
        """Verdict on a wall whose rubber has lost material stability; the sentence says where and what mends it."""
        return cls(NOT_VALID, sentence, certain=True, band=np.nan)

    @classmethod
    def undecided(cls, sentence: str) -> Verdict:
        """No verdict, and why."""
        return cls(UNDECIDED, sentence, band=np.nan)

    @classmethod
    def joined(cls, parts: Mapping[str, Verdict]) -> Verdict:
        """Verdict on all symmetry classes of a state by their names: the worst of them, certain if all are, up to the
        frequency that all were looked at.

        Flutter begins where that of the first class does, and ends where that of the last one does; nothing is known of
        that where a class is undecided or diverges, or was not looked at as far. None begins down to a factor if every
        class was looked at, and none ends up to one if it ends in no class that flutters.
        """
        if len(parts) == 1:
            return next(iter(parts.values()))
        worst = min(parts, key=lambda name: (OUTCOMES.index(parts[name].outcome), -_or_least(parts[name].growth_rate)))
        ratios = [part.damping_ratio for part in parts.values() if np.isfinite(part.damping_ratio)]
        bad = [part for part in parts.values() if not part.stable]
        factors, last = np.array([(p.critical_damping_factor, p.damping_sought) for p in bad or parts.values()]).T
        factor = np.fmax.reduce(factors)
        if bad:
            known, sought = np.isfinite(factors).all(), np.fmax.reduce(last)
        else:
            known = all(part.is_examined_down_to(factor) for part in parts.values())
            sought = np.nan if np.isfinite(factor) else last.max()
        return replace(
            parts[worst],
            reason=" ".join(f"In {name}: {lowered(part.reason)}" for name, part in parts.items()),
            damping_ratio=min(ratios, default=np.nan),
            critical_damping_factor=float(factor) if known else np.nan,
            damping_sought=float(sought),
            certain=all(part.certain for part in parts.values()),
            band=min((part.band for part in parts.values() if not np.isnan(part.band)), default=np.nan),
        )

    def is_examined_down_to(self, factor: float) -> bool:
        """True for a stable state whose flutter begins at a factor on the damping or below it, or is known not to begin
        above it.
        """
        return self.critical_damping_factor <= factor or self.damping_sought <= factor

    @property
    def stable(self) -> bool | None:
        """True or False where that is known, else None."""
        return {STABLE: True, FLUTTERS: False, DIVERGES: False}.get(self.outcome)

    @property
    def holds(self) -> bool:
        """True where growth rates are valid, since the rubber's constants are stable at the state."""
        return self.outcome != NOT_VALID

    def sentence(self, conditions: str = "") -> str:
        """One sentence for people, with the words behind the outcome that say under which conditions."""
        words = f"{self.outcome[0].upper()}{self.outcome[1:]} {conditions}".rstrip()
        return f"{words}: {lowered(self.reason)} {self.margin}".rstrip()

    @property
    def margin(self) -> str:
        """The margin as a sentence; empty where nothing is known of it."""
        if not self.holds or not np.isfinite(self.damping_ratio):
            return ""
        said = f"The least damped mode has a damping ratio of {digits(100 * self.damping_ratio, 2)} %"
        factor = self.critical_damping_factor
        if np.isfinite(factor):
            begins = "flutter would begin" if self.outcome == STABLE else "flutter would end"
            said += f"; {begins} at {factor:.3g} times the damping of the wall"
        elif np.isfinite(self.damping_sought):
            none = "no flutter begins down to" if self.outcome == STABLE else "flutter does not end up to"
            said += f"; {none} {self.damping_sought:.3g} times the damping of the wall"
        return said + "."

    def summary(self) -> dict[str, Any]:
        """Plain numbers for JSON; None for what is not known, and what was sought only where nothing was found."""
        told = {field.name: json_value(getattr(self, field.name)) for field in fields(self)}
        return {name: value for name, value in told.items() if (name, value) != ("damping_sought", None)}

    @classmethod
    def read(cls, summary: Mapping[str, Any]) -> Verdict:
        """The verdict that `summary` gave."""
        numbers = {"growth_rate", "frequency", "damping_ratio", "critical_damping_factor", "band"}
        given = {"damping_sought": np.nan} | {f.name: summary[f.name] for f in fields(cls) if f.name in summary}
        missing = {name: np.nan for name in numbers if given[name] is None}
        return cls(**given | missing)


def oscillates(values: np.ndarray) -> np.ndarray:
    """True for eigenvalues (k,) whose imaginary part is more than rounding."""
    return np.abs(values.imag) > NEUTRAL * np.abs(values)


def _of_modes(modes: np.ndarray) -> dict[str, float]:
    """Growth rate and frequency of the leading oscillating mode, and the least damping ratio."""
    if not modes.size:
        return {}
    leading = modes[int(np.argmax(modes.real))]
    return {
        "growth_rate": float(leading.real),
        "frequency": float(abs(leading.imag) / (2 * np.pi)),
        "damping_ratio": float((-modes.real / np.abs(modes)).min()),
    }


def not_valid_at(parameter: str, unsound: Mapping[float, str]) -> str:
    """Sentence on the values of a parameter at which the constants of the rubber do not hold."""
    row, values = PARAMETERS[parameter], sorted(unsound)
    low, high = values[0], values[-1]
    alike = row.amount(low) == row.amount(high)
    where = row.amount(low) if alike else f"{len(values)} values from {row.span(low, high)}"
    return f"Not valid at {where}: {unsound[values[0]]}"


def lowered(sentence: str) -> str:
    """Sentence to go on with after a colon."""
    return f"{sentence[:1].lower()}{sentence[1:]}"


def _or_least(value: float) -> float:
    return value if np.isfinite(value) else -np.inf
