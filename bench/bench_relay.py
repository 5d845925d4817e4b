"""A port through `ssh://` on loopback: round trips, their cost, the opening, and a stop behind a full queue.

The peer is a bare `ssh HOST cat` through the same sshd: what ssh itself takes. Rounds of the two take turns. It needs
sshd.

Run: python bench/bench_relay.py
"""

from __future__ import annotations

import asyncio
import os
import subprocess
import sys
import tempfile
import threading
import time
import tty
from collections.abc import Iterator
from pathlib import Path
from shutil import which

sys.path.insert(0, str(Path(__file__).parent.parent))

from bench_line import ANSWER, FRAME, PEER, REQUEST, timed, transact
from report import Row, alone, compared, main

from multidrop.drives.bus import Bus
from multidrop.transports.port_users import lock_owner
from multidrop.transports.ssh import RELAY, SOCAT, FarPort
from multidrop.transports.ssh_session import open_ssh
from tests.support.ssh_server import SSH, SSHD, ssh_server

ROUNDS = 5
TRIPS = 1000
TICKS = os.sysconf("SC_CLK_TCK")


def rows(full: bool) -> Iterator[Row]:
    """All figures."""
    if not (SSH and SSHD):
        return
    with tempfile.TemporaryDirectory() as folder, ssh_server(Path(folder)) as port:
        command = [sys.executable, "-c", PEER, "pty", FRAME[-1:].hex(), ANSWER.hex()]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as drive:
            try:
                assert drive.stdout is not None
                far = FarPort("127.0.0.1", drive.stdout.readline().strip(), port=port)
                yield from trips(far, TRIPS * (5 if full else 1))
                yield from openings(far)
            finally:
                drive.kill()
        yield from stops(port)


def trips(far: FarPort, count: int) -> Iterator[Row]:
    """Round trips a second, and processor time on both sides."""
    ours, peers, near, relay, bare, socat = [], [], [], [], [], []
    for _ in range(ROUNDS):
        seconds, busy, there = asyncio.run(through_bus(far, count, RELAY))
        ours.append(count / seconds)
        near.append(busy / count * 1e6)
        relay.append(there / count * 1e6)
        seconds, busy = through_cat(far, count)
        peers.append(count / seconds)
        bare.append(busy / count * 1e6)
        if which("socat"):
            socat.append(count / asyncio.run(through_bus(far, count, SOCAT))[0])
    yield compared("round trips, ssh://", "/s", ours, peers, "ssh cat", better="more")
    if socat:
        yield compared("round trips, ssh:// with multidrop there", "/s", ours, socat, "with socat there", better="more")
    yield compared("processor time a round trip, here", "us", near, bare, "ssh cat")
    yield alone("processor time a round trip, multidrop relay", "us", relay)


async def through_bus(far: FarPort, count: int, way: str) -> tuple[float, float, float]:
    """Seconds, processor seconds here, and those of the relay."""
    bus = Bus("bench", await open_ssh(far, way=way))
    bus.start()
    owner = lock_owner(far.path)
    assert owner is not None
    relay = owner.pid
    try:
        for _ in range(100):
            await transact(bus.link, REQUEST)
        begin, busy, there = time.perf_counter(), time.process_time(), spent(relay)
        for _ in range(count):
            reply = await transact(bus.link, REQUEST)
            assert reply.reply.text == "51200", reply
        return time.perf_counter() - begin, time.process_time() - busy, spent(relay) - there
    finally:
        await bus.close()


def spent(pid: int) -> float:
    """Processor seconds of a process."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / TICKS


def through_cat(far: FarPort, count: int) -> tuple[float, float]:
    """The reply's bytes to a far `cat` and back."""
    command = ["ssh", "-T", "-p", str(far.port), far.host, "exec cat"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, bufsize=0) as process:
        assert process.stdin is not None and process.stdout is not None
        give, take = process.stdin, process.stdout

        def once() -> bytes:
            give.write(ANSWER)
            answer = take.read(4096) or b""
            while not answer.endswith(b"\n"):
                answer += take.read(4096) or b""
            return answer

        try:
            return timed(once, count)
        finally:
            give.close()


def openings(far: FarPort) -> Iterator[Row]:
    """From nothing to an open port, beside a login that does nothing."""
    ours, peers = [], []
    for _ in range(ROUNDS):
        begin = time.perf_counter()
        asyncio.run(opened(far))
        ours.append(1e3 * (time.perf_counter() - begin))
        begin = time.perf_counter()
        subprocess.run(["ssh", "-T", "-p", str(far.port), far.host, "true"], check=True)
        peers.append(1e3 * (time.perf_counter() - begin))
    yield compared("open and close a port", "ms", ours, peers, "ssh true")


async def opened(far: FarPort) -> None:
    """Open a port and close it."""
    await (await open_ssh(far)).close()


def stops(port: int) -> Iterator[Row]:
    """From the stop key's thread to the far port, with an empty and with a full queue, on a port that is not read."""
    for figure, lines in (("a stop, nothing on its way", 0), ("a stop behind 20,000 lines", 20_000)):
        yield alone(figure, "ms", [asyncio.run(stop(port, lines)) for _ in range(ROUNDS)], aim=50)


async def stop(port: int, lines: int) -> float:
    """Milliseconds until the far side of the port has the stop."""
    far, near = os.openpty()
    tty.setraw(near)
    transport = await open_ssh(FarPort("127.0.0.1", os.ttyname(near), port=port))
    transport.start(lambda data: None, lambda error: None)
    for _ in range(lines):
        transport.write(b"MR 51200\r")
    await asyncio.sleep(0.3)
    took: list[float] = []

    def press() -> None:
        begin = time.perf_counter()
        transport.preempt(False, lambda dropped: b"\x1b")  # type: ignore[attr-defined]
        while b"\x1b" not in os.read(far, 65536):
            pass
        took.append(1e3 * (time.perf_counter() - begin))

    thread = threading.Thread(target=press)
    thread.start()
    thread.join(10.0)
    await transport.close()
    os.close(far)
    os.close(near)
    return took[0]


if __name__ == "__main__":
    main(rows)
