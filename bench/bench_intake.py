"""Lines a second that a program that prints can send until the last of them is shown, beside serial terminals.

One pseudo-terminal is the line: lines of 64 bytes, as fast as they are taken. A second one is the person (for `shell`
with its output piped: a pipe). Rounds take turns. A row names the number of lines that multidrop reports as dropped.

Run: python bench/bench_intake.py [--full]
"""

from __future__ import annotations

import os
import re
import select
import shutil
import subprocess
import sys
import tempfile
import threading
import time
import tty
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from report import Row, absent, compared, main
from sim_process import busy, served
from terminal import Terminal, environment, multidrop

AIM = 100_000
ROUNDS = 3
LINES = 50_000
SIZE = 64
BLOCK = 50
"""Lines of one write."""
LONGEST = 120.0
"""Time after which lines that are not shown are given up, s."""
CELL = '[[bus]]\nname = "line"\nserve = ["pty:line.tty"]\n[[bus.drive]]\npersonality = "LMDCM"\nset = { EM = 1 }\n'
LAST = b"THE LAST LINE"
MISSING = re.compile(rb"(\d+) lines? (?:is|are) missing here")


@dataclass(frozen=True)
class Program:
    """The receiver of the lines. `command` is given the port; `ready`: what it shows once it reads."""

    name: str
    command: Callable[[str], list[str]]
    ready: bytes
    piped: bool = False
    needs: str = ""
    size: tuple[int, int] = (120, 40)
    """Columns and rows of its terminal."""


OURS = (
    Program("multidrop tui", lambda port: multidrop("tui", url(port)), b"LMDCM"),
    Program("multidrop shell", lambda port: multidrop("shell", url(port)), b"LMDCM"),
    Program("multidrop shell, piped", lambda port: multidrop("shell", url(port)), b"", piped=True),
)
PEERS = (
    Program("picocom", lambda port: ["picocom", "-b", "115200", port], b"Terminal ready", needs="picocom"),
    Program("tio", lambda port: ["tio", "-b", "115200", port], b"Connected", needs="tio"),
    Program("miniterm", lambda port: [sys.executable, "-m", "serial", *MINITERM, port, "115200"], b"Miniterm on"),
)
MINITERM = ("--raw",)


def url(port: str) -> str:
    """A line whose settings are given."""
    return f"serial:{port}?baud=115200&party=0&em=1&checksum=0"


