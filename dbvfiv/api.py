"""The valve from Python: load a case, ask for states, read results."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property, partial
from pathlib import Path
from typing import Any, overload

from .case.axis import is_single, read_pressures, write_axis
from .case.model import Changes, change_case, made_with
from .drawing.style import draw_figures, write_figures
from .drawing.views import valve_figure
from .errors import CaseError, SolveError, as_path
from .explore import Explorer
from .fit.cards import DampingReport, describe_damping
from .model.valve import ValveModel
from .observer import Observer, Progress, is_watched
from .record.files import kind_of
from .studies.case import Case, load_case
from .studies.closure.study import ClosureResult
from .studies.cycle.study import CycleResult
from .studies.design.study import DesignResult
from .studies.identify.study import IdentifyResult
from .studies.map.study import MapResult
from .studies.modes.study import ModesResult
from .studies.onset.study import OnsetResult
from .studies.response.study import ResponseResult
from .studies.sensitivity.study import SensitivityResult
from .studies.session import Session, named_changes, resume_result
from .studies.state import State, sensitivity_keys
from .studies.steady.study import SteadyResult
from .studies.sweep.study import SweepResult
from .studies.transient.study import TransientResult
from .studies.uncertainty.study import UncertaintyResult
from .studies.workers import read_workers

#: A result file to write; none without it.
Output = str | Path | None
#: A parameter with the values it takes: ``"density=1:1000:40:log"`` or ``{"density": [1, 10, 100]}``.
Range = str | Mapping[str, Sequence[float | str]]


def bar() -> Observer | None:
    """Bar of a run from Python, where there is a terminal or a notebook to show it."""
    return Progress() if is_watched() else None


class Valve:
    """A valve to ask questions of.

    Parameters
    ----------
    case : Case
    name : str
        For titles and file names.

    Attributes
    ----------
    model : ValveModel
        The coupled model, built on first use.

    Examples
    --------
    >>> valve = dbvfiv.load("cases/dbv12.toml")                  # doctest: +SKIP
    >>> state = valve.steady(pressure="36 kPa")                  # doctest: +SKIP
    >>> curve = valve.steady(pressure=[6e3, 18e3, 36e3])         # doctest: +SKIP
    >>> [state.mass_flow for state in curve.states]              # doctest: +SKIP
    """

    def __init__(self, case: Case, name: str = "case"):
        self.case = case
        self.name = name

    def __repr__(self) -> str:
        case, mesh, drive = self.case, self.case.mesh, self.case.drive
        load = f"{drive.pressure / 1e3:.6g} kPa" + (f", {case.fluid.density:g} kg/m3" if drive.kind == "flow" else "")
        return f"<Valve {self.name!r}: {mesh.around} x {mesh.along} elements, {len(case.layers)} layers, {load}>"

    def __getstate__(self) -> dict[str, Any]:
        """Case and name; model and states are found again when they are asked for."""
        return {"case": self.case, "name": self.name}

    @cached_property
    def session(self) -> Session:
        """The case with all that is worked out for it."""
        return Session(self.case, self.name)

    @property
    def model(self) -> ValveModel:
        """The coupled model of the case, with strain levels settled where materials.strain_level is "auto"."""
        return self.session.model

    def plot(self, folder: str | Path = ".", format: str = "png", only: Sequence[str] = ()) -> list[Path]:
        """Draw the valve as its case describes it, with measures, wall and layers; nothing is solved."""
        model = self.session.described
        figures = draw_figures({"valve": lambda: valve_figure(model)}, only, f"case {self.name!r}", self.case.units)
        return write_figures(figures, folder, format)

    def replace(self, changes: Changes) -> Valve:
        """A valve with some keys of its case changed, as `load` takes them: ``{"fluid.density": 10}``."""
        return Valve(change_case(self.case, changes), self.name)

    def damping(self) -> DampingReport:
        """Damping of the wall by the case: materials, fits of their loss factors, damping ratio over frequency.

        Raises
        ------
        CaseError
            For data of a material that cannot be used.
        """
        return describe_damping(self.case)

    @overload
    def steady(self, pressure: float | str) -> State: ...

    @overload
    def steady(self, pressure: Iterable[float | str] | None = None) -> SteadyResult: ...

    def steady(self, pressure=None, *, output: Output = None, observer: Observer | None = None):
        """Equilibria.

        Parameters
        ----------
        pressure : number (Pa), text with a unit, or several of them
            One pressure gives one state; several, or None for those of `Case.steady_pressures`, give a result with all
            states.
        output : path, optional
            Result file, written state by state.
        observer : Observer, optional
            Is told of progress and warnings; a bar by default, where there is a terminal or a notebook.

        Returns
        -------
        State or SteadyResult

        Raises
        ------
        CaseError
            For a pressure that cannot be used or a case that gives no model.
        SolveError
            If one pressure was asked for and not reached. Of several, `failures` of the result names those that were
            not.
        """
        single = is_single(pressure)
        if pressure is None and self.case.meets_pump("steady"):
            return self.session.perform("steady", output, observer or bar())
        asked = self.case.steady_pressures() if pressure is None else [pressure] if single else pressure
        pressures = read_pressures(asked, "drive.pressure" if pressure is None else "pressure", self.case.fluid.density)
        result = self._ask("steady", {"steady.pressures": list(pressures)}, {}, output, observer)
        if not single:
            return result
        if result.failures:
            raise SolveError(result.failures[0])
        if not result.states:
            raise KeyboardInterrupt
        return result.states[0]

    def levels(self, pressure=None, *, output: Output = None, observer: Observer | None = None):
        """Strain levels of the built-in rubbers that agree with what their layers strain, at one or more pressures; a
        `dbvfiv.studies.levels.study.LevelsResult`.
        """
        given = None if pressure is None else [pressure] if is_single(pressure) else list(pressure)
        return self._ask("levels", {"levels.pressures": given}, {}, output, observer)

    def modes(
        self,
        pressure: float | str | None = None,
        *,
        count: int | None = None,
        output: Output = None,
        observer: Observer | None = None,
        **changes: Any,
    ) -> ModesResult:
        """Leading modes of the coupled valve at one pressure: growth rates, frequencies, shapes, and whether the state
        is stable.

        Parameters
        ----------
        pressure : number (Pa) or text with a unit, optional
            drive.pressure of the case by default; 0 is the valve at rest, for modes in vacuo.
        count : int, optional
        output : path, optional
            Result file.
        observer : Observer, optional
        changes
            density, continuity, alpha, beta, ... in place of those of the case, and keys of the section of the study:
            of this one in_vacuo, symmetry, max_frequency and the others of [modes].

        Raises
        ------
        CaseError
            For something that cannot be used.
        SolveError
            If the equilibrium or its modes were not found.

        Examples
        --------
        >>> found = dbvfiv.load().modes("6 kPa", density=10, alpha=0)     # doctest: +SKIP
        >>> found.modes[0].growth_rate, found.stable                      # doctest: +SKIP
        """
        keys = {"drive.pressure": pressure, "modes.count": count}
        return self._ask("modes", keys, changes, output, observer)

    def sweep(
        self,
        over: Range | None = None,
        *,
        count: int | None = None,
        output: Output = None,
        observer: Observer | None = None,
        **changes: Any,
    ) -> SweepResult:
        """Modes tracked along a parameter of load, fluid or damping.

        Parameters
        ----------
        over : str or mapping, optional
            Parameter and values, "density=1:1000:40:log" or {"density": [1, 10, 100]}; sweep.over of the case by
            default.
        count : int, optional
            Leading modes to follow.
        output, observer, changes
            As for `modes`; also pressure, for sweeps over something else.
        """
        return self._ask("sweep", {"sweep.over": write_axis(over), "sweep.count": count}, changes, output, observer)

    def sensitivity(
        self,
        of: str | Sequence[str] = (),
        *,
        mode: int | None = None,
        output: Output = None,
        observer: Observer | None = None,
        **changes: Any,
    ) -> SensitivityResult:
        """Derivatives of the leading mode's growth rate and frequency by the parameters of the valve.

        Parameters
        ----------
        of : str or sequence of str, optional
            Names of parameters, "pressure" or "layer 3 angle"; all that the valve has by default.
        mode : int, optional
            Another mode, by falling growth rate from 1.
        output, observer, changes
            As for `modes`; also pressure.
        """
        return self._ask("sensitivity", sensitivity_keys(of, mode), changes, output, observer)

    def response(
        self,
        over: Range | None = None,
        *,
        noise: float | str | None = None,
        output: Output = None,
        observer: Observer | None = None,
        **changes: Any,
    ) -> ResponseResult:
        """Lip motion, flow and pressure per pressure at the inlet over frequency, and under pressure noise.

        Parameters
        ----------
        over : str or mapping, optional
            Range as for `onset`, at whose values the response is asked; response.over of the case by default.
        noise : float or str, optional
            Root mean square of white pressure noise, Pa.
        output, observer, changes
            As for `modes`; also pressure.
        """
        asked = {"response.over": write_axis(over), "response.noise": noise}
        return self._ask("response", asked, changes, output, observer)

    def identify(
        self,
        records: Sequence[Mapping[str, Any]] | None = None,
        over: Range | None = None,
        *,
        workers: int | str | None = None,
        output: Output = None,
        observer: Observer | None = None,
        **changes: Any,
    ) -> IdentifyResult:
        """Identification of the uncertain inputs by measured records, and of where flutter begins.

        Parameters
        ----------
        records : sequence of mapping, optional
            Each with ``file`` or ``frequency`` and its interval, and ``at``; identify.records of the case by default.
        over : str or mapping, optional
            Range as for `onset`, over which the onset is sought.
        workers : int or str, optional
            As for `uncertainty`.
        output, observer, changes
            As for `modes`: samples, rounds.
        """
        given = None if records is None else [dict(record) for record in records]
        for record in given or ():
            if isinstance(record.get("file"), str | Path):  # a case that is written elsewhere finds it too
                record["file"] = str(Path(record["file"]).resolve())
        asked = {"identify.records": given, "identify.over": write_axis(over)}
        shared = None if workers is None else read_workers(workers)
        return self._ask("identify", asked, changes, output, observer, workers=shared)

    def closure(
        self,
        pressure: float | str | Iterable[float | str] | None = None,
        *,
        output: Output = None,
        observer: Observer | None = None,
    ) -> ClosureResult:
        """Equilibria under back pressure: whether, where and how firmly the valve shuts.

        Parameters
        ----------
        pressure : number (Pa), text with a unit, or several of them, optional
            Those of the case by default.
        output : path, optional
            Result file, written state by state.
        observer : Observer, optional

        Raises
        ------
        CaseError
            For a pressure that cannot be used or a case that gives no model.

        Examples
        --------
        >>> result = dbvfiv.load().closure(["7 kPa", "28 kPa"])          # doctest: +SKIP
        >>> result.states[-1].closed, result.critical_pressure           # doctest: +SKIP
        >>> result.safety.factor, result.safety.limit                    # doctest: +SKIP
        """
        asked = self.case.closure.pressures if pressure is None else [pressure] if is_single(pressure) else pressure
        pressures = read_pressures(asked, "pressure", self.case.fluid.density)
        return self._ask("closure", {"closure.pressures": list(pressures)}, {}, output, observer)

    def onset(
        self, over: Range | None = None, *, output: Output = None, observer: Observer | None = None, **changes: Any
    ) -> OnsetResult:
        """Every onset along one parameter: where the valve loses or regains stability.

        Parameters
        ----------
        over : str or mapping, optional
            Parameter, or a range as for `sweep`; onset.over of the case by default.
        output : path, optional
            Result file, written sample by sample; `dbvfiv.resume` continues it.
        observer, changes
            As for `modes`; also pressure, for onsets over something else.

        Raises
        ------
        CaseError, SolveError
        """
        return self._ask("onset", {"onset.over": write_axis(over)}, changes, output, observer)

    def cycle(
        self, over: Range | None = None, *, output: Output = None, observer: Observer | None = None, **changes: Any
    ) -> CycleResult:
        """Limit cycles followed from an onset along one parameter.

        Parameters
        ----------
        over : str or mapping, optional
            Range as for `sweep`; cycle.over of the case by default.
        output, observer, changes
            As for `onset`.

        Examples
        --------
        >>> found = dbvfiv.load("cases/light-fluid.toml").cycle("density=25:60:8")     # doctest: +SKIP
        """
        return self._ask("cycle", {"cycle.over": write_axis(over)}, changes, output, observer)

    def map(
        self,
        x: Range | None = None,
        y: Range | None = None,
        *,
        workers: int | str | None = None,
        output: Output = None,
        observer: Observer | None = None,
        **changes: Any,
    ) -> MapResult:
        """Stability over two parameters: growth rate of the leading mode, and onset curves.

        Parameters
        ----------
        x, y : str or mapping, optional
            Ranges as for `sweep`; map.x and map.y of the case by default.
        workers : int or str, optional
            Processes that share the columns, or the address of a Dask scheduler; map.workers of the case by default.
            Under ``mpiexec`` with mpi4py all its processes.
        output : path, optional
            Result file, written column by column; `dbvfiv.resume` continues it.
        observer, changes
            As for `modes`; also pressure, for maps over something else.

        Raises
        ------
        CaseError, SolveError
        """
        asked = {"map.x": write_axis(x), "map.y": write_axis(y)}
        shared = None if workers is None else read_workers(workers)
        return self._ask("map", asked, changes, output, observer, workers=shared)

    def uncertainty(
        self,
        over: Range | None = None,
        *,
        samples: int | None = None,
        inputs: Mapping[str, str] | None = None,
        workers: int | str | None = None,
        output: Output = None,
        observer: Observer | None = None,
        **changes: Any,
    ) -> UncertaintyResult:
        """Probability of flutter where inputs are known to a spread only, and the input that decides it.

        Parameters
        ----------
        over : str or mapping, optional
            Range as for `onset`, at whose values the probability is asked; uncertainty.over of the case by default.
        samples : int, optional
            Of the inputs.
        inputs : mapping, optional
            Distributions by the names of parameters or keys of the case, {"loss_factor": "lognormal(1.3)"}.
        workers : int or str, optional
            As for `map`.
        output, observer, changes
            As for `onset`.

        Raises
        ------
        CaseError, SolveError
        """
        asked = {"uncertainty.over": write_axis(over), "uncertainty.samples": samples, "uncertainty.inputs": inputs}
        if workers is not None:
            asked["uncertainty.workers"] = workers
        return self._ask("uncertainty", asked, changes, output, observer)

    def design(
        self,
        variables: Mapping[str, str] | None = None,
        *,
        aim: str | None = None,
        constraints: Sequence[str] | None = None,
        cases: str | Path | None = None,
        output: Output = None,
        observer: Observer | None = None,
        **changes: Any,
    ) -> DesignResult:
        """Better valves within bounds, each verified on a finer mesh.

        Parameters
        ----------
        variables : mapping, optional
            Bounds by the names of parameters or keys of the case, {"thickness": "0.7:1.4"}.
        aim : str, optional
            "loss coefficient at 2 m down"; design.aim of the case by default.
        constraints : sequence of str, optional
            "margin from 0.1 m to 5 m at least 5 %"; design.constraints by default.
        cases : path, optional
            Folder for the case file of each design.
        output, observer, changes
            As for `onset`.

        Raises
        ------
        CaseError, SolveError
        """
        asked = {"design.variables": variables, "design.aim": aim, "design.constraints": constraints}
        folder = None if cases is None else Path(cases)
        return self._ask("design", asked, changes, output, observer, cases=folder)

    def transient(
        self,
        duration: float | str | None = None,
        *,
        output: Output = None,
        observer: Observer | None = None,
        **changes: Any,
    ) -> TransientResult:
        """A time history of the coupled valve that ends with a verdict; see
        `dbvfiv.studies.transient`.

        Parameters
        ----------
        duration : number (s) or text with a unit, optional
            That of the case by default.
        output : path, optional
            Result file, written while the run goes on; `dbvfiv.resume` continues it.
        observer : Observer, optional
        changes
            As for `modes`: pressure, density, continuity, alpha, beta.

        Raises
        ------
        CaseError
            For a start or a drive that cannot be used.
        SolveError
            If there is no first state. A step that is not found ends the run, which keeps what it has.
        """
        return self._ask("transient", {"transient.duration": duration}, changes, output, observer)

    def explore(self) -> Explorer:
        """Answers at one parameter point after another in the time of a slider; see `dbvfiv.explore`.

        Raises
        ------
        CaseError, SolveError
            For a case without flow, or with a pump.
        """
        return Explorer(self.session)

    def _ask(self, kind: str, keys: dict, given: dict, output: Output, observer: Observer | None, **choices) -> Any:
        """Result of a study with keys and named arguments put into its case; None stands for nothing given."""
        session = self.session.prepared(kind, keys | named_changes(given, kind))
        return session.perform(kind, output, observer or bar(), **choices)


def load(case: str | Path | Case | None = None, changes: Changes | None = None) -> Valve:
    """A valve from a case file; the 12-inch valve without one.

    Parameters
    ----------
    case : path or Case, optional
    changes : mapping or texts, optional
        Keys to change, ``{"fluid.density": "10 kg/m^3"}`` or ``["fluid.density=10 kg/m^3"]``.

    Raises
    ------
    CaseError
        One sentence: which key, what was given, what is allowed.
    """
    name = "dbv12" if case is None else "case" if isinstance(case, Case) else as_path(case, "A case file").stem
    if isinstance(case, Case):
        return Valve(case if changes is None else change_case(case, changes), name)
    return Valve(made_with(partial(load_case, case), {} if changes is None else changes), name)


#: What a resumed study may be given anew, the studies that take it, and what it is called in a sentence.
_OWN = {
    "duration": (("transient",), "A new duration belongs to transient runs"),
    "workers": (("map", "uncertainty", "identify"), "Workers belong to maps, uncertainties and identifications"),
}


def resume(
    path: str | Path,
    *,
    duration: float | str | None = None,
    workers: int | str | None = None,
    observer: Observer | None = None,
) -> Any:
    """Continue an interrupted or killed study in its file.

    Parameters
    ----------
    path : path
        Result file; its case says what is still to do.
    duration : number (s) or text with a unit, optional
        Of a transient run: a later end.
    workers : int or str, optional
        Of a map, an uncertainty or an identification: processes that share it, or the address of a Dask scheduler.
    observer : Observer, optional

    Returns
    -------
    StudyResult
        As of the study itself.

    Raises
    ------
    CaseError
        If the file cannot be read, or there is nothing left to do.

    Examples
    --------
    >>> run = dbvfiv.resume("run.h5", duration="2 s")     # doctest: +SKIP
    """
    kind = kind_of(path)
    given = {"duration": duration, "workers": workers}
    for name, value in given.items():
        owners, words = _OWN[name]
        if value is not None and kind not in owners:
            raise CaseError(f"{words}; {str(path)!r} is of kind {kind!r}.")
    changes = {} if duration is None else {"transient.duration": duration}
    return resume_result(path, observer, changes, **({} if workers is None else {"workers": read_workers(workers)}))
