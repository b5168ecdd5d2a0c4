"""Life of a valve: from the motion that a result holds to the hours until a flaw in its rubber is a crack."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import matplotlib
import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from ..case.parameters import PARAMETERS
from ..drawing.style import MAGNITUDE, colour_bar, headline, new_figure
from ..drawing.views import ValveSkin, draw_skin, layer_panels
from ..errors import CaseError
from ..materials.energy import MOONEY_RIVLIN
from ..materials.fatigue import (
    RUBBERS,
    SHAPE,
    CrackGrowth,
    count_cycles,
    cracking_energy,
    plane_normals,
    shipped_growth,
)
from ..record.table import Column, Shown, document_of, printed_head, printed_row
from ..shell.recovery import face_strains, interlaminar_shear, stress_at
from ..shell.reference import thickness_over_radius
from ..shell.shell import Shell
from .state import StateSteps

#: Range of strain below which nothing moves.
STILL = 1e-7
#: Share of the swings of the lip, by the fourth power, that full states have to hold, and that below which it is told.
SEEN, WELL_SEEN = 0.3, 0.9
#: Elements of a part in which the samples are followed: so many by their hours, and by their energy.
PICKS = 3
#: Last cycles of a run that has settled on one.
LAST = 20
#: Keys of [life] that stand before shipped constants.
GIVEN = ("rate", "exponent", "threshold", "crystallisation")
#: Hours, and length of a cut, mm, beyond which figures are grey.
LONG, DEEP = 1e6, 20.0


#: Options that go with the kinds of results.
TAKES = {"cycle": ("--at",), "transient": ("--since", "--per-day"), "steady": ("--per-day",), "closure": ("--per-day",)}


@dataclass(frozen=True, eq=False)
class Motion:
    """A motion that repeats."""

    shell: Shell
    states: Sequence[np.ndarray]  #: sequence of (n,); full states over one block of it.
    hours: float  #: From the start of a block to that of the next.
    words: str
    remarks: tuple[str, ...] = ()


def motion_of(
    result: Any, value: float | None = None, since: float | None = None, per_day: float | None = None
) -> Motion:
    """Motion of a result of `cycle`, `transient`, `steady` or `closure`. Raises CaseError if the result holds no
    motion.

    Parameters
    ----------
    value : float, optional
        Of the parameter of a branch of cycles; the last one without it.
    since : float, s, optional
        Start of the part of a run that counts; without it its last whole cycles, or all that is judged where it has
        none.
    per_day : float, optional
        How often in a day a run takes place, or the way to the last state and back.
    """
    name = f"The {result.kind} result of {result.header.name!r}"
    given = {"--at": value, "--since": since, "--per-day": per_day}
    takes = TAKES.get(result.kind, tuple(given))
    for option in (option for option, number in given.items() if number is not None and option not in takes):
        raise CaseError(
            f"{option} does not go with a result of kind {result.kind!r}, which takes {' and '.join(takes)}."
        )
    if result.kind == "cycle":
        return _limit_cycle(result, value)
    if result.kind == "transient":
        return _run(result, since, per_day)
    if result.kind not in ("steady", "closure") or not result.states:
        raise CaseError(f"{name} holds no motion; life takes results of cycle, transient, closure and steady.")
    if per_day is None:
        raise CaseError(f"{name} has states and no time; give how often a day it goes there and back: --per-day N.")
    shell = result.model.shell
    rising = sorted(result.states, key=lambda state: state.pressure)  # they stand as they were asked for
    there = [shell.dofs.restrict(state.nodal) for state in rising]
    states = [np.zeros(shell.size), *there, *there[-2::-1]]  # and back through each to the rest of the next block
    last = result.case.units.pressure(rising[-1].pressure)
    return Motion(shell, states, 24.0 / per_day, f"{per_day:g} ways a day from rest to {last} and back")


def _limit_cycle(result: Any, value: float | None) -> Motion:
    point = result.nearest(value)
    orbit, at = point.orbit, PARAMETERS[result.parameter].text(point.value)
    remarks = ("The cycle is unstable: the valve leaves it.",) if point.stable is False else ()
    words = f"the limit cycle at {at}, {point.frequency:.4g} Hz"
    return Motion(orbit.model.shell, orbit.states, 1.0 / point.frequency / 3600.0, words, remarks)


def _run(result: Any, since: float | None, per_day: float | None) -> Motion:
    result.require_steps()
    history, verdict = result.history, result.verdict
    begin, end, advice = *history["time"][[0, -1]], 'compute it with --set transient.save_every="1 ms", for instance'
    if since is not None:
        if since < begin:
            raise CaseError(f"--since is {since:g} s, and the run begins at {begin:g} s.")
        begin = since
    elif per_day is None and verdict["verdict"] == "limit cycle":
        lip, flow = verdict["lip_displacement"], verdict["mass_flow"]
        cycle = lip if lip["verdict"] == "limit cycle" else flow
        begin = max(begin, end - max(1, min(int(cycle["cycles_observed"]), LAST)) / cycle["frequency"])
    elif per_day is None and verdict["verdict"] in ("irregular", "chatters"):
        begin = max(begin, result.judged_from)  # a way up to the drive that lasts is taken once
    elif per_day is None:
        raise CaseError(
            f"The run ends {verdict['verdict']} and not in a motion that lasts; give how often a day it takes place, "
            "--per-day N, or the time from which its motion goes on, --since T."
        )
    record, shell = result.record, result.model.shell
    times = record.column("states", "time")
    rows, steps = np.flatnonzero(times >= begin), history["time"] >= begin
    if len(rows) < 3:
        raise CaseError(f"The run holds {len(rows)} full states from {begin:.4g} s on, which are no motion; {advice}.")
    time, lip = history["time"][steps], history["lip_displacement"][steps]
    whole, seen = (_swings(values) for values in (lip, np.interp(times[rows], time, lip)))
    if seen < SEEN * whole:
        raise CaseError(f"Full states of the run hold {seen / whole:.2%} of the swings of the lip; {advice}.")
    remarks = (f"Full states hold {seen / whole:.0%} of the swings of the lip; {advice}.",)
    hours = (end - begin) / 3600.0 if per_day is None else 24.0 / per_day
    often = "without pause" if per_day is None else f"{per_day:g} times a day"
    words = f"the run from {begin:.4g} to {end:.4g} s ({verdict['verdict']}), {often}"
    states = StateSteps(rows, lambda row: shell.dofs.restrict(record.value("states", "nodal", int(row))))
    return Motion(shell, states, hours, words, remarks if seen < WELL_SEEN * whole else ())


def _swings(lip: np.ndarray) -> float:
    """Sum of the fourth powers of the swings."""
    return float((np.ptp(count_cycles(lip[None])[0], axis=1) ** 4).sum())


@dataclass(frozen=True, eq=False)
class Part:
    """A rubber layer, or its bond to a ply, and how long it lasts."""

    name: str
    rubber: str
    layers: list[int]  #: Of the wall, inside to outside from 1: one, or the two that are bonded.
    #: all_hours and all_cuts: (ne,); by the middles of the constants: hours to the crack, and length, m, from which a
    #: flaw grows.
    all_hours: np.ndarray
    all_cuts: np.ndarray
    all_releases: np.ndarray  #: (ne,), J/m2; largest energy release rate of a flaw of the middle length.
    element: int  #: The one that fails first, of which the columns of `COLUMNS` are.
    hours: float
    interval: list[float]
    without_growth: float
    release: float
    ratio: float
    growing_cut: list[float]
    place: list[float]
    face: str


def hours_text(value: float) -> str:
    """Hours to two digits, or the word for a crack that does not grow; 1e8 are ten thousand years."""
    if value >= 100 * LONG:
        return "unlimited" if np.isinf(value) else "over 1e8"
    return f"{float(f'{value:.2g}'):,.15g}".replace(",", " ")


def _place(part: Part) -> str:
    return f"{', '.join(f'{1e3 * x:.0f}' for x in part.place)}, {part.face}"


_RANGE = Shown("10 to 90 %", "hours", 24, lambda part: " to ".join(map(hours_text, part.interval)))
COLUMNS = (
    Column("layers", "", "Numbers of the layers"),
    Column("name", "", "Layer or bond", shown=Shown("part", "", 22, lambda p: f"{p.layers[0]} {p.name}")),
    Column("rubber", "", "Rubber whose constants it has", shown=Shown("rubber", "", 6, "")),
    Column("interval", "h", "Hours that 10 and 90 % of the samples do not exceed", shown=_RANGE),
    Column("hours", "h", "The same of 50 %", shown=Shown("middle", "hours", 10, lambda part: hours_text(part.hours))),
    Column("without_growth", "", "Share of the samples without growth", shown=Shown("no growth", "%", 9, ".0f")),
    Column("release", "J/m^2", "Largest energy release rate of a flaw", shown=Shown("release", "J/m2", 7, ".3g")),
    Column("ratio", "", "Least over largest of its largest cycle", shown=Shown("ratio", "", 5, ".2f")),
    Column("growing_cut", "m", "Length from which a flaw grows, 10 and 90 % of the samples"),
    Column("place", "m", "Middle of the element", shown=Shown("at x, y, z", "mm", 26, _place)),
    Column("face", "", "Where the crack starts"),
)


class Life:
    """Life of a valve under a motion. Raises CaseError if no layer is a rubber, constants of one are not known, or
    nothing moves.

    Parameters
    ----------
    keys : dbvfiv.case.project.Life, optional
        In place of those of the case.

    Attributes
    ----------
    parts : list of Part
        Rubber layers inside to outside, then their bonds to plies.
    first : Part
        The one that fails first.
    """

    def __init__(self, result: Any, motion: Motion, keys: Any = None):
        self.result, self.motion, self.keys = result, motion, result.case.life if keys is None else keys
        section, mesh = motion.shell.section, motion.shell.mesh
        self.laws = {i: layer.law for i, layer in enumerate(section.layers) if layer.law.kind == MOONEY_RIVLIN}
        if not self.laws:
            raise CaseError("No layer of the wall is a rubber; life is told by cracks in rubber.")
        self.constants = {i: _constants(result.case, self.keys, i) for i in self.laws}
        self.place, self.titles = mesh.nodes[mesh.quads].mean(axis=1), result.mesh.layer_titles()
        self.parts = [*self._rubbers(), *self._bonds()]
        self.first = min(self.parts, key=lambda part: (part.hours, part.interval, part.growing_cut))
        self.crack = f"{1e3 * self.keys.crack:.3g} mm"

    def _rubbers(self) -> Iterator[Part]:
        """Critical face and plane of each element by its largest cycle, then the energy on that over time."""
        shell, states, normals = self.motion.shell, self.motion.states, plane_normals()
        largest, least, low, high = dict.fromkeys(self.laws, -np.inf), dict.fromkeys(self.laws, np.inf), np.inf, -np.inf
        for q in states:
            strain = face_strains(shell, q)
            low, high = np.minimum(low, strain), np.maximum(high, strain)
            for i, law in self.laws.items():
                energy = _energy(law, strain[:, i], normals)
                largest[i], least[i] = np.maximum(largest[i], energy), np.minimum(least[i], energy)
        if not (high - low).max() > STILL:
            raise CaseError(f"The valve does not move: {self.motion.words} strains it by {(high - low).max():.1g}.")
        critical = {i: np.divmod((largest[i] - least[i]).argmax(axis=1), len(normals)) for i in self.laws}
        elements, history = np.arange(len(self.place)), {i: [] for i in self.laws}
        for q in states:
            strain = face_strains(shell, q)
            for i, (face, plane) in critical.items():
                history[i].append(_energy(self.laws[i], strain[elements, i, face][:, None], normals[plane][:, None]))
        for i, (face, _) in critical.items():
            faces = np.where(face == 0, "inner face", "outer face")
            yield self._part(self.titles[i], i, [i + 1], np.concatenate(history[i], axis=1), faces)

    def _bonds(self) -> Iterator[Part]:
        """Joints of a rubber and another material, by the energy of the interlaminar shear in the rubber where they
        meet: in a part of the wall a layer may be missing.
        """
        zones, count = self.motion.shell.zones, len(self.motion.shell.section.layers)
        present = np.ones((1, count), bool) if zones is None else zones.presence[zones.of_element]
        pairs = [(a, b) for a, b in combinations(range(count), 2) if (a in self.laws) != (b in self.laws)]
        meet = [present[:, a] & present[:, b] & ~present[:, a + 1 : b].any(axis=1) for a, b in pairs]
        joints = {pair: there for pair, there in zip(pairs, meet) if there.any()}
        shear = np.stack([interlaminar_shear(self.motion.shell, q) for q in self.motion.states if joints] or [0])
        strain = np.outer([0.0, *np.geomspace(1e-5, 2.0, 400)], [0.0, 0.0, 0.0, 1.0, 0.0])
        for (a, b), there in joints.items():
            rubber = a if a in self.laws else b
            law = self.laws[rubber]
            stress = stress_at(MOONEY_RIVLIN, law.parameters[None], strain[:, None])[:, 0, 3]
            energy = there[:, None] * np.interp(shear[:, :, a].T, stress, 0.5 * np.asarray(law.energy(strain.T)))
            name = f"{self.titles[a]} to {self.titles[b]}"
            yield self._part(name, rubber, [a + 1, b + 1], energy, np.full(len(self.place), "bond"))

    def _part(self, name: str, rubber: int, layers: list[int], energy: np.ndarray, faces: np.ndarray) -> Part:
        """Life of a part from the cracking energy density (ne, t) over time."""
        cycles, (family, spread) = count_cycles(energy), self.constants[rubber]
        middle, drawn, most = CrackGrowth.middle(spread), CrackGrowth.draw(spread), energy.max(axis=1)
        hours = self.motion.hours * middle.blocks(cycles, self.keys.crack)
        picks = np.unique(np.concatenate([np.argsort(hours)[:PICKS], np.argsort(-most)[:PICKS]]))
        own = [cycles[e][: max(1, np.count_nonzero(cycles[e, :, 0]))] for e in picks]
        each = np.stack([self.motion.hours * drawn.blocks(some, self.keys.crack) for some in own])
        samples, grows = each.min(axis=0), np.isfinite(each).any(axis=0)
        wins = np.bincount(each[:, grows].argmin(axis=0), minlength=len(picks)) if grows.any() else most[picks]
        element, there = picks[np.argmax(wins)], own[np.argmax(wins)]
        low, half, high = np.quantile(samples, [0.1, 0.5, 0.9], method="inverted_cdf").tolist()
        top, bottom = there[np.argmax(np.ptp(there, axis=1))]
        with np.errstate(divide="ignore"):
            cuts = np.append(np.quantile(drawn.threshold, [0.1, 0.9]), middle.threshold)[:, None] / (SHAPE * most)
        return Part(
            name=name,
            rubber=family,
            layers=layers,
            all_hours=hours,
            all_cuts=cuts[2],
            all_releases=SHAPE * middle.precursor * most,
            element=int(element),
            hours=half,
            interval=[low, high],
            without_growth=float(np.isinf(samples).mean()),
            release=float(SHAPE * middle.precursor * most[element]),
            ratio=float(bottom / top) if top > 0 else 1.0,
            growing_cut=cuts[:2, element].tolist(),
            place=self.place[element].tolist(),
            face=str(faces[element]),
        )

    def document(self) -> dict[str, Any]:
        """Plain SI numbers for JSON, of the part that fails first and of all; hours without growth are infinite."""
        about = {"motion": self.motion.words, "crack": self.keys.crack} | document_of(COLUMNS, self.first)
        return about | {"parts": [document_of(COLUMNS, part) for part in self.parts], "remarks": self.remarks()}

    def sentence(self) -> str:
        """Hours to the crack as an interval."""
        if np.isinf(self.first.interval[0]):
            return f"no crack grows to {self.crack}"
        low, high = map(hours_text, self.first.interval)
        return f"hours to a crack of {self.crack}: {low} to {high}, middle {hours_text(self.first.hours)}"

    def lines(self) -> list[str]:
        """Sentence and table for people."""
        said, first, cut = self.sentence(), self.first, [f"{1e3 * length:.2g}" for length in self.first.growing_cut]
        nearest = "Nearest to it is" if np.isinf(first.interval[0]) else "First in"
        return [
            f"{said[0].upper()}{said[1:]}. {nearest} {first.name}, {first.face}: a cut grows there from {cut[0]} to "
            f"{cut[1]} mm on.",
            f"That is under {self.motion.words}.",
            "",
            *printed_head(COLUMNS),
            *(printed_row(COLUMNS, part) for part in self.parts),
            "",
            *self.remarks(),
        ]

    def remarks(self) -> list[str]:
        """Sentences on how far to trust it."""
        folded, said = (thickness_over_radius(self.motion.shell.geometry) > 0.5).any(axis=1), []
        if folded[self.first.element] and not folded.all():
            hours, cut = (
                np.min([getattr(part, name)[~folded] for part in self.parts]) for name in ("all_hours", "all_cuts")
            )
            said.append(
                "There the wall exceeds the radius of its mid-surface and stresses may be half as large again, so this "
                f"is an order of magnitude. Elsewhere: {hours_text(hours)} hours by the middles, cuts grow from "
                f"{1e3 * cut:.2g} mm on."
            )
        return [
            *self.motion.remarks,
            *said,
            "An interval holds 80 % of what compounds of a rubber do; a test of the compound narrows it ([life]). "
            "Ozone, heat, age and the cords of plies are not counted.",
        ]

    def figures(self) -> dict[str, Callable[[], Figure]]:
        """Figures by name."""
        return {"life": self._figure, "crack-energy": self._energy_figure}

    def _figure(self) -> Figure:
        """Whole valve coloured by the hours of what fails first through the wall; by the length from which a cut grows
        where no flaw does.
        """
        skin, figure = ValveSkin.of(self.result.mesh), new_figure(8.2, 4.9)
        axes = figure.add_subplot(projection="3d", computed_zorder=False)
        values, most, label = np.min([part.all_hours for part in self.parts], axis=0), LONG, "Hours, middle"
        if not (values < LONG).any():
            values, most = 1e3 * np.min([part.all_cuts for part in self.parts], axis=0), DEEP
            label = "Cut that grows, mm"
        short, colour = values < most, matplotlib.colormaps[f"{MAGNITUDE}_r"]
        scale = LogNorm(values.min(), max(2.0 * values.min(), values[short].max(initial=0.0)))
        colours = np.where(short[:, None], colour(scale(np.where(short, values, most))), (0.85, 0.85, 0.85, 1.0))
        cells = np.tile(colours[skin.valve.cell], (2, 1))
        rim = np.full((len(skin.quads) - len(cells), 4), (0.75, 0.75, 0.75, 1.0))
        corners = skin.corners(np.zeros(self.result.mesh.nodal_shape))[:, :, [2, 0, 1]] * 1e3
        draw_skin(axes, corners, np.concatenate([cells, rim]), zoom=1.3)
        colour_bar(figure, ScalarMappable(scale, colour), axes, f"{label}; grey: more than {most:g}", shrink=0.7)
        headline(figure, f"{self.result.header.name}: {self.sentence()}\n{self.motion.words}")
        return figure

    def _energy_figure(self) -> Figure:
        """Largest energy release rate of a flaw in each rubber layer, unrolled."""
        layers = [part for part in self.parts if len(part.layers) == 1]
        values, titles = np.array([p.all_releases for p in layers]), [f"{p.layers[0]}  {p.name}" for p in layers]
        figure, _ = layer_panels(self.result.mesh, values, "Energy release rate, J/m²", titles)
        headline(figure, f"Energy release rate of flaws in the rubbers, {self.motion.words}")
        return figure


def _energy(law: Any, strain: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Cracking energy density (ne, faces * k), J/m3, of strains (ne, faces, 5) on planes (k, 3) or (ne, k, 3)."""

    def stress(e: np.ndarray) -> np.ndarray:
        return stress_at(MOONEY_RIVLIN, law.parameters[None], e[:, None])[:, 0]

    return cracking_energy(strain.reshape(-1, 5), stress, normals).reshape(len(strain), -1)


def _constants(case: Any, keys: Any, layer: int) -> tuple[str, dict[str, Any]]:
    """Name of the rubber whose constants a layer has, and their spreads."""
    name = case.layers[layer].material
    family = keys.rubber if keys.rubber != "auto" else getattr(case.materials.named.get(name), "rubber", name)
    given = {key: getattr(keys, key) for key in GIVEN if getattr(keys, key) is not None}
    if family not in RUBBERS and len(given) < len(GIVEN):
        raise CaseError(
            f"life.rubber is not given, and the growth of cracks in layer {layer + 1}, {name!r}, is not known; it must "
            f"be one of {', '.join(RUBBERS)}, or {', '.join(GIVEN)} of [life] all be given.",
            key="life.rubber",
        )
    return family, {"precursor": keys.precursor} | (shipped_growth(family) if family in RUBBERS else {}) | given
