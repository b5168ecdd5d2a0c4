"""Amplitude of the oscillation against the density of the fluid: does it grow from zero or jump, and is there
hysteresis?

The densities are gone through downwards, from the steady state with a small kick, and upwards again; each run starts
from the state in which the one before ended, or from a kick where that one had come to rest. Every run is kept in a
file of the folder: a study that is started again reads those that are finished and goes on with the one that is not.
The table (CSV) and the figure are written anew after each run. `--theory` adds the Hopf onset, its normal form and the
growth rates of the steady state, from the eigenvalues alone.

    python cases/studies/response_to_density.py out/response 60 57 56 54 53 52 50 45 40 30 20 10 --theory
"""

from __future__ import annotations

import argparse
import csv
import json
import sys
from pathlib import Path

import numpy as np
from kept import base_case, kept_run, takes_keys
from response_figure import draw

import dbvfiv

COLUMNS = (
    "way",
    "density",
    "verdict",
    "decided",
    "amplitude",
    "mean",
    "smallest",
    "largest",
    "frequency",
    "flow_amplitude",
    "flow_mean",
    "trend",
    "periodicity_error",
    "cycles",
    "smallest_area",
    "stops",
    "time",
    "steps",
    "growth_rate",
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="for runs, table and figure")
    parser.add_argument("densities", type=float, nargs="*", help="kg/m3")
    parser.add_argument("--mesh", default="28x48")
    parser.add_argument("--pressure", default="6 kPa")
    parser.add_argument("--step", default="0.5 ms")
    parser.add_argument("--duration", default="1.5 s", help="of a run that does not settle before")
    parser.add_argument("--longest", type=float, default=3.0, help="of a run next to the onset, s; with --theory")
    parser.add_argument("--continuity", default="quasi-steady")
    parser.add_argument("--kick", default="1 mm")
    parser.add_argument("--back", type=float, nargs="*", help="densities of the way up; all by default")
    parser.add_argument("--theory", action="store_true", help="onset and normal form too")
    takes_keys(parser)
    given = parser.parse_args()
    around, along = given.mesh.split("x")
    base = base_case(given).replace(
        {
            "mesh.around": int(around),
            "mesh.along": int(along),
            "drive.pressure": given.pressure,
            "damping.alpha": 0,
            "fluid.continuity": given.continuity,
            "transient.step": given.step,
            "transient.duration": given.duration,
            "transient.kick_opening": given.kick,
            "transient.stop_when": ["limit cycle", "steady"],
            "transient.restart_every": 100,
        }
    )
    theory = {}
    if given.theory:
        theory = _theory(base, given.folder / "theory.json")
    rows, last = [], None
    ways = {
        "down": sorted(given.densities, reverse=True),
        "up": sorted(given.densities if given.back is None else given.back),
    }
    for way, densities in ways.items():
        for density in densities:
            case = base.replace({"fluid.density": density})
            if theory:  # next to the onset everything is slow
                rate = np.interp(density, theory["densities"], theory["growth"])
                case = case.replace(
                    {
                        "transient.duration": min(
                            max(case.transient.duration, 3.0 / rate if rate > 1e-6 else 0.0), given.longest
                        )
                    }
                )
            if way == "up" and not _moving(case, last):
                break  # at rest again: from here on it would be the first way's kicks once more
            last = _run(case, given.folder / f"{way}-{density:g}.h5", last)
            rows.append(_row(way, last))
            print(", ".join(f"{key} {_text(rows[-1][key])}" for key in COLUMNS[:9]), flush=True)
            _write(given.folder / "response.csv", rows)
            draw(rows, theory, given.folder / "response.png")


def _run(case, path: Path, last):
    """Result of a run from the state that the last one ended in, or from a kick where that was at rest."""
    start = (
        {"transient.start": "state", "transient.start_file": str(last.path)}
        if _moving(case, last)
        else {"transient.start": "kick"}
    )
    return kept_run(case.replace(start), path)


def _moving(case, last) -> bool:
    return last is not None and last.verdict["lip_displacement"]["amplitude"] > 0.5 * case.transient.kick_opening


