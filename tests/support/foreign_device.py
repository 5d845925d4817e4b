"""A Modbus/TCP server of a device that is no Lexium drive, in a thread: it keeps every PDU that it receives."""

from __future__ import annotations

import socketserver
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import cast

IDENTIFY, READ, READ_BITS, READ_SPECIFIC = 0x2B, 0x03, (0x01, 0x02), 0x41
WRITES = (0x05, 0x10)
LEXIUM = {0: "SEM USA", 1: "LMDCE571", 2: "4.0.0.0", 6: "LMDCE 6.002, Hw: 3.2"}
PLC = {0: "Acme", 1: "PLC-7", 2: "1.0"}


class Device(socketserver.ThreadingTCPServer):
    """Every register reads as 7, so its "velocity" never becomes 0; it takes every write and refuses other functions.

    `identity` None: it does not know function 43/14. `deaf`: identifications that it does not answer at first.
    """

    daemon_threads = True
    allow_reuse_address = True

    def __init__(self, identity: dict[int, str] | None = None, deaf: int = 0) -> None:
        super().__init__(("127.0.0.1", 0), _Client)
        self.identity, self.deaf = identity, deaf
        self.heard: list[bytes] = []
        self.hang_up_on: tuple[int, ...] = ()
        """Functions after which it ends the connection without a reply."""

    @property
    def url(self) -> str:
        return f"modbus://127.0.0.1:{self.server_address[1]}"

    @property
    def received(self) -> list[str]:
        """Every PDU so far but identifications, as `10 0043`: the function and the register."""
        return [f"{pdu[0]:02x} {pdu[1:3].hex()}" for pdu in self.heard if pdu[0] != IDENTIFY]

    def answer(self, pdu: bytes) -> bytes | None:
        function = pdu[0]
        if function == IDENTIFY:
            if self.deaf:
                self.deaf -= 1
                return None
            if self.identity is not None:
                listed = b"".join(bytes((n, len(text))) + text.encode() for n, text in self.identity.items())
                return bytes((function, 14, pdu[2], 0x83, 0, 0, len(self.identity))) + listed
        if function == READ:
            count = int.from_bytes(pdu[3:5])
            return bytes((function, 2 * count)) + b"\0\7" * count
        if function in READ_BITS:
            return bytes((function, 1, 1))
        if function in WRITES:
            return pdu[:5]
        return bytes((function | 0x80, 1))


class _Client(socketserver.StreamRequestHandler):
    def handle(self) -> None:
        device = cast(Device, self.server)
        while len(head := self.rfile.read(7)) == 7:
            pdu = self.rfile.read(int.from_bytes(head[4:6]) - 1)
            device.heard.append(pdu)
            if pdu[0] in device.hang_up_on:
                return
            if (answer := device.answer(pdu)) is not None:
                self.wfile.write(head[:4] + (len(answer) + 1).to_bytes(2) + head[6:7] + answer)


@contextmanager
def device(identity: dict[int, str] | None = None, deaf: int = 0) -> Iterator[Device]:
    """Serve a device meanwhile."""
    with Device(identity, deaf) as server:
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02})
        thread.start()
        try:
            yield server
        finally:
            server.shutdown()
            thread.join()
