"""The parts of a report, in the order they are read; each makes a `Part` from what was gathered, or nothing."""

from __future__ import annotations

import numpy as np

from ..case.parameters import PARAMETERS, Mu
from ..drawing.materials import damping_figure
from ..drawing.views import deformed, layer_stress, valve_figure
from ..errors import CaseError
from ..fit.cards import law_from_case
from ..fit.damping import describe_damping
from ..materials.stability import StableRange, stable_range
from ..model.symmetry import symmetry_named
from ..record.mesh import MeshData
from ..record.states import shown_summary
from ..studies.closure.safety import rated_sentence
from ..studies.map.study import LAWS
from . import live
from .content import Part, Table, picture, pictures_of
from .gather import Gathered


def not_there(found: Gathered, kind: str, title: str) -> Part:
    """A part that says why there is no result."""
    return Part(kind, title, (f"There is no result. {found.missing.get(kind, '')}".strip(),))


def said_by(result) -> tuple[str, ...]:
    """Warnings and failures of a result."""
    return (*(f"Warning: {w}" for w in result.warnings), *result.failures)


def valve_part(found: Gathered) -> Part:
    """Measures, layers, and the valve in space at its driving pressure."""
    state = None if found.steady is None or not found.steady.states else _chosen(found)
    mesh = next(iter(found.results.values())).mesh if found.results else None
    sentences, tables = [], []
    if mesh is not None:
        width, height = (1e3 * mesh.extent(0, axis) for axis in (0, 1))
        inlet = 2e3 * np.hypot(mesh.nodes[mesh.rows[-1], 0], mesh.nodes[mesh.rows[-1], 1]).max()
        sentences = [
            f"{1e3 * np.ptp(mesh.z):.0f} mm long; at the lip {width:.0f} mm wide and {height:.1f} mm high over the "
            f"middle of the wall, at the flange {inlet:.0f} mm across.",
            f"The wall is {_range(mesh.thickness * 1e3)} mm thick, of {len(mesh.layer_names)} layers, inside to "
            "outside:",
        ]
        tables = [_layers(found, mesh)]
    pictures = []
    if state is not None:
        caption = f"The valve at {state.pressure / 1e3:.4g} kPa, true to scale; on a screen it can be turned."
        pictures = [picture("deformed", caption, lambda: deformed(state), live.valve(state))]
    if found.results:
        model = next(iter(found.results.values())).model
        told = "As the case describes it: faces, measures, wall and layers."
        pictures.insert(0, picture("described", told, lambda: valve_figure(model)))
    return Part("valve", "The valve", tuple(sentences), tuple(tables), tuple(pictures))


def _chosen(found: Gathered):
    return found.steady.nearest(found.case.drive.pressure)


def _range(values: np.ndarray) -> str:
    low, high = values.min(), values.max()
    return f"{low:.4g}" if high - low < 1e-6 * high else f"{low:.4g} to {high:.4g}"


def _layers(found: Gathered, mesh: MeshData) -> Table:
    rows = []
    for i, name in enumerate(mesh.layer_names):
        share = mesh.layer_fractions[i]
        angle = mesh.layer_angles[i]
        rows.append((str(i + 1), name, _range(mesh.thickness * share * 1e3), f"{angle:g}"))
    return Table(("layer", "material", "thickness, mm", "angle from the valve's axis, degrees"), tuple(rows))


_HYDRAULICS = "Opening and flow"
_HYDRAULIC_CAPTIONS = {
    "head-discharge": "Pressure over flow; points on a screen answer to the pointer.",
    "area-pressure": "Area at the lip over the pressure, with what was measured.",
    "operating-point": "Where valve, line and pump meet.",
    "passage": "Area, velocity and pressure along the passage.",
    "lip-shapes": "Inner and outer face of the lip.",
    "centre-line": "The wall in the middle of the wide side.",
    "measured-sections": "Sections of the wall as measured and as computed.",
    "measured-centre-line": "The wall in the middle of the wide side, as measured and as computed.",
}


def hydraulics_part(found: Gathered) -> Part:
    """Hydraulics at the driving pressure, and over all pressures."""
    result = found.steady
    if result is None or not result.states:
        return not_there(found, "steady", _HYDRAULICS)
    state = result.nearest(found.case.drive.pressure)
    columns = shown_summary(found.case)
    shown = [c for c in columns if c.shown is not None and c.name not in ("iterations", "residual")]
    head = tuple(", ".join(p for p in (c.shown.title, c.shown.unit) if p) for c in shown)
    states = sorted(result.states, key=lambda s: s.pressure)
    table = Table(head, tuple(tuple(c.shown.write(s) for c in shown) for s in states))
    worst = max(s.residual for s in result.states)
    trust = (
        f"Equilibrium of all {len(states)} states: unbalanced forces at most {worst:.1e} of the pressure forces, on "
        f"{found.case.mesh.around} x {found.case.mesh.along} elements.",
        *said_by(result),
    )
    pictures = pictures_of(result, _HYDRAULIC_CAPTIONS, {"head-discharge": live.discharge(result, state)})
    return Part("steady", _HYDRAULICS, opening(found), (table,), pictures, trust, tuple(result.remarks()))


