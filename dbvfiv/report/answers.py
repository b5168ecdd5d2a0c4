"""Answers on the first page: opens, chatters, closes, seals; each with its margin and how sure it is.

An answer is "yes" or "no" where every head of the case was examined and every verdict is certain, and "not examined"
with a reason anywhere else.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from ..materials.shipped import shipped_loss, shipped_loss_names
from ..studies.closure.safety import BUCKLING, CROSSING, END, OWN, SEAL, FirstBuckling, buckles_first, rated_verdict
from ..texts import digits, listed
from .gather import Gathered, second_mesh

YES, NO, UNKNOWN = "yes", "no", "not examined"
#: Flow of the law over that in three dimensions, on the 12-inch valve; docs/three-dimensions.md.
_FLOW = "flow 6 % high against three dimensions (12-inch valve)"


@dataclass(frozen=True)
class Answer:
    """Answer to one question.

    Attributes
    ----------
    question : str
    answer : str
        "yes", "no" or "not examined".
    text : str
        What was found, or why nothing was.
    margin : str
    uncertainty : tuple of str
    """

    question: str
    answer: str
    text: str
    margin: str = ""
    uncertainty: tuple[str, ...] = ()

    def summary(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return asdict(self)


def answers(found: Gathered) -> list[Answer]:
    """The four questions of page one."""
    return [opens(found), chatters(found), closes(found), seals(found)]


def span(found: Gathered) -> str:
    """Heads that were examined, "0.05 m to 1 m"."""
    return f"{found.case.units.pressure(found.heads[0], 3)} to {found.case.units.pressure(found.heads[-1], 3)}"


def opens(found: Gathered) -> Answer:
    """Answer on opening: cracked within the heads of the case."""
    question, steady, units = f"Does it open from {span(found)}?", found.get("steady"), found.case.units
    top = found.heads[-1]
    state = found.state(top)
    if state is None or found.case.drive.kind != "flow":
        why = found.why("steady") if found.case.drive.kind == "flow" else "No fluid flows: drive.kind is 'uniform'."
        return Answer(question, UNKNOWN, why if steady is None or not steady.failures else steady.failures[0])
    crack = steady.cracking
    if crack is None:
        return Answer(question, UNKNOWN, "No cracking head was found below the heads examined.")
    if crack.pressure is None or state.hydraulics is None:
        beyond = "" if crack.pressure is None else f"; they do at {units.pressure(crack.pressure, 3)}"
        return Answer(question, NO, f"The lips do not crack up to {units.pressure(top)}{beyond}.")
    text = (
        f"Cracks at {units.pressure(crack.pressure, 3)}; at {units.pressure(top)} the opening is "
        f"{units.text_of('size', state.lip_opening, 3)}, {units.text_of('flow', state.volume_flow, 3)} flow with a jet "
        f"of {units.text_of('velocity', state.outlet_velocity, 3)} and a head loss of "
        f"{units.text_of('head', state.hydraulics.head_loss, 3)}."
    )
    ratio = (top - found.case.rest_pressure) / crack.pressure if crack.pressure > 0 else np.inf
    margin = f"{ratio:.3g} times the cracking head" if np.isfinite(ratio) else "open at rest by its weight"
    return Answer(question, YES, text, margin, (*_mesh_of_flow(found, state), *_levels_of_flow(found), _FLOW))


def _mesh_of_flow(found: Gathered, state) -> Iterable[str]:
    other = found.state(state.pressure, "mesh-steady")
    if other is None:
        return (_not_there(found, "mesh-steady", "mesh"),)
    return (
        f"second mesh ({_mesh(found)}): opening {_apart(other.lip_opening, state.lip_opening)}, flow "
        f"{_apart(other.volume_flow, state.volume_flow)}",
    )


def _levels_of_flow(found: Gathered) -> Iterable[str]:
    top = found.heads[-1]
    base, levels = found.state(top, "mesh-steady"), _by_level(found, "steady")
    states = {level: found.state(top, f"levels-steady-{level}") for level in levels}
    if base is None or not levels or None in states.values():
        return ()
    said = ", ".join(f"{float(x):.0%}: {_apart(s.volume_flow, base.volume_flow)}" for x, s in states.items())
    return (f"flow with rubber of another strain level, {said}",)


def chatters(found: Gathered) -> Answer:
    """Answer on chatter: verdicts of the modes study at every head."""
    question, units, modes = f"Does it chatter from {span(found)}?", found.case.units, found.modes
    verdicts = {p: result.verdict for p, result in modes.items()}
    bad = [p for p, verdict in verdicts.items() if verdict.stable is False]
    unknown = [p for p in found.heads if p not in verdicts or verdicts[p].stable is None]
    if found.case.drive.kind != "flow":
        return Answer(question, UNKNOWN, "No fluid flows: drive.kind is 'uniform'.")
    reasons: dict[str, list[float]] = {}
    for p in unknown:
        reasons.setdefault(verdicts[p].reason if p in verdicts else _missing_head(found, p), []).append(p)
    open_heads = [
        f"No certain verdict at {listed(units.pressure(p, 3) for p in at)}: {why}" for why, at in reasons.items()
    ]
    if bad:
        worst = verdicts[max(bad, key=lambda p: verdicts[p].growth_rate)]
        kind = "flutters" if worst.outcome == "flutters" else "diverges, without oscillating,"
        text = f"It {kind} at {listed(units.pressure(p, 3) for p in bad)}"
        swings = [verdicts[p].frequency for p in bad if verdicts[p].frequency > 0]
        ends = dict.fromkeys(digits(end(swings)) for end in (min, max)) if swings else ()
        text += f", at {' to '.join(ends)} Hz" if ends else ""
        text = " ".join(filter(None, (f"{text}.", _onsets(found), *open_heads)))
        return Answer(question, YES, text, _factor(found), _sure(found, verdicts))
    if unknown:
        return Answer(question, UNKNOWN, " ".join(open_heads), _factor(found))
    least = min(verdicts.values(), key=lambda v: v.damping_ratio)
    text = (
        f"Stable at all {len(verdicts)} heads in every symmetry class; the least damped mode has a damping ratio of "
        f"{digits(100 * least.damping_ratio, 2)} %, at {units.pressure(found.worst, 3)}."
    )
    return Answer(question, NO, text, _factor(found), _sure(found, verdicts))


def _missing_head(found: Gathered, pressure: float) -> str:
    return found.why(f"heads-{found.heads.index(pressure) + 1}")


def _onsets(found: Gathered) -> str:
    onset = found.get("onset")
    if onset is None or not onset.points:
        return "" if "onset" not in found.missing else f"Where it begins is not examined: {found.missing['onset']}"
    units, said = found.case.units, []
    for point in (p for p in onset.points if p["edge"]):
        sure = "" if not point["uncertainty"] else f" ± {units.pressure(point['uncertainty'], 1)} (second mesh)"
        if point["uncertainty"] is None and onset.case.onset.coarse_mesh:
            sure = " (the second mesh has no onset like it)"
        word = "begins" if point["gains"] else "ends"
        said.append(f"{word} at {units.pressure(point['value'], 3)}{sure}, {digits(point['frequency'])} Hz")
    return f"Chatter {listed(said)}." if said else ""


def _factor(found: Gathered) -> str:
    """Margin in damping: the factor on the damping of the wall at which the verdict changes, at the worst head; empty
    where a head has no verdict.
    """
    verdicts = [result.verdict for result in found.modes.values()]
    unstable = [v.critical_damping_factor for v in verdicts if v.stable is False]
    if unstable:
        quiet = f"quiet with {digits(max(unstable), 2)} times the damping"
        return quiet if np.isfinite(unstable).all() else "no damping in reach quiets it"
    if len(verdicts) < len(found.heads) or any(v.stable is None for v in verdicts):
        return ""
    factors = [v.critical_damping_factor for v in verdicts if np.isfinite(v.critical_damping_factor)]
    return (
        f"chatter begins at {digits(max(factors), 2)} times the damping"
        if factors
        else "stable down to 0.05 times the damping"
    )


def _sure(found: Gathered, verdicts: dict) -> tuple[str, ...]:
    """Uncertainty of the verdict: constants of the rubber, second mesh, range of the loss factors, strain levels."""
    said, worst = list(_fits(found)), found.worst
    own = verdicts[worst]
    other = found.get("mesh-modes")
    if other is None:
        said.append(_not_there(found, "mesh-modes", "mesh"))
    else:
        theirs, ours = (digits(100 * found.damping_ratio, 2) for found in (other.verdict, own))
        said.append(f"second mesh ({_mesh(found)}): {_verdict(other.verdict)}, damping ratio {theirs} against {ours} %")
    spread = loss_range(found.case)
    factors = [v.critical_damping_factor for v in verdicts.values() if np.isfinite(v.critical_damping_factor)]
    if spread is not None:
        low, high = spread
        always = any(v.stable is False for v in verdicts.values()) and max(factors, default=0.0) > high
        holds = always or not any(low <= factor <= high for factor in factors)  # one head that chatters is enough
        word = "holds" if holds else "does not hold"
        said.append(f"over the range of the loss factors, {low:.2g} to {high:.2g} times: the verdict {word}")
    else:
        said.append("range of the damping: not examined (none is known of given constants)")
    for level in _by_level(found, "modes"):
        said.append(f"strain level {float(level):.0%}: {_verdict(found.get(f'levels-modes-{level}').verdict)}")
    if (chance := _chance(found)) is not None:
        said.append(chance)
    return tuple(said)


def _fits(found: Gathered) -> Iterable[str]:
    """Heads with a verdict although the constants of a rubber are unstable there, as under Rayleigh damping."""
    heads = [
        pressure
        for pressure, result in found.modes.items()
        if result.verdict.stable is not None and any("constants are unstable" in text for text in result.warnings)
    ]
    if heads:
        at = listed(found.case.units.pressure(pressure, 3) for pressure in heads)
        yield f"the rubber's constants are unstable at {at}: the verdict there is one on their fit, not on the rubber"


def _chance(found: Gathered) -> str | None:
    """Probability of chatter where it is largest, with its interval; None where the case has no uncertainty."""
    result = found.get("chance")
    if result is None:
        return _not_there(found, "chance", "uncertainty") if "chance" in found.missing else None
    known = [point for point in result.points if point["probability"] is not None]
    if not known:
        return "probability of chatter: no sample was decided"
    most = max(known, key=lambda point: point["probability"])
    chance, low, high = (digits(100 * x, 2) for x in (most["probability"], *most["interval"]))
    at = found.case.units.parameter(result.parameter).text(most["value"])
    return f"probability of chatter at {at}: {chance} % ({low} to {high} %)"


def loss_range(case) -> tuple[float, float] | None:
    """Ends of the range of the shipped loss factors over those of the case; None where it has none of them."""
    if not case.damping.relaxes:
        return None
    known = [shipped_loss(layer.material) for layer in case.layers if layer.material in shipped_loss_names()]
    rubbers = [one for one in known if one.value]
    if not rubbers:
        return None
    return min(one.range[0] / one.value for one in rubbers), max(one.range[1] / one.value for one in rubbers)


def closes(found: Gathered) -> Answer:
    """Answer on closing: shut at every back pressure examined up to the rated one, or to where the wall gives way."""
    result, question, units = found.get("closure"), "Does it close under back pressure?", found.case.units
    if result is None or not result.states:
        return Answer(question, UNKNOWN, found.why("closure") if result is None else _first(result.failures))
    rated = found.case.closure.rated_pressure or max(s.pressure for s in result.states)
    states = [s for s in result.states if not s.beyond_limit and s.pressure <= rated * (1 + 1e-9)]
    if not states:
        return Answer(question, UNKNOWN, _first(result.failures))
    shut = [s.pressure for s in states if s.closed]
    text = f"Shut at {listed(units.pressure(p, 3) for p in shut)}" if shut else "Open"
    collapse = _collapse(result, rated)
    text += f"{'' if shut else ' up to ' + units.pressure(states[-1].pressure, 3)}; {collapse}" if collapse else ""
    answer = YES if shut and states[-1].closed else NO
    return Answer(question, answer, text + ".", _margin(result), _closure_mesh(found))


def seals(found: Gathered) -> Answer:
    """Answer on sealing at the rated back pressure: no gap left."""
    case, result = found.case, found.get("closure")
    rated = case.closure.rated_pressure
    if rated is None:
        return Answer("Does it seal?", UNKNOWN, "No rated back pressure is given: closure.rated_pressure.")
    question = f"Does it seal at its rated {case.units.pressure(rated, 3)}?"
    told = None if result is None else rated_verdict(result)
    collapse = None if result is None else _collapse(result, rated)
    if collapse:
        return Answer(question, NO, f"{collapse[0].upper()}{collapse[1:]}.", _margin(result), _closure_mesh(found))
    if told is None or told["sealed"] is None:
        why = (
            found.why("closure") if result is None else result.walk_failure or "The lips are held shut by the supports."
        )
        return Answer(question, UNKNOWN, why)
    still = " at most, as fluid.viscosity is none" if told["leak"] and not case.fluid.dynamic_viscosity else ""
    text = f"{_seal(told).capitalize()}, leak {digits(told['leak'] * 3.6e6)} L/h{still}."
    return Answer(question, YES if told["sealed"] else NO, text, _margin(result), _closure_mesh(found))


def _collapse(result, rated: float) -> str:
    """Clause on a wall that gives way below a back pressure, Pa; empty where it does not."""
    first, units = buckles_first(result), result.case.units
    if first is None or first.pressure >= rated:
        return ""
    below = "rated back pressure" if result.case.closure.rated_pressure is not None else "largest one examined"
    return f"{_gives_way(first)} at {units.pressure(first.pressure, 3)}, below the {below}"


def _gives_way(first: FirstBuckling) -> str:
    """Clause on a wall at its critical back pressure: at a limit point it snaps to a state far away."""
    return "the wall collapses" if first.kind == "limit point" else "the wall buckles"


def _seal(told: dict[str, Any]) -> str:
    return "sealed" if told["sealed"] else "shut" if told["shut"] else "open"


#: Limits of a valve under back pressure as a reader meets them.
_LIMITS = {SEAL: "the seal is lost at", CROSSING: "faces cross at", END: "no state was found beyond"}


def _margin(result) -> str:
    """First limit of a valve under back pressure, in its units and over the rated one."""
    safety, units = result.safety, result.case.units
    if safety is None:
        return ""
    times = f", {safety.factor:.2f} times the rated" if result.case.closure.rated_pressure is not None else ""
    if safety.at_least:
        within = "" if result.classes else f" {OWN}"
        return f"no limit{within} up to {units.pressure(safety.followed_to, 3)}{times}"
    limit = f"{_gives_way(buckles_first(result))} at" if safety.limit == BUCKLING else _LIMITS[safety.limit]
    return f"{limit} {units.pressure(safety.limit_pressure, 3)}{times}"


def _closure_mesh(found: Gathered) -> tuple[str, ...]:
    other = found.get("mesh-closure")
    if other is None or other.safety is None:
        return (_not_there(found, "mesh-closure", "mesh"),)
    told = rated_verdict(other)
    seal = f"{_seal(told)}, leak {digits(told['leak'] * 3.6e6, 2)} L/h, " if told and told["sealed"] is not None else ""
    return (f"second mesh ({_mesh(found)}): {seal}{_margin(other)}",)


def trade(found: Gathered) -> list[tuple[str, str]]:
    """Names and numbers that a buyer asks for, at the largest head."""
    units, case, rows = found.case.units, found.case, []
    state, steady = found.state(found.heads[-1]), found.get("steady")
    sizes = found.sizes
    bill = " x ".join(units.text_of("size", size, 4) for size in (sizes.bill_width, sizes.bill_height))
    bore = 2 * (case.valve.inlet_radius - case.valve.flange_wall_deduction)
    rows += [("bill, width x height", bill), ("bore", units.text_of("size", bore, 4))]
    if steady is not None and steady.cracking is not None and steady.cracking.pressure is not None:
        rows += [("cracking head", units.pressure(steady.cracking.pressure, 3))]
    if state is not None and state.hydraulics is not None:
        at = f"at {units.pressure(state.pressure, 3)}"
        rows += [
            (f"opening {at}", units.text_of("size", state.lip_opening, 3)),
            (f"flow {at}", units.text_of("flow", state.volume_flow, 3)),
            (f"head loss {at}", units.text_of("head", state.hydraulics.head_loss, 3)),
            (f"jet velocity {at}", units.text_of("velocity", state.outlet_velocity, 3)),
        ]
    if case.closure.rated_pressure is not None:
        rows += [("rated back pressure", units.pressure(case.closure.rated_pressure, 4))]
        told = None if found.get("closure") is None else rated_verdict(found.get("closure"))
        leak = "not examined" if told is None or told["leak"] is None else f"{digits(told['leak'] * 3.6e6)} L/h"
        rows += [("leak rate there", leak)]
    return rows


def _verdict(verdict) -> str:
    return {"flutters": "chatters", "diverges": "diverges", "stable": "stable"}.get(verdict.outcome, verdict.outcome)


def _apart(value: float, base: float) -> str:
    apart = 100 * (value / base - 1) if base else np.nan
    return (
        "not known" if np.isnan(apart) else f"{digits(apart, 2, '+')} %" if abs(apart) >= 0.01 else "less than 0.01 %"
    )


def _mesh(found: Gathered) -> str:
    mesh = second_mesh(found.case)
    return f"{mesh['mesh.around']} x {mesh['mesh.along']}"


def _not_there(found: Gathered, name: str, word: str) -> str:
    return f"{word}: not examined ({found.why(name)})"


def _by_level(found: Gathered, kind: str) -> list[str]:
    prefix = f"levels-{kind}-"
    return [name.removeprefix(prefix) for name in found.results if name.startswith(prefix)]


def _first(failures) -> str:
    return failures[0] if failures else "Nothing was found."
