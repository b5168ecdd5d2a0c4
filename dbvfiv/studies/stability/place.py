"""Parameters that stability is asked over: of the load, of the surroundings, of the design."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from ...case.materials import RUBBERS
from ...case.parameters import OUTSIDE, PARAMETERS, PIPES, Mu
from ...errors import CaseError, SolveError
from ...model import ValveModel
from ..case import Case


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


def check_scan(case: Case, *names: str) -> None:
    """Refuse to ask over a parameter that this case does not have, or without flow.

    Raises
    ------
    CaseError
        For strain levels without a rubber that has them, and angles without a ply that has one.
    SolveError
        Without flow.
    """
    if case.drive.kind != "flow":
        raise SolveError(
            "Without flow nothing couples the fluid to the wall, so there is no onset to look for; "
            "drive.kind must be 'flow'."
        )
    for name in names:
        require_parameter(case, name)


def require_parameter(case: Case, name: str) -> None:
    """Refuse a parameter that nothing in a case depends on.

    Raises
    ------
    CaseError
        For strain levels without a rubber that has them, angles without a ply that has one, the length of a line that
        is not there, and what the model of damping does not have.
    """
    if name in ("pipe_length", "wave_speed") and case.upstream.pieces:
        raise CaseError(
            f"There is no one {name} to change: the line has {len(case.upstream.pieces)} pieces, each with its own; "
            "give a line of one pipe, or set the pieces one by one.",
            key="upstream.pieces",
        )
    if name == "pipe_length" and not case.has_line:
        raise CaseError(
            "There is no pipe_length to change: the valve has no line in front; give upstream.length (drive.pressure "
            "is then that at its far end, see drive.at).",
            key=PARAMETERS[name].key,
        )
    if name == "tail_length" and not case.has_tail:
        raise CaseError(
            "There is no tail_length to change: no pipe follows the valve; give downstream.pipe_diameter.",
            key=PARAMETERS[name].key,
        )
    if name == "density" and case.has_pump:
        raise CaseError(
            "Over the density a pump has no steady state to keep: its head is another pressure in another fluid; set "
            "fluid.density for each, or give drive.pressure and no upstream.pump.",
            key=PARAMETERS[name].key,
        )
    if name == "wave_speed" and not case.has_waves:
        raise CaseError(
            "There is no wave_speed to change: the valve has no elastic line in front; give upstream.length and "
            "upstream.wave_speed.",
            key=PARAMETERS[name].key,
        )
    if name == "sealing" and not case.valve.sealing_pressure:
        raise CaseError(
            "There is no sealing pressure to change: the bill is not moulded shut; give valve.sealing_pressure.",
            key=PARAMETERS[name].key,
        )
    lacking = case.damping.lacks(name)
    if lacking:
        raise CaseError(f"There is no {name} to change: {lacking}.", key=PARAMETERS[name].key)
    used = {layer.material for layer in case.layers}
    if name == "strain" and not case.seeks_levels and not case.materials.levels(used):
        raise CaseError(
            "There is no strain level to change, because no layer is one of the built-in rubbers "
            f"{', '.join(RUBBERS)}; the layers are of {', '.join(sorted(used))}."
        )
    if name == "angle" and not any(layer.angle for layer in case.layers):
        raise CaseError("There is no fibre angle to change, because every layer lies at 0 degrees.")


def design_value(case: Case, name: str) -> float | None:
    """Value of a parameter of the design in a case, as `redesigned` takes it; None where there is no one value."""
    if name == "thickness":
        return 1.0
    if name == "sealing":
        return case.valve.sealing_pressure
    if name == "angle":  # of all plies at once
        values = {abs(layer.angle) for layer in case.layers if layer.angle}
    else:  # strain, of all rubbers at once
        values = set(case.materials.levels({layer.material for layer in case.layers}).values())
    return values.pop() if len(values) == 1 else None


def redesigned(case: Case, design: Mapping[str, float]) -> Case:
    """A case with design parameters changed: wall thickness factor, size of the angle of all plies (degrees), strain
    level (0.1 for 10 %); any other by its key, such as the length of the line where the steady state depends on it.

    Raises
    ------
    CaseError
        For values that the case does not allow.
    """
    changes: dict[str, object] = {}
    for name, value in design.items():
        if name == "thickness":
            changes[PARAMETERS[name].key] = case.valve.thickness_factor * value
        elif name == "strain":
            rubbers = case.materials.levels({layer.material for layer in case.layers})
            changes |= case.materials.at_levels(dict.fromkeys(rubbers, value))
        elif name == "angle":
            layers = case.to_dict()["layers"]
            for layer in layers:
                if layer["angle"]:
                    layer["angle"] = value if layer["angle"] > 0 else -value
            changes[PARAMETERS[name].key] = layers
        else:
            changes[PARAMETERS[name].key] = value
    return case.replace(changes) if changes else case


def rebuilder(case: Case) -> Callable[[Mapping[str, float]], ValveModel]:
    """Models of a case for design parameters."""
    return lambda design: ValveModel(redesigned(case, design))
