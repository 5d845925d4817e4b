"""The answer to a question as one key. Keys that were typed before it could be read answer nothing."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import AsyncIterator
from functools import partial

from multidrop.shell.asking import Ask
from multidrop.shell.front.interrupts import on_stop_key
from multidrop.shell.front.keyboard import Keyboard
from multidrop.shell.front.stream import stream_lines
from multidrop.shell.output import write

GO_ON = "Go on? [y/N]"
PAUSE = 0.5
"""The time without a key, s, after which a key counts: until then it may have been typed ahead."""
YES = ("y", "Y")
NO = ("n", "N", "\r", "\n", "\x1b", "\x03", "\x04")
"""No, Enter, Escape, Ctrl+C and Ctrl+D."""


class Answer:
    """The answer to a question that is shown from `at` on, s."""

    def __init__(self, at: float) -> None:
        self._last = at

    def quiet_at(self) -> float:
        """The time from which a key counts, if none comes before."""
        return self._last + PAUSE

    def key(self, key: str, at: float) -> bool | None:
        """Take a key; return the answer, None if it is none."""
        counts = at >= self.quiet_at()
        self._last = at
        if not counts or key not in (*YES, *NO):
            return None
        return key in YES


async def at_keyboard(keyboard: Keyboard, question: str) -> bool:
    """Ask on standard error, and take the answer from a held keyboard."""
    loop = asyncio.get_running_loop()
    answered: asyncio.Future[bool] = loop.create_future()
    keyboard.forget()
    write(sys.stderr, f"{question}. {GO_ON}")
    answer = Answer(loop.time())

    def listen() -> None:
        for key in keyboard.take():
            found = answer.key(key, loop.time())
            if found is not None and not answered.done():
                answered.set_result(found)

    before = keyboard.listen(listen)
    try:
        return await answered
    finally:
        keyboard.forget()
        keyboard.listen(before)


def at_lines(lines: AsyncIterator[str]) -> Ask:
    """Return how to ask on standard error, and take whole lines: where the keys of a terminal cannot be held."""

    async def ask(question: str) -> bool:
        loop = asyncio.get_running_loop()
        write(sys.stderr, f"{question}. {GO_ON}")
        counts_at = loop.time() + PAUSE
        async for line in lines:
            if loop.time() >= counts_at:
                return line.strip() in YES
        return False

    return ask


async def ask_outside_a_session(question: str) -> bool | None:
    """Ask at the terminal of a command that has no session; None where there is none. The stop key is a no."""
    answering: list[asyncio.Future[bool]] = []

    def end() -> None:
        for each in answering:
            each.cancel()

    with on_stop_key(lambda: None, end, end) as keyboard:
        ask = asker(keyboard)
        if ask is None:
            return None
        answering.append(asyncio.ensure_future(ask(question)))
        await asyncio.wait(answering)
        return not answering[0].cancelled() and answering[0].result()


def asker(keyboard: Keyboard | None) -> Ask | None:
    """Return how to ask at the terminal of a command; None where there is none, or where the question is not seen."""
    if not sys.stderr.isatty():
        return None
    if keyboard is not None:
        return partial(at_keyboard, keyboard)
    if sys.platform == "win32" and sys.stdin.isatty():
        return at_lines(stream_lines(sys.stdin.fileno()))
    return None