def _row(way: str, result) -> dict:
    """Numbers of a run; m, kg/s, Hz, 1/s."""
    verdict, h = result.verdict, result.history
    lip, flow = verdict["lip_displacement"], verdict["mass_flow"]
    late = h["time"] >= 0.5 * h["time"][-1]
    trend = (lip["amplitude_trend"] or 0.0) * (lip["frequency"] or 0.0)
    return {
        "way": way,
        "density": result.case.fluid.density,
        "verdict": verdict["verdict"] + (" (failed)" if result.failures else ""),
        "decided": verdict["decided"],
        "amplitude": lip["amplitude"],
        "mean": lip["mean"],
        "smallest": h["lip_displacement"][late].min(),
        "largest": h["lip_displacement"][late].max(),
        "frequency": lip["frequency"],
        "flow_amplitude": flow["amplitude"],
        "flow_mean": flow["mean"],
        "trend": trend,
        "periodicity_error": lip["periodicity_error"],
        "cycles": lip["cycles_observed"],
        "smallest_area": h["smallest_area"][late].min(),
        "stops": h["stops"][late].max(),
        "time": verdict["time"],
        "steps": verdict["steps"],
        "growth_rate": growth(h["time"], h["lip_displacement"], lip["period"]),
    }


def growth(time, values, period: float | None) -> dict | None:
    """Coefficients of d(ln A)/dt = rate - cubic A^2 + fifth A^4 fitted to the amplitudes A of a run's cycles, where
    these change enough to tell.

    Amplitudes are those of the first harmonic over single cycles, the fit is over the time that they take from one to
    the next.
    """
    if not period:
        return None
    count = int((time[-1] - time[0]) / period)
    steps = int(round(period / np.median(np.diff(time)))) * 4
    ends = time[-1] - period * np.arange(count - 1, -1, -1)
    lags = period * (np.arange(steps) / steps - 1.0)
    from scipy.interpolate import CubicSpline

    sampled = CubicSpline(time, values)(ends[:, None] + lags)
    a = (
        2.0 * np.abs(np.mean(sampled * np.exp(2j * np.pi * np.arange(steps) / steps), axis=1))[3:]
    )  # the kick's other modes die out first
    if len(a) < 12 or a.max() < 1.3 * a.min():
        return None
    rate = np.diff(np.log(a)) / period
    square = a[1:] * a[:-1]
    columns = np.stack([np.ones_like(square), -square, square**2], axis=1)
    found = np.linalg.lstsq(columns / np.array([1, square.mean(), square.mean() ** 2]), rate, rcond=None)[0]
    return dict(zip(("rate", "cubic", "fifth"), (found / np.array([1, square.mean(), square.mean() ** 2])).tolist()))


def _theory(base, path: Path) -> dict:
    """Onset density, normal form there in terms of the lip's amplitude, and eigenvalues of the steady state over the
    density.
    """
    if path.exists():
        return json.loads(path.read_text())
    from scipy.optimize import brentq

    from dbvfiv.case.parameters import Mu
    from dbvfiv.studies.onset.search import normal_form
    from dbvfiv.studies.stability.walk import StabilityWalk

    walk = StabilityWalk(base)

    def leading(density: float) -> complex:
        return complex(walk.spectrum(Mu.of(base).at(density=density)).eigenvalues[0])

    values = np.unique(np.concatenate([np.geomspace(1.2, 100, 40), np.linspace(50, 60, 11)]))
    found = [leading(v) for v in values]
    lost = np.flatnonzero(np.diff(np.sign([v.real for v in found])))
    if len(lost) != 1:
        raise SystemExit(
            f"The steady state changes stability {len(lost)} times between 1.2 and 100 kg/m3; this study is "
            f"for one onset."
        )
    onset = brentq(lambda v: leading(v).real, values[lost[0]], values[lost[0] + 1], rtol=1e-10)
    place = Mu.of(base).at(density=onset)
    form = normal_form(base, walk, place, walk.spectrum(place).mode(0), "density")
    model = dbvfiv.load(base).model
    lip = model.shell.dofs.index[model.mesh.rows[0, 0], 1]
    share = abs(form.q[lip])
    theory = {
        "density": onset,
        "frequency": form.omega / (2 * np.pi),
        "criticality": form.criticality,
        # slope of the eigenvalue, and cubic coefficient for A = 2 |z| |q_lip|: dA/dt = (slope (density - onset) + cubic
        # A^2) A
        "slope": [form.crossing.real, form.crossing.imag],
        "cubic": [form.c1.real / (2 * share) ** 2, form.c1.imag / (2 * share) ** 2],
        # mean of the lip over a cycle less the steady opening, per A^2
        "mean": float(form.h11[lip].real) / (2 * share) ** 2,
        "steady_opening": float(form.u[lip].real),
        "densities": values.tolist(),
        "growth": [v.real for v in found],
        "frequencies": [abs(v.imag) / (2 * np.pi) for v in found],
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(theory, indent=1) + "\n")
    return theory


def _text(value) -> str:
    return f"{value:.6g}" if isinstance(value, (float, np.floating)) else str(value)


def _write(path: Path, rows: list[dict]) -> None:
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS)
        writer.writeheader()
        writer.writerows({key: _text(value) for key, value in row.items()} for row in rows)


if __name__ == "__main__":
    sys.exit(main())
