"""Curves and maps of a valve, and its runs: both are results of the command line."""

from __future__ import annotations

import asyncio
import re
import time
from collections.abc import Callable
from itertools import groupby
from typing import Any

from nicegui import events, ui

from ..case.parameters import DESIGN, PARAMETERS, Mu
from ..errors import CaseError
from ..studies import KINDS
from ..studies.case import Case, load_case
from ..studies.stability.place import design_value
from .ask import colour_bar, label_of
from .processes import RECORD, Run
from .sheet import shown_as

#: Time between two looks at the runs, s; largest record or result, bytes.
LOOK, LARGEST = 1.0, 15 << 20
#: Pictures of a valve: title, study, and its arguments; low and high are heads, Pa, damping a range of the damping.
PICTURES = {
    "Head-loss curve": ("steady", ("-p", "{shown_low:.6g} {unit}:{shown_high:.6g} {unit}:10")),
    "Root locus over head": ("sweep", ("--over", "pressure={low:.6g}:{high:.6g}:10")),
    "Stability map": ("map", ("--x", "pressure={low:.6g}:{high:.6g}:8", "--y", "{damping}:8", "--contours", "2 %,5 %")),
    "Cycle amplitude": ("cycle", ("--over", "{damping}:6")),
    "Closure": ("closure", ()),
    "Probability of chatter": ("uncertainty", ()),
}


def arguments_of(case: Any, title: str) -> list[str]:
    """Arguments of the study of a picture for a case: heads over that downstream up to 1.5 times its own, or that of
    its column of fluid, damping from a quarter to three times its own, or to the end of its range.
    """
    name = Mu.of(case).damping or "density"
    own = Mu.of(case)[name]
    back = case.least_drive
    span = (case.drive.pressure - back) or abs(case.level_pressure)
    low, high = (back + share * span for share in (0.15, 1.5))
    unit, scale = case.units.name("pressure"), case.units.factor("pressure")  # in any other the command would tell all
    heads = {"low": low, "high": high, "shown_low": low / scale, "shown_high": high / scale, "unit": unit}
    values = heads | {"damping": f"{name}={0.25 * own:.6g}:{min(3 * own, PARAMETERS[name].high):.6g}"}
    return [argument.format(**values) for argument in PICTURES[title][1]]


def asked_at(values: dict[str, float]) -> list[str]:
    """Arguments of `dbvfiv modes` at values of the sliders, SI; the wall stays that of the case, whose rubbers have
    strain levels by the pressures that it names.
    """
    own = {"pressure": "--pressure={!r} N/m2", "density": "--density={!r}"}  # a unit in which the run tells nothing
    return [own.get(name, f"--set={PARAMETERS[name].key}={{!r}}").format(value) for name, value in values.items()]


def drop_box(label: str, largest: int, take: Callable[[events.UploadEventArguments], Any]) -> None:
    """Box that a file up to a size in bytes is dropped on.

    The browser empties it when a file has arrived: told to from here, a little later, it would lose the next file.
    """
    box = ui.upload(label=label, auto_upload=True, max_file_size=largest, on_upload=take)
    box.props("flat bordered").style("width: 250px; max-height: 56px")
    box.on("finish", js_handler=f"() => runMethod({box.id}, 'removeUploadedFiles', [])")


class RunView:
    """A run in a list: bar, buttons, output and results.

    Parameters
    ----------
    opens : bool
        Show what it found as soon as it ends.
    """

    def __init__(self, page: Any, run: Run, opens: bool):
        self.page, self.run, self._opens = page, run, opens and run.is_live
        with ui.card().classes("full").props(f'data-at="run {run.kind}"') as self.card:
            with ui.row().classes("full").style("align-items: center; gap: 4px 16px"):
                ui.label(run.title).style("font-weight: bold")
                self._state = ui.label().classes("note").props('data-at="state"')
                self._cancel = ui.button("Cancel", on_click=lambda: page.site.runs.cancel(run)).props("flat dense")
                self._resume = ui.button("Resume", on_click=lambda: page.site.runs.resume(run)).props("flat dense")
                self._open = ui.button("Open", on_click=self.show).props("flat dense")
                self._valve = ui.button("Its valve", on_click=self._take_case).props("flat dense")
                ui.button("Delete", on_click=lambda: page.site.runs.delete(page.home, run)).props("flat dense")
            self._bar = ui.linear_progress(0, show_value=False).classes("full")
            self._body = ui.column().classes("full")

    def look(self) -> None:
        """Bring bar and buttons up to date."""
        run, live = self.run, self.run.is_live
        share, said = run.progress() if run.state == "running" else (float(run.state == "done"), "")
        took = f" in {run.ended - run.started:.0f} s" if run.state == "done" and run.started else ""
        if run.state == "running" and not said:
            said = f"{time.time() - run.started:.0f} s"
        self._state.text = f"{run.state}{took}{': ' if said else ''}{said}"
        self._bar.value = share
        self._bar.visible, self._cancel.visible = live, live
        self._resume.visible = run.can_resume
        self._open.visible = not live
        self._valve.visible = run.case.exists()
        if self._opens and not live:
            self._opens = False
            self._showing = asyncio.create_task(self.show())

    def _take_case(self) -> None:
        try:
            self.page.take_case_of(self.run)
        except (CaseError, OSError) as error:
            self.page.tell(str(error))
            return
        self.page.panels.value = "Describe"

    async def show(self) -> None:
        """Draw what the run found."""
        self._body.clear()
        with self._body:
            await show_result(self.page, self.run)


