"""`multidrop sim`: a cell served to the outside until a signal ends it."""

from __future__ import annotations

import asyncio
import contextlib
import io
import json as json_text
import os
import signal
import sys
import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TextIO
from urllib.parse import urlsplit

from multidrop.base.errors import Diagnostic
from multidrop.base.files import bounded, check_line
from multidrop.base.text import visible
from multidrop.simulator import cells
from multidrop.simulator.cell.endpoint_kinds import kind_of
from multidrop.simulator.floor import Floor
from multidrop.simulator.serving.endpoints import Served, serve_bus
from multidrop.simulator.serving.running import RunningFloor
from multidrop.transports.sockets import exposed

INPUT = "standard input"
LONGEST_INPUT_LINE = 64 * 1024
"""Bytes of a line of it."""
SIGNALS = (signal.SIGINT, signal.SIGTERM, *(getattr(signal, name, signal.SIGTERM) for name in ("SIGHUP", "SIGBREAK")))


async def serve(
    cell_path: str | None, *, json: bool, speed: float, stdin: TextIO | None, stdout: TextIO, allow: Sequence[Path] = ()
) -> None:
    """Serve a cell (None: the demo cell) until SIGINT, SIGTERM or SIGHUP; `allow`: its paths may lead there, too.

    Print the endpoints on `stdout`, carry out the `/sim` lines of `stdin` (their errors go to standard error), and
    remove the links at the end. Raises Diagnostic for an error in the cell, and for an endpoint that cannot be served.
    """
    if not speed > 0:
        raise Diagnostic(f"no speed {speed:g}", "--speed", "valid: above 0; 1 is real time, 10 ten times as fast")
    cell = cells.demo() if cell_path is None else cells.load(cell_path, allow)
    loop = asyncio.get_running_loop()
    over = asyncio.Event()
    async with contextlib.AsyncExitStack() as stack:
        floor = RunningFloor(Floor(cell), speed)
        floor.notify = _warn
        stack.callback(floor.close)
        stack.callback(_on_signals(loop, over.set))
        open_to_all = []
        for bus in cell.buses:
            for served in await serve_bus(floor, bus, stack):
                _print_endpoint(served, json, stdout)
                kind = kind_of(served.endpoint.partition(":")[0])
                if kind is not None and kind.remark is not None:
                    try:
                        _narrate(kind.remark(served.endpoint))
                    except Diagnostic as failure:  # by others
                        _warn(str(failure))
                open_to_all += [f"{served.bus} {served.endpoint}"] if reachable(served.endpoint) else []
        if open_to_all:
            _warn(f"{', '.join(open_to_all)}: open to the network, not only to this computer; serve 127.0.0.1 for that")
        _print_endpoint(None, json, stdout)
        if stdin is not None:
            stack.callback(read_lines(loop, stdin, lambda line: _carry_out(floor, line)))
        await over.wait()


def reachable(endpoint: str) -> bool:
    """Whether other computers can reach an endpoint; a pseudo-terminal has no host."""
    host = urlsplit(endpoint).hostname
    return host is not None and exposed(host)


def _warn(text: str) -> None:
    _narrate(f"multidrop: {text}")


def _narrate(text: str) -> None:
    with contextlib.suppress(OSError):
        print(visible(text), file=sys.stderr, flush=True)


def _print_endpoint(served: Served | None, json: bool, stdout: TextIO) -> None:
    """Print one endpoint, or (None) that all of them are open. A reader that stops reading is served all the same."""
    if json:
        fact = {"ready": True} if served is None else {"bus": served.bus, "endpoint": served.endpoint}
        text = json_text.dumps(fact)
    elif served is not None:
        text = visible(f"{served.bus:<12} {served.endpoint}")
    else:
        text = "ready: /sim lines move the world, Ctrl+C ends it"
    with contextlib.suppress(BrokenPipeError):
        print(text, file=stdout, flush=True)


def _carry_out(floor: RunningFloor, line: str) -> None:
    """Carry out a line of standard input; an error in it is printed, and the simulation continues."""
    line = line.strip()
    if not line:
        return
    try:
        check_line(line, INPUT)
        if line.startswith("#"):
            return
        if not line.startswith("/sim"):
            raise Diagnostic(f'not understood: "{line}"', INPUT, "only /sim lines are read here")
        floor.command(line)
    except Diagnostic as error:
        _warn(str(error))


def _on_signals(loop: asyncio.AbstractEventLoop, end: Callable[[], None]) -> Callable[[], None]:
    """Let signals end it where they can be taken; call what is returned to undo that."""
    undo = contextlib.ExitStack()
    for each in dict.fromkeys(SIGNALS):
        with contextlib.suppress(NotImplementedError, RuntimeError, ValueError):
            if sys.platform == "win32":  # the loop there takes none, but one wakes it
                undo.callback(signal.signal, each, signal.signal(each, lambda *_: loop.call_soon_threadsafe(end)))
            else:
                loop.add_signal_handler(each, end)
                undo.callback(loop.remove_signal_handler, each)
    return undo.close


def read_lines(loop: asyncio.AbstractEventLoop, stdin: TextIO, take: Callable[[str], None]) -> Callable[[], None]:
    """Pass on the lines of a stream as they come; its end has no effect. Call what is returned to stop.

    A file never blocks, so it is read at once. `stdin` needs a descriptor. Raises Diagnostic for one that is too large.
    """
    fd = stdin.fileno()
    begun = bytearray()

    def readable() -> None:
        data = os.read(fd, 4096)
        *lines, rest = (bytes(begun) + data).split(b"\n")
        if len(rest) > LONGEST_INPUT_LINE:
            _warn(f"{INPUT}: a line of more than {LONGEST_INPUT_LINE} bytes was dropped")
            rest = b""
        begun[:] = rest
        if not data:
            loop.remove_reader(fd)
            lines, begun[:] = [rest], b""
        for line in lines:
            take(line.decode("utf-8", "replace"))

    def read_all() -> None:
        if isinstance(stdin, io.TextIOWrapper):
            stdin.reconfigure(errors="replace")
        for line in stdin:
            loop.call_soon_threadsafe(take, line)

    def end() -> None:
        loop.remove_reader(fd)

    try:
        loop.add_reader(fd, readable)
    except NotImplementedError:  # Windows waits for sockets only.
        threading.Thread(target=read_all, daemon=True).start()
    except OSError:
        with open(fd, "rb", closefd=False) as file:
            for line in bounded(file, INPUT).decode("utf-8", "replace").split("\n"):
                loop.call_soon(take, line)
    else:
        return end
    return lambda: None
