"""Parts of a report, sentences, tables and pictures, in the order they are read, made from what was gathered."""

from __future__ import annotations

import base64
import io
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from ..case.materials import Layer
from ..case.parameters import Mu
from ..case.units import Units
from ..drawing.style import put_in_units, style
from ..drawing.views import deformed, layer_stress, valve_figure
from ..effects import explained, without_numbers
from ..errors import CaseError
from ..fit.cards import describe_damping, law_from_case
from ..materials.stability import StableRange, stable_range
from ..model.supports import HELD_LIPS
from ..model.symmetry import only_class_of, symmetry_named
from ..studies.result import StudyResult
from ..texts import digits, listed
from .answers import lacking, loss_range
from .figures import closure_figure, headloss_figure, live_valve, pipe_figure, vibration_figure
from .gather import Gathered, is_on_own_mesh


@dataclass(frozen=True)
class Table:
    """A table for people."""

    head: tuple[str, ...]  #: Titles of the columns, with units.
    rows: tuple[tuple[str, ...], ...]

    @classmethod
    def of(cls, things: Iterable[Any], columns: Mapping[str, Callable[[Any], str]]) -> Table:
        """A row for each thing; columns by their titles, each written off the thing."""
        return cls(tuple(columns), tuple(tuple(write(thing) for write in columns.values()) for thing in things))


@dataclass(frozen=True)
class Picture:
    """A figure, and where it helps one that answers to the pointer, which stands in its place on screens."""

    name: str
    caption: str
    png: bytes  #: What is printed.
    live: str = ""  #: HTML of the interactive figure; empty where there is none.

    @property
    def source(self) -> str:
        """The image as a data address."""
        return "data:image/png;base64," + base64.b64encode(self.png).decode()


@dataclass(frozen=True)
class Part:
    """A part of a report."""

    name: str  #: Its place on the page.
    title: str
    sentences: tuple[str, ...] = ()
    tables: tuple[Table, ...] = ()
    pictures: tuple[Picture, ...] = ()
    trust: tuple[str, ...] = ()  #: How far to trust it: residuals, counts, uncertainties, warnings.
    listing: tuple[str, ...] = ()  #: Lines as the command prints them, in columns.


def picture(name: str, caption: str, draw: Callable[[], Figure], live: str = "", units: Units | None = None) -> Picture:
    """A picture from a function that draws a figure in the program's style, in units of choice."""
    with style():
        figure = draw()
        if units is not None:
            put_in_units(figure, units)
        written = io.BytesIO()
        figure.savefig(written, format="png", dpi=110)
    return Picture(name, caption, written.getvalue(), live)


def pictures_of(result, captions: dict[str, str], before: str = "") -> tuple[Picture, ...]:
    """Pictures of a result by the names of its figures, in its units; those that it does not have are left out. Words
    before the names tell them from those of another study.
    """
    drawers = result.drawers()
    return tuple(
        picture(f"{before}{name}", caption, drawers[name], units=result.case.units)
        for name, caption in captions.items()
        if name in drawers
    )


def not_there(found: Gathered, part: str, title: str) -> Part:
    """A part that says why there is no result."""
    return Part(part, title, (f"Not examined: {found.why(part)}",))


def first_pictures(found: Gathered) -> tuple[Picture, ...]:
    """Pictures of page one: the valve, and head loss and opening over the flow."""
    state, units, pictures = found.state(found.heads[-1]), found.case.units, []
    if state is not None:
        caption = f"The valve at {units.pressure(state.pressure, 3)}, true to scale."
        pictures.append(picture("valve", caption, lambda: deformed(state), live_valve(state, units), units))
        if state.hydraulics is not None:
            caption = "Head loss and opening over the flow."
            pictures.append(picture("head-loss", caption, lambda: headloss_figure(found), units=units))
    elif found.results:
        model = next(iter(found.results.values())).model
        pictures.append(
            picture("valve", "The valve as the case describes it.", lambda: valve_figure(model), units=units)
        )
    return tuple(pictures)


