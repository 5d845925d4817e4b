"""The end that a person asks for: what was sent is answered first, and no line that is typed after it is sent.

A quit is decided, and then accepted or declined. The front end decides (`before_quit`): it asks where a drive moves.
From the acceptance on a session refuses every line of a person except `/stop`, and the stop key works until the
process ends. The `on_early_end` lines of a macro are still executed: no person types them.
"""

from __future__ import annotations

import asyncio
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import Any

from multidrop.base.text import counted, visible
from multidrop.shell.channel import Channel

EVEN_NOW = "/stop"
"""The line that is executed after an accepted quit, too."""
GOES_ON = "multidrop goes on"
"""The outcome of a quit that was declined."""
ENDING = "multidrop is ending"
"""Why a line is not sent after an accepted quit."""
MOST_NAMED_LINES = 10
"""The number of unsent lines that are named one by one."""


class Unanswered:
    """The lines for drives that a session has begun to send, and that are not answered yet."""

    def __init__(self) -> None:
        self._sent: dict[asyncio.Task[Any], tuple[str, asyncio.Event]] = {}
        """By the task that sends it: a line, and what is set once it is answered. The task may go on with others."""

    @contextmanager
    def sending(self, text: str) -> Iterator[None]:
        """Note a line until it is answered, in the task that sends it."""
        task = asyncio.current_task()
        if task is None or task in self._sent:
            yield
            return
        answered = asyncio.Event()
        self._sent[task] = text.strip(), answered
        try:
            yield
        finally:
            del self._sent[task]
            answered.set()

    async def answered(self, limit: float) -> list[str]:
        """Wait until all of them are answered, for `limit` seconds at most; return a text for each other one."""
        own = asyncio.current_task()
        waiting = [sent for task, sent in self._sent.items() if task is not own]
        with suppress(TimeoutError):
            async with asyncio.timeout(limit):
                for _, answered in waiting:
                    await answered.wait()
        return [f"'{text}' is not answered yet" for text, answered in waiting if not answered.is_set()]


def say_unsent(channel: Channel, lines: Iterable[str]) -> None:
    """Name the lines that follow a quit."""
    for text in not_sent([*lines], "it follows a /quit"):
        channel.notify(text, warning=True)


def not_sent(lines: Sequence[str], why: str = ENDING) -> list[str]:
    """Name lines that were typed and are not sent, in lines for a person."""
    typed = [line.strip() for line in lines if line.strip()]
    named = [f"not sent, as {why}: {visible(line)}" for line in typed[:MOST_NAMED_LINES]]
    if len(typed) > MOST_NAMED_LINES:
        named.append(f"{counted(len(typed) - MOST_NAMED_LINES, 'more line was', 'more lines were')} not sent")
    return named
