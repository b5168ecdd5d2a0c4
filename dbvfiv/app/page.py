"""The page of one tab of a browser: describe a valve, ask it, see its curves, run its studies."""

from __future__ import annotations

import asyncio
import copy
import filecmp
import hashlib
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

from nicegui import events, ui

from ..case.load import put
from ..case.quantity import number_or_text
from ..errors import CaseError
from ..studies.case import Case
from .ask import AskPanel
from .processes import Run
from .see import RunsPanel, SeePanel, drop_box
from .sheet import FORM, Checked, bring, change, check, data_files, given, read_sheet, usual_value, write_sheet

#: Valves to start from: those of the source tree, and of the folder that the server was started in.
SHELVES = (Path(__file__).parents[2] / "cases", Path("cases").resolve())
#: Largest data file, bytes, and how many a user may keep.
DATA, FILES = 5 << 20, 30
#: Time after the last key before the valve is drawn, s.
PAUSE = 0.4
STYLE = """
body { font-family: 'DejaVu Sans', Arial, sans-serif; background: #f6f7f9 }
.columns { display: flex; flex-wrap: wrap; gap: 16px; width: 100%; align-items: flex-start }
.columns > * { flex: 1 1 340px; min-width: 0; max-width: 100% }
.fields { display: grid; grid-template-columns: repeat(auto-fill, minmax(150px, 1fr)); gap: 4px 12px; width: 100% }
.wrong { color: #b3261e; white-space: pre-line } .note { color: #5a5f66; white-space: pre-line }
.figures { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 520px), 1fr)); gap: 12px }
.figures { width: 100% } .figures > * { max-width: 760px }
.drawing img { width: 100%; background: white; border-radius: 6px } .full { width: 100% }
.numbers { display: grid; grid-template-columns: repeat(auto-fill, minmax(150px, 1fr)); gap: 8px; width: 100% }
.number { background: white; border-radius: 6px; padding: 8px 10px } .number b { font-size: 1.25rem; display: block }
.text { white-space: pre; overflow-x: auto; font: 12px 'DejaVu Sans Mono', monospace; max-width: 100%; width: 100% }
.predicted, .confirmed { border-left: 4px solid #d98200; padding-left: 10px } .confirmed { border-color: #2e7d32 }
.q-uploader__subtitle { display: none } .q-tab-panel { padding: 12px } .nicegui-content { padding: 0 }
"""


def shelf() -> dict[str, Path]:
    """Case files to start from, by name."""
    return {path.stem: path for folder in SHELVES for path in sorted(folder.glob("*.toml"))}