_STEADY = "Opening and flow over the head"


def steady_part(found: Gathered) -> Part:
    """Opening, flow and losses at every head."""
    result, units = found.get("steady"), found.case.units
    if result is None or not result.states:
        return not_there(found, "steady", _STEADY)
    states = sorted(result.states, key=lambda s: s.pressure)
    names = {name: units.name(name) for name in ("pressure", "head", "flow", "velocity", "size")}
    head = [f"{_pressure_title(found)}, {names['pressure']}", f"flow, {names['flow']}", f"opening, {names['size']}"]
    flowing = any(s.hydraulics is not None for s in states)
    if flowing:
        head += [f"jet, {names['velocity']}", f"head loss, {names['head']}", "K", "Kv, m3/h", "Cv, gpm"]
        head += [f"loss of the pipe, {names['head']}"] if found.case.has_line else []

    def row(s) -> tuple[str, ...]:
        values, h = [("pressure", s.pressure, 4), ("flow", s.volume_flow, 4), ("size", s.lip_opening, 3)], s.hydraulics
        if h is not None:
            values += [("velocity", s.outlet_velocity, 3), ("head", h.head_loss, 3)]
        shown = [f"{value / units.factor(name):.{n}g}" for name, value, n in values]
        if h is None:
            return (*shown, *["-"] * (len(head) - len(shown)))
        loss = (digits(h.line_loss / units.factor("head")),) if found.case.has_line else ()
        return (*shown, *map(digits, (h.loss_coefficient, h.kv, h.cv)), *loss)

    worst = max(s.residual for s in result.states)
    trust = (
        f"Equilibrium of all {len(states)} states: unbalanced forces at most {worst:.1e} of the pressure forces, on "
        f"{found.case.mesh.around} x {found.case.mesh.along} elements.",
        *result.failures,
    )
    pictures = pictures_of(result, _MEASURED)
    sentences = () if result.cracking is None else (result.cracking.sentence(states[-1].pressure),)
    return Part("steady", _STEADY, sentences, (Table(tuple(head), tuple(map(row, states))),), pictures, trust)


#: Figures of a study that are there where something was measured.
_MEASURED = {
    "measured-passage": "The passage left, as measured and as computed.",
    "measured-sections": "Sections of the wall as measured and as computed.",
    "measured-centre-line": "The wall in the middle of the wide side, as measured and as computed.",
}


def _pressure_title(found: Gathered) -> str:
    where = found.case.pressure_at.removeprefix("static ") if found.case.has_line else "at the inlet"
    return f"{'head' if found.case.units.heads else 'pressure'} {where}"


_HEADS = "Vibration over the head"


def heads_part(found: Gathered) -> Part:
    """Verdict at every head, and the damping at which it would change."""
    modes, case, units = found.modes, found.case, found.case.units
    if not modes:
        return not_there(found, "heads", _HEADS)
    head = (
        f"{_pressure_title(found)}, {units.name('pressure')}",
        "verdict",
        "growth rate, 1/s",
        "frequency, Hz",
        "least damping ratio, %",
        "chatter begins at times the damping",
        "modes up to, Hz",
        "counts agree",
    )
    rows = []
    for pressure in found.heads:
        shown = f"{pressure / units.factor('pressure'):.4g}"
        if pressure not in modes:
            rows.append((shown, "not examined", *[""] * 6))
            continue
        v, state = modes[pressure].verdict, found.state(pressure)
        sealed = state is not None and case.valve.is_preset and state.hydraulics is None
        numbers = (v.growth_rate, v.frequency, 100 * v.damping_ratio, v.critical_damping_factor, v.band)
        said = [f"{x:.3g}" if np.isfinite(x) else "-" for x in numbers]
        said[3] = f"none to {v.damping_sought:.3g}" if np.isfinite(v.damping_sought) else said[3]
        rows.append((shown, v.outcome + " (sealed)" * sealed, *said, "yes" if v.certain else "no"))
    missing = [
        f"{units.pressure(found.heads[int(n.split('-')[1]) - 1])}: {why}"
        for n, why in found.missing.items()
        if n.startswith("heads-")
    ]
    first = next(iter(modes.values()))
    classes = ", ".join(f"{name} ({symmetry_named(name).words})" for name in first.certificates)
    factor = "loss factors" if found.case.damping.relaxes else "stiffness damping"
    sentences = (
        f"Modes about the steady state at each head, in all symmetry classes: {classes}.",
        f"The factor is that on the {factor} at which chatter begins, or ends where the valve chatters, in the first "
        "and the last of the classes; where none is found, 'none to' the last one that was looked at; - where that is "
        "not known.",
        *missing,
    )
    caption = (
        "Least damping ratio over the head, crosses where the valve chatters; and the factor on the damping of the "
        "wall below which it would."
    )
    pictures = (picture("vibration", caption, lambda: vibration_figure(found), units=found.case.units),)
    return Part("heads", _HEADS, sentences, (Table(head, tuple(rows)),), pictures, ())


