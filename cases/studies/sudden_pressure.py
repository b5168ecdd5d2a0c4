"""Water, pressure applied at once to the valve at rest: does every run end in the steady state, and what does its end
not depend on?

Runs (after Th. 5.3): pressures from 2 to 50 kPa at alpha 5, beta 0.003; the unsteady law of the flow against the steady
one at 36 kPa (Fig. 5-10); meshes (Fig. 5-3), steps (Fig. 5-4), beta (Fig. 5-5), alpha (Fig. 5-6) and numerical damping
(Fig. 5-7) at alpha 3 otherwise. Each run is kept in a file of the folder, so that a study that is started again goes on
where it was. It ends with pressures.csv, sensitivity.csv and two figures.

    python cases/studies/sudden_pressure.py out/sudden
"""

from __future__ import annotations

import argparse
import csv
import sys
from pathlib import Path

import numpy as np
from kept import base_case, kept_run, takes_keys

import dbvfiv
from dbvfiv.drawing.style import ACCENT, COMPUTED, PUBLISHED, REST, new_figure, style

PRESSURES = (2, 6, 12, 18, 24, 29, 36, 50)  # kPa
MARK, CLOSE = 0.5, 1e-4  # s; relative distance to the steady flow
ALPHA_5 = {"damping.alpha": 5, "damping.beta": 0.003}
ALPHA_3 = {"damping.alpha": 3, "damping.beta": 0.003}

#: Groups of runs that differ in one thing: title, common changes, and what differs by name.
GROUPS = {
    "law": (
        "Flow with and without its unsteady term, 36 kPa, alpha 0 (Fig. 5-10)",
        {"drive.pressure": 36e3, "damping.alpha": 0, "damping.beta": 0.003},
        {
            "unsteady": {},
            "steady": {"fluid.unsteady": False},
            "steady, beta 0.004 s": {
                "fluid.unsteady": False,
                "damping.beta": 0.004,
                "transient.numerical_damping": 0.1,
            },
        },
    ),
    "mesh": (
        "Mesh, 36 kPa (Fig. 5-3)",
        {"drive.pressure": 36e3} | ALPHA_3,
        {
            f"{a} x {b}": {"mesh.around": a, "mesh.along": b}
            for a, b in ((5, 8), (10, 24), (14, 24), (28, 48), (36, 64))
        },
    ),
    "step": (
        "Step, 29 kPa (Fig. 5-4)",
        {"drive.pressure": 29e3} | ALPHA_3,
        {f"{step} ms": {"transient.step": f"{step} ms"} for step in ("2", "1", "0.5", "0.2")},
    ),
    "beta": (
        "Stiffness damping, 36 kPa (Fig. 5-5)",
        {"drive.pressure": 36e3} | ALPHA_3,
        {f"{beta:g} s": {"damping.beta": beta} for beta in (0.003, 0.01, 0.02)},
    ),
    "alpha": (
        "Mass damping, 36 kPa (Fig. 5-6)",
        {"drive.pressure": 36e3} | ALPHA_3,
        {f"{alpha} 1/s": {"damping.alpha": alpha} for alpha in (1, 3, 5)},
    ),
    "numerical": (
        "Numerical damping, 36 kPa (Fig. 5-7)",
        {"drive.pressure": 36e3} | ALPHA_3,
        {f"{nd:g}": {"transient.numerical_damping": nd} for nd in (0.0, 0.1, 0.3, 0.5)},
    ),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="for runs, tables and figures")
    parser.add_argument("--mesh", default="28x48")
    parser.add_argument("--duration", default="1 s", help="of the runs at different pressures; the others take 0.5 s")
    parser.add_argument("--only", nargs="+", default=["pressures", *GROUPS], choices=["pressures", *GROUPS])
    takes_keys(parser)
    given = parser.parse_args()
    around, along = given.mesh.split("x")
    base = base_case(given).replace({"mesh.around": int(around), "mesh.along": int(along), "transient.duration": MARK})
    if "pressures" in given.only:
        rows, runs = pressures(base.replace(ALPHA_5 | {"transient.duration": given.duration}), given.folder)
        _write(given.folder / "pressures.csv", rows)
        draw_pressures(rows, runs, given.folder / "sudden-pressure.png")
    rows, groups = [], {}
    for name in (name for name in GROUPS if name in given.only):
        title, common, members = GROUPS[name]
        groups[title] = {}
        for member, changes in members.items():
            run = kept_run(
                base.replace(common | changes),
                given.folder / f"{name}-{member.replace(' ', '').replace(',', '-').replace('/', '-per-')}.h5",
            )
            groups[title][member] = run
            rows.append({"group": name, "member": member} | _row(run))
            print(_line(rows[-1]), flush=True)
    if rows:
        _write(given.folder / "sensitivity.csv", rows)
        draw_groups(groups, given.folder / "sudden-sensitivity.png")


