"""`multidrop share` as a command."""

from __future__ import annotations

import json
import signal
import socket
from pathlib import Path

import pytest

from tests.support.front_door import command
from tests.support.processes import Running
from tests.support.until import PATIENCE


@pytest.mark.process
@pytest.mark.fork
def test_it_serves_says_who_writes_and_ends_well_on_a_signal(tmp_path: Path) -> None:
    running = Running("share", "sim:#press", "--rfc2217", "0", "--json", folder=tmp_path)
    try:
        endpoint, _ = map(json.loads, running.until('{"ready": true}'))
        assert endpoint["bus"] == "press" and endpoint["endpoint"].startswith("rfc2217://127.0.0.1:")
        port = int(endpoint["endpoint"].rpartition(":")[2])
        with (
            socket.create_connection(("127.0.0.1", port)) as writer,
            socket.create_connection(("127.0.0.1", port)) as other,
        ):
            writer.settimeout(PATIENCE)
            other.settimeout(PATIENCE)
            writer.sendall(b"\naPR VM\n")
            assert writer.recv(1) == other.recv(1)  # of a checksummed drive's NAK
            other.sendall(b"MR 51200\r")
            assert other.recv(999) == b""
        running.process.send_signal(signal.SIGINT)
        assert running.end() == 0
    finally:
        running.process.kill()
    events = [json.loads(line) for line in running.said if "event" in line]
    assert {"connected", "writes", "refused"} <= {each["event"] for each in events}
    assert running.errors == []


@pytest.mark.parametrize(
    ("arguments", "code", "says"),
    [
        (("sim:#press", "--rfc2217", "1:2:x"), 2, "no port '1:2:x' to serve at; valid: PORT or HOST:PORT"),
        (("sim:#press", "--rfc2217", "70000"), 2, "no port '70000' to serve at"),
        (("sim:", "--rfc2217", "0"), 2, "sim:: 3 buses; name one of them, as in sim:#press"),
        (("sim:#gone", "--rfc2217", "0"), 2, 'no bus "gone"'),
        (("udp://10.0.0.5", "--rfc2217", "0"), 2, "datagrams cannot be shared"),
        (("modbus://10.0.0.5", "--rfc2217", "0"), 2, "a line of modbus cannot be shared"),
        (("/dev/does-not-exist", "--rfc2217", "0"), 3, "no port /dev/does-not-exist"),
        (("sim:#press",), 2, "the following arguments are required: --rfc2217"),
    ],
)
def test_what_cannot_be_shared_is_one_line(tmp_path: Path, arguments: tuple[str, ...], code: int, says: str) -> None:
    done = command(tmp_path, "share", *arguments)
    assert done.returncode == code and done.stdout == ""
    assert says in done.stderr and done.stderr.count("\n") == 1


def test_a_port_that_is_taken_is_one_line(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        done = command(tmp_path, "share", "sim:#press", "--rfc2217", str(port))
    assert done.returncode == 3
    assert (
        done.stderr == f"--rfc2217 127.0.0.1:{port}: cannot listen there: Address already in use; give another port\n"
    )
