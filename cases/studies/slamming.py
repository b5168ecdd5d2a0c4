"""How far results with slamming lips can be trusted: statistics of the same run under other steps, stops, area floors,
meshes and continuity laws.

Every variant is a run from rest, its keys changed as given, kept in a file of the folder; printed are root mean square
and mean over all but the first part, the interval between slams, and the largest of what should stay within bounds:
pressures, flow areas below zero, work of the pressure.

    python cases/studies/slamming.py out/slam --mesh 14x24 --density 1.2 --duration "0.5 s" \\
        base: fine:transient.step=0.25ms soft:supports.lip_stop_stiffness=1e7
        "both:fluid.area_floor=0.5,transient.step=0.25ms"
"""

from __future__ import annotations

import argparse
import csv
import sys
from pathlib import Path

import numpy as np
from kept import base_case, kept_run, takes_keys


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("variants", nargs="+", help="NAME:KEY=VALUE,KEY=VALUE")
    parser.add_argument("--mesh", default="14x24")
    parser.add_argument("--density", type=float, default=1.2, help="kg/m3")
    parser.add_argument("--pressure", default="6 kPa")
    parser.add_argument("--step", default="0.5 ms")
    parser.add_argument("--duration", default="0.5 s")
    parser.add_argument("--since", type=float, default=0.05, help="s")
    parser.add_argument("--open", type=float, default=5.0, help="cm2 that lips must open between two slams that count")
    takes_keys(parser)
    given = parser.parse_args()
    around, along = given.mesh.split("x")
    base = base_case(given).replace(
        {
            "mesh.around": int(around),
            "mesh.along": int(along),
            "drive.pressure": given.pressure,
            "fluid.density": given.density,
            "damping.alpha": 0,
            "transient.step": given.step,
            "transient.duration": given.duration,
            "transient.restart_every": 100,
        }
    )
    rows = []
    for variant in given.variants:
        name, _, changes = variant.partition(":")
        case = base.replace(dict(_pair(part) for part in changes.split(",") if part))
        run = kept_run(case, given.folder / f"{name}.h5")
        rows.append({"variant": name} | statistics(run, given.since, given.open))
        print(
            ", ".join(
                f"{key} {value:.4g}" if isinstance(value, float) else f"{key} {value}"
                for key, value in rows[-1].items()
            ),
            flush=True,
        )
        with (given.folder / "slamming.csv").open("w", newline="") as file:
            writer = csv.DictWriter(file, list(rows[0]))
            writer.writeheader()
            writer.writerows(rows)


def _pair(text: str):
    key, _, value = text.partition("=")
    try:
        return key.strip(), float(value)
    except ValueError:
        return key.strip(), value.strip()


def statistics(result, since: float, open_: float = 5.0) -> dict:
    """Numbers of a run from a time on, weighted by the lengths of its steps; their uncertainty is the spread between
    its two halves, that of the interval between slams its scatter over the root of their number.
    """
    h = result.history
    kept = h["time"] >= since
    t, step = h["time"][kept], h["step"][kept]
    lip, flow, area = 1e3 * h["lip_displacement"][kept], h["mass_flow"][kept], 1e4 * h["smallest_area"][kept]

    def mean(x, part=slice(None)):
        return float(np.average(x[part], weights=step[part]))

    slams = slam_times(t, area, open_=open_)
    half = [t < 0.5 * (t[0] + t[-1]), t >= 0.5 * (t[0] + t[-1])]
    gaps = 1e3 * np.diff(slams)
    work = np.diff(h["pressure_work"][kept])
    return {
        "verdict": result.verdict["verdict"] + (" (failed)" if result.failures else ""),
        "time": float(h["time"][-1]),
        "steps": len(h["time"]) - 1,
        "slams": len(slams),
        "interval_ms": float(gaps.mean()) if len(gaps) else float("nan"),
        "interval_scatter_ms": float(gaps.std()) if len(gaps) else float("nan"),
        "interval_error_ms": float(gaps.std() / np.sqrt(len(gaps))) if len(gaps) else float("nan"),
        "shut_share": mean(area < 1.0),
        "lip_mean_mm": mean(lip),
        "lip_mean_halves": abs(mean(lip, half[0]) - mean(lip, half[1])) / 2,
        "lip_rms_mm": float(np.sqrt(mean((lip - mean(lip)) ** 2))),
        "lip_max_mm": float(lip.max()),
        "flow_mean": mean(flow),
        "flow_mean_halves": abs(mean(flow, half[0]) - mean(flow, half[1])) / 2,
        "flow_rms": float(np.sqrt(mean((flow - mean(flow)) ** 2))),
        "area_min_cm2": float(area.min()),
        "pressure_max_kPa": 1e-3 * float(h["station_pressure"][kept].max()),
        "pressure_min_kPa": 1e-3 * float(h["station_pressure"][kept].min()),
        "work_in_a_step_J": float(work.max()),
        "work_J": float(h["pressure_work"][-1]),
        "balance_J": float(np.abs(h["balance"]).max()),
        "wall_kinetic_J": float(h["kinetic_energy"][kept].max()),
    }


def slam_times(t, area, shut: float = 1.0, open_: float = 5.0) -> np.ndarray:
    """Instants at which the smallest area, cm2, falls below `shut` after having been above `open_`."""
    found, armed = [], True
    for now, value in zip(t, area):
        if armed and value < shut:
            found.append(now)
            armed = False
        elif value > open_:
            armed = True
    return np.array(found)


if __name__ == "__main__":
    sys.exit(main())
