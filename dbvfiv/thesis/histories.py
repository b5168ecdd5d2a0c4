"""Time histories: pressure applied at once in water (Figs. 5-3 to 5-7, 5-10, 7-13), and vibration at small openings in
a light fluid, of a density that the thesis does not give (Figs. 7-14 to 7-17).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from ..report.parts import Picture, picture, pictures_of
from ..studies.transient import figures
from .entry import Found, Number, Workshop, entry

_ALPHA_3 = {"damping.alpha": 3, "damping.beta": 0.003}
_AT_36 = {"drive.pressure": 36e3} | _ALPHA_3


def _together(name: str, runs: Mapping[str, Any]) -> Picture:
    return picture(f"thesis-{name}", "", lambda: figures.draw_together(list(runs.values()), list(runs)))


def _series(
    workshop: Workshop, name: str, common: Mapping[str, Any], members: Mapping[str, Mapping[str, Any]]
) -> list[Found]:
    """Histories that differ in one thing: their last flow and how far it is from that of the steady state, one picture,
    and a sentence for each that found no step.
    """
    length = {"transient.duration": workshop.duration(0.5, 0.4)}
    runs = {word: workshop.run("transient", length | common | changes, word) for word, changes in members.items()}
    found: list[Found] = [_together(name, runs)]
    for word, run in runs.items():
        if run.failures:
            found.append(f"Not to the end, {word}: no step was found after {1e3 * run.history['time'][-1]:.3g} ms.")
            continue
        keys = ("mesh.around", "mesh.along", "materials.strain_level")
        changes = {key: value for key, value in (common | members[word]).items() if key in keys}
        steady = workshop.steady((run.case.drive.pressure,), changes).states[0].mass_flow
        last = float(run.history["mass_flow"][-1])
        found.append(Number(f"flow at the end, {word}", last, None, "kg/s"))
        found.append(Number(f"off the steady flow, {word}", 100 * (last / steady - 1), None, "%"))
    return found


@entry("5-3", "independence of the mesh")
def _mesh(workshop: Workshop):
    yield "In the thesis the flow at the end hardly depends on the mesh. Onsets do: see the guide on stability."
    sizes = ((8, 14), (10, 18)) if workshop.quick else ((10, 24), (14, 24), (28, 48))
    yield from _series(workshop, "5-3", _AT_36, {f"{a} x {b}": {"mesh.around": a, "mesh.along": b} for a, b in sizes})


@entry("5-4", "independence of the step")
def _step(workshop: Workshop):
    yield (
        "In the thesis all steps end in the same state. Its flow turns back in the first 20 ms, which it puts down "
        "to its gap and link elements; ours does not."
    )
    sizes = ("2", "1") if workshop.quick else ("1", "0.5", "0.2")
    common = {"drive.pressure": 29e3} | _ALPHA_3
    yield from _series(workshop, "5-4", common, {f"{size} ms": {"transient.step": f"{size} ms"} for size in sizes})


@entry("5-5", "stiffness damping")
def _beta(workshop: Workshop):
    yield "In the thesis the way differs and the end does not."
    members = {f"beta {value:g} s": {"damping.beta": value} for value in (0.003, 0.01, 0.02)}
    yield from _series(workshop, "5-5", _AT_36, members)


@entry("5-6", "mass damping")
def _alpha(workshop: Workshop):
    yield "The thesis sees no difference."
    members = {f"alpha {value:g} 1/s": {"damping.alpha": value} for value in (1, 3, 5)}
    yield from _series(workshop, "5-6", _AT_36, members)


@entry("5-7", "numerical damping")
def _numerical_damping(workshop: Workshop):
    yield "The thesis sees no influence on the end."
    members = {f"{value:g}": {"transient.numerical_damping": value} for value in (0.0, 0.1, 0.3, 0.5)}
    yield from _series(workshop, "5-7", _AT_36, members)


@entry("5-8", "first against fifth loading")
def _softening(workshop: Workshop):
    yield (
        "Not made again: it compares the fifth with the first loading curve of each rubber (+15 % of flow), and of the "
        "first the thesis prints no constants."
    )


@entry("5-10", "the unsteady term")
def _unsteady_term(workshop: Workshop):
    members = {"with its unsteady term": {}, "without it": {"fluid.unsteady": False}}
    common = {"drive.pressure": 36e3, "damping.alpha": 0, "damping.beta": 0.003}
    found = _series(workshop, "5-10", common, members)
    yield (
        "In the thesis the flow rises to its end without a swing with the unsteady term, and overshoots and oscillates "
        "without it."
    )
    if any(isinstance(one, str) for one in found):
        yield (
            "Before the lips have opened the law without it is ill-posed on this mesh: where the walls close upstream "
            "of the lip its jet has suction without bound."
        )
    yield from found


@entry("7-13", "water from 2 to 50 kPa")
def _water(workshop: Workshop):
    yield "In the thesis and in its tunnel water from 2 to 50 kPa opens the valve without an oscillation."
    members = {f"{p} kPa": {"drive.pressure": 1e3 * p} for p in ((6, 36) if workshop.quick else (2, 6, 18, 36, 50))}
    yield from _series(workshop, "7-13", {"damping.alpha": 5, "damping.beta": 0.003}, members)


_LIGHT = {"damping.alpha": 0, "damping.beta": 0.003}
#: A push of about the size of the cycle, so that it settles soon.
_CYCLE = {"transient.start": "kick", "transient.kick_opening": "8 mm", "transient.stop_when": ["limit cycle", "steady"]}


def _density(workshop: Workshop) -> float:
    """Density at which the model has a clean cycle at 6 kPa, kg/m3; the coarse mesh has it further up."""
    return 70.0 if workshop.quick else 40.0


@entry("7-14", "independence of the step in a cycle")
def _steps(workshop: Workshop):
    common = _LIGHT | _CYCLE | {"drive.pressure": 6e3, "fluid.density": _density(workshop)}
    common |= {"transient.duration": workshop.duration(1.0, 0.8)}
    sizes = ("2", "1") if workshop.quick else ("2", "1", "0.5")
    runs = {
        f"{size} ms": workshop.run("transient", common | {"transient.step": f"{size} ms"}, f"{size} ms")
        for size in sizes
    }
    for name, run in runs.items():
        if run.verdict["verdict"] == "limit cycle":
            yield Number(f"amplitude of the flow, {name}", run.verdict["mass_flow"]["amplitude"], None, "kg/s")
        else:
            yield f"{name}: {run.verdict['verdict']}, so no amplitude."
    yield (
        f"At {_density(workshop):g} kg/m3 and 6 kPa. In the thesis the amplitude tends to a limit as the step shrinks; "
        "docs/evidence/time.md follows it to 0.1 ms, with its observed order of 2."
    )
    yield _together("7-14", runs)


def _suddenly(workshop: Workshop, pressure: float, name: str) -> Iterator[Found]:
    """Pressure applied at once, with several readings of "small enough that the fluid inertia can be ignored"."""
    common = _LIGHT | {"drive.pressure": pressure, "transient.step": "0.5 ms"}
    # in air the lips slam from the first closing on, which time does not change; a cycle takes its time to settle
    short = {"transient.duration": workshop.duration(0.25, 0.15)}
    long = {"transient.duration": workshop.duration(0.9, 0.15), "transient.stop_when": ["limit cycle", "steady"]}
    air, staggered = {"fluid.density": 1.2}, {"transient.coupling": "staggered"}
    readings = {
        "40 kg/m3": long | {"fluid.density": 40.0},
        "25 kg/m3": long | {"fluid.density": 25.0},
        "air": short | air,
        "no unsteady term": short | {"fluid.unsteady": False},
        "air, staggered": short | air | staggered,
        "25 kg/m3, staggered": long | {"fluid.density": 25.0} | staggered,
    }
    if workshop.quick:
        readings = {word: readings[word] for word in ("25 kg/m3", "air", "no unsteady term")}
    runs = {word: workshop.run("transient", common | changes, word) for word, changes in readings.items()}
    for word, run in runs.items():
        reached = f", ended at {run.history['time'][-1]:.3g} s" if run.failures else ""
        yield f"{word}: {run.verdict['verdict']}{reached}."
    yield _together(name, runs)


@entry("7-15", "oscillation at 6 kPa")
def _cycle_at_6(workshop: Workshop):
    yield (
        "The thesis shows an oscillation of constant amplitude in a fluid of a density that it does not give. "
        "Verdicts of its possible readings here, App. A's stops, alpha 0, beta 3 ms:"
    )
    yield from _suddenly(workshop, 6e3, "7-15")
    yield (
        "Constant amplitudes are what this model has from 25 kg/m3 to its onset; lighter fluids make the lips "
        "touch and slam."
    )


@entry("7-16", "travelling wave")
def _wave(workshop: Workshop):
    common = _LIGHT | _CYCLE | {"drive.pressure": 6e3, "fluid.density": _density(workshop), "transient.step": "1 ms"}
    run = workshop.run("transient", common | {"transient.duration": workshop.duration(1.5, 0.8)})
    yield "In the thesis the motion is largest at the lip and runs streamwise."
    yield f"The run ends as: {run.verdict['verdict']}."
    captions = {"centre-line-cycle": "The line x = 0 over a cycle.", "lip-wave": "Its motion over place and time."}
    yield from pictures_of(run, captions)


@entry("7-17", "oscillation at 2 kPa")
def _cycle_at_2(workshop: Workshop):
    yield "Suddenly applied 2 kPa; the thesis sees a smaller oscillation than at 6 kPa."
    yield from _suddenly(workshop, 2e3, "7-17")
