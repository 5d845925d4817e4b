"""Real multidrop processes for the tests, and a tap on a TCP wire that keeps what is written."""

from __future__ import annotations

import os
import queue
import selectors
import socket
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path

from tests.support.paths import ROOT
from tests.support.until import PATIENCE


def environment(folder: Path) -> dict[str, str]:
    """What a process is given so that it keeps to `folder`, and finds the rooms from there. No PYTHON* is passed on."""
    inherited = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    return inherited | {
        "PYTHONPATH": str(ROOT),
        "MULTIDROP_CONFIG_DIR": str(folder / "conf"),
        "MULTIDROP_STATE_DIR": str(folder / "state"),
        "MULTIDROP_DATA_DIR": str(folder / "data"),
        "TERM": "xterm",
        "PROMPT_TOOLKIT_NO_CPR": "1",
    }


class Running:
    """A multidrop process whose lines are read as they come. Its standard input is open until it ends."""

    def __init__(self, *arguments: str, folder: Path) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-m", "multidrop", *arguments],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            bufsize=1,
            cwd=folder,
            env=environment(folder),
        )
        self.lines: queue.Queue[str] = queue.Queue()
        self.said: list[str] = []
        self.errors: list[str] = []
        self._readers = [
            threading.Thread(target=self._read, args=(self.process.stdout, self.lines.put), daemon=True),
            threading.Thread(target=self._read, args=(self.process.stderr, self.errors.append), daemon=True),
        ]
        for reader in self._readers:
            reader.start()

    @staticmethod
    def _read(stream, take) -> None:
        for line in stream:
            take(line.rstrip("\n"))

    def say(self, *lines: str) -> None:
        """Write lines to its standard input."""
        for line in lines:
            self.process.stdin.write(line + "\n")
        self.process.stdin.flush()

    def until(self, text: str) -> list[str]:
        """What it prints up to the line that is `text`."""
        got: list[str] = []
        while not got or got[-1] != text:
            try:
                got.append(self.lines.get(timeout=PATIENCE))
            except queue.Empty:
                self.kill()
                raise AssertionError(f"{text!r} did not come; got {got}, errors {self.errors}") from None
        self.said += got
        return got

    def kill(self) -> None:
        """End it at once."""
        self.process.kill()
        self.end()

    def end(self) -> int:
        """Wait for its end; its exit code."""
        if self.process.stdin:
            self.process.stdin.close()
        try:
            code = self.process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            self.process.kill()  # nothing that a failing test leaves behind may keep the run from its end
            raise
        for reader in self._readers:
            reader.join(PATIENCE)
        self.process.stdout.close()
        self.process.stderr.close()
        while not self.lines.empty():
            self.said.append(self.lines.get())
        return code


class Tap:
    """A TCP port in front of another one, which keeps the bytes that its clients write. Close it.

    `answer` in place of a port: what is sent back for what a client wrote, by a drive of the test's own.
    """

    def __init__(self, beyond: tuple[str, int] | None = None, answer: Callable[[socket.socket], None] | None = None):
        self._beyond, self._answer = beyond, answer
        self._server = socket.create_server(("127.0.0.1", 0))
        self._written = bytearray()
        self._clients: set[socket.socket] = set()
        self._held: bytes | None = None
        self._changed = threading.Condition()
        self._thread = threading.Thread(target=self._accept, daemon=True)
        self._thread.start()

    @property
    def port(self) -> int:
        """Where clients go."""
        return int(self._server.getsockname()[1])

    def written(self) -> bytes:
        """What clients have written; all of it, once they are gone."""
        with self._changed:
            assert self._changed.wait_for(lambda: not self._clients, PATIENCE), "a client of the tap stays"
            return bytes(self._written)

    def forget(self) -> None:
        """Keep from here on."""
        self.written()
        self._written.clear()

    def wait_for(self, text: bytes) -> None:
        """Until clients have written this."""
        with self._changed:
            assert self._changed.wait_for(lambda: text in self._written, PATIENCE), f"{text!r} was not written"

    def hang_up(self) -> None:
        """Cut all connections."""
        with self._changed:
            for client in self._clients:
                client.shutdown(socket.SHUT_RDWR)

    def hold(self, text: bytes) -> None:
        """Whenever a client writes this, hold back everything that comes for it until it writes again."""
        self._held = text

    def _keep(self, data: bytes) -> bool:
        """Keep bytes of a client; whether answers are to be held until the next ones."""
        with self._changed:
            self._written += data
            self._changed.notify_all()
        return self._held is not None and self._held in data

    def close(self) -> None:
        """Take no more clients."""
        self._server.shutdown(socket.SHUT_RDWR)  # closing alone does not end an accept that waits
        self._server.close()
        self._thread.join(PATIENCE)

    def _accept(self) -> None:
        while True:
            try:
                client, _ = self._server.accept()
            except OSError:
                return
            with self._changed:
                self._clients.add(client)
            threading.Thread(target=self._serve, args=(client,), daemon=True).start()

    def _serve(self, client: socket.socket) -> None:
        try:
            with client:
                if self._answer is not None:
                    self._answer(client)
                elif self._beyond is not None:
                    with socket.create_connection(self._beyond) as drive:
                        self._pass_on(client, drive)
        except OSError:
            pass  # either side hung up
        finally:
            with self._changed:
                self._clients.discard(client)
                self._changed.notify_all()

    def _pass_on(self, client: socket.socket, drive: socket.socket) -> None:
        late, held = bytearray(), False
        with selectors.DefaultSelector() as ready:
            ready.register(client, selectors.EVENT_READ)
            ready.register(drive, selectors.EVENT_READ)
            while True:
                for key, _ in ready.select():
                    data = key.fileobj.recv(4096)
                    if not data:
                        return
                    if key.fileobj is drive:
                        late += data
                    else:
                        held = self._keep(data)
                        drive.sendall(data)
                if not held:
                    client.sendall(late)
                    late.clear()


def names_of_packages(folder: Path) -> None:
    """Read the entry points of this environment, as the first session does, so that the next one need not."""
    code = "from multidrop.base.registry import entries; entries()"
    subprocess.run([sys.executable, "-c", code], env=environment(folder), cwd=folder, timeout=PATIENCE, check=True)
