"""A case with all that is worked out for it once: model, equilibria, and the studies that are asked of it."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Any

from ..case.parameters import PARAMETERS
from ..errors import CaseError
from ..model import ValveModel
from ..model.equilibria import find_equilibrium, redescribe, rest_state
from ..model.operating_point import operating_pressure
from ..model.state import SteadyState
from ..model.strain_level import agree_levels
from ..observer import Observer
from ..record.files import check_writable, kind_of
from ..record.header import Header
from ..record.mesh import MeshData
from ..record.part import RecordPart
from ..record.record import GrowingRecord, Record, StoredRecord
from . import KINDS
from .case import Case
from .study import Study, find_study, nothing_to_resume

#: Keyword arguments of the Python interface and the keys of the case that they stand for.
KEYWORDS = {row.name: row.key for row in PARAMETERS.values() if row.swept} | {
    "continuity": "fluid.continuity",
    "in_vacuo": "modes.in_vacuo",
    "symmetry": "modes.symmetry",
    "max_frequency": "modes.max_frequency",
}


def named_changes(given: Mapping[str, Any]) -> dict[str, Any]:
    """Changes of a case from keyword arguments; those that are None are left out.

    Raises
    ------
    CaseError
        For a name that is nothing to choose.
    """
    unknown = [name for name in given if name not in KEYWORDS]
    if unknown:
        raise CaseError(f"{unknown[0]!r} is given, which is nothing to choose here; known are {', '.join(KEYWORDS)}.")
    return {KEYWORDS[name]: value for name, value in given.items() if value is not None}


def describe_surroundings(case: Case) -> dict[str, Any]:
    """Fluid and damping of a case, for JSON."""
    damping = {name: getattr(case.damping, name) for name in ("alpha", "beta", "loss_factor")}
    known = {name: value for name, value in damping.items() if not case.damping.lacks(name)}
    outside = {"outside": case.outside.words} if case.outside.is_there else {}
    return {"density": case.fluid.density, "continuity": case.fluid.continuity} | known | outside


class Session:
    """What studies ask about a valve.

    Parameters
    ----------
    case : Case
    name : str
        For titles and file names.
    start : SteadyState, optional
        An equilibrium that is known already.

    Attributes
    ----------
    model : ValveModel
        The coupled model, built on first use.
    mesh : MeshData
    """

    def __init__(self, case: Case, name: str = "case", start: SteadyState | None = None):
        self.case, self.name, self.start = case, name, start

    def __getstate__(self) -> dict[str, Any]:
        """Without the model, which is built again when it is asked for."""
        return {"case": self.case, "name": self.name, "start": self.start}

    @cached_property
    def model(self) -> ValveModel:
        """The coupled model of the case.

        Raises
        ------
        CaseError
            If the case gives no model.
        """
        try:
            model = ValveModel(self.case)
            model.shell.energies  # built on first use otherwise, and it is here that an invalid metric shows
            return model
        except CaseError:
            raise
        except ValueError as error:  # what geometry, mesh and shell refuse
            raise CaseError(str(error)) from error

    @cached_property
    def mesh(self) -> MeshData:
        return MeshData.of(self.model)

    def replace(self, changes: Mapping[str, Any]) -> Session:
        """A session with some keys of its case changed; the same one if none is.

        The model stays where only keys of studies change.
        """
        if not changes:
            return self
        session = Session(self.case.replace(changes), self.name)
        if {key.partition(".")[0] for key in changes} <= set(KINDS):
            session.__dict__.update({name: self.__dict__[name] for name in ("model", "mesh") if name in self.__dict__})
        return session

    def equilibrium(self, observer: Observer) -> SteadyState:
        """The steady state at drive.pressure: the one known already, the valve at rest, or by load steps.

        What is worth knowing about model and state is told to the observer.

        Raises
        ------
        SolveError
            If it is not reached.
        """
        model, pressure = self.model, self.case.drive.pressure
        if self.start is not None and self.start.pressure == pressure:
            return redescribe(model, self.start)  # flow and jet follow the density of this case
        if pressure == model.flow.back:
            return rest_state(model)
        return find_equilibrium(model, pressure, observer)

    def perform(
        self, kind: str, output: str | Path | None = None, observer: Observer | None = None, **choices: Any
    ) -> Any:
        """Run a study of the case.

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

        Raises
        ------
        CaseError
            If the case or the file cannot be used.
        SolveError
            If nothing can be found at all.
        """
        if self.case.seeks_levels and kind != "levels":
            return self._at_own_levels(kind, observer).perform(kind, output, observer, **choices)
        if self.case.meets_pump(kind):
            return self._at_operating_point(kind, observer).perform(kind, output, observer, **choices)
        header = Header.of(kind, self.case, self.name)
        return self._run(kind, header, output, observer, None, choices)

    def _at_own_levels(self, kind: str, observer: Observer | None) -> Session:
        """The session of the case with the strain levels that agree with its state at the pressure of a study."""
        if self.case.meets_pump(kind) or self.case.drive.kind != "flow":
            raise CaseError(
                "materials.strain_level is 'auto', which needs a steady flow at a known pressure; give drive.pressure "
                "with drive.kind = 'flow' and no operating point of a pump to look for, or a level.",
                "materials.strain_level",
            )
        pressure = max(self.case.steady_pressures()) if kind == "steady" else self.case.drive.pressure
        found = agree_levels(self.case, pressure, observer)
        if observer is not None:
            levels = ", ".join(f"{name} {100 * level:.4g} %" for name, level in found.levels.items())
            observer.warn(f"Strain levels that agree with the state at {pressure:.6g} Pa: {levels}.")
            for sentence in found.bounded():
                observer.warn(sentence)
        return Session(found.case, self.name, found.state)

    def _at_operating_point(self, kind: str, observer: Observer | None) -> Session:
        """The session of the case with the pressure at which valve and pump meet."""
        pressure = operating_pressure(self.model, observer)
        changes: dict[str, Any] = {"drive.pressure": pressure}
        if kind == "steady":
            changes["steady.pressures"] = [pressure]
        return Session(self.case.replace(changes), self.name)

    def resume(self, known: Record, observer: Observer | None = None, **choices: Any) -> Any:
        """Go on with a run in its file; `known` is what it holds."""
        header = Header(**(vars(known.header) | {"case": self.case, "complete": False}))
        return self._run(header.kind, header, known.path, observer, known, choices)

    def _run(self, kind, header, output, observer, known, choices) -> Any:
        study = find_study(kind)
        mesh = self.mesh  # a case that gives no model is told before a file is touched
        with GrowingRecord(header, mesh, study.tables(mesh), output, observer, known) as record:
            complete = False
            try:
                study.run(self, record, **choices)
                complete = True
            except KeyboardInterrupt:
                record.end(True)
            else:
                record.end(False)
            record.conclude(complete)
        return study.result(record, self)


def load_result(path: str | Path) -> Any:
    """Read a result file of any kind.

    Raises
    ------
    CaseError
        One sentence: what is wrong with the file.
    """
    return _find(path).result(_read(path))


def resume_result(path: str | Path, observer: Observer | None = None, changes: Mapping[str, Any] = {}, **choices: Any):
    """Go on with an interrupted or killed study in its file.

    Parameters
    ----------
    changes : mapping
        Keys of the case that are changed, such as a later end.
    choices
        What the study takes that is no key of the case.

    Returns
    -------
    StudyResult

    Raises
    ------
    CaseError
        If the file cannot be read or there is nothing left to do.
    """
    check_writable(path)  # what another process is about to add must not be missed
    study, known = _find(path), _read(path)
    if study.rows_to_keep is None and known.complete and not changes:
        raise nothing_to_resume(study.kind, path)
    session = Session(known.header.rebuildable_case(), known.header.name).replace(changes)
    if study.rows_to_keep is not None:
        known = RecordPart(known, study.rows_to_keep(known, session.case))
    return session.resume(known, observer, **choices)


def _find(path: str | Path) -> Study:
    kind = kind_of(path)
    try:
        return find_study(kind)
    except KeyError:
        raise CaseError(f"{str(path)!r} holds a result of kind {kind!r}, which this version does not know.") from None


def _read(path: str | Path) -> StoredRecord:
    return StoredRecord(path, _find(path).tables, Case)
