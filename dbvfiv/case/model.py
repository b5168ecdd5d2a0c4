"""The physics of a case: its sections, the rules between them, and changes of its keys."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Collection, Iterable, Mapping
from typing import Any, Self

from pydantic import ValidationInfo, model_validator

from ..errors import CaseError
from . import physics
from .damping import MEANINGLESS, SHIPPED_LOSSES, WAYS, Damping
from .load import held, make_case, plain, put, toml_value
from .materials import AUTO, DEFAULT_LAYERS, RUBBERS, Layer, Materials
from .mesh import Mesh
from .parameters import PARAMETERS
from .part import Part, part_of
from .physics import Gravity, Outside
from .pipes import Downstream, Pipe, Upstream
from .project import Life, Project, Report
from .section import BrokenRule, Section, key
from .units import Units, read_units, unit_of, with_pressure_in
from .valve import PRESETS, SHAPE, Valve
from .wall import edges_of

#: Pressure over depth with which faces resist, Pa/m: nearly rigid; where contact spreads, some modulus over thickness
#: of a rubber wall.
FACE_STIFFNESS, SPREADING_STIFFNESS = 1e10, 1e9
#: Share of the gap between rough faces in contact below which no passage of a bill that is moulded shut narrows.
PRESET_FILM = 0.75


def _each_of(keys: Iterable[str]) -> dict[str, set[str]]:
    """Keys of which each stands in the place of the others."""
    return {key: set(keys) - {key} for key in keys}


#: Keys of a section, of a table of a material, of a pipe and of a patch that stand in the place of others.
_OF_PIPES, _OF_PATCHES = _each_of(("friction", "roughness")), _each_of(("thickness", "extra"))
_OF_MATERIALS = _each_of(("hardness", "shear_modulus")) | _each_of(WAYS)
_INSTEAD = {
    "drive": _each_of(("pressure", "head")),
    "upstream": _OF_PIPES | {"pieces": set(Pipe.model_fields), "length": {"pieces"}},
    "valve": _each_of(PRESETS) | {"key_points": set(SHAPE)},
}


class Case(Section):
    """The valve, its fluid and its load; ``Case()`` is the 12-inch inline valve.

    All numbers are SI floats; layer angles are in degrees.

    Examples
    --------
    >>> Case().drive.pressure
    18000.0
    >>> Case().replace({"drive.pressure": "36 kPa"}).drive.pressure
    36000.0
    """

    valve: Valve = key(Valve(), "Shape and wall of the valve.")
    mesh: Mesh = key(Mesh(), "Shell mesh of the part that is computed.")
    layers: tuple[Layer, ...] = key(
        DEFAULT_LAYERS,
        "Layers of the wall from inside to outside, scaled so that their sum is the local wall thickness.",
        min_length=1,
    )
    materials: Materials = key(Materials(), "Materials by name.")
    shell: physics.Shell = key(physics.Shell(), "Choices of the shell theory.")
    damping: Damping = key(Damping(), "Materials that relax, or Rayleigh damping.")
    fluid: physics.Fluid = key(physics.Fluid(), "The fluid and its conservation laws.")
    drive: physics.Drive = key(physics.Drive(), "The load.")
    upstream: Upstream = key(Upstream(), "The line in front of the valve.")
    downstream: Downstream = key(Downstream(), "What the valve discharges into.")
    outside: Outside = key(Outside(), "The fluid outside the wall.")
    gravity: Gravity = key(Gravity(), "The weight of wall and fluid.")
    supports: physics.Supports = key(physics.Supports(), "What keeps the lips from crossing.")
    project: Project = key(Project(), "What a report is for, and the units in which results are read.")
    report: Report = key(Report(), "What a report covers.")
    life: Life = key(Life(), "Crack and rubber by which `dbvfiv life` tells the life of the valve.")

    @model_validator(mode="before")
    @classmethod
    def _find_density(cls, data: Any, info: ValidationInfo) -> Any:
        """Density of the fluid, for pressures given as heads of it."""
        if isinstance(info.context, dict) and isinstance(data, Mapping):
            fluid = data.get("fluid")
            given = fluid.get("density") if isinstance(fluid, Mapping) else getattr(fluid, "density", None)
            row = PARAMETERS["density"]
            try:
                info.context["density"] = cls().fluid.density if given is None else row.quantity.parse(given)
            except ValueError:
                info.context["density"] = None  # refused where it stands
        return data

    @model_validator(mode="before")
    @classmethod
    def _keep_unit_of_pressure(cls, data: Any) -> Any:
        """Let the unit in which drive.pressure is given, or else report.heads, be that in which results are read, where
        none of heads or pressures is chosen.
        """
        drive, project = (data.get(name, {}) if isinstance(data, Mapping) else None for name in ("drive", "project"))
        if not isinstance(drive, Mapping) or not isinstance(project, Mapping):
            return data
        units = project.get("units") or ""
        try:
            if {"head", "pressure"} & read_units(units).keys():
                return data
        except (AttributeError, ValueError):  # refused where it stands
            return data
        report = data.get("report")
        heads = report.get("heads") if isinstance(report, Mapping) else None
        given = drive.get("pressure", heads[0] if isinstance(heads, (list, tuple)) and heads else heads)
        head = drive.get("head")
        unit = unit_of(given) if head is None else unit_of(head) or "m"
        if unit in ("", "kPa"):
            return data
        return {**data, "project": {**project, "units": with_pressure_in(units, unit)}}

    @model_validator(mode="after")
    def _goes_together(self) -> Case:
        for i, layer in enumerate(self.layers):
            if layer.material not in self.materials.names:
                near = difflib.get_close_matches(layer.material.upper(), self.materials.names, n=1)
                meant = f", the nearest is {near[0]}" if near else ""
                raise BrokenRule(
                    f"layers.{i}.material",
                    f"{layer.material!r}, which is no material of this case",
                    f"it must be one of {', '.join(self.materials.names)}{meant}, or a table [materials.NAME], of a "
                    "rubber with its hardness and density",
                )
        if self.damping.relaxes:
            for name in dict.fromkeys(layer.material for layer in self.layers):
                if self.materials.loss(name) is None:
                    raise BrokenRule(
                        f"materials.{name}.loss_factor",
                        "missing with damping.model = 'loss factor'",
                        f"how {name} relaxes must be said by loss_factor (a number, or one of "
                        f"{', '.join(SHIPPED_LOSSES)}), loss_data, relaxation_data or prony, or damping.model be "
                        "'rayleigh'",
                    )
        radius = self.valve.as_given.inlet_radius
        for i, layer in enumerate(self.layers):
            if layer.thickness > radius:
                raise BrokenRule(
                    f"layers.{i}.thickness",
                    f"{1e3 * layer.thickness:.4g} mm in a valve with a radius of {1e3 * radius:.4g} mm",
                    "no wall has such a layer, so it must be less",
                )
        if len(self.layers) * self.mesh.layer_points < 2:
            raise BrokenRule(
                "mesh.layer_points",
                "1 with a single layer, which has no bending stiffness",
                "it must be at least 2 then",
            )
        if self.drive.kind == "flow" and self.drive.side == "outside":
            raise BrokenRule(
                "drive.side", "'outside' with drive.kind = 'flow'", "it must be 'inside' unless drive.kind is 'uniform'"
            )
        if self.drive.kind == "uniform" and self.downstream.pressure > 0:
            raise BrokenRule(
                "downstream.pressure",
                f"{self.downstream.pressure:g} Pa with drive.kind = 'uniform'",
                "drive.pressure is all that the wall sees then, so leave it out",
            )
        if self.contact_spreads and self.supports.contact == "stops":
            shape = "a bill that is moulded shut" if self.valve.is_preset else "lips that are bowed apart"
            raise BrokenRule(
                "supports.contact",
                f"'stops' for {shape}",
                "stops hold lips in the shape at rest, so it must be 'faces' or left out",
            )
        self._check_fillers()
        self.mesh.check_positions(self.valve.as_given.length)
        if self.drive.kind == "flow" and self.upstream.is_elastic and not self.fluid.unsteady:
            raise BrokenRule(
                "upstream.pieces" if self.upstream.pieces else "upstream.wave_speed",
                f"{self.upstream.first_wave_speed:g} m/s with fluid.unsteady = false, which leaves waves out",
                "give it with the unsteady law alone",
            )
        if self.has_pump and not self.fluid.unsteady:
            raise BrokenRule(
                "upstream.pump",
                "given with fluid.unsteady = false, which holds the pressure",
                "give it with the unsteady law alone",
            )
        self._check_compression()
        self.upstream.check_pipes(self.valve.bore)
        self.downstream.check_pipe(self.valve.bore, self.valve.bill_reach)
        self.outside.check_pipe(self.valve.outer_diameter)
        return self

    def _check_compression(self) -> None:
        """Refuse a fluid that is compressed where nothing can store its mass."""
        self._check_boiling()
        if not self.is_compressed:
            return
        if self.fluid.continuity != "storage":
            raise BrokenRule(
                "fluid.sound_speed",
                f"{self.fluid.sound_speed:g} m/s with fluid.continuity = {self.fluid.continuity!r}",
                "a fluid that is compressed stores mass, so it must be 'storage' then",
            )
        if not self.fluid.unsteady:
            raise BrokenRule(
                "fluid.sound_speed",
                f"{self.fluid.sound_speed:g} m/s with fluid.unsteady = false, which leaves out that mass is stored",
                "give it with the unsteady law alone",
            )

    def _check_boiling(self) -> None:
        """Refuse a vapour pressure without waves, or one at which the fluid boils everywhere."""
        boils, around = self.fluid.vapour_pressure, self.fluid.ambient_pressure + self.downstream.pressure
        if self.drive.kind != "flow" or boils is None:
            return
        if not self.is_compressed:
            raise BrokenRule(
                "fluid.vapour_pressure",
                f"{boils:g} Pa without fluid.sound_speed",
                "how a liquid fills a cavity depends on its waves, so give both or neither",
            )
        if self.has_tail:
            raise BrokenRule(
                "fluid.vapour_pressure",
                f"{boils:g} Pa with downstream.pipe_diameter = {self.downstream.pipe_diameter:g} m",
                "the pressure around the jet is not that at the end of the pipe, so leave one of them out",
            )
        if boils >= around:
            raise BrokenRule(
                "fluid.vapour_pressure",
                f"{boils:g} Pa in surroundings of {around:g} Pa",
                "it must be below the absolute pressure around the jet, fluid.ambient_pressure and downstream.pressure "
                "together, or the liquid boils everywhere",
            )

    def _check_fillers(self) -> None:
        """Refuse layers of limited extent beside the valve, and places with too few points through the wall."""
        along, around = edges_of(self.layers, "layers", self.valve.as_given.length)
        for z in along:
            for s in around:
                count = sum(layer.covers(z, s) for layer in self.layers)
                if z < self.valve.as_given.length and s < 1 and count * self.mesh.layer_points < 2:
                    raise BrokenRule(
                        "layers",
                        f"a list with {count} at z = {z:g} m and {s:g} of the section",
                        "every place of the wall needs a layer, and two points through it that mesh.layer_points and "
                        "its layers make",
                    )

    @property
    def units(self) -> Units:
        """Units in which results are read."""
        return Units(self.project.units, self.fluid.density)

    @property
    def part(self) -> Part:
        """The part of the valve that is computed."""
        return part_of(self.valve, self.mesh)

    @property
    def contact_spreads(self) -> bool:
        """True where faces meet and part row by row: of a bill that is moulded shut, and of lips bowed apart."""
        return self.valve.is_preset or self.valve.lip_rise > 0

    @property
    def faces_touch(self) -> bool:
        """True where the inner faces touch, and not stops."""
        return self.supports.contact == "faces" or self.contact_spreads

    @property
    def film_share(self) -> float:
        """Share of the lip gap at rest below which no passage narrows."""
        return PRESET_FILM if self.valve.is_preset else self.fluid.area_floor

    @property
    def face_stiffness(self) -> float:
        """Pressure over depth with which faces that meet resist, Pa/m."""
        given = self.supports.contact_stiffness
        return (SPREADING_STIFFNESS if self.contact_spreads else FACE_STIFFNESS) if given is None else given

    @property
    def separation(self) -> float:
        """Share of the velocity head that is lost where the passage widens downstream."""
        given = self.fluid.separation
        return float(self.valve.is_preset) if given is None else given

    @property
    def has_line(self) -> bool:
        """True where fluid comes through an upstream pipe."""
        return self.drive.kind == "flow" and self.upstream.whole_length > 0

    @property
    def is_compressed(self) -> bool:
        """True where the fluid in the valve is compressible."""
        return self.drive.kind == "flow" and self.fluid.sound_speed is not None

    @property
    def boiling_pressure(self) -> float | None:
        """Pressure at which the fluid in the valve boils, Pa, over that around the jet; None where it does not."""
        if self.fluid.vapour_pressure is None:
            return None
        return self.fluid.vapour_pressure + self.vacuum_pressure

    @property
    def vacuum_pressure(self) -> float:
        """Pressure of a vacuum, Pa, over that at the far end downstream: around the jet without a pipe there."""
        return -self.fluid.ambient_pressure - self.downstream.pressure

    @property
    def has_tail(self) -> bool:
        """True where the jet runs into a downstream pipe."""
        return self.drive.kind == "flow" and self.downstream.pipe_diameter is not None

    @property
    def rest_pressure(self) -> float:
        """The drive.pressure, Pa, at which nothing flows."""
        return self.downstream.pressure + self.level_pressure if self.drive.kind == "flow" else 0.0

    @property
    def least_drive(self) -> float:
        """The drive.pressure, Pa, above which the valve is asked: where nothing flows, and 0 for an outlet below."""
        return max(self.rest_pressure, 0.0)

    @property
    def level_pressure(self) -> float:
        """Hydrostatic pressure, Pa, of the fluid up to an outlet above the inlet; negative for an outlet below it."""
        return self.fluid.density * self.gravity.along * self.valve.length if self.drive.kind == "flow" else 0.0

    def outside_level(self, height: Any) -> Any:
        """Pressure, Pa, of the fluid outside at rest at heights, m, over the lips along the axis, over that there."""
        return self.outside.density(self.fluid.density) * (self.gravity.along * height)

    @property
    def has_waves(self) -> bool:
        """True where the upstream pipe is elastic and carries pressure waves."""
        return self.has_line and self.upstream.is_elastic

    @property
    def has_pump(self) -> bool:
        """True where a pump feeds the upstream pipe."""
        return self.has_line and self.upstream.pump is not None

    @property
    def seeks_operating_point(self) -> bool:
        """True where no drive.pressure is given, so that the operating point of valve and pump has to be found."""
        return self.has_pump and "pressure" not in self.drive.model_fields_set

    @property
    def continuity(self) -> str:
        """The continuity law in words, and what is outside; empty where no law is needed: without flow, and in the
        steady law.
        """
        if self.drive.kind != "flow" or not self.fluid.unsteady:
            return ""
        return f"{self.fluid.continuity} continuity {self.outside.words}".rstrip()

    @property
    def seeks_levels(self) -> bool:
        """True where strain levels of built-in rubbers are to be iterated until they agree with the layers' strains."""
        return self.materials.strain_level == AUTO and bool(self.built_in_rubbers)

    @property
    def built_in_rubbers(self) -> list[str]:
        """Built-in rubbers among the layers."""
        used = {layer.material for layer in self.layers}
        return [name for name in RUBBERS if self.materials.is_built_in(name) and name in used]

    @property
    def pressure_at(self) -> str:
        """Location of drive.pressure, in words that follow its number: "static", "in the reservoir"."""
        if not self.has_line:
            return "static"
        return "in the reservoir" if self.drive.at == "reservoir" else "static at the far end of the line"

    @classmethod
    def make_way(cls, data: dict[str, Any], changed: Collection[tuple[str, ...]]) -> None:
        """A key that is asked for stands in the place of one that was there before and says the same otherwise."""
        tables = [((name,), data.get(name), instead) for name, instead in _INSTEAD.items()]
        own = data.get("materials")
        tables += [(("materials", name), own[name], _OF_MATERIALS) for name in (own if isinstance(own, dict) else ())]
        for path, instead in ((("valve", "patches"), _OF_PATCHES), (("upstream", "pieces"), _OF_PIPES)):
            listed = held(data, ".".join(path))
            tables += [
                ((*path, str(i)), one, instead) for i, one in enumerate(listed if isinstance(listed, list) else ())
            ]
        for place, table, instead in tables:
            given = {path[-1] for path in changed if path[:-1] == place} if isinstance(table, dict) else set()
            asked = [name for name in instead if name in given and table.get(name) != []]
            for other in {other for name in asked for other in instead[name]} - given:
                table.pop(other, None)
            if asked and not table.keys() & {"loss_data", "relaxation_data"}:
                table.pop("loss_temperature", None)
        super().make_way(data, changed)
        damping = data.get("damping")
        if ("damping", "model") in changed and isinstance(damping, dict):
            meaningless = MEANINGLESS.get(str(damping.get("model")), "")
            if ("damping", meaningless) not in changed:
                damping.pop(meaningless, None)

    @classmethod
    def take_along(cls, data: dict[str, Any], changed: Collection[tuple[str, ...]] | None = None) -> None:
        """Take out what any table does, and with the last preset of a bill how far it is moulded shut."""
        super().take_along(data, changed)
        valve, asked = data.get("valve"), {path[1] for path in changed or () if path[0] == "valve" and len(path) > 1}
        taken = changed is None or (asked & {*PRESETS} and "moulded_length" not in asked)
        if isinstance(valve, dict) and taken and not any(valve.get(name) for name in PRESETS):
            valve.pop("moulded_length", None)

    def to_dict(self) -> dict[str, Any]:
        """Return plain SI data (numbers, strings, lists, dicts) that JSON and HDF5 can hold."""
        return self.model_dump(mode="json")

    def _tables(self) -> dict[str, Any]:
        """Data as a case file has them: materials by their names."""
        data = self.to_dict()
        data["materials"] |= data["materials"].pop("named")
        return data

    @property
    def given(self) -> dict[str, list[str]]:
        """Keys that were given, by section, as plain data; ``to_dict`` holds every key."""
        return {name: sorted(part.model_fields_set) for name, part in self if isinstance(part, Section)}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any], given: Mapping[str, Collection[str]] | None = None) -> Self:
        """Rebuild a case from ``to_dict`` without looking for the files it was made from; one of a version that had no
        damping.model damps by Rayleigh's constants. All keys of the data count as given, or those alone that `given`
        has of a section.
        """
        if isinstance(data.get("damping"), Mapping):
            data = {**data, "damping": {"model": "rayleigh", **data["damping"]}}
        return cls._with_given(data, given or {})

    @classmethod
    def _with_given(cls, data: Mapping[str, Any], given: Mapping[str, Collection[str]]) -> Self:
        """A case of which those keys alone count as given that stand there, in the sections that stand there."""
        made = make_case(cls, data, check_files=False)
        for name, part in made:
            if isinstance(part, Section) and name in given:
                part.model_fields_set.intersection_update(given[name])
        return made

    def replace(self, changes: Mapping[str, Any]) -> Self:
        """Return a validated copy with some keys changed, ``{"drive.pressure": 36e3, ...}``. Raises CaseError: as
        `dbvfiv.case.load.make_case` does.
        """
        data = self._tables()
        changed = {put(type(self), data, dotted, plain(value)) for dotted, value in changes.items()}
        self.make_way(data, changed)
        if ("drive", "head") in changed:
            changed.add(("drive", "pressure"))
        given = {  # a dictionary holds every key, but not all were given
            name: {*keys, *(path[1] for path in changed if path[0] == name)}
            for name, keys in self.given.items()
            if (name,) not in changed
        }
        return self._with_given(data, given)