def onset_part(found: Gathered) -> Part | None:
    """Heads at which chatter begins or ends, located."""
    result, title = found.get("onset"), "Heads at which chatter begins or ends"
    if result is None:
        return not_there(found, "onset", title) if "onset" in found.failed else None
    row = found.case.units.parameter("pressure")
    kinds = {"super": "softly (supercritical)", "sub": "hard (subcritical)"}

    def apart(p) -> str:
        unknown = "no such onset there" if lacking(p) else "-"
        return unknown if p["uncertainty"] is None else f"{p['uncertainty'] / row.scale:.2g}"

    columns = {
        f"{_pressure_title(found)}, {row.shown_unit}": lambda p: f"{p['value'] / row.scale:.4g}",
        f"+- (second mesh), {row.shown_unit}": apart,
        "frequency, Hz": lambda p: f"{p['frequency']:.4g}",
        "what changes": lambda p: (
            ("unstable" if p["gains"] else "stable") + " above" + ("" if p["confirmed"] else ", not confirmed")
        ),
        "how": lambda p: kinds.get(p["criticality"], "-"),
    }
    tables = (Table.of(result.points, columns),) if result.points else ()
    return Part("onset", title, (), tables, (), result.failures)


def pipe_part(found: Gathered) -> Part | None:
    """Vibration over the length of the pipe."""
    sweeps, title = found.pipes, "Vibration over the length of the pipe"
    if not sweeps:
        return not_there(found, "pipe", title) if found.case.has_line and "pipe" not in found.not_asked else None
    units = found.case.units
    lengths = list(next(iter(sweeps.values())).values)
    head = (f"{_pressure_title(found)}", *(f"pipe of {length:.3g} m" for length in lengths))
    rows = tuple(
        (units.pressure(p, 3), *(", ".join((v.outcome, *_ratio(v.damping_ratio))) for v in r.verdicts))
        for p, r in sweeps.items()
    )
    caption = "Least damping ratio over the length of the pipe."
    mesh = next(iter(sweeps.values())).case.mesh
    said = (
        "Verdict and least damping ratio, motions that open and close the lips, on "
        f"{mesh.around} x {mesh.along} elements."
    )
    pictures = (picture("pipe", caption, lambda: pipe_figure(found, sweeps), units=units),)
    return Part(
        "pipe", title, (said,), (Table(head, rows),), pictures, tuple(f for r in sweeps.values() for f in r.failures)
    )


def _ratio(value: float) -> tuple[str, ...]:
    """A damping ratio in per cent; nothing where it is not known."""
    return (f"{digits(100 * value, 2)} %",) if np.isfinite(value) else ()


