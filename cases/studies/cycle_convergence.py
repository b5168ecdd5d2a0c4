"""One limit cycle on several steps and meshes: amplitude, period and mean, and the orders in which they converge.

Each step after the longest starts from the cycle that the run on the step before ended in; other meshes start from
their own steady state with a kick. Runs are kept in files of the folder, so a study that is started again goes on.

    python cases/studies/cycle_convergence.py out/cycle --density 45 --steps 2 1 0.5 0.25 0.1 --meshes 14x24 42x72
"""

from __future__ import annotations

import argparse
import csv
import sys
from pathlib import Path

import numpy as np
from kept import base_case, kept_run, takes_keys
from scipy.optimize import brentq

QUANTITIES = {
    "lip amplitude, mm": ("lip_displacement", "amplitude", 1e3),
    "lip mean, mm": ("lip_displacement", "mean", 1e3),
    "period, ms": ("lip_displacement", "period", 1e3),
    "flow amplitude, kg/s": ("mass_flow", "amplitude", 1.0),
    "flow mean, kg/s": ("mass_flow", "mean", 1.0),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--density", type=float, default=45.0, help="kg/m3")
    parser.add_argument("--pressure", default="6 kPa")
    parser.add_argument("--mesh", default="28x48")
    parser.add_argument("--steps", type=float, nargs="*", default=[2.0, 1.0, 0.5, 0.25, 0.1], help="ms")
    parser.add_argument("--duration", default="0.6 s")
    parser.add_argument("--meshes", nargs="*", default=[])
    parser.add_argument("--mesh-step", type=float, default=0.5, help="ms")
    parser.add_argument("--mesh-duration", default="0.8 s")
    parser.add_argument("--kick", default="6 mm")
    takes_keys(parser)
    given = parser.parse_args()
    base = base_case(given).replace(
        {
            "drive.pressure": given.pressure,
            "damping.alpha": 0,
            "fluid.density": given.density,
            "transient.kick_opening": given.kick,
            "transient.restart_every": 200,
        }
    )
    rows, last = [], None
    for step in sorted(given.steps, reverse=True):
        start = (
            {"transient.start": "state", "transient.start_file": str(last.path)}
            if last
            else {"transient.start": "kick"}
        )
        duration = given.duration if last else given.mesh_duration
        case = _on(base, given.mesh, step).replace(start | {"transient.duration": duration})
        last = kept_run(case, given.folder / f"{given.mesh}-{step:g}ms.h5")
        rows.append(_row(given.mesh, step, last))
        _tell(rows[-1])
    steps = list(rows)
    for mesh in given.meshes:
        case = _on(base, mesh, given.mesh_step).replace(
            {"transient.start": "kick", "transient.duration": given.mesh_duration}
        )
        rows.append(_row(mesh, given.mesh_step, kept_run(case, given.folder / f"{mesh}-{given.mesh_step:g}ms.h5")))
        _tell(rows[-1])
    with (given.folder / "convergence.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    for name in QUANTITIES:
        for three in zip(steps, steps[1:], steps[2:]):
            h, values = [row["step, ms"] for row in three], [row[name] for row in three]
            print(f"order of {name} from steps {', '.join(f'{x:g}' for x in h)} ms: {order(h, values):.2f}")


def _on(base, mesh: str, step: float):
    around, along = mesh.split("x")
    return base.replace({"mesh.around": int(around), "mesh.along": int(along), "transient.step": 1e-3 * step})


def _row(mesh: str, step: float, result) -> dict:
    lip = result.verdict["lip_displacement"]
    numbers = {}
    for name, (signal, key, factor) in QUANTITIES.items():
        value = result.verdict[signal][key]  # None where no cycle was found
        numbers[name] = float("nan") if value is None else factor * value
    return {
        "mesh": mesh,
        "step, ms": step,
        **numbers,
        "verdict": result.verdict["verdict"],
        "trend a cycle": lip["amplitude_trend"],
        "cycles": lip["cycles_observed"],
    }


def _tell(row: dict) -> None:
    print(
        ", ".join(f"{key} {value:.7g}" if isinstance(value, float) else f"{key} {value}" for key, value in row.items()),
        flush=True,
    )


def order(steps, values) -> float:
    """p of value = limit + c step^p through three points, not a number if there is none."""
    if not np.isfinite(values).all() or values[1] == values[2]:
        return float("nan")
    ratio = (values[0] - values[1]) / (values[1] - values[2])

    def miss(p):
        return (steps[0] ** p - steps[1] ** p) / (steps[1] ** p - steps[2] ** p) - ratio

    return brentq(miss, 0.05, 8.0) if miss(0.05) * miss(8.0) < 0 else float(np.nan)


if __name__ == "__main__":
    sys.exit(main())
