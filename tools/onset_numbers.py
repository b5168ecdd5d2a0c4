"""Onsets of the 12-inch valve at 28 x 48, for docs/stability.md: python tools/onset_numbers.py [FILE.json]

Densities at 1, 2, 4 and 6 kPa, and all pressures from 0.3 to 36 kPa at 1.2, 10 and 30 kg/m3, under both continuity laws (alpha 0, beta 0.003), each with
direct eigenvalues and independent counts on both sides. Takes about ten minutes on one core. An interrupted run goes on.
"""
import json
import sys
from pathlib import Path

from dbvfiv.runtime import prepare

prepare()

import numpy as np  # noqa: E402

from dbvfiv.case import load_case  # noqa: E402
from dbvfiv.studies.onset import OnsetOptions, OnsetSearch  # noqa: E402
from dbvfiv.studies.parameters import Place  # noqa: E402
from dbvfiv.studies.stability_walk import StabilityWalk  # noqa: E402

MESH = (28, 48)


def main(path: Path) -> None:
    case = load_case(None, [f"mesh.around={MESH[0]}", f"mesh.along={MESH[1]}", "damping.alpha=0", "damping.beta=0.003"])
    walk = StabilityWalk(case)
    base = Place.of(case)
    done = json.loads(path.read_text()) if path.exists() else {}

    def search(key: str, parameter: str, values, **fixed) -> None:
        if key in done:
            return
        options = OnsetOptions(parameter, tuple(values), True, normal_form=False, coarse_mesh=0)
        found = OnsetSearch(case, options, walk=walk, place=base.at(**fixed))
        points = [found.point(crossing).summary() for crossing in found.scan.run(values)]
        leading = [found.scan.samples[v].growth[0] for v in sorted(found.scan.samples)]
        done[key] = {"parameter": parameter, "fixed": fixed, "points": points, "scanned": len(leading), "largest_growth_rate": float(max(leading)),
                     "failures": list(found.scan.failures.values())}
        path.write_text(json.dumps(done, indent=1) + "\n")
        print(key, [(round(p["value"], 6), round(p["frequency"], 4), p["confirmed"]) for p in points], flush=True)

    for law in (0.0, 1.0):
        for pressure in (1e3, 2e3, 4e3, 6e3):
            search(f"density {pressure:g} {law:g}", "density", np.geomspace(0.5, 2000, 61), pressure=pressure, storage=law)
    for law in (0.0, 1.0):
        for density in (1.2, 10.0, 30.0):
            search(f"pressure {density:g} {law:g}", "pressure", np.geomspace(300, 36000, 49), density=density, storage=law)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "onset-28x48.json"))
