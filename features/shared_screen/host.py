"""The host's side of a shared screen: a Unix socket that only this account may use, and a thread for each watcher.

The thread reads nothing but stops, and writes each onto the wires itself, as the thread that reads the keys does. What
a watcher gets waits in a bounded queue with a writer of its own, so one that does not read delays nobody.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import socket
import stat
import struct
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from multidrop.base.atomic import make_folder
from multidrop.base.errors import Diagnostic
from multidrop.base.isolation import isolated
from multidrop.features.shared_screen import wire
from multidrop.shell.threads import BoundedWriter, Loss

assert sys.platform != "win32"

MOST_WATCHERS = 16
"""Watchers at one time, and connections that have not greeted yet."""
BACKLOG = 128
"""Connections that may come at once, before the thread that takes them comes to run."""
WAITING = 512 * 1024
"""The bytes that may wait for a watcher."""
HELLO_TIMEOUT = 5.0
"""Seconds for a greeting."""
WATCHER_STOP_PAUSE = 0.05
"""Seconds between two stops of a watcher: a flood of them does not keep the host from its work."""


@dataclass(frozen=True)
class GateCalls:
    """The functions that a gate calls: `stop_ahead` in the thread of a watcher, the others in the loop."""

    stop_ahead: Callable[[], None]
    stop: Callable[[str], None]
    """With the name of the watcher; follows each `stop_ahead`."""
    joined: Callable[[Watcher], None]
    behind: Callable[[Watcher], None]
    """Items were dropped, and the watcher reads again."""
    left: Callable[[Watcher], None]
    refused: Callable[[str], None]
    """With the reason."""


class Watcher:
    """The connection of one watcher."""

    def __init__(
        self,
        made: socket.socket,
        loop: asyncio.AbstractEventLoop,
        calls: GateCalls,
        admitted: Callable[[Watcher], bool],
    ) -> None:
        """`admitted`, called in its thread once it has greeted, takes a place for it, if there is one."""
        self.name = ""
        self._socket, self._loop, self._calls, self._admitted = made, loop, calls, admitted
        self._stops = 0
        self._writer = BoundedWriter(made.send, self._lost, lambda problem: self.close(), WAITING, name="watcher")

    def put(self, data: bytes, count: int, keep: bool = False) -> None:
        """Send a line of so many items, or drop it where too many wait; those to `keep` may be more. Never waits."""
        self._writer.put(data, keep, count)

    def close(self) -> None:
        """End the connection; its thread says the rest."""
        self._writer.give_up()
        with contextlib.suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)

    def turn_away(self, why: str) -> None:
        self._call(self._calls.refused, f"a watcher was refused: {why}")
        self._socket.close()

    def run(self) -> None:
        """Greet, then take stops until the end. Runs in a thread of its own."""
        with self._socket:
            try:
                if self._greeted():
                    self._call(self._calls.joined, self)
                    self._take_stops()
            except (OSError, wire.GarbledMessage):
                pass  # hung up, or no watcher
            finally:
                self.close()
                self._call(self._calls.left, self)

    def _greeted(self) -> bool:
        if peer(self._socket) != os.getuid():
            self.turn_away("it is of another account")
            return False
        self._socket.settimeout(HELLO_TIMEOUT)
        self._socket.sendall(wire.greeting())
        said, until = b"", time.monotonic() + HELLO_TIMEOUT
        while not said.endswith(b"\n"):
            data = self._socket.recv(1)  # no byte of what follows
            if not data or len(said) > wire.LONGEST_GREETING or time.monotonic() > until:
                return False
            said += data
        version, self.name = wire.greeted(said)
        if wrong := wire.other_version(version, f"the program of {self.name}"):
            self.turn_away(wrong)
            return False
        if not self._admitted(self):
            self.turn_away(f"more than {MOST_WATCHERS} watchers at a time")
            return False
        self._socket.settimeout(None)
        return True

    def _take_stops(self) -> None:
        while (data := self._socket.recv(4096)) and not data.strip(wire.STOP):
            with isolated("the stop of a watcher"):  # the loop stops all the same, and later ones are taken
                self._calls.stop_ahead()
            self._stops += len(data)
            self._call(self._calls.stop, self.name)
            self._writer.put(wire.line([wire.Item(wire.StopHeard(self._stops))]), keep=True)
            time.sleep(WATCHER_STOP_PAUSE)

    def _lost(self, loss: Loss) -> bytes:
        self._call(self._calls.behind, self)
        return wire.line([wire.Item(wire.Dropped(loss.count))])

    def _call(self, function: Callable[..., None], *arguments: object) -> None:
        with contextlib.suppress(RuntimeError):  # the loop has ended
            self._loop.call_soon_threadsafe(partial(function, *arguments))


class Gate:
    """The socket to which watchers connect; it is named by the process. Raises Diagnostic where there can be none."""

    def __init__(self, folder: Path, loop: asyncio.AbstractEventLoop, calls: GateCalls) -> None:
        self.path = folder / f"{os.getpid()}.sock"
        self.watchers: list[Watcher] = []
        """Those that have greeted; changed in the loop."""
        self._loop, self._calls, self._closed = loop, calls, False
        self._lock = threading.Lock()
        self._waiting: list[Watcher] = []
        """Connections that have not greeted yet, the oldest first."""
        self._admitted: set[Watcher] = set()
        self._socket = socket.socket(socket.AF_UNIX)
        try:
            private(folder)
            self.path.unlink(missing_ok=True)
            self._socket.bind(str(self.path))
            self.path.chmod(0o600)
            self._socket.listen(BACKLOG)
        except OSError as problem:
            self._socket.close()
            hint = "set MULTIDROP_STATE_DIR to a shorter path" if "too long" in str(problem) else ""
            raise Diagnostic(f"cannot share: {problem.strerror or problem}", str(self.path), hint) from None
        threading.Thread(target=self._accept, name="watchers", daemon=True).start()

    def _accept(self) -> None:
        while not self._closed:
            try:
                made, _ = self._socket.accept()
            except OSError:
                time.sleep(WATCHER_STOP_PAUSE)  # the end, or no descriptor is left
                continue
            watcher = Watcher(made, self._loop, self._calls, self._admit)
            with self._lock:
                self._waiting.append(watcher)
                oldest = self._waiting.pop(0) if len(self._waiting) > MOST_WATCHERS else None
            if oldest is not None:  # it would keep out one that greets
                oldest.close()
            threading.Thread(target=self._serve, args=(watcher,), name="watcher", daemon=True).start()

    def _admit(self, watcher: Watcher) -> bool:
        """Give a place to a watcher that has greeted; False where all are taken."""
        with self._lock:
            self._forget(watcher)
            there = len(self._admitted) < MOST_WATCHERS
            if there:
                self._admitted.add(watcher)
            return there

    def _serve(self, watcher: Watcher) -> None:
        try:
            watcher.run()
        finally:
            with self._lock:
                self._admitted.discard(watcher)
                self._forget(watcher)

    def _forget(self, watcher: Watcher) -> None:
        if watcher in self._waiting:
            self._waiting.remove(watcher)

    def close(self) -> None:
        self._closed = True
        self.path.unlink(missing_ok=True)
        with contextlib.suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)  # wakes the thread that accepts
        self._socket.close()
        with self._lock:
            waiting = [*self._waiting]
        for watcher in (*self.watchers, *waiting):
            watcher.close()


def private(folder: Path) -> None:
    """Make a folder that only this account can enter. Raises OSError where that cannot be."""
    make_folder(folder, 0o700)
    facts = folder.lstat()
    if not stat.S_ISDIR(facts.st_mode) or facts.st_uid != os.getuid():
        raise OSError(0, "the folder is another account's")
    folder.chmod(0o700)


def peer(made: socket.socket) -> int:
    """The account of the process at the other end."""
    if sys.platform == "linux":
        return int(struct.unpack("3i", made.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, 12))[1])
    return int(struct.unpack("2I", made.getsockopt(0, 1, 8))[1])  # LOCAL_PEERCRED: its version, then the account