class RunList:
    """Runs as cards, the newest first; those that stay keep what they show.

    Parameters
    ----------
    opens : bool
        Show what a run found as soon as it ends.
    """

    def __init__(self, page: Any, opens: bool):
        self._page, self._opens = page, opens
        self._views: dict[str, RunView] = {}
        self._column = ui.column().classes("full")

    def show(self, runs: list[Run]) -> None:
        """Bring the cards up to date."""
        for name in self._views.keys() - {run.name for run in runs}:
            self._views.pop(name).card.delete()
        for place, run in enumerate(runs):
            if run.name not in self._views:
                with self._column:
                    self._views[run.name] = RunView(self._page, run, self._opens)
                self._views[run.name].card.move(target_index=place)
            self._views[run.name].look()


async def show_result(page: Any, run: Run) -> None:
    """Draw what a run printed and found."""
    said, found = run.output(), {"figures": sorted(file.name for file in (run.folder / "figures").glob("*.png"))}
    if run.kind == "report" and run.page.exists():
        ui.link("Open the report", f"/files/{run.name}/report.html", new_tab=True)
    figures = run.folder / "figures"
    if run.kind in KINDS and run.page.exists():
        try:
            found = await page.site.workers.drawing.ask("result", path=str(run.page), figures=str(figures))
            if run.kind == "map" and found["summary"].get("growth_rate"):
                show_map(page, run, found["summary"])
        except CaseError as error:
            ui.label(str(error)).classes("wrong")
            return
        said = said or "\n".join(found["lines"])  # of a result that was made elsewhere
        with ui.row():
            for name in found["tables"]:
                ui.link(name, f"/files/{run.name}/figures/{name}").props("download")
            ui.link("result.h5", f"/files/{run.name}/result.h5").props("download")
    with ui.element("div").classes("figures"):
        for name in found["figures"]:
            address = f"/files/{run.name}/figures/{name}?{(figures / name).stat().st_mtime_ns}"
            with ui.link(target=address).props(f'download="{name}" title="Save this figure"').classes("drawing"):
                ui.html(f'<img src="{address}" alt="{name}">', sanitize=False).classes("drawing full")
    # tables keep their columns, sentences are wrapped
    for is_table, lines in groupby(said.split("\n"), lambda line: re.search(r"(\S|^) {2,}\S", line) is not None):
        ui.label("\n".join(lines)).classes("text" if is_table else "note")


def map_figure(case: Case, found: dict[str, Any]) -> tuple[dict[str, Any], str]:
    """Stability map with neutral curves and the star of the installation, and words below it: under the flow model of
    the case where the map has two, without cells whose verdict is uncertain.
    """
    laws = found.get("laws", [found])
    picture = next((one for one in laws if one["continuity"] == case.fluid.continuity), laws[0])
    names = [found[axis]["parameter"] for axis in "xy"]
    rows = [shown_as(case, name, names) for name in names]
    x, y = ([value / row["scale"] for value in found[axis]["values"]] for axis, row in zip("xy", rows))
    leading = picture | picture.get("leading", {})
    rates, certified = leading["growth_rate"], leading["certified"]
    grid = [[rate if sure else None for rate, sure in zip(*pair)] for pair in zip(rates, certified)]
    limit = max((abs(rate) for row in grid for rate in row if rate is not None), default=1.0)
    cells = {"type": "heatmap", "x": x, "y": y, "z": grid, "colorscale": "RdBu", "zmin": -limit, "zmax": limit}
    drawn = [cells | {"colorbar": colour_bar("Growth rate, 1/s", -0.22)}]
    contours = picture.get("contours", ())
    curves = [("onset", "solid", curve) for curve in picture["onset_curves"]]
    curves += [(f"margin {one['level']}", "dot", one["points"]) for one in contours]
    for title, dash, curve in curves:
        points = {name: [point[i] / rows[i]["scale"] for point in curve] for i, name in enumerate("xy")}
        drawn.append(
            {"type": "scatter", "mode": "lines", "line": {"color": "black", "dash": dash}, "name": title} | points
        )
    own = [design_value(case, name) if name in DESIGN else Mu.of(case).get(name) for name in names]
    if None not in own:
        marker = {"symbol": "star", "size": 16, "color": "gold", "line": {"color": "black", "width": 1}}
        star = {axis: [value / row["scale"]] for axis, value, row in zip("xy", own, rows)}
        drawn.append({"type": "scatter", "mode": "markers", "marker": marker, "name": "this installation"} | star)
    layout = {"height": 480, "margin": {"t": 40, "r": 10}, "showlegend": False}
    if len(laws) > 1:
        layout["title"] = {"text": f"Flow model: {picture['continuity']}", "font": {"size": 14}}
    for name, row in zip("xy", rows):
        layout[f"{name}axis"] = {"title": {"text": label_of(row)}, "type": "log" if found[name]["log"] else "linear"}
        layout[f"{name}axis"] |= {"exponentformat": "none", "automargin": True}
    levels = " and ".join(dict.fromkeys(str(one["level"]) for one in contours))
    said = ["Solid: onset", *([f"dotted: margin {levels}"] if levels else []), "blank: uncertain."]
    figure = {"data": drawn, "layout": layout, "config": {"responsive": False, "displaylogo": False}}
    return figure, "; ".join(said)


