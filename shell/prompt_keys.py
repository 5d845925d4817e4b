"""A keyboard that is held for good, as prompt_toolkit wants its input."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Callable, Iterator

from prompt_toolkit.input import Input
from prompt_toolkit.input.typeahead import clear_typeahead
from prompt_toolkit.input.vt100_parser import Vt100Parser
from prompt_toolkit.key_binding import KeyPress

from shell.keyboard import Keyboard

BEGIN, END = "\x1b[200~", "\x1b[201~"
"""What stands around a paste."""
CURSOR = re.compile("\x1b\\[[0-9]+;[0-9]+R")


class KeyboardInput(Input):
    """Keys for prompt_toolkit, which neither sets the terminal nor reads from it: the keyboard does both throughout."""

    def __init__(self, keyboard: Keyboard) -> None:
        self.keyboard = keyboard
        self._keys: list[KeyPress] = []
        self._parser = Vt100Parser(self._keys.append)
        self._resting = False
        """A line was entered: its successors stay with the keyboard until the next prompt."""
        self._tail = ""
        self._pasted: str | None = None
        """What has come of a paste whose end has not."""

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
        else:
            text = self.keyboard.take()
            self._follow_paste(text)
            self._parser.feed(text)
        return self._parsed()

    def _follow_paste(self, text: str) -> None:
        whole = (self._tail if self._pasted is None else self._pasted) + text
        begin, end = whole.rfind(BEGIN), whole.rfind(END)
        self._pasted = whole[begin:] if begin > end else None
        self._tail = whole[-len(BEGIN) + 1 :]

    def rest(self) -> None:
        """An Enter was taken: hand over no more until the next prompt attaches."""
        self._resting = True

    def take_lines(self) -> str:
        """Take out the whole lines that were not handed over yet; a paste is not one before its own Enter."""
        head = self.keyboard.typed.partition(BEGIN)[0] if self._pasted is None else ""
        return self.keyboard.pick(0, max(head.rfind("\r"), head.rfind("\n")) + 1)

    def flush_keys(self) -> list[KeyPress]:
        """What may have been the beginning of something longer: Escape alone."""
        self._parser.flush()
        return self._parsed()

    def _parsed(self) -> list[KeyPress]:
        keys = self._keys[:]
        self._keys.clear()
        return keys

    def forget(self) -> str:
        """Forget what was begun: half an escape sequence, keys behind an Enter, a paste without its end (returned)."""
        pasted, self._pasted, self._tail = self._pasted or "", None, ""
        self._parser.reset()
        self._keys.clear()
        clear_typeahead(self)
        return pasted

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
