"""The time from the stop key to the wire, and from a typed letter to the screen, whatever else goes on.

A pseudo-terminal is the person. A tap between multidrop and the simulated drives reports when the stop's bytes pass
(`bench/wire_tap.py`, a process of its own). Between two tries what was stopped is begun again. Peers: a key that
travels through a bare event loop and out again, picocom, a minimal Textual app and a minimal prompt.

Run: python bench/bench_stop.py [--full]
"""

from __future__ import annotations

import json
import os
import random
import select
import shutil
import subprocess
import sys
import tempfile
import threading
import time
import tty
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from report import Row, main, percentile
from terminal import ROOT, Terminal, environment, multidrop

AIM = 10.0
"""Of 99 stops of 100, ms."""
STOP = b"\x18"
CLEAR_LINE = b"\x15"
LETTERS = [chr(code) for code in range(0x101, 0x17F, 2)]
"""Letters that nothing else on the screen has."""
LOST = 3.0
"""Seconds after which a stop or a letter counts as lost."""
BARE = """
import asyncio, os, sys, tty
tty.setraw(0)
loop = asyncio.new_event_loop()
out = __import__("socket").create_connection(("127.0.0.1", int(sys.argv[1])))
def typed():
    data = os.read(0, 4096)
    if b"\\x18" in data: out.send(b"\\x1b")
    os.write(1, data)
loop.add_reader(0, typed)
print("opened", flush=True)
loop.run_forever()
"""
TEXTUAL = """
from textual.app import App
from textual.widgets import Input, Static
class Small(App):
    def compose(self):
        yield Static("opened")
        yield Input()
Small().run()
"""
PROMPT = """
from prompt_toolkit import PromptSession
session = PromptSession(bottom_toolbar="opened")
while True:
    session.prompt("> ")
"""
PROGRAM = "PG 1\n" + "".join(f"R1={n}\n" for n in range(300)) + "E\nPG\n"
MACRO = 'name = "loop"\nlines = [\n' + '  "PR P",\n' * 400 + "]\n"


@dataclass(frozen=True)
class Case:
    """The work in progress as the key is pressed. `prepare` is typed before each try; a peer has a `code`."""

    name: str
    front: str
    buses: int = 1
    flood: int = 0
    prepare: tuple[str, ...] = ()
    code: str = ""


PEERS = (
    Case("bare event loop", "peer", code=BARE),
    Case("minimal Textual app", "peer", code=TEXTUAL),
    Case("minimal prompt", "peer", code=PROMPT),
)
CASES = (
    Case("idle", "tui"),
    Case("plot, moving", "tui", prepare=("SL 50000",)),
    Case("1000 lines/s", "tui", flood=1000),
    Case("download", "tui", prepare=("/resume", "/download long.mxt")),
    Case("macro", "tui", prepare=("/resume", "/play loop")),
    Case("8 tabs, 1000 lines/s each", "tui", buses=8, flood=1000),
    Case("idle", "shell"),
    Case("1000 lines/s", "shell", flood=1000),
    Case("download", "shell", prepare=("/resume", "/download long.mxt")),
    Case("macro", "shell", prepare=("/resume", "/play loop")),
    Case("8 buses, 1000 lines/s each", "shell", buses=8, flood=1000),
)
SCREEN_PEER = {"tui": "minimal Textual app", "shell": "minimal prompt"}


