"""A table and plots of drives that stay up to date below the cell of a notebook."""

from __future__ import annotations

import contextlib
import importlib
import threading
from collections import deque
from collections.abc import Callable

from multidrop.api.blocking import Telemetry, running
from multidrop.api.telemetry import Sample, Samples
from multidrop.base.errors import Diagnostic, TransportLost
from multidrop.features.notebook.pictures import of_samples, table

EVERY = 0.5
"""Seconds between two pictures."""
SPAN = 30.0
"""Seconds that the plots show."""
LONGEST_LIVE_PLOT = 3600.0
"""Seconds after which a picture that nobody closed ends: it reads drives."""
HEADS = ("drive", "axis", "position", "velocity", "in units", "read")


def shown(html: str) -> Callable[[str], object]:
    """Show a picture below the cell; return what replaces it. Raises Diagnostic outside a notebook."""
    if not hasattr(running(), "kernel"):
        hint = "telemetry() works everywhere; pip install 'multidrop[notebook]' has a kernel for Jupyter"
        raise Diagnostic("live() shows in a notebook, and this is none", "session", hint)
    display = importlib.import_module("IPython.display")
    handle = display.display(display.HTML(html), display_id=True)
    return lambda now: handle.update(display.HTML(now))


class LivePicture:
    """A table and plots of drives below a cell, until `close`, the end of the session, or an hour."""

    def __init__(self, readings: Telemetry) -> None:
        self._readings = readings
        self._rows: deque[Sample] = deque()
        self._over = threading.Event()
        self._replace = shown("<p>multidrop: reading</p>")
        self._thread = threading.Thread(target=self._run, daemon=True, name="multidrop live")
        self._thread.start()

    def close(self) -> None:
        """End it; the last picture stays. May be called again."""
        self._over.set()
        self._thread.join()

    def _run(self) -> None:
        with contextlib.suppress(Diagnostic, TransportLost):  # the session is closed, or its line is gone
            for _ in range(int(LONGEST_LIVE_PLOT / EVERY)):
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
        return table("multidrop", HEADS, rows) + of_samples(Samples(self._rows))
