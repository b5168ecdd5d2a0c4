"""Axes and options of the map that these tests look at."""

AXES = {
    "map.x": "pressure=1000:12000:6",
    "map.y": "density=1:1000:10:log",
    "map.curve": False,
    "map.refine": 1,
    "map.checks": 3,
}
