"""Downloads and uploads of a program, beside the barest loop that one could write with EM=0, at the pace of a wire.

The drive is a simulated one on a paced line in another process. The bare loop writes a line, reads up to its prompt and
writes the next one; to list a program it writes `PR LK`, `L` and `PR UV` and reads up to the prompt. It looks at
nothing else. What the difference buys: a refusal is seen at its line, the echo mode is restored, a stop goes between
two lines. Rounds take turns.

`lines` is the time from the first line of the program to its last; `whole` has the settings and the echo mode, too.
`backup` and `verify` read what the drive holds, `S` saves; they are apart from `whole`.

Run: python bench/bench_transfer.py
"""

from __future__ import annotations

import asyncio
import sys
import time
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent.parent))

import serial
from report import Row, compared, main
from sim_process import served

from multidrop.dialects.family import Hints
from multidrop.drives.bus import Bus
from multidrop.drives.drive import Drive
from multidrop.drives.events import BusEvent, Ended
from multidrop.families.lexium.host.mcode.codec import MCode
from multidrop.families.lexium.manual import program_file
from multidrop.transports.serial_port import open_serial

AIM = 1.2
ROUNDS = {9600: 3, 115200: 7}
SETTINGS = [(0, 0), (1, 0), (2, 0), (3, 0), (0, 1), (1, 1), (2, 1), (3, 1)]
"""EM and CK."""
BODY = ["LB G1", *(f"R1=R1+{n}" for n in range(57)), "E"]
PROGRAM = ["VM=400000", "A=200000", "PG 1", *BODY, "PG"]
"""Sixty lines of a program file are those from PG 1 on."""
PARTS = ("download, lines", "download, backup", "download, whole", "download, S", "download, verify", "upload")
APART = ("download, backup", "download, S", "download, verify")
"""Parts without an aim: the bare loop does nothing of the kind for a download."""
CELL = """[[bus]]
name = "line"
serve = ["pty:line.tty"]
baud = {baud}
[[bus.drive]]
personality = "LMDCM"
set = {{ EM = {em}, CK = {check} }}
"""


def rows(full: bool) -> Iterator[Row]:
    """For each baud rate, checksum and echo mode the time of a download and of an upload."""
    for baud in ROUNDS:
        for em, check in SETTINGS if full else SETTINGS[:4]:
            cell = CELL.format(baud=baud, em=em, check=check)
            with served(cell) as (_, where), served(CELL.format(baud=baud, em=0, check=0)) as (_, beside):
                yield from compare(f"{baud} baud, EM={em} CK={check}", where, beside, baud, MCode(em, False, check, 1))


def compare(name: str, where: str, beside: str, baud: int, codec: MCode) -> Iterator[Row]:
    """Rounds of the host and of the bare loop in turn."""
    ours: list[list[float]] = []
    bare: list[list[float]] = []
    for _ in range(ROUNDS[baud]):
        ours.append(asyncio.run(transfer(where, baud, codec)))
        bare.append(bare_transfer(beside, baud))
    for n, figure in enumerate(PARTS):
        columns = [each[n] * 1000 for each in ours], [each[n] * 1000 for each in bare]
        aims: dict[str, Any] = {} if figure in APART else {"aim": AIM, "aim_of": "ratio"}
        yield compared(f"{figure}, {name}", "ms", *columns, "bare EM=0 loop", **aims)


async def transfer(where: str, baud: int, codec: MCode) -> list[float]:
    """Seconds of each part."""
    bus = Bus("bench", await open_serial(where, baud), baud=baud)
    bus.start()
    try:
        drive = (await bus.identify(Hints(family="mcode", party=False, checksum=codec.checksum)))[0]
        await drive.send("CP")
        file = program_file.read("\n".join(PROGRAM), "bench.mxt")
        watched = Lines(drive)
        times = [time.perf_counter()]
        held = await drive.run(drive.programs.read(file, nothing))
        times.append(time.perf_counter())
        sent = await drive.download(file, held)
        times.append(time.perf_counter())
        await drive.send("S")
        times.append(time.perf_counter())
        found = await drive.run(drive.programs.read(file, nothing))
        assert not drive.programs.differences(sent, found, None)
        times.append(time.perf_counter())
        made = await drive.run(drive.programs.upload(True))
        times.append(time.perf_counter())
        assert [each for each in made if each in BODY] == BODY, made
        return [watched.last - watched.first, *(b - a for a, b in pairwise(times))]
    finally:
        await bus.close()


def nothing(done: int, total: int) -> None:
    """Show no progress."""


class Lines:
    """The times of the lines of a program on a bus, s of the bus's clock."""

    def __init__(self, drive: Drive) -> None:
        self.first = self.last = 0.0
        drive.link.watch(self._see)

    def _see(self, event: BusEvent) -> None:
        if isinstance(event, Ended) and event.transaction.request.text.startswith("PG"):
            self.first = self.first or event.transaction.sent_at
            self.last = event.transaction.ended_at


def bare_transfer(where: str, baud: int) -> list[float]:
    """The same with a loop that only waits for prompts."""
    with serial.Serial(where, baud, timeout=5) as port:

        def send(line: str) -> bytes:
            prompts = (b">",) if line in ("CP", "S", "L") or line[:2] == "PR" else (b">", b"  ")
            port.write(line.encode() + b"\r")
            answer = port.read_until(b"\n")
            while not answer.endswith(prompts):
                answer += port.read(max(1, port.in_waiting))
            return answer

        def timed(*lines: str) -> float:
            begin = time.perf_counter()
            for line in lines:
                send(line)
            return time.perf_counter() - begin

        send("CP")
        backup = timed("PR LK", "L", "PR UV")
        settings = timed(*PROGRAM[:2])
        program = timed(*PROGRAM[2:])
        save = timed("S")
        verify = timed("PR LK", "L", "PR UV")
        return [program, backup, settings + program, save, verify, timed("PR LK", "L", "PR UV")]


if __name__ == "__main__":
    main(rows)
