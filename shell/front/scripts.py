"""Scripts: files of prompt lines, and lines from standard input."""

from __future__ import annotations

import asyncio
import os
import re
import threading
from collections.abc import AsyncIterator, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from dialects import Diagnostic
from dialects.files import bytes_of
from macros import fill
from shell.events import FAILURES, By
from shell.lines import VerbLine, parse

if TYPE_CHECKING:
    from shell.session import Session


QUIET = 0.5
"""The quiet time that ends the input of a line in raw mode, s."""
AHEAD = 4
"""The number of reads of standard input that may wait for their lines to run."""


@dataclass(frozen=True)
class ScriptLine:
    """A line of a script, without its comment and with its values."""

    where: str
    """`file:line`."""
    text: str


def read_script(file: str, values: Mapping[str, str]) -> list[ScriptLine]:
    """Read and check a script file before anything moves.

    Raises Diagnostic with `file:line` for a missing value, an unknown verb, an address without text.
    """
    if file.endswith(".py"):
        raise Diagnostic("is Python, not a script of lines", file, "run it with python; it may import multidrop")
    try:
        text = bytes_of(file).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise Diagnostic("is not UTF-8 text", file) from None
    numbered = ((f"{file}:{number}", uncommented(line)) for number, line in enumerate(text.splitlines(), 1))
    return [ScriptLine(where, _checked(where, line, values)) for where, line in numbered if line]


def uncommented(line: str) -> str:
    """The line without its comment: from a `#` at its head or after a space to its end."""
    return re.sub(r"(^|\s)#.*", "", line).strip()


def _checked(where: str, line: str, values: Mapping[str, str]) -> str:
    from shell.verbs.table import find

    filled = fill(line, values, where)
    try:
        parsed = parse(filled)
        if isinstance(parsed, VerbLine):
            find(parsed.name)
    except Diagnostic as problem:
        raise Diagnostic(str(problem), where) from None
    return filled


async def run_script(session: Session, lines: Sequence[ScriptLine]) -> None:
    """Run a script's lines in turn. Raises the first failure, with its place as a note."""
    for line in lines:
        try:
            await session.run(line.text, By.SCRIPT)
        except FAILURES as failure:
            failure.add_note(line.where)
            raise
        if session.quitting:
            return


async def run_lines(session: Session, lines: Iterable[str]) -> None:
    """Run lines from the command line in turn. Raises the first failure."""
    for line in lines:
        await session.run(line)
        if session.quitting:
            return


async def run_stream(session: Session, descriptor: int) -> None:
    """Run lines as they come from a descriptor; comments as in scripts. Raises the first failure.

    In raw mode it ends once the port has been quiet for a while: nothing else says that a reply is whole.
    """
    async for line in stream_lines(descriptor):
        await session.run(uncommented(line))
        if session.quitting:
            return
    while (left := max((raw.last + QUIET - session.now() for raw in session.raw.values()), default=0.0)) > 0:
        await asyncio.sleep(left)


async def stream_lines(descriptor: int) -> AsyncIterator[str]:
    """Yield the lines of a descriptor (file, pipe), read by a daemon thread with bounded read-ahead."""
    loop = asyncio.get_running_loop()
    queue: asyncio.Queue[bytes] = asyncio.Queue()
    room = threading.Semaphore(AHEAD)

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
    rest = b""
    while data := await queue.get():
        *whole, rest = (rest + data).split(b"\n")
        for line in whole:
            yield line.decode("utf-8", "replace")
        room.release()
    if rest:
        yield rest.decode("utf-8", "replace")