def chance_part(found: Gathered) -> Part | None:
    """Probability of chatter and what decides it, where the case says how uncertain its numbers are."""
    result, title = found.get("chance"), "How likely chatter is, and what decides it"
    if result is None:
        return not_there(found, "chance", title) if "chance" in found.failed else None
    row = found.case.units.parameter(result.parameter)
    percent = lambda value: "-" if value is None else digits(100 * value, 2)  # noqa: E731
    columns = {
        f"{row.title}, {row.shown_unit}".rstrip(", "): lambda p: f"{p['value'] / row.scale:.4g}",
        "chatters, %": lambda p: percent(p["probability"]),
        "95 % interval, %": lambda p: " to ".join(map(percent, p["interval"])),
        **{f"{name}, %": lambda p, name=name: percent(p["outcomes"][name]["probability"]) for name in result.others},
        "undecided": lambda p: f"{p['undecided']} of {p['samples']}",
    }
    captions = {
        "probability": "Probability of chatter with its 95 % interval.",
        "margin": "Least damping ratio of the samples.",
        "tornado": "Least damping ratio with each input low and high.",
    }
    inputs = (f"Input: {one.words()}." for one in result.plan.inputs)
    said = (f"Verdicts on {only_class_of(result.case.part)}.", *result.deciding_lines(), *inputs)
    tables = (Table.of(result.points, columns),)
    return Part("chance", title, said, tables, pictures_of(result, captions), result.failures)


_CYCLES = "What it grows into"


def cycle_part(found: Gathered) -> Part | None:
    """The limit cycle from its onset to this state; nothing where the state is stable."""
    result = found.get("cycle")
    if result is None or not result.points:
        return not_there(found, "cycle", _CYCLES) if "cycle" in found.failed else None
    units, here = found.case.units, Mu.of(found.case)[result.parameter]
    row, size, unit = units.parameter(result.parameter), units.factor("size"), units.name("size")
    columns = {
        f"{row.title}, {row.shown_unit}".rstrip(", "): lambda p: f"{p.value / row.scale:.4g}",
        f"amplitude of a lip, {unit}": lambda p: f"{p.amplitude / size:.3g}",
        "frequency, Hz": lambda p: f"{p.frequency:.4g}",
        f"lip from .. to, {unit}": lambda p: f"{p.lip_least / size:.3g} to {p.lip_largest / size:.3g}",
        "stable": lambda p: {True: "yes", False: "no", None: "not asked"}[p.stable],
    }
    point = result.nearest(here)
    if abs(point.value - here) > 1e-6 * abs(here):
        said = f"The limit cycle was followed to {row.text(point.value)} and not to {row.text(here)}: {result.reason}."
    else:
        kind = {True: "A stable", False: "An unstable", None: "A"}[point.stable]
        swing = units.text_of("size", point.amplitude, 3)
        said = f"{kind} limit cycle of {swing} of each lip, half its swing, at {point.frequency:.4g} Hz."
    pictures = pictures_of(result, {"branch": "Amplitude and frequency of the cycle; dashed where it is unstable."})
    return Part(
        "cycle", _CYCLES, (said, result.remarks()[-1]), (Table.of(result.points, columns),), pictures, result.failures
    )


_CLOSURE = "Closing and sealing under back pressure"


def closure_part(found: Gathered) -> Part:
    """States under back pressure."""
    result, units = found.get("closure"), found.case.units
    if result is None or not result.states:
        return not_there(found, "closure", _CLOSURE)
    scale, size, unit = units.factor("pressure"), units.factor("size"), units.name("size")
    columns = {
        f"back pressure, {units.name('pressure')}": lambda s: (
            f"{s.pressure / scale:.4g}{' (beyond the limit)' if s.beyond_limit else ''}"
        ),
        "shut": lambda s: "held" if result.case.closure.supports == HELD_LIPS else "yes" if s.closed else "no",
        f"sealed length, {unit}": lambda s: f"{s.sealed_length / size:.3g}",
        "leak, L/h": lambda s: digits(s.leak * 3.6e6),
        "contact force, N": lambda s: digits(s.contact_force),
        f"largest displacement, {unit}": lambda s: f"{s.max_displacement / size:.3g}",
    }
    table = Table.of(sorted(result.states, key=lambda s: s.pressure), columns)
    caption = "Sealed length, largest displacement and stiffness of the wall over the back pressure."
    curve = picture("closure", caption, lambda: closure_figure(result), units=units)
    rated = found.case.closure.rated_pressure is not None  # a factor of safety is one over the rated pressure
    left = ("Forces balance",) if rated else ("Forces balance", "Safety factor")
    sentences = tuple(line for line in result.remarks() if not line.startswith(left))
    trust = (*result.failures, *(line for line in result.remarks() if line.startswith("Forces")))
    return Part("closure", _CLOSURE, sentences, (table,), (curve, *pictures_of(result, _MEASURED, "closure-")), trust)


