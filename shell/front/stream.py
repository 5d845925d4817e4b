"""Lines from the command line, and from standard input as they come."""

from __future__ import annotations

import asyncio
import os
import threading
from collections.abc import AsyncIterator, Iterable
from typing import TYPE_CHECKING

from multidrop.dialects import Diagnostic
from multidrop.dialects.files import LARGEST, check_line, split_lines
from multidrop.shell.lines import uncommented

if TYPE_CHECKING:
    from multidrop.shell.session import Session


QUIET = 0.5
"""The quiet time that ends the input of a line in raw mode, s."""
INPUT = "standard input"
AHEAD = 4
"""The number of reads of standard input that may wait for their lines to run."""


async def run_lines(session: Session, lines: Iterable[str]) -> None:
    """Run lines from the command line in turn. Raises the first failure, and the loss of a bus that they went to."""
    for line in lines:
        await session.run(line)
        for name in sorted({bus for bus, _ in session.addressed} & session.buses.keys()):
            if (loss := session.buses[name].link.lost) is not None:  # while no line used it: in a /sleep
                raise loss.again()
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
    """Yield the lines of a descriptor (file, pipe), read by a daemon thread with bounded read-ahead.

    Raises Diagnostic for a character that no line may have, and for a line without an end.
    """
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
    rest, number = b"", 0
    while data := await queue.get():
        *whole, rest = (rest + data).split(b"\n")
        if len(rest) > LARGEST:
            raise Diagnostic(f"a line is larger than {LARGEST // 1024**2} MB", f"{INPUT}:{number + len(whole) + 1}")
        for line in whole:
            number += 1
            text = line.removesuffix(b"\r").decode("utf-8", "replace")
            text = text.removeprefix("\ufeff") if number == 1 else text
            check_line(text, INPUT, number)
            yield text
        room.release()
    last = rest.decode("utf-8", "replace").removesuffix("\x1a")
    for text in [last] if number else split_lines(last):
        number += 1
        check_line(text, INPUT, number)
        if text:
            yield text