#: What `dbvfiv.load` and `Valve.replace` take.
Changes = Mapping[str, Any] | Iterable[str] | str

_FORM = """a mapping such as {"drive.pressure": "18 kPa"} or texts such as "drive.pressure=18 kPa\""""


def change_case(case: Case, changes: Changes) -> Case:
    """A case with some keys changed, which files that these name must exist for. Raises CaseError: one sentence: which
    key, what was given, what is allowed.

    Parameters
    ----------
    changes : mapping, text or iterable of texts
        ``{"drive.pressure": "18 kPa", "mesh.around": 8}``, or ``"drive.pressure=18 kPa"`` as after ``--set``.
    """
    names = _as_mapping(changes)
    made = made_with(case.replace, names)
    data = made._tables()
    for name, value in names.items():
        if held(data, name) == [str(value)]:  # of the files of a key one was named
            put(type(case), data, name, str(value))
    try:
        found = make_case(type(case), data)._tables()
    except CaseError as error:  # files of the case itself may have gone since it was read
        if any(f"{error.key}.".startswith(f"{name}.") for name in names):
            raise
        return made
    files = {name: held(found, name) for name in names if held(found, name) != held(data, name)}  # with full names
    return made.replace(files) if files else made


def made_with(make: Callable[[Mapping[str, Any]], Case], changes: Changes) -> Case:
    """A case as it is made with changes, see `change_case`; texts that are no value of their key are read as TOML."""
    wanted = _as_mapping(changes)
    while True:
        try:
            return make(wanted)
        except CaseError as error:
            # of a list its first bad element is blamed
            name = next((name for name in wanted if f"{error.key}.".startswith(f"{name}.")), error.key)
            given = wanted.get(name)
            other = toml_value(given) if isinstance(given, str) else given
            if other is given:
                raise
            wanted[name] = other


def _as_mapping(changes: Changes) -> dict[str, Any]:
    if isinstance(changes, Mapping):
        pairs = list(changes.items())
    elif isinstance(changes, Iterable):
        pairs = [_pair(text) for text in ([changes] if isinstance(changes, str) else changes)]
    else:
        raise CaseError(f"Changes are given as {changes!r}; they must be {_FORM}.")
    for name, _ in pairs:
        if not isinstance(name, str):
            raise CaseError(f"A key to change is given as {name!r}; it must be a text such as 'drive.pressure'.")
    return {key.strip(): value for key, value in pairs}


def _pair(text: Any) -> tuple[str, str]:
    key, equals, value = text.partition("=") if isinstance(text, str) else ("", "", "")
    if not equals or not key.strip():
        raise CaseError(f"A change is given as {text!r}; changes must be {_FORM}.")
    return key.strip(), value.strip()
