"""Modes of the same state under the other continuity law, beside those of the case's own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..stability.verdict import Verdict
from .mode import Certificate, ModeShape, rows_of
from .run import FoundModes

#: Kind of the note that holds them.
NOTE = "other law"
_NUMBERS = ("growth_rate", "angular_frequency", "residual")


@dataclass(frozen=True, eq=False)
class OtherLaw:
    """Modes and verdict under the other continuity law.

    Attributes
    ----------
    continuity : str
    modes : tuple of dict
        growth_rate, frequency, damping_ratio, residual, by falling growth rate.
    certificate : Certificate
        Without its curve.
    verdict : Verdict
    outside : str
        Fluid outside the wall, in words.
    """

    continuity: str
    modes: tuple[dict[str, Any], ...]
    certificate: Certificate
    verdict: Verdict
    outside: str = ""

    @property
    def stable(self) -> bool | None:
        return self.verdict.stable

    @property
    def sentence(self) -> str:
        """The verdict in a sentence, which names the law."""
        return self.verdict.sentence(f"under {self.continuity} continuity {self.outside}".rstrip())

    def summary(self) -> dict[str, Any]:
        """Keys as those of the case's own law."""
        return {
            "continuity": self.continuity,
            "modes": list(self.modes),
            "unstable_count": self.certificate.unstable_count,
            "unstable_count_independent": self.certificate.unstable_count_independent,
            "stable": self.stable,
            "verdict": self.verdict.summary(),
            "certificate": self.certificate.summary(),
        }


def note_of(found: FoundModes, continuity: str) -> dict[str, Any]:
    """Note that a record keeps of the modes under the other continuity law."""
    modes = [{name: row[name] for name in _NUMBERS} for row in rows_of(found)]
    certificate = Certificate.of(found).note()
    return {"continuity": continuity, "modes": modes, "certificate": certificate, "verdict": found.verdict.summary()}


def read(note: dict[str, Any], outside: str = "") -> OtherLaw:
    """From a note of a record; `outside` says in words what is outside the wall."""
    nothing = np.zeros(0)
    shapeless = {"backward_error": np.nan, "shape": nothing, "area": nothing, "pressure": nothing, "inlet_velocity": 0j}
    modes = (ModeShape(number=i + 1, **row, **shapeless).summary() for i, row in enumerate(note["modes"]))
    certificate = Certificate.read(note["certificate"], nothing, nothing)
    return OtherLaw(note["continuity"], tuple(modes), certificate, Verdict.read(note["verdict"]), outside)


def side_by_side(own: str, modes: Sequence[dict[str, Any]], other: OtherLaw) -> list[str]:
    """Table of the modes under both laws, each by falling growth rate."""
    lines = [
        f"{'':6}{own:>40}{other.continuity:>40}",
        f"{'mode':>6}" + 2 * f"{'1/s':>14}{'Hz':>13}{'damping':>13}",
    ]
    for i in range(max(len(modes), len(other.modes))):
        lines.append(
            f"{i + 1:6d}" + "".join(_cells(found[i] if i < len(found) else None) for found in (modes, other.modes))
        )
    return lines


def _cells(mode: dict[str, Any] | None) -> str:
    if mode is None:
        return " " * 40
    return f"{mode['growth_rate']:14.4f}{mode['frequency']:13.4f}{mode['damping_ratio']:13.4f}"
