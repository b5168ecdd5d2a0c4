"""A case with all that is worked out for it once: model, equilibria, and the studies declared that are asked of it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from importlib import import_module
from pathlib import Path
from typing import Any

from ..case.distribution import Distribution
from ..case.materials import HIGHEST_LEVEL
from ..case.parameters import PARAMETERS, Parameter
from ..errors import CaseError, attempt
from ..model.equilibria import (
    find_equilibrium,
    model_warnings,
    operating_pressure,
    redescribe,
    rest_state,
    sealing_for_cracking,
    state_warnings,
)
from ..model.sizes import hoop_strain
from ..model.state import SteadyState
from ..model.strain_level import SettledLevels, settle_levels
from ..model.valve import ValveModel
from ..observer import Observer
from ..record.files import Header, check_folder, check_writable, kind_of, refuse_read
from ..record.mesh import MeshData
from ..record.record import GrowingRecord, Record, StoredRecord
from ..record.table import Column, Shown, TableSpec, printed_head, printed_row
from ..runtime import free_memory
from . import KINDS
from .case import Case, oddities, require_consistent


@dataclass(frozen=True)
class Study:
    """One analysis that the program offers."""

    kind: str  #: Name of the command, of the section of the case file and of the result.
    tables: Callable[[MeshData], tuple[TableSpec, ...]]  #: From the mesh of a valve to the tables of a result.
    #: ``run(session, record, **choices)`` finds what is asked for and keeps it in the record, a `GrowingRecord`. What
    #: the record holds already, from an interrupted attempt, is not computed again. Ctrl-C may end it at any point.
    run: Callable[..., None]
    result: type[Any]  #: `StudyResult` of its records.
    #: Raises the `CaseError` or `SolveError` of a case that the study cannot answer, before anything is solved.
    check: Callable[[Case], Any] = lambda _case: None
    #: From what an earlier attempt kept and the case as it is to go on, to how many rows of each table the run goes on
    #: from. Without it a run goes on from all rows.
    rows_to_keep: Callable[[Record, Case], Mapping[str, int]] | None = None
    #: A complete run can go on, to a later end; ``rows_to_keep`` refuses one without it by a `CaseError`. Other studies
    #: that are complete are refused.
    extends: bool = False
    #: From the case to what writes an item that was found as a line of a table, as soon as it is; the first line has
    #: the head of the table above it. Without it everything is printed at the end.
    live: Callable[[Case], Callable[[Any], str]] | None = None
    #: From results to what tells them apart: ``labels``, ``lines()``, ``document()`` and the figure, ``draw()``.
    compare: Callable[[Sequence[Any]], Any] | None = None
    #: Choices that are names of what a run writes besides its result: of a file, with an empty text, or of a folder,
    #: with a pattern of the files in it.
    files: Mapping[str, str] = field(default_factory=dict)


def show_parameter(row: Parameter) -> Shown:
    """Print format of values of a parameter, `value` of a row."""
    value = Column("value", "", row.title)
    return Shown(row.name, row.shown_unit, 12, lambda one: f"{value.of(one) / row.scale:.6g}")


def print_rows(columns: Iterable[Column]) -> Callable[[Any], str]:
    """Writer of the lines of a table as its rows are found; a text is a title of those that follow."""
    columns = tuple(columns)
    head = [*printed_head(columns)]

    def write(item: Any) -> str:
        if isinstance(item, str):
            head[:] = printed_head(columns)
            return item
        lines = [*head, printed_row(columns, item)]
        head.clear()
        return "\n".join(lines)

    return write


def find_study(kind: str) -> Study:
    """The study of a kind; its folder is imported when it is first asked for. Raises KeyError if there is none."""
    if kind not in KINDS:
        raise KeyError(kind)
    return import_module(f"{__package__}.{kind}.study").STUDY


#: Keyword arguments of the Python interface for every study, and the keys of the case that they stand for.
KEYWORDS = {row.name: row.key for row in PARAMETERS.values() if row.swept} | {"continuity": "fluid.continuity"}


def named_changes(given: Mapping[str, Any], kind: str = "") -> dict[str, Any]:
    """Changes of a case from keyword arguments, those of every study and the keys of the section of the one asked;
    those that are None are left out. Raises CaseError for a name that is nothing to choose.
    """
    own = Case.model_fields[kind].annotation.model_fields if kind else ()
    band = {"max_frequency": "modes.max_frequency"} if kind else {}  # up to which all of them search
    known = band | {name: f"{kind}.{name}" for name in own} | KEYWORDS
    if unknown := [name for name in given if name not in known]:
        raise CaseError(f"{unknown[0]!r} is given, which is nothing to choose here; known are {', '.join(known)}.")
    return {known[name]: value for name, value in given.items() if value is not None}


def describe_surroundings(case: Case) -> dict[str, Any]:
    """Fluid, damping and strain levels of a case, for JSON."""
    damping = {name: getattr(case.damping, name) for name in ("alpha", "beta", "loss_factor")}
    known = {name: value for name, value in damping.items() if not case.damping.lacks(name)}
    outside = {"outside": case.outside.words} if case.outside.is_there else {}
    levels = case.materials.levels({layer.material for layer in case.layers})
    strained = {"strain_level": levels} if levels else {}
    return {"density": case.fluid.density, "continuity": case.fluid.continuity} | known | outside | strained


#: What a session builds of its case.
_MODELS = ("described", "model", "mesh")


class Session:
    """Valve of a case, with its model, mesh and equilibria, as studies need them.

    Parameters
    ----------
    name : str
        For titles and file names.
    start : SteadyState, optional
        An equilibrium that is known already.

    Attributes
    ----------
    model : ValveModel
        The coupled model, built on first use, with settled strain levels.
    mesh : MeshData
    """

    def __init__(self, case: Case, name: str = "case", start: SteadyState | None = None):
        self.case, self.name, self.start = case, name, start
        #: Session that this one changes some keys of, and these: its strain levels are those of that session.
        self.origin: tuple[Session, dict[str, Any]] | None = None
        #: Session with the same wall and load, of which this one has the model.
        self.same: Session | None = None
        #: How its strain levels were settled, which every study of it tells.
        self.settled: SettledLevels | None = None
        self._at_levels: Session | None = None
        self._cracks: Session | None = None

    def __repr__(self) -> str:
        return f"<Session of {self.name!r}>"

    def __getstate__(self) -> dict[str, Any]:
        """Without the model, which is built again when it is asked for."""
        return {name: value for name, value in vars(self).items() if name not in _MODELS} | {"same": None}

    @cached_property
    def model(self) -> ValveModel:
        """The coupled model of the case. Raises CaseError if the case gives no model."""
        if self.same is not None:
            return self.same.model
        if self.case.seeks_levels:
            return self.settle().model
        return self.at_cracking().model if self.case.valve.cracking_head else self.described

    def at_cracking(self, observer: Observer | None = None) -> Session:
        """The session with the sealing pressure that valve.cracking_head asks for; itself without one."""
        if not self.case.valve.cracking_head:
            return self
        if self._cracks is None:
            ratio = self.case.steady.cracking_area
            found = attempt(lambda: sealing_for_cracking(self.case, ratio, observer))
            self._cracks = self.replace({"valve.cracking_head": None, "valve.sealing_pressure": found})
        return self._cracks

    @cached_property
    def described(self) -> ValveModel:
        """The model before anything is solved: rubbers whose strain levels are sought have the lowest tested ones.
        Raises CaseError if the case gives no model, or asks for a pressure that no wall like it bears.
        """
        if self.same is None:
            free_memory()
            model = attempt(lambda: ValveModel(self.case))
        else:
            model = self.same.described
        self.require_borne(model)
        return model

    def require_borne(self, model: ValveModel, kind: str = "", **asked: float) -> None:
        """Refuse pressures of the case, those that a study names and that are asked too, that no wall like its
        bears.
        """
        behind = self.case.rest_pressure - self.case.level_pressure  # what is around the wall bears it too
        opening, closed = self.case.straining_pressures()
        named = [("drive.pressure", opening, behind), ("closure.rated_pressure", closed, 0.0)]
        named += [(key, max(values), behind) for key, values in self.case.ranged_pressures(kind)]
        named += [(name, pressure, behind) for name, pressure in asked.items()]
        for name, pressure, around in named:
            if pressure and (strain := hoop_strain(model, pressure - around)) > HIGHEST_LEVEL:
                said = (
                    f"{name} is {pressure / 1e3:.4g} kPa at most, which strains the round wall at the inlet by "
                    f"{strain:.0%} around, more than the {HIGHEST_LEVEL:.0%} of the tests of rubber; give what it "
                    "bears."
                )
                raise CaseError(self.case.units.say(said), key=name)

    @cached_property
    def mesh(self) -> MeshData:
        return MeshData.of(self.described)

    def replace(self, changes: Mapping[str, Any]) -> Session:
        """A session with some keys of its case changed, and its strain levels kept; the same one if none is.

        The model stays where only keys of studies change.
        """
        if not changes:
            return self
        session = Session(self.case.replace(changes), self.name)
        session.settled = self.settled
        if self.case.seeks_levels:
            session.origin = self, dict(changes)
        if {key.partition(".")[0] for key in changes} <= set(KINDS):
            session.same = self.same or self
        return session

    def prepared(self, kind: str, changes: Mapping[str, Any]) -> Session:
        """The session with what a study is asked for put into its case; None stands for nothing given. Raises CaseError
        for a key that cannot be used, and for a value of a parameter that the range of the study moves; where records
        are identified, they were taken at that value.
        """
        given = {key: value for key, value in changes.items() if value is not None}
        for name in ("over", "x", "y") if kind != "identify" else ():
            text = str(given.get(key := f"{kind}.{name}") or getattr(getattr(self.case, kind), name, ""))
            row = PARAMETERS.get(text.partition("=")[0].strip())
            if row is not None and row.key in given:
                raise CaseError(
                    f"{row.name} is given as {given[row.key]!r}, but {key} = {text!r} moves it; one of them has to go."
                )
        inputs = given.get("uncertainty.inputs", self.case.uncertainty.inputs) if kind == "uncertainty" else {}
        for name, text in inputs.items():
            row = next((row for row in PARAMETERS.values() if name in (row.name, row.key) and row.key in given), None)
            if row is not None and not Distribution.is_relative(text, row.quantity, self.case.fluid.density):
                raise CaseError(
                    f"{row.name} is given as {given[row.key]!r}, but uncertainty.inputs holds {name} = {text!r}; one "
                    "of them has to go, or the input be relative, such as 'normal(5 %)'.",
                    key="uncertainty.inputs",
                )
        return self.replace(given)

    def settle(self, observer: Observer | None = None) -> Session:
        """The session with strain levels for materials.strain_level = "auto"; itself where none are sought.

        They are settled once, with the largest pressures of the case that was loaded: what a study is asked for does
        not change them.
        """
        if not self.case.seeks_levels:
            return self
        if self._at_levels is None and self.origin is not None:
            origin, changes = self.origin
            self._at_levels = origin.settle(observer).replace(changes).settle(observer)
        elif self._at_levels is None:
            found = attempt(lambda: settle_levels(self.case, *self.case.straining_pressures(), observer))
            self._at_levels = Session(self.case.replace(self.case.materials.at_levels(found.levels)), self.name)
            self._at_levels.settled = found
        return self._at_levels

    def equilibrium(self, observer: Observer, known: Sequence[SteadyState] = ()) -> SteadyState:
        """The steady state at drive.pressure: one known already, the valve at rest, or by load steps. Raises SolveError
        if it is not reached.

        What is worth knowing about the state is told to the observer, again where it is known.
        """
        model, pressure = self.model, self.case.drive.pressure
        starts = known or [start for start in [self.start] if start is not None and start.pressure == pressure]
        if not starts and pressure != model.flow.back:
            return find_equilibrium(model, pressure, observer)
        for sentence in state_warnings(model, starts):
            observer.warn(sentence)
        # flow and jet follow the density of this case
        return redescribe(model, starts[0]) if starts else rest_state(model)

    def perform(
        self, kind: str, output: str | Path | None = None, observer: Observer | None = None, **choices: Any
    ) -> Any:
        """Run a study of the case. Raises CaseError if the case or the file cannot be used. Raises SolveError if
        nothing can be found at all.

        Parameters
        ----------
        kind : str
            Of the study; see `dbvfiv.studies.KINDS`.
        output : path, optional
            Result file, written while the study runs.
        observer : Observer, optional
            Is told of progress, items and warnings.
        choices
            What the study takes that is no key of the case.

        Returns
        -------
        StudyResult
            Of an interrupted or failed run too: with what it found.
        """
        require_consistent(self.case, kind)
        study = find_study(kind)
        for name in study.files:
            _require_new(choices.get(name), study.files[name])
        study.check(self.case)
        refuse_read(self.case, output)
        if self.case.ranged_pressures(kind):
            self.require_borne(self.described, kind)
        session = self.asked(kind, observer)
        if session is not self:
            return session.perform(kind, output, observer, **choices)
        header = Header.of(kind, self.case, self.name)
        return self._run(kind, header, output, observer, None, choices)

    def asked(self, kind: str, observer: Observer | None = None) -> Session:
        """The session that a study runs on: what its case leaves to be found is found; itself where nothing is. Raises
        CaseError, SolveError.
        """
        settled = self if kind == "levels" else self.settle(observer)
        return settled.at_cracking(observer)._at_operating_point(kind, observer)

    def _at_operating_point(self, kind: str, observer: Observer | None) -> Session:
        """The session with the pressure at which valve and pump meet; itself where a study does not seek it."""
        if not self.case.meets_pump(kind):
            return self
        pressure = operating_pressure(self.model, observer)
        changes: dict[str, Any] = {"drive.pressure": pressure}
        if kind == "steady":
            changes["steady.pressures"] = [pressure]
        return self.replace(changes)

    def resume(self, known: Record, observer: Observer | None = None, **choices: Any) -> Any:
        """Go on with a run in its file; `known` is what it holds."""
        find_study(known.header.kind).check(self.case)
        header = Header(**(vars(known.header) | {"case": self.case, "complete": False}))
        return self._run(header.kind, header, known.path, observer, known, choices)

    def _run(self, kind, header, output, observer, known, choices) -> Any:
        study = find_study(kind)
        mesh = self.mesh  # a case that gives no model is told before a file is touched
        with GrowingRecord(header, mesh, study.tables(mesh), output, observer, known) as record:
            complete = False
            record.warn(*oddities(self.case))
            if self.settled is not None:
                record.note("settled", text=str(self.settled), warnings=[*self.settled.warnings])
            for note in record.notes("settled")[-1:]:  # of the first attempt where it goes on
                record.warn(*note.get("warnings", ()))
            record.first = model_warnings(self.described)
            try:
                study.run(self, record, **_with_files(study, record, choices))
                complete = True
            except KeyboardInterrupt:
                record.end(True)
            else:
                record.end(False)
            record.conclude(complete)
        return study.result(record, self)


#: Note of files that a run writes besides its result.
_FILES = "files"


def _require_new(path: Path | None, pattern: str) -> None:
    """Refuse a name that is taken or cannot be written, before anything is computed. Raises CaseError.

    Parameters
    ----------
    pattern : str
        Of the files that are written into it, of a folder, which may be there.
    """
    if path is None:
        return
    taken = next(path.glob(pattern), None) if pattern else path if path.exists() else None
    if taken is not None:
        raise CaseError(f"{str(taken)!r} exists already and is not overwritten; choose another name.")
    check_writable(path / pattern if pattern else path)


def _with_files(study: Study, record: GrowingRecord, choices: Mapping[str, Any]) -> dict[str, Any]:
    """Choices of a run, whose files the record keeps: a run that goes on has them from there."""
    given = {name: str(choices[name].absolute()) for name in study.files if choices.get(name) is not None}
    if given:
        record.note(_FILES, given=given)
        return dict(choices)
    kept = {name: Path(path) for note in record.notes(_FILES)[-1:] for name, path in note["given"].items()}
    return {name: path for name, path in kept.items() if _is_free(record, path)} | dict(choices)


def _is_free(record: GrowingRecord, path: Path) -> bool:
    """True for a name that a run which goes on may still write to; a warning where it may not, and the run ends without
    it.
    """
    why = "is there by now" if path.is_file() else ""
    try:
        check_folder(path.parent)
    except OSError as error:
        why = f"cannot be written any more ({error.strerror})"
    if why:
        record.warn(f"The case file that was asked for is left out: {str(path)!r} {why}; `info --case` writes it.")
    return not why


def load_result(path: str | Path) -> Any:
    """Read a result file of any kind.

    Raises
    ------
    CaseError
        One sentence: what is wrong with the file.
    """
    return _find(path).result(_read(path))


def resume_result(path: str | Path, observer: Observer | None = None, changes: Mapping[str, Any] = {}, **choices: Any):
    """Go on with an interrupted or killed study in its file. Raises CaseError if the file cannot be read or there is
    nothing left to do.

    Parameters
    ----------
    changes : mapping
        Keys of the case that are changed, such as a later end.
    choices
        What the study takes that is no key of the case.

    Returns
    -------
    StudyResult
    """
    check_writable(path)  # what another process is about to add must not be missed
    study, known = _find(path), _read(path)
    if known.complete and not study.extends:
        raise CaseError(f"The {study.kind} run in {str(path)!r} is complete; there is nothing to resume.")
    session = Session(known.header.rebuildable_case(), known.header.name).replace(changes)
    if study.rows_to_keep is not None:
        known.cut(study.rows_to_keep(known, session.case))
    return session.resume(known, observer, **choices)


def kept_run(kind: str, session: Session, path: Path, observer: Observer | None = None, **choices: Any) -> Any:
    """The result of a study: from its file where that holds the same case, else computed into it. Raises
    KeyboardInterrupt if the run was interrupted; what was found is in the file. Raises CaseError, SolveError.

    Parameters
    ----------
    kind : str
        Of the study.
    path : path
        Result file. One of another case, or of another version of the program, is written over.
    observer : Observer, optional
    choices
        What the study takes that is no key of the case.
    """
    session = session.asked(kind, observer)
    kept = None
    with suppress(CaseError):  # of another version, or no result at all
        kept = load_result(path) if path.exists() else None
    # these compute nothing, and say how it is told
    sheet = {name: getattr(session.case, name) for name in ("project", "report")}
    own = kept is not None and (kept.kind, kept.header.program) == (kind, Header.program)
    if own and kept.case.model_copy(update=sheet) == session.case:
        result = kept if kept.record.complete else resume_result(path, observer, **choices)
    else:
        result = session.perform(kind, path, observer, **choices)
    if not result.record.complete:
        raise KeyboardInterrupt
    result.record.header = replace(result.header, case=result.case.model_copy(update=sheet))
    return result


def _find(path: str | Path) -> Study:
    kind = kind_of(path)
    try:
        return find_study(kind)
    except KeyError:
        raise CaseError(f"{str(path)!r} holds a result of kind {kind!r}, which this version does not know.") from None


def _read(path: str | Path) -> StoredRecord:
    return StoredRecord(path, _find(path).tables, Case)
