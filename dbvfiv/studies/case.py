"""The whole case: the physics, and the section that each study brings.

``python -m dbvfiv.studies.case`` prints the page of all keys, ``docs/case-reference.md``; with ``thesis`` behind it the
valve of the thesis, ``cases/dbv12.toml``.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Collection, Iterable, Iterator, Mapping
from importlib import import_module
from pathlib import Path
from typing import Any, Self

from pydantic import create_model, model_validator

from ..case.axis import parse_point, parse_stability_axis
from ..case.describe import page
from ..case.load import Overrides, key_path, read_case_file
from ..case.model import Case as PhysicsCase
from ..case.physics import LIQUID
from ..case.quantity import WATER, head_of
from ..case.section import BrokenRule, Section, key
from ..case.statement import parse_statement
from ..case.write import case_toml
from ..errors import CaseError
from ..texts import digits
from . import KINDS


def _section(kind: str) -> tuple[type[Section], Any]:
    """The section of a study, under the first line of its docstring."""
    keys = import_module(f"{__package__}.{kind}").Keys
    return keys, key(keys(), (keys.__doc__ or "").partition("\n")[0])


class _CaseOfStudies(PhysicsCase):
    """Queries on the whole case that need keys of studies."""

    def steady_pressures(self) -> tuple[float, ...]:
        """Pressures, Pa, of `steady` where none are asked for: drive.pressure if that was given, or changed later, and
        steady.pressures was not; else steady.pressures.
        """
        alone = "pressure" in self.drive.model_fields_set and "pressures" not in self.steady.model_fields_set
        return (self.drive.pressure,) if alone else self.steady.pressures

    def straining_pressures(self) -> tuple[float | None, float | None]:
        """Largest pressures, Pa, that the case names: as drive.pressure, None for the operating point of a pump alone,
        and of the closed valve, None where no key says one.
        """
        opening = (
            None
            if self.meets_pump("steady")
            else max(self.drive.pressure, *self.steady_pressures(), *self.report.heads)
        )
        closed = {"rated_pressure", "pressures"} & self.closure.model_fields_set
        return opening, (self.closure.rated_pressure or max(self.closure.pressures)) if closed else None

    def ranged_pressures(self, kind: str) -> list[tuple[str, tuple[float, ...]]]:
        """Keys of a study, such as "sweep.over", that name pressures besides these, and the pressures, Pa."""
        section = getattr(self, kind, None)
        texts = {f"{kind}.{name}": getattr(section, name, None) for name in ("over", "x", "y")}
        axes = {key: parse_stability_axis(text) for key, text in texts.items() if text and "=" in text}
        found = [(key, tuple(axis.values)) for key, axis in axes.items() if axis.parameter == "pressure"]
        density = self.fluid.density
        if kind == "levels":
            found.append(("levels.pressures", section.pressures))
        elif kind == "transient" and section.drive_rows:
            found.append(("transient.drive_table", tuple(pressure for _, pressure in section.drive_rows)))
        elif kind == "identify":
            points = [parse_point(one.at, density) for one in section.records]
            found += [("identify.records", (p["pressure"],)) for p in points if "pressure" in p]
        elif kind == "design":
            said = [("design.aim", section.aim), *(("design.constraints", text) for text in section.constraints)]
            read = [(key, parse_statement(text, key == "design.aim", density)) for key, text in said if text]
            found += [(key, one.pressures) for key, one in read if one.pressures]
        return found

    @model_validator(mode="after")
    def _steps_take_what_is_upstream(self) -> Self:
        for there, words in (
            (self.has_waves, "an elastic line (upstream.wave_speed)"),
            (self.is_compressed, "a fluid that is compressed (fluid.sound_speed)"),
            (not self.fluid.unsteady, "fluid.unsteady = false, which leaves no order to choose"),
        ):
            if there and self.transient.coupling == "staggered":
                raise BrokenRule("transient.coupling", f"'staggered' with {words}", "it must be 'monolithic' there")
        given = "pressures" if self.has_pump and self.transient.drive_table is not None else ""
        if given or (self.has_pump and self.transient.ramp > 0):
            raise BrokenRule(
                "transient.drive_table" if given else "transient.ramp",
                "given beside a pump",
                "the pump's curve says what the pressure is; leave it out, or the pump",
            )
        return self

    @model_validator(mode="after")
    def _held_lips_meet(self) -> Self:
        if self.closure.supports == "held-lips" and self.valve.lip_rise > 0:
            raise BrokenRule(
                "closure.supports",
                f"'held-lips' with valve.lip_rise = {self.valve.lip_rise:g} m",
                "lips that are bowed apart are not shut where they are held; it must be 'contact' there",
            )
        return self

    @model_validator(mode="after")
    def _classes_are_those_of_the_part(self) -> Self:
        known = {"SS", "all", *self.part.classes}
        for study in ("modes", "sweep"):
            given = getattr(self, study).symmetry
            if given not in known:
                raise BrokenRule(
                    f"{study}.symmetry",
                    f"{given!r} where a {self.part.name} of the valve is computed",
                    f"its symmetry classes are {', '.join(self.part.classes)}",
                )
        return self

    def meets_pump(self, kind: str) -> bool:
        """True where a study has to find the operating point of valve and pump."""
        listed = kind == "steady" and "pressures" in self.steady.model_fields_set
        return self.seeks_operating_point and kind not in ("closure", "levels") and not listed

    def replace(self, changes: Mapping[str, Any]) -> Self:
        made = super().replace(changes)
        made._replace_list_by_pressure({key_path(dotted) for dotted in changes})
        made.closure.reach_rated_pressure()
        return made

    def _replace_list_by_pressure(self, changed: Collection[tuple[str, ...]]) -> None:
        """Let a drive.pressure that was changed by itself stand before the list, see `steady_pressures`."""
        driven = {("drive", "pressure"), ("drive", "head")} & set(changed)
        if driven and ("steady", "pressures") not in changed:
            self.steady.model_fields_set.discard("pressures")


Case = create_model(
    "Case",
    __base__=_CaseOfStudies,
    __module__=__name__,
    __doc__="Everything a run depends on: the physics, and a section for each study; ``Case()`` is the 12-inch valve.",
    **{kind: _section(kind) for kind in KINDS},
)


#: Keys in which the thesis's computations differ from the defaults.
THESIS = {
    "mesh.rows": "graded",
    "mesh.inertia": "linear",
    "materials.strain_level": "10 %",
    "materials.constants": "published",
    "shell.mass": "consistent",
    "damping.model": "rayleigh",
    "fluid.continuity": "quasi-steady",
}


def load_case(path: str | Path | None = None, overrides: Overrides = ()) -> Case:
    """Read and check a case file. Raises CaseError: one sentence: which key, in which line, what was given, what is
    allowed.

    Parameters
    ----------
    path : path, optional
        TOML file; without it the 12-inch valve of the defaults.
    overrides : iterable of str, or mapping
        ``"drive.pressure=18 kPa"``; list elements by index from 0, ``"layers.2.angle=45"``.

    Returns
    -------
    Case
    """
    overrides = overrides if isinstance(overrides, Mapping) else tuple(overrides)
    case = read_case_file(Case, path, overrides)
    case._replace_list_by_pressure({key_path(override.partition("=")[0]) for override in overrides})
    return case


def thesis_case(changes: Mapping[str, Any] | Iterable[str] = ()) -> Case:
    """The 12-inch valve as the thesis computes it, ``cases/dbv12.toml``.

    Parameters
    ----------
    changes : mapping or texts
        Keys to change, ``{"fluid.density": 10}``, or overrides as `load_case` takes them.
    """
    overrides = () if isinstance(changes, Mapping) else changes
    case = load_case(None, (*(f"{key}={value}" for key, value in THESIS.items()), *overrides))
    return case.replace(changes) if isinstance(changes, Mapping) else case


# -- contradictions between keys that are each allowed, found before minutes are spent on them

#: Studies that need a flow at drive.pressure, unless a parameter that they vary is the pressure.
_AT_DRIVE = ("modes", "sweep", "onset", "map", "cycle", "sensitivity", "response")


def contradictions(case: Case, kind: str | None = None) -> Iterator[str]:
    """Sentences on what contradicts what, for a study or for any, in the units of the case.

    Parameters
    ----------
    kind : str, optional
        Study that is about to run; what does not concern it is left out.
    """
    yield from _forgotten_units(case, kind)
    if case.drive.kind == "flow" and not case.seeks_operating_point:
        yield from map(case.units.say, _nothing_flows(case, kind))
    yield from map(case.units.say, _slivers(case))


def require_consistent(case: Case, kind: str | None = None) -> None:
    """Refuse a case whose keys contradict each other, for a study or for any. Raises CaseError with the first
    contradiction.
    """
    for sentence in contradictions(case, kind):
        raise CaseError(sentence)


def _nothing_flows(case: Case, kind: str | None) -> Iterator[str]:
    """Drive that is not above what the valve discharges into."""
    given, drive = case.downstream.pressure, case.drive.pressure
    # a level that opposes the flow is that of one density, and a study may vary it
    back = case.rest_pressure if kind is None else min(given, case.rest_pressure)
    behind = f"downstream.pressure = {_pascal(given)}" if given else "0, the pressure downstream"
    if back != given:
        level = "less the level of the lips below" if back < given else "and the level of the lips above"
        behind = f"{_pascal(back)}, {behind} {level} the inlet"
    if drive <= back and (kind is None or (kind in _AT_DRIVE and not _varies_pressure(case, kind))):
        if not (kind == "modes" and case.modes.in_vacuo):
            yield (
                f"drive.pressure is {_pascal(drive)}, which is not above {behind}, so nothing flows; give the head of "
                "the flow, or use `dbvfiv closure` for a back pressure."
            )
    asked = case.steady_pressures()
    if kind in (None, "steady") and max(asked) <= back and (asked != (drive,) or kind == "steady"):
        yield (
            f"steady.pressures end at {_pascal(max(asked))}, which is not above {behind}, so nothing flows at any of "
            "them."
        )

    if kind is None and case.report.heads and min(case.report.heads) <= back:
        yield (
            f"report.heads begin at {_pascal(min(case.report.heads))}, which is not above {behind}, so nothing flows "
            "there; give heads of the flow."
        )


def _varies_pressure(case: Case, kind: str) -> bool:
    if kind == "map":
        return "pressure" in (axis.parameter for axis in case.map.axes)
    axis = getattr(case, kind).axis if kind in ("sweep", "onset", "cycle", "response") else None
    return axis is not None and axis.parameter == "pressure"


def _slivers(case: Case) -> Iterator[str]:
    """Pieces of the wall shorter than half their thickness: slips of a drawing, which elements would follow."""
    if case.valve.wall != "measured":
        return
    begin = 0.0
    for i, piece in enumerate(case.valve.wall_map):
        if 0 < piece.to - begin < 0.5 * piece.thickness and begin < case.valve.length:
            yield (
                f"valve.wall_map.{i} is {1e3 * (piece.to - begin):.3g} mm long and {1e3 * piece.thickness:.3g} mm "
                "thick, a sliver that no shell can follow; join it with its neighbour."
            )
        begin = piece.to


def unanswered_rating(case: Case) -> Iterator[str]:
    """Sentence on back pressures of `closure` that end below the rated one; a report goes beyond both by itself."""
    rated, largest = case.closure.rated_pressure, max(case.closure.pressures)
    if rated is not None and largest < rated:
        yield case.units.say(
            f"closure.rated_pressure is {_pascal(rated)} and closure.pressures end at {_pascal(largest)}, so whether "
            f'the valve holds would stay open; give -p "{rated / 1e3:g} kPa" or closure.pressures up to it.'
        )


#: Pressures of a liquid below which a number without its unit is meant, Pa: 5 mm of water, which crack no valve.
_NO_PRESSURE = 50.0


def _forgotten_units(case: Case, kind: str | None) -> Iterator[str]:
    """Pressures of a liquid too small to be meant: a bare 5 is 5 Pa."""
    if case.fluid.density < LIQUID:
        return
    given = {}
    if kind is None:
        given["drive.pressure"] = case.drive.pressure
        given["closure.rated_pressure"] = case.closure.rated_pressure or 0.0
        given["report.heads"] = max(case.report.heads, default=0.0)
    elif kind in ("sweep", "onset", "map", "cycle"):
        axes = case.map.axes if kind == "map" else (getattr(case, kind).axis,)
        given |= {f"{kind}, pressure": max(axis.values) for axis in axes if axis and axis.parameter == "pressure"}
    for name, value in given.items():
        if 0 < value < _NO_PRESSURE:
            ends = "is" if name in ("drive.pressure", "closure.rated_pressure") else "ends at"
            yield (
                f"{name} {ends} {value:g} Pa, {1e3 * head_of(value, case.fluid.density):.2g} mm of the fluid; a number "
                f'alone is in Pa, give "{value:g} m" or "{value:g} kPa".'
            )


#: Share of the bore below which a bill is narrower than any that passes what its pipe brings, and bore, m, above that
#: of all duckbill valves on sale (96 in).
_NARROW, _LARGEST_BORE = 0.5, 2.5
#: Speed of sound in air, m/s, and Mach number from which a gas is compressed by more than 5 % (density M^2/2).
_SOUND_OF_AIR, _FAST = 343.0, 0.3


def oddities(case: Case) -> Iterator[str]:
    """Sentences on keys that are allowed and seldom meant: half widths that are whole, degrees that are radians."""
    yield from _sizes_seldom_meant(case)
    yield from _gas(case)
    behind, around = case.downstream.pipe_diameter, case.outside.pipe_diameter
    if case.has_tail and case.outside.is_there and around != behind:
        words = "unbounded" if around is None else f"in a pipe of {1e3 * around:.4g} mm"
        yield (
            f"downstream.pipe_diameter is {1e3 * behind:.4g} mm, and the fluid outside the wall is {words}; "
            "outside.pipe_diameter says in which pipe the valve stands, so give both alike."
        )


def _gas(case: Case) -> Iterator[str]:
    """A density of a gas, with heads of it or a jet that compresses it."""
    density, over = case.fluid.density, case.drive.pressure - case.downstream.pressure
    if density >= LIQUID or case.drive.kind != "flow" or case.has_pump:
        return
    if case.units.heads:
        yield (
            f"Heads are those of the fluid of {density:g} kg/m3, a gas, of which {case.units.pressure(over)} press as "
            f'{digits(head_of(over, WATER), 3)} m of water do; give "1 mH2O" for heads of water, or fluid.density = '
            "1000 for water."
        )
    jet = math.sqrt(2.0 * max(over, 0.0) / density)
    if case.fluid.sound_speed is None and jet > _FAST * _SOUND_OF_AIR:
        yield (
            f"fluid.density is {density:g} kg/m3, that of a gas, and its jet of {jet:.3g} m/s compresses it; give "
            f"fluid.sound_speed, {_SOUND_OF_AIR:g} m/s in air, or fluid.density = 1000 for water."
        )


def _sizes_seldom_meant(case: Case) -> Iterator[str]:
    flat, half = 0.5 * math.pi * case.valve.inlet_radius, case.valve.lip_half_width
    if half > flat and not case.valve.key_points:
        yield (
            f"valve.lip_half_width is {1e3 * half:.4g} mm, while the pipe pressed flat is {2e3 * flat:.4g} mm wide in "
            "all; it is half the width of the bill."
        )
    bore, pipe = 2.0 * case.valve.inlet_radius, case.upstream.diameter
    if 2 * case.valve.bill_reach < _NARROW * bore:
        key = "key_points make a pipe" if case.valve.key_points else "valve.flange_radius makes a pipe"
        yield (
            f"{key} of {1e3 * bore:.4g} mm before a bill that goes {1e3 * case.valve.bill_reach:.4g} mm from its axis; "
            "half the diameter is its radius."
        )
    if bore > _LARGEST_BORE:
        yield (
            f"The valve has a bore of {bore:.3g} m, more than any that is sold; valve.scale is {case.valve.scale:g}, "
            "which multiplies all its lengths."
        )
    if case.has_line and not case.upstream.pieces and pipe is not None and not 0.5 < pipe / bore < 2.0:
        yield f"upstream.diameter is {1e3 * pipe:.4g} mm before a valve of {1e3 * bore:.4g} mm."
    valve, given = case.valve.as_given, 0.5 * case.valve.as_given.length
    wall = max(valve.thickness_at(place) for place in (0.0, given, 2 * given))
    named = case.valve.model_fields_set
    if "wall_thickness" in named and "wall" not in named and valve.wall == "measured":
        yield (
            f"valve.wall_thickness is {1e3 * valve.wall_thickness:.4g} mm, and the wall has the thicknesses of "
            'valve.wall_map; valve.wall = "uniform" takes the former.'
        )
    for i, layer in enumerate(case.layers):
        if layer.thickness > 3 * wall and len(case.layers) > 1:
            yield (
                f"layers.{i}.thickness is {1e3 * layer.thickness:.4g} mm in a wall of {1e3 * wall:.4g} mm; all layers "
                "are scaled until they fill the wall."
            )
        if 0 < abs(layer.angle) <= math.pi and layer.angle % 1:
            yield f'layers.{i}.angle is {layer.angle:g} degrees; radians are given as "{layer.angle:g} rad".'


def _pascal(pressure: float) -> str:
    return f"{pressure / 1e3:.4g} kPa"


if __name__ == "__main__":
    of_thesis = case_toml(thesis_case(), about="Those are as the thesis has them.")
    print(of_thesis if sys.argv[1:] == ["thesis"] else page(Case), end="")
