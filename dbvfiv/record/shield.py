"""Deferral of SIGINT and SIGTERM until the enclosed write is complete."""

from __future__ import annotations

import signal
import threading
from types import FrameType, TracebackType

_HELD = (signal.SIGINT, signal.SIGTERM)


class Shield:
    """Context that defers Ctrl-C (SIGINT) and SIGTERM until it is left; not to be nested or shared.

    Python handles signals in its main thread alone, so in other threads the context does nothing. Nor does it for
    signals that this process ignores or that end it without a Python handler.
    """

    def __init__(self):
        self._before: dict[int, object] = {}
        self._heard: list[tuple[int, FrameType | None]] = []

    def __enter__(self) -> None:
        if threading.current_thread() is not threading.main_thread():
            return
        for number in _HELD:
            before = signal.getsignal(number)
            if callable(before):
                self._before[number] = before
                signal.signal(number, self._hear)

    def _hear(self, number: int, frame: FrameType | None) -> None:
        self._heard.append((number, frame))

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        before, self._before = self._before, {}
        for number, handler in before.items():
            signal.signal(number, handler)
        heard, self._heard = self._heard, []
        for number, frame in heard[:1]:
            before[number](number, frame)
