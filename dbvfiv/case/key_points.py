"""Mid-surface key points: profiles of points from the lip to the flange, a table with units or as App. A has them."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from pathlib import Path

from .quantity import Quantity
from .tables import cells_of, numbered_lines

#: A file of bare numbers of this many lines holds nine profiles of fifteen points, as the thesis's program reads them.
_BARE = 9, 15
_LENGTH = Quantity("m", "mm")
_COLUMN = re.compile(r"\s*([A-Za-z]+)\s*(?:[\[(]\s*([^\])]*?)\s*[\])])?\s*")
_HEADER = "the first line must name x, y and z with their units, such as 'profile, x [mm], y [mm], z [mm], joint'"
#: Distance from a symmetry plane, over the size of the profile, up to which a point lies on it.
_ON_PLANE = 1e-6
#: Range of the z of a profile's points, over the length of the valve, up to which it lies at their mean.
_ONE_PLACE = 1e-3
_LARGEST = 200_000


@dataclass(frozen=True)
class KeyProfile:
    """One section of the mid-surface."""

    #: (x, y, z), m; from the centre, x = 0, or from one side edge, y = 0, to the other side edge.
    points: tuple[tuple[float, float, float], ...]
    joints: tuple[int, ...] = ()  #: Points inside at which the curvature jumps or the section has a corner.
    smooth: bool = False  #: Whether the section is smooth between joints, so that curves of higher degree serve.

    @property
    def z(self) -> float:
        """Axial position, m: the mean of its points."""
        return math.fsum(point[2] for point in self.points) / len(self.points)

    @property
    def radius(self) -> float:
        """Mean distance of its points from the axis, m."""
        return math.fsum(math.hypot(x, y) for x, y, _ in self.points) / len(self.points)

    @property
    def reach(self) -> float:
        """Largest distance of its points from the axis along x, m."""
        return max(abs(x) for x, _, _ in self.points)


def read_key_points(path: Path) -> tuple[KeyProfile, ...]:
    """Read a file of key points. Raises ValueError with a clause that completes "key_points is given as FILE, ...".

    Parameters
    ----------
    path : Path
        Either a table (commas, semicolons, tabs or blanks) whose first line names the columns ``x``, ``y`` and ``z``
        with their units and, where wanted, ``profile`` (any word, the same for all points of one) and ``joint`` (1
        where the curvature jumps); or bare lines ``x y z`` in m. Points of one profile follow each other, told by that
        word or by their equal z; 135 bare lines are 9 profiles of 15 points. Empty lines and text after ``#`` are
        skipped.

    Returns
    -------
    tuple of KeyProfile
        From lip to flange.
    """
    numbered = numbered_lines(path)
    if not numbered:
        raise ValueError("which holds no points")
    if len(numbered) > _LARGEST:
        raise ValueError(f"which holds more than {_LARGEST} lines")
    profiles = _table(numbered) if re.match(r"[A-Za-z\"']", numbered[0][1]) else _bare(numbered)
    _check(profiles)
    return tuple(profiles)


def readable_key_points(path: Path | None) -> tuple[KeyProfile, ...]:
    """Profiles of a file of key points; none without a file, and where it cannot be read."""
    try:
        return () if path is None else read_key_points(path)
    except ValueError:
        return ()


def is_whole(profile: KeyProfile) -> bool:
    """True where a profile runs from side edge to side edge instead of from the centre."""
    size = max(max(abs(x), abs(y)) for x, y, _ in profile.points)
    return profile.points[0][0] < -_ON_PLANE * size


def _bare(numbered: list[tuple[int, str]]) -> list[KeyProfile]:
    points = [_numbers(" ".join(cells_of(line)).split(), number) for number, line in numbered]
    count, each = _BARE
    if len(points) == count * each:
        groups = [points[i * each : (i + 1) * each] for i in range(count)]
    else:
        groups = _by(points, [point[2] for point in points])
    return [KeyProfile(tuple(group)) for group in groups]


def _table(numbered: list[tuple[int, str]]) -> list[KeyProfile]:
    columns = [_COLUMN.fullmatch(word) for word in cells_of(numbered[0][1])]
    names = [match[1].lower() if match else "" for match in columns]
    for name in ("x", "y", "z"):
        if names.count(name) != 1:
            raise ValueError(f"whose first line names no column {name}, or several; {_HEADER}")
    unknown = [name for name in names if name not in ("x", "y", "z", "profile", "joint")]
    if unknown or len(set(names)) < len(names):
        raise ValueError(f"whose first line has a column that is not told or stands twice; {_HEADER}")
    units = {name: match[2] for name, match in zip(names, columns) if name in "xyz"}
    for name, unit in units.items():
        try:
            _LENGTH.parse(f"1 {unit}")
        except ValueError:
            raise ValueError(f"whose column {name} has no unit of length; {_HEADER}") from None
    points, labels, joints = [], [], []
    for number, line in numbered[1:]:
        words = cells_of(line, numbered[0][1])
        if len(words) != len(names):
            raise ValueError(f"whose line {number} has {len(words)} entries and not {len(names)}")
        row = dict(zip(names, words))
        points.append(_numbers([row[name] for name in "xyz"], number, [units[name] for name in "xyz"]))
        labels.append(row.get("profile", points[-1][2]))
        joint = row.get("joint", "") or "0"
        try:
            marked = (0.0, 1.0).index(float(joint))
        except ValueError:
            raise ValueError(f"whose line {number} holds the joint {joint!r}, which is neither 0 nor 1") from None
        joints.append(bool(marked))
    if not points:
        raise ValueError("which holds no points below its first line")
    groups, marks = _by(points, labels), _by(joints, labels)
    if len(set(labels)) != len(groups):
        raise ValueError("in which the points of a profile do not follow each other")
    return [
        KeyProfile(tuple(group), tuple(i for i in range(1, len(group) - 1) if mark[i]), smooth="joint" in names)
        for group, mark in zip(groups, marks)
    ]


def _numbers(words: list[str], number: int, units: list[str] | None = None) -> tuple[float, float, float]:
    try:
        point = tuple(float(word) for word in words)
        if units is not None:
            point = tuple(_LENGTH.parse(f"{value!r} {unit}") for value, unit in zip(point, units))
    except ValueError:
        point = ()
    if len(point) != 3 or not all(map(math.isfinite, point)):
        raise ValueError(f"whose line {number} is not three numbers x y z")
    return point


def _by(items: list, labels: list) -> list[list]:
    """Items in groups of equal labels that follow each other."""
    groups: list[list] = []
    for i, item in enumerate(items):
        if i == 0 or labels[i] != labels[i - 1]:
            groups.append([])
        groups[-1].append(item)
    return groups


def _check(profiles: list[KeyProfile]) -> None:
    """Refuse profiles that make neither a quarter of a valve nor a half."""
    if len(profiles) < 2:
        raise ValueError("which holds one profile, and a valve has two or more")
    for i, profile in enumerate(profiles, 1):
        points = profile.points
        where = f"whose profile {i} at z = {profile.z:g} m"
        low, high = (end(z for _, _, z in points) for end in (min, max))
        if high - low > _ONE_PLACE * abs(profiles[-1].z):
            raise ValueError(f"{where} has points from {low:g} to {high:g} m, and a profile lies at one z")
        if len(points) < 3:
            raise ValueError(f"{where} has {len(points)} points, and a profile has three or more")
        size = max(max(abs(x), abs(y)) for x, y, _ in points)
        near = _ON_PLANE * size
        whole = is_whole(profile)
        if whole != is_whole(profiles[0]):
            raise ValueError(
                f"{where} does not begin as the first one does: all run from the centre, x = 0, or all from the side "
                "edge at negative x"
            )
        if min(y if whole else min(x, y) for x, y, _ in points) < -near:
            there = "half of positive y" if whole else "quarter of positive x and y"
            raise ValueError(f"{where} leaves the {there}, whose mirror images are the rest of the valve")
        if whole and max(abs(points[0][1]), abs(points[-1][1])) > near:
            raise ValueError(f"{where} does not run from side edge to side edge, where y = 0")
        if not whole and (abs(points[0][0]) > near or abs(points[-1][1]) > near):
            raise ValueError(f"{where} does not run from the centre, x = 0, to the side edge, y = 0")
        if min(math.dist(a[:2], b[:2]) for a, b in zip(points, points[1:])) <= 1e-9 * size:
            raise ValueError(f"{where} has the same point twice")
    places = [profile.z for profile in profiles]
    if any(b <= a for a, b in zip(places, places[1:])):
        raise ValueError("whose profiles do not go from the lip to the flange with z increasing")
    if abs(places[0]) > 1e-6 * places[-1]:
        raise ValueError(f"whose first profile lies at z = {places[0]:g} m, and the lip is at 0")
