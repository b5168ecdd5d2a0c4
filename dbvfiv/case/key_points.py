"""Mid-surface key points: nine profiles of fifteen points, as the thesis's program reads them (App. A)."""

from __future__ import annotations

import math
from pathlib import Path

from .text_file import read_text_file

PROFILES, POINTS = 9, 15


def read_key_points(path: Path) -> list[list[tuple[float, float, float]]]:
    """Read a file of key points.

    Parameters
    ----------
    path : Path
        One point ``x y z`` in m on each line (blanks or commas between);
        empty lines and text after ``#`` are skipped.

    Returns
    -------
    list of list of tuple
        ``[9][15]`` points, profiles from lip to flange, each profile from the
        centre (x = 0) to the side edge (y = 0). ``numpy.asarray`` makes it (9, 15, 3).

    Raises
    ------
    ValueError
        With a clause that completes "key_points is given as FILE, ...".
    """
    text = read_text_file(path, encoding=None)
    points = []
    for number, line in enumerate(text.splitlines(), 1):
        line = line.split("#")[0].replace(",", " ").strip()
        if not line:
            continue
        try:
            point = tuple(float(word) for word in line.split())
        except ValueError:
            point = ()
        if len(point) != 3 or not all(map(math.isfinite, point)):
            raise ValueError(f"whose line {number} is not three numbers x y z")
        points.append(point)
    if len(points) != PROFILES * POINTS:
        raise ValueError(f"which holds {len(points)} points and not {PROFILES} x {POINTS} = {PROFILES * POINTS}")
    return [points[i * POINTS : (i + 1) * POINTS] for i in range(PROFILES)]
