"""The question before a step that a person must agree to: put by the front end, or answered beforehand by `--yes`."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable

from dialects import Diagnostic, Stopped
from shell.channel import Channel
from shell.tasks import Tasks

Ask = Callable[[str], Awaitable[bool]]
"""Puts one question to a person, and returns whether the answer is yes. A stop cancels it."""


class Asking(Channel):
    """A channel with questions, one at a time."""

    def __init__(self) -> None:
        super().__init__()
        self.agreed = False
        """Every question is answered with yes beforehand (`--yes`)."""
        self.ask: Ask | None = None
        """The front end's way to ask; None: it has no person to ask."""
        self.beforehand = ""
        """How to agree to the questions of this front end beforehand, for the message after a no."""
        self.questions = Tasks(self.changed)
        """The open questions. A stop ends them."""
        self._turn = asyncio.Lock()

    async def confirm(self, what: str, where: str = "", so_far: str = "nothing was sent") -> None:
        """Return once a person has agreed to `what`, one line that says what will happen.

        Raises Diagnostic after any other answer and without a person to ask, Stopped after a stop. `so_far`: what a
        caller that has sent something says instead.
        """
        if self.agreed:
            return
        if self.ask is None:
            raise Diagnostic(f"{what}; {so_far}", where, "--yes agrees to it")
        question = f"{where}: {what}" if where else what
        try:
            agreed = await self.questions.run(self._answer(self.ask, question))
        except Stopped:
            raise Stopped(f"{where}: not done, as a stop came before the answer".removeprefix(": ")) from None
        if not agreed:
            raise Diagnostic("the answer was no, so it was not done", where, self.beforehand)
        self.notify(f"{question}: the answer was yes")

    async def _answer(self, ask: Ask, question: str) -> bool:
        async with self._turn:
            return await ask(question)
