"""Round trips a second through a Bus, beside the barest loop that one could write, over a pty and over TCP.

Both ask a peer in another process the same question in the same bytes; rounds of the two take turns, so that whatever
else the machine does meets both. What the difference buys: late replies distinguished, a stop that goes around the
queue, watchers, and a loop that is free for a screen meanwhile.

Run: python bench/bench_line.py
"""

from __future__ import annotations

import asyncio
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent))

import serial
from report import Row, compared, main

from multidrop.base.errors import TransportLost
from multidrop.dialects.codec import Request
from multidrop.drives.bus import Bus
from multidrop.drives.line import Transaction
from multidrop.drives.link import Link
from multidrop.families.lexium.host.mcode.codec import MCode
from multidrop.transports import Transport
from multidrop.transports.serial_port import open_serial
from multidrop.transports.sockets import open_tcp

ROUNDS = 7
TRIPS = 2000
AIMS = {"pty": 0.9, "tcp": 0.5}
ANSWER = b"51200\r\n"
DIALECT = MCode(em=1)
REQUEST = DIALECT.request("", "PR P")
FRAME = DIALECT.encode(REQUEST)

PEER = """
import os, socket, sys, tty
END, ANSWER = bytes.fromhex(sys.argv[2]), bytes.fromhex(sys.argv[3])
if sys.argv[1] == "pty":
    ours, theirs = os.openpty()
    tty.setraw(theirs)
    print(os.ttyname(theirs), flush=True)
    read, write = lambda: os.read(ours, 4096), lambda data: os.write(ours, data)
    while True:
        held = b""
        while not held.endswith(END):
            held += read()
        write(ANSWER)
server = socket.create_server(("127.0.0.1", 0))
print(server.getsockname()[1], flush=True)
while True:
    peer, _ = server.accept()
    peer.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    held = b"x"
    while held:
        held = peer.recv(4096)
        while held and not held.endswith(END):
            held += peer.recv(4096)
        if held:
            peer.sendall(ANSWER)
"""


async def transact(link: Link, request: Request) -> Transaction:
    """Send one request and return the whole transaction. Raises TransportLost."""
    answer: asyncio.Future[Transaction | TransportLost] = asyncio.get_running_loop().create_future()
    link.submit(request, answer.set_result)
    link.advance()
    found = await answer
    if isinstance(found, TransportLost):
        raise found
    return found


def rows(full: bool) -> Iterator[Row]:
    """Rates and processor time over a pty and over TCP."""
    for kind in AIMS:
        command = [sys.executable, "-c", PEER, kind, FRAME[-1:].hex(), ANSWER.hex()]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as peer:
            try:
                assert peer.stdout is not None
                yield from compare(kind, peer.stdout.readline().strip(), TRIPS * (5 if full else 1))
            finally:
                peer.kill()


def compare(kind: str, where: str, trips: int) -> Iterator[Row]:
    """Rounds of both in turn."""
    bare = bare_pty if kind == "pty" else bare_tcp
    rates: tuple[list[float], list[float]] = ([], [])
    costs: tuple[list[float], list[float]] = ([], [])
    for _ in range(ROUNDS):
        for index, work in enumerate((lambda: asyncio.run(through_bus(where, trips)), lambda: bare(where, trips))):
            seconds, busy = work()
            rates[index].append(trips / seconds)
            costs[index].append(busy / trips * 1e6)
    yield compared(f"round trips, {kind}", "/s", *rates, "bare loop", aim=AIMS[kind], aim_of="ratio", better="more")
    yield compared(f"processor time a round trip, {kind}", "us", *costs, "bare loop")


def timed(once: Callable[[], bytes], trips: int) -> tuple[float, float]:
    """Seconds, and seconds of CPU, that the trips took."""
    for _ in range(100):
        once()
    begin, busy = time.perf_counter(), time.process_time()
    for _ in range(trips):
        assert once() == ANSWER
    return time.perf_counter() - begin, time.process_time() - busy


def bare_pty(where: str, trips: int) -> tuple[float, float]:
    """pyserial: write, read a line."""
    with serial.Serial(where, 115200, timeout=5) as port:

        def once() -> bytes:
            port.write(FRAME)
            return bytes(port.read_until(b"\n"))

        return timed(once, trips)


def bare_tcp(where: str, trips: int) -> tuple[float, float]:
    """A socket: send, receive a line."""
    with socket.create_connection(("127.0.0.1", int(where))) as peer:
        peer.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

        def once() -> bytes:
            peer.sendall(FRAME)
            answer = peer.recv(4096)
            while not answer.endswith(b"\n"):
                answer += peer.recv(4096)
            return answer

        return timed(once, trips)


async def through_bus(where: str, trips: int) -> tuple[float, float]:
    """`Bus.ask`, one after the other."""
    transport: Transport = await (open_tcp("127.0.0.1", int(where)) if where.isdigit() else open_serial(where, 115200))
    bus = Bus("bench", transport)
    bus.start()
    try:
        for _ in range(100):
            await transact(bus.link, REQUEST)
        begin, busy = time.perf_counter(), time.process_time()
        for _ in range(trips):
            reply = await transact(bus.link, REQUEST)
            assert reply.reply.text == "51200", reply
        return time.perf_counter() - begin, time.process_time() - busy
    finally:
        await bus.close()


if __name__ == "__main__":
    main(rows)
