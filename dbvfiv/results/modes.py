"""Leading modes of one state: the result, in memory or in a file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5py

from ..errors import CaseError
from ..record.files import writing
from ..record.header import Header, read_header, write_header
from ..record.layout import Table, read_texts, replace_texts
from ..record.mesh import MeshData, read_mesh, write_mesh
from ..record.result import Result
from .certificate import Certificate
from .mode import MODE, ModeShape, rows_of
from .state import FIELDS, SUMMARY, layers_of
from .steady import SteadyResults, row_from

if TYPE_CHECKING:
    from ..record.vtkhdf import Step
    from ..record.whole_valve import WholeValve
    from ..studies.modes import ModesResult
    from .state import State

HEAD = (
    "  mode   growth rate    frequency   damping ratio   residual",
    "                 1/s           Hz",
)


class ModesResults(Result):
    """Leading modes, by falling growth rate.

    Attributes
    ----------
    modes : tuple of ModeShape
    state : State
        The equilibrium they belong to.
    certificate : Certificate
    stable : bool or None
    notes : tuple of str
        What the search and its certificate have to say.

    Examples
    --------
    >>> modes = dbvfiv.load().steady(pressure="6 kPa").modes(density=10)    # doctest: +SKIP
    >>> modes.modes[0].growth_rate, modes.modes[0].frequency, modes.stable  # doctest: +SKIP
    """

    kind = "modes"

    def __init__(
        self,
        header: Header,
        mesh: MeshData,
        state: Mapping[str, Any],
        modes: Sequence[Mapping[str, Any]],
        certificate: Certificate,
        notes: Sequence[str] = (),
        **common: Any,
    ):
        super().__init__(header, mesh, **common)
        self.notes = tuple(notes)
        self._row, self._rows = dict(state), tuple(modes)
        self.certificate = certificate
        self.modes = tuple(ModeShape(number=i + 1, **row) for i, row in enumerate(self._rows))

    @property
    def stable(self) -> bool | None:
        return self.certificate.stable

    @cached_property
    def state(self) -> State:
        """The equilibrium, with its layers and figures."""
        steady = SteadyResults(
            replace(self.header, kind="steady"),
            self.mesh,
            [self._row],
            lambda i: layers_of(self.model, self.model.shell.dofs.restrict(self._row["nodal"])),
            model=self.__dict__.get("model"),
        )
        return steady.states[0]

    def mode(self, number: int) -> ModeShape:
        """A mode by its number, from 1.

        Raises
        ------
        CaseError
        """
        if not 1 <= number <= len(self.modes):
            raise CaseError(
                f"There is no mode {number} in the {self.kind} result of {self.header.name!r}; it has "
                f"{len(self.modes)}."
            )
        return self.modes[number - 1]

    @classmethod
    def of(cls, result: ModesResult, header: Header | None = None, warnings: Sequence[str] = ()) -> ModesResults:
        """From a run that has just ended.

        Parameters
        ----------
        result : dbvfiv.studies.modes.ModesResult
        header : Header, optional
            Where it comes from; made from the model's case and the conditions of the run without one.
        warnings : sequence of str
            About the model and the state.
        """
        model = result.model
        header = header or Header.of("modes", case_of(result))
        return cls(
            replace(header, complete=True),
            MeshData.of(model),
            row_from(model, result.state),
            rows_of(result),
            Certificate.of(result),
            notes=result.notes,
            warnings=warnings,
            model=model,
        )

    @classmethod
    def read(cls, file: h5py.File, path: Path) -> ModesResults:
        state = Table(file["state"], (*SUMMARY, *FIELDS))
        modes = Table(file["modes"], MODE)
        rows = [{c.name: _plain(modes.read(c.name, i)) for c in modes.columns} for i in range(modes.rows)]
        row = {c.name: _plain(state.read(c.name, 0)) for c in state.columns}
        row["max_displacement_position"] = tuple(row["max_displacement_position"].tolist())
        return cls(
            read_header(file),
            read_mesh(file),
            row,
            rows,
            Certificate.read(file["certificate"]),
            notes=read_texts(file, "messages/notes"),
            warnings=read_texts(file, "messages/warnings"),
            path=path,
        )

    def save(self, path: str | Path) -> Path:
        with writing(path) as file:
            write_header(file, self.header)
            write_mesh(file, self.mesh)
            stations, nodes = len(self.mesh.z), len(self.mesh.nodes)
            shapes = dict.fromkeys((c.name for c in FIELDS), (stations,)) | {
                "max_displacement_position": (3,),
                "nodal": (nodes, 5),
            }
            Table.create(file.create_group("state"), (*SUMMARY, *FIELDS), shapes).append(self._row)
            shapes = {"shape": (nodes, 5), "area": (stations,), "pressure": (stations,)}
            modes = Table.create(file.create_group("modes"), MODE, shapes)
            for row in self._rows:
                modes.append(row)
            self.certificate.write(file.create_group("certificate"))
            messages = file.create_group("messages")
            replace_texts(messages, "warnings", self.warnings)
            replace_texts(messages, "notes", self.notes)
        return Path(path)

    def summary(self) -> dict[str, Any]:
        return {
            "state": self.state.summary() | surroundings(self.case) | {"in_vacuo": self.case.modes.in_vacuo},
            "modes": [mode.summary() for mode in self.modes],
            "unstable_count": self.certificate.unstable_count,
            "unstable_count_independent": self.certificate.unstable_count_independent,
            "stable": self.stable,
            "certificate": self.certificate.summary(),
            "notes": list(self.notes),
            "warnings": list(self.warnings),
        }

    def lines(self) -> list[str]:
        rows = [
            f"{m.number:6d}{m.growth_rate:14.4f}{m.frequency:13.4f}{m.damping_ratio:16.4f}{m.residual:11.1e}"
            for m in self.modes
        ]
        return [*HEAD, *rows, "", self.certificate.verdict, *(f"Note: {note}" for note in self.notes)]

    def steps(self, valve: WholeValve, mode: int | None = None, phases: int = 24) -> Sequence[Step]:
        """The modes one after the other, or one cycle of one of them; see `dbvfiv.results.modes_export`."""
        from .modes_export import cycle_steps, mode_steps

        return mode_steps(self, valve) if mode is None else cycle_steps(self, valve, self.mode(mode), phases)

    def animate(self, path: str | Path, mode: int = 1, frames: int = 24) -> Path:
        """Write a GIF of one cycle of a mode."""
        from ..plots.modes_animation import animate_mode

        return animate_mode(self, self.mode(mode), path, frames)


def surroundings(case) -> dict[str, Any]:
    """Fluid and damping of a case, for JSON."""
    return {
        "density": case.fluid.density,
        "continuity": case.fluid.continuity,
        "alpha": case.damping.alpha,
        "beta": case.damping.beta,
    }


def case_of(result: ModesResult):
    """Case of the model with the conditions of a run."""
    given = result.conditions
    return result.model.case.replace(
        {
            "fluid.density": given.density,
            "damping.alpha": given.alpha,
            "damping.beta": given.beta,
            "drive.pressure": result.state.pressure,
            "modes.count": result.spectrum.asked,
            "modes.in_vacuo": result.in_vacuo,
        }
    )


def _plain(value: Any) -> Any:
    return value.item() if hasattr(value, "item") and getattr(value, "ndim", 1) == 0 else value
