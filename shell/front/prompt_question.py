"""The question at the prompt: shown in place of the drive's name, answered with one key.

Until keys pause, they were typed before the question could be read. They edit the line as ever, and a line that is
entered waits after the one that asks. Then half a line is dropped with a word, and a single key is the answer.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from prompt_toolkit.application import Application
from prompt_toolkit.filters import Condition
from prompt_toolkit.key_binding import KeyBindings
from prompt_toolkit.key_binding.bindings.cpr import load_cpr_bindings
from prompt_toolkit.keys import Keys

from multidrop.shell.front.terminal_input import GO_ON, Answer

KEYS = {"y": "y", "Y": "y", "n": "n", "N": "n", "enter": "n", "c-j": "n", "escape": "n", "c-d": "n"}
"""The answer of each key, by its name in prompt_toolkit. Ctrl+C is the prompt's own: it may be a stop."""


class PromptQuestion:
    """The question of one prompt. `begin` drops the line that is being typed, before keys answer."""

    def __init__(self, app: Application[str], begin: Callable[[], None]) -> None:
        self._app, self._begin = app, begin
        self._answer: Answer | None = None
        self._given: asyncio.Future[bool] | None = None
        self.shown = ""
        """The open question; empty: there is none."""
        self._text: asyncio.Future[str | None] | None = None
        self.open = Condition(lambda: self._given is not None)
        """Whether keys answer."""
        self.taking = Condition(lambda: self._text is not None)
        """Whether the next line is an answer."""
        app.key_processor.before_key_press += lambda _: self._ahead()

    async def ask(self, question: str) -> bool:
        """Put a question; return the answer."""
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
        self.shown, self._answer = shown, Answer(loop.time())
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
        if self._text is None or self._text.done():
            return False
        self._text.set_result(line)
        return True

    def bind(self, bindings: KeyBindings) -> None:
        """Bind the keys of the answer, ahead of the line's own. A key that answers nothing does nothing."""
        for name, key in KEYS.items():
            bindings.add(name, filter=self.open, eager=True)(lambda event, key=key: self._key(key))
        bindings.add(Keys.Any, filter=self.open, eager=True)(lambda event: self._key(""))
        for name in ("c-d", "escape"):
            bindings.add(name, filter=self.taking, eager=True)(lambda event: self.no())
        for each in load_cpr_bindings().bindings:  # the terminal's cursor reports are no keys
            bindings.add(*each.keys, filter=self.open, eager=True, save_before=each.save_before)(each.handler)

    def _ahead(self) -> None:
        """Note a key before keys answer."""
        if self._answer is not None and self._given is None:
            self._answer.key("", asyncio.get_running_loop().time())

    def _key(self, key: str) -> None:
        if self._answer is None or self._given is None or self._given.done():
            return
        found = self._answer.key(key, asyncio.get_running_loop().time())
        if found is not None:
            self._given.set_result(found)

    def _draw(self) -> None:
        if self._app.is_running:
            self._app.invalidate()
