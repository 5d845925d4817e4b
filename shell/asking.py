"""Questions to a person, put by the front end: a yes before a step (or `--yes` beforehand), and values of a form."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Mapping, Sequence
from dataclasses import dataclass

from multidrop.dialects import Diagnostic, Stopped
from multidrop.shell.channel import Channel
from multidrop.shell.events import By
from multidrop.shell.tasks import Tasks

Ask = Callable[[str], Awaitable[bool]]
"""Puts one question to a person, and returns whether the answer is yes. A stop cancels it."""


@dataclass(frozen=True)
class Field:
    """A value that a person is asked for. `default` None: an answer is needed."""

    name: str
    valid: str
    default: str | None
    take: Callable[[str], object]
    """Raises Diagnostic for an invalid answer."""
    choices: tuple[str, ...] = ()
    """The only valid answers, if there are so few."""

    def problem(self, text: str) -> str:
        """Describe what is wrong with an answer in one line; empty: nothing."""
        try:
            self.take(text)
        except Diagnostic as problem:
            return str(problem)
        return ""


Fill = Callable[[str, Sequence[Field]], Awaitable[Mapping[str, str] | None]]
"""Puts a form to a person; returns the answers by name, None where the person gives up. A stop cancels it."""


class Asking(Channel):
    """A channel with questions, one at a time."""

    def __init__(self) -> None:
        super().__init__()
        self.agreed = False
        """Every question is answered with yes beforehand (`--yes`)."""
        self.ask: Ask | None = None
        """The front end's way to ask; None: it has no person to ask."""
        self.fill: Fill | None = None
        """The front end's way to ask for values; None: it has no person to ask."""
        self.way = "--yes"
        """The way to agree to every question beforehand."""
        self.beforehand = ""
        """How to agree to the questions of this front end beforehand, for the message after a no."""
        self.questions = Tasks(self.changed)
        """The open questions. A stop ends them."""
        self._turn = asyncio.Lock()

    async def confirm(self, what: str, where: str = "", so_far: str = "nothing was sent", by: By = By.OPERATOR) -> None:
        """Return once a person has agreed to `what`, one line that says what will happen. A script cannot ask.

        Raises Diagnostic after any other answer and without a person to ask, Stopped after a stop. `so_far`: what a
        caller that has sent something says instead.
        """
        if self.agreed:
            return
        if by is not By.OPERATOR:
            hint = f"{self.way} agrees beforehand, or type the line"
            raise Diagnostic(f"{what}; a {by.value} cannot ask, {so_far}", where, hint)
        if self.ask is None:
            raise Diagnostic(f"{what}; {so_far}", where, f"{self.way} agrees to it")
        question = f"{where}: {what}" if where else what
        try:
            agreed = await self.questions.run(self._answer(self.ask, question))
        except Stopped:
            raise Stopped(f"{where}: not done, as a stop came before the answer".removeprefix(": ")) from None
        if not agreed:
            raise Diagnostic("the answer was no, so it was not done", where, self.beforehand)
        self.notify(f"{question}: the answer was yes")

    async def agrees(self, what: str) -> bool:
        """Ask a person about a change that can be left. False without a person; `--yes` does not answer it."""
        if self.ask is None:
            return False
        try:
            return await self.questions.run(self._answer(self.ask, what))
        except Stopped:
            return False

    async def fill_in(self, title: str, fields: Sequence[Field]) -> Mapping[str, str]:
        """Ask a person for values. Raises Diagnostic without answers or a person, Stopped after a stop."""
        if self.fill is None:
            raise Diagnostic("values are needed, and no person can be asked", title, "give them as NAME=VALUE")
        try:
            answers = await self.questions.run(self._filled(self.fill, title, fields))
        except Stopped:
            raise Stopped(f"{title}: not done, as a stop came before the answer") from None
        if answers is None:
            raise Diagnostic("no values were given; nothing was sent", title)
        return answers

    async def _filled(self, fill: Fill, title: str, fields: Sequence[Field]) -> Mapping[str, str] | None:
        async with self._turn:
            return await fill(title, fields)

    async def _answer(self, ask: Ask, question: str) -> bool:
        async with self._turn:
            return await ask(question)
