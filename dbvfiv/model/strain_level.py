"""Strain levels of the built-in rubbers that agree with the strains their layers see.

The constants of a tested rubber hold up to the strain they were fitted over, so the level is a guess of the strain that
occurs (Eq. 7.1 guesses it for all rubbers from the arc of the lip). Here it is found: with the constants of a level the
valve is solved, what its layers strain is the next level, until both agree.

As Eq. 7.1 asks for the largest strain, the next level of a rubber is the peak of its layers (`material_stability`).
`agree_levels` does that at one pressure, `settle_levels` for all that is asked of a case.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..case.materials import HIGHEST_LEVEL, LOWEST_LEVEL
from ..case.model import Case
from ..errors import SolveError
from ..geometry.divisions import least_rows
from ..geometry.surface import surface_of
from ..observer import Observer
from .equilibria import LoadPath, SteadyOptions, operating_pressure
from .load_steps import LARGEST_JUMP
from .material_stability import LayerLevel, layer_levels
from .state import SteadyState
from .valve import ValveModel

#: Change of a level from one round to the next that counts as agreement, and rounds before giving up.
AGREED, ROUNDS = 1e-4, 40
#: Elements around and along on which levels are settled: there they are within 0.3 % strain of those on 28 x 48.
SETTLING = (14, 24)
#: Decimals of settled levels, 0.1 % strain: constants are interpolated between tests that lie 10 to 20 % apart.
DIGITS = 3
#: Level of the first round of settling: with constants of 10 % soft walls lose stability before they are loaded.
FIRST_LEVEL = 0.20
#: Smallest load step over the target, and how often a target that is not reached is halved.
SMALLEST_STEP, HALVINGS = 1 / 256, 4
#: Load steps to a back pressure at least; as many again in the first of them.
CLOSED_STEPS = 20
#: Keys of a case that is pressed from outside: its inner faces in contact, nothing with a weight.
CLOSED = {
    "drive.kind": "uniform",
    "drive.side": "outside",
    "supports.contact": "faces",
    "gravity.direction": "none",
    "outside.fluid": "none",
    "downstream.pressure": 0.0,
}
#: With the stiffness of faces, N/m3, that settles levels. On the 12-inch valve at 28 kPa strains are within 0.3 % of
#: those of the closure study, whose faces are stiffer.
SOFTLY_CLOSED = CLOSED | {"supports.contact_stiffness": 1e8}


@dataclass(frozen=True)
class AgreedLevels:
    """Levels that agree with a state."""

    case: Case  #: With the constants of these levels.
    state: SteadyState
    layers: tuple[LayerLevel, ...]
    rounds: int

    @property
    def levels(self) -> dict[str, float]:
        """Level of each rubber."""
        return {layer.material: layer.level for layer in self.layers if np.isfinite(layer.level)}


def agree_levels(
    case: Case, pressure: float, observer: Observer | None = None, first: Mapping[str, float] | None = None
) -> AgreedLevels:
    """Levels of the built-in rubbers in the layers of a case that agree with its steady state at a pressure, Pa. Raises
    SolveError if a state is not reached, or the levels do not settle.

    Parameters
    ----------
    pressure : float, Pa
    observer : Observer, optional
    first : mapping of str to float, optional
        Levels of the first round by rubber; the lowest tested ones without it.
    """
    observer = Observer() if observer is None else observer
    load = _Load(pressure, observer)
    first = {name: (first or {}).get(name, LOWEST_LEVEL) for name in case.built_in_rubbers}
    for last in _rounds(case, [load], first, observer):
        if load.missed is not None:
            raise load.missed
        found = last
    if found.change > AGREED:
        raise SolveError(
            f"The strain levels at {pressure:.6g} Pa did not settle in {ROUNDS} rounds: the last ones were "
            f"{_told(found.levels)}."
        )
    return AgreedLevels(found.case, load.state, found.layers, found.count)


@dataclass(frozen=True)
class SettledLevels:
    """Levels of the rubbers of a case for all that is asked of it."""

    levels: dict[str, float]  #: Level of each built-in rubber among its layers, to `DIGITS`.
    where: str  #: The states that they agree with, in words.
    warnings: tuple[str, ...]  #: What should be known about them.

    def __str__(self) -> str:
        return f"Strain levels of the rubbers: {_told(self.levels)} (settled at {self.where})."


def settle_levels(
    case: Case, pressure: float | None, back_pressure: float | None = None, observer: Observer | None = None
) -> SettledLevels:
    """Levels of the built-in rubbers at the largest pressures that a case names, on a mesh of `SETTLING` elements, with
    one for each piece of the surface at least.

    Each rubber takes the largest level of the states. A pressure that is not reached is halved; nothing is refused:
    where halves of it are not reached either, rubbers keep the lowest tested level.

    Parameters
    ----------
    pressure : float or None, Pa
        As drive.pressure; None for the operating point of valve and pump.
    back_pressure : float, Pa, optional
        Of a closed valve, outside over inside. Its faces meet by the penalty of `SOFTLY_CLOSED`.
    observer : Observer, optional
        Is told of progress.
    """
    observer = Observer() if observer is None else observer
    loads = [_Load(pressure, observer, lower=HALVINGS)]
    if back_pressure is not None:
        loads.append(_Load(back_pressure, observer, SOFTLY_CLOSED, " from outside", HALVINGS))
    coarse = case.replace(
        {
            "mesh.around": SETTLING[0],
            "mesh.along": max(SETTLING[1], least_rows(surface_of(case.valve, case.part))),
            "steady.min_step": max(SMALLEST_STEP, case.steady.min_step),
        }
    )
    first = dict.fromkeys(case.built_in_rubbers, FIRST_LEVEL)
    *_, found = _rounds(coarse, loads, first, observer)
    levels = {name: float(round(level, DIGITS)) for name, level in found.levels.items()}
    where = " and ".join(load.told() for load in loads)
    said = []
    if found.change > AGREED:
        said.append(f"Strain levels did not settle in {ROUNDS} rounds: the last ones differ by {found.change:.2%}.")
    for name, level in levels.items():
        if level == HIGHEST_LEVEL:
            said.append(_bounded(name, level, _peak(found.layers, name), where))
    return SettledLevels(levels, where, tuple(said))


@dataclass
class _Load:
    """A state that strains the rubbers, solved again with the constants of each round."""

    pressure: float | None  #: Pa; none for that of the operating point.
    observer: Observer
    changes: Mapping[str, Any] = field(default_factory=dict)  #: Keys of the case in this state.
    side: str = ""  #: Words behind its pressure.
    #: How often the pressure may be halved where it is not reached; it stays so for all rounds that follow.
    lower: int = 0
    path: LoadPath | None = None  #: Of the last round.
    #: Of the last round; None where no pressure was reached, and the valve is at rest.
    state: SteadyState | None = None
    missed: SolveError | None = None  #: Why the pressure was not reached first.
    halved: int = 0  #: How often it was halved.

    def strain(self, case: Case, levels: Mapping[str, float]) -> list[LayerLevel]:
        """Layers of the state with the constants of a case, from that of the last round where that serves."""
        model = ValveModel(case.replace(self.changes) if self.changes else case)
        start, self.state = self.path if self.state is not None else None, None
        while self.state is None and self.halved <= self.lower:
            self.path = LoadPath(model, self._options(model), observer=self.observer)
            try:
                target = self._target(model)  # of a pump that has no operating point an error
                near = None
                if start is not None:
                    self.path.q, self.path.pressure = start.q, start.pressure
                    near = self.path.settled()
                self.state = near if near is not None and near.pressure == target else self.path.go_to(target)
            except SolveError as error:
                if start is None:
                    self.missed, self.halved = self.missed or error, self.halved + 1
                start = None
        return list(layer_levels(model, model.rest() if self.state is None else self.state.q, levels))

    def _options(self, model: ValveModel) -> SteadyOptions:
        """Load steps that end where a closed wall snaps: what lies beyond strains it, and no study goes there."""
        options = SteadyOptions.of(model.case)
        if not self.changes:
            return options
        largest, jump = self._target(model) / CLOSED_STEPS, LARGEST_JUMP * float(np.mean(model.mesh.thickness))
        steps = {"first_step": largest / CLOSED_STEPS, "max_step": largest, "largest_jump": jump}
        return replace(options, straight=None, **steps)

    def _target(self, model: ValveModel) -> float:
        """Pressure of this round, Pa: halves of what is above that at rest."""
        if self.pressure is None and self.halved:
            raise self.missed  # there is no operating point to be halved
        whole = operating_pressure(model, self.observer) if self.pressure is None else self.pressure
        return model.flow.back + (whole - model.flow.back) / 2**self.halved if self.halved else whole

    def told(self) -> str:
        """Its pressure in words."""
        asked = "the operating point of the pump" if self.pressure is None else f"{self.pressure / 1e3:.6g} kPa"
        if self.missed is None:
            return asked + self.side
        reached = "rest" if self.state is None else f"{self.state.pressure / 1e3:.6g} kPa{self.side}"
        return f"{reached}, as {asked} was not reached"


@dataclass(frozen=True)
class _Round:
    """Levels of a round, what they make of the layers, and the largest change to the next levels."""

    count: int
    case: Case
    levels: dict[str, float]
    layers: tuple[LayerLevel, ...]
    change: float


def _rounds(case: Case, loads: Sequence[_Load], levels: dict[str, float], observer: Observer) -> Iterator[_Round]:
    """Rounds until the levels agree with the strains of all loads, the last one at any rate with `ROUNDS`.

    From the third round on secants of each rubber's strain over its level are followed.
    """
    before: dict[str, tuple[float, float]] = {}
    for count in range(1, ROUNDS + 1):
        found = case.replace(case.materials.at_levels(levels))
        strained = [load.strain(found, levels) for load in loads]
        layers = tuple(max(layer, key=lambda state: state.peak) for layer in zip(*strained))
        # the next level of a rubber is the largest peak of its layers, as far as the tests go
        own = {name: float(np.clip(_peak(layers, name), LOWEST_LEVEL, HIGHEST_LEVEL)) for name in levels}
        told = ", ".join(f"{name} {100 * level:.4g} %" for name, level in own.items())
        observer.progress(f"strain levels, round {count}: {told}")
        change = max((abs(own[name] - levels[name]) for name in levels), default=0.0)
        yield _Round(count, found, levels, layers, change)
        if change <= AGREED:
            return
        pairs = {name: (levels[name], own[name]) for name in levels}
        levels = {name: _secant(before.get(name), pair) for name, pair in pairs.items()}
        before = pairs


def _secant(before: tuple[float, float] | None, pair: tuple[float, float]) -> float:
    """Next level from a pair of level and strain, and the pair before it: where their secant meets level = strain.

    The strain itself without a secant of slope below one half in size.
    """
    level, strain = pair
    if before is None or before[0] == level:
        return strain
    slope = (strain - before[1]) / (level - before[0])
    if abs(slope) > 0.5:
        return strain
    return float(np.clip(level + (strain - level) / (1.0 - slope), LOWEST_LEVEL, HIGHEST_LEVEL))


def _peak(layers: Iterable[LayerLevel], name: str) -> float:
    """Largest strain of the layers of a rubber."""
    return max(layer.peak for layer in layers if layer.material == name)


def beyond_tests(layers: Sequence[LayerLevel], pressure: float) -> list[str]:
    """Sentences on rubbers whose strain at a pressure, Pa, lies beyond the tested levels."""
    levels = {layer.material: layer.level for layer in layers}
    return [
        _bounded(name, level, _peak(layers, name), f"{pressure:.6g} Pa")
        for name, level in levels.items()
        if level in (LOWEST_LEVEL, HIGHEST_LEVEL)
    ]


def _told(levels: Mapping[str, float]) -> str:
    return ", ".join(f"{name} {100 * level:.4g} %" for name, level in levels.items())


def _bounded(name: str, level: float, peak: float, where: str) -> str:
    return (
        f"{name} strains by up to {100 * peak:.3g} % at {where}, and its tests go from {100 * LOWEST_LEVEL:g} to "
        f"{100 * HIGHEST_LEVEL:g} %: it has the constants of {100 * level:g} %."
    )
