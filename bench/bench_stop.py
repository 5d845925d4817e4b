"""How long the stop key takes from the terminal to the wire, in the screen and at the prompt, and what else goes on.

A pseudo-terminal stands for the person, simulated drives stand behind a tap that tells when the stop's bytes pass
(`bench/wire_tap.py`, a process of its own). Between two tries what was stopped is begun again. The aim: 10 ms for 99
of 100. A key that travels through a bare event loop and out again is measured beside it.

Run: python bench/bench_stop.py [TRIES [CASE ...]]     cases: see CASES
"""

from __future__ import annotations

import fcntl
import json
import os
import pty
import random
import select
import statistics
import struct
import subprocess
import sys
import tempfile
import termios
import threading
import time
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
AIM = 0.010
STOP = b"\x18"
BARE = """
import asyncio, os, sys, tty
tty.setraw(0)
loop = asyncio.new_event_loop()
out = __import__("socket").create_connection(("127.0.0.1", int(sys.argv[1])))
def typed():
    if b"\\x18" in os.read(0, 4096): out.send(b"\\x1b")
loop.add_reader(0, typed)
print("opened", flush=True)
loop.run_forever()
"""
PROGRAM = "PG 1\n" + "".join(f"R1={n}\n" for n in range(300)) + "E\nPG\n"
MACRO = 'name = "loop"\nlines = [\n' + '  "PR P",\n' * 400 + "]\n"


@dataclass(frozen=True)
class Case:
    """What goes on while the key is pressed. `prepare` is typed before each try."""

    name: str
    front: str
    buses: int = 1
    flood: int = 0
    prepare: tuple[str, ...] = ()


CASES = (
    Case("bare loop", "bare"),
    Case("tui idle", "tui"),
    Case("tui plot, moving", "tui", prepare=("SL 50000",)),
    Case("tui flood", "tui", flood=1000),
    Case("tui download", "tui", prepare=("/resume", "/download long.mxt")),
    Case("tui macro", "tui", prepare=("/resume", "/play loop")),
    Case("tui 8 tabs flooded", "tui", buses=8, flood=1000),
    Case("prompt idle", "shell"),
    Case("prompt flood", "shell", flood=1000),
    Case("prompt download", "shell", prepare=("/resume", "/download long.mxt")),
    Case("prompt macro", "shell", prepare=("/resume", "/play loop")),
    Case("prompt 8 buses flooded", "shell", buses=8, flood=1000),
)


class Person:
    """A terminal of 120 x 40 that reads everything at once and answers cursor queries."""

    def __init__(self, command: list[str], folder: Path) -> None:
        self.shown = b""
        pid, self.descriptor = pty.fork()
        if pid == 0:
            os.chdir(folder)
            os.execvpe(command[0], command, environment(folder))
        self.pid = pid
        fcntl.ioctl(self.descriptor, termios.TIOCSWINSZ, struct.pack("HHHH", 40, 120, 0, 0))
        self._ended = False
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        while not self._ended:
            if not select.select([self.descriptor], [], [], 0.2)[0]:
                continue
            try:
                data = os.read(self.descriptor, 65536)
            except OSError:
                return
            self.shown = (self.shown + data)[-200_000:]
            for _ in range(data.count(b"\x1b[6n")):
                os.write(self.descriptor, b"\x1b[1;1R")

    def type(self, data: bytes) -> None:
        """Keys."""
        os.write(self.descriptor, data)

    def until(self, text: bytes, seconds: float = 30.0) -> None:
        """Wait for a text on the terminal."""
        limit = time.monotonic() + seconds
        while text not in self.shown:
            if time.monotonic() > limit:
                raise SystemExit(f"{text!r} was not shown; at the end:\n{self.shown[-3000:].decode(errors='replace')}")
            time.sleep(0.02)

    def end(self) -> None:
        """Kill it."""
        os.kill(self.pid, 9)
        os.waitpid(self.pid, 0)
        self._ended = True
        time.sleep(0.25)
        os.close(self.descriptor)


def environment(folder: Path) -> dict[str, str]:
    """A process's own configuration and a terminal with colours."""
    return dict(os.environ) | {
        "PYTHONPATH": str(ROOT),
        "MULTIDROP_CONFIG_DIR": str(folder / "conf"),
        "MULTIDROP_STATE_DIR": str(folder / "state"),
        "TERM": "xterm-256color",
        "COLORTERM": "truecolor",
    }


