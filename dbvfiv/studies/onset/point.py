"""Samples of a scan over one parameter and its crossings of the imaginary axis, and their storage in a record."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from ...case.parameters import Mu
from ...observer import Observer
from ...record.mesh import MeshData
from ...record.record import GrowingRecord, Record
from ...record.table import Column, TableSpec
from ..case import Case
from ..stability.crossings import WATCHED
from ..stability.verdict import Verdict

#: Meshes of a run: that of the case, and the coarser one for the uncertainty.
FINE, COARSE = 0, 1
NOTHING_KNOWN = Verdict.undecided("Nothing is known of this state.")


@dataclass(frozen=True)
class OnsetSample:
    """Leading eigenvalues at one value, or why there are none.

    Attributes
    ----------
    value : float
    eigenvalues : (k,) complex array, 1/s
        Sorted by growth rate, a conjugate pair given once.
    mesh : int
        `FINE` or `COARSE`.
    failure : str
        Empty if there is a state.
    certified : bool
        An independent count of the unstable eigenvalues agrees with them.
    verdict : Verdict
    """

    value: float
    eigenvalues: np.ndarray
    mesh: int = FINE
    failure: str = ""
    certified: bool = False
    verdict: Verdict = NOTHING_KNOWN


@dataclass(frozen=True)
class Side:
    """Stability at a parameter value a little beside an onset, by the full model.

    Attributes
    ----------
    value : float
    growth_rate, frequency : float, 1/s, Hz
        Growth rate and frequency of the crossing mode.
    leading : float, 1/s
        Growth rate of the leading mode.
    unstable, counted : int
        Unstable eigenvalues by the spectrum and by the argument principle.
    """

    value: float
    growth_rate: float
    frequency: float
    leading: float
    unstable: int
    counted: int

    @property
    def eigenvalue(self) -> complex:
        """Eigenvalue of the crossing mode, 1/s."""
        return complex(self.growth_rate, 2 * np.pi * self.frequency)

    def summary(self) -> dict:
        """Plain numbers for JSON, frequencies in Hz."""
        return {
            "value": self.value,
            "growth_rate": self.growth_rate,
            "frequency": self.frequency,
            "leading_growth_rate": self.leading,
            "unstable_count": self.unstable,
            "unstable_count_independent": self.counted,
        }

    @classmethod
    def of(cls, summary) -> Side:
        """From what `summary` gave."""
        names = ("value", "growth_rate", "frequency", "leading_growth_rate")
        counts = (int(summary[name]) for name in ("unstable_count", "unstable_count_independent"))
        return cls(*(float(summary[name]) for name in names), *counts)


@dataclass(frozen=True)
class OnsetPoint:
    """One crossing of the imaginary axis.

    Attributes
    ----------
    parameter : str
    value : float
    frequency : float, Hz
        0 for a real eigenvalue (divergence).
    growth_rate : float, 1/s
        Left over at the value: how well it is located.
    gains : bool
        True if the mode becomes unstable as the parameter grows.
    edge : bool
        True if no other mode is unstable there, so that the state itself changes between stable and unstable.
    below, above : Side
        Direct eigenvalues on both sides.
    confirmed : bool
        Both sides agree with the crossing, and both counts agree on each side.
    place : Mu
    bracket : (2,) tuple of float
        Neighbouring values of the scan that it lies between.
    ahead : int
        Modes that grow faster there.
    criticality : str or None
        "super", "sub" or "degenerate"; None for a real eigenvalue or where it was not asked for.
    first_lyapunov_coefficient : float or None
        Scaled for eigenvectors of unit norm in (q, v, U), 1/s; only its sign carries over to other scalings.
    crossing_speed : float or None
        Derivative of the growth rate with respect to the parameter.
    uncertainty : float or None
        By Richardson's rule from a second mesh, in units of the parameter.
    coarse_value : float or None
        The onset on the second mesh.
    note : str
    """

    parameter: str
    value: float
    frequency: float
    growth_rate: float
    gains: bool
    edge: bool
    below: Side
    above: Side
    confirmed: bool
    place: Mu
    bracket: tuple[float, float]
    ahead: int = 0
    criticality: str | None = None
    first_lyapunov_coefficient: float | None = None
    crossing_speed: float | None = None
    uncertainty: float | None = None
    coarse_value: float | None = None
    note: str = ""

    @property
    def kind(self) -> str:
        """Either "Hopf" or "divergence"."""
        return "Hopf" if self.frequency > 0 else "divergence"

    @property
    def key(self) -> tuple[float, float, int]:
        """Key that identifies the crossing among those of the same scan."""
        return (*self.bracket, self.ahead)

    def summary(self) -> dict:
        """Plain SI numbers for JSON."""
        return {
            "parameter": self.parameter,
            "value": self.value,
            "frequency": self.frequency,
            "growth_rate": self.growth_rate,
            "criticality": self.criticality,
            "first_lyapunov_coefficient": self.first_lyapunov_coefficient,
            "uncertainty": self.uncertainty,
            "kind": self.kind,
            "gains": self.gains,
            "edge": self.edge,
            "confirmed": self.confirmed,
            "crossing_speed": self.crossing_speed,
            "coarse_value": self.coarse_value,
            "below": self.below.summary(),
            "above": self.above.summary(),
            "note": self.note or None,
            "bracket": list(self.bracket),
            "ahead": self.ahead,
        }

    @classmethod
    def of(cls, summary: Mapping[str, Any], case: Case) -> OnsetPoint:
        """From what `summary` gave, of a case that says the other parameters."""
        given = {field.name: summary[field.name] for field in fields(cls) if field.name in summary}
        return cls(
            **given
            | {
                "below": Side.of(summary["below"]),
                "above": Side.of(summary["above"]),
                "bracket": tuple(summary["bracket"]),
                "note": summary["note"] or "",
                "place": Mu.of(case).at(**{summary["parameter"]: summary["value"]}),
            }
        )


SCAN = "scan"
_COLUMNS = (
    Column("value", "SI", "Values of the scan, those of narrow tongues and of the search for onsets included"),
    Column("growth_rates", "1/s", "Of the leading modes; NaN where there are fewer"),
    Column("angular_frequencies", "rad/s", "Of the leading modes"),
    Column("mesh", "", "0 for the mesh of the case, 1 for the coarser one", "i8"),
    Column("solved", "", "Whether a state was found; a note says why not", "bool"),
    Column("certified", "", "Whether an independent count agrees with the unstable modes there", "bool"),
)
_POINT, _GAP, _VERDICT = "point", "gap", "verdict"


def tables_of(_mesh: MeshData) -> tuple[TableSpec]:
    """Tables of an onset result. Points are notes: what more is known about one is noted again."""
    shape = (WATCHED,)
    return (TableSpec(SCAN, _COLUMNS, {"growth_rates": shape, "angular_frequencies": shape}),)


class KeepItems(Observer):
    """Keeps every sample and point as soon as it is found.

    Parameters
    ----------
    record : GrowingRecord
    """

    def __init__(self, record: GrowingRecord):
        self.record = record

    def item(self, result: object) -> None:
        if isinstance(result, OnsetSample):
            self.record.note(_VERDICT, value=result.value, mesh=result.mesh, **result.verdict.summary())
            if result.failure:  # before the row, which vouches for it
                self.record.note(_GAP, value=result.value, mesh=result.mesh, text=result.failure)
            self.record.append(SCAN, _row(result))
        elif isinstance(result, OnsetPoint):
            self.record.note(_POINT, **result.summary())


def read_samples(record: Record) -> list[OnsetSample]:
    """Samples in the order they were found in."""
    reasons = {(note["value"], note["mesh"]): note["text"] for note in record.notes(_GAP)}
    verdicts = {(note["value"], note["mesh"]): Verdict.read(note) for note in record.notes(_VERDICT)}
    names = ("value", "mesh", "solved", "certified")
    rows = zip(*(record.column(SCAN, name).tolist() for name in names))
    modes = 1j * record.column(SCAN, "angular_frequencies")
    modes += record.column(SCAN, "growth_rates")
    found = []
    for (value, mesh, solved, certified), eigenvalues in zip(rows, modes):
        kept = eigenvalues[np.isfinite(eigenvalues)]
        verdict = verdicts.get((value, mesh)) or _earlier(kept, certified)
        found.append(OnsetSample(value, kept, mesh, "" if solved else reasons[value, mesh], certified, verdict))
    return found


def _earlier(eigenvalues: np.ndarray, certified: bool) -> Verdict:
    """Verdict on a sample of a file of an earlier version, which has no counts."""
    unstable = int(np.sum(np.where(eigenvalues.imag > 0, 2, 1)[eigenvalues.real > 0]))
    return Verdict.of(eigenvalues, unstable, unstable, certified, proven=False)


def read_points(record: Record) -> list[dict[str, Any]]:
    """Latest note on each onset point, in ascending order of the parameter."""
    latest = {(*note["bracket"], note["ahead"]): note for note in record.notes(_POINT)}
    points = [{name: value for name, value in note.items() if name != "what"} for note in latest.values()]
    return sorted(points, key=lambda point: point["value"])


def known_items(record: Record, case: Case) -> list[OnsetSample | OnsetPoint]:
    """Samples and points that an interrupted run had found, for `run_onset`."""
    return [*read_samples(record), *(OnsetPoint.of(point, case) for point in read_points(record))]


def _row(sample: OnsetSample) -> dict[str, Any]:
    modes = np.full(WATCHED, complex(np.nan, np.nan))
    kept = sample.eigenvalues[:WATCHED]
    modes[: len(kept)] = kept
    return {
        "value": sample.value,
        "growth_rates": modes.real,
        "angular_frequencies": modes.imag,
        "mesh": sample.mesh,
        "solved": not sample.failure,
        "certified": sample.certified,
    }