def opening(found: Gathered) -> tuple[str, ...]:
    """Sentence on the flow and the opening at the driving pressure."""
    result = found.steady
    if result is None or not result.states:
        return ()
    state = result.nearest(found.case.drive.pressure)
    return (
        f"At {state.pressure / 1e3:.4g} kPa ({state.head:.3g} m of the fluid) {state.volume_flow * 1e3:.4g} L/s flow "
        f"({state.mass_flow:.4g} kg/s), through lips that stand {state.lip_opening * 1e3:.3g} mm open.",
    )


def modes(found: Gathered) -> Part:
    """Modes at the driving pressure, and what both laws of continuity say."""
    result, title = found.modes, "Vibration at this pressure"
    if result is not None and not result.verdict.holds:
        return Part("modes", title, stability(found), (), (), said_by(result))
    if result is None or result.certificate is None:
        return not_there(found, "modes", title)
    pictures = pictures_of(result, {"eigenvalues": _EIGENVALUES, "mode-shapes": "Shapes of the leading modes."})
    return Part("modes", title, stability(found), (_modes(result),), pictures, _certified(result))


def classes(found: Gathered) -> Part:
    """Part on modes of all symmetry classes, including those not symmetric about both planes."""
    result, title = found.classes, "Motions of all classes"
    if result is not None and not result.verdict.holds:
        return Part("classes", title, (result.sentence,), (), (), said_by(result))
    if result is None or result.certificate is None:
        return not_there(found, "classes", title)
    words = ", ".join(f"{name}: {symmetry_named(name).words}" for name in result.certificates)
    return Part("classes", title, (result.sentence, f"{words}."), (_modes(result),), (), _certified(result))


def _modes(result) -> Table:
    head = ("mode", "growth rate, 1/s", "frequency, Hz", "damping ratio", "class of motion")
    rows = (
        (f"{m.number}", f"{m.growth_rate:.4g}", f"{m.frequency:.4g}", f"{m.damping_ratio:.4g}", m.symmetry)
        for m in result.modes
    )
    return Table(head, tuple(rows))


def _certified(result) -> tuple[str, ...]:
    residual = max((m.residual for m in result.modes), default=0.0)
    found, counted = result.certificate.unstable_count, result.certificate.unstable_count_independent
    return (
        f"Residuals of the full pencil at most {residual:.1e}; unstable modes found {found}, counted independently "
        f"{_shown(counted)}.",
        *result.notes,
        *said_by(result),
    )


_EIGENVALUES = "Growth rate and frequency of the modes; those on the shaded side grow."
_LAW = "<p>Under {} continuity:</p>"


def stability(found: Gathered) -> tuple[str, ...]:
    """The verdict, under both laws."""
    result = found.modes
    if result is None:
        return ()
    other = result.other_law
    return (result.sentence,) if other is None else (result.sentence, other.sentence, result.comparison)


def onset(found: Gathered) -> Part:
    """Part on the loss of stability along the parameter of the case."""
    result, title = found.onset, "Where it begins"
    if result is None:
        return not_there(found, "onset", title)
    row = PARAMETERS[result.parameter]
    head = (f"{row.title}, {row.shown_unit}".rstrip(", "), "+-", "frequency, Hz", "what changes", "how", "law")
    points = [(point, found.case.fluid.continuity) for point in result.points]
    if result.other_law is not None:
        points += [(point, result.other_law["continuity"]) for point in result.other_law["points"]]
    table = Table(head, tuple(_onset(point, row.scale, law) for point, law in points))
    sentences = tuple(line for line in (*onsets(found), result.comparison) if line)
    pictures = pictures_of(result, {"onset": "Growth rate of the leading modes over the range, with the onsets."})
    trust = (
        f"{int(result.certified.sum())} of {len(result.values)} values of the scan carry two counts that agree; the "
        "uncertainty is that of the mesh, from a second one of half the elements each way.",
        *said_by(result),
    )
    return Part("onset", title, sentences, (table,) if points else (), pictures, trust)


def onsets(found: Gathered) -> tuple[str, ...]:
    """The onsets of the case's law, in a sentence."""
    result = found.onset
    if result is None:
        return ()
    row, law = PARAMETERS[result.parameter], found.case.fluid.continuity
    if not result.points:
        return (result.lines()[1] if len(result.lines()) > 1 else "",)
    words = [
        f"{p['value'] / row.scale:.4g} {row.shown_unit} ({_above(p)}, {p['frequency']:.3g} Hz)"
        for p in result.points
        if p["edge"]
    ]
    return (f"Under {law} continuity stability changes at {row.title.lower()} {', '.join(words)}.",)


