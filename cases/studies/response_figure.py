"""Figure of the response to density: amplitude and extremes of the lip, frequency and growth rates."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from dbvfiv.plots.style import ACCENT, COMPUTED, PUBLISHED, REST, new_figure, style

MARKS = {"down": ("v", COMPUTED), "up": ("^", ACCENT)}


def draw(rows: list[dict], theory: dict, path: Path) -> None:
    """Draw rows of the study; with the onset, its normal form and the eigenvalues where these are known."""
    with style():
        figure = new_figure(7.4, 8.6)
        size, frequency, growth = figure.subplots(3, 1, sharex=True, gridspec_kw={"height_ratios": [3, 1.6, 1.6]})
        for way, (mark, colour) in MARKS.items():
            chosen = [r for r in rows if r["way"] == way]
            label = f"density going {way}"
            for settled in (True, False):
                some = [r for r in chosen if (r["verdict"] in ("limit cycle", "steady")) == settled]
                look = {"color": colour} if settled else {"markeredgecolor": colour, "markerfacecolor": "none", "ls": "none"}
                x = [r["density"] for r in some]
                size.plot(x, [1e3 * r["amplitude"] for r in some], mark, ls="none", label=label if settled else f"{label}, not settled", **{k: v for k, v in look.items() if k != "ls"})
                moving = [r for r in some if r["frequency"] and r["amplitude"] > 1e-5]
                frequency.plot([r["density"] for r in moving], [r["frequency"] for r in moving], mark, ls="none", **{k: v for k, v in look.items() if k != "ls"})
            fitted = [r for r in chosen if r["growth_rate"]]
            growth.plot([r["density"] for r in fitted], [r["growth_rate"]["rate"] for r in fitted], mark, ls="none", color=colour, label=f"amplitudes of the runs, {way}")
        touching = sorted(r["density"] for r in rows if r["stops"])
        if touching:
            size.axvspan(0, touching[-1], color="0.93", zorder=0)
            size.annotate("lips touch", (touching[-1], 0.96), xycoords=("data", "axes fraction"), xytext=(-4, 0), textcoords="offset points", ha="right", va="top", color=REST)
        if theory:
            _theory(size, frequency, growth, theory)
        size.set_ylabel("Amplitude of the lip, mm")
        size.set_ylim(bottom=0)
        size.legend(loc="best")
        frequency.set_ylabel("Frequency, Hz")
        growth.set_ylabel("Growth rate, 1/s")
        growth.set_xlabel("Density of the fluid, kg/m³")
        growth.legend(loc="best")
        size.set_title("Response to density", loc="left", fontweight="bold")
        figure.savefig(path, dpi=120)


def _theory(size, frequency, growth, theory: dict) -> None:
    onset, (slope, turn), (cubic, bend) = theory["density"], theory["slope"], theory["cubic"]
    side = np.sign(slope)  # of the densities beyond the onset
    beyond = onset + side * np.linspace(0.0, 0.35 * onset, 200)
    square = np.maximum(-slope * (beyond - onset) / cubic, 0.0)
    size.plot(beyond, 1e3 * np.sqrt(square), color=PUBLISHED, lw=1.2, ls="--", label="normal form at the onset", zorder=1)
    size.axvline(onset, color=REST, lw=0.8)
    frequency.plot(beyond, theory["frequency"] + (turn * (beyond - onset) + bend * square) / (2 * np.pi), color=PUBLISHED, lw=1.2, ls="--", zorder=1)
    low, high = frequency.get_ylim()
    frequency.plot(theory["densities"], theory["frequencies"], color=REST, lw=1.0, label="leading mode of the steady state", zorder=1)
    frequency.set_ylim(min(low, 0.99 * theory["frequency"]), max(high, 1.01 * theory["frequency"]))
    frequency.legend(loc="best")
    growth.plot(theory["densities"], theory["growth"], color=REST, lw=1.0, label="leading eigenvalue", zorder=1)
    growth.axhline(0.0, color=REST, lw=0.6)
    for axes in (frequency, growth):
        axes.axvline(onset, color=REST, lw=0.8)
