"""A process between a host and simulated drives: passes bytes on, floods the host, reports when a stop passes.

Run: python bench/wire_tap.py LINES_A_SECOND HOST:PORT ...     A listener is made for each drive's endpoint.

It prints `listening PORT ...` once, then `stop INDEX TIME` (CLOCK_MONOTONIC, s) for each write to a drive in which a
stop passes. `flood 1` and `flood 0` on standard input switch the flood on and off. A flood line has 64 bytes, and goes
between the drives' own lines.
"""

from __future__ import annotations

import os
import selectors
import socket
import sys
import time
from collections.abc import Callable

STOPS = (b"\x1b", b"\x05")
BURST = 0.01
"""Seconds between two pieces of the flood."""


class Tap:
    """One wire. `client` is the host's connection, once it has come."""

    def __init__(self, index: int, target: str) -> None:
        host, _, port = target.rpartition(":")
        self.index = index
        self.drive = socket.create_connection((host, int(port)))
        self.drive.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.client: socket.socket | None = None
        self.whole = True
        self.count = 0

    def accept(self) -> None:
        """The host connects."""
        self.client, _ = self.listener.accept()
        self.client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.client.setblocking(False)

    def to_drive(self) -> bool:
        """Pass on what the host wrote; False at its end."""
        assert self.client is not None
        try:
            data = self.client.recv(4096)
        except ConnectionResetError:
            data = b""
        if any(stop in data for stop in STOPS):
            print(f"stop {self.index} {time.monotonic()}", flush=True)
        if data:
            self.drive.sendall(data)
        return bool(data)

    def to_host(self) -> None:
        """Pass on what the drive wrote."""
        data = self.drive.recv(4096)
        self.whole = data.endswith(b"\n")
        self.give(data)

    def give(self, data: bytes) -> None:
        """Write to the host; what it does not take is lost."""
        if self.client is not None:
            try:
                self.client.send(data)
            except BlockingIOError:
                return

    def flood(self, lines: int) -> None:
        """Some lines of a program that prints."""
        if self.whole and lines:
            self.count += lines
            self.give(b"".join(b"%-62d\r\n" % (self.count + n) for n in range(lines)))


def main() -> None:
    """Serve until standard input ends."""
    rate = int(sys.argv[1])
    taps = [Tap(index, target) for index, target in enumerate(sys.argv[2:])]
    print("listening", *(tap.listener.getsockname()[1] for tap in taps), flush=True)
    with selectors.DefaultSelector() as selector:
        serve(selector, taps, rate)


def serve(selector: selectors.BaseSelector, taps: list[Tap], rate: int) -> None:
    """Pass bytes on and flood, in one thread."""
    flooding = False

    def take(tap: Tap) -> None:
        tap.accept()
        assert tap.client is not None
        selector.register(tap.client, selectors.EVENT_READ, lambda: pass_on(tap))

    def pass_on(tap: Tap) -> None:
        if not tap.to_drive():
            assert tap.client is not None
            selector.unregister(tap.client)
            tap.client = None

    for tap in taps:
        selector.register(tap.listener, selectors.EVENT_READ, lambda tap=tap: take(tap))
        selector.register(tap.drive, selectors.EVENT_READ, tap.to_host)
    selector.register(0, selectors.EVENT_READ, lambda: None)
    due = time.monotonic()
    while True:
        for key, _ in selector.select(max(0.0, due - time.monotonic())):
            if key.fd == 0:
                said = os.read(0, 64).decode()
                if not said:
                    return
                flooding = "1" in said
                continue
            action: Callable[[], None] = key.data
            action()
        if time.monotonic() >= due:
            due = max(due + BURST, time.monotonic() - 0.1)
            for tap in taps:
                tap.flood(int(rate * BURST) if flooding else 0)


if __name__ == "__main__":
    main()
