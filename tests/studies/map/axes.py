"""Axes and options of the map that these tests look at, and its run."""

from dbvfiv.studies.session import Session

AXES = {
    "map.x": "pressure=1000:12000:6",
    "map.y": "density=1:1000:10:log",
    "map.curve": False,
    "map.refine": 1,
    "map.checks": 3,
}


def run_map(case, observer=None, start=None, **choices):
    """Map of a case, from a steady state that is known."""
    return Session(case, start=start).perform("map", observer=observer, **choices)
