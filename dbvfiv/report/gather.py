"""The studies that a report rests on, each in a file of its own: a report made again computes nothing twice."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..case.parameters import PARAMETERS, Mu
from ..errors import CaseError, SolveError
from ..observer import Observer
from ..studies.case import Case
from ..studies.closure.study import ClosureResult
from ..studies.cycle.study import CycleResult
from ..studies.map.study import MapResult
from ..studies.modes.study import ModesResult
from ..studies.onset.study import OnsetResult
from ..studies.session import Session, kept_run
from ..studies.steady.study import SteadyResult

#: What runs for a report, in this order, and of which study it is.
RUNS = {
    "steady": "steady",
    "modes": "modes",
    "classes": "modes",
    "onset": "onset",
    "map": "map",
    "cycle": "cycle",
    "closure": "closure",
}


@dataclass(frozen=True)
class Runs:
    """Amount of computation for a report.

    Attributes
    ----------
    cells : int
        Values along each axis of the stability map.
    values : int
        Values of the scan for onsets.
    workers : int
        Processes that share the columns of the map.
    leave_out : tuple of str
        Names among `RUNS` that are not wanted.
    """

    cells: int = 20
    values: int = 24
    workers: int = 1
    leave_out: tuple[str, ...] = ()


@dataclass
class Gathered:
    """Results of a case by the names of `RUNS`, and what is missing.

    Attributes
    ----------
    case : Case
    name : str
    results : dict of StudyResult
    missing : dict of str
        Those that gave no result, and why, in a sentence.
    not_asked : set of str
        Those among them that were left out, or have nothing to say of this valve.
    """

    case: Case
    name: str
    results: dict[str, Any] = field(default_factory=dict)
    missing: dict[str, str] = field(default_factory=dict)
    not_asked: set[str] = field(default_factory=set)

    @property
    def steady(self) -> SteadyResult | None:
        return self.results.get("steady")

    @property
    def modes(self) -> ModesResult | None:
        return self.results.get("modes")

    @property
    def classes(self) -> ModesResult | None:
        """Modes in all classes of motion under the law of the case."""
        return self.results.get("classes")

    @property
    def onset(self) -> OnsetResult | None:
        return self.results.get("onset")

    @property
    def map(self) -> MapResult | None:
        return self.results.get("map")

    @property
    def cycle(self) -> CycleResult | None:
        """Limit cycles from the onset to this state; there where the state is unstable."""
        return self.results.get("cycle")

    @property
    def closure(self) -> ClosureResult | None:
        return self.results.get("closure")


def gather(
    case: Case,
    name: str,
    folder: Path,
    runs: Runs = Runs(),
    observer: Callable[[str], Observer] = lambda _: Observer(),
) -> Gathered:
    """Run the studies, or take them from the files of an earlier report of the same case.

    Parameters
    ----------
    case : Case
    name : str
        For titles.
    folder : path
        Of the result files, NAME-RUN.h5.
    runs : Runs
    observer : callable
        From the name of a run to who is told of its progress.

    Raises
    ------
    CaseError
        If the case gives no model, or the folder cannot be written.
    """
    session = Session(case, name)
    session.mesh  # a case that gives no model is told before anything runs
    if case.seeks_levels:
        session = session.settle(observer("strain levels"))
        case = session.case
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise CaseError(f"The folder {str(folder)!r} cannot be written ({error.strerror or error}).") from error
    found = Gathered(case, name)
    for name_of_run, kind in RUNS.items():
        if name_of_run in runs.leave_out:
            found.missing[name_of_run] = "It was left out."
            found.not_asked.add(name_of_run)
            continue
        changes = way_to_the_cycle(found) if name_of_run == "cycle" else changes_of(name_of_run, case, runs)
        if changes is None:
            found.missing[name_of_run] = (
                "The steady state is not known to be unstable beside an onset, so none was sought."
            )
            found.not_asked.add(name_of_run)
            continue
        try:
            asked = session.replace(changes)
            choices = {"workers": runs.workers} if kind == "map" else {}
            path = folder / f"{name}-{name_of_run}.h5"
            found.results[name_of_run] = kept_run(kind, asked, path, observer(name_of_run), **choices)
        except (CaseError, SolveError) as error:
            found.missing[name_of_run] = str(error)
    return found


def changes_of(run: str, case: Case, runs: Runs) -> dict[str, Any]:
    """Keys that a report sets for one of `RUNS`: both laws side by side, all classes, grids of its own size."""
    both = {f"{run}.continuity": "both"}
    if run == "steady":
        asked = {*case.steady_pressures(), case.drive.pressure} - {case.rest_pressure}
        return {"steady.pressures": sorted(asked)}
    if run == "modes":
        return {} if case.modes.in_vacuo else both | {"modes.symmetry": "SS"}
    if run == "classes":
        return {"modes.symmetry": "all", "modes.continuity": "case"}
    if run == "onset":
        axis = case.onset.axis
        return both | {"onset.over": spelled(axis.parameter, axis, runs.values)}
    if run == "map":
        x, y = case.map.axes
        return both | {
            "map.x": spelled(x.parameter, x, runs.cells, around=case.drive.pressure),
            "map.y": spelled(y.parameter, y, runs.cells, around=case.fluid.density),
        }
    return {}


def way_to_the_cycle(found: Gathered) -> dict[str, Any] | None:
    """Keys of a branch of cycles from the nearest onset to the state of the case; None where no cycle is expected."""
    if found.modes is None or found.modes.stable is not False or found.onset is None:
        return None
    parameter = found.onset.parameter
    here = Mu.of(found.case)[parameter]
    beside = [p for p in found.onset.points if p["edge"] and (p["value"] < here) == p["gains"] and p["frequency"] > 0]
    if not beside:
        return None
    nearest = min(beside, key=lambda point: abs(point["value"] - here))
    low, high = sorted((here, nearest["value"] + 0.1 * (nearest["value"] - here)))
    start = "first" if nearest["gains"] else "last"
    return {"cycle.over": f"{parameter}={max(low, 0.5 * here):.9g}:{high:.9g}:4", "cycle.start": start}


def spelled(parameter: str, axis, count: int, around: float | None = None) -> str:
    """An axis of a case with another number of values, widened until it holds a pressure or a density of interest."""
    low, high = axis.values[0], axis.values[-1]
    if around is not None and parameter in ("pressure", "density") and around > 0:
        row = PARAMETERS[parameter]
        low, high = min(low, 0.5 * around), max(high, min(1.5 * around, row.high))
    return f"{parameter}={low:.9g}:{high:.9g}:{count}" + (":log" if axis.log else "")
