"""Figure of the response to density: amplitude, frequency and growth rates."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from dbvfiv.drawing.style import ACCENT, COMPUTED, PUBLISHED, REST, new_figure, style

MARKS = {"down": ("v", COMPUTED), "up": ("^", ACCENT)}


def draw(rows: list[dict], theory: dict, path: Path) -> None:
    """Draw rows of the study; with the onset, its normal form and the eigenvalues where these are known."""
    with style():
        figure = new_figure(7.4, 8.6)
        size, frequency, growth = figure.subplots(3, 1, sharex=True, gridspec_kw={"height_ratios": [3, 1.6, 1.6]})
        for row in rows:
            mark, colour = MARKS[row["way"]]
            kind = _kind(row["verdict"])
            look = {"marker": "X" if kind == "irregular" else mark, "ls": "none", "color": colour}
            if kind == "on the way":
                look |= {"markerfacecolor": "none"}
            size.plot(row["density"], 1e3 * row["amplitude"], **look)
            if row["frequency"] and row["amplitude"] > 1e-4 and kind != "irregular":
                frequency.plot(row["density"], row["frequency"], **look)
            if row["growth_rate"]:
                growth.plot(row["density"], row["growth_rate"]["rate"], **look)
            if kind == "on the way" and limit(row) is not None:
                size.plot(row["density"], 1e3 * limit(row), "_", color=colour, ms=11, mew=2)
        _legend(size)
        touching = max((row["density"] for row in rows if row["stops"]), default=None)
        if touching:
            size.axvspan(0, touching, color="0.94", zorder=0)
            size.annotate(
                "lips touch",
                (touching, 0.03),
                xycoords=("data", "axes fraction"),
                xytext=(-5, 0),
                textcoords="offset points",
                ha="right",
                color=REST,
            )
        size.set_xlim(0, 1.05 * max(row["density"] for row in rows))
        if theory:
            _theory(size, frequency, growth, theory)
            growth.legend(loc="best")
            frequency.legend(loc="best")
        size.set_ylabel("Amplitude of the lip, mm")
        size.set_ylim(bottom=0)
        frequency.set_ylabel("Frequency, Hz")
        growth.set_ylabel("Growth rate, 1/s")
        growth.set_xlabel("Density of the fluid, kg/m³")
        size.set_title("Response to density", loc="left", fontweight="bold")
        figure.savefig(path, dpi=100)


def _kind(verdict: str) -> str:
    return (
        "settled"
        if verdict in ("limit cycle", "steady")
        else "irregular"
        if verdict.startswith("irregular")
        else "on the way"
    )


def limit(row: dict) -> float | None:
    """Amplitude, m, that the fitted amplitude equation of a run on its way leads to; zero where it dies out, None if
    the fit does not tell.
    """
    fit = row["growth_rate"]
    if not fit:
        return None
    if fit["rate"] < 0:
        return 0.0
    squares = [
        root.real
        for root in np.roots([fit["fifth"], -fit["cubic"], fit["rate"]])
        if abs(root.imag) < 1e-12 and root.real > 0
    ]
    return float(np.sqrt(min(squares))) if squares else None


def _legend(axes) -> None:
    grey = {"ls": "none", "color": "0.3"}
    for label, look in (
        ("density going down", {"marker": "v", "ls": "none", "color": COMPUTED}),
        (("density going up"), {"marker": "^", "ls": "none", "color": ACCENT}),
        ("on the way when the run ended", {"marker": "v", "markerfacecolor": "none", **grey}),
        (("where it leads to"), {"marker": "_", "ms": 11, "mew": 2, **grey}),
        ("irregular", {"marker": "X", **grey}),
        ("normal form at the onset", {"color": PUBLISHED, "lw": 1.2, "ls": "--"}),
    ):
        axes.plot([], [], label=label, **look)
    axes.legend(loc="upper right")


def _theory(size, frequency, growth, theory: dict) -> None:
    onset, (slope, turn), (cubic, bend) = theory["density"], theory["slope"], theory["cubic"]
    side = np.sign(slope)  # of the densities at which the steady state is unstable
    beyond = onset + side * np.linspace(0.0, 0.35 * onset, 200)
    square = np.maximum(-slope * (beyond - onset) / cubic, 0.0)
    size.plot(beyond, 1e3 * np.sqrt(square), color=PUBLISHED, lw=1.2, ls="--", zorder=1)
    frequency.plot(
        beyond,
        theory["frequency"] + (turn * (beyond - onset) + bend * square) / (2 * np.pi),
        color=PUBLISHED,
        lw=1.2,
        ls="--",
        zorder=1,
    )
    frequency.plot(
        theory["densities"],
        theory["frequencies"],
        color=REST,
        lw=1.0,
        label="leading mode of the steady state",
        zorder=1,
    )
    frequency.set_ylim(0.88 * theory["frequency"], 1.02 * theory["frequency"])
    growth.plot(
        theory["densities"],
        theory["growth"],
        color=REST,
        lw=1.0,
        label="leading eigenvalue; marks: amplitudes of the runs",
        zorder=1,
    )
    growth.axhline(0.0, color=REST, lw=0.6)
    for axes in (size, frequency, growth):
        axes.axvline(onset, color=REST, lw=0.8)
