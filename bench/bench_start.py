"""Start and end of a command, beside what Python and the libraries under it need for the same.

A command without a terminal counts from its start to its end. The prompt and the screen count from the start of the
process to the first frame on a terminal of their own. The end of `send` counts from its reply to the end of the
process. Rounds take turns.

Run: python bench/bench_start.py [--full]
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from report import Row, alone, compared, main
from sim_process import served
from terminal import Terminal, environment, multidrop

ROUNDS = 11
PROGRAM = "PG 1\nLB G1\n MR 51200\n H\n PR P\n BR G1\nE\nPG\n"
LONG = "PG 1\n" + "".join(f" MR {number}\n" for number in range(20_000)) + "E\nPG\n"
"""Longer than the memory of a drive, which refuses most of it."""
CELL = '[[bus]]\nname = "line"\nserve = ["pty:line.tty"]\n[[bus.drive]]\npersonality = "LMDCM"\nset = { EM = 1 }\n'
MARK = b"STOP ALL"
"""A text of the first frame: ours show the stop key in it."""
PROMPT = """
from prompt_toolkit import PromptSession
session = PromptSession(bottom_toolbar="^X STOP ALL")
text = session.prompt("> ")
print(text)
"""
SCREEN = """
from textual.app import App
from textual.widgets import Static
class Minimal(App):
    def compose(self):
        yield Static("STOP ALL")
Minimal().run()
"""
Measure = Callable[[], float]


def rows(full: bool) -> Iterator[Row]:
    """All figures."""
    rounds = ROUNDS * (3 if full else 1)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "p.mxt").write_text(PROGRAM)
        nothing = python("pass")
        yield side_by_side(
            "multidrop --version", folder, multidrop("--version"), nothing, "python -c pass", rounds, aim=4
        )
        check = multidrop("program", "check", "p.mxt")
        yield side_by_side("program check", folder, check, nothing, "python -c pass", rounds, aim=8)
        (folder / "long.mxt").write_text(LONG)
        found = [1000 * whole(folder, multidrop("program", "check", "long.mxt"), code=1) for _ in range(3)]
        yield alone("program check of 20,000 lines", "ms", found)
        with served(CELL) as (_, path):
            port = f"{path}?party=0&em=1&checksum=0"
            yield _end(folder, port, rounds)
            for url in ("sim:", port):
                ours = partial(first_frame, folder, multidrop("shell", url))
                peer = partial(first_frame, folder, python(PROMPT))
                kind = "sim:" if url == "sim:" else "PTY"
                yield _in_turn(f"shell {kind}, first prompt", ours, peer, "prompt_toolkit", rounds, aim=2)
            ours = partial(first_frame, folder, multidrop("tui", port))
            peer = partial(first_frame, folder, python(SCREEN))
            yield _in_turn("tui PTY, first frame", ours, peer, "Textual, 1 Static", rounds, aim=2)


def python(code: str) -> list[str]:
    """A command that runs this code."""
    return [sys.executable, "-c", code]


def side_by_side(
    figure: str, folder: Path, ours: Sequence[str], peer: Sequence[str], peer_name: str, rounds: int, aim: float
) -> Row:
    """The whole time of two commands."""
    return _in_turn(figure, partial(whole, folder, ours), partial(whole, folder, peer), peer_name, rounds, aim=aim)


def _in_turn(figure: str, ours: Measure, peer: Measure, peer_name: str, rounds: int, aim: float) -> Row:
    ours(), peer()  # they find their modules compiled, and in the memory of the system
    found = [(ours(), peer()) for _ in range(rounds)]
    mine, theirs = ([1000 * each[n] for each in found] for n in (0, 1))
    return compared(figure, "ms", mine, theirs, peer_name, aim=aim, aim_of="ratio")


def whole(folder: Path, command: Sequence[str], code: int = 0) -> float:
    """Seconds from the start of a process to its end. Raises SystemExit for another exit code."""
    nowhere, begin = subprocess.DEVNULL, time.monotonic()
    done = subprocess.run(command, cwd=folder, env=environment(folder), stdout=nowhere, stderr=nowhere)
    if done.returncode != code:
        raise SystemExit(f"{' '.join(command)} has ended with {done.returncode}")
    return time.monotonic() - begin


def first_frame(folder: Path, command: Sequence[str]) -> float:
    """Seconds from the start of a process to its first frame on a terminal."""
    begin = time.monotonic()
    terminal = Terminal(command, folder)
    terminal.seek(MARK)
    try:
        found = terminal.found(30)
        if found is None:
            raise SystemExit(f"no first frame: {bytes(terminal.shown[-500:])!r}")
        return found - begin
    finally:
        terminal.end()


def _end(folder: Path, url: str, rounds: int) -> Row:
    """The time between a reply and the end of `send`, beside a Python that has imported as much of the library."""
    ours = partial(last_line_to_end, folder, multidrop("send", url, "PR P"))
    peer = partial(last_line_to_end, folder, python("import asyncio, serial; print(0, flush=True)"))
    return _in_turn("send PTY, from the reply to the end", ours, peer, "import asyncio, serial", rounds, aim=2)


def last_line_to_end(folder: Path, command: Sequence[str]) -> float:
    """Seconds from the first line of output to the end of the process."""
    process = subprocess.Popen(
        command, cwd=folder, env=environment(folder), stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    )
    assert process.stdout is not None
    with process.stdout:
        process.stdout.readline()
        begin = time.monotonic()
        process.wait()
    return time.monotonic() - begin


if __name__ == "__main__":
    main(rows)
