"""Onsets of the 12-inch valve at 28 x 48, for docs/evidence/stability.md.

    python tools/onset_numbers.py [FILE.json] [MAP.h5] [KEY=VALUE ...]

Densities at 1, 2, 4 and 6 kPa, and all pressures from 0.3 to 36 kPa at 1.2, 10 and 30 kg/m3, under both continuity laws
(alpha 0, beta 0.003), each with direct eigenvalues and independent counts on both sides, criticality, and uncertainty
from a mesh of half as many elements each way. Takes some tens of minutes on one core. An interrupted run goes on with
the searches that are missing; a file of onsets with other keys is refused. With the result of `dbvfiv map --both` for
the same damping it also measures how far the onsets lie from the map's curves, and whether the signs of its cells agree
with them.
"""

import json
import sys
from pathlib import Path

from dbvfiv.runtime import prepare

prepare()

import numpy as np  # noqa: E402

from dbvfiv.studies.case import thesis_case  # noqa: E402
from dbvfiv.studies.onset.search import run_onset  # noqa: E402
from dbvfiv.studies.stability.walk import StabilityWalk  # noqa: E402

MESH = (28, 48)
LAWS = ("quasi-steady", "storage")


def main(path: Path, keys: list[str]) -> None:
    """Write the onsets, of the case with some keys changed."""
    keys = [f"mesh.around={MESH[0]}", f"mesh.along={MESH[1]}", "damping.alpha=0", "damping.beta=0.003", *keys]
    kept = json.loads(path.read_text()) if path.exists() else {"keys": keys, "onsets": {}}
    if kept.get("keys") != keys:
        sys.exit(f"{path} holds onsets with the keys {kept.get('keys', 'of nobody knows what')}; give another file.")
    done, case = kept["onsets"], thesis_case(keys)
    walk = StabilityWalk(case)

    def search(law: str, parameter: str, values, fixed: str, value: float) -> None:
        key = f"{parameter} {law} {value:g}"
        if key in done:
            return
        over = f"{parameter}={','.join(map(repr, map(float, values)))}:log"
        found = run_onset(case.replace({fixed: value, "fluid.continuity": law, "onset.over": over}), walk=walk)
        leading = found.growth_rates[:, 0]
        done[key] = {
            "parameter": parameter,
            "law": law,
            "fixed": {fixed.split(".")[1]: value},
            "points": [p.summary() for p in found.points],
            "scanned": len(leading),
            "largest_growth_rate": float(max(leading)),
            "failures": list(found.failures),
        }
        path.write_text(json.dumps(kept, indent=1) + "\n")
        for line in rows(done[key]):
            print(line, flush=True)

    for law in LAWS:
        for pressure in (1e3, 2e3, 4e3, 6e3):
            search(law, "density", np.geomspace(0.5, 2000, 61), "drive.pressure", pressure)
    for law in LAWS:
        for density in (1.2, 10.0, 30.0):
            search(law, "pressure", np.geomspace(300, 36000, 49), "fluid.density", density)


def rows(entry: dict) -> list[str]:
    """Lines of the tables in docs/evidence/stability.md."""
    (fixed,) = entry["fixed"].values()
    scale = 1e3 if entry["parameter"] == "pressure" else 1.0
    start = f"| {fixed if scale > 1 else fixed / 1e3:g} | {entry['law']} |"
    lines = []
    for p in entry["points"]:
        below, above = p["below"], p["above"]
        counts = ", ".join(f"{side['unstable_count']}/{side['unstable_count_independent']}" for side in (below, above))
        lyapunov = "" if p["first_lyapunov_coefficient"] is None else f"{p['first_lyapunov_coefficient']:+.3g}"
        spread = "" if p["uncertainty"] is None else f"{p['uncertainty'] / scale:.2g}"
        lines.append(
            f"{start} {p['value'] / scale:.6f} | {spread} | {p['frequency']:.3f} | "
            f"{below['growth_rate']:+.4f} | {above['growth_rate']:+.4f} | {counts} | "
            f"{'above' if p['gains'] else 'below'} | {p['criticality']} | {lyapunov} "
            f"|{'' if p['confirmed'] else ' NOT CONFIRMED'}"
        )
    return lines or [f"{start} none, largest growth rate {entry['largest_growth_rate']:.3f} 1/s |"]


def compare(numbers: Path, map_file: Path) -> None:
    """Distances of onsets from the curves of a map, and cells whose sign the curves contradict."""
    from dbvfiv.studies.session import load_result

    result = load_result(map_file)
    plan = result.plan
    lines = [
        (c.law, np.array([[plan.coordinate(plan.x, x), plan.coordinate(plan.y, y)] for x, y in zip(c.x, c.y)]))
        for c in result.curves
    ]
    for c in result.curves:
        print(
            f"curve of law {plan.laws[c.law]:g}: {len(c.x)} points, exact {c.exact}, largest distance of "
            f"{c.mismatch:.1e} from the columns' onsets"
        )
    for key, entry in json.loads(numbers.read_text())["onsets"].items():
        fixed, law = entry["fixed"], LAWS.index(entry["law"])
        for p in entry["points"]:
            place = {"pressure": fixed.get("pressure", p["value"]), "density": fixed.get("density", p["value"])}
            point = np.array([plan.coordinate(plan.x, place["pressure"]), plan.coordinate(plan.y, place["density"])])
            mine = [line for number, line in lines if plan.laws[number] == law]
            print(
                f"{key}: {p['value']:.6g}, {min(_distance(point, line) for line in mine):.1e} of the map's "
                f"width from the curve"
            )
    for number, law in enumerate(plan.laws):
        unstable = result.grid("unstable")[number] > 0
        wrong = 0
        for i, x in enumerate(plan.x.values):
            at = plan.coordinate(plan.x, x)
            cuts = sorted(cut for k, line in lines if k == number for cut in _cuts(line, at))
            for j, y in enumerate(plan.y.values):
                above = sum(cut > plan.coordinate(plan.y, y) for cut in cuts)
                wrong += bool(above % 2) != bool(unstable[j, i])
        print(
            f"law {law:g}: {wrong} of {unstable.size} cells have another sign than the curves say (stable "
            f"at the upper edge)"
        )


def _distance(point: np.ndarray, line: np.ndarray) -> float:
    """From a point (2,) to the nearest place of a polyline (k, 2)."""
    start, way = line[:-1], np.diff(line, axis=0)
    length = np.maximum(np.sum(way**2, axis=1), np.finfo(float).tiny)
    share = np.clip(np.sum((point - start) * way, axis=1) / length, 0.0, 1.0)
    return float(np.linalg.norm(start + share[:, None] * way - point, axis=1).min())


def _cuts(line: np.ndarray, x: float) -> list[float]:
    """Heights at which a polyline crosses a vertical line; an end on it counts."""
    found = []
    for (x0, y0), (x1, y1) in zip(line[:-1], line[1:]):
        if min(x0, x1) <= x < max(x0, x1) or (x == 1.0 and max(x0, x1) == 1.0 and x0 != x1):
            found.append(y0 + (x - x0) / (x1 - x0) * (y1 - y0))
    return found


if __name__ == "__main__":
    files = [word for word in sys.argv[1:] if "=" not in word]
    numbers = Path(files[0] if files else "onset-28x48.json")
    main(numbers, [word for word in sys.argv[1:] if "=" in word])
    if len(files) > 1:
        compare(numbers, Path(files[1]))
