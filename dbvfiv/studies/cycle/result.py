"""Cycles along one parameter: what can be read off a run or its file."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from ...case.parameters import PARAMETERS, Mu
from ...errors import CaseError
from ...model.system import ValveSystem
from ...record.mesh import WholeValve
from ...record.table import printed_head, printed_row
from ...record.vtkhdf import Step, motion
from ..orbits.orbit import Orbit
from ..result import StudyResult
from ..stability.place import describe_fixed, fixed_conditions, rebuilder
from ..stability.verdict import Verdict
from . import figures
from .fatigue import LayerRanges, layer_ranges
from .rows import COLUMNS, CYCLES, ENDED, SPECIAL, VERDICT, read_motion

#: Steps of a period for ParaView.
STEPS = 24


class Point:
    """A cycle of a result.

    Attributes
    ----------
    The columns of `dbvfiv.studies.cycle.rows.COLUMNS` by their names.
    """

    def __init__(self, result: CycleResult, number: int):
        self.result, self.number = result, number
        self.numbers = {c.name: result.record.value(CYCLES, c.name, number) for c in COLUMNS}

    def __getattr__(self, name: str):
        if name.startswith("__") or name not in self.__dict__.get("numbers", {}):
            raise AttributeError(name)
        return self.numbers[name]

    @property
    def stable(self) -> bool | None:
        """True where all perturbations of the model's symmetry decay; None where stability was not asked for."""
        return None if self.unstable < 0 else bool(self.unstable == 0)

    @property
    def exponents(self) -> np.ndarray:
        """Leading Floquet exponents, complex, 1/s."""
        kept = np.isfinite(self.growth_rates)
        return (self.growth_rates + 1j * self.angular_frequencies)[kept]

    @cached_property
    def orbit(self) -> Orbit:
        """The motion, over one period."""
        name = PARAMETERS[self.result.parameter].system_name or self.result.parameter
        mu = Mu.of(self.result.case).for_system() | {name: float(self.value)}
        return Orbit(self.result.system.model(mu), mu, read_motion(self.result.record, self.number))

    @cached_property
    def ranges(self) -> LayerRanges:
        """Ranges of strain and stress in the layers over a period."""
        return layer_ranges(self.orbit)

    def summary(self) -> dict[str, Any]:
        """Plain SI numbers for JSON."""
        names = (
            "value amplitude frequency lip_least lip_largest lip_mean flow_mean flow_amplitude least_speed harmonics "
            "tail correction trivial asked"
        ).split()
        plain = {name: np.asarray(self.numbers[name]).item() for name in names}
        found = [
            {"growth_rate": float(s.real), "angular_frequency": float(s.imag), "multiplier": [m.real, m.imag]}
            for s, m in zip(self.exponents, np.exp(self.exponents / self.frequency))
        ]
        return plain | {"stable": self.stable, "unstable_dimension": int(self.unstable), "exponents": found}


class CycleResult(StudyResult):
    """A branch of limit cycles, in the order in which they lie on it.

    Attributes
    ----------
    parameter : str
    points : tuple of Point
    special_points : list of dict
        Kind, value of the parameter, amplitude, frequencies of the cycle and of the perturbation, whether located.

    Examples
    --------
    >>> found = dbvfiv.load("cases/light-fluid.toml").cycle("density=25:60:8")      # doctest: +SKIP
    >>> [(p.value, p.amplitude, p.frequency, p.stable) for p in found.points]      # doctest: +SKIP
    """

    kind = "cycle"

    @property
    def parameter(self) -> str:
        return self.case.cycle.axis.parameter

    @cached_property
    def points(self) -> tuple[Point, ...]:
        found = [Point(self, number) for number in range(self.record.rows(CYCLES))]
        return tuple([p for p in found if p.leg == 1][::-1] + [p for p in found if p.leg == 0])

    @cached_property
    def special_points(self) -> list[dict[str, Any]]:
        notes = self.record.notes(SPECIAL)
        return [{name: value for name, value in note.items() if name != "what"} for note in notes]

    @property
    def onset(self) -> dict[str, float] | None:
        """Value and frequency of the onset that the branch starts at."""
        notes = self.record.notes("onset")
        return {name: notes[-1][name] for name in ("value", "frequency")} if notes else None

    @property
    def verdict(self) -> Verdict:
        """Stability of the steady state of the case itself."""
        notes = self.record.notes(VERDICT)
        return Verdict.read(notes[-1]) if notes else Verdict.undecided("The run ended before it was looked at.")

    @property
    def reason(self) -> str:
        """Why the branch ended."""
        reasons = [note["reason"] for note in self.record.notes(ENDED)]
        return "; ".join(dict.fromkeys(reasons)) or "the run ended before the branch did"

    @cached_property
    def system(self) -> ValveSystem:
        """Models for parameters."""
        return ValveSystem(self.model, rebuilder(self.case))

    def nearest(self, value: float | None = None) -> Point:
        """The cycle at the value nearest to one of the parameter; the last one without.

        Raises
        ------
        CaseError
            If there is no cycle.
        """
        if not self.points:
            raise CaseError("The run ended before the first cycle was found.")
        if value is None:
            return self.points[-1]
        return min(self.points, key=lambda point: abs(point.value - value))

    def summary(self) -> dict[str, Any]:
        return {
            "parameter": self.parameter,
            "points": [point.summary() for point in self.points],
            "special_points": self.special_points,
            "onset": self.onset,
            "verdict": self.verdict.summary(),
            "reason": self.reason,
            "fixed": fixed_conditions(self.case, self.parameter),
            "failures": list(self.failures),
            "warnings": list(self.warnings),
            "interrupted": not self.complete,
        }

    def shortfall(self) -> str | None:
        return "The branch could not be followed to the end of the range" if self.failures else None

    def drawers(self) -> Iterator[tuple[str, Callable[[], Figure]]]:
        if self.points:
            yield from figures.draw(self)

    def lines(self) -> list[str]:
        rows = [printed_row(COLUMNS, point) for point in self.points]
        return [f"At {describe_fixed(self.case, self.parameter)}:", *printed_head(COLUMNS), *rows, *self.remarks()]

    def remarks(self) -> list[str]:
        row = PARAMETERS[self.parameter]
        said = []
        if self.onset:
            at = row.text(self.onset["value"])
            said.append(f"The branch starts at the onset at {at}, {self.onset['frequency']:.4g} Hz.")
        for special in self.special_points:
            words = f"{special['kind']} at {row.text(special['value'])}, amplitude {1e3 * special['amplitude']:.4g} mm"
            if special["perturbation_frequency"]:
                words += f", perturbation at {special['perturbation_frequency']:.4g} Hz"
            said.append(words[0].upper() + words[1:] + ("." if special["located"] else ", not located closely."))
        said.append(f"The branch ends: {self.reason.rstrip('.')}.")
        if self.points:
            said.append("Stable means: against perturbations that are symmetric as the model is.")
        return said

    def steps(self, valve: WholeValve, value: float | None = None) -> Sequence[Step]:
        """One period of the cycle nearest to a value of the parameter, or of the last one."""
        orbit = self.nearest(value).orbit if self.points else None
        if orbit is None:
            return ()
        found = []
        for k in range(STEPS + 1):
            q = orbit.motion.at([2 * np.pi * k / STEPS])[0, : orbit.model.size]
            points = motion(self.mesh, valve, orbit.model.nodal(q))
            found.append(Step(k / STEPS * orbit.motion.period, points, {"thickness": valve.cells(self.mesh.thickness)}))
        return found