def valve_part(found: Gathered) -> Part | None:
    """Measures and layers of the valve, and how its materials damp."""
    if not found.results:
        return None
    result = next(iter(found.results.values()))
    mesh, case = result.mesh, found.case
    damping = _damping_table(found)
    levels = case.materials.levels({layer.material for layer in case.layers})
    told = listed(f"{name} {100 * level:.3g} %" for name, level in levels.items())
    units = case.units
    size, wall = units.text_of("size", float(np.ptp(mesh.z)), 4), _range(mesh.thickness / units.factor("size"))
    sentences = [f"{size} long; the wall is {wall} {units.name('size')} thick, layers from inside to outside."]
    sentences += [found.levels or f"Strain levels of the rubbers: {told}."] if levels else []
    tables = (_layers(result, units), *damping)
    caption = "As the case describes it: faces, measures, wall and layers."
    return Part(
        "layers",
        "The valve",
        tuple(sentences),
        tables,
        (picture("described", caption, lambda: valve_figure(result.model), units=found.case.units),),
    )


def _damping_table(found: Gathered) -> tuple[Table, ...]:
    """Loss factors of the materials at 2, 10 and 50 Hz, and the ranges of the shipped ones."""
    try:
        report = describe_damping(found.case)
    except CaseError:
        return ()
    at = np.array([2.0, 10.0, 50.0])
    if not found.case.damping.relaxes:
        shown = (
            f"{found.case.damping.alpha:g}",
            f"{found.case.damping.beta:g}",
            *(f"{x:.3g}" for x in report.rayleigh(at)),
        )
        return (
            Table(("mass damping, 1/s", "stiffness damping, s", *(f"damping ratio at {f:g} Hz" for f in at)), (shown,)),
        )
    rows = tuple((m.name, *(f"{x:.3g}" for x in report.series(m).loss_factor(at)), m.source) for m in report.materials)
    spread = loss_range(found.case)
    words = "source" if spread is None else f"source; shipped ones range from {spread[0]:.2g} to {spread[1]:.2g} times"
    return (Table(("material", *(f"loss factor at {f:g} Hz" for f in at), words), rows),)


def _range(values: np.ndarray) -> str:
    low, high = values.min(), values.max()
    return f"{low:.4g}" if high - low < 1e-6 * high else f"{low:.4g} to {high:.4g}"


def _layers(result: StudyResult, units: Units) -> Table:
    """Thickness of each layer over the elements where it is."""
    mesh, case = result.mesh, result.case
    limited = any(layer.is_limited for layer in case.layers)
    shares = np.atleast_2d(result.model.shell.at_rest.fractions if limited else mesh.layer_fractions)
    walls = mesh.thickness[:, None] * shares / units.factor("size")
    rows = []
    for i, (name, layer) in enumerate(zip(mesh.layer_names, case.layers)):
        there, words = walls[walls[:, i] > 0, i], _where(layer.enlarged(case.valve.scale), units)
        rows.append((str(i + 1), name + words, _range(there) if there.size else "-", f"{mesh.layer_angles[i]:g}"))
    return Table(
        ("layer", "material", f"thickness, {units.name('size')}", "angle from the valve's axis, degrees"), tuple(rows)
    )


