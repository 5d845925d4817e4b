"""The simulated Ethernet drive's Modbus/TCP port under many clients at once, beside two servers of registers.

Each client asks for the position (function 3, two registers), waits for the answer and asks again; the load is one
process of bare sockets, so that it is the same for all. The peers hold numbers in a table; ours is a drive, which works
out the position of its motor, once at rest and once on the move. Rounds of all take turns.

Run: python bench/bench_modbus_server.py
"""

from __future__ import annotations

import json
import os
import selectors
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from report import Row, absent, compared, main
from sim_process import busy

ROOT = Path(__file__).parent.parent
ROUNDS = 3
CLIENTS = 16
SECONDS = 1.5
ASKED = bytes.fromhex("0001 0000 0006 01 03 0057 0002")
ANSWER_SIZE = 13
SLEW = bytes.fromhex("0002 0000 000B 01 10 0078 0002 04 2710 0000")
PATIENCE = 30.0

CELL = """
[[bus]]
name = "eth"
serve = ["modbus://127.0.0.1:0"]
[[bus.drive]]
personality = "LMDCE"
"""
PYMODBUSTCP = """
import sys, time
from pyModbusTCP.server import ModbusServer
server = ModbusServer("127.0.0.1", int(sys.argv[1]), no_block=True)
server.start()
print("up", flush=True)
time.sleep(3600)
"""
PYMODBUS = """
import asyncio, sys
from pymodbus.server import StartAsyncTcpServer
from pymodbus.simulator import DataType, SimData, SimDevice
device = SimDevice(id=1, simdata=[SimData(0, values=0, count=256, datatype=DataType.REGISTERS)])
async def main():
    asyncio.get_running_loop().call_later(0.5, lambda: print("up", flush=True))
    await StartAsyncTcpServer(device, address=("127.0.0.1", int(sys.argv[1])))
asyncio.run(main())
"""


OURS = ("multidrop, standing", "multidrop, moving")
PEERS = ("pymodbus", "pyModbusTCP")


def rows(full: bool) -> Iterator[Row]:
    """Answers a second, their times and the server's processor time, of ours beside each peer's."""
    seconds = SECONDS * (5 if full else 1)
    names = [*OURS, *(peer for peer in PEERS if find_spec(peer))]
    results: dict[str, list[tuple[float, ...]]] = {name: [] for name in names}
    for _ in range(ROUNDS):
        for name in names:
            process, port = start(name)
            try:
                results[name].append(measure(process, port, CLIENTS, seconds, moving="moving" in name))
            finally:
                process.kill()
                process.communicate()
    for ours in OURS:
        for peer in PEERS:
            yield from beside(ours, peer, results)


def beside(ours: str, peer: str, results: dict[str, list[tuple[float, ...]]]) -> Iterator[Row]:
    """The figures of one pair."""
    drive = ours.partition(", ")[2]
    rate, *others = zip(*results[ours], strict=True)
    if peer not in results:
        yield absent(f"{CLIENTS} Modbus clients, {drive}", "/s", rate, peer, better="more")
        return
    their_rate, *theirs = zip(*results[peer], strict=True)
    yield compared(f"{CLIENTS} Modbus clients, {drive}", "/s", rate, their_rate, peer, better="more")
    for (what, unit, scale), mine, their in zip(FIGURES, others, theirs, strict=True):
        pair = [[each * scale for each in column] for column in (mine, their)]
        yield compared(f"{what}, {drive}", unit, *pair, peer)


FIGURES = (
    ("answer, median", "ms", 1e3),
    ("answer, 99 of 100 within", "ms", 1e3),
    ("processor time an answer", "us", 1e6),
)


def start(name: str) -> tuple[subprocess.Popen[str], int]:
    """A server in a process of its own, and its port."""
    if name.startswith("multidrop"):
        with tempfile.NamedTemporaryFile("w", suffix=".toml", delete=False) as file:
            file.write(CELL)
        command = [sys.executable, "-m", "multidrop", "sim", file.name, "--json"]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stdin=subprocess.PIPE, text=True, cwd=ROOT)
        assert process.stdout is not None
        port = int(json.loads(process.stdout.readline())["endpoint"].rpartition(":")[2])
        process.stdout.readline()
        os.unlink(file.name)
        return process, port
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    code = PYMODBUS if name == "pymodbus" else PYMODBUSTCP
    process = subprocess.Popen(
        [sys.executable, "-c", code, str(port)], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    )
    assert process.stdout is not None and process.stdout.readline() == "up\n", f"{name} did not start"
    return process, port


def measure(
    process: subprocess.Popen[str], port: int, clients: int, seconds: float, moving: bool
) -> tuple[float, float, float, float]:
    """Answers a second, the median and the 99th percentile of their times (s), and the server's CPU an answer (s)."""
    wires = [connected(port) for _ in range(clients)]
    if moving:
        wires[0].sendall(SLEW)
        assert wires[0].recv(64)
    with selectors.DefaultSelector() as ready:
        asked = {}
        for wire in wires:
            ready.register(wire, selectors.EVENT_READ)
        times: list[float] = []
        used = busy(process.pid)
        begin = time.perf_counter()
        for wire in wires:
            asked[wire] = time.perf_counter()
            wire.sendall(ASKED)
        while time.perf_counter() - begin < seconds:
            for key, _ in ready.select(PATIENCE):
                wire = key.fileobj
                assert isinstance(wire, socket.socket)
                assert len(wire.recv(64)) == ANSWER_SIZE
                now = time.perf_counter()
                times.append(now - asked[wire])
                asked[wire] = now
                wire.sendall(ASKED)
        spent = time.perf_counter() - begin
        used = busy(process.pid) - used
    for wire in wires:
        wire.close()
    times.sort()
    return len(times) / spent, times[len(times) // 2], times[len(times) * 99 // 100], used / len(times)


def connected(port: int) -> socket.socket:
    """A client."""
    wire = socket.create_connection(("127.0.0.1", port), PATIENCE)
    wire.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return wire


if __name__ == "__main__":
    main(rows)
