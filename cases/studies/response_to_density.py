"""Amplitude of the oscillation against the density of the fluid: does it grow from zero or jump, and is there hysteresis?

Each density is run twice: from the steady state with a small kick, and from the state that the run at the density before ended in, going through the
densities in both directions. Prints one CSV row for each run.

    python cases/studies/response_to_density.py --mesh 8x12 --pressure 6e3 --step 5e-4 200 160 140 120 100 80 60
"""

from __future__ import annotations

import argparse
import sys

import dbvfiv
from dbvfiv.model import ValveModel
from dbvfiv.transient.run import Runner
from dbvfiv.transient.state import consistent_state


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("densities", type=float, nargs="+", help="kg/m3")
    parser.add_argument("--mesh", default="8x12")
    parser.add_argument("--pressure", default="6 kPa")
    parser.add_argument("--step", default="5e-4")
    parser.add_argument("--duration", default="1.5")
    parser.add_argument("--continuity", default="quasi-steady")
    parser.add_argument("--kick", default="0.1 mm")
    parser.add_argument("--damping", default="0", help="numerical")
    parser.add_argument("--ways", default="kick,down,up")
    given = parser.parse_args()
    around, along = given.mesh.split("x")
    base = dbvfiv.load().case.replace({
        "mesh.around": int(around), "mesh.along": int(along), "drive.pressure": _number(given.pressure), "damping.alpha": 0,
        "fluid.continuity": given.continuity, "transient.step": _number(given.step), "transient.duration": _number(given.duration),
        "transient.start": "kick", "transient.kick_opening": given.kick, "transient.numerical_damping": float(given.damping),
        "transient.stop_when": ["limit cycle", "steady"],
    })  # fmt: skip
    print("way,density,verdict,decided,lip_amplitude_mm,lip_mean_mm,frequency_hz,flow_amplitude,flow_mean,periodicity_error,cycles,time,smallest_area_cm2,steps")
    for way in given.ways.split(","):
        last = None
        for density in sorted(given.densities, reverse=way != "up"):
            last = _run(way, base.replace({"fluid.density": density}), last if way != "kick" else None)


def _run(way, case, last):
    runner = Runner(ValveModel(case))
    # positions and velocities of the run before; accelerations follow from the new density
    first = last and consistent_state(runner.motion, 0.0, last.q, last.v, last.speed, case.drive.pressure)
    run = runner.start(first)
    lip, flow = run.verdict.lip_opening, run.verdict.mass_flow
    half = run.history.rows // 2
    numbers = (
        1e3 * lip.amplitude, 1e3 * lip.mean, lip.frequency, flow.amplitude, flow.mean, lip.periodicity_error, lip.cycles,
        run.progress.state.time, 1e4 * run.history["smallest_area"][half:].min(), run.progress.steps,
    )  # fmt: skip
    name = f"{run.verdict.name}{' (failed)' if run.failures else ''}"
    print(f"{way},{case.fluid.density:g},{name},{run.verdict.decided}," + ",".join(f"{n:.6g}" for n in numbers), flush=True)
    return run.progress.state


def _number(text):
    try:
        return float(text)
    except ValueError:
        return text


if __name__ == "__main__":
    sys.exit(main())