def _where(layer: Layer, units: Units) -> str:
    """Words on where a layer of limited extent is; empty of one that is everywhere."""
    words, size = [], units.factor("size")
    if layer.axial_edges:
        end = "the inlet" if layer.end is None else units.text_of("size", layer.end)
        words.append(f"z = {(layer.begin or 0.0) / size:.4g} to {end}")
    if layer.section_edges:
        end = 1.0 if layer.around_to is None else layer.around_to
        words.append(f"{layer.around_from or 0.0:g} to {end:g} of the section")
    return f" ({', '.join(words)})" if words else ""


def warnings_part(found: Gathered) -> Part | None:
    """Every warning once, with its effect and the key that mends it."""
    own = [w for name, result in found.results.items() if is_on_own_mesh(name) for w in result.warnings]
    said = {without_numbers(w): w for w in reversed(own)}
    if not said:
        return None
    rows = tuple((found.case.units.say(w), *explained(w)) for w in reversed(said.values()))
    return Part("warnings", "Warnings", (), (Table(("warning", "effect", "key that mends it"), rows),))


def law_part(found: Gathered) -> Part | None:
    """Appendix on the other flow model at the head nearest to chatter."""
    result = found.get("law")
    if result is None:
        return None if "law" in found.not_asked or "law" not in found.missing else not_there(found, "law", _LAW)
    own = found.modes[found.worst].verdict
    rows = tuple(
        (
            name,
            v.outcome,
            *(f"{x:.3g}" if np.isfinite(x) else "-" for x in (v.growth_rate, v.frequency, 100 * v.damping_ratio)),
        )
        for name, v in ((found.case.fluid.continuity, own), (result.case.fluid.continuity, result.verdict))
    )
    head = ("flow model", "verdict", "growth rate, 1/s", "frequency, Hz", "least damping ratio, %")
    at = found.case.units.pressure(found.worst, 3)
    said = (
        f"At {at}. Storage conserves volume where the walls move and agrees with the water tunnel; quasi-steady is the "
        "thesis's. The answers of page one are those of the case, the first row, in all symmetry classes; the other "
        "model differs in motions that open and close the lips alone."
    )
    return Part("law", _LAW, (said,), (Table(head, rows),))


_LAW = "Appendix: the other flow model"


_STRAINS = "Strains and stresses in the layers"


def strains_part(found: Gathered) -> Part | None:
    """Largest strains of each layer at the highest pressure computed."""
    result = found.get("steady")
    if result is None or not result.states:
        return None
    state = max(result.states, key=lambda s: s.pressure)
    rows = []
    for i, name in enumerate(state.layers.names):
        law = law_from_case(found.case, found.case.layers[i].material)
        stretch, stress = state.layers.stretch[:, i], state.layers.von_mises[:, i]
        span = f"{stretch[:, 0].min():.3f} to {stretch[:, 1].max():.3f}"
        rows.append((str(i + 1), name, span, f"{stress.max() / 1e6:.3g}", _strain_range(stable_range(law))))
    at = found.case.units.pressure(state.pressure, 3)
    head = ("layer", "material", "stretch in its plane", "von Mises stress, MPa", "stable stretch, uniaxial")
    said = f"At {at}; the last column says between which stretches the constants describe a stable material."
    pictures = (
        picture(
            "layer-stress",
            f"Von Mises stress of the layers at {at}.",
            lambda: layer_stress(state),
            units=found.case.units,
        ),
    )
    return Part("strains", _STRAINS, (said,), (Table(head, tuple(rows)),), pictures)


def _strain_range(limits: StableRange) -> str:
    low, high = limits.uniaxial
    if low == 0.0 and not np.isfinite(high):
        return "all"
    return f"{low:.3f} to {high:.3f}" if np.isfinite(high) else f"from {low:.3f}"


#: Functions from `Gathered` to a `Part`, or to None where there is nothing to say.
MAKERS = (
    steady_part,
    heads_part,
    onset_part,
    pipe_part,
    chance_part,
    cycle_part,
    closure_part,
    strains_part,
    valve_part,
    warnings_part,
    law_part,
)
