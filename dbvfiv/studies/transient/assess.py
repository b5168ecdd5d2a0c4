"""The verdict on a run: on its mass flow and the displacement of its lip, with the equilibrium's residual at hand."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...model import ValveModel
from ...verdict import JudgeOptions, Verdict, judge
from ..stability.verdict import DIVERGES, FLUTTERS, STABLE, UNDECIDED
from ..stability.verdict import Verdict as StabilityVerdict

#: Columns of a history by name.
Columns = Mapping[str, np.ndarray]
#: Smallest area over that of the lip gap at rest up to which a valve is closed: where the pressure drives fluid out,
#: and where nothing does.
SHUT, UNOPENED = 0.5, 2.0
#: Pascal; no fluid's pressure falls further below that of the surroundings.
ATMOSPHERE = 101_325.0


@dataclass(frozen=True)
class RunVerdict:
    """Verdicts on the signals and what mass flow and lip displacement say together.

    Attributes
    ----------
    mass_flow, lip_displacement : Verdict
    lip_opening : Verdict
        Of the clear opening, which is cut off at zero and says nothing more; amplitudes are about twice as large.
    residual : float
        Unbalanced force at the end over pressure force; not a number while the pressure changes.
    steps : int
    time : float, s
    """

    mass_flow: Verdict
    lip_displacement: Verdict
    lip_opening: Verdict
    residual: float
    steps: int
    time: float

    @property
    def name(self) -> str:
        """The livelier of the two: a flow can look settled while the lip still moves."""
        names = (self.mass_flow.name, self.lip_displacement.name)
        return max(names, key=_LIVELINESS.index)

    @property
    def decided(self) -> bool:
        """True where the verdicts on mass flow and lip displacement agree and a longer run would not change them."""
        lip = self.lip_displacement
        return self.mass_flow.decided and lip.decided and self.mass_flow.name == lip.name

    @property
    def governing(self) -> Verdict:
        """The verdict that gives the name."""
        return self.mass_flow if self.mass_flow.name == self.name else self.lip_displacement

    def summary(self) -> dict[str, Any]:
        """Plain SI numbers for JSON: name and numbers of the mass flow, then each signal by itself."""
        flow = self.mass_flow.summary()
        top = {key: flow[key] for key in ("amplitude", "frequency", "mean", "cycles_observed", "periodicity_error")}
        return {
            "verdict": self.name,
            "decided": bool(self.decided),
            "reason": self.governing.reason,
            **top,
            "steps": self.steps,
            "time": self.time,
            "residual": self.residual if np.isfinite(self.residual) else None,
            "mass_flow": flow,
            "lip_opening": self.lip_opening.summary(),
            "lip_displacement": self.lip_displacement.summary(),
        }


_STABILITY = {"steady": STABLE, "decaying": STABLE, "limit cycle": FLUTTERS, "growing": FLUTTERS}
_LIVELINESS = ("closed", "steady", "decaying", "limit cycle", "growing", "undecided", "irregular")


def assess(
    history: Columns,
    model: ValveModel,
    residual: float = np.nan,
    options: JudgeOptions = JudgeOptions(),
    since: float = 0.0,
) -> RunVerdict:
    """Verdict on a history.

    A valve is closed where its lips shut the gap they have at rest, or where nothing drives fluid out and they do not
    open; one that stands at its gap under a pressure lets flow what passes there.

    Parameters
    ----------
    history : mapping of str to array
        See `dbvfiv.studies.transient.tables.SCALARS`.
    model : ValveModel
    residual : float
        Of the equilibrium at the end; not a number if it is not known.
    since : float
        Time, s, before which the drive still changed.
    """
    time = history["time"]
    chosen = time >= since
    known = residual if np.isfinite(residual) else None
    signals = ("mass_flow", "lip_displacement", "lip_opening")
    found = [judge(time[chosen], history[name][chosen], options, residual=known) for name in signals]
    driven = history["inlet_pressure"] > model.case.rest_pressure
    area = history["smallest_area"] / (np.where(driven, SHUT, UNOPENED) * lip_gap(model))
    if judge(time[chosen], area[chosen], options, closed_below=1.0).name == "closed":
        reason = "The lips shut the gap that they have at rest, or nothing drives fluid out and they do not open."
        found = [Verdict(**{**vars(v), "name": "closed", "decided": True, "reason": reason}) for v in found]
    return RunVerdict(*found, residual, len(time) - 1, float(time[-1]))


def stability_of(summary: Mapping[str, Any]) -> StabilityVerdict:
    """Stability of the steady state that a run was kicked from, by what became of the kick.

    Parameters
    ----------
    summary : mapping
        Of a `RunVerdict`.
    """
    lip = summary.get("lip_displacement") or {}
    frequency = lip.get("frequency") or np.nan
    outcome = _STABILITY.get(summary["verdict"], UNDECIDED)
    if summary["verdict"] == "growing" and not np.isfinite(frequency):
        outcome = DIVERGES
    reason = f"After a kick the run in time ends as {summary['verdict']}: {summary['reason']}"
    return StabilityVerdict(outcome, reason, frequency=frequency, certain=bool(summary["decided"]))


def lip_gap(model: ValveModel) -> float:
    """Flow area of the whole valve at the lip at rest, m2."""
    mesh = model.mesh
    return mesh.part.copies * float(mesh.rest_area[0] - mesh.wall_deduction[0])


def beyond_model(history: Columns) -> str | None:
    """Sentence on speeds and pressures beyond what the equations are for, None without any.

    An ideal incompressible fluid pays any price for passing a gap that shuts; a real one separates, cavitates or is
    compressed. What follows such an instant is the solution of the equations and no prediction.
    """
    fastest = np.asarray(history["mach"]) if "mach" in history else np.zeros(1)
    if fastest.max() > 1.0:
        where = int(np.argmax(fastest > 1.0))
        return (
            f"The fluid is faster than sound in the valve from {history['time'][where]:.4g} s on, in "
            f"{100 * np.mean(fastest > 1.0):.2g} % of the steps and up to Mach {fastest.max():.3g}: what shocks take "
            "is a loss of head here, and the air that lips draw in then is a rough estimate."
        )
    lowest = np.min(history["station_pressure"], axis=1)
    beyond = np.flatnonzero(lowest < -ATMOSPHERE)
    if not len(beyond):
        return None
    time, share = history["time"][beyond[0]], len(beyond) / len(lowest)
    return (
        f"Pressures fall below vacuum from {time:.4g} s on, in {100 * share:.2g} % of the steps and down to "
        f"{1e-3 * lowest.min():.4g} kPa, where the valve slams "
        "shut: the fluid's equations are beyond their range there, and the motion afterwards is no prediction."
    )
