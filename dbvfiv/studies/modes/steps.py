"""Modes as fields on the valve for ParaView: real and imaginary parts mode by mode, or one cycle of one mode in steps
of its phase.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...model.symmetry import symmetry_named
from ...record.mesh import WholeValve
from ...record.vtkhdf import Step, motion
from ..result import StudyResult
from .mode import ModeShape


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
