"""A server of the page as its user starts it, and a tab of it."""

from __future__ import annotations

import base64
import os
import re
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

#: The 6-inch valve on a mesh that answers at once; damping by stiffness, which compiles least.
COARSE = """[valve]
duckbill_length = "105 mm"
saddle_length = "140 mm"
flange_length = "35 mm"
lip_half_width = "62.5 mm"
flange_radius = "69.6 mm"
wall_map = [
    { to = "105 mm", thickness = "6 mm" },
    { to = "150 mm", thickness = "7.5 mm" },
    { to = "245 mm", thickness = "9.5 mm" },
    { to = "280 mm", thickness = "8 mm" },
]

[mesh]
around = 6
along = 8

[materials]
strain_level = "20 %"

[damping]
model = "rayleigh"
beta = 0.003

[report]
heads = "0.5 m:2 m:3"
"""


class Served:
    """A running server: address, folder, process."""

    def __init__(self, folder: Path, case: Path | None = None, *options: str):
        command = [sys.executable, "-m", "dbvfiv", "app", *([str(case)] if case else [])]
        self.folder, begun = folder, time.monotonic()
        self.process = subprocess.Popen(
            [*command, "--folder", str(folder), *options],
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            env=os.environ | {"PYTHONUNBUFFERED": "1"},
            start_new_session=True,
        )
        line = self.process.stdout.readline()
        self.seconds = time.monotonic() - begun
        found = re.search(r"http\S+", line)
        assert found, line
        self.address = found[0]
        self.root = self.address.split("?")[0]

    def end(self) -> int:
        """End it as Ctrl-C does; its exit status."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
            try:
                self.process.wait(20)
            except subprocess.TimeoutExpired:
                os.killpg(self.process.pid, signal.SIGKILL)
                self.process.wait()
        return self.process.returncode


class Tab:
    """A tab of the page, by what its user sees."""

    def __init__(self, driver, address: str):
        self.driver = driver
        driver.get(address)
        self.wait(lambda: "It fits." in self.text or self.at("wrong").text, 60)

    @property
    def text(self) -> str:
        """Text that is shown."""
        return self.driver.find_element("tag name", "body").text

    def at(self, name: str):
        """Element by its name."""
        return self.driver.find_element("css selector", f'[data-at="{name}"]')

    def wait(self, condition, seconds: float = 180.0):
        """Wait until something holds, and return it."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            try:
                if found := condition():
                    return found
            except Exception as error:  # an element that is drawn anew
                if "stale" not in str(error) and "no such element" not in str(error):
                    raise
            time.sleep(0.05)
        raise AssertionError(f"not within {seconds:g} s; the page says:\n{self.text[:2000]}")

    def _press(self, selector: str, words: str) -> None:
        """Click the first element that is shown and says some words."""

        def pressed() -> bool:
            found = (e for e in self.driver.find_elements("css selector", selector) if e.is_displayed())
            chosen = next((e for e in found if e.text.strip().lower() == words.lower()), None)
            if chosen is not None:
                chosen.click()
            return chosen is not None

        self.wait(pressed)

    def go(self, name: str) -> None:
        """Turn to a panel."""
        self._press(".q-tab", name)

    def click(self, words: str) -> None:
        """Click a button by its words."""
        self._press("button, a.q-btn", words)

    def unfold(self, heading: str) -> None:
        """Open a part of the form."""
        self._press(".q-expansion-item .q-item__label", heading)

    def fill(self, name: str, text: str) -> None:
        """Write into a field."""
        from selenium.webdriver.common.keys import Keys

        self.wait(lambda: self.at(name).is_enabled() and self.at(name).is_displayed())
        box = self.at(name)
        box.send_keys(Keys.CONTROL, "a")
        box.send_keys(text or Keys.DELETE)

    def slide(self, name: str, share: float) -> None:
        """Put a slider to a share of its range, by a click on its track."""
        from selenium.webdriver.common.action_chains import ActionChains

        track = self.at(f"slide {name}").find_element("css selector", ".q-slider__track-container")
        offset = int((share - 0.5) * (track.size["width"] - 2))
        ActionChains(self.driver, duration=0).move_to_element_with_offset(track, offset, 0).click().perform()

    def drop(self, name: str, content: bytes) -> None:
        """Drop a file on the box of the panel that is shown, as soon as it takes one."""
        script = """const [box, name, data, done] = arguments, moved = new DataTransfer();
            moved.items.add(new File([Uint8Array.from(atob(data), c => c.charCodeAt(0))], name));
            const told = kind => new DragEvent(kind, {bubbles: true, cancelable: true, dataTransfer: moved});
            box.dispatchEvent(told("dragover"));
            setTimeout(() => {
                const place = box.querySelector(".q-uploader__dnd");
                place?.dispatchEvent(told("drop"));
                done(place !== null);
            }, 200);"""

        def dropped() -> bool:
            boxes = self.driver.find_elements("css selector", ".q-uploader")
            box = next((box for box in boxes if box.is_displayed()), None)
            data = base64.b64encode(content).decode()
            return box is not None and self.driver.execute_async_script(script, box, name, data)

        self.wait(dropped)

    def number(self, name: str) -> float:
        """Number of the answer, SI."""
        return float(self.driver.find_element("css selector", f"[data-name={name}]").get_attribute("data-si"))

    def is_confirmed(self) -> bool:
        """True where the full model has confirmed the answer."""
        return "confirmed by the full model" in self.at("mark").text

    def errors(self) -> list:
        """Severe entries of the browser's log."""
        return [entry for entry in self.driver.get_log("browser") if entry["level"] == "SEVERE"]


@contextmanager
def served(folder: Path, text: str | None = COARSE, *options: str):
    """Server with a case."""
    case = None
    if text is not None:
        case = folder / "dbv6.toml"
        case.write_text(text)
    server = Served(folder / "kept", case, *options)
    try:
        yield server
    finally:
        server.end()
