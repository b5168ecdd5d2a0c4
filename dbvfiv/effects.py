"""Effects of warnings: how much each may move the numbers, and the key of the case that mends it."""

from __future__ import annotations

import re

#: Words of a warning -> its effect on flow or verdict, and the key that mends it, "-" where none does. Numbers are from
#: docs/limits.md.
EFFECTS = {
    "exceeds the radius of the mid-surface": ("7 to 11 % in flow between the two shell metrics", "valve.lip_radius"),
    "too few for a row on every step": ("unknown", "mesh.along"),
    "too few for a column on every edge": ("unknown", "mesh.around"),
    "inner face starts beyond the closing plane": ("unknown", "valve.lip_radius"),
    "outside damping.band": ("3 to 8 % less damping just outside, half of it far outside", "damping.band"),
    "constants are unstable": (
        "no verdict on vibration there with loss factors; with Rayleigh damping one on the fit, not on the rubber",
        "materials.constants",
    ),
    "damping.loss_factor must be lower": ("no verdict on vibration there", "-"),
    "settled at the largest pressures": ("10 to 16 % in flow between 10 and 20 %", "materials.strain_level"),
    "growth rates do not order the modes": ("none below that frequency", "modes.max_frequency"),
    "the count finds more": ("no verdict on vibration above that frequency", "-"),
    "Verdicts hold for modes up to": ("none below that frequency", "-"),
    "resolve waves up to": ("none below that frequency", "-"),
    "loss factors creep": ("none on chatter", "-"),
    "unstable eigenvalues": ("no verdict on vibration there", "-"),
    "Gravity has no part": ("unknown", "gravity.direction"),
    "lie beyond it": ("no answer beyond that back pressure", "closure.rated_pressure"),
    "half the diameter is its radius": ("unknown", "valve.flange_radius"),
    "cracking pressure was not found": ("none on the states that were found", "-"),
    "more than any that is sold": ("unknown", "valve.scale"),
    "it is half the width of the bill": ("unknown", "valve.lip_half_width"),
    "before a valve of": ("unknown", "upstream.diameter"),
    "says in which pipe the valve stands": ("frequencies less than half as high", "outside.pipe_diameter"),
    "scaled until they fill the wall": ("none where their shares are meant", "-"),
    "the thicknesses of valve.wall_map": ("unknown", "valve.wall"),
    "radians are given as": ("unknown", "-"),
    "and its jet of": ("a density that changes by half the Mach number squared", "fluid.sound_speed"),
    "a gas, of which": ("unknown", "drive.pressure"),
    "held shut by its supports": ("no answer on sealing", "closure.supports"),
    "of its power below": ("root mean squares without that share", "response.count"),
    "of its power above": ("root mean squares without that share", "response.max_frequency"),
    "turns round beside the onset": ("no cycles between the onset and the fold", "-"),
    "is above transient.local_error": ("unknown", "transient.smallest_step"),
    "A state of a run does not hold": ("another motion from the first instant on", "-"),
    "case file that was asked for is left out": ("none on the result", "-"),
    "asks for all symmetry classes": ("none within the class of the model", "closure.symmetry"),
}


def without_numbers(warning: str) -> str:
    """A warning that is the same at another head."""
    return re.sub(r"[\d.]+", "#", warning)


def explained(warning: str) -> tuple[str, str]:
    """Effect of a warning, in per cent where that is known, and the key that mends it; "unknown" and "-" without."""
    return next((row for words, row in EFFECTS.items() if words in warning), ("unknown", "-"))


def with_effect(warning: str) -> str:
    """A warning with its effect and the key that mends it behind it."""
    effect, key = explained(warning)
    return f"{warning} Effect: {effect}" + (f"; key: {key}." if key != "-" else ".")