def _onset(point, scale: float, law: str) -> tuple[str, ...]:
    spread = "" if point["uncertainty"] is None else f"{point['uncertainty'] / scale:.2g}"
    kind = {"super": "softly (supercritical)", "sub": "hard (subcritical)"}.get(point["criticality"], "")
    return (f"{point['value'] / scale:.5g}", spread, f"{point['frequency']:.4g}", _above(point), kind, law)


def map(found: Gathered) -> Part:
    """The plane of two parameters with this installation in it."""
    result, title = found.map, "Stability map"
    if result is None or not any(not column.failure for column in result.columns):
        return not_there(found, "map", title)
    here = _here(found)
    lives = (
        _LAW.format(LAWS.get(blend, blend)) + live.stability_map(result, law, here)
        for law, blend in enumerate(result.plan.laws)
    )
    star = "; on a screen the star is this installation, and every cell answers to the pointer" if here else ""
    caption = f"Growth rate of the leading mode over {result.plan.x.parameter} and {result.plan.y.parameter}{star}."
    pictures = pictures_of(result, {"stability-map": caption}, {"stability-map": "".join(lives)})
    trust = tuple(line for line in result.lines()[1:]) + said_by(result)
    return Part("map", title, (result.lines()[0],), (), pictures, trust)


def _above(point) -> str:
    return ("unstable" if point["gains"] else "stable") + " above"


def _here(found: Gathered) -> tuple[float, float] | None:
    """Place of the installation on the map, in the units shown; None where the map moves something else."""
    values = {"pressure": found.case.drive.pressure, "density": found.case.fluid.density}
    axes = [axis.parameter for axis in (found.map.plan.x, found.map.plan.y)]
    if not set(axes) <= set(values):
        return None
    return tuple(values[name] / PARAMETERS[name].scale for name in axes)


def _shown(count) -> str:
    return "?" if count is None else str(count)


def damping_part(found: Gathered) -> Part | None:
    """Part on the damping of the case, on which every verdict on vibration rests."""
    try:
        report = describe_damping(found.case)
    except CaseError as error:
        return Part("damping", "Damping", (str(error),))
    frequencies = [m.frequency for m in found.modes.modes if m.frequency > 0] if found.modes else []
    lines = tuple(report.lines(None))
    caption = "Damping ratio of the wall over frequency."
    if frequencies:
        caption += f" The modes above lie between {min(frequencies):.3g} and {max(frequencies):.3g} Hz."
    return Part(
        "damping", "Damping", pictures=(picture("damping", caption, lambda: damping_figure(report)),), listing=lines
    )


_CYCLES = "What it grows into"
_CYCLE_CAPTIONS = {
    "branch": "Amplitude and frequency of the cycle; dashed where it is unstable.",
    "envelope": "Between which displacements the lip moves.",
    "centre-line-cycle": "The middle of the wide side over a cycle.",
}


def cycle_part(found: Gathered) -> Part | None:
    """The limit cycle from its onset to this state; nothing where the state is stable."""
    result = found.cycle
    if result is None or not result.points:
        why = found.missing.get("cycle", "The branch ended before its first cycle was found.")
        return None if "cycle" in found.not_asked else Part("cycle", _CYCLES, (f"There is no result. {why}",))
    row = PARAMETERS[result.parameter]
    rows = tuple(
        (
            f"{p.value / row.scale:.5g}",
            f"{1e3 * p.amplitude:.4g}",
            f"{p.frequency:.5g}",
            f"{1e3 * p.lip_least:.3g} to {1e3 * p.lip_largest:.3g}",
            {True: "yes", False: "no", None: "not asked"}[p.stable],
        )
        for p in result.points
    )
    head = (
        f"{row.title}, {row.shown_unit}".rstrip(", "),
        "amplitude of a lip, mm",
        "frequency, Hz",
        "lip from .. to, mm",
        "stable",
    )
    trust = (*result.remarks(), *said_by(result))
    return Part("cycle", _CYCLES, cycles(found), (Table(head, rows),), pictures_of(result, _CYCLE_CAPTIONS), trust)


def cycles(found: Gathered) -> tuple[str, ...]:
    """The cycle at this state, in a sentence."""
    result = found.cycle
    if result is None or not result.points:
        return ()
    row, here = PARAMETERS[result.parameter], Mu.of(found.case)[result.parameter]
    point = result.nearest(here)
    if abs(point.value - here) > 1e-6 * abs(here):
        return (
            f"Its limit cycle was followed to {row.text(point.value)} and not to {row.text(here)}: {result.reason}.",
        )
    kind = {True: "A stable", False: "An unstable", None: "A"}[point.stable]
    size = f"{1e3 * point.amplitude:.3g} mm of each lip, half its swing"
    return (f"{kind} limit cycle of {size}, at {point.frequency:.4g} Hz.",)


