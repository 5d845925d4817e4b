"""Serving one client: on standard input and output, or on a TCP port.

Standard output belongs to the protocol: all other prints go to standard error. A signal ends the process at once, also
while a client does not read: the server has no state to save.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from json import JSONDecodeError
from types import FrameType

from pygls.exceptions import JsonRpcException
from pygls.io_ import run_async

from multidrop.base.errors import Diagnostic
from multidrop.features.lsp.server import Server
from multidrop.shell.signals import SIGNALS
from multidrop.transports.sockets import exposed

PIECE = 65536


class _Input:
    """A client's messages. The end of the stream, also within a message, is empty bytes."""

    def __init__(self, stream: asyncio.StreamReader) -> None:
        self._stream = stream

    async def readline(self) -> bytes:
        try:
            return await self._stream.readline()
        except (OSError, ValueError):  # lost; a line longer than any header
            return b""

    async def readexactly(self, n: int) -> bytes:
        try:
            return await self._stream.readexactly(n)
        except (OSError, asyncio.IncompleteReadError):
            return b""


class _Output:
    """Writes to a client. One that is gone ends the process."""

    def __init__(self, write: Callable[[bytes], object]) -> None:
        self._write = write

    def write(self, data: bytes) -> None:
        try:
            self._write(data)
        except OSError:
            raise SystemExit(1) from None

    def close(self) -> None:
        """Leave the stream open: the interpreter closes it."""


class _Reports(logging.Handler):
    """Writes what the library reports: a wrong message of the client in one line, a bug of ours with its traceback."""

    def emit(self, record: logging.LogRecord) -> None:
        failure = record.exc_info[1] if record.exc_info else None
        if isinstance(failure, JsonRpcException):  # a refused request
            return
        first = record.getMessage().partition("\n")[0]
        if isinstance(failure, (JSONDecodeError, UnicodeDecodeError)):
            first = f"{first}: {failure}"
            failure = None
        with contextlib.suppress(OSError):
            print(f"multidrop: {first}" if failure is None else self.format(record), file=sys.stderr, flush=True)


def serve(product: str, tcp: tuple[str, int] | None) -> int:
    """Serve one client until it ends the session or is gone. Raises Diagnostic where the port cannot be served.

    Return 0 after `shutdown` and `exit`, and after a signal; 1 where the client left otherwise.
    """
    library = logging.getLogger("pygls")
    library.propagate, library.handlers = False, [_Reports(logging.ERROR)]
    server = Server(product)
    with _signals():
        try:
            asyncio.run(_stdio(server) if tcp is None else serve_port(server, *tcp))
        except SystemExit as end:
            return int(end.code or 0)
    return 1


async def _run(server: Server, stream: asyncio.StreamReader, write: Callable[[bytes], object]) -> None:
    lines = server.protocol_server
    lines.protocol.set_writer(_Output(write))
    await run_async(
        stop_event=threading.Event(),
        reader=_Input(stream),
        protocol=lines.protocol,
        error_handler=lines.report_server_error,
    )


async def _stdio(server: Server) -> None:
    """Serve the client at standard input and output; other prints go to standard error."""
    sys.stdout.flush()
    before = sys.stdout
    sys.stdout = sys.stderr

    def write(data: bytes) -> None:
        before.buffer.write(data)
        before.buffer.flush()

    try:
        await _run(server, _standard_input(), write)
    finally:
        sys.stdout = before


def _standard_input() -> asyncio.StreamReader:
    """Return the bytes of standard input, read by a thread: it may be a pipe, a socket, a terminal or a file."""
    loop, stream = asyncio.get_running_loop(), asyncio.StreamReader()

    def read() -> None:
        with contextlib.suppress(RuntimeError):  # the loop is closed
            with contextlib.suppress(OSError):
                while data := os.read(0, PIECE):
                    loop.call_soon_threadsafe(stream.feed_data, data)
            loop.call_soon_threadsafe(stream.feed_eof)

    threading.Thread(target=read, daemon=True).start()
    return stream


async def serve_port(server: Server, host: str, port: int) -> None:
    client: asyncio.Future[tuple[asyncio.StreamReader, asyncio.StreamWriter]]
    client = asyncio.get_running_loop().create_future()

    def connected(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        if client.done():
            writer.close()
        else:
            client.set_result((reader, writer))

    try:
        listener = await asyncio.start_server(connected, host, port)
    except OSError as problem:
        what = f"port {port} of {host} cannot be served: {problem.strerror or problem}"
        raise Diagnostic(what, "--tcp", "0 takes a free one") from problem
    address = listener.sockets[0].getsockname()
    print(f"tcp://{address[0]}:{address[1]}", flush=True)
    if exposed(host):
        print(f"multidrop: {host} is open to the network; 127.0.0.1 is not", file=sys.stderr, flush=True)
    reader, writer = await client
    listener.close()
    await _run(server, reader, writer.write)


@contextlib.contextmanager
def _signals() -> Iterator[None]:
    """Let a signal end the process with exit code 0, whatever it does."""

    def end(number: int, frame: FrameType | None) -> None:
        raise SystemExit(0)

    before = {each: signal.signal(each, end) for each in SIGNALS}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
