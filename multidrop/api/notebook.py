"""Notebooks: a table and plots of drives that stay up to date, and a stop where a cell is interrupted.

Only IPython is used, which every kernel has; nothing is loaded before it is there.
"""

from __future__ import annotations

import importlib
import sys
import threading
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from typing import Any, Protocol

from multidrop.api.pictures import table
from multidrop.api.telemetry import Sample, Samples
from multidrop.dialects import Diagnostic
from multidrop.transports import TransportLost

EVERY = 0.5
"""Seconds between two pictures."""
SPAN = 30.0
"""Seconds that the plots show."""
LONGEST = 3600.0
"""Seconds after which a picture that nobody closed ends: it reads drives."""
HEADS = ("drive", "axis", "position", "velocity", "in units", "read")


def running() -> Any:
    """The IPython that runs this program; None: none does."""
    ipython = sys.modules.get("IPython")
    return ipython.get_ipython() if ipython is not None else None


def on_interrupt(stop: Callable[[], object]) -> Callable[[], object]:
    """Call `stop` where a cell ends by an interruption, wherever the program was; return what ends that."""
    shell = running()
    if shell is None:
        return lambda: None

    def check(result: Any) -> None:
        if isinstance(result.error_in_exec, KeyboardInterrupt):
            stop()

    def leave() -> None:
        with suppress(ValueError):  # a second time
            shell.events.unregister("post_run_cell", check)

    shell.events.register("post_run_cell", check)
    return leave


def shown(html: str) -> Callable[[str], object]:
    """Show a picture below the cell; return what replaces it. Raises Diagnostic outside a notebook."""
    if not hasattr(running(), "kernel"):
        hint = "telemetry() works everywhere; pip install 'multidrop[notebook]' has a kernel for Jupyter"
        raise Diagnostic("live() shows in a notebook, and this is none", "session", hint)
    display = importlib.import_module("IPython.display")
    handle = display.display(display.HTML(html), display_id=True)
    return lambda now: handle.update(display.HTML(now))


class Readings(Protocol):
    """Telemetry, as a picture takes it."""

    def samples(self) -> Samples:
        """Take all samples that have come."""

    def close(self) -> None:
        """End it."""


class Live:
    """A table and plots of drives below a cell, until `close`, the end of the session, or an hour."""

    def __init__(self, readings: Readings, show: Callable[[str], Callable[[str], object]] = shown) -> None:
        self._readings = readings
        self._rows: deque[Sample] = deque()
        self._over = threading.Event()
        self._replace = show("<p>multidrop: reading</p>")
        self._thread = threading.Thread(target=self._run, daemon=True, name="multidrop live")
        self._thread.start()

    def close(self) -> None:
        """End it; the last picture stays. May be called again."""
        self._over.set()
        self._thread.join()

    def _run(self) -> None:
        with suppress(Diagnostic, TransportLost):  # the session is closed, or its line is gone
            for _ in range(int(LONGEST / EVERY)):
                ended = self._over.wait(EVERY)
                self._rows += self._readings.samples()
                while self._rows and self._rows[0].elapsed < self._rows[-1].elapsed - SPAN:
                    self._rows.popleft()
                self._replace(self.html())
                if ended:
                    break
        self._readings.close()

    def html(self) -> str:
        """Return the picture of now."""
        last = {(row.drive, row.axis): row for row in self._rows}
        newest = self._rows[-1].time if self._rows else 0.0
        rows = [
            (
                row.drive,
                row.axis,
                f"{row.position}",
                f"{row.velocity}",
                "" if row.place is None else f"{row.place:g} {row.unit}",
                "now" if newest - row.time < 2 * EVERY else f"{newest - row.time:.0f} s ago",
            )
            for row in last.values()
        ]
        return table("multidrop", HEADS, rows) + Samples(self._rows)._repr_html_()
