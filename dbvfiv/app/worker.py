"""Process of its own for one valve: takes questions as lines of JSON, answers them likewise; between them it prepares.

``python -m dbvfiv.app.worker``; a page talks to it through `dbvfiv.app.processes`.
"""

from __future__ import annotations

import base64
import contextlib
import csv
import ctypes
import gc
import io
import json
import os
import queue
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from ..api import Valve, load
from ..case.section import Section
from ..case.units import UNITS
from ..case.write import case_toml
from ..drawing.style import put_in_units, style
from ..drawing.views import ValveSkin, valve_figure
from ..errors import CaseError, SolveError
from ..explore import Answer, Explorer
from ..model.equilibria import model_warnings
from ..model.sizes import ValveSizes
from ..model.symmetry import symmetry_named
from ..record.files import reading
from ..record.mesh import MeshData
from ..shell.recovery import layer_fields
from ..studies.case import Case
from ..studies.modes.search import drawn_amplitude
from ..studies.session import find_study, load_result
from ..texts import json_value
from .sheet import shown_as, stay_inside

#: Time without a question after which the reduced operator is enriched, s.
IDLE = 0.3


class Desk:
    """Answers to questions on the valve that was opened last.

    Parameters
    ----------
    interrupted : callable
        True where another question waits.
    """

    def __init__(self, interrupted: Callable[[], bool] = lambda: False) -> None:
        self._interrupted = interrupted
        self.valve: Valve | None = None
        self.explorer: Explorer | None = None
        self._last: Answer | None = None

    def describe(self, case: str) -> dict[str, Any]:
        """Drawing, sizes and warnings of a case file."""
        model = load(case).session.described
        units = model.case.units
        with style():
            put_in_units(valve_figure(model), units).savefig(drawn := io.BytesIO(), format="png", dpi=90)
        picture = base64.b64encode(drawn.getvalue()).decode()
        sizes, notes = (list(map(units.say, told)) for told in (ValveSizes.of(model).lines(), model_warnings(model)))
        return {"picture": picture, "sizes": sizes, "notes": notes}

    def header(self, path: str, inside: bool = False) -> dict[str, str]:
        """Kind of a result file, and its case as TOML; one that has to stay inside its folder names no other files."""
        if inside:
            with reading(path) as file:
                stay_inside(json.loads(file["case/json"].asstr()[()]), runs=False)
        found = load_result(path)
        return {"kind": found.kind, "case": text_for_page(found.header.case)}

    def open(self, case: str) -> dict[str, Any]:
        """Open a case file; the parameters that can be moved, SI, with their rows of the table, and units with their
        SI values by quantity.
        """
        self.valve = self.explorer = self._last = None  # one valve at a time
        self.valve = load(case)
        self.explorer = found = self.valve.explore()
        found.interrupted = self._interrupted
        rows = {}
        for name, (low, high) in found.ranges.items():
            rows[name] = shown_as(found.case, name, found.ranges)
            rows[name] |= {"low": low, "high": high, "own": found.base[name], "moves": found.moves(name)}
        units = found.case.units
        return {"parameters": rows, "units": {one: (units.name(one), units.factor(one)) for one in UNITS}}

    def predict(self, values: dict[str, float]) -> dict[str, Any]:
        """Prediction of the reduced operator."""
        return self._explorer.predict(**values).summary()

    def bounded(self, values: dict[str, float]) -> dict[str, Any]:
        """Prediction of the reduced operator with its bound."""
        return self._explorer.bounded(**values).summary()

    def displacements(self, values: dict[str, float]) -> np.ndarray:
        """Displacements of the steady state of a point, from which another process finds it at once."""
        return self._explorer.state(self._explorer.place(values)).q

    def confirm(self, values: dict[str, float], near: list[float]) -> dict[str, Any]:
        """Answer of the full operator, whose steady state is found from displacements near it."""
        self._explorer.walk.settle(self._explorer.place(values), np.array(near))
        self._last = self._explorer.confirm(**values)
        return self._last.summary()

    def margin(self, values: dict[str, float]) -> dict[str, Any]:
        """The answer of the full operator with its margin of damping; another page may have asked for another one
        since it was confirmed.
        """
        if self._last is None or self._last.place != self._explorer.place(values):
            self._last = self._explorer.confirm(**values)
        return self._explorer.with_margin(self._last).summary()

    @property
    def _explorer(self) -> Explorer:
        if self.explorer is None:
            raise CaseError("No valve is open.")
        return self.explorer

    def shape(self, values: dict[str, float]) -> dict[str, Any]:
        """Skin of the whole valve at a point: corners, m, triangles, and what it can be coloured by at the corners."""
        explorer = self._explorer
        state, mesh = explorer.state(explorer.place(values)), MeshData.of(explorer.model)
        skin, found = ValveSkin.of(mesh), layer_fields(explorer.model.shell, state.q)
        colours = {"Displacement, mm": 1e3 * np.linalg.norm(state.nodal[:, :3], axis=1)}
        often = np.bincount(mesh.quads.ravel(), minlength=len(mesh.nodes))
        for number, (name, stretch) in enumerate(zip(mesh.layer_titles(), found.stretch[:, :, 1].T), 1):
            summed = np.bincount(mesh.quads.ravel(), np.repeat(stretch, 4), len(mesh.nodes))
            colours[f"Largest strain of {number} {name}, %"] = 100 * (summed / often - 1)
        points = np.round(skin.points(state.nodal), 5)
        whole = {name: np.round(skin.spread(field), 4) for name, field in colours.items()}
        return {"points": points, "triangles": skin.triangles, "colours": whole}

    def motion(self, values: dict[str, float], frames: int = 12) -> dict[str, Any]:
        """One cycle of the leading mode that oscillates, as corners of the skin, m, with a sentence on it."""
        rest = dict(values)
        found = self.valve.modes(rest.pop("pressure", None), **rest)
        mode = next((mode for mode in found.modes if mode.frequency > 0), None)
        if mode is None:
            raise CaseError("No mode that is listed oscillates.")
        skin, most = ValveSkin.of(found.mesh), drawn_amplitude(found.state, mode)
        parity = symmetry_named(mode.symmetry).parity(skin.valve.sign)
        turns = (most * mode.at_phase(2 * np.pi * i / frames) for i in range(frames))
        moved = [np.round(skin.moving_points(found.state.nodal, turn, parity), 5) for turn in turns]
        said = f"Mode of {mode.frequency:.4g} Hz, growth rate {mode.growth_rate:.4g} 1/s"
        return {"frames": moved, "text": said}

    def result(self, path: str, figures: str) -> dict[str, Any]:
        """Text, figures and tables of a result file, these written into a folder."""
        found, folder = load_result(path), Path(figures)
        folder.mkdir(exist_ok=True)
        drawn = found.plot(folder) if found.drawable else []
        tables = [write_table(found, spec, folder) for spec in find_study(found.kind).tables(found.mesh)]
        said = [found.case.units.say(line) for line in found.lines()]
        names = {"figures": [file.name for file in drawn], "tables": [file.name for file in tables if file]}
        summary = found.summary() if found.kind == "map" else {}
        return {"kind": found.kind, "lines": said, "complete": found.complete, "summary": summary} | names


