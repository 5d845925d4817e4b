"""The input of a person or a pipe without a prompt: lines, the answer to a question, the values of a form.

An answer is one key. Keys that were typed before the question could be read answer nothing.
"""

from __future__ import annotations

import asyncio
import os
import sys
import threading
from collections import deque
from collections.abc import AsyncIterator, Awaitable, Callable, Iterable, Sequence
from functools import partial

from multidrop.base.comments import uncommented
from multidrop.base.errors import Diagnostic
from multidrop.base.files import LARGEST_FILE, check_line, split_lines
from multidrop.base.text import visible
from multidrop.shell.channel import Ask, AskedValue
from multidrop.shell.prompt.keyboard import Keyboard, on_stop_key
from multidrop.shell.quitting import say_unsent
from multidrop.shell.session import Session
from multidrop.shell.streams.stdout import write

RAW_QUIET_TIME = 0.5
"""The quiet time that ends the input of a line in raw mode, s."""
INPUT = "standard input"
MOST_LINES_AHEAD = 4
"""The number of reads of standard input that may wait for their lines to run."""


async def run_lines(session: Session, lines: Iterable[str]) -> None:
    """Run lines from the command line in turn. Raises the first failure, and the loss of a bus that they went to."""
    left = deque(lines)
    while left:
        await session.run(left.popleft())
        for name in sorted({bus for bus, _ in session.addressed} & session.buses.keys()):
            if (loss := session.buses[name].link.lost) is not None:  # while no line used it: in a /sleep
                raise loss.again()
        if session.quitting:
            say_unsent(session, left)
            return


async def run_stream(session: Session, descriptor: int) -> None:
    """Run lines as they come from a descriptor; comments as in scripts. Raises the first failure.

    In raw mode it ends once the port has been quiet for a while: nothing else says that a reply is whole.
    """
    behind: deque[str] = deque()
    async for line in stream_lines(descriptor, behind):
        await session.run(uncommented(line))
        if session.quitting:
            say_unsent(session, map(uncommented, behind))
            return
    while (left := max((raw.last + RAW_QUIET_TIME - session.now() for raw in session.raw.values()), default=0.0)) > 0:
        await asyncio.sleep(left)


async def stream_lines(descriptor: int, left: deque[str] | None = None) -> AsyncIterator[str]:
    """Yield the lines of a descriptor (file, pipe), read by a daemon thread with bounded read-ahead.

    `left` holds the lines that were read in the same piece as the one that is yielded, and follow it.

    Raises Diagnostic for a character that no line may have, and for a line without an end.
    """
    loop = asyncio.get_running_loop()
    queue: asyncio.Queue[bytes] = asyncio.Queue()
    room = threading.Semaphore(MOST_LINES_AHEAD)

    def hand_over(data: bytes) -> None:
        if not loop.is_closed():
            loop.call_soon_threadsafe(queue.put_nowait, data)

    def read() -> None:
        try:
            while room.acquire() and (data := os.read(descriptor, 65536)):
                hand_over(data)
        except OSError:
            pass  # the lines read so far still run
        hand_over(b"")

    threading.Thread(target=read, daemon=True, name="standard input").start()
    rest, number = b"", 0
    left = deque() if left is None else left
    while data := await queue.get():
        *whole, rest = (rest + data).split(b"\n")
        if len(rest) > LARGEST_FILE:
            raise Diagnostic(
                f"a line is larger than {LARGEST_FILE // 1024**2} MB", f"{INPUT}:{number + len(whole) + 1}"
            )
        left.extend(line.removesuffix(b"\r").decode("utf-8", "replace") for line in whole)
        while left:
            number += 1
            text = left.popleft()
            text = text.removeprefix("\ufeff") if number == 1 else text
            check_line(text, INPUT, number)
            yield text
        room.release()
    last = rest.decode("utf-8", "replace").removesuffix("\x1a")
    left.extend([last] if number else split_lines(last))
    while left:
        number += 1
        text = left.popleft()
        check_line(text, INPUT, number)
        if text:
            yield text


GO_ON = "Go on? [y/N]"
TYPING_PAUSE = 0.5
"""The time without a key, s, after which a key counts: until then it may have been typed ahead."""
YES = ("y", "Y")
NO = ("n", "N", "\r", "\n", "\x1b", "\x03", "\x04")
"""No, Enter, Escape, Ctrl+C and Ctrl+D."""


class TypedAnswer:
    """The answer to a question that is shown from `at` on, s."""

    def __init__(self, at: float) -> None:
        self._last = at

    def quiet_at(self) -> float:
        """The time from which a key counts, if none comes before."""
        return self._last + TYPING_PAUSE

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
    answer = TypedAnswer(loop.time())

    def listen() -> None:
        for key in keyboard.take():
            agreed = answer.key(key, loop.time())
            if agreed is not None and not answered.done():
                answered.set_result(agreed)

    before = keyboard.listen(listen)
    try:
        return await answered
    finally:
        keyboard.forget()
        keyboard.listen(before)


async def ask_outside_a_session(question: str) -> bool | None:
    """Ask at the terminal of a command that has no session; None where there is none. The stop key is a no."""
    answering: list[asyncio.Future[bool]] = []

    def end() -> None:
        for future in answering:
            future.cancel()

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
    return None if keyboard is None else partial(at_keyboard, keyboard)


NEEDED = "a value is needed; Ctrl+C gives up"


def question(title: str, field: AskedValue) -> str:
    default = f" [{field.default}]" if field.default is not None else ""
    return visible(f"{title}: {field.name}, {field.valid}{default}: ")


def problem(field: AskedValue, text: str) -> str:
    """Describe what is wrong with an answer; empty: nothing. An empty answer stands for the default."""
    if not text and field.default is None:
        return NEEDED
    return field.problem(text or field.default or "")


async def filled(
    ask: Callable[[str], Awaitable[str | None]], tell: Callable[[str], None], title: str, fields: Sequence[AskedValue]
) -> dict[str, str] | None:
    """Ask for each value until it is valid; None once the person gives up."""
    answers: dict[str, str] = {}
    for field in fields:
        while True:
            text = await ask(question(title, field))
            if text is None:
                return None
            if not (wrong := problem(field, text.strip())):
                break
            tell(wrong)
        answers[field.name] = text.strip() or field.default or ""
    return answers


def at_terminal(title: str, fields: Sequence[AskedValue]) -> dict[str, str] | None:
    """Ask at the terminal of a command, before it opens anything; None at the end of the input."""
    answers: dict[str, str] = {}
    for field in fields:
        while True:
            sys.stderr.write(question(title, field))
            sys.stderr.flush()
            line = sys.stdin.readline()
            if not line:
                return None
            if not (wrong := problem(field, line.strip())):
                break
            sys.stderr.write(f"{visible(wrong)}\n")
        answers[field.name] = line.strip() or field.default or ""
    return answers


def can_ask() -> bool:
    """True if a person sees questions and can answer them."""
    return sys.stdin.isatty() and sys.stderr.isatty()
