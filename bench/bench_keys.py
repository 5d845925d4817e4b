"""The time from Enter to the wire, and from a reply to the screen, in the prompt and the TUI.

A tap in this process is the wire: it answers the measured print itself and passes everything else on to a simulated
drive. The peer is a bare event loop on a terminal of its own: it sends a typed line and shows what comes back. The
three take turns.

Run: python bench/bench_keys.py
"""

from __future__ import annotations

import re
import socket
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from report import Row, compared, main, percentile
from sim_process import served
from terminal import Terminal, multidrop

AIMS = {"Enter to the wire": 1.0, "reply to the screen": 27.0}
TRIES = 30
CELL = '[[bus]]\nname = "line"\nserve = ["tcp://127.0.0.1:0"]\n[[bus.drive]]\npersonality = "LMDCM"\nset = { EM = 1 }\n'
TYPED = b"PR R4"
SIGNED = re.compile(rb'PR R4(?:,"([^"]*)")?[\r\n]')
BARE = """
import asyncio, os, socket, sys, tty
tty.setraw(0)
out = socket.create_connection(("127.0.0.1", int(sys.argv[1])))
out.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
loop, held = asyncio.new_event_loop(), bytearray()
def typed():
    held.extend(os.read(0, 4096))
    if held.endswith(b"\\r"):
        out.send(bytes(held))
        held.clear()
loop.add_reader(0, typed)
loop.add_reader(out, lambda: os.write(1, out.recv(4096)))
print("opened", flush=True)
loop.run_forever()
"""


class Tap:
    """A wire between a program and a simulated drive. It answers the measured print itself."""

    def __init__(self, drive: str) -> None:
        host, _, port = drive.removeprefix("tcp://").rpartition(":")
        self.target = (host, int(port))
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.port = self.listener.getsockname()[1]
        self.answer = b""
        self.passed: list[float] = []
        """The time at which the measured print passed, CLOCK_MONOTONIC."""
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self) -> None:
        client, _ = self.listener.accept()
        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        drive = socket.create_connection(self.target)
        threading.Thread(target=self._back, args=(drive, client), daemon=True).start()
        while data := self._received(client):
            now = time.monotonic()
            if (found := SIGNED.search(data)) is None:
                drive.sendall(data)
                continue
            self.passed.append(now)
            client.sendall(b"\r\n%s%s\r\n" % (self.answer, found[1] or b""))

    @staticmethod
    def _received(client: socket.socket) -> bytes:
        """The next bytes; none after its end, which is a reset where it closed with bytes unread."""
        try:
            return client.recv(4096)
        except ConnectionResetError:
            return b""

    @staticmethod
    def _back(drive: socket.socket, client: socket.socket) -> None:
        while data := drive.recv(4096):
            client.sendall(data)


class Front:
    """A program on its terminal and its wire."""

    def __init__(self, name: str, drive: str, folder: Path) -> None:
        self.tap = Tap(drive)
        url = f"tcp://127.0.0.1:{self.tap.port}?party=0&em=1&checksum=0"
        command = {
            "bare loop": [sys.executable, "-c", BARE, str(self.tap.port)],
            "prompt": multidrop("shell", url),
            "TUI": multidrop("tui", url),
        }[name]
        self.terminal = Terminal(command, folder)
        self.terminal.until({"bare loop": b"opened", "prompt": b"STOP ALL", "TUI": b"LMDCM"}[name])
        self.times: dict[str, list[float]] = {figure: [] for figure in AIMS}

    def measure(self, number: int) -> None:
        """Type a line, press Enter, and note both times in ms.

        The replies have no digit in common: the TUI writes only what differs from the row before.
        """
        answer, before = b"%d" % (number % 9 + 1) * 9, len(self.tap.passed)
        self.tap.answer = answer
        self.terminal.type(TYPED)
        time.sleep(0.25 + number % 7 * 0.013)
        self.terminal.seek(answer)
        pressed = time.monotonic()
        self.terminal.type(b"\r")
        shown = self.terminal.found(5.0)
        assert shown is not None and len(self.tap.passed) == before + 1, bytes(self.terminal.shown[-500:])
        passed = self.tap.passed[-1]
        self.times["Enter to the wire"].append((passed - pressed) * 1e3)
        self.times["reply to the screen"].append((shown - passed) * 1e3)


def rows(full: bool) -> Iterator[Row]:
    """Both figures of both front ends beside a bare loop."""
    with ExitStack() as stack:
        fronts = {}
        for name in ("bare loop", "prompt", "TUI"):
            _, drive = stack.enter_context(served(CELL))
            folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
            fronts[name] = Front(name, drive, folder)
            stack.callback(fronts[name].terminal.end)
        time.sleep(2.0)
        for number in range(TRIES * (4 if full else 1)):
            for front in fronts.values():
                front.measure(number)
        for figure, aim in AIMS.items():
            peer = fronts["bare loop"].times[figure]
            for name in ("prompt", "TUI"):
                ours = fronts[name].times[figure]
                note = f"p95 {percentile(ours, 95):.1f}, peer's {percentile(peer, 95):.1f}"
                yield compared(f"{figure}, {name}", "ms", ours, peer, "bare loop", aim=aim, note=note)


if __name__ == "__main__":
    main(rows)
