"""Questions to a valve by sliders: the reduced operator answers, the full one confirms."""

from __future__ import annotations

import asyncio
import contextlib
import time
from pathlib import Path
from typing import Any

from nicegui import ui

from ..case.parameters import PARAMETERS
from ..errors import CaseError
from ..studies.stability.verdict import STABLE

#: Steps of a slider; time for which it rests before more than the prediction is computed, s.
STEPS, REST = 400, 0.25
#: Numbers that an answer shows: title, entry of the state and quantity.
NUMBERS = (
    ("Opening", "lip_opening", "size"),
    ("Flow", "volume_flow", "flow"),
    ("Jet", "outlet_velocity", "velocity"),
    ("Passage", "outlet_area", "area"),
)


class AskPanel:
    """Sliders and the answer beside.

    Attributes
    ----------
    values : dict
        Values of the sliders, SI.
    answers : int
        Number of predictions that were shown.
    """

    def __init__(self, page: Any):
        self.page = page
        self.values: dict[str, float] = {}
        self.answers = 0
        self._file: Path | None = None
        self._wanted: dict[str, float] = {}
        self._drawn = False
        self._rows: dict[str, dict] = {}
        self._units: dict[str, tuple[str, float]] = {}
        self._boxes: dict[str, tuple[ui.slider, ui.number]] = {}
        self._moved = asyncio.Event()
        self._since = 0.0
        self._task: asyncio.Task | None = None
        self._confirming: asyncio.Task | None = None

    def build(self) -> None:
        """Draw the panel."""
        with ui.element("div").classes("columns"):
            with ui.column():
                self._status = ui.label("").classes("note").props('data-at="status"')
                self._sliders = ui.column().classes("full")
            with ui.column() as self._card:
                self._verdict = ui.label("").style("font-size: 1.2rem").props('data-at="verdict"')
                self._mark = ui.label("").classes("note").props('data-at="mark"')
                self._reason = ui.label("").classes("note")
                with ui.element("div").classes("numbers"):
                    self._numbers = {name: self._number(title) for title, name, *_ in NUMBERS}
                    self._margin = self._number("Least damping ratio")
                    self._factor = self._number("Flutter")
                self._modes = ui.table(
                    columns=[
                        {"name": "growth", "label": "Growth rate, 1/s", "field": "growth"},
                        {"name": "frequency", "label": "Frequency, Hz", "field": "frequency"},
                    ],
                    rows=[],
                )
                self._modes.classes("full").props("dense")
                with ui.row():
                    ui.button("Show the shape", on_click=self._shape).props("flat")
                    ui.button("Animate the leading mode", on_click=self._animate).props("flat")
                self._scene = ui.column().classes("full")

    @staticmethod
    def _number(title: str) -> ui.label:
        with ui.element("div").classes("number"):
            shown = ui.html("<b>–</b>", sanitize=False)
            ui.label(title).classes("note")
        return shown

    def open(self, values: dict[str, float] | None = None) -> None:
        """Open the valve of the page, unless it is open; values to ask it at, those of the case for what they lack."""
        file = self.page.file
        if file is None:
            self._status.text = "The valve does not fit yet; see Describe."
            return
        if self._task is not None and not self._task.done() and file == self._file:
            if values is not None:
                self._wanted = values  # at which a valve that is being built is asked then
                if self._drawn:
                    self._go_there()
            return
        if self._task is not None:
            self._task.cancel()
        self._file, self._wanted, self._drawn = file, values or {}, False
        self._task = asyncio.create_task(self._follow(file))

    def values_of(self, file: Path | None) -> dict[str, float]:
        """Values of the sliders, SI, where they are those of a case file; empty where it is another."""
        return self.values if file == self._file else {}

    def go(self, values: dict[str, float]) -> None:
        """Move sliders to values, SI, as far as they reach."""
        for name, value in values.items():
            if name in self._boxes:
                row, (slider, box) = self._rows[name], self._boxes[name]
                self.values[name] = min(max(value, row["low"]), row["high"])
                slider.value = box.value = self.values[name] / row["scale"]

    def _go_there(self) -> None:
        """Move the sliders to the values that are wanted, the others to those of the case; where a slider does not
        reach its value that is told, and none moves.
        """
        for name, value in self._wanted.items():
            row = self._rows.get(name)
            if row is None:
                said = f"{PARAMETERS[name].title} cannot be moved here, so that the valve is not asked there."
            else:
                reach = (row["high"] - row["low"]) / STEPS
                if row["low"] - reach <= value <= row["high"] + reach:
                    continue
                low, high, given = (f"{number / row['scale']:.4g}" for number in (row["low"], row["high"], value))
                said = f"{row['title']} reaches from {low} to {high} {row['unit']} here, so that {given} is not asked."
            with self._card:
                self.page.tell(said)
            return
        self.go({name: row["own"] for name, row in self._rows.items()} | self._wanted)

    async def _follow(self, file: Path) -> None:
        """Answer moves of the sliders, the last one always, until another valve is opened."""
        predictor, confirmer = self.page.site.workers.of(file, self)
        self._status.text = "The valve is being built; the first answer takes longest."
        try:
            found = await predictor.about(file, "open")
        except CaseError as error:
            self._status.text = str(error)
            return
        self._rows, self._units = found["parameters"], found["units"] | {"area": ("cm²", 1e-4)}
        self._draw_sliders()
        self._drawn = True
        self._go_there()
        self._status.text = ""
        self._since = time.monotonic()
        self._moved.set()
        while True:
            await self._moved.wait()
            self._moved.clear()
            try:
                await self._answer(file, predictor, confirmer, dict(self.values))
            except CaseError as error:
                self._verdict.text = str(error)
                self._mark.text = "no answer"

    async def _answer(self, file: Path, predictor: Any, confirmer: Any, values: dict[str, float]) -> None:
        """Predict, give the bound, and confirm, as far as no slider moves meanwhile."""
        since = self._since
        self._show(await predictor.about(file, "predict", values=values))
        seconds = time.monotonic() - since
        self.answers += 1
        self._status.text = f"answered in {seconds:.2f} s"
        self._status.props(f"data-answers={self.answers} data-seconds={seconds:.4f}")
        if await self._is_moved_before(asyncio.create_task(asyncio.sleep(REST))):
            return  # a slider that is being drawn is answered at once: what follows cannot be stopped at any moment
        for step, worker in (("bounded", predictor), ("confirm", confirmer), ("margin", confirmer)):
            if worker is confirmer and await self._is_moved_before(self._confirming):
                return
            question: dict[str, Any] = {"values": values}
            if step == "confirm":
                question["near"] = await predictor.about(file, "displacements", values=values)
            asked = asyncio.create_task(worker.about(file, step, **question))
            asked.add_done_callback(lambda task: task.cancelled() or task.exception())  # told below, or of no use
            self._confirming = asked if worker is confirmer else self._confirming
            if await self._is_moved_before(asked):
                return
            self._show(asked.result(), step == "margin")

    async def _is_moved_before(self, task: asyncio.Task | None) -> bool:
        """Wait for a task; True where a slider moves before it is done."""
        if task is not None and not task.done():
            move = asyncio.create_task(self._moved.wait())
            await asyncio.wait({task, move}, return_when=asyncio.FIRST_COMPLETED)
            move.cancel()
        return self._moved.is_set()

    def _draw_sliders(self) -> None:
        self._sliders.clear()
        self.values = {name: row["own"] for name, row in self._rows.items()}
        self._boxes = {}
        with self._sliders:
            for name, row in self._rows.items():
                scale, step = row["scale"], (row["high"] - row["low"]) / row["scale"] / STEPS
                low, high, own = row["low"] / scale, row["high"] / scale, row["own"] / scale
                moves = " (changes the steady state)" if row["moves"] else ""
                ui.label(label_of(row) + moves).classes("note")
                with ui.row().classes("full").style("flex-wrap: nowrap; align-items: center"):
                    slider = ui.slider(min=low, max=high, step=step, value=own).props(f'data-at="slide {name}"')
                    box = (
                        ui.number(value=own, format="%.4g")
                        .props("dense")
                        .style("width: 90px")
                        .props(f'data-at="set {name}"')
                    )
                slider.on_value_change(lambda event, name=name: self._slid(name, event.value))
                box.on("change", lambda _, name=name, box=box: self._typed(name, box.value))
                self._boxes[name] = slider, box

    def _slid(self, name: str, value: float) -> None:
        value *= self._rows[name]["scale"]
        if abs(value - self.values[name]) > 1e-9 * abs(value):
            self.values[name] = value
        self._boxes[name][1].value = value / self._rows[name]["scale"]
        self._since = time.monotonic()
        self._moved.set()

    def _typed(self, name: str, value: float | None) -> None:
        if value is not None:
            self.go({name: value * self._rows[name]["scale"]})

    def _show(self, found: dict[str, Any], whole: bool = False) -> None:
        """Show an answer; where it is whole, what it lacks is not to be had."""
        verdict, state = found["verdict"], found["state"]
        for _, name, quantity in NUMBERS:
            unit, scale = self._units[quantity]
            shown = f"{_short(state[name] / scale)} {unit}"
            self._numbers[name].content = f"<b data-name='{name}' data-si='{state[name]!r}'>{shown}</b>"
        ratio, margin = verdict["damping_ratio"], verdict["critical_damping_factor"]
        begins, none = ("begins", "none down") if verdict["outcome"] == STABLE else ("ends", "no end up")
        missing = "not known" if whole else "–"
        if (sought := verdict.get("damping_sought")) is not None:
            missing = f"{none} to {sought:.3g} × damping"
        self._margin.content = f"<b>{'–' if ratio is None else f'{100 * ratio:.3g} %'}</b>"
        self._factor.content = f"<b>{missing if margin is None else f'{begins} at {margin:.3g} × damping'}</b>"
        self._verdict.text = verdict["outcome"].capitalize()
        bound = "" if found["bound"] is None else f", within {max(found['bound'], 1e-9):.0e} of an eigenvalue"
        self._mark.text = "confirmed by the full model" if found["confirmed"] else f"predicted{bound}"
        self._reason.text = verdict["reason"]
        self._card.classes(
            add="confirmed" if found["confirmed"] else "predicted",
            remove="predicted" if found["confirmed"] else "confirmed",
        )
        self._modes.rows = [
            {"growth": f"{real:.5g}", "frequency": f"{imaginary / 6.283185307179586:.5g}"}
            for real, imaginary in found["eigenvalues"][:5]
        ]

    async def _asked(self, number: int, do: str) -> Any:
        """Answer of one of the two workers at the values of the sliders; None where there is none, which is told."""
        if self._file is None or not self.values:
            return None
        try:
            return await self.page.site.workers.of(self._file, self)[number].about(self._file, do, values=self.values)
        except CaseError as error:
            self.page.tell(str(error))

    async def _shape(self) -> None:
        """Draw the valve in space at the values of the sliders, coloured by displacement or the strain of a layer."""
        if (found := await self._asked(0, "shape")) is not None:
            self._scene.clear()
            with self._scene:
                names = [*found["colours"]]
                choice = ui.select(names, value=names[0], label="Colour").style("min-width: 240px")
                plot = ui.plotly(_space(found, names[0])).classes("full")
                choice.on_value_change(lambda event: plot.update_figure(_space(found, event.value)))

    async def _animate(self) -> None:
        """Show one cycle of the leading mode that oscillates."""
        self._scene.clear()
        with self._scene:
            waiting = ui.label("The modes are being computed.").classes("note")
        shape, found = await self._asked(0, "shape"), await self._asked(1, "motion")
        if shape is None or found is None:
            waiting.text = ""
            return
        figure = _space(shape, next(iter(shape["colours"])))
        frames = []
        for points in found["frames"]:
            x, y, z = zip(*points)
            frames.append({"data": [{"type": "mesh3d", "x": z, "y": x, "z": y}]})
        play = {"frame": {"duration": 80}, "transition": {"duration": 0}, "fromcurrent": True}
        buttons = [{"label": "Play", "method": "animate", "args": [None, play]}]
        buttons.append({"label": "Stop", "method": "animate", "args": [[None], {"mode": "immediate"}]})
        place = {"direction": "left", "x": 0, "xanchor": "left", "y": 1, "yanchor": "top"}
        figure["layout"]["updatemenus"] = [{"type": "buttons", "buttons": buttons} | place]
        figure["frames"] = [{"name": str(i), **frame} for i, frame in enumerate(frames * 6)]
        waiting.text = found["text"]
        with self._scene:
            ui.plotly(figure).classes("full")

    def close(self) -> None:
        """Stop following."""
        self.page.site.workers.leave(self)
        for task in (self._task, self._confirming):
            if task is not None:
                with contextlib.suppress(Exception):
                    task.cancel()