_CLOSURE = "Shutting under back pressure"
_CLOSURE_CAPTIONS = {
    "closure-curve": "How the passage shuts as the back pressure rises.",
    "side-views": "The shut valve from the side.",
    "contact-map": "Where the faces meet.",
    "measured-passage": "The passage left, as measured and as computed.",
    "measured-sections": "Sections of the wall as measured and as computed.",
    "measured-centre-line": "The wall in the middle of the wide side, as measured and as computed.",
    "buckling-shape": "The shape into which the wall buckles.",
}


def closure_part(found: Gathered) -> Part:
    """States under back pressure."""
    result = found.closure
    if result is None or not result.states:
        return not_there(found, "closure", _CLOSURE)
    rows = tuple(
        (
            f"{s.pressure / 1e3:.4g}",
            "yes" if s.closed else "no",
            f"{s.sealed_length * 1e3:.4g}",
            f"{s.contact_force:.4g}",
            f"{s.max_displacement * 1e3:.4g}",
        )
        for s in result.states
    )
    head = ("back pressure, kPa", "shut", "sealed length, mm", "contact force, N", "largest displacement, mm")
    return Part(
        "closure",
        _CLOSURE,
        shutting(found),
        (Table(head, rows),),
        pictures_of(result, _CLOSURE_CAPTIONS),
        (*result.remarks(), *said_by(result)),
    )


def shutting(found: Gathered) -> tuple[str, ...]:
    """Sentence on closure: whether the valve shuts under the largest back pressure computed."""
    result = found.closure
    if result is None or not result.states:
        return ()
    last = max(result.states, key=lambda s: s.pressure)
    how = "shuts" if last.closed else "does not shut"
    sentence = (
        f"Under {last.pressure / 1e3:.4g} kPa of back pressure it {how}, sealed over {last.sealed_length * 1e3:.3g} mm."
    )
    safety = () if result.safety is None else (result.safety.sentence,)
    return tuple(s for s in (rated_sentence(result), sentence, *safety) if s)


_STRAINS = "Strains and stresses in the layers"


def strains_part(found: Gathered) -> Part | None:
    """Largest strains of each layer at the driving pressure and at the highest one computed."""
    result = found.steady
    if result is None or not result.states:
        return None
    state = result.nearest(found.case.drive.pressure)
    highest = max(result.states, key=lambda s: s.pressure)
    levels = found.case.materials.levels({layer.material for layer in found.case.layers})
    rows = []
    for i, name in enumerate(state.layers.names):
        law = law_from_case(found.case, found.case.layers[i].material)
        rows.append((str(i + 1), name, *_of(state, i), *_of(highest, i), _strain_range(stable_range(law))))
    at, top = (f"{s.pressure / 1e3:.4g} kPa" for s in (state, highest))
    head = (
        "layer",
        "material",
        f"stretch at {at}",
        "stress, MPa",
        f"stretch at {top}",
        "stress, MPa",
        "stable stretch, uniaxial",
    )
    told = ", ".join(f"{name} {100 * level:.3g} %" for name, level in levels.items())
    at_levels = f"Rubber constants of the strain levels {told}. " if levels else ""
    sentences = (
        f"{at_levels}Stretches are the smallest and the largest in the plane of a "
        "layer; stresses are von Mises values of the Cauchy stress, the largest in any element. The last column says "
        "between which stretches the constants describe a stable material in tension and compression along one "
        "direction.",
    )
    caption = f"Von Mises stress of the layers at {at}, the wall unrolled."
    return Part(
        "strains",
        _STRAINS,
        sentences,
        (Table(head, tuple(rows)),),
        (picture("layer-stress", caption, lambda: layer_stress(state)),),
    )


def _of(state, layer: int) -> tuple[str, str]:
    stretch, stress = state.layers.stretch[:, layer], state.layers.von_mises[:, layer]
    return f"{stretch[:, 0].min():.3f} to {stretch[:, 1].max():.3f}", f"{stress.max() / 1e6:.3g}"


def _strain_range(limits: StableRange) -> str:
    low, high = limits.uniaxial
    if low == 0.0 and not np.isfinite(high):
        return "all"
    return f"{low:.3f} to {high:.3f}" if np.isfinite(high) else f"from {low:.3f}"


#: Functions from `Gathered` to a `Part`, or to None where there is nothing to say.
PARTS = (
    valve_part,
    hydraulics_part,
    modes,
    classes,
    damping_part,
    onset,
    map,
    cycle_part,
    closure_part,
    strains_part,
)
