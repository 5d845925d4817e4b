"""The keys of the prompt: a held keyboard in the form that prompt_toolkit takes, and the question that a key answers.

A question is shown in place of the drive's name. Until keys pause, they were typed before the question could be read:
they edit the line as ever, and a line that is entered waits after the one that asks. Then half a line is dropped with a
word, and a single key is the answer.
"""

from __future__ import annotations

import asyncio
import contextlib
import re
from collections.abc import Callable, Iterator

from prompt_toolkit.application import Application
from prompt_toolkit.filters import Condition
from prompt_toolkit.input import Input
from prompt_toolkit.input.typeahead import clear_typeahead, get_typeahead
from prompt_toolkit.input.vt100_parser import Vt100Parser
from prompt_toolkit.key_binding import KeyBindings, KeyPress
from prompt_toolkit.key_binding.bindings.cpr import load_cpr_bindings
from prompt_toolkit.keys import Keys

from multidrop.shell.prompt.keyboard import Keyboard
from multidrop.shell.prompt.terminal_input import GO_ON, TypedAnswer

BEGIN, END = "\x1b[200~", "\x1b[201~"
"""The marks around a paste."""
LEAVE = "\x03"
"""Ctrl+C, which drops a paste that does not end."""
PASTE_TIMEOUT = 1.0
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
        return self.keyboard.descriptor

    def typeahead_hash(self) -> str:
        """The key under which prompt_toolkit keeps text typed after an Enter."""
        return f"keyboard-{self.keyboard.descriptor}"

    @property
    def closed(self) -> bool:
        return self.keyboard.closed

    @property
    def enters_follow(self) -> bool:
        """Whether the end of another line was typed already."""
        return any(end in self.keyboard.typed for end in "\r\n")

    def read_keys(self) -> list[KeyPress]:
        """The next keys, of one line at most; after an Enter only the terminal's cursor reports."""
        if self._resting:
            match = CURSOR.search(self.keyboard.typed)
            self._parser.feed(self.keyboard.pick(*match.span()) if match else "")
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
        self._stall = asyncio.get_running_loop().call_later(PASTE_TIMEOUT, self._stalls) if pasting else None

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

    def drop_typed(self) -> str:
        """Drop the text that was typed and not taken yet, and return it. A paste without its end goes on."""
        ahead, typed = "".join(press.data for press in get_typeahead(self)), self.keyboard.typed
        self.keyboard.forget()
        self._follow(typed)
        return ahead + typed

    def raw_mode(self) -> contextlib.AbstractContextManager[None]:
        """Do nothing: the terminal is raw throughout, so Ctrl+S never stops the output between two lines."""
        return contextlib.nullcontext()

    def cooked_mode(self) -> contextlib.AbstractContextManager[None]:
        """Do nothing: see `raw_mode`."""
        return contextlib.nullcontext()

    @contextlib.contextmanager
    def attach(self, input_ready_callback: Callable[[], None]) -> Iterator[None]:
        self._resting = False
        before = self.keyboard.listen(input_ready_callback)
        try:
            yield
        finally:
            self.keyboard.listen(before)

    @contextlib.contextmanager
    def detach(self) -> Iterator[None]:
        before = self.keyboard.listen(None)
        try:
            yield
        finally:
            self.keyboard.listen(before)


KEYS = {"y": "y", "Y": "y", "n": "n", "N": "n", "enter": "n", "c-j": "n", "escape": "n", "c-d": "n"}
"""The answer of each key, by its name in prompt_toolkit. Ctrl+C is the prompt's own: it may be a stop."""


STOP_LINE = "/stop"


class PromptQuestion:
    """The question of one prompt. `begin` drops the line that is being typed, before keys answer."""

    def __init__(self, app: Application[str], begin: Callable[[], None], stop: Callable[[], None]) -> None:
        self._app, self._begin, self._stop = app, begin, stop
        self._typed = ""
        """What was typed on the question's line: `/stop` and Enter stop there, too, where Ctrl+X may not come."""
        self._answer: TypedAnswer | None = None
        self._given: asyncio.Future[bool] | None = None
        self.shown = ""
        """The open question; empty: there is none."""
        self._text: asyncio.Future[str | None] | None = None
        self.open = Condition(lambda: self._given is not None)
        """True if keys answer."""
        self.taking = Condition(lambda: self._text is not None)
        """True if the next line is an answer."""
        app.key_processor.before_key_press += lambda _: self._ahead()

    async def ask(self, question: str) -> bool:
        try:
            await self._quiet(f"{question}. {GO_ON} ")
            self._given = asyncio.get_running_loop().create_future()
            self._draw()
            return await self._given
        finally:
            self._end()

    async def ask_text(self, question: str) -> str | None:
        """Put a question whose answer is a line; None: the person gives up."""
        try:
            await self._quiet(question)
            self._answer, self._text = None, asyncio.get_running_loop().create_future()
            self._draw()
            return await self._text
        finally:
            self._end()

    async def _quiet(self, shown: str) -> None:
        """Show a question, and wait until keys pause."""
        loop = asyncio.get_running_loop()
        self.shown, self._typed, self._answer = shown, "", TypedAnswer(loop.time())
        self._draw()
        while (left := self._answer.quiet_at() - loop.time()) > 0:
            await asyncio.sleep(left)
        self._begin()

    def _end(self) -> None:
        self.shown, self._answer, self._given, self._text = "", None, None, None
        self._draw()

    def no(self) -> None:
        """Answer with no, or with no line."""
        if self._given is not None and not self._given.done():
            self._given.set_result(False)
        if self._text is not None and not self._text.done():
            self._text.set_result(None)

    def takes(self, line: str) -> bool:
        """Take a line that was entered, if it is an answer."""
        if self._text is None or self._text.done() or line.strip() == STOP_LINE:
            return False
        self._text.set_result(line)
        return True

    def bind(self, bindings: KeyBindings) -> None:
        """Bind the keys of the answer, ahead of the line's own. A key that answers nothing does nothing."""
        for name, key in KEYS.items():
            bindings.add(name, filter=self.open, eager=True)(lambda event, key=key: self._key(key, event.data))
        bindings.add(Keys.Any, filter=self.open, eager=True)(lambda event: self._key("", event.data))
        for name in ("c-d", "escape"):
            bindings.add(name, filter=self.taking, eager=True)(lambda event: self.no())
        for binding in load_cpr_bindings().bindings:  # the terminal's cursor reports are no keys
            bindings.add(*binding.keys, filter=self.open, eager=True, save_before=binding.save_before)(binding.handler)

    def _ahead(self) -> None:
        """Note a key before keys answer."""
        if self._answer is not None and self._given is None:
            self._answer.key("", asyncio.get_running_loop().time())

    def _key(self, key: str, text: str) -> None:
        if self._answer is None or self._given is None or self._given.done():
            return
        ends, before = text in ("\r", "\n"), self._typed
        self._typed = "" if ends else before + text
        if ends and before == STOP_LINE:
            self._stop()
            return
        answered = self._answer.key(key, asyncio.get_running_loop().time())
        if answered is not None:
            self._given.set_result(answered)

    def _draw(self) -> None:
        if self._app.is_running:
            self._app.invalidate()
