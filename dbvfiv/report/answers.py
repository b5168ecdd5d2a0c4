"""Answers on the first page: opens, chatters, closes, seals; each with its margin and how sure it is.

An answer is "yes" or "no" where every head of the case was examined and every verdict is certain, and "not examined"
with a reason anywhere else.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from ..materials.shipped import shipped_loss, shipped_loss_names
from ..model.supports import HELD_LIPS
from ..model.symmetry import only_class_of
from ..studies.closure.safety import BUCKLING, CROSSING, END, OWN, SEAL, buckles_first, rated_leak, rated_verdict
from ..studies.onset.search import NO_ONSET
from ..studies.stability.verdict import DIVERGES, FLUTTERS, Verdict
from ..studies.steady.study import NOT_FOUND
from ..texts import digits, listed
from .gather import Gathered, second_mesh

YES, NO, UNKNOWN = "yes", "no", "not examined"
_HELD = "The lips are held shut by the supports"
#: Flow of the law over that in three dimensions, on the 12-inch valve; docs/three-dimensions.md.
_FLOW = "flow 6 % high against three dimensions (12-inch valve)"


@dataclass(frozen=True)
class Answer:
    """Answer to one question."""

    question: str
    answer: str  #: "yes", "no" or "not examined".
    text: str  #: What was found, or why nothing was.
    margin: str = ""
    uncertainty: tuple[str, ...] = ()

    def summary(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return asdict(self)


def answers(found: Gathered) -> list[Answer]:
    """The four questions of page one, with the sentences of studies in the units of the case."""
    say = found.case.units.say
    return [
        replace(one, text=say(one.text), margin=say(one.margin), uncertainty=tuple(map(say, one.uncertainty)))
        for one in (opens(found), chatters(found), closes(found), seals(found))
    ]


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
        lost = (sentence for sentence in steady.warnings if sentence.startswith(NOT_FOUND))
        return Answer(question, UNKNOWN, next(lost, "No cracking head was found below the heads examined."))
    cracks = "" if crack.pressure is None else units.pressure(found.case.rest_pressure + crack.pressure, 3)
    if crack.pressure is None or state.hydraulics is None:
        beyond = f"; they do at {cracks}" if cracks else ""
        return Answer(question, NO, f"The lips do not crack up to {units.pressure(top)}{beyond}.{_lost(found)}")
    text = (
        f"Cracks at {cracks}; at {units.pressure(top)} the opening is "
        f"{units.text_of('size', state.lip_opening, 3)}, {units.text_of('flow', state.volume_flow, 3)} flow with a jet "
        f"of {units.text_of('velocity', state.outlet_velocity, 3)} and a head loss of "
        f"{units.text_of('head', state.hydraulics.head_loss, 3)}.{_lost(found)}"
    )
    ratio = (top - found.case.rest_pressure) / crack.pressure if crack.pressure > 0 else np.inf
    margin = f"{ratio:.3g} times the cracking head" if np.isfinite(ratio) else "open at rest by its weight"
    return Answer(question, YES, text, margin, (*_mesh_of_flow(found, state), *_levels_of_flow(found), _FLOW))


def _lost(found: Gathered) -> str:
    """Sentence on heads at which no steady state was found, behind another; empty without any."""
    lost, failures = [p for p in found.heads if found.state(p) is None], found.get("steady").failures
    at = listed(found.case.units.pressure(p, 3) for p in lost)
    return f" No state was found at {at}: {failures[0]}" if lost and failures else ""


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
        missing = f"heads-{found.heads.index(p) + 1}"
        reasons.setdefault(verdicts[p].reason if p in verdicts else found.why(missing), []).append(p)
    open_heads = [
        f"No certain verdict at {listed(units.pressure(p, 3) for p in at)}: {why}" for why, at in reasons.items()
    ]
    if bad:
        text = " ".join(filter(None, (*_unstable(found, verdicts), _onsets(found), *open_heads)))
        return Answer(question, YES, text, _factor(found), _sure(found, verdicts))
    if unknown:
        return Answer(question, UNKNOWN, " ".join(open_heads), _factor(found))
    text, least = f"Stable at all {len(verdicts)} heads in every symmetry class", verdicts[found.worst].damping_ratio
    if np.isfinite(least):
        text += f"; the least damped mode has a damping ratio of {digits(100 * least, 2)} %, "
        text += f"at {units.pressure(found.worst, 3)}"
    return Answer(question, NO, f"{text}.", _factor(found), _sure(found, verdicts))


def _unstable(found: Gathered, verdicts: dict[float, Verdict]) -> Iterable[str]:
    """Sentences on the heads at which the valve flutters, with its frequencies, and on those at which it diverges."""
    for outcome, words in ((FLUTTERS, "It flutters"), (DIVERGES, "It diverges, without oscillating,")):
        heads = [p for p, verdict in verdicts.items() if verdict.outcome == outcome]
        swings = [verdicts[p].frequency for p in heads if verdicts[p].frequency > 0]
        ends = dict.fromkeys(digits(end(swings)) for end in (min, max)) if swings else ()
        at = listed(found.case.units.pressure(p, 3) for p in heads)
        at += f", at {' to '.join(ends)} Hz" if ends else ""
        if heads:
            yield f"{words} at {at}."


def _onsets(found: Gathered) -> str:
    onset = found.get("onset")
    if onset is None or not onset.points:
        return "" if "onset" not in found.missing else f"Where it begins is not examined: {found.missing['onset']}"
    units, said = found.case.units, {"Chatter": [], "Divergence": []}
    for point in (p for p in onset.points if p["edge"]):
        sure = "" if not point["uncertainty"] else f" ± {units.pressure(point['uncertainty'], 1)} (second mesh)"
        sure += f" (the second mesh {lacks})" if (lacks := lacking(point)) else ""
        sure += "" if point["confirmed"] else " (not confirmed)"
        at = f"{'begins' if point['gains'] else 'ends'} at {units.pressure(point['value'], 3)}{sure}"
        oscillates = point["frequency"] > 0
        at += f", {digits(point['frequency'])} Hz" if oscillates else ""
        said["Chatter" if oscillates else "Divergence"].append(at)
    return " ".join(f"{kind} {listed(points)}." for kind, points in said.items() if points)


def lacking(point: dict[str, Any]) -> str:
    """Clause on what the second mesh lacks, "has no onset like it"; empty of an onset that was found on both, or on
    one alone.
    """
    found = re.search(f"{NO_ONSET}[^,]*", point["note"] or "")
    return found[0] if found else ""


def _factor(found: Gathered) -> str:
    """Margin in damping: the factor on the damping of the wall at which the verdict changes, at the worst head, or the
    last one that was looked at; empty where a head has no verdict, or nothing is known of that.
    """
    verdicts = [result.verdict for result in found.modes.values()]
    if unstable := [v for v in verdicts if v.stable is False]:
        if any(v.outcome == DIVERGES for v in unstable):
            return "no damping quiets what diverges"
        if sought := [v.damping_sought for v in unstable if np.isfinite(v.damping_sought)]:
            return f"chatters up to {digits(max(sought), 2)} times the damping"
        most = np.max([v.critical_damping_factor for v in unstable])
        return f"quiet with {digits(most, 2)} times the damping" if np.isfinite(most) else ""
    if len(verdicts) < len(found.heads) or any(v.stable is None for v in verdicts):
        return ""
    factors = [v.critical_damping_factor for v in verdicts if np.isfinite(v.critical_damping_factor)]
    if factors:
        known = all(v.is_examined_down_to(max(factors)) for v in verdicts)
        return f"chatter begins at {digits(max(factors), 2)} times the damping" if known else ""
    least = np.max([v.damping_sought for v in verdicts])
    return f"stable down to {digits(least, 2)} times the damping" if np.isfinite(least) else ""


def _sure(found: Gathered, verdicts: dict) -> tuple[str, ...]:
    """Uncertainty of the verdict: constants of the rubber, second mesh, range of the loss factors, strain levels."""
    said, worst = list(_fits(found)), found.worst
    own = verdicts[worst]
    other = found.get("mesh-modes")
    if other is None:
        said.append(_not_there(found, "mesh-modes", "mesh"))
    else:
        theirs, ours = (100 * verdict.damping_ratio for verdict in (other.verdict, own))
        known = np.isfinite([theirs, ours]).all()
        ratios = f", damping ratio {digits(theirs, 2)} against {digits(ours, 2)} %" if known else ""
        said.append(f"second mesh ({_mesh(found)}): {_verdict(other.verdict)}{ratios}")
    spread = loss_range(found.case)
    if spread is not None:
        said.append(_over_losses(verdicts.values(), *spread))
    else:
        said.append("range of the damping: not examined (none is known of given constants)")
    for level in _by_level(found, "modes"):
        said.append(f"strain level {float(level):.0%}: {_verdict(found.get(f'levels-modes-{level}').verdict)}")
    if (chance := _chance(found)) is not None:
        said.append(chance)
    return tuple(said)


def _over_losses(verdicts: Iterable[Verdict], low: float, high: float) -> str:
    """Sentence on whether the verdict on all heads holds to one end of a range of multiples of the damping: to the low
    end for a stable valve, to the high one for a valve that chatters, for which one head is enough; multiples were
    looked at on that side alone.
    """
    bad = [v for v in verdicts if v.stable is False]
    if bad:
        end, examined = f"up to {high:.2g}", high > 1
        holds = any(v.outcome == DIVERGES or v.critical_damping_factor >= high or v.damping_sought >= high for v in bad)
        fails = all(v.critical_damping_factor < high for v in bad)
    else:
        end, examined = f"down to {low:.2g}", low < 1
        holds = all(v.critical_damping_factor < low or v.damping_sought <= low for v in verdicts)
        fails = any(v.critical_damping_factor >= low for v in verdicts)
    word = "the verdict holds" if holds else "the verdict does not hold" if fails else "not examined"
    return f"over the range of the loss factors, {end} times: {word if examined else 'not examined'}"


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
        return "probability of chatter: not known, no sample was decided"
    snaps = lambda point: point["outcomes"][DIVERGES]["probability"] or 0.0  # noqa: E731
    most = max(known, key=lambda point: point["probability"] + snaps(point))
    chance, low, high = (digits(100 * x, 2) for x in (most["probability"], *most["interval"]))
    text = found.case.units.parameter(result.parameter).text
    at, lost = text(most["value"]), [text(point["value"]) for point in result.points if point["probability"] is None]
    also = f", of divergence {digits(100 * snaps(most), 2)} %" if snaps(most) else ""
    also += f", not known at {listed(lost)}" if lost else ""
    return f"probability of chatter at {at}: {chance} % ({low} to {high} %){also}, {only_class_of(found.case.part)}"


def loss_range(case) -> tuple[float, float] | None:
    """Ends of the range of the shipped loss factors over those of the case; None where it has none of them."""
    own = case.damping.loss_factor if case.damping.relaxes else 0.0
    data = [case.materials.loss(layer.material) for layer in case.layers]
    known = [
        shipped_loss(one.loss_factor) for one in data if one is not None and one.loss_factor in shipped_loss_names()
    ]
    if not (own and known):
        return None
    return min(one.range[0] / one.value for one in known) / own, max(one.range[1] / one.value for one in known) / own


def closes(found: Gathered) -> Answer:
    """Answer on closing: shut at every back pressure examined up to the rated one, or to where the wall gives way."""
    result, question, units = found.get("closure"), "Does it close under back pressure?", found.case.units
    if result is None or not result.states:
        return Answer(question, UNKNOWN, found.why("closure") if result is None else _first(result.failures))
    rated = found.case.closure.rated_pressure
    asked = rated or max(result.case.closure.pressures)
    states = [s for s in result.states if not s.beyond_limit and s.pressure <= asked * (1 + 1e-9)]
    states.sort(key=lambda state: state.pressure)  # those of closure.pressures stand as they were asked for
    if not states:
        return Answer(question, UNKNOWN, _first(result.failures))
    shut = [s.pressure for s in states if s.closed]
    held = result.case.closure.supports == HELD_LIPS
    text = _HELD if held else f"Shut at {listed(units.pressure(p, 3) for p in shut)}" if shut else "Open"
    collapse = _collapse(result, asked)
    text += f"{'' if shut else ' up to ' + units.pressure(states[-1].pressure, 3)}; {collapse}" if collapse else ""
    answer = UNKNOWN if held else YES if shut and states[-1].closed else NO
    if not collapse and max(s.pressure for s in states) < asked * (1 - 1e-9):
        pressure = f"{'rated ' if rated else ''}{units.pressure(asked, 3)}{'' if rated else ' asked for'}"
        answer, text = UNKNOWN, f"{text}; no state was found at the {pressure}"
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
        why = found.why("closure") if result is None else result.walk_failure or f"{_HELD}."
        return Answer(question, UNKNOWN, why)
    text = f"{_seal(told).capitalize()}, leak {rated_leak(result)}."
    return Answer(question, YES if told["sealed"] else NO, text, _margin(result), _closure_mesh(found))


def _collapse(result, rated: float) -> str:
    """Clause on a wall that gives way below a back pressure, Pa; empty where it does not."""
    first, units = buckles_first(result), result.case.units
    if first is None or first.pressure >= rated:
        return ""
    below = ", below the rated back pressure" if result.case.closure.rated_pressure is not None else ""
    return f"{_gives_way(first.kind)} at {units.pressure(first.pressure, 3)}{below}"


def _gives_way(kind: str) -> str:
    """Clause on a wall at its critical back pressure: at a limit point it snaps to a state far away."""
    return "the wall collapses" if kind == "limit point" else "the wall buckles"


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
    limit = f"{_gives_way(buckles_first(result).kind)} at" if safety.limit == BUCKLING else _LIMITS[safety.limit]
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
    rows += [("bill, width x height", bill), ("bore", units.text_of("size", case.valve.bore, 4))]
    if steady is not None and steady.cracking is not None and steady.cracking.pressure is not None:
        over = " over that at rest" if case.rest_pressure else ""
        rows += [("cracking head", f"{units.pressure(steady.cracking.pressure, 3)}{over}")]
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
        leak = "not examined" if found.get("closure") is None else rated_leak(found.get("closure"))
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
