"""Round trips a second over Modbus/TCP: a Bus beside pymodbus' asynchronous client and pyModbusTCP.

All ask a peer in another process for the same two registers (P), one after the other; rounds take turns, so that
whatever else the machine does meets all of them. The peer answers from a table and parses nothing.

Run: python bench/bench_modbus.py
"""

from __future__ import annotations

import asyncio
import logging
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent.parent))

from bench_line import transact
from report import Row, absent, compared, main

from multidrop.drives.bus import Bus
from multidrop.families.lexium.host.modbus import mapping
from multidrop.families.lexium.host.modbus.codec import Modbus, ModbusState
from multidrop.families.lexium.host.modbus.operations import request
from multidrop.families.lexium.manual.modbus.registers import REGISTERS
from multidrop.transports.sockets import open_tcp

ROUNDS = 7
TRIPS = 2000
WARM_UP = 100
POSITION = REGISTERS["P"]
VALUE = 51200
AIM = 1.0
"""Of pymodbus. A blocking client waits in the system; an event loop asks it first."""
Measured = tuple[float, float]

PEER = """
import socket
server = socket.create_server(("127.0.0.1", 0))
print(server.getsockname()[1], flush=True)
TAIL = bytes.fromhex("0000 0007 01 03 04 C800 0000")
while True:
    peer, _ = server.accept()
    peer.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    while asked := peer.recv(4096):
        peer.sendall(asked[:2] + TAIL)
"""


def through_bus(port: int, trips: int) -> Measured:
    """Bus.ask, one after the other."""

    async def run() -> Measured:
        bus = Bus("bench", await open_tcp("127.0.0.1", port, "modbus"), family="modbus")
        bus.start()
        asked = request(ModbusState(Modbus()), "PR P", mapping.read(POSITION))
        reading = mapping.reading("P")

        async def once() -> None:
            assert reading.shown((await transact(bus.link, asked)).reply.body) == str(VALUE)

        try:
            return await timed(once, trips)
        finally:
            await bus.close()

    return asyncio.run(run())


def through_pymodbus(port: int, trips: int) -> Measured:
    """AsyncModbusTcpClient."""
    from pymodbus.client import AsyncModbusTcpClient

    logging.getLogger("pymodbus").addHandler(logging.NullHandler())

    async def run() -> Measured:
        client = AsyncModbusTcpClient("127.0.0.1", port=port, retries=0)
        await client.connect()

        async def once() -> None:
            answer = await client.read_holding_registers(POSITION.address, count=2, device_id=1)
            assert answer.registers == [VALUE, 0]

        try:
            return await timed(once, trips)
        finally:
            client.close()

    return asyncio.run(run())


def through_pymodbustcp(port: int, trips: int) -> Measured:
    """pyModbusTCP, which blocks."""
    from pyModbusTCP.client import ModbusClient

    client = ModbusClient("127.0.0.1", port, auto_open=True)
    try:
        for _ in range(WARM_UP):
            client.read_holding_registers(POSITION.address, 2)
        begin, busy = time.perf_counter(), time.process_time()
        for _ in range(trips):
            assert client.read_holding_registers(POSITION.address, 2) == [VALUE, 0]
        return time.perf_counter() - begin, time.process_time() - busy
    finally:
        client.close()


async def timed(once: Callable, trips: int) -> Measured:
    """Seconds, and seconds of CPU, that the trips took."""
    for _ in range(WARM_UP):
        await once()
    begin, busy = time.perf_counter(), time.process_time()
    for _ in range(trips):
        await once()
    return time.perf_counter() - begin, time.process_time() - busy


def clients() -> dict[str, Callable[[int, int], Measured]]:
    """Those that are installed; Bus first."""
    found: dict[str, Callable[[int, int], Measured]] = {"Bus": through_bus, "pymodbus": through_pymodbus}
    if find_spec("pyModbusTCP"):
        found["pyModbusTCP"] = through_pymodbustcp
    return found


def rows(full: bool) -> Iterator[Row]:
    """Reads of P a second, and their processor time."""
    trips = TRIPS * (5 if full else 1)
    with subprocess.Popen([sys.executable, "-c", PEER], stdout=subprocess.PIPE, text=True) as peer:
        try:
            assert peer.stdout is not None
            rates, costs = measure(int(peer.stdout.readline()), trips)
        finally:
            peer.kill()
    for name in ("pymodbus", "pyModbusTCP"):
        aim: dict[str, Any] = {"aim": AIM, "aim_of": "ratio"} if name == "pymodbus" else {}
        if name not in rates:
            yield absent("reads of P over Modbus/TCP", "/s", rates["Bus"], name, better="more")
            continue
        yield compared("reads of P over Modbus/TCP", "/s", rates["Bus"], rates[name], name, better="more", **aim)
        yield compared("processor time a read", "us", costs["Bus"], costs[name], name)


def measure(port: int, trips: int) -> tuple[dict[str, list[float]], dict[str, list[float]]]:
    """Rates and costs of all clients, rounds in turn."""
    measured = clients()
    rates: dict[str, list[float]] = {name: [] for name in measured}
    costs: dict[str, list[float]] = {name: [] for name in measured}
    for _ in range(ROUNDS):
        for name, through in measured.items():
            seconds, busy = through(port, trips)
            rates[name].append(trips / seconds)
            costs[name].append(busy / trips * 1e6)
    return rates, costs


if __name__ == "__main__":
    main(rows)
