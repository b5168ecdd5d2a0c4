"""Part of the report on vibration: stability, onset and unstable regions of the valve."""

from __future__ import annotations

from ...case.parameters import PARAMETERS
from ...model.symmetry import symmetry_named
from ...studies.map.result import LAWS
from .. import live
from ..content import Part, Table, pictures_of
from ..gather import Gathered
from .missing import not_there, said_by


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
