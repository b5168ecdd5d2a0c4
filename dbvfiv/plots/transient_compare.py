"""Several runs in one figure."""
from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Sequence

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from ..errors import CaseError
from .style import new_figure, style

if TYPE_CHECKING:
    from ..transient.result import TransientResults


def differing_keys(results: "Sequence[TransientResults]") -> list[str]:
    """Keys of the cases that are not the same in all runs, those that only steer the run left out."""
    flat = [_flat(result.case.to_dict()) for result in results]
    keys = [key for key in flat[0] if any(case.get(key) != flat[0][key] for case in flat)]
    quiet = ("transient.save_every", "transient.restart_every", "transient.stop_when", "transient.duration")
    return [key for key in keys if key not in quiet]


def labels(results: "Sequence[TransientResults]") -> list[str]:
    """Legend entries that say what tells the runs apart."""
    keys = differing_keys(results)[:3]
    if not keys:
        return [result.path.stem if result.path else result.header.name for result in results]
    found = []
    for result in results:
        flat = _flat(result.case.to_dict())
        found.append(", ".join(f"{key.split('.')[-1]} {_text(flat.get(key))}" for key in keys))
    return found


def compare(results: "Sequence[TransientResults]") -> Figure:
    """Mass flow and lip opening of several runs over time (compare Figs. 5-3 to 5-10, 7-13 and 7-14 of Wang 2014)."""
    figure = new_figure(8.0, 6.2)
    flow, lip = figure.subplots(2, 1, sharex=True)
    colours = matplotlib.colormaps["viridis"](np.linspace(0.0, 0.85, len(results)))
    styles = ["-", "--", "-.", ":"]
    for i, (result, label, colour) in enumerate(zip(results, labels(results), colours)):
        h = result.history
        verdict = f"{label}: {result.verdict['verdict']}"
        flow.plot(h["time"], h["mass_flow"], styles[i % 4], color=colour, lw=1.4, label=verdict)
        lip.plot(h["time"], 1e3 * h["lip_opening"], styles[i % 4], color=colour, lw=1.4)
    flow.set_ylabel("Mass flow, kg/s")
    lip.set_ylabel("Lip opening, mm")
    lip.set_xlabel("Time, s")
    lip.set_xlim(left=min(r.history["time"][0] for r in results), right=max(r.history["time"][-1] for r in results))
    flow.legend(loc="center left", bbox_to_anchor=(1.01, 0.5))
    flow.set_title("Comparison of runs", loc="left", fontweight="bold")
    return figure


def save_comparison(results: "Sequence[TransientResults]", path: Path) -> Path:
    """Draw a comparison into a file.

    Raises
    ------
    CaseError
        If the file cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with style():
            compare(results).savefig(path)
    except (OSError, ValueError) as error:
        raise CaseError(f"{str(path)!r} cannot be written ({error}).") from error
    return path


def _flat(data, prefix: str = "") -> dict:
    if isinstance(data, dict):
        found = {}
        for key, value in data.items():
            found |= _flat(value, f"{prefix}.{key}" if prefix else key)
        return found
    return {prefix: data}


def _text(value) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)
