"""Keys, pastes and clicks in the order of their bytes: each is complete before the next one counts.

Textual hands a key to the queue of the focused widget. That widget takes a character at once, but Enter climbs from
queue to queue to its binding, so later characters overtake it. Therefore no key enters those queues: it waits here, and
the app's own queue works it off. Characters go into the field. Any other key runs its binding, which is awaited: a
dialog that it opens has the focus before the next key.

A stop clears what waits. Each turn is short, and a stop never waits for more than one turn.
"""

from __future__ import annotations

import asyncio
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress

from textual import events
from textual.app import App
from textual.binding import Binding
from textual.css.query import NoMatches
from textual.dom import DOMNode
from textual.errors import NoWidget
from textual.message import Message
from textual.widgets import Input, TextArea

LONGEST_KEY_SLICE = 0.003
"""Greatest time in seconds of one turn."""
RUN = 512
"""Greatest number of characters that go into a field together."""
DEAF_TIME = 0.5
"""Seconds without a key after which keys count again, once the screen has changed under them."""
LONGEST_KEY_WAIT = 0.25
"""Greatest time in seconds that a widget gets to handle a click."""
EARLY = "the screen changed while you typed: these keys were dropped; keys count again after a pause"
MOST_DROPPED = 1 << 16
"""Greatest number of characters that are kept of what was dropped."""
IMMEDIATE = frozenset({"ctrl+q", "ctrl+c", "escape"})
"""Keys that do not wait while keys are held; what was typed before them is dropped."""
Typed = events.Key | events.Paste | events.MouseDown | events.MouseUp


