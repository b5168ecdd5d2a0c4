"""Effects of warnings: how much each may move the numbers, and the key of the case that mends it."""

from __future__ import annotations

#: Words of a warning -> its effect on flow or verdict, and the key that mends it. Numbers are those of docs/limits.md.
_EFFECTS = (
    ("exceeds the radius of the mid-surface", "7 to 11 % in flow between the two shell metrics", "valve.lip_radius"),
    ("too few for a row on every step", "unknown", "mesh.along"),
    ("too few for a column on every edge", "unknown", "mesh.around"),
    ("inner face starts beyond the closing plane", "unknown", "valve.lip_radius"),
    ("lie outside damping.band", "3 to 8 % less damping just outside, half of it far outside", "damping.band"),
    ("lies outside damping.band", "3 to 8 % less damping just outside, half of it far outside", "damping.band"),
    ("constants", "no verdict on vibration there", "materials.strain_level"),
    ("strain level", "10 to 16 % in flow between 10 and 20 %", "materials.strain_level"),
    ("tested levels", "10 to 16 % in flow between 10 and 20 %", "materials.strain_level"),
    ("Verdicts hold for modes up to", "none below that frequency", "modes.max_frequency"),
    ("Gravity has no part", "unknown", "gravity.direction"),
    ("buckles", "no answer beyond that back pressure", "closure.rated_pressure"),
    ("No equilibrium was found", "no answer beyond that pressure", "steady.min_step"),
    ("unstable eigenvalues", "no verdict on vibration there", "modes.max_frequency"),
)


def explained(warning: str) -> tuple[str, str]:
    """Effect of a warning, in per cent where that is known, and the key that mends it; "unknown" and "-" without."""
    return next(((effect, key) for words, effect, key in _EFFECTS if words in warning), ("unknown", "-"))


def with_effect(warning: str) -> str:
    """A warning with its effect and the key that mends it behind it."""
    effect, key = explained(warning)
    return f"{warning} Effect: {effect}" + (f"; key: {key}." if key != "-" else ".")
