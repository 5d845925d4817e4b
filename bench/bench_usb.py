"""Round trips a second on USB: a Bus beside the barest loop that one could write, over the same controller in memory.

The controller replies after some milliseconds, as the manual says (6.1.2), or at once. The bare loop sends a packet and
waits for the next one: it knows no stale reply, no stop and no other caller. Rounds of the two take turns.

Run: python bench/bench_usb.py
"""

from __future__ import annotations

import asyncio
import sys
import time
from collections.abc import Awaitable, Callable, Iterator
from pathlib import Path
from random import Random

sys.path.insert(0, str(Path(__file__).parent.parent))

from bench_line import transact
from report import Row, compared, main

from multidrop.drives.bus import Bus
from multidrop.families.pmx.host.codec import Pmx
from multidrop.features.usb.device import sides
from multidrop.features.usb.pipe import open_usb
from multidrop.simulator.cells import read
from multidrop.simulator.floor import Floor
from multidrop.simulator.serving.running import RunningFloor
from tests.support.usb_stand_in import Plugged, Sockets

ROUNDS = 7
CELL = '[[bus]]\nname = "w"\n[[bus.drive]]\npersonality = "PMX"\n'
REPLY_TIMES = {"2 ms": (0.002, 300, 1.2), "at once": (0.0, 2000, None)}
"""The time of a reply, s, the trips of a round, and the aim of the ratio."""
REQUEST = Pmx(addressed=False).request("", "DN")
REPLY = "2ED00"


def rows(full: bool) -> Iterator[Row]:
    """Times and processor times of a round trip."""
    for name, (reply_time, trips, aim) in REPLY_TIMES.items():
        times: tuple[list[float], list[float]] = ([], [])
        costs: tuple[list[float], list[float]] = ([], [])
        for _ in range(ROUNDS):
            for index, work in enumerate((through_bus, bare)):
                seconds, busy = asyncio.run(work(reply_time, trips * (5 if full else 1)))
                times[index].append(seconds * 1e6)
                costs[index].append(busy * 1e6)
        yield compared(f"round trip, reply {name}", "us", *times, "bare loop", aim=aim, aim_of="ratio")
        yield compared(f"processor time of it, reply {name}", "us", *costs, "bare loop")


def plugged(reply_time: float) -> tuple[RunningFloor, Sockets]:
    """A controller in a socket of this machine."""
    floor = RunningFloor(Floor(read(CELL, "cell")))
    return floor, Sockets(Plugged(floor, "w", sides(floor.floor, "w")[0], "1-1", Random(0), reply_time=reply_time))


async def timed(once: Callable[[], Awaitable[str]], trips: int) -> tuple[float, float]:
    """Seconds, and seconds of CPU, of one trip."""
    for _ in range(20):
        await once()
    begin, busy = time.perf_counter(), time.process_time()
    for _ in range(trips):
        assert await once() == REPLY
    return (time.perf_counter() - begin) / trips, (time.process_time() - busy) / trips


async def bare(reply_time: float, trips: int) -> tuple[float, float]:
    """A packet out, a packet in."""
    floor, sockets = plugged(reply_time)
    carrier, loop = sockets(""), asyncio.get_running_loop()
    waited: dict[int, asyncio.Future[bytes]] = {}

    def done(number: int, status: int, data: bytes) -> None:
        if number in waited:
            waited.pop(number).set_result(data)

    async def once() -> str:
        carrier.send(b"DN\0")
        reply = waited[carrier.receive()] = loop.create_future()
        return (await reply).partition(b"\0")[0].decode()

    carrier.start(done, lambda error: None)
    try:
        return await timed(once, trips)
    finally:
        carrier.close()
        floor.close()


async def through_bus(reply_time: float, trips: int) -> tuple[float, float]:
    """Requests of a bus, one after the other."""
    floor, sockets = plugged(reply_time)
    bus = Bus("bench", await open_usb(sockets("")))
    bus.start()

    async def once() -> str:
        return str((await transact(bus.link, REQUEST)).reply.text)

    try:
        return await timed(once, trips)
    finally:
        await bus.close()
        floor.close()


if __name__ == "__main__":
    main(rows)
