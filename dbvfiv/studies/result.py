"""Base class of the results of all studies, built from the record of a run or of a file."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from functools import cached_property
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Any, ClassVar, Literal

from ..case.axis import Axis
from ..case.parameters import Parameter
from ..drawing.style import draw_figures, write_figures
from ..errors import CaseError
from ..model.valve import ValveModel
from ..record.files import Header
from ..record.mesh import MeshData, WholeValve
from ..record.record import Record, copy_record, tabulate
from ..record.vtkhdf import Step, export_result
from .case import Case
from .session import Session, find_study


class StudyResult:
    """A finished or interrupted run; nothing is computed again.

    Derived classes set `kind` and define `summary` and `lines`, and `steps` if they have something to show; their
    figures are those that the function ``draw`` of the study yields, see `drawing`.

    Parameters
    ----------
    record : Record
    session : Session, optional
        Where it is at hand; made from the case of the record otherwise, when asked for.
    """

    kind: ClassVar[str]
    missed: ClassVar[str] = "Not everything was reached"  #: Clause on what was not, {} being a number of failures.

    def __init__(self, record: Record, session: Session | None = None):
        self.record = record
        if session is not None:
            self.session = session

    def __repr__(self) -> str:
        held = [f"{name} {count}" for name in self.record.tables if (count := self.record.rows(name))]
        state = "complete" if self.complete else "not complete"
        return f"<{type(self).__name__} of {self.header.name!r}, {state}: {', '.join(held) or 'nothing yet'}>"

    def __getstate__(self) -> dict[str, Any]:
        """Record and case, and no model, which is built again when it is asked for."""
        derived = {
            name for part in type(self).__mro__ for name, it in vars(part).items() if type(it) is cached_property
        }
        return {name: value for name, value in vars(self).items() if name == "session" or name not in derived}

    @cached_property
    def session(self) -> Session:
        """The case with its model; the model is built when it is asked for."""
        return Session(self.header.rebuildable_case(), self.header.name)

    @property
    def header(self) -> Header:
        """Provenance of the result: header of its record."""
        return self.record.header

    @property
    def case(self) -> Case:
        return self.header.case

    @property
    def mesh(self) -> MeshData:
        return self.record.mesh

    @property
    def model(self) -> ValveModel:
        """The coupled model of the case."""
        return self.session.model

    @property
    def path(self) -> Path | None:
        """Its file."""
        return self.record.path

    @property
    def warnings(self) -> tuple[str, ...]:
        return self.record.warnings

    @property
    def failures(self) -> tuple[str, ...]:
        """Sentences on states that were not reached."""
        return self.record.failures

    @property
    def complete(self) -> bool:
        """True where the run went to its end."""
        return self.record.complete

    @property
    def interrupted(self) -> bool:
        """True where the run was ended from outside."""
        return not self.complete

    # -- numbers ----

    def summary(self) -> dict[str, Any]:
        """Plain SI numbers for JSON."""
        raise NotImplementedError

    def ending(self) -> dict[str, Any]:
        """Part of the JSON document on how the run ended."""
        return {"failures": [*self.failures], "warnings": [*self.warnings], "interrupted": not self.complete}

    def lines(self) -> list[str]:
        """The numbers as a table for people."""
        raise NotImplementedError

    def table(self, name: str | None = None, form: Literal["pandas", "xarray"] = "pandas") -> Any:
        """Rows of a table of the result as a pandas DataFrame, or as an xarray Dataset.

        Parameters
        ----------
        name : str, optional
            One of those that ``repr`` lists; the longest by default.
        form : {"pandas", "xarray"}
            A DataFrame holds the columns with one number or text a row, a Dataset also those with an array a row; its
            dimension is ``row``. Units and descriptions are in ``attrs``. Both packages are optional.

        Raises
        ------
        CaseError
            For a table that the result does not have, or a package that is not installed.

        Examples
        --------
        >>> curve = dbvfiv.load().steady(["6 kPa", "18 kPa"]).table()          # doctest: +SKIP
        >>> curve.plot("pressure", "mass_flow"), curve.attrs["units"]           # doctest: +SKIP
        """
        specs = {spec.name: spec for spec in find_study(self.kind).tables(self.mesh)}
        held = sorted(filter(self.record.rows, specs), key=self.record.rows, reverse=True)
        if name not in specs and not (name is None and held):
            given = "table is asked for" if name is None else f"table is given as {name!r}"
            raise CaseError(f"{given}; this {self.kind} result has {', '.join(held) or 'no rows yet'}.")
        return tabulate(self.record, specs[held[0] if name is None else name], form)

    def remarks(self) -> list[str]:
        """Lines to print after the table.

        The table itself was printed row by row; without such a table these are all lines.
        """
        return self.lines()

    def shortfall(self) -> str | None:
        """A clause on what was not reached, "2 of 3 pressures were reached"; None if nothing is missing."""
        return self._missed(len(self.failures)) if self.failures else None

    def _missed(self, lost: int) -> str:
        """Clause on what was not reached, of a number of failures."""
        return self.missed.format(lost)

    # -- files and pictures ----

    def save(self, path: str | Path) -> Path:
        """Write a result file.

        Raises
        ------
        CaseError
        """
        copy_record(self.record, find_study(self.kind).tables(self.mesh), path)
        return Path(path)

    @property
    def drawing(self) -> ModuleType:
        """Module with the function ``draw`` of the study: `figures` beside it, or its own."""
        module = type(self).__module__
        beside = f"{module.rpartition('.')[0]}.figures"
        return import_module(beside if find_spec(beside) else module)

    def drawers(self, **choices: Any) -> dict[str, Callable[[], Any]]:
        """Functions that draw figures, by name, with choices such as ``pressure`` where the study takes them.

        Raises
        ------
        CaseError
            For a choice that it does not take.
        """
        draw = getattr(self.drawing, "draw", None)
        if draw is None:
            return {}
        if unknown := choices.keys() - inspect.signature(draw).parameters.keys():
            raise CaseError(f"Figures of a {self.kind} result are those of no one {min(unknown)}; leave it out.")
        return dict(draw(self, **choices))

    def figures(self, only: Sequence[str] = (), **choices: Any) -> dict[str, Any]:
        """Figures by name.

        Raises
        ------
        CaseError
            For a name that the result has no figure of, or a result without anything to draw.
        """
        return draw_figures(
            self.drawers(**choices), only, f"{self.kind} result of {self.header.name!r}", self.case.units
        )

    def plot(
        self, folder: str | Path = ".", format: str = "png", only: Sequence[str] = (), **choices: Any
    ) -> list[Path]:
        """Write the figures as PNG or SVG files and return their names."""
        return write_figures(self.figures(only, **choices), folder, format)

    @property
    def drawable(self) -> bool:
        """True where there is anything to draw."""
        return bool(self.drawers())

    def steps(self, valve: WholeValve) -> Sequence[Step]:
        """Fields on the valve for ParaView; empty if the result has none."""
        return ()

    def export(self, path: str | Path, quarter: bool = False, deformed: bool = False, **choices: Any) -> Path:
        """Write a VTKHDF file for ParaView; see `dbvfiv.record.vtkhdf`."""
        return export_result(self, path, quarter, deformed, **choices)


class RangeResult(StudyResult):
    """A result along a range of one parameter, the key ``over`` of its section, or at the state of the case without."""

    @property
    def axis(self) -> Axis | None:
        """The range."""
        return getattr(self.case, self.kind).axis

    @property
    def parameter(self) -> str:
        """Parameter of the range; the pressure where there is none."""
        return "pressure" if self.axis is None else self.axis.parameter

    @property
    def _row(self) -> Parameter:
        """The parameter, with a pressure in the units of the case."""
        return self.case.units.parameter(self.parameter)