def pressures(base, folder: Path) -> tuple[list[dict], dict]:
    """Rows and runs of the pressures, with the eigenvalue that limits how fast the last of the difference can go."""
    rows, runs = [], {}
    for kilo in PRESSURES:
        case = base.replace({"drive.pressure": 1e3 * kilo})
        runs[kilo] = run = kept_run(case, folder / f"pressure-{kilo}.h5")
        slowest = dbvfiv.load(case).modes(count=2).modes[0]
        rows.append(
            {"pressure": kilo} | _row(run) | {"growth_rate": slowest.growth_rate, "mode_frequency": slowest.frequency}
        )
        print(_line(rows[-1]), flush=True)
    return rows, runs


def _row(run) -> dict:
    """Numbers of a run; kg/s, s."""
    time, flow = run.history["time"], run.history["mass_flow"]
    steady = dbvfiv.load(run.case).steady(run.case.drive.pressure).mass_flow
    off = np.abs(flow / steady - 1.0)
    late = np.flatnonzero(off > CLOSE)
    settled = time[late[-1] + 1] if late[-1] + 1 < len(time) else np.nan
    at = int(np.argmin(np.abs(time - MARK)))
    opened = time >= time[np.argmax(flow > 0.5 * steady)]
    return {
        "mass_flow": flow[at],
        "steady": steady,
        "difference": flow[at] / steady - 1.0,
        "settled": settled,
        "end": flow[-1] / steady - 1.0,
        "overshoot": max(0.0, float(flow.max() / steady - 1.0)),
        "monotone": bool(np.all(np.diff(flow[opened]) > -1e-7 * steady)),
        "smallest": flow.min() / steady,
        "verdict": run.verdict["verdict"],
        "lip": run.history["lip_displacement"][at],
        "evaluations": int(run.history["evaluations"].sum()),
        "balance": np.abs(run.history["balance"]).max() / run.history["pressure_work"].max(),
    }


def draw_pressures(rows: list[dict], runs: dict, path: Path) -> None:
    """Mass flow over time and its distance to the steady state, with the slope of the slowest mode."""
    with style():
        figure = new_figure(9.4, 4.2)
        flow, distance = figure.subplots(1, 2)
        colours = _colours(len(rows))
        for row, colour in zip(rows, colours):
            h = runs[row["pressure"]].history
            flow.plot(h["time"], h["mass_flow"] / row["steady"], color=colour, lw=1.4, label=f"{row['pressure']} kPa")
            distance.semilogy(
                h["time"], np.maximum(np.abs(h["mass_flow"] / row["steady"] - 1.0), 1e-10), color=colour, lw=1.4
            )
            t = np.array([0.2, 0.9])
            at = int(np.argmin(np.abs(h["time"] - 0.35)))
            level = abs(h["mass_flow"][at] / row["steady"] - 1.0)
            distance.semilogy(
                t, level * np.exp(row["growth_rate"] * (t - h["time"][at])), color="black", lw=1.0, ls=":"
            )
        flow.set(xlabel="Time, s", ylabel="Mass flow over that of the steady state", xlim=(0, 0.6), ylim=(0, 1.1))
        flow.legend(loc="lower right", ncols=2)
        distance.axhline(CLOSE, color=REST, lw=0.8)
        distance.axvline(MARK, color=REST, lw=0.8)
        distance.set(xlabel="Time, s", ylabel="Relative distance to the steady state", ylim=(1e-8, 2))
        flow.set_title("Water, pressure applied at once", loc="left", fontweight="bold")
        distance.set_title("dotted: decay of the slowest mode", loc="left")
        figure.savefig(path, dpi=90)


def draw_groups(groups: dict, path: Path) -> None:
    """One panel for each thing that was varied."""
    with style():
        columns = 2 if len(groups) > 1 else 1
        lines = -(-len(groups) // columns)
        figure = new_figure(9.4, 2.9 * lines)
        panels = np.atleast_1d(figure.subplots(lines, columns, squeeze=False)).ravel()
        for panel in panels[len(groups) :]:
            panel.remove()
        for panel, (title, members) in zip(panels, groups.items()):
            looks = zip((COMPUTED, PUBLISHED, ACCENT, REST, "black"), ("-", "--", "-.", ":", "-"))
            for (name, run), (colour, dash) in zip(members.items(), looks):
                panel.plot(run.history["time"], run.history["mass_flow"], color=colour, ls=dash, lw=1.3, label=name)
            panel.set_title(title, loc="left", fontsize=9)
            panel.set_xlim(0, MARK)
            panel.legend(loc="lower right", fontsize=8, frameon=True, framealpha=0.85, edgecolor="none")
        for panel in panels[::columns]:
            panel.set_ylabel("Mass flow, kg/s")
        for panel in panels[: len(groups)][-columns:]:
            panel.set_xlabel("Time, s")
        figure.savefig(path, dpi=80)


def _colours(count: int):
    import matplotlib

    return matplotlib.colormaps["viridis"](np.linspace(0.0, 0.9, count))


def _text(value) -> str:
    return f"{value:.8g}" if isinstance(value, (float, np.floating)) else str(value)


def _line(row: dict) -> str:
    return ", ".join(f"{key} {_text(value)}" for key, value in row.items())


def _write(path: Path, rows: list[dict]) -> None:
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows({key: _text(value) for key, value in row.items()} for row in rows)


if __name__ == "__main__":
    sys.exit(main())
