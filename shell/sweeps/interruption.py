"""Signals that end a sweep: they cut off a run or a wait, and never a report."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

from multidrop.shell.signals import SIGNALS


class Interruption:
    """Takes the signals within its block, in the main thread. Those that come outside of `open` wait for it."""

    def __init__(self) -> None:
        self.came = False
        self._open = False
        self._before: dict[int, Any] = {}

    def __enter__(self) -> Interruption:
        if threading.current_thread() is threading.main_thread():
            self._before = {each: signal.signal(each, self._take) for each in SIGNALS}
        return self

    def __exit__(self, *_: object) -> None:
        for each, handler in self._before.items():
            signal.signal(each, handler)

    @contextmanager
    def open(self) -> Iterator[None]:
        """Raise KeyboardInterrupt for a signal, within this block."""
        self._open = True
        try:
            if self.came:
                raise KeyboardInterrupt
            yield
        finally:
            self._open = False

    def _take(self, number: int, frame: FrameType | None) -> None:
        self.came = True
        if self._open:
            self._open = False
            raise KeyboardInterrupt
