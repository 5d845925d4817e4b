"""A keyboard that is held for good, as prompt_toolkit wants its input."""

from __future__ import annotations

import asyncio
import contextlib
import re
from collections.abc import Callable, Iterator

from prompt_toolkit.input import Input
from prompt_toolkit.input.typeahead import clear_typeahead
from prompt_toolkit.input.vt100_parser import Vt100Parser
from prompt_toolkit.key_binding import KeyPress

from shell.front.keyboard import Keyboard

BEGIN, END = "\x1b[200~", "\x1b[201~"
"""What stands around a paste."""
LEAVE = "\x03"
"""Ctrl+C, which leaves a paste that does not end."""
STALLED = 1.0
"""Seconds without a byte after which a paste that has not ended is told."""
CURSOR = re.compile("\x1b\\[[0-9]+;[0-9]+R")


class KeyboardInput(Input):
    """Keys for prompt_toolkit, which neither sets the terminal nor reads from it: the keyboard does both throughout.

    A paste in which a stop came is older than the stop: it is dropped to its end, whenever that comes.
    """

    def __init__(self, keyboard: Keyboard) -> None:
        self.keyboard = keyboard
        self.notify: Callable[[str], None] = lambda text: None
        """Called with what a person should know of a paste."""
        self._keys: list[KeyPress] = []
        self._parser = Vt100Parser(self._keys.append)
        self._resting = False
        """A line was entered: its successors stay with the keyboard until the next prompt."""
        self._pasted: str | None = None
        """What has come of a paste whose end has not."""
        self._old = False
        """A stop came in it."""
        self._tail = ""
        """The last characters, which may be the first ones of a mark."""
        self._stall: asyncio.TimerHandle | None = None
        self._stalled = False

    def fileno(self) -> int:
        """The terminal's descriptor."""
        return self.keyboard.descriptor

    def typeahead_hash(self) -> str:
        """What prompt_toolkit keeps keys by that came behind an Enter."""
        return f"keyboard-{self.keyboard.descriptor}"

    @property
    def closed(self) -> bool:
        """Whether the terminal is gone."""
        return self.keyboard.closed

    def read_keys(self) -> list[KeyPress]:
        """The next keys, of one line at most; behind an Enter only the terminal's answers about its cursor."""
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
        """Keep up with where pastes begin and end; what is left of the text, for the parser."""
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
        """An Enter was taken: hand over no more until the next prompt attaches."""
        self._resting = True

    def flush_keys(self) -> list[KeyPress]:
        """What may have been the beginning of something longer: Escape alone."""
        self._parser.flush()
        return self._parsed()

    def _parsed(self) -> list[KeyPress]:
        keys = self._keys[:]
        self._keys.clear()
        return keys

    def forget(self, dropped: str) -> str:
        """A stop came, behind `dropped`: forget what was begun. What was typed and not entered is returned.

        That is half an escape sequence, keys behind an Enter, a paste without its end.
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
        """Nothing: it is raw throughout, so that Ctrl+S never stops the output between two lines."""
        return contextlib.nullcontext()

    def cooked_mode(self) -> contextlib.AbstractContextManager[None]:
        """Nothing: see `raw_mode`."""
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
        """Call nobody back."""
        before = self.keyboard.listen(None)
        try:
            yield
        finally:
            self.keyboard.listen(before)
