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

from shell.front.answer import GO_ON, Answer

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
        self.open = Condition(lambda: self._given is not None)
        """Whether keys answer."""
        app.key_processor.before_key_press += lambda _: self._ahead()

    async def ask(self, question: str) -> bool:
        """Put a question; return the answer."""
        loop = asyncio.get_running_loop()
        self.shown, self._answer = f"{question}. {GO_ON} ", Answer(loop.time())
        self._draw()
        try:
            while (left := self._answer.quiet_at() - loop.time()) > 0:
                await asyncio.sleep(left)
            self._begin()
            self._given = loop.create_future()
            self._draw()
            return await self._given
        finally:
            self.shown, self._answer, self._given = "", None, None
            self._draw()

    def no(self) -> None:
        """Answer with no."""
        if self._given is not None and not self._given.done():
            self._given.set_result(False)

    def bind(self, bindings: KeyBindings) -> None:
        """Bind the keys of the answer, ahead of the line's own. A key that answers nothing does nothing."""
        for name, key in KEYS.items():
            bindings.add(name, filter=self.open, eager=True)(lambda event, key=key: self._key(key))
        bindings.add(Keys.Any, filter=self.open, eager=True)(lambda event: self._key(""))
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
