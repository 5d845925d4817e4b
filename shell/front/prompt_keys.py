"""A held keyboard in the form that prompt_toolkit takes."""

from __future__ import annotations

import asyncio
import contextlib
import re
from collections.abc import Callable, Iterator

from prompt_toolkit.input import Input
from prompt_toolkit.input.typeahead import clear_typeahead
from prompt_toolkit.input.vt100_parser import Vt100Parser
from prompt_toolkit.key_binding import KeyPress

from multidrop.shell.front.keyboard import Keyboard

BEGIN, END = "\x1b[200~", "\x1b[201~"
"""The marks around a paste."""
LEAVE = "\x03"
"""Ctrl+C, which drops a paste that does not end."""
STALLED = 1.0
"""The time without a byte, s, after which an unfinished paste is reported."""
CURSOR = re.compile("\x1b\\[[0-9]+;[0-9]+R")


class KeyboardInput(Input):
    """Keys for prompt_toolkit. The keyboard sets the terminal and reads it; prompt_toolkit does neither.

    A paste with a stop inside is older than the stop: it is dropped to its end, whenever that comes.
    """

    def __init__(self, keyboard: Keyboard) -> None:
        self.keyboard = keyboard
        self.notify: Callable[[str], None] = lambda text: None
        """Called with a notice about a paste."""
        self._keys: list[KeyPress] = []
        self._parser = Vt100Parser(self._keys.append)
        self._resting = False
        """After an Enter: later text stays with the keyboard until the next prompt."""
        self._pasted: str | None = None
        """The beginning of a paste whose end has not come; None: there is none."""
        self._old = False
        """A stop came inside that paste."""
        self._tail = ""
        """The last characters, which may begin a mark."""
        self._stall: asyncio.TimerHandle | None = None
        self._stalled = False

    def fileno(self) -> int:
        """The terminal's descriptor."""
        return self.keyboard.descriptor

    def typeahead_hash(self) -> str:
        """The key under which prompt_toolkit keeps text typed after an Enter."""
        return f"keyboard-{self.keyboard.descriptor}"

    @property
    def closed(self) -> bool:
        """Whether the terminal is gone."""
        return self.keyboard.closed

    def read_keys(self) -> list[KeyPress]:
        """The next keys, of one line at most; after an Enter only the terminal's cursor reports."""
        if self._resting:
            found = CURSOR.search(self.keyboard.typed)
            self._parser.feed(self.keyboard.pick(*found.span()) if found else "")
            return self._parsed()
        text = self.keyboard.take()
        if self._stalled and text == LEAVE:
            self.forget("")
            self._old, self._pasted, self._tail = False, None, ""
            self._watch()
            self.notify("the paste that did not end was dropped")
            return []
        self._parser.feed(self._follow(text))
        self._watch()
        return self._parsed()

    def _follow(self, text: str) -> str:
        """Track the marks of pastes; return the rest of the text, for the parser."""
        whole = (self._tail if self._pasted is None else self._pasted) + text
        begin, end = whole.rfind(BEGIN), whole.rfind(END)
        self._tail = whole[1 - len(BEGIN) :]
        self._pasted = whole[begin:] if begin > end else None
        if not self._old:
            return text
        if end < 0:
            return ""
        self._old = False
        self.notify("the rest of the paste in which the stop came was dropped, too")
        return whole[whole.find(END) + len(END) :]

    def _watch(self) -> None:
        if self._stall is not None:
            self._stall.cancel()
        self._stalled = False
        pasting = self._pasted is not None
        self._stall = asyncio.get_running_loop().call_later(STALLED, self._stalls) if pasting else None

    def _stalls(self) -> None:
        self._stalled = True
        self.notify("a paste has not ended; until it does, keys belong to it. Ctrl+C drops it")

    def rest(self) -> None:
        """Pass on no more keys after an Enter, until the next prompt attaches."""
        self._resting = True

    def flush_keys(self) -> list[KeyPress]:
        """Return keys that could begin a longer sequence: Escape alone."""
        self._parser.flush()
        return self._parsed()

    def _parsed(self) -> list[KeyPress]:
        keys = self._keys[:]
        self._keys.clear()
        return keys

    def forget(self, dropped: str) -> str:
        """Drop all unfinished input after a stop; `dropped` was typed before it. Return the text that was not entered.

        Unfinished input is half an escape sequence, keys after an Enter, a paste without its end.
        """
        before = "" if self._old else self._pasted or ""
        left = self._follow(dropped)
        self._parser.reset()
        self._keys.clear()
        clear_typeahead(self)
        self._old = self._pasted is not None
        self._watch()
        return before + left

    def raw_mode(self) -> contextlib.AbstractContextManager[None]:
        """Do nothing: the terminal is raw throughout, so Ctrl+S never stops the output between two lines."""
        return contextlib.nullcontext()

    def cooked_mode(self) -> contextlib.AbstractContextManager[None]:
        """Do nothing: see `raw_mode`."""
        return contextlib.nullcontext()

    @contextlib.contextmanager
    def attach(self, input_ready_callback: Callable[[], None]) -> Iterator[None]:
        """Call back while there are keys."""
        self._resting = False
        before = self.keyboard.listen(input_ready_callback)
        try:
            yield
        finally:
            self.keyboard.listen(before)

    @contextlib.contextmanager
    def detach(self) -> Iterator[None]:
        """Suspend the callback."""
        before = self.keyboard.listen(None)
        try:
            yield
        finally:
            self.keyboard.listen(before)