class Keyboard:
    """The keys of one app. `warn` shows a line to the person who types."""

    def __init__(self, app: App[int], warn: Callable[[str], None]) -> None:
        self._app, self._warn = app, warn
        self._waiting: deque[Typed] = deque()
        self._awake = False
        self._turning = False
        self._held = set[object]()
        self._deaf_until = 0.0
        self._deaf = 0
        self._closed = False
        self._dropped = ""
        """The text of keys and pastes that were dropped, with a NUL for each key that is not text."""

    @property
    def idle(self) -> bool:
        return not self._waiting and not self._turning

    @property
    def held(self) -> bool:
        """Whether keys wait until their meaning is known."""
        return bool(self._held)

    @property
    def enter_waits(self) -> bool:
        return any(isinstance(event, events.Key) and event.key == "enter" for event in self._waiting)

    def take(self, event: Message) -> bool:
        """Take a key, a paste or a mouse button; return False for any other message."""
        if not isinstance(event, Typed) or event.is_forwarded:
            return False
        if self._closed:
            self._drop(event)
            return True
        if self._may_be_too_early(event) and self._not_heard():
            self._drop(event)
            return True
        self._waiting.append(event)
        self._wake()
        return True

    def start(self) -> None:
        self._awake = True
        self._wake()

    # What came before a stop, and what the screen changed under

    def clear(self) -> str:
        """Drop what waits; return its text, with a NUL for each key that is not text."""
        text = "".join(isinstance(event, events.Key) and event.character or "\0" for event in self._waiting)
        self._waiting.clear()
        return text

    def drop(self) -> None:
        """Drop what waits; `take_dropped` has its text."""
        while self._waiting:
            self._drop(self._waiting.popleft())

    def _drop(self, event: Typed) -> None:
        if isinstance(event, events.Paste):
            self._dropped += f"{event.text}\r"
        elif isinstance(event, events.Key):
            self._dropped += "\r" if event.key == "enter" else event.character or "\0"
        self._dropped = self._dropped[-MOST_DROPPED:]

    def take_dropped(self) -> str:
        """Return the text that was dropped while keys were held, or since the screen changed, and forget it.

        It has a NUL for each key that is not text.
        """
        text, self._dropped = self._dropped, ""
        return text

    def close(self) -> None:
        """Drop what waits and all that comes: the app ends."""
        self._closed = True
        self.drop()

    def hold(self, by: object) -> None:
        """Make keys wait until their meaning is known: until each who holds them has released them."""
        if not self._held:
            self._dropped = ""
        self._held.add(by)

    def release(self, by: object) -> None:
        self._held.discard(by)
        self._wake()

    def turn_deaf(self) -> None:
        """Discard keys until a pause: the screen changed by itself, and the person has not seen it yet."""
        self._deaf_until, self._deaf = self._now() + DEAF_TIME, 0
        if not self._held:
            self._dropped = ""
        waited = list(self._waiting)
        self._waiting = deque(event for event in waited if not self._may_be_too_early(event))
        for event in waited:
            if self._may_be_too_early(event):
                self._drop(event)
        if len(self._waiting) < len(waited):
            self._not_heard()

    def _may_be_too_early(self, event: Typed) -> bool:
        """Whether an event must wait for the person to have seen the screen; a key that stops something need not."""
        if isinstance(event, events.Key):
            return event.key not in getattr(self._app.screen, "STOPS", ())
        return isinstance(event, events.Paste)

    @staticmethod
    def _now() -> float:
        return asyncio.get_running_loop().time()

    def hear(self) -> None:
        """Let keys count at once: a stop closed what had appeared under them."""
        self._deaf_until = 0.0

    def _not_heard(self) -> bool:
        if self._now() >= self._deaf_until:
            return False
        self._deaf_until = self._now() + DEAF_TIME
        self._deaf += 1
        if self._deaf == 1:
            self._warn(EARLY)
        return True

    @property
    def early(self) -> str:
        """The words on keys that were discarded since the screen changed; empty if none were."""
        return EARLY if self._deaf else ""

    # Working it off

    def _wake(self) -> None:
        if self._awake and self._waiting and not self._turning and (not self._held or self._urgent() is not None):
            self._turning = self._app.call_later(self._turn)

    def _urgent(self) -> int | None:
        """Index of the first waiting key that does not wait while keys are held."""
        keys = ((n, event) for n, event in enumerate(self._waiting) if isinstance(event, events.Key))
        return next((n for n, event in keys if event.key in IMMEDIATE), None)

    def _next(self) -> Typed | None:
        if not self._held:
            return self._waiting.popleft() if self._waiting else None
        urgent = self._urgent()
        if urgent is None:
            return None
        for _ in range(urgent):
            self._drop(self._waiting.popleft())
        return self._waiting.popleft()

    async def _turn(self) -> None:
        screen, until = self._app.screen, time.monotonic() + LONGEST_KEY_SLICE
        try:
            # Another screen appears between turns, after what the previous event left to do.
            while self._app.screen is screen and time.monotonic() < until and (event := self._next()) is not None:
                await self._do(event)
            await asyncio.sleep(0)
        finally:
            self._turning = False
            self._wake()

    async def _do(self, event: Typed) -> None:
        if isinstance(event, events.Key):
            await self._press(event)
        elif not isinstance(event, events.Paste):
            await self._click(event)
        elif isinstance(
            self._app.focused, Input | TextArea
        ):  # any other widget would hand it on, and it would return here
            await self._app.focused.on_event(event)

    async def _press(self, key: events.Key) -> None:
        field = self._app.focused
        if isinstance(field, Input) and _plain(key):
            field.replace(self._run(key), *field.selection)
        elif isinstance(field, TextArea) and not field.read_only and _plain(key):
            field.replace(self._run(key), *field.selection, maintain_selection_offset=False)
        else:
            bound = self._binding(key.key) or (self._binding(key.key.lower()) if len(key.key) == 1 else None)
            if bound is not None:
                binding, node, enabled = bound
                if enabled:
                    await self._app.run_action(binding.action, node)

    def _run(self, key: events.Key) -> str:
        """Join a character with those that wait after it."""
        run = [key.character or ""]
        while self._waiting and len(run) < RUN:
            following = self._waiting[0]
            if not isinstance(following, events.Key) or not _plain(following):
                break
            run.append(following.character or "")
            self._waiting.popleft()
        return "".join(run)

    def _binding(self, key: str) -> tuple[Binding, DOMNode, bool] | None:
        """The binding of a key, and whether its action is possible now.

        `Screen.active_bindings` would ask for each key whether its action is possible. That takes longer than all else
        between Enter and the wire.
        """
        bound: tuple[Binding, DOMNode, bool] | None = None
        for node, bindings in self._app.screen._modal_binding_chain:
            for binding in bindings.key_to_bindings.get(key, ()):
                possible = self._app._check_action_state(binding.action, node)
                first = bound is None or (binding.priority and not bound[0].priority)
                if possible is not False and first:
                    bound = binding, node, bool(possible)
        return bound

    async def _click(self, event: events.MouseDown | events.MouseUp) -> None:
        app = self._app
        nodes: list[DOMNode] = []
        with suppress(NoWidget, NoMatches):
            nodes += app.get_widget_at(event.x, event.y)[0].ancestors_with_self
        if app.mouse_captured is not None:
            nodes += app.mouse_captured.ancestors_with_self
        await app.on_event(event)
        for node in nodes:
            if node is not app:
                await _worked_off(node)


def _plain(key: events.Key) -> bool:
    """True if a key is a character for a field."""
    return key.is_printable and not key.key.startswith("alt+")


async def _worked_off(node: DOMNode) -> None:
    """Wait until a widget has emptied its queue."""
    done = asyncio.Event()
    if node.call_later(done.set):
        with suppress(TimeoutError):
            async with asyncio.timeout(LONGEST_KEY_WAIT):
                await done.wait()
