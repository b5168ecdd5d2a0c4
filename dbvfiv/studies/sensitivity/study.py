"""Derivatives of an eigenvalue by the parameters of a valve: run, storage, and what can be read off them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from eigen.search import leading_modes
from eigen.spectrum import Mode

from ...case.parameters import PARAMETERS, Mu
from ...drawing.style import STABLE, UNSTABLE, headline, new_figure
from ...errors import CaseError, SolveError
from ...model.dynamics import LinearisedState
from ...model.equilibria import require_equilibrium
from ...model.state import SteadyState
from ...model.symmetry import equilibria_of, only_class_of
from ...record.mesh import MeshData
from ...record.record import GrowingRecord
from ...record.states import read_states, state_row, state_table
from ...record.table import TEXT, Column, TableSpec
from ...texts import json_value
from ..comparing import cell
from ..result import StudyResult
from ..session import Session, Study, describe_surroundings
from ..stability.derivatives import PERFORMANCE, Neighbourhood, Sensitivity, parameters_of, require_number, unit_of
from ..stability.place import describe_fixed
from ..stability.walk import StabilityWalk, name_state_in_failures
from ..state import State, states_of

#: Modes searched for beyond the one asked for, so that its rank is certain.
_MARGIN = 3
STATE, VALUES, MODE = "state", "sensitivities", "mode"
_VALUES = (
    Column("parameter", "", "Name of the parameter", TEXT),
    Column("value", "SI", "Its value; angles in degrees"),
    Column("growth_rate", "1/s per unit", "Derivative of the growth rate"),
    Column("angular_frequency", "rad/s per unit", "Of the angular frequency", read=lambda found: found.derivative.imag),
    *(
        Column(name, f"{unit} per unit".strip(), words, read=lambda found, name=name: found.performance[name])
        for name, (unit, words) in PERFORMANCE.items()
    ),
)
_TABLE = TableSpec(VALUES, _VALUES)
_HEAD = (
    f"{'parameter':<24}{'value':>12} {'unit':<8}{'d growth':>12}{'d frequency':>13}{'d growth':>12}{'d frequency':>13}"
    f"{'d flow':>9}{'d opening':>11}{'d loss':>9}{'d mass':>9}",
    f"{'':<24}{'':>12} {'':<8}{'1/s a unit':>12}{'Hz a unit':>13}{'1/s a %':>12}{'Hz a %':>13}"
    f"{'% a %':>9}{'% a %':>11}{'% a %':>9}{'% a %':>9}",
)


def tables_of(mesh: MeshData) -> tuple[TableSpec, ...]:
    """Tables of a result on a mesh: the state, and the derivatives."""
    return state_table(STATE, mesh), _TABLE


def run(session: Session, record: GrowingRecord) -> None:
    """Derivatives of the mode `sensitivity.mode` at drive.pressure by the parameters `sensitivity.of`."""
    model, asked = session.model, session.case.sensitivity
    known = parameters_of(model)
    names = asked.of or known
    for name in names:
        lacking = session.case.damping.lacks(name)
        if lacking:
            raise CaseError(f"sensitivity.of names {name!r}, but {lacking}.", key="sensitivity.of")
        require_number(model, name)
    kept = read_states(record, STATE)
    state = session.equilibrium(record, kept)
    if not kept:
        record.append(STATE, state_row(model, state))
    mu = Mu.of(session.case)
    mode, linear = _find_mode(session, record, state, mu)
    beside = Neighbourhood(model, state.q, state.pressure, mu, [mode], asked.step, linear)
    record.note(MODE, number=asked.mode, eigenvalue=complex(mode.eigenvalue), performance=beside.performance)
    record.begin("sensitivity", len(names))
    done = set(record.column(VALUES, "parameter"))
    for name in names:
        if name in done:
            continue
        record.progress(name)
        try:
            found = beside.slope(name)
        except (SolveError, CaseError) as error:
            record.fail(str(error))
            continue
        record.append(VALUES, _TABLE.row(found))
        record.item(found)


def _find_mode(session: Session, record: GrowingRecord, state: SteadyState, mu: Mu) -> tuple[Mode, LinearisedState]:
    """The mode asked for, with its left vector, and the linearised state."""
    model, number = session.model, session.case.sensitivity.mode
    require_equilibrium(model, state)
    if model.flow.has_fluid and state.pressure <= model.flow.back:
        raise CaseError(f"Coupled modes need an inlet pressure greater than {model.flow.back:g}.")
    walk = StabilityWalk(session.case, record, model)
    walk.give(mu, state)
    walk.require_valid(mu)
    family = walk.family(mu)
    with name_state_in_failures(state.pressure):
        found = leading_modes(family.linear.pencil(mu), number + _MARGIN, replace(family.search(mu), left=True))
    if len(found) < number:
        raise SolveError(f"The state at {state.pressure:.6g} Pa has {len(found)} leading modes, and no mode {number}.")
    return found.mode(number - 1), family.linear


class SensitivityResult(StudyResult):
    """Derivatives of one eigenvalue by the parameters of a valve.

    Attributes
    ----------
    state : State
        The equilibrium.
    number : int
        Of the mode, by falling growth rate.
    eigenvalue : complex, 1/s
    sensitivities : tuple of Sensitivity
        In the order asked for.

    Examples
    --------
    >>> found = dbvfiv.load().sensitivity(["pressure", "layer 3 angle"], pressure="6 kPa")      # doctest: +SKIP
    >>> [(s.parameter, s.growth_rate, s.frequency) for s in found.sensitivities]                # doctest: +SKIP
    """

    kind = "sensitivity"
    missed = "The eigenvalue was not differentiated by {} of the parameters"

    @cached_property
    def state(self) -> State:
        return states_of(self, STATE)[0]

    @cached_property
    def number(self) -> int:
        return int(self.record.notes(MODE)[-1]["number"])

    @cached_property
    def eigenvalue(self) -> complex:
        return complex(*self.record.notes(MODE)[-1]["eigenvalue"])

    @property
    def growth_rate(self) -> float:
        """Growth rate of the mode, 1/s."""
        return self.eigenvalue.real

    @property
    def frequency(self) -> float:
        """Frequency of the mode, Hz."""
        return abs(self.eigenvalue.imag) / (2 * np.pi)

    @cached_property
    def sensitivities(self) -> tuple[Sensitivity, ...]:
        rows = (self.record.column(VALUES, column.name).tolist() for column in _VALUES)
        found = {
            name: Sensitivity(name, value, (complex(*eigenvalue),), dict(zip(PERFORMANCE, performance)))
            for name, value, *eigenvalue, performance in ((*row[:4], row[4:]) for row in zip(*rows))
        }
        asked = self.case.sensitivity.of or tuple(found)
        return tuple(found[name] for name in dict.fromkeys(asked) if name in found)

    @cached_property
    def performance(self) -> dict[str, float]:
        """Values of what `Sensitivity.performance` has the derivatives of, SI."""
        return dict(self.record.notes(MODE)[-1]["performance"])

    def elasticity(self, found: Sensitivity) -> dict[str, float | None]:
        """Per cent of flow, opening, loss coefficient and mass for one per cent of a parameter; None of what is not
        there, such as a flow under an even pressure.
        """
        own = self.performance
        per_cent = {name: slope * found.value / (own[name] or np.nan) for name, slope in found.performance.items()}
        return json_value(per_cent)

    def summary(self) -> dict[str, Any]:
        if not self.record.notes(MODE):
            return {"sensitivities": []} | self.ending()
        mode = {"number": self.number, "symmetry": equilibria_of(self.case.part).name}
        return {
            "state": self.state.summary() | describe_surroundings(self.case),
            "mode": mode | {"growth_rate": self.growth_rate, "frequency": self.frequency},
            "sensitivities": [
                {
                    "parameter": found.parameter,
                    "value": found.value,
                    "unit": unit_of(self.case, found.parameter),
                    "growth_rate": found.growth_rate,
                    "frequency": found.frequency,
                    "growth_rate_per_percent": found.per_percent.real,
                    "frequency_per_percent": found.per_percent.imag / (2 * np.pi),
                    "per_cent_per_cent": self.elasticity(found),
                }
                for found in self.sensitivities
            ],
            **self.ending(),
        }

    def lines(self) -> list[str]:
        if not self.record.notes(MODE):
            return ["The run ended before its mode was found."]
        mode = f"mode {self.number} of {only_class_of(self.case.part)}, "
        mode += f"{self.growth_rate:.4f} 1/s at {self.frequency:.4f} Hz"
        return [
            f"At {describe_fixed(self.case)}: {mode}.",
            *_HEAD,
            *(_line(self, found) for found in self.sensitivities),
        ]


def _line(result: SensitivityResult, found: Sensitivity) -> str:
    """Row of the table; two blanks before the unit keep it from being told in another one."""
    row = result.case.units.parameter(found.parameter) if found.parameter in PARAMETERS else None
    scale, unit = (row.scale, row.shown_unit) if row else (1.0, unit_of(result.case, found.parameter))
    value = found.value / scale
    percent = found.per_percent
    relative = f"{percent.real:12.4g}{percent.imag / (2 * np.pi):13.4g}" if found.value else f"{'-':>12}{'-':>13}"
    widths = zip(result.elasticity(found).values(), (9, 11, 9, 9))
    further = "".join(cell(value, width, ".3g") for value, width in widths)
    return (
        f"{found.parameter:<24}{value:>12.6g}  {unit:<7}{found.growth_rate * scale:>12.4g}"
        f"{found.frequency * scale:>13.4g}{relative}{further}"
    )


#: Bars drawn at most, those that move the mode most.
MOST = 24


def draw(result: StudyResult) -> Iterator[tuple[str, Callable[[], Figure]]]:
    """Figures of sensitivities, each with its name."""
    if any(found.value for found in result.sensitivities):
        yield "sensitivity", lambda: bars(result)


def bars(result: StudyResult) -> Figure:
    """Change of growth rate and frequency of the mode for one percent more of each parameter, the largest on top."""
    known = [found for found in result.sensitivities if found.value]
    shown = sorted(known, key=lambda found: abs(found.relative), reverse=True)[:MOST]
    change = np.array([found.per_percent for found in shown])
    place = np.arange(len(shown))
    figure = new_figure(8.4, 1.9 + 0.27 * len(shown))
    growth, frequency = figure.subplots(1, 2, sharey=True)
    growth.barh(place, change.real, color=[UNSTABLE if c > 0 else STABLE for c in change.real], height=0.7)
    frequency.barh(place, change.imag / (2 * np.pi), color="#5f6a72", height=0.7)
    growth.set_yticks(place, [found.parameter for found in shown])
    growth.invert_yaxis()
    growth.set_xlabel("Change of growth rate, 1/s per percent")
    frequency.set_xlabel("Change of frequency, Hz per percent")
    for axes in (growth, frequency):
        axes.axvline(0.0, color="0.25", lw=1.0)
        axes.grid(axis="y", visible=False)
    mode = f"mode {result.number}, {result.growth_rate:.4g} 1/s at {result.frequency:.4g} Hz"
    words = [describe_fixed(result.case)]
    if len(shown) < len(known):
        words.append(f"the {len(shown)} largest of {len(known)}")
    if len(known) < len(result.sensitivities):
        words.append("parameters that are zero have no percent")
    return headline(figure, f"{result.header.name}, {mode}", *words)


STUDY = Study("sensitivity", tables_of, run, SensitivityResult)
