"""The one boundary of the screen: a defect of a part ends neither the screen nor the stop.

An exception in a panel, a page, a dialog, a key, a timer or a poll is caught here, and nowhere else. Its place shows
"cannot be shown", the traceback goes to a file that is named on the screen, and everything else goes on. A part that
fails in every frame is written once and counted. It shows itself again once it succeeds.

Tests set `RAISES`: then each defect is raised, as in any other program.
"""

from __future__ import annotations

import asyncio
import logging
import os
import sys
import traceback
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any, TypeVar

from rich.segment import Segment
from textual._context import active_message_pump
from textual.app import App
from textual.dom import DOMNode
from textual.geometry import Region
from textual.message import Message
from textual.screen import Screen
from textual.strip import Strip
from textual.widget import Widget
from textual.widgets import Static
from textual.worker import WorkerFailed

from multidrop.base.atomic import make_folder
from multidrop.base.isolation import LOG

T = TypeVar("T")

RAISES = False
"""Defects are raised, not caught: for tests."""
FILE = "defects.log"
"""The file of tracebacks, in the state folder."""
MOST_LOGGED_DEFECTS = 50
"""Greatest number of defects that one run writes; further ones are counted."""
GOES_ON = "everything else goes on, and Ctrl+X stops all drives"


class Attempt:
    """One attempt to do a part: a defect in its block is caught, and `trouble` says so. See `Boundary.at`."""

    __slots__ = ("_boundary", "_place", "trouble")

    def __init__(self, boundary: Boundary, place: str) -> None:
        self._boundary, self._place = boundary, place
        self.trouble = ""
        """What its place shows; empty: it was done."""

    def __enter__(self) -> Attempt:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, failure: BaseException | None, _: TracebackType | None
    ) -> bool:
        if failure is None:
            self._boundary.failing.pop(self._place, None)
            return False
        if RAISES or not isinstance(failure, Exception):
            return False
        self.trouble = self._boundary.caught(self._place, failure)
        return True


