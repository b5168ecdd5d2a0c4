"""Parameters that stability is asked over: of the load, of the surroundings, of the design."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from pydantic.fields import FieldInfo

from ...case.damping import LARGEST_LOSS
from ...case.describe import numeric_limits, quantity_of
from ...case.load import key_path
from ...case.materials import AUTO, BUILT_IN, RUBBERS, BuiltIn, Materials
from ...case.model import Case as PhysicsCase
from ...case.parameters import OUTSIDE, PARAMETERS, PIPES, SYSTEM_NAMES, Mu
from ...case.quantity import Quantity
from ...case.section import Section
from ...case.valve import Valve
from ...errors import CaseError, SolveError, attempt
from ...materials.shipped import shipped_loss
from ...model.valve import ValveModel
from ..case import Case

#: Lengths of the parts of a valve, from the lip on.
PARTS = ("duckbill_length", "saddle_length", "cuff_length", "flare_length", "flange_length")
#: Keys that hold places along a valve, from the lip on.
PLACES = ("valve.wall_map", "valve.patches", "valve.moulded_length", "layers", "mesh.breaks", "mesh.row_positions")
#: Sizes of a valve that follow from the others by rules that jump where it is no longer the 12-inch one.
KEPT = ("lip_radius", "duckbill_wall_deduction", "flange_wall_deduction")
#: Sections of a case that describe neither the valve nor what surrounds it.
UNREAD = ("mesh", "project", "report", "life")
#: Keys that are turned into a parameter before anything is computed, and that parameter.
READ_AS = {"drive.head": "pressure", "valve.cracking_head": "sealing"}


def flow_law(mu: Mu) -> Mu:
    """Part of a parameter point that the flow's matrices at unit density depend on.

    The flow model and the pipes; the density where waves or a fixed fluid outside tell fluids apart by more than their
    inertia.
    """
    outside = (OUTSIDE,) if mu.outside else ()
    return mu.only("storage", *PIPES, *(("density",) if mu.wave_speed or outside else ()), *outside)


def fixed_conditions(case: Case, *moved: str) -> dict[str, float | str]:
    """Load, fluid and damping of a case in SI units, those that are moved left out."""
    given: dict[str, float | str] = {**Mu.of(case), "storage": case.fluid.continuity}
    given.pop(OUTSIDE, None)
    if case.outside.is_there:
        given[OUTSIDE] = case.outside.words
    if case.upstream.pieces:  # pipes in series have wave speeds of their own
        given.pop("wave_speed", None)
    return {name: value for name, value in given.items() if name not in moved and not case.damping.lacks(name)}


def describe_fixed(case: Case, *moved: str) -> str:
    """Fixed conditions of a case in words, "6 kPa static, 10 kg/m³, quasi-steady, α = 0 1/s, β = 0.003 s"."""
    words = []
    for name, value in fixed_conditions(case, *moved).items():
        text = value if isinstance(value, str) else PARAMETERS[name].text(value)
        words.append(f"{text} {case.pressure_at}" if name == "pressure" else text)
    return ", ".join(words)


def is_surrounding(case: Case, name: str) -> bool:
    """True where a parameter leaves the steady state and the linearised structure of a case as they are."""
    return PARAMETERS[name].surrounding and not why_it_moves(case, name)


def why_it_moves(case: Case, name: str) -> str:
    """Why a parameter that leaves steady states alone as a rule moves them in a case, as a clause; empty where it does
    not: the length of a line does where it has friction, and the density with gravity, viscosity or compression.
    """
    if name == "pipe_length" and case.has_line and not case.upstream.pieces and case.upstream.has_friction:
        return "friction in the line moves the steady state with it"
    if name == "density" and case.gravity.is_there:
        return "the weight of the fluid moves the steady state with it"
    if name == "density" and case.fluid.dynamic_viscosity:
        return "the friction of the fluid in the passage moves the steady state with it"
    if name == "density" and case.is_compressed:
        return "by how much the fluid is compressed moves the steady state with it"
    return ""


def moving_surroundings(case: Case) -> tuple[str, ...]:
    """Parameters of the surroundings that move the steady states of a case."""
    return tuple(name for name in ("pipe_length", "density") if why_it_moves(case, name))


def check_range(case: Case, *names: str) -> None:
    """Refuse to ask over parameters as `check_scan` does, and as `require_kept_head` does."""
    check_scan(case, *names)
    require_kept_head(case, *names)


def check_scan(case: Case, *names: str) -> None:
    """Refuse to ask over a parameter that this case does not have, or without flow. Raises CaseError for strain levels
    without a rubber that has them, and angles without a ply that has one. Raises SolveError without flow.
    """
    if case.drive.kind != "flow":
        raise SolveError(
            "Without flow nothing couples the fluid to the wall, so there is no onset to look for; "
            "drive.kind must be 'flow'."
        )
    for name in names:
        require_parameter(case, name)


def require_head(case: Case) -> None:
    """Refuse a pump, behind which the head is no input. Raises CaseError."""
    if case.has_pump:
        raise CaseError("Behind a pump a head is no input; give drive.pressure and no upstream.pump.", "upstream.pump")


def require_kept_head(case: Case, *names: str) -> None:
    """Refuse ranges that move the operating point of a pump, of which their studies keep the pressure. Raises
    CaseError.
    """
    for name in () if "pressure" in names else names:
        if case.seeks_operating_point and not is_surrounding(case, name):
            raise CaseError(
                f"Over {name} a pump has another operating point at each value; set {PARAMETERS[name].key} for each, "
                "or give drive.pressure, which is kept.",
                key=PARAMETERS[name].key,
            )


def require_parameter(case: Case, name: str) -> None:
    """Refuse a parameter that nothing in a case depends on. Raises CaseError for strain levels without a rubber that
    has them, angles without a ply that has one, the length of a line that is not there, and what the model of damping
    does not have.
    """
    if name in ("pipe_length", "wave_speed") and case.upstream.pieces:
        raise CaseError(
            f"There is no one {name} to change: the line has {len(case.upstream.pieces)} pieces, each with its own; "
            "give a line of one pipe, or set the pieces one by one.",
            key="upstream.pieces",
        )
    lacks = {
        "pipe_length": not case.has_line
        and "There is no pipe_length to change: the valve has no line in front; give upstream.length (drive.pressure "
        "is then that at its far end, see drive.at).",
        "tail_length": not case.has_tail
        and "There is no tail_length to change: no pipe follows the valve; give downstream.pipe_diameter.",
        "storage": case.is_compressed
        and "There is no flow model to change: a fluid that is compressed (fluid.sound_speed) stores mass.",
        "density": case.has_pump
        and "Over the density a pump has no steady state to keep: its head is another pressure in another fluid; set "
        "fluid.density for each, or give drive.pressure and no upstream.pump.",
        "wave_speed": not case.has_waves
        and "There is no wave_speed to change: the valve has no elastic line in front; give upstream.length and "
        "upstream.wave_speed.",
        "sealing": not case.valve.is_preset
        and "There is no sealing pressure to change: the bill is not moulded shut; give valve.sealing_pressure.",
    }
    unknown = case.damping.lacks(name)
    if said := lacks.get(name) or (unknown and f"There is no {name} to change: {unknown}."):
        raise CaseError(said, key=PARAMETERS[name].key)
    of_inertia = name in ("pipe_length", "tail_length", "storage") and not why_it_moves(case, name)
    if of_inertia and not case.fluid.unsteady:
        raise CaseError(
            f"Nothing depends on {name}: fluid.unsteady is false, which leaves the inertia of the fluid out.",
            key="fluid.unsteady",
        )
    used = {layer.material for layer in case.layers}
    if name == "strain" and not case.seeks_levels and not case.materials.levels(used):
        raise CaseError(
            "There is no strain level to change, because no layer is one of the built-in rubbers "
            f"{', '.join(RUBBERS)}; the layers are of {', '.join(sorted(used))}."
        )
    if name == "angle" and not any(layer.folded for layer in case.layers):
        raise CaseError("There is no fibre angle to change, because every layer lies at 0 degrees.")


def design_value(case: Case, name: str) -> float | None:
    """Value of a parameter of the design in a case, as `redesigned` takes it; None where there is no one value."""
    if name == "thickness":
        return 1.0
    if name == "sealing":
        force = case.valve.sealing_force
        return force / case.valve.moulded_length if force else case.valve.sealing_pressure
    if name == "angle":  # of all plies at once
        values = {abs(layer.folded) for layer in case.layers if layer.folded}
    else:  # strain, of all rubbers at once
        values = set(case.materials.levels({layer.material for layer in case.layers}).values())
    return values.pop() if len(values) == 1 else None


def redesigned(case: Case, design: Mapping[str, float]) -> Case:
    """A case with design parameters changed: wall thickness factor, size of the angle of all plies (degrees), strain
    level (0.1 for 10 %); any other by its key, such as the length of the saddle, with which places along the wall move.
    Raises CaseError for values that the case does not allow.
    """
    changes: dict[str, object] = {}
    keys: dict[str, float] = {}
    for name, value in design.items():
        if name == "thickness":
            changes[PARAMETERS[name].key] = case.valve.thickness_factor * value
        elif name == "strain":
            rubbers = case.materials.levels({layer.material for layer in case.layers})
            changes |= case.materials.at_levels(dict.fromkeys(rubbers, value))
        elif name == "angle":
            layers = case.to_dict()["layers"]
            for layer, own in zip(layers, case.layers):
                if own.folded:
                    layer["angle"] = value if own.folded > 0 else -value
            changes[PARAMETERS[name].key] = layers
        elif name in PARAMETERS:
            changes[PARAMETERS[name].key] = value
        else:
            keys[name] = value
    changes |= _shape_beside(case, keys, changes) | keys
    return case.replace(changes) if changes else case


def number_of(case: Case, name: str, key: str) -> tuple[FieldInfo, Any]:
    """Field and value of a key of the case that holds a number, such as "materials.CR.stiffness_factor"; None where it
    has none. `key` is the one that names it. Raises CaseError.
    """
    target: Any = case
    field = owner = None
    path = key_path(name)
    for part in path:
        if isinstance(target, Materials) and part not in type(target).model_fields and part in target.names:
            target, field = target.named.get(part) or _card(target, part), None
        elif isinstance(target, tuple) and part.isdigit() and int(part) < len(target):
            target, field = target[int(part)], None
        elif isinstance(target, Section) and part in type(target).model_fields:
            owner, field, target = target, type(target).model_fields[part], getattr(target, part)
        else:
            field = None
            break
        if isinstance(target, Valve):  # sizes before its scale, as they are written
            target = target.as_given
    if field is None or quantity_of(field) is None:
        material = path[1] if path[0] == "materials" and len(path) > 1 else path[0]
        more = f"; other numbers of {material} need a table [materials.{material}] with its kind"
        raise CaseError(
            f"{key} is given, and {name!r} is neither a parameter ({', '.join(PARAMETERS)}) nor a key of the case that "
            f"holds a number, such as materials.CR.stiffness_factor or valve.initial_gap"
            f"{more if material in BUILT_IN else ''}.",
            key=key,
        )
    if other := "strain" if target == AUTO else READ_AS.get(name):
        raise CaseError(f"{key} names {name!r}, in whose place {other} is used; name that.", key=key)
    if why := _says_nothing(case, path, owner):
        raise CaseError(f"{key} names {name!r}, {why}.", key=key)
    return field, target


def _says_nothing(case: Case, path: Sequence[str], owner: Section) -> str:
    """Clause on why nothing of the valve depends on a key of the case; empty where something does."""
    if path[0] in UNREAD or path[0] not in PhysicsCase.model_fields:
        return "which describes no valve but how it is computed or told"
    other = owner.needs.get(path[-1])
    if other and owner.is_usual(other):
        return f"which says nothing without {other}"
    wall = {"wall_thickness": "uniform", "wall_map": "measured"}.get(path[1]) if path[0] == "valve" else None
    if wall and case.valve.wall != wall:
        return f"which says nothing with valve.wall = {case.valve.wall!r}"
    return ""


def _card(materials: Materials, name: str) -> Section:
    """Section of numbers that may change of a material without a table; rubbers whose levels are sought have one once
    these are found.
    """
    return materials.card(name) if name in RUBBERS and materials.strain_level == AUTO else BuiltIn()


def key_of(case: Case, name: str, key: str) -> tuple[Quantity, float]:
    """Quantity and value of a key of the case that holds one number; of a loss factor that the case does not number,
    the one that the material has. Raises CaseError.
    """
    field, value = number_of(case, name, key)
    if (number := plain_number(case, name, value)) is None:
        raise CaseError(f"{key} names {name!r}, which has no value in this case; give it one.", key=key)
    return quantity_of(field), number


def plain_number(case: Case, name: str, value: Any) -> float | None:
    """Number of a key of the case from what it holds; that of the material of a loss factor without one."""
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return float(value)
    parts = key_path(name)
    if parts[0] != "materials" or parts[-1] != "loss_factor":
        return None
    data = case.materials.loss(parts[1])
    known = data.loss_factor if data is not None else None
    return shipped_loss(known).value if isinstance(known, str) else known


def limits_of(field: FieldInfo, name: str) -> tuple[float, float]:
    """Least and largest number, SI, that a key of the case may hold; infinite where it has none."""
    is_loss = name.startswith("materials.") and name.endswith(".loss_factor")
    return (0.0, LARGEST_LOSS) if is_loss else numeric_limits(field)


def _shape_beside(case: Case, changed: Mapping[str, float], beside: Mapping[str, Any]) -> dict[str, object]:
    """Keys that keep the rest of a valve's shape where some of its numbers change: places along the axis move with its
    parts, and what follows from wall and shape by rules that jump stays. Some keys are changed beside.
    """
    sizes = {name.removeprefix("valve."): value for name, value in changed.items() if name.startswith("valve.")}
    if not sizes:
        return {}
    valve = case.valve.as_given
    kept = [key for key in KEPT if key in valve.following and key not in sizes]
    if valve.key_points is not None and "lip_radius" in kept:  # which the points give
        kept.remove("lip_radius")
    found: dict[str, object] = {f"valve.{key}": getattr(valve, key) for key in kept}
    if "lip_radius" in sizes and "duckbill_wall_deduction" in kept and valve.key_points is None:
        # half the wall, of which a smaller radius leaves no more than itself
        found["valve.duckbill_wall_deduction"] = min(valve.duckbill_wall_deduction, sizes["lip_radius"])
    if sizes.keys().isdisjoint(PARTS):
        return found
    lengths = [getattr(valve, each) for each in PARTS]
    longer = [sizes.get(each, length) for each, length in zip(PARTS, lengths)]
    joints = [np.concatenate([[0.0], np.cumsum(each)]) for each in (lengths, longer)]
    data = case.to_dict()
    for key in PLACES:
        section, _, name = key.partition(".")
        held = beside.get(key, data[section][name] if name else data[section])
        if held and (moved := _moved(held, *joints)) != held:
            found[key] = moved
    return found


def _moved(held: Any, *joints: np.ndarray) -> Any:
    """Places along the axis, in lists and tables too, moved with the joints of a valve from where these were."""
    if isinstance(held, list):
        return [_moved(each, *joints) for each in held]
    if isinstance(held, dict):
        return held | {name: _moved(held[name], *joints) for name in ("to", "begin", "end") if held.get(name)}
    return float(np.interp(held, *joints))


def models_of(case: Case, own: ValveModel) -> Callable[[Mapping[str, float]], ValveModel]:
    """Models of a case for parameters by their names in the equations; `own` is that of the case itself. With gravity
    each density has a model, whose levels and weight are numbers of it.
    """
    fixed = {"density": case.fluid.density} if case.gravity.is_there else {}
    known, rebuild = {*own.flow.names, *SYSTEM_NAMES} - fixed.keys(), rebuilder(case)

    @lru_cache(8)
    def built(design: tuple) -> ValveModel:
        return rebuild(dict(design)) if design else own

    def model(mu: Mapping[str, float]) -> ValveModel:
        changed = ((name, float(x)) for name, x in mu.items() if name not in known)
        return built(tuple(sorted(item for item in changed if item not in fixed.items())))

    return model


def rebuilder(case: Case) -> Callable[[Mapping[str, float]], ValveModel]:
    """Models of a case for design parameters; what geometry, mesh and shell refuse is a `CaseError`."""
    return lambda design: attempt(lambda: ValveModel(redesigned(case, design)))