def show_map(page: Any, run: Run, found: dict[str, Any]) -> None:
    """Draw a stability map; a click goes to a cell."""
    case = load_case(run.case)
    figure, said = map_figure(case, found)
    names = [found[axis]["parameter"] for axis in "xy"]

    def go(event: events.GenericEventArguments) -> None:
        point = (event.args.get("points") or [{}])[0]
        if point.get("x") is None:
            return
        values = {name: float(point[axis]) * shown_as(case, name)["scale"] for name, axis in zip(names, "xy")}
        page.take_case_of(run)
        page.panels.value = "Ask"
        page.asking.open(values)

    ui.plotly(figure).classes("full").props('data-at="map"').on("plotly_click", go)
    asks = "" if set(names) & set(DESIGN) else " A click on a cell asks the valve there."
    ui.label(f"{said}{asks}").classes("note")


class SeePanel:
    """Pictures of the valve of the page, each computed when it is asked for."""

    def __init__(self, page: Any):
        self.page = page

    def build(self) -> None:
        """Draw the panel."""
        with ui.row():
            buttons = {title: ui.button(title, on_click=lambda _, title=title: self._ask(title)) for title in PICTURES}
        self._chance = buttons["Probability of chatter"]
        ui.label("Each is a run, which waits in its turn and is kept.").classes("note")
        self._list = RunList(self.page, opens=True)
        ui.timer(LOOK, self.refresh)

    def _ask(self, title: str) -> None:
        case = self.page.checked.case
        arguments = [] if case is None else arguments_of(case, title)
        self.page.run(PICTURES[title][0], title, arguments)
        self.refresh()

    def refresh(self) -> None:
        """Bring the list up to date: the newest of each picture."""
        case = self.page.checked.case
        self._chance.visible = case is not None and bool(case.uncertainty.model_fields_set)
        newest: dict[str, Run] = {}
        for run in self.page.site.runs.of(self.page.home):
            if run.title in PICTURES:
                newest.setdefault(run.title, run)
        self._list.show([*newest.values()])


class RunsPanel:
    """Any study and the report, in a queue; results that are kept."""

    def __init__(self, page: Any):
        self.page = page

    def build(self) -> None:
        """Draw the panel."""
        with ui.row().style("align-items: center"):
            kinds = ["report", *KINDS]
            self._kind = ui.select(kinds, value="report", label="Run").style("min-width: 140px").props('data-at="kind"')
            ui.button("Add to the queue", on_click=self._add).props('data-at="add"')
            drop_box("Drop a record or result", LARGEST, self._take)
        ui.label("What a study takes stands in its section of the case: Describe, all keys as text.").classes("note")
        self._list = RunList(self.page, opens=False)
        ui.timer(LOOK, self.refresh)

    def _add(self) -> None:
        self.page.run(self._kind.value, f"{self._kind.value} of {self.page.name}", [])
        self.refresh()

    async def _take(self, event: events.UploadEventArguments) -> None:
        """Keep a result; judge a record, beside the modes of the valve at the values of the sliders."""
        content, name, page = await event.file.read(), re.sub(r"[^\w. -]", "_", event.file.name[-40:]), self.page
        try:
            if name.lower().endswith(".h5"):
                await page.keep_result(name, content)
            elif page.checked.case is None:
                page.site.runs.add(page.home, "verdict", f"verdict of {name}", {RECORD: content}, [])
            else:
                moved = asked_at(page.asking.values_of(page.file))
                files = page.files() | {RECORD: content}
                page.site.runs.add(page.home, "compare", f"{name} beside the modes of {page.name}", files, moved)
        except (CaseError, OSError) as error:
            self.page.tell(str(error))
        self.refresh()

    def refresh(self) -> None:
        """Bring the list up to date."""
        self._list.show(self.page.site.runs.of(self.page.home))
