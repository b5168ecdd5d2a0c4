"""The studies that a report rests on, each in a file of its own: a report made again computes nothing twice.

The valve is solved once at each head; its modes start from those states. A second mesh of half the elements each way,
and two strain levels on it, say how sure the answers are.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..case.parameters import PARAMETERS, Mu
from ..effects import with_effect, without_numbers
from ..errors import CaseError, SolveError
from ..model.sizes import ValveSizes
from ..model.symmetry import equilibria_of
from ..observer import Observer, is_watched
from ..studies.case import Case
from ..studies.closure import EXAMINED
from ..studies.onset.search import coarse_mesh
from ..studies.session import Session, kept_run, load_result
from ..studies.stability.place import why_it_moves
from ..studies.stability.verdict import DIVERGES
from ..studies.workers import Lost, Work, Workers

#: What a report can leave out.
PARTS = ("steady", "heads", "pipe", "onset", "law", "mesh", "levels", "closure", "chance", "cycle")
#: Heads examined where none are asked for, over the largest pressure of the case: closer where the lips just open.
_HEADS = (0.02, 0.05, 0.1, 0.2, 0.4, 0.7, 1.0)
#: Back pressures examined, over the rated one, besides that and `EXAMINED` times it.
_BACK = (0.1, 0.5)
#: Strain levels on both sides of those of the case, and lengths of the pipe over its own.
_LEVELS, _LENGTHS = (0.10, 0.20), (0.2, 5.0, 6)


@dataclass(frozen=True)
class Run:
    """A study that is asked for."""

    name: str  #: Of its file.
    kind: str  #: Of the study.
    label: str  #: For the bar.
    changes: dict[str, Any]  #: Keys of the case.
    share: float  #: Processor time it is expected to take, s on 28 x 48 elements.

    @property
    def part(self) -> str:
        """Part of the report it belongs to."""
        return self.name.partition("-")[0]


@dataclass
class Gathered:
    """Results of a case by the names of their runs, and what is missing."""

    case: Case  #: With settled strain levels, and the sealing pressure of a cracking head.
    name: str
    heads: tuple[float, ...]  #: Pa; pressures at which the valve was examined.
    sizes: ValveSizes
    results: dict[str, Any] = field(default_factory=dict)
    missing: dict[str, str] = field(default_factory=dict)  #: Runs that gave no result, and why, in a sentence.
    #: Those among them that were left out, or have nothing to say of this valve.
    not_asked: set[str] = field(default_factory=set)
    seconds: float = 0.0  #: Processor time that it took.
    levels: str = ""  #: Strain levels that were settled, in a sentence.

    def get(self, name: str) -> Any:
        """A result by the name of its run; None without one."""
        return self.results.get(name)

    def why(self, name: str) -> str:
        """Why a run, or all runs of a part, gave nothing, in a sentence."""
        own = [self.missing[word] for word in (name, *name.split("-")) if word in self.missing]
        of_part = [text for run, text in self.missing.items() if run.partition("-")[0] == name]
        failures = self.results[name].failures if name in self.results else ()
        return next(iter((*own, *of_part, *failures)), "It was not asked for.")

    @property
    def modes(self) -> dict[float, Any]:
        """Modes by the pressure, Pa, of those heads at which they were found."""
        named = {pressure: self.get(f"heads-{i}") for i, pressure in enumerate(self.heads, 1)}
        return {pressure: result for pressure, result in named.items() if result is not None}

    @property
    def pipes(self) -> dict[float, Any]:
        """Sweeps over the length of the pipe by the pressure, Pa."""
        return {r.case.drive.pressure: r for name, r in self.results.items() if name.startswith("pipe-")}

    @property
    def worst(self) -> float | None:
        """Pressure, Pa, at which the valve is nearest to chatter or beyond it."""
        rates = {p: _nearness(result.verdict) for p, result in self.modes.items()}
        return max(rates, key=rates.__getitem__) if rates else None

    def state(self, pressure: float, name: str = "steady") -> Any:
        """Steady state at a pressure, Pa; None where it was not found."""
        states = self.get(name).states if self.get(name) is not None else ()
        return next((s for s in states if np.isclose(s.pressure, pressure, rtol=1e-9)), None)

    @property
    def failed(self) -> dict[str, str]:
        """Runs that were asked for and gave no result, and why."""
        return {name: why for name, why in self.missing.items() if name not in self.not_asked}


def is_on_own_mesh(name: str) -> bool:
    """True for a run on the mesh of the case, by its name."""
    return name.partition("-")[0] not in ("mesh", "levels")


def _nearness(verdict) -> tuple[bool, float]:
    """Nearness of a state to chatter: growth rate of one that diverges, else the negative least damping ratio."""
    diverges = verdict.outcome == DIVERGES
    size = verdict.growth_rate if diverges else -verdict.damping_ratio
    return diverges, size if np.isfinite(size) else -np.inf


def heads_of(case: Case) -> tuple[float, ...]:
    """Pressures, Pa, that a report examines: those of report.heads, else shares of the largest one of the case."""
    if case.report.heads:
        return tuple(sorted(set(case.report.heads)))
    rest = case.least_drive
    given = case.steady.pressures if "pressures" in case.steady.model_fields_set else ()
    top = max([case.drive.pressure, *given])
    if not top > max(rest, 0.0):
        raise CaseError(
            f"drive.pressure is {case.drive.pressure:g} Pa, and nothing is driven but by the valve's own column; "
            "give report.heads, those that the report examines.",
            key="report.heads",
        )
    return (*(float(f"{rest + share * (top - rest):.9g}") for share in _HEADS[:-1]), top)


def second_mesh(case: Case) -> dict[str, Any]:
    """Keys of a mesh with half the elements each way."""
    return coarse_mesh(case, 0.5, 4)


def planned(case: Case) -> Iterator[Run]:
    """Runs that every report begins with."""
    heads, flows = heads_of(case), case.drive.kind == "flow"
    given = case.steady.pressures if "pressures" in case.steady.model_fields_set else ()
    asked = {*heads, case.drive.pressure, *given}
    yield Run("steady", "steady", "opening and flow", {"steady.pressures": sorted(asked - {case.rest_pressure})}, 12)
    classes = {"modes.symmetry": "all", "modes.continuity": "case", "modes.in_vacuo": not flows}
    for i, pressure in enumerate(heads, 1):
        label = f"vibration at {case.units.pressure(pressure)}"
        yield Run(f"heads-{i}", "modes", label, classes | {"drive.pressure": pressure}, 12)
    yield Run("closure", "closure", "back pressure", closure_keys(case), 60)
    coarse, top = second_mesh(case), heads[-1]
    yield Run("mesh-steady", "steady", "second mesh", coarse | {"steady.pressures": sorted({*heads})}, 4)
    yield Run("mesh-closure", "closure", "second mesh under back pressure", coarse | closure_keys(case), 12)
    for level, keys in _other_levels(case).items():
        keys = coarse | keys | {"steady.pressures": [top]}
        yield Run(f"levels-steady-{level:g}", "steady", f"strain level {level:.0%}", keys, 2)


def _other_levels(case: Case) -> dict[float, dict[str, Any]]:
    """Keys of strain levels other than its own for all rubbers that have levels; nothing without such rubbers."""
    used = case.materials.levels({layer.material for layer in case.layers})
    other = [level for level in _LEVELS if used and set(used.values()) != {level}]
    return {level: case.materials.at_levels(dict.fromkeys(used, level)) for level in other}


def closure_keys(case: Case) -> dict[str, Any]:
    """Back pressures up to 1.5 times the rated one; those of the case where none is rated. Nothing is followed beyond
    the first limit.
    """
    rated = case.closure.rated_pressure
    keys: dict[str, Any] = {"closure.arclength": False}
    if rated is None:
        return keys
    step = max(case.closure.max_step, 1.5 * rated / 20)
    given = set(case.closure.pressures) if "pressures" in case.closure.model_fields_set else set()
    pressures = sorted({*given, *(float(f"{share * rated:.9g}") for share in _BACK), rated, EXAMINED * rated})
    return keys | {"closure.pressures": pressures, "closure.max_step": step}


def following(found: Gathered) -> Iterator[Run]:
    """Runs that depend on what the heads have shown."""
    case, worst = found.case, found.worst
    if worst is None or case.drive.kind != "flow":
        return
    classes = {"modes.symmetry": "all", "modes.continuity": "case", "drive.pressure": worst}
    yield Run("mesh-modes", "modes", "vibration on the second mesh", second_mesh(case) | classes, 5)
    for level, keys in _other_levels(case).items():
        keys = second_mesh(case) | classes | keys
        yield Run(f"levels-modes-{level:g}", "modes", f"vibration at a strain level of {level:.0%}", keys, 5)
    if case.continuity:
        other = "quasi-steady" if case.fluid.continuity == "storage" else "storage"
        if not (other == "quasi-steady" and case.is_compressed):
            keys = classes | {"modes.symmetry": "SS", "fluid.continuity": other}
            yield Run("law", "modes", f"vibration with {other} flow", keys, 8)
    moves = case.has_line and bool(why_it_moves(case, "pipe_length"))
    # behind a pump a length that moves the state has an operating point of its own
    if case.has_line and not case.upstream.pieces and not (moves and case.has_pump):
        low, high, count = _LENGTHS
        length, quick = case.upstream.length, {}
        if moves and case.valve.is_preset:  # at every length a curve of equilibria from rest on
            quick, count = second_mesh(case) | {"sweep.count": 1, "sweep.least_confidence": 1e-3}, 3
        top = min(high * length, PARAMETERS["pipe_length"].high)
        span = f"pipe_length={low * length:.6g}:{top:.6g}:{count}:log"
        heads = [worst] if moves else sorted({found.heads[0], worst, found.heads[-1]})
        for i, pressure in enumerate(heads, 1):
            keys = quick | {"drive.pressure": pressure, "sweep.over": span}
            yield Run(f"pipe-{i}", "sweep", f"length of the pipe at {case.units.pressure(pressure)}", keys, 5)
    if case.uncertainty.model_fields_set:
        over = {} if case.uncertainty.over else {"drive.pressure": worst}
        yield Run("chance", "uncertainty", "probability of chatter", over, 1.0 * case.uncertainty.samples)
    decided = [(pressure, result) for pressure, result in found.modes.items() if result.stable is not None]
    changed = [(one, other) for one, other in zip(decided, decided[1:]) if one[1].stable != other[1].stable]
    if changed:
        low, high = changed[0][0][0], changed[-1][1][0]
        between = [p for p in found.modes if low < p < high] or [0.5 * (low + high)]  # what is known of them stays so
        over = ",".join(f"{p:.9g}" for p in (low, *between, high))
        keys = {"onset.over": f"pressure={over}", "onset.continuity": "case"}
        yield Run("onset", "onset", "head at which chatter begins", keys | {"onset.symmetry": "all"}, 40)


def cycle_run(found: Gathered) -> Iterator[Run]:
    """A branch of limit cycles from the nearest onset to the state of the case, where it chatters beside one."""
    onset, here = found.get("onset"), Mu.of(found.case)["pressure"]
    nearest = min(found.modes, key=lambda p: abs(p - here), default=None)
    if onset is None or nearest is None or found.modes[nearest].stable is not False:
        return
    own = equilibria_of(found.case.part).name  # whose cycles alone are followed
    known = [p for p in onset.points if p.get("symmetry", own) == own]
    beside = [p for p in known if p["edge"] and (p["value"] < here) == p["gains"] and p["frequency"] > 0]
    if not beside:
        return
    begins = min(beside, key=lambda point: abs(point["value"] - here))
    low, high = sorted((here, begins["value"] + 0.1 * (begins["value"] - here)))
    if begins["gains"]:  # the valve has to be open all the way
        rest = found.case.rest_pressure
        low = max(low, rest + 0.5 * (begins["value"] - rest))
    start = "first" if begins["gains"] else "last"
    keys = {"cycle.over": f"pressure={low:.9g}:{high:.9g}:4", "cycle.start": start}
    keys |= dict.fromkeys(("cycle.start_file", "cycle.start_cycle"))  # of cycles that the case starts elsewhere
    yield Run("cycle", "cycle", "limit cycle", keys, 200)


def gather(
    case: Case, name: str, folder: Path, leave_out: tuple[str, ...] = (), workers: int = 1, quiet: bool = False
) -> Gathered:
    """Run the studies, or take them from the files of an earlier report of the same case. Raises CaseError if the case
    gives no model, or the folder cannot be written.

    Parameters
    ----------
    name : str
        For titles.
    folder : path
        Of the result files, NAME-RUN.h5.
    leave_out : tuple of str
        Names among `PARTS` that are not wanted.
    workers : int
        Processes that share the runs.
    quiet : bool
        Show no bar.
    """
    session = Session(case, name)
    session.mesh  # a case that gives no model is told before anything runs
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise CaseError(f"The folder {str(folder)!r} cannot be written ({error.strerror or error}).") from error
    bar, started = Bar(case.units.say, quiet), _processor_time()
    if case.meets_pump("modes"):
        path = folder / f"{name}-operating-point.h5"
        found = kept_run("steady", session, path, bar.of("operating point"))
        if not found.states:
            raise SolveError(f"The operating point of the pump was not found: {found.failures[0]}")
        session = session.replace({"drive.pressure": found.states[0].pressure})
    bar.expect(list(planned(session.case)))
    if case.seeks_levels or case.valve.cracking_head:
        bar.expect([Run("settled", "levels", "strain levels" if case.seeks_levels else "cracking head", {}, 12)])
        session = session.settle(bar.of("settled"))
        session.at_cracking(bar.of("settled"))
        bar.done("settled")
    given, session = session, session.at_cracking()
    sizes = ValveSizes.of(session.described)
    found = Gathered(session.case, name, heads_of(session.case), sizes, levels=str(session.settled or ""))
    found.missing = dict.fromkeys(leave_out, "It was left out.")
    found.not_asked = set(leave_out)
    studies = _Studies(found, session, folder, workers, bar, given)
    for runs in (planned, following, cycle_run):
        asked = runs(found.case if runs is planned else found)
        studies.make([run for run in asked if not {*run.name.split("-")} & {*leave_out}])
    bar.close()
    found.seconds = _processor_time() - started
    return found


def _processor_time() -> float:
    """Processor time of this process and those that it started and that have ended, s."""
    return sum(os.times()[:4])


@dataclass
class _Studies:
    """Runs of one report, from their files where these are there; `given` has a cracking head in place of the sealing
    pressure that was found for it.
    """

    found: Gathered
    session: Session
    folder: Path
    workers: int
    bar: Bar
    given: Session
    _cracking: dict[str, Session] = field(default_factory=dict)

    def make(self, runs: list[Run]) -> None:
        """Make runs; the steady states first, from which modes start, and the others by several processes."""
        self.bar.expect(runs)
        first = [run for run in runs if run.name == "steady"]
        for run in first:
            self._make(run)
        rest = [run for run in runs if run not in first]
        lost = self._share(rest) if self.workers > 1 and len(rest) > 1 else ()
        for run in rest:
            if run.name in lost:
                self.found.missing[run.name] = Lost.sentence
            else:
                self._make(run)

    def _asked(self, run: Run) -> Session:
        """Session of a run, with the steady state it starts from where that is known."""
        asked = self._walled(run.changes).replace(run.changes)
        if "mesh.around" not in run.changes and "drive.pressure" in run.changes:
            state = self.found.state(run.changes["drive.pressure"])
            asked.start = None if state is None else state.solution()
        return asked

    def _walled(self, changes: dict[str, Any]) -> Session:
        """Session of the case; on another mesh, or with other constants, one that cracks at the same head."""
        wall = {key: value for key, value in changes.items() if key.startswith(("mesh.", "materials."))}
        if not (wall and self.given.case.valve.cracking_head):
            return self.session
        if str(wall) not in self._cracking:
            self._cracking[str(wall)] = self.given.replace(wall).at_cracking()
        return self._cracking[str(wall)]

    def _path(self, run: Run) -> Path:
        return self.folder / f"{self.found.name}-{run.name}.h5"

    def _make(self, run: Run) -> None:
        try:
            header = kept_run(run.kind, self._asked(run), self._path(run), self.bar.of(run.name)).header
            result = load_result(self._path(run))  # without the model, which holds as much memory as all results
            result.record.header = header
            self.found.results[run.name] = result
            for sentence in result.warnings if is_on_own_mesh(run.name) else ():
                self.bar.warn(sentence)
        except (CaseError, SolveError) as error:
            self.found.missing[run.name] = self.found.case.units.say(str(error))
        self.bar.done(run.name)

    def _share(self, runs: list[Run]) -> list[str]:
        """Let several processes fill the files of runs; what fails there is told when the run is made here.

        Returns
        -------
        list of str
            Names of runs over which workers died.
        """
        asked = {}
        for run in sorted(runs, key=lambda run: -run.share):  # longest first
            with suppress(CaseError, SolveError):
                asked[run.name] = Work(_fill, (run.kind, self._asked(run), self._path(run)))
        with Workers(min(self.workers, len(asked)), str, (), self.bar.warn) as team:
            lost = []
            for name, result in team.share(asked, asked.__getitem__):
                self.bar.done(name)
                lost += [name] * (result is Lost)
            return lost


def _fill(_context: str, kind: str, session: Session, path: Path) -> None:
    """Make a run in a process of its own."""
    with suppress(CaseError, SolveError):
        kept_run(kind, session, path)


class Bar:
    """One bar over all runs, with the time that is left; lines where nobody watches a terminal.

    Parameters
    ----------
    say : callable
        Puts the numbers of a sentence into the units of choice.
    quiet : bool
        Show nothing but warnings.
    """

    def __init__(self, say: Callable[[str], str], quiet: bool = False):
        self._say, self._quiet = say, quiet
        self._runs: dict[str, Run] = {}
        self._done: dict[str, float] = {}
        self._warned: set[str] = set()
        self._shown: set[str] = set()
        self._started, self._bar = time.monotonic(), None
        if is_watched() and not quiet:
            from tqdm import tqdm

            form = "{desc}: {percentage:3.0f} % |{bar}| {postfix}"
            self._bar = tqdm(total=1.0, bar_format=form, file=sys.stderr, leave=False, dynamic_ncols=True)

    def expect(self, runs: list[Run]) -> None:
        """Count further runs in."""
        self._runs |= {run.name: run for run in runs}

    def of(self, name: str) -> Observer:
        """Observer of one run."""
        if self._done.get(name, 0.0) < 1.0:
            self._show(name)
        return _Part(self, name)

    def move(self, name: str, share: float) -> None:
        """Say how much of a run is done."""
        self._done[name] = max(min(share, 0.95), self._done.get(name, 0.0))
        self._show(name)

    def done(self, name: str) -> None:
        """Say that a run is done."""
        self._done[name] = 1.0
        self._show(name)

    def left(self) -> str:
        """Time that is left, in words, from what the part that is done has taken."""
        part, elapsed = self.part, time.monotonic() - self._started
        if part < 0.02 or elapsed < 3.0:
            return "time left not known yet"
        left = elapsed * (1 - part) / part
        return f"{left:.0f} s left" if left < 100 else f"{left / 60:.0f} min left"

    @property
    def part(self) -> float:
        """Part of all runs that is done."""
        whole = sum(run.share for run in self._runs.values())
        return sum(self._done.get(name, 0.0) * run.share for name, run in self._runs.items()) / whole if whole else 0.0

    def _show(self, name: str) -> None:
        label = self._runs[name].label if name in self._runs else name
        if self._bar is None and not self._quiet and name not in self._shown:
            print(f"{label} ... ({self.left()})", file=sys.stderr, flush=True)
        self._shown.add(name)
        if self._bar is not None:
            self._bar.n = self.part
            self._bar.set_description_str(label, refresh=False)
            self._bar.set_postfix_str(self.left())

    def warn(self, sentence: str) -> None:
        """Print a warning, once a report."""
        kind = without_numbers(sentence)
        if kind not in self._warned:
            self._warned.add(kind)
            if self._bar is not None:
                self._bar.clear()
            print(f"Warning: {self._say(with_effect(sentence))}", file=sys.stderr, flush=True)

    def close(self) -> None:
        """Take the bar away."""
        if self._bar is not None:
            self._bar.close()


class _Part(Observer):
    """Observer of one run of a report."""

    def __init__(self, bar: Bar, name: str):
        self._bar, self._name, self._total, self._items = bar, name, None, 0

    def begin(self, study: str, total: int | None) -> None:
        self._total = self._total or total

    def item(self, result: object) -> None:
        self._items += 1
        self._bar.move(self._name, self._items / (self._total or 4))

    def warn(self, sentence: str) -> None:
        if is_on_own_mesh(self._name):
            self._bar.warn(sentence)
