"""A TCP server that speaks just enough MCode, and puts terminal commands into everything that it says."""

from __future__ import annotations

import re
import socketserver
import threading
from collections.abc import Iterator

import pytest

HOSTILE = b"\x1b]52;c;cHduZWQ=\x07\x1b]0;pwned\x07\x1b[?1047h\x9b2J\x1b[31mred\x1bc\x85\x0e"
ACTING = (
    b"\x1b]52",
    b"\x1b]0;pwned",
    b"\x1b[?1047h",
    b"\x9b2J",
    b"\x1b[31mred",
    b"\x1bc",
    b"\xc2\x9b",
    b"\xe2\x80\xae",
)
"""Of which nothing may reach a terminal; as a drive sends it, and as UTF-8."""
OVERRIDE = "\u202e"
VALUES = {"VR": b"LMDCM 6.002, Hw: 3.2", "EM": b"1", "ES": b"1", "PN": b"LMDCM", "DN": b'"!"', "P": b"51200"}
URL = "tcp://127.0.0.1:{}?em=1&party=0&checksum=0"


class _Drive(socketserver.StreamRequestHandler):
    def handle(self) -> None:
        held = b""
        while data := self.request.recv(4096):
            *lines, held = re.split(rb"[\r\n]", held + data)
            for line in lines:
                self._answer(line.decode("latin-1").strip())

    def _answer(self, line: str) -> None:
        if not line.startswith("PR"):
            return
        items = re.findall(r'"[^"]*"|[^,]+', line[2:].strip())
        parts = [each.strip('"').encode() if each[0] == '"' else VALUES.get(each.strip(), b"0") for each in items]
        self.request.sendall(b"".join(parts) + b"\r\n" + b"says " + HOSTILE + b"\r\n")


class _Server(socketserver.ThreadingTCPServer):
    allow_reuse_address = daemon_threads = True


@pytest.fixture
def hostile_url() -> Iterator[str]:
    """The URL of a hostile drive."""
    with _Server(("127.0.0.1", 0), _Drive) as server:
        threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01}, daemon=True).start()
        yield URL.format(server.server_address[1])
        server.shutdown()
