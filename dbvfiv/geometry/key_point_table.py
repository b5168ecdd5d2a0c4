"""The parametric shape of a valve written as key points, to be edited."""

from __future__ import annotations

import numpy as np

from ..case.part import HALF, QUARTER
from ..case.valve import Valve
from ..errors import CaseError
from .sections import Profile
from .surface import Surface, surface_of


def key_point_table(valve: Valve, points: int = 17, extra: int = 0) -> str:
    """Table of key points that gives a valve's shape back.

    Parameters
    ----------
    valve : Valve
        Of a parametric shape; sizes are written as its case gives them, before `scale`.
    points : int
        Points between two joints of a profile, both included.
    extra : int
        Further profiles at even distances inside the saddle.

    Returns
    -------
    str
        As `dbvfiv.case.key_points.read_key_points` takes it. With a smooth saddle `valve.key_point_skin` must be
        "smooth" too.

    Raises
    ------
    CaseError
        If the valve has key points already, or a smooth saddle meets a flare without a cuff between.
    """
    valve = valve.as_given
    if valve.key_points is not None:
        raise CaseError(f"valve.key_points is {valve.key_points.name}, so the shape is one of key points already.")
    smooth = valve.saddle == "smooth"
    if smooth and valve.flare_length > 0 and (valve.cuff_length == 0 or valve.cuff_radius != valve.flange_radius):
        raise CaseError(
            "valve.saddle is 'smooth' with a flare, whose blend key points do not have; take a ruled saddle.",
            "valve.saddle",
        )
    surface = surface_of(valve, QUARTER if valve.is_double_symmetric else HALF)
    begin = surface.part.begin
    lines = [
        f"# Key points of a duckbill valve, {valve.length * 1e3:g} mm long; profiles from lip to flange.",
        "# joint: 1 where the curvature jumps; between joints a profile is a smooth curve through its points.",
        "profile, x [mm], y [mm], z [mm], joint",
    ]
    for number, (profile, joints) in enumerate(_profiles(surface, valve, extra), 1):
        ends = [begin, *joints, 1.0]
        each = points if joints else 2 * surface.part.quarters * (points - 1) + 1
        shares = [np.linspace(a, b, each) for a, b in zip(ends[:-1], ends[1:])]
        for i, share in enumerate(shares):
            first = 1 if i else 0
            for place in range(first, each):
                x, y = profile.points(share[place : place + 1])[0] * 1e3
                if share[place] in (begin, 1.0):  # on a plane of symmetry, to the last digit
                    x, y = (0.0, y) if share[place] == 0.0 else (x, 0.0)
                joint = int(place == each - 1 and i < len(shares) - 1)
                lines.append(f"{number}, {x:.15g}, {y:.15g}, {profile.z * 1e3:.15g}, {joint}")
    return "\n".join(lines) + "\n"


def _profiles(surface: Surface, valve: Valve, extra: int):
    """Profiles to write, each with its joints."""
    lip = surface.profiles[0]
    begin, end = valve.duckbill_length, valve.duckbill_length + valve.saddle_length
    between = np.linspace(begin, end, extra + 2)[1:-1]
    inside = [(Profile(z, lambda s, z=z: surface.section(z, s)[:, :2]), lip.joints) for z in between]
    own = [(profile, profile.joints) for profile in surface.profiles]
    return sorted(own + inside, key=lambda pair: pair[0].z)