class Line:
    """A pseudo-terminal between a program and a simulated drive, on which a flood may come."""

    def __init__(self, drive: str) -> None:
        self.end, self.far = os.openpty()
        tty.setraw(self.far)
        self.port = os.ttyname(self.far)
        self.drive = os.open(drive, os.O_RDWR | os.O_NOCTTY)
        self._reply = b""
        self._ended = self._flooding = False
        self._lock = threading.Lock()
        """Held while a thread reads: what one finds ready, another must not take."""
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def _serve(self) -> None:
        while not self._ended:
            if not self._flooding:
                self._pass_on(0.05)
            else:
                time.sleep(0.05)

    def _pass_on(self, seconds: float) -> None:
        """Pass on what comes within this time; the drive's replies in whole lines."""
        with self._lock:
            for ready in select.select([self.end, self.drive], [], [], seconds)[0]:
                data = os.read(ready, 4096)
                if ready == self.end:
                    os.write(self.drive, data)
                    continue
                self._reply += data
                if self._reply.endswith(b"\n"):
                    os.write(self.end, self._reply)
                    self._reply = b""

    def flood(self, lines: int) -> None:
        """Write lines, with the drive's replies between them."""
        self._flooding = True
        block = b"".join(b"%-*d\r\n" % (SIZE - 2, n) for n in range(BLOCK))
        for _ in range(lines // BLOCK):
            os.write(self.end, block)
            self._pass_on(0)
        self._flooding = False

    def pace(self, rate: float, seconds: float) -> None:
        """Write lines at an even rate, with the drive's replies between them."""
        self._flooding = True
        begin, count = time.monotonic(), 0
        while (now := time.monotonic()) < begin + seconds:
            due = int((now - begin) * rate)
            if due > count:
                os.write(self.end, b"".join(b"%-*d\r\n" % (SIZE - 2, n) for n in range(count, due)))
                count = due
            self._pass_on(0.005)
        self._flooding = False

    def write(self, text: bytes) -> None:
        """Write a line."""
        os.write(self.end, b"%-*s\r\n" % (SIZE - 2, text))

    def close(self) -> None:
        """End it."""
        self._ended = True
        self._thread.join()
        for each in (self.end, self.far, self.drive):
            os.close(each)


class Piped:
    """A program whose standard output is a pipe that is read at once."""

    def __init__(self, command: Sequence[str], folder: Path) -> None:
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
        self.process = subprocess.Popen(command, cwd=folder, env=environment(folder), **pipes)  # type: ignore[call-overload]
        self.pid: int = self.process.pid
        self.shown, self.count = bytearray(), 0
        self._sought, self._found_at = b"", 0.0
        for stream in (self.process.stdout, self.process.stderr):
            threading.Thread(target=self._read, args=[stream.fileno()], daemon=True).start()

    def _read(self, descriptor: int) -> None:
        while data := os.read(descriptor, 65536):
            now, seam = time.monotonic(), bytes(self.shown[-SIZE:])
            self.shown += data
            self.count += len(data)
            if self._sought and self._sought in seam + data:
                self._found_at, self._sought = now, b""

    def until(self, text: bytes) -> None:
        """Wait until the drive is open: its reply to a line."""
        assert self.process.stdin is not None
        self.process.stdin.write(b"PR VR\n")
        self.process.stdin.flush()
        while not self.shown:
            time.sleep(0.02)

    def seek(self, text: bytes) -> None:
        """See Terminal."""
        self._found_at, self._sought = 0.0, text

    def found(self, seconds: float) -> float | None:
        """See Terminal."""
        limit = time.monotonic() + seconds
        while not self._found_at and time.monotonic() < limit:
            time.sleep(0.001)
        return self._found_at or None

    def end(self) -> None:
        """Kill it."""
        self.process.kill()
        self.process.communicate()


@dataclass(frozen=True)
class Taken:
    """One round: lines a second, processor time (s) and bytes of output a line, lines that were said to be missing."""

    rate: float
    cost: float
    size: float
    lost: int


def rows(full: bool) -> Iterator[Row]:
    """Rates of ours beside each peer's; processor time and bytes to the terminal beside picocom's."""
    lines = LINES * (5 if full else 1)
    programs = [*OURS, *(each for each in PEERS if not each.needs or shutil.which(each.needs))]
    rounds: dict[str, list[Taken]] = {each.name: [] for each in programs}
    for _ in range(ROUNDS):
        for each in programs:
            rounds[each.name].append(measure(each, lines))
    for mine in OURS:
        ours = rounds[mine.name]
        note = f"{sum(each.lost for each in ours) // len(ours):,} of {lines:,} lines said to be missing"
        for peer in PEERS:
            yield rate_row(mine.name, peer.name, ours, rounds.get(peer.name), note)
        if other := rounds.get("picocom"):
            costs = [[each.cost * 1e6 for each in column] for column in (ours, other)]
            yield compared(f"{mine.name}: processor time a line", "us", *costs, "picocom")
            sizes = [[each.size for each in column] for column in (ours, other)]
            yield compared(f"{mine.name}: output a line", "bytes", *sizes, "picocom")


def rate_row(name: str, peer: str, ours: list[Taken], theirs: list[Taken] | None, note: str) -> Row:
    """Lines a second."""
    rates = [each.rate for each in ours]
    if theirs is None:
        return absent(f"{name}: intake", "lines/s", rates, peer, aim=AIM, better="more", note=note)
    other = [each.rate for each in theirs]
    return compared(f"{name}: intake", "lines/s", rates, other, peer, aim=AIM, better="more", note=note)


def measure(program: Program, lines: int) -> Taken:
    """One flood."""
    with opened(program) as (line, shown):
        shown.seek(LAST)
        used, size, begin = busy(shown.pid), shown.count, time.monotonic()
        line.flood(lines)
        end = seen(line, shown)
        if end is None:
            raise SystemExit(f"{program.name}: the last line was not shown within {LONGEST:g} s")
        time.sleep(0.2)
        lost = sum(int(found) for found in MISSING.findall(bytes(shown.shown)))
        return Taken(lines / (end - begin), (busy(shown.pid) - used) / lines, (shown.count - size) / lines, lost)


def seen(line: Line, shown: Terminal | Piped) -> float | None:
    """The time at which the last line was shown; it is written again where it was dropped."""
    limit = time.monotonic() + LONGEST
    while time.monotonic() < limit:
        line.write(LAST)
        if (end := shown.found(1.0)) is not None:
            return end
    return None


@contextmanager
def opened(program: Program) -> Iterator[tuple[Line, Terminal | Piped]]:
    """A program that reads a line."""
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        line = Line(stack.enter_context(served(CELL))[1])
        stack.callback(line.close)
        command = program.command(line.port)
        shown = Piped(command, folder) if program.piped else Terminal(command, folder, program.size)
        stack.callback(shown.end)
        shown.until(program.ready)
        time.sleep(1.0)
        yield line, shown


if __name__ == "__main__":
    main(rows)