class Page:
    """Page of one tab.

    Parameters
    ----------
    home : Path
        Folder of the user.

    Attributes
    ----------
    data : dict
        Keys of the case that were given.
    checked : Checked
    """

    def __init__(self, site: Any, home: Path):
        self.site, self.home = site, home
        self.data: dict[str, Any] = {}
        self.checked = Checked(None)
        self.name = "valve"
        self._open = {"Sizes"}
        self._drawing: asyncio.Task | None = None
        self._told: list[Callable[[], None]] = []

    async def build(self) -> None:
        """Draw the page, with the valve that the user left."""
        ui.add_css(STYLE)
        self.asking, self.seeing, self.running = AskPanel(self), SeePanel(self), RunsPanel(self)
        with ui.header().style("padding: 4px 12px; align-items: center"):
            ui.label("dbvfiv").style("font-weight: bold; font-size: 1.1rem")
            with ui.tabs().props("dense") as self.tabs:
                for name in ("Describe", "Ask", "See", "Run"):
                    ui.tab(name).props(f'data-at="{name}"')
        with ui.tab_panels(self.tabs, value="Describe", animated=False).classes("full").props("keep-alive") as panels:
            self.panels = panels
            with ui.tab_panel("Describe"):
                self._describe()
            with ui.tab_panel("Ask"):
                self.asking.build()
            with ui.tab_panel("See"):
                self.seeing.build()
            with ui.tab_panel("Run"):
                self.running.build()
        panels.on_value_change(lambda event: self.shown(event.value))
        ui.context.client.on_delete(self._leave)
        await self._begin()

    def _leave(self) -> None:
        """Stop what goes on for a tab that was closed."""
        self.asking.close()
        if self._drawing is not None:
            self._drawing.cancel()

    async def _begin(self) -> None:
        left, begins = self.home / "valve.toml", self.home not in self.site.begun
        self.site.begun.add(self.home)
        try:
            if left.exists() and not (begins and self.site.start is not None):
                self.take(left.read_text(encoding="utf-8"), "valve")
            elif self.site.start is not None and self.site.start.suffix.lower() == ".h5":
                self.take_case_of(await self._result_of_start(self.site.start))
            elif self.site.start is not None:
                self.start_from(self.site.start)
            else:
                self.take("", "dbv12")
        except (CaseError, OSError, UnicodeDecodeError) as error:
            self.take("", "dbv12")
            self.tell(str(error))

    def shown(self, name: str) -> None:
        """Bring a tab up to date that is looked at."""
        if name == "Ask":
            self.asking.open()
        elif name == "See":
            self.seeing.refresh()
        elif name == "Run":
            self.running.refresh()

    def tell(self, sentence: str) -> None:
        """Say something at the foot of the page."""
        ui.notify(sentence, multi_line=True, timeout=8000, close_button="OK")

    # -- the valve ----

    def take(self, text: str, name: str) -> None:
        """Take a case in place of that on the page. Raises CaseError for what is no TOML."""
        self.data, self.name = read_sheet(text), name
        self._form.refresh()
        self._parts.refresh()
        self.changed(text)

    def start_from(self, path: Path) -> None:
        """Take a case file with the files that it names. Raises CaseError, OSError, UnicodeDecodeError."""
        self.take(bring(path, self.home), path.stem)

    async def keep_result(self, name: str, content: Path | bytes) -> Run:
        """Keep a result file, or what one holds, among the runs.

        Raises
        ------
        CaseError
            For what is no result, and where a user has too many.
        """
        run = self.site.runs.keep(self.home, name, content)
        try:
            inside = isinstance(content, bytes)
            found = await self.site.workers.drawing.ask("header", path=str(run.page), inside=inside)
        except CaseError as error:
            self.site.runs.delete(self.home, run)
            raise CaseError(str(error).replace(str(run.page), name)) from None
        (run.folder / f"{Path(name).stem}.toml").write_text(found["case"], encoding="utf-8")
        run.kind = found["kind"]
        run.keep()
        return run

    async def _result_of_start(self, path: Path) -> Run:
        """Run of the result file that the server was started with, which is kept once, however many pages open."""
        async with self.site.keeping:
            kept = (run for run in self.site.runs.of(self.home) if run.title == path.name and run.page.exists())
            found = next((run for run in kept if filecmp.cmp(run.page, path, shallow=False)), None)
            return found or await self.keep_result(path.name, path)

    def take_case_of(self, run: Run) -> None:
        """Take the valve of a run, unless it is that on the page. Raises CaseError, OSError."""
        text = bring(run.case, self.home, anew=False)
        if read_sheet(text) != self.data:
            self.take(text, run.case.stem)

    def typed(self, key: str, text: str) -> None:
        """Take what was typed for a key."""
        try:
            change(self.data, key, text)
        except CaseError as error:
            self._show(Checked(None, (str(error),), key=key))
            return
        self.changed()

    def changed(self, text: str | None = None) -> None:
        """Check the case, keep it, and draw it soon."""
        text = write_sheet(self.data) if text is None else text
        self._text.value = text
        self._show(check(self.data, self.home, text))
        (self.home / "valve.toml").write_text(text, encoding="utf-8")
        if self._drawing is not None:
            self._drawing.cancel()
        if self.checked.case is not None:
            self._drawing = asyncio.create_task(self._draw())

    def _show(self, checked: Checked) -> None:
        self.checked = checked
        self._wrong.text = "\n".join(checked.problems)
        self._noted.text = "\n".join(checked.notes)
        self._fits.text = "It fits." if checked.case is not None else ""

    @property
    def file(self) -> Path | None:
        """File of the case as it is now, for processes, another one for other data files beside it; None where the case
        does not fit.
        """
        if self.checked.case is None:
            return None
        text = write_sheet(self.data)
        beside = sorted((p.name, p.stat().st_mtime_ns, p.stat().st_size) for p in data_files(self.home))
        path = self.home / f"case-{hashlib.sha256(f'{text}{beside}'.encode()).hexdigest()[:16]}.toml"
        if not path.exists():
            for old in sorted(self.home.glob("case-*.toml"), key=lambda file: file.stat().st_mtime)[:-20]:
                old.unlink()
            path.write_text(text, encoding="utf-8")
        return path

    def files(self) -> dict[str, bytes]:
        """Case and data files of a run."""
        found = {path.name: path.read_bytes() for path in data_files(self.home)}
        return found | {f"{self.name}.toml": write_sheet(self.data).encode()}

    def run(self, kind: str, title: str, arguments: list[str]) -> Run | None:
        """Put a run of the valve into the queue; None where that is refused, which is told."""
        try:
            if self.checked.case is None:
                raise CaseError("The valve does not fit yet; see Describe.")
            return self.site.runs.add(self.home, kind, title, self.files(), arguments)
        except (CaseError, OSError) as error:
            self.tell(str(error))
            return None

    async def _draw(self) -> None:
        await asyncio.sleep(PAUSE)
        try:
            found = await self.site.workers.drawing.ask("describe", case=str(self.file))
        except CaseError as error:
            self._wrong.text = str(error)
            return
        self._picture.set_source(f"data:image/png;base64,{found['picture']}")
        self._picture.props(f'alt="{self.name}: the valve with its measures"')
        self._sizes.text = "\n".join(found["sizes"])
        self._noted.text = "\n".join([*self.checked.notes, *found["notes"]])

    # -- the form ----

    def _describe(self) -> None:
        with ui.row().style("align-items: center"):
            names = shelf()
            ui.select(
                [*names], label="Start from", on_change=lambda e: self._attempt(self.start_from, names[e.value])
            ).style("min-width: 170px").props('data-at="start"')
            drop_box("Drop a case, or data", DATA, self._uploaded)
            ui.button("Save", on_click=self._save).props('data-at="save"')
        with ui.element("div").classes("columns"):
            with ui.column():
                self._fits = ui.label().style("color: #2e7d32").props('data-at="fits"')
                self._wrong = ui.label().classes("wrong").props('data-at="wrong"')
                self._form()
                self._parts()
                with self._part("All keys as text"):
                    self._text = (
                        ui.textarea().classes("full").props('rows=16 data-at="text"').style("font-family: monospace")
                    )
                    ui.button("Take this text", on_click=lambda: self._attempt(self.take, self._text.value, self.name))
            with ui.column():
                self._picture = ui.image().classes("drawing full")
                self._sizes, self._noted = ui.label().classes("note"), ui.label().classes("note")

    @ui.refreshable_method
    def _form(self) -> None:
        for heading, rows in FORM.items():
            with self._part(heading), ui.element("div").classes("fields"):
                for key, label in rows:
                    self._field(key, label)

    def _part(self, heading: str) -> ui.expansion:
        """Part of the form, which stays open when the form is drawn anew."""
        part = ui.expansion(heading, value=heading in self._open).classes("full")
        part.on_value_change(lambda event: (self._open.add if event.value else self._open.discard)(heading))
        return part

    def _field(self, key: str, label: str) -> None:
        section, name = key.split(".")
        usual = getattr(_DEFAULT, section)
        default, told = usual_value(usual, name), type(usual).model_fields[name].description
        box = ui.input(label, value=given(self.data, key), placeholder="" if default is None else str(default))
        box.props(f'dense stack-label data-at="{key}"')
        box.on_value_change(lambda event: self.typed(key, event.value or ""))
        if told:
            box.tooltip(told)

    @ui.refreshable_method
    def _parts(self) -> None:
        self._rows("Layers, inside to outside", "layers", ("material", "thickness", "angle"))
        self._rows("Wall along the valve, from the lip", "valve.wall_map", ("to", "thickness"))
        with self._part("Rubbers"):
            own = self.data.get("materials", {})
            cards = (
                {name: card for name, card in own.items() if isinstance(card, dict)} if isinstance(own, dict) else {}
            )
            for name, card in cards.items():
                ui.label(f"{name}: " + ", ".join(f"{key} {value}" for key, value in card.items())).classes("note")
            with ui.row().style("align-items: center; gap: 8px"):
                name = ui.input("Name").props("dense").style("width: 100px").props('data-at="rubber"')
                shore = ui.input("Hardness, Shore A").props("dense").style("width: 150px").props('data-at="hardness"')
                test = (
                    ui.select(["", *self._data_files()], label="or its test")
                    .style("width: 130px")
                    .props('data-at="test"')
                )
                loss = ui.input("Loss factor").props("dense").style("width: 90px")
                ui.button(
                    "Add", on_click=lambda: self._add_rubber(name.value, shore.value, test.value, loss.value)
                ).props("flat")

    def _data_files(self) -> list[str]:
        return [path.name for path in data_files(self.home)]

    def _rows(self, heading: str, key: str, names: tuple[str, ...]) -> None:
        """Table of a list of the case, with its default where it is not given."""
        table, _, last = key.rpartition(".")
        holder = self.data if not table else self.data.get(table)
        rows = holder.get(last) if isinstance(holder, dict) else None
        if not isinstance(rows, list):
            default = getattr(getattr(_DEFAULT, table), last) if table else getattr(_DEFAULT, last)
            rows = [{name: usual_value(row, name) for name in row.model_fields_set} for row in default]

        def resize(removed: int | None) -> None:
            kept = [row for number, row in enumerate(rows) if number != removed]
            kept += copy.deepcopy(kept[-1:]) if removed is None else []
            self._attempt(put, Case, self.data, key, kept)
            self._parts.refresh()
            self.changed()

        with self._part(heading):
            for number, row in enumerate(rows):
                with ui.row().style("align-items: center; gap: 8px; flex-wrap: nowrap"):
                    for name in names:
                        value, at = row.get(name, "") if isinstance(row, dict) else "", f"{key}.{number}.{name}"
                        box = ui.input(name, value=str(value)).props(f'dense data-at="{at}"').style("flex: 0 1 110px")
                        box.on_value_change(lambda event, at=at: self.typed(at, event.value or ""))
                    ui.button(icon="remove", on_click=lambda _, n=number: resize(n)).props("flat dense")
            ui.button("Add a row", on_click=lambda: resize(None)).props("flat")

    def _add_rubber(self, name: str, shore: str, test: str | None, loss: str) -> None:
        if not re.fullmatch(r"[A-Za-z][\w-]{0,30}", name or ""):
            self.tell("A rubber needs a name of letters and digits.")
            return
        card: dict[str, Any] = {"density": "1150 kg/m^3"}
        card |= {"kind": "fit", "path": test} if test else {"kind": "neo-hookean", "shear_modulus": f"{shore} Shore A"}
        if loss:
            card["loss_factor"] = number_or_text(loss)
        self._attempt(put, Case, self.data, f"materials.{name}", card)
        self._parts.refresh()
        self.changed()

    def _attempt(self, act: Callable, *given: Any) -> None:
        try:
            act(*given)
        except (CaseError, OSError, UnicodeDecodeError) as error:
            self._show(Checked(None, (str(error),)))

    async def _uploaded(self, event: events.UploadEventArguments) -> None:
        """Take a case file, or keep a data file; a record becomes a run that judges it."""
        content, name = await event.file.read(), Path(event.file.name.replace("\\", "/")).name
        if not re.fullmatch(r"[\w][\w. -]{0,60}\.(toml|csv)", name, re.IGNORECASE) or len(content) > DATA:
            self.tell(f"{name[:60]!r} is not taken: a case ends in .toml, data in .csv, up to {DATA >> 20} MB.")
            return
        if name.lower().endswith(".toml"):
            self._attempt(lambda: self.take(content.decode("utf-8-sig"), Path(name).stem))
            return
        if len(self._data_files()) >= FILES:
            self.tell(f"{FILES} data files are kept already.")
            return
        kept = f"{Path(name).stem.replace(' ', '_')}.csv"
        (self.home / kept).write_bytes(content)
        self._parts.refresh()
        self.changed()
        self.tell(f"{kept} is kept; the case may name it, and Rubbers offers it.")

    def _save(self) -> None:
        ui.download.content(write_sheet(self.data), f"{self.name}.toml", "application/toml")


_DEFAULT = Case()
