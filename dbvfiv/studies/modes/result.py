"""Leading modes of one state: content of their file, what can be read off it, and fields for ParaView."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from ...errors import CaseError
from ...model.symmetry import EQUILIBRIA, asks_for_equilibria, symmetry_named
from ...record.mesh import MeshData, WholeValve
from ...record.states import state_table
from ...record.table import TableSpec
from ...record.vtkhdf import Step, motion
from ..result import StudyResult
from ..session import describe_surroundings
from ..stability.dimensions import compare_states, read_other_law
from ..stability.verdict import Verdict
from ..state import State, states_of
from . import figures
from .figures import animate_mode
from .mode import CURVE, MODE, Certificate, ModeShape, OtherLaw, read_law, side_by_side


@dataclass(frozen=True)
class _ModeSteps(Sequence):
    """Modes as steps, made one at a time; "time" is the number of the mode."""

    result: StudyResult
    valve: WholeValve

    def __len__(self) -> int:
        return len(self.result.modes)

    def __getitem__(self, number):
        mode, valve, mesh = self.result.modes[number], self.valve, self.result.mesh
        shape, parity = mode.shape[:, :3], symmetry_named(mode.symmetry).parity(valve.sign)[:, None]
        points = motion(mesh, valve, self.result.state.nodal) | {
            "mode_real": valve.vectors(shape.real) * parity,
            "mode_imag": valve.vectors(shape.imag) * parity,
            "mode_amplitude": mode.amplitude[valve.node],
        }
        ones = np.ones(len(valve.quads))
        cells = {
            "thickness": valve.cells(mesh.thickness),
            "growth_rate": mode.growth_rate * ones,
            "frequency": mode.frequency * ones,
        }
        return Step(float(mode.number), points, cells)


@dataclass(frozen=True)
class _CycleSteps(Sequence):
    """Phases of one cycle as steps, the first repeated at the end; "time" is time in s, or the share of a cycle where
    nothing oscillates.
    """

    result: StudyResult
    valve: WholeValve
    mode: ModeShape
    phases: int

    def __len__(self) -> int:
        return self.phases + 1

    def __getitem__(self, number):
        share = range(self.phases + 1)[number] / self.phases
        mode, state, mesh = self.mode, self.result.state, self.result.mesh
        moved = mode.at_phase(2 * np.pi * share) * mode.drawn_amplitude(state)
        parity = symmetry_named(mode.symmetry).parity(self.valve.sign)[:, None]
        points = motion(mesh, self.valve, state.nodal + moved)
        if np.any(parity < 0):
            opposite = motion(mesh, self.valve, state.nodal - moved)
            points = {name: np.where(parity < 0, opposite[name], field) for name, field in points.items()}
        points |= {"oscillation": self.valve.vectors(moved[:, :3]) * parity}
        value = share / mode.frequency if mode.frequency > 0 else share
        return Step(value, points, {"thickness": self.valve.cells(mesh.thickness)})


def mode_steps(result: StudyResult, valve: WholeValve) -> Sequence[Step]:
    """All modes: the equilibrium as ``displacement``, shapes as ``mode_real``, ``mode_imag`` and ``mode_amplitude``
    (largest 1).
    """
    return _ModeSteps(result, valve)


def cycle_steps(result: StudyResult, valve: WholeValve, mode: ModeShape, phases: int = 24) -> Sequence[Step]:
    """One cycle of a mode about the equilibrium, at an amplitude that shows well; growth or decay is left out."""
    return _CycleSteps(result, valve, mode, phases)


STATE, MODES, COUNT = "state", "modes", "count"
#: Kind of the note that says why the constants of the rubber do not hold at the state.
REFUSAL = "not valid"
#: What a note of a certificate says about the rows that belong to it, and the table they stand in.
COUNTED = (("modes", MODES), ("points", COUNT))
HEAD = (
    "  mode   growth rate    frequency   damping ratio   residual",
    "                 1/s           Hz",
)


def tables_of(mesh: MeshData) -> tuple[TableSpec, TableSpec, TableSpec]:
    """Tables of a result on a mesh: the state, its modes, and the curve of the independent count."""
    stations = len(mesh.z)
    row_shapes = {"shape": mesh.nodal_shape, "area": (stations,), "pressure": (stations,)}
    return state_table(STATE, mesh), TableSpec(MODES, MODE, row_shapes, chunk=8), TableSpec(COUNT, CURVE)


class ModesResult(StudyResult):
    """Leading modes, by falling growth rate.

    Attributes
    ----------
    modes : tuple of ModeShape
    state : State
        The equilibrium they belong to.
    certificate : Certificate or None
    stable : bool or None
    notes : tuple of str
        What the search and its certificate have to say.

    Examples
    --------
    >>> modes = dbvfiv.load().steady(pressure="6 kPa").modes(density=10)    # doctest: +SKIP
    >>> modes.modes[0].growth_rate, modes.modes[0].frequency, modes.stable  # doctest: +SKIP
    """

    kind = "modes"

    @cached_property
    def modes(self) -> tuple[ModeShape, ...]:
        (_, table, _) = tables_of(self.mesh)
        rows, classes = self.record.table_rows(table), []
        for note in self._certified:
            count = note.get("modes", len(rows))
            classes += [note.get("symmetry", EQUILIBRIA)] * count
        classes += [EQUILIBRIA] * (len(rows) - len(classes))
        order = range(len(rows))
        if len(set(classes)) > 1:
            order = sorted(order, key=lambda i: (-rows[i]["growth_rate"], rows[i]["angular_frequency"]))
        return tuple(ModeShape(number=n + 1, **rows[i], symmetry=classes[i]) for n, i in enumerate(order))

    @property
    def _certified(self) -> list[dict[str, Any]]:
        return self.record.notes("certificate")

    @cached_property
    def certificates(self) -> dict[str, Certificate]:
        """One for each class of motion that was searched, by its name."""
        found, first = {}, 0
        for note in self._certified:
            last = first + note.get("points", self.record.rows(COUNT))
            curve = (self.record.column(COUNT, c.name)[first:last] for c in CURVE)
            found[note.get("symmetry", EQUILIBRIA)] = Certificate.read(note, *curve)
            first = last
        return found

    @cached_property
    def certificate(self) -> Certificate | None:
        """Certificate of all classes searched; None if the run ended before it had one."""
        return Certificate.joined(self.certificates) if self.certificates else None

    @property
    def notes(self) -> tuple[str, ...]:
        return tuple(note["text"] for note in self.record.notes("remark"))

    @cached_property
    def verdict(self) -> Verdict:
        """Stability of the state in all symmetry classes that were searched."""
        refusals = self.record.notes(REFUSAL)
        if refusals:
            return Verdict.not_valid(refusals[-1]["text"])
        notes = {note.get("symmetry", EQUILIBRIA): note for note in self._certified}
        if not notes:
            return Verdict.undecided("The run ended before its modes were found.")
        return Verdict.joined({name: self._verdict(note) for name, note in notes.items()})

    def _verdict(self, note: dict[str, Any]) -> Verdict:
        """Verdict on one class; for files of earlier versions from the data that they hold."""
        if "verdict" in note:
            return Verdict.read(note["verdict"])
        values = [complex(m.growth_rate, m.angular_frequency) for m in self.modes]
        counts = note["unstable_count"], note["unstable_count_independent"]
        return Verdict.of(values, *counts, note["certain"], line=note["line"], statement=note["statement"])

    @property
    def stable(self) -> bool | None:
        return self.verdict.stable

    @property
    def sentence(self) -> str:
        """The verdict in a sentence for people, which names the continuity law and what is outside."""
        return self.verdict.sentence(self.law)

    @property
    def law(self) -> str:
        """Conditions of a verdict, in words: continuity law and fluid outside; in vacuo the latter alone."""
        case = self.case
        return case.outside.words if case.modes.in_vacuo or not case.continuity else f"under {case.continuity}"

    @cached_property
    def other_law(self) -> OtherLaw | None:
        """Modes of the same state under the other continuity law; None where that was not asked for."""
        note = read_other_law(self.record)
        return read_law(note, self.case.outside.words) if note else None

    @property
    def comparison(self) -> str | None:
        """One sentence on what both laws say; None where one was asked."""
        other = self.other_law
        return other and compare_states(self.case.fluid.continuity, self.stable, other.continuity, other.stable)

    @cached_property
    def state(self) -> State:
        """The equilibrium, with its layers and figures."""
        return states_of(self, STATE)[0]

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

    def summary(self) -> dict[str, Any]:
        if self.certificate is None:
            surroundings = describe_surroundings(self.case)
            return {
                "state": self.state.summary() | surroundings if self.record.rows(STATE) else None,
                "modes": [],
                "unstable_count": None,
                "unstable_count_independent": None,
                "stable": None,
                "verdict": self.verdict.summary(),
                "warnings": list(self.warnings),
            }
        both = {"other_law": self.other_law.summary(), "comparison": self.comparison} if self.other_law else {}
        return {
            "state": self.state.summary() | describe_surroundings(self.case) | {"in_vacuo": self.case.modes.in_vacuo},
            "modes": [mode.summary() for mode in self.modes],
            "unstable_count": self.certificate.unstable_count,
            "unstable_count_independent": self.certificate.unstable_count_independent,
            "stable": self.stable,
            "verdict": self.verdict.summary(),
            "certificate": self.certificate.summary(),
            "classes": [self._class_summary(name, found) for name, found in self.certificates.items()],
            "notes": list(self.notes),
            "warnings": list(self.warnings),
        } | both

    @staticmethod
    def _class_summary(name: str, found: Certificate) -> dict[str, Any]:
        return {
            "symmetry": name,
            "motion": symmetry_named(name).words,
            "unstable_count": found.unstable_count,
            "unstable_count_independent": found.unstable_count_independent,
            "stable": found.stable,
            "certificate": found.summary(),
        }

    def lines(self) -> list[str]:
        if self.certificate is None:
            return [self.sentence]
        rows = [
            f"{m.number:6d}{m.growth_rate:14.4f}{m.frequency:13.4f}{m.damping_ratio:16.4f}{m.residual:11.1e}"
            for m in self.modes
        ]
        head, notes = HEAD, [f"Note: {note}" for note in self.notes]
        if not asks_for_equilibria(self.case.modes.symmetry):
            head = (f"{HEAD[0]}   class", HEAD[1])
            rows = [f"{row}{mode.symmetry:>8}" for row, mode in zip(rows, self.modes)]
            words = ", ".join(f"{name}: {symmetry_named(name).words}" for name in self.certificates)
            notes = [f"Classes: {words}.", *notes]
        other = self.other_law
        if other is None:
            return [*head, *rows, "", self.sentence, *notes]
        table = side_by_side(self.case.fluid.continuity, [mode.summary() for mode in self.modes], other)
        return [*table, "", self.sentence, other.sentence, self.comparison, *notes]

    def steps(self, valve: WholeValve, mode: int | None = None, phases: int = 24) -> Sequence[Step]:
        """The modes one after the other, or one cycle of one of them."""
        return mode_steps(self, valve) if mode is None else cycle_steps(self, valve, self.mode(mode), phases)

    def drawers(self, mode: int | None = None) -> Iterator[tuple[str, Callable[[], Figure]]]:
        """Eigenvalues, shapes, centre lines and the independent count; of one mode alone if it is named."""
        if self.certificate is None:
            return
        yield from figures.draw(self, mode)

    def animate(self, path: str | Path, mode: int = 1, frames: int = 24) -> Path:
        """Write a GIF of one cycle of a mode."""
        return animate_mode(self, self.mode(mode), path, frames)