def _space(found: dict[str, Any], colour: str) -> dict[str, Any]:
    """Figure of the skin in space."""
    (x, y, z), (i, j, k) = zip(*found["points"]), zip(*found["triangles"])
    mesh = {"type": "mesh3d", "x": z, "y": x, "z": y, "i": i, "j": j, "k": k, "colorscale": "Cividis"}
    mesh |= {"intensity": found["colours"][colour], "flatshading": True, "colorbar": colour_bar(colour, -0.05)}
    camera = {"eye": {"x": -1.8, "y": -1.9, "z": 1.1}}
    scene = {"aspectmode": "data", "camera": camera, **{f"{a}axis": {"title": {"text": f"{n}, m"}} for a, n in _AXES}}
    layout = {"margin": {"l": 0, "r": 0, "t": 30, "b": 80}, "height": 480, "scene": scene}
    return {"data": [mesh], "layout": layout, "config": {"responsive": False, "displaylogo": False}}


#: Axes of the figure and of the valve.
_AXES = (("x", "z"), ("y", "x"), ("z", "y"))


def colour_bar(title: str, y: float) -> dict[str, Any]:
    """Colour bar below a figure, so that a narrow page keeps its width."""
    place = {"orientation": "h", "y": y, "yanchor": "top", "thickness": 12}
    return place | {"title": {"text": title, "side": "top"}}


def label_of(row: dict[str, Any]) -> str:
    """Label of a parameter with its unit."""
    return f"{row['title']}, {row['unit']}".rstrip(", ")


def _short(value: float) -> str:
    return f"{value:.4g}"