class Boundary:
    """Catches and reports the defects of one app. `say` shows a line to the person; `goes_on`: what still works."""

    def __init__(self, folder: Path, say: Callable[[str], None] = lambda text: None, goes_on: str = GOES_ON) -> None:
        self.path = folder / FILE
        self.failing: dict[str, str] = {}
        """What each failing place shows."""
        self.counts: dict[tuple[str, str], int] = {}
        """How often each defect came, by its place and its origin."""
        self._say, self._goes_on = say, goes_on

    def at(self, place: str) -> Attempt:
        """Guard one attempt to do a part; `place` names it for a person."""
        return Attempt(self, place)

    def do(self, place: str, work: Callable[[], T], instead: Callable[[str], T]) -> T:
        """Return what the work returns; after a defect, what `instead` makes of the text to show."""
        with self.at(place) as attempt:
            return work()
        return instead(attempt.trouble)

    def caught(self, place: str, failure: BaseException, defect: str = "a defect of multidrop") -> str:
        """Take a defect: write it once, count it, say it once; return what its place shows. `defect`: its name."""
        if isinstance(failure, WorkerFailed):
            failure = failure.error
        origin = _origin(failure)
        text = f"cannot be shown: {type(failure).__name__} ({origin}); see {self.path}"
        self.failing[place] = text
        known = self.counts.get((place, origin), 0)
        self.counts[place, origin] = known + 1
        if not known and len(self.counts) <= MOST_LOGGED_DEFECTS:
            written = self._write(place, failure)
            details = f"details: {self.path}" if written else f"{self.path} could not be written"
            with self.at("what is said of a defect"):  # the part that shows a line may be defective, too
                self._say(f"{defect} in {place}: {type(failure).__name__}; {self._goes_on}; {details}")
        return text

    def end(self) -> None:
        """Name the file on the terminal, where a defect has ended the screen all the same."""
        from multidrop.shell.streams.stdout import write

        if self.counts:
            write(sys.stderr, f"the screen ended because of a defect of multidrop; details: {self.path}")

    def close(self) -> None:
        """Write how often the defects came that came more than once."""
        if repeated := {key: count for key, count in self.counts.items() if count > 1}:
            self._append("".join(f"{place} ({origin}): {count} times\n" for (place, origin), count in repeated.items()))

    def _write(self, place: str, failure: BaseException) -> bool:
        lines = traceback.format_exception(failure)
        return self._append(f"{place}\n{''.join(lines)}\n")

    def _append(self, text: str) -> bool:
        with suppress(OSError):
            make_folder(self.path.parent)
            descriptor = os.open(self.path, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o600)
            try:
                os.write(descriptor, text.encode("utf-8", "backslashreplace"))
            finally:
                os.close(descriptor)
            return True
        return False

    # Textual's widgets, timers and workers; the event loop; subscribers of events

    def guard(self, widget: Widget) -> None:
        """Keep a widget alive whatever its handlers raise, and show in its place that it cannot be rendered."""
        if "_dispatch_message" in vars(widget):
            return
        dispatch, render, place = widget._dispatch_message, widget.render_lines, _name(widget)

        async def guarded(message: Message) -> None:
            with self.at(f"{place}, {type(message).__name__}"):
                await dispatch(message)

        def rendered(crop: Region) -> list[Strip]:
            return self.do(place, lambda: render(crop), lambda text: _strips(text, crop))

        vars(widget).update(_dispatch_message=guarded, render_lines=rendered)
        if isinstance(widget, Screen):
            focus = widget.set_focus

            def focused(part: Widget | None, *arguments: Any, **named: Any) -> None:
                there = part is None or part.is_attached  # else the keys of the screen would be missing with it
                focus(part if there else None, *arguments, **named)

            vars(widget).update(set_focus=focused)

    def own(self, app: App[Any], composed: Callable[[], bool]) -> None:
        """Keep an app alive once it is composed: its queue, what its timers and workers raise, and all its widgets."""
        dispatch, register, handle = app._dispatch_message, app._register_child, app._handle_exception

        async def guarded(message: Message) -> None:
            if not composed():
                await dispatch(message)
                return
            with self.at(f"the screen, {type(message).__name__}"):
                await dispatch(message)

        def registered(parent: DOMNode, child: Widget, before: int | None, after: int | None) -> None:
            self.guard(child)
            register(parent, child, before, after)

        def handled(failure: Exception) -> None:
            if RAISES or not composed():
                handle(failure)
                return
            pump = active_message_pump.get(None)
            text = self.caught(f"{type(pump).__name__}, {getattr(pump, 'id', None) or 'a part'}", failure)
            if isinstance(pump, Screen) and pump.is_attached and not pump.children:
                pump.mount(Static(text, markup=False))  # it could not be composed

        vars(app).update(_dispatch_message=guarded, _register_child=registered, _handle_exception=handled)

    def try_again(self, screens: Sequence[Screen[Any]]) -> None:
        """Render all parts again after a defect: the cause may be gone."""
        for screen in screens if self.failing else ():
            screen.refresh()
            for widget in screen.query("*"):
                widget.refresh()

    def look_at(self, loop: asyncio.AbstractEventLoop) -> Callable[[], None]:
        """Catch what the event loop and the subscribers of events report; call what is returned to end that."""
        if RAISES:
            return lambda: None
        before = loop.get_exception_handler()

        def report(loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
            failure = context.get("exception")
            if isinstance(failure, Exception):
                self.caught("work in the background", failure)

        handler = _Handler(self, loop)
        loop.set_exception_handler(report)
        LOG.addHandler(handler)

        def end() -> None:
            loop.set_exception_handler(before)
            LOG.removeHandler(handler)
            self.close()

        return end


class _Handler(logging.Handler):
    """Takes the defects that `base.isolation.isolated` logs, in whatever thread."""

    def __init__(self, boundary: Boundary, loop: asyncio.AbstractEventLoop) -> None:
        super().__init__(logging.ERROR)
        self._boundary, self._loop = boundary, loop

    def emit(self, record: logging.LogRecord) -> None:
        failure = record.exc_info[1] if record.exc_info else None
        if failure is not None:
            with suppress(RuntimeError):  # the loop has ended
                whose = "a defect of multidrop" if record.name == LOG.name else "a defect"
                self._loop.call_soon_threadsafe(self._boundary.caught, record.getMessage(), failure, whose)


def _origin(failure: BaseException) -> str:
    """Where an exception was raised: `drive.py:120`."""
    step = failure.__traceback__
    while step is not None and step.tb_next is not None:
        step = step.tb_next
    return f"{Path(step.tb_frame.f_code.co_filename).name}:{step.tb_lineno}" if step is not None else "?"


def _name(widget: Widget) -> str:
    """A widget in words: its class, and its name in the style sheet."""
    return f"{type(widget).__name__} {widget.id or ''}".strip()


def _strips(text: str, crop: Region) -> list[Strip]:
    """The text in the first row of a region, and blank rows below it."""
    rows = [f" {text}"[: crop.width].ljust(crop.width) if y == 0 else " " * crop.width for y in crop.line_range]
    return [Strip([Segment(row)], crop.width) for row in rows]