class Taps:
    """The process between host and drives; `stops` are the times at which a stop passed."""

    def __init__(self, rate: int, endpoints: list[str]) -> None:
        self.process = subprocess.Popen(
            [sys.executable, str(ROOT / "bench" / "wire_tap.py"), str(rate), *endpoints],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        assert self.process.stdout is not None
        self.ports = self.process.stdout.readline().split()[1:]
        self.stops: list[tuple[int, float]] = []
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            _, index, at = line.split()
            self.stops.append((int(index), float(at)))

    def flood(self, on: bool) -> None:
        """Switch the flood."""
        assert self.process.stdin is not None
        self.process.stdin.write(f"flood {int(on)}\n")
        self.process.stdin.flush()


def cell(buses: int) -> str:
    """Drives on lines of their own, at 115200 baud."""
    one = '[[bus]]\nname = "w{n}"\nbaud = 115200\nserve = ["tcp://127.0.0.1:0"]\n[[bus.drive]]\n'
    one += 'personality = "LMDCM"\nset = {{ EM = 1 }}\n'
    return "".join(one.format(n=n) for n in range(buses))


def simulated(folder: Path, buses: int, stack: ExitStack) -> list[str]:
    """Simulated drives in a process of their own; their endpoints, HOST:PORT."""
    (folder / "cell.toml").write_text(cell(buses))
    process = subprocess.Popen(
        [sys.executable, "-m", "multidrop", "sim", "cell.toml", "--json"],
        stdout=subprocess.PIPE,
        stdin=subprocess.PIPE,
        text=True,
        cwd=folder,
        env=environment(folder),
    )
    stack.callback(process.kill)
    found: list[str] = []
    assert process.stdout is not None
    for line in process.stdout:
        said = json.loads(line)
        if "ready" in said:
            break
        found.append(said["endpoint"].removeprefix("tcp://"))
    return found


def measure(case: Case, tries: int) -> list[float]:
    """Seconds from the key to each wire, the slowest wire of each try; lost tries are told and not counted."""
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        (folder / "conf" / "macros").mkdir(parents=True)
        (folder / "conf" / "macros" / "loop.toml").write_text(MACRO)
        (folder / "long.mxt").write_text(PROGRAM)
        taps = Taps(case.flood, simulated(folder, case.buses, stack))
        stack.callback(taps.process.kill)
        urls = [f"tcp://127.0.0.1:{port}?party=0" for port in taps.ports]
        command = [sys.executable, "-m", "multidrop", case.front, *urls]
        if case.front == "bare":
            command = [sys.executable, "-c", BARE, taps.ports[0]]
        person = Person(command, folder)
        stack.callback(person.end)
        person.until(b"opened" if case.front == "bare" else b"LMDCM")
        time.sleep(1.0 + 0.5 * case.buses)
        taps.flood(case.flood > 0)
        time.sleep(1.0)
        return [took for took in (attempt(case, person, taps) for _ in range(tries)) if took is not None]


def attempt(case: Case, person: Person, taps: Taps) -> float | None:
    """One press of the key."""
    for line in case.prepare:
        person.type(line.encode() + b"\r")
        time.sleep(0.1)
    time.sleep(random.uniform(0.15, 0.35))
    taps.stops.clear()
    pressed = time.monotonic()
    person.type(STOP)
    limit = pressed + 3.0
    while time.monotonic() < limit:
        first = {index: at for index, at in reversed(taps.stops)}
        if len(first) == case.buses:
            time.sleep(0.2)
            return max(first.values()) - pressed
        time.sleep(0.002)
    print(f"  {case.name}: a stop was not seen on {case.buses - len(first)} wires within 3 s")
    return None


def main() -> None:
    """Measure, and print a table."""
    tries = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    chosen = [case for case in CASES if len(sys.argv) < 3 or any(word in case.name for word in sys.argv[2:])]
    print(f"stop key to wire, ms, {tries} tries each; aim: p99 {AIM * 1000:.0f}\n")
    print(f"{'':26} {'p50':>8} {'p95':>8} {'p99':>8} {'most':>8} {'seen':>6}")
    for case in chosen:
        took = sorted(measure(case, tries))
        cuts = statistics.quantiles(took, n=100, method="inclusive")
        row = [cuts[49], cuts[94], cuts[98], took[-1]]
        print(f"{case.name:26} " + " ".join(f"{1000 * each:8.2f}" for each in row) + f" {len(took):6}", flush=True)


if __name__ == "__main__":
    main()