@dataclass
class Times:
    """Milliseconds of each try; what was lost is counted, not averaged."""

    stops: list[float] = field(default_factory=list)
    letters: list[float] = field(default_factory=list)
    lost_stops: int = 0
    lost_letters: int = 0


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
    (folder / "cell.toml").write_text(cell(buses), encoding="utf-8")
    process = subprocess.Popen(
        multidrop("sim", "cell.toml", "--json"),
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


def measure(case: Case, tries: int) -> Times:
    """Tries of a case: a letter, then the stop."""
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        (folder / "conf" / "macros").mkdir(parents=True)
        (folder / "conf" / "macros" / "loop.toml").write_text(MACRO, encoding="utf-8")
        (folder / "long.mxt").write_text(PROGRAM, encoding="utf-8")
        taps = Taps(case.flood, simulated(folder, case.buses, stack))
        stack.callback(taps.process.kill)
        urls = [f"tcp://127.0.0.1:{port}?party=0" for port in taps.ports]
        command = [sys.executable, "-c", case.code, taps.ports[0]] if case.code else multidrop(case.front, *urls)
        person = Terminal(command, folder)
        stack.callback(person.end)
        person.until(b"opened" if case.code else b"LMDCM")
        time.sleep(1.0 + 0.5 * case.buses)
        taps.flood(case.flood > 0)
        time.sleep(1.0)
        times = Times()
        for number in range(tries):
            attempt(case, person, taps, number, times)
        return times


def attempt(case: Case, person: Terminal, taps: Taps, number: int, times: Times) -> None:
    """One letter and one press of the stop key, which takes the letter back."""
    for line in case.prepare:
        person.type(line.encode() + b"\r")
        time.sleep(0.1)
    time.sleep(random.uniform(0.15, 0.35))
    type_letter(person, LETTERS[number % len(LETTERS)].encode(), times)
    if case.code and case.code != BARE:
        person.type(CLEAR_LINE)
        return
    time.sleep(random.uniform(0, 0.05))
    press_stop(case, person, taps, times)


def type_letter(person: Terminal, letter: bytes, times: Times) -> None:
    """The time from a key to its letter on the screen."""
    person.seek(letter)
    pressed = time.monotonic()
    person.type(letter)
    shown = person.found(LOST)
    if shown is None:
        times.lost_letters += 1
    else:
        times.letters.append(1e3 * (shown - pressed))


def press_stop(case: Case, person: Terminal, taps: Taps, times: Times) -> None:
    """The time from the stop key to the slowest wire."""
    taps.stops.clear()
    pressed = time.monotonic()
    person.type(STOP)
    while time.monotonic() < pressed + LOST:
        first = {index: at for index, at in reversed(taps.stops)}
        if len(first) == case.buses:
            times.stops.append(1e3 * (max(first.values()) - pressed))
            time.sleep(0.2)
            return
        time.sleep(0.001)
    times.lost_stops += 1


def picocom(tries: int) -> list[float]:
    """Milliseconds from a key in picocom to its line."""
    with tempfile.TemporaryDirectory() as folder:
        end, far = os.openpty()
        tty.setraw(far)
        person = Terminal(["picocom", "-b", "115200", os.ttyname(far)], Path(folder))
        person.until(b"Terminal ready")
        times = []
        for _ in range(tries):
            time.sleep(random.uniform(0.02, 0.1))
            pressed = time.monotonic()
            person.type(b"\x1b")
            select.select([end], [], [], LOST)
            os.read(end, 64)
            times.append(1e3 * (time.monotonic() - pressed))
        person.end()
        return times


def rows(full: bool) -> Iterator[Row]:
    """Stop to wire and key to screen of each case, beside what does nothing else."""
    tries = 200 if full else 20
    peers = {case.name: measure(case, tries) for case in PEERS}
    bare = peers["bare event loop"].stops
    if shutil.which("picocom"):
        keys = picocom(5 * tries)
        yield row("a key of picocom", keys, bare, "bare event loop")
    for case in CASES:
        times = measure(case, tries)
        note = f"{times.lost_stops} of {tries} lost" if times.lost_stops else ""
        yield row(f"{case.front} stop, {case.name}", times.stops, bare, "bare event loop", aim=AIM, note=note)
        note = f"{times.lost_letters} of {tries} lost" if times.lost_letters else ""
        peer = SCREEN_PEER[case.front]
        yield row(f"{case.front} letter, {case.name}", times.letters, peers[peer].letters, peer, note=note)


def row(
    figure: str, ours: list[float], peer: list[float], peer_name: str, aim: float | None = None, note: str = ""
) -> Row:
    """99 of 100 within this time, or the slowest of fewer tries; the medians in the note."""
    medians = [percentile(each, 50) for each in (ours, peer)]
    note = "; ".join(filter(None, (f"medians {medians[0]:.2g} and {medians[1]:.2g}", note)))
    label = "p99" if len(ours) >= 100 else f"slowest of {len(ours)}"
    mine, their = percentile(ours, 99), percentile(peer, 99)
    return Row(f"{figure}, {label}", "ms", mine, their, peer_name, mine / their, aim, note=note)


if __name__ == "__main__":
    main(rows)