def text_for_page(case: Case) -> str:
    """A case as TOML, with the usual number of processes in place of those that made its result."""
    usual = {
        f"{name}.workers": part.model_fields["workers"].default
        for name, part in ((name, type(part)) for name, part in case)
        if issubclass(part, Section) and "workers" in part.model_fields
    }
    return case_toml(case.replace(usual), comments=False)


def write_table(result: Any, spec: Any, folder: Path) -> Path | None:
    """Columns with one number a row of a table of a result as CSV; None where there are no rows."""
    columns = [c for c in spec.columns if spec.shape(c) == ()]
    if not columns or not result.record.rows(spec.name):
        return None
    path = folder / f"{spec.name}.csv"
    with open(path, "w", newline="", encoding="utf-8") as file:
        out = csv.writer(file)
        out.writerow([f"{c.name} [{c.units}]" if c.units else c.name for c in columns])
        out.writerows(zip(*(result.record.column(spec.name, c.name) for c in columns)))
    return path


def answer(desk: Desk, question: dict[str, Any]) -> dict[str, Any]:
    """Answer to a question; what goes wrong as a sentence."""
    number, name = question.pop("id"), question.pop("do")
    try:
        return {"id": number, "answer": json_value(getattr(desk, name)(**question))}
    except (CaseError, SolveError) as error:
        return {"id": number, "error": str(error)}
    except Exception as error:  # told on the page; the next question may be a better one
        return {"id": number, "error": f"The program failed unexpectedly ({type(error).__name__}: {str(error)[:200]})."}


def main() -> None:
    """Answer questions until standard input ends."""
    out = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)  # whatever else prints
    asked: queue.Queue[str | None] = queue.Queue()

    def listen() -> None:
        for line in sys.stdin:
            asked.put(line)
        asked.put(None)

    threading.Thread(target=listen, daemon=True).start()
    desk, idle = Desk(lambda: not asked.empty()), True
    while True:
        try:
            line = asked.get(timeout=IDLE if idle else 3600.0)
        except queue.Empty:
            try:
                idle = desk.explorer is not None and desk.explorer.prepare()
            except Exception:  # nobody asked for it; the question that comes to it is told
                idle = False
            if not idle:
                give_back()
            continue
        if line is None:
            return
        print(json.dumps(answer(desk, json.loads(line))), file=out, flush=True)
        idle = True


def give_back() -> None:
    """Give memory that is free back to the system, where its library can."""
    gc.collect()
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).malloc_trim(0)


if __name__ == "__main__":
    main()
