"""The client of RFC 2217 against a real ser2net in front of a pseudo-terminal."""

from __future__ import annotations

import asyncio
import os
import socket
import subprocess
from pathlib import Path

import pytest

from multidrop.base.errors import TransportLost
from multidrop.transports import Unreachable
from multidrop.transports.rfc2217 import Rfc2217Pipe, open_rfc2217
from tests.support.posix import termios, tty
from tests.support.tools import tool
from tests.support.until import PATIENCE, until

pytestmark = [
    pytest.mark.process,
    pytest.mark.needs("ser2net"),
    pytest.mark.pty,
]
CONFIGURATION = """connection: &line
  accepter: telnet(rfc2217),tcp,127.0.0.1,{port}
  connector: serialdev,{device},9600n81,local
"""


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        return int(taken.getsockname()[1])


async def reached(port: int) -> Rfc2217Pipe:
    """The port, once the server has begun to listen."""
    for _ in range(500):
        try:
            return await open_rfc2217("127.0.0.1", port, 19200)
        except Unreachable as refused:
            assert "nothing listens" in str(refused)
            await asyncio.sleep(0.02)
    raise AssertionError("ser2net does not listen")


def rate(descriptor: int) -> int:
    return int(termios.tcgetattr(descriptor)[4])


async def test_a_real_ser2net(tmp_path: Path) -> None:
    far, near = os.openpty()
    tty.setraw(near)
    os.set_blocking(far, False)
    port = free_port()
    (tmp_path / "ser2net.yaml").write_text(CONFIGURATION.format(port=port, device=os.ttyname(near)))
    with (tmp_path / "output").open("w") as output:
        server = subprocess.Popen(
            [tool("ser2net"), "-n", "-c", str(tmp_path / "ser2net.yaml")], stdout=output, stderr=output
        )
    got, losses = bytearray(), list[TransportLost]()
    try:
        pipe = await reached(port)
        assert rate(far) == termios.B19200
        # A pseudo-terminal has no DTR, and ser2net then does not reply.
        assert pipe.limits == "the server does not confirm DTR, RTS; a party line does not need it"
        pipe.start(got.extend, losses.append)

        pipe.write(bytes(range(256)))
        arrived = bytearray()
        await until(lambda: arrived.extend(read(far)) or len(arrived) == 256)
        os.write(far, bytes(range(256)))
        await until(lambda: len(got) == 256)
        assert arrived == got == bytes(range(256))

        await asyncio.to_thread(pipe.control.set_baud, 38400)
        assert rate(far) == termios.B38400
        await asyncio.to_thread(pipe.control.set_break, True)
        await asyncio.to_thread(pipe.control.set_break, False)

        with pytest.raises(Unreachable, match="the server said 'Port already in use'"):
            await open_rfc2217("127.0.0.1", port)

        pipe.discard()
        pipe.write(b"\x1b")
        arrived.clear()
        await until(lambda: arrived.extend(read(far)) or arrived == b"\x1b")
    finally:
        server.terminate()
        server.wait(PATIENCE)
        await until(lambda: losses)
        await pipe.close()
        os.close(far)
        os.close(near)
    assert "closed by the other end" in str(losses[0])


def read(descriptor: int) -> bytes:
    try:
        return os.read(descriptor, 4096)
    except BlockingIOError:
        return b""
