"""The interface of a transport: a pipe that promises nothing, losses, one that never opened, and that of a port."""

from __future__ import annotations

import importlib.util
import socket
import sys
from typing import Any

import pytest

import multidrop
from multidrop import transports
from multidrop.base.errors import TransportLost
from multidrop.transports import Lost, NotOpen, PortControl, Received, Transport, Undelivered, Unreachable
from multidrop.transports import serial_pipe as here
from multidrop.transports.serial_pipe import SerialPipe
from tests.support.until import until


class Plain(Transport):
    """A pipe with no more than it must have."""

    name = "plain"

    def start(self, received: Received, lost: Lost) -> None: ...

    def write(self, data: bytes) -> bool:
        return True

    def discard(self, whole: bool = False) -> int:
        return 0

    async def close(self) -> None: ...


def test_a_plain_pipe_promises_nothing_beyond_bytes() -> None:
    pipe, asked, noted = Plain(), list[int](), list[bool]()
    assert pipe.control is None and pipe.round_trip is None and pipe.pending == 0
    assert (pipe.limits, pipe.identity, pipe.other_user(), pipe.suspects()) == ("", "", "", "")
    assert not pipe.network and not pipe.preemptible and not pipe.may_invalidate

    def make(number: int) -> bytes:
        asked.append(number)
        return b"stop"

    assert pipe.preempt(False, make) is False and pipe.follow(make) is False and pipe.follow(make, key=True) is False
    assert asked == [], "a stop that cannot leave from a thread is not made there"
    assert pipe.yielded(noted.append) is True and noted == [True] and pipe.yielded() is True


def test_each_line_of_a_port_is_switched_by_its_name() -> None:
    switched: list[tuple[str, bool]] = []

    class Port(PortControl):
        def set_baud(self, baud: int) -> None: ...

        def _switch(self, line: str, on: bool) -> None:
            switched.append((line, on))

    port = Port()
    for switch in (port.set_dtr, port.set_rts, port.set_break):
        switch(True)
        switch(False)
    assert switched == [(line, on) for line in ("DTR", "RTS", "break") for on in (True, False)]


@pytest.mark.parametrize("kind", [TransportLost, Unreachable, Undelivered])
def test_a_loss_is_raised_anew_for_each_caller(kind: type[TransportLost]) -> None:
    loss = kind("the port is gone")
    again = loss.again()
    assert type(again) is kind and again is not loss and again.args == loss.args and str(again) == "the port is gone"
    assert (loss.unproven, loss.executed) == ("", "") and isinstance(loss, TransportLost)


def test_scripts_catch_a_loss_by_the_name_of_the_package() -> None:
    assert multidrop.TransportLost is TransportLost and multidrop.Unreachable is Unreachable
    assert TransportLost.__module__ == Unreachable.__module__ == "multidrop", "a traceback names it so"


async def test_a_pipe_that_could_not_be_opened_breaks_as_it_is_started() -> None:
    failure, losses, heard = Unreachable("no such port"), list[TransportLost](), list[bytes]()
    pipe = NotOpen("/dev/ttyUSB0", failure)
    assert pipe.name == "/dev/ttyUSB0" and losses == []
    pipe.start(heard.append, losses.append)
    assert losses == [failure] and heard == []
    assert pipe.write(b"x") is False and pipe.write(b"") is False and pipe.discard() == pipe.discard(True) == 0
    await pipe.close()


@pytest.mark.fork
def test_what_the_system_holds_of_a_stream_is_counted_and_of_anything_else_is_none(tmp_path: Any) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server, socket.socket() as near:
        server.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        near.connect(server.getsockname())
        far, _ = server.accept()
        with far:
            assert transports.output_queue(near.fileno()) == 0
            near.setblocking(False)
            sent = 0
            with pytest.raises(BlockingIOError):
                while True:
                    sent += near.send(bytes(65536))
            assert 1000 < transports.output_queue(near.fileno()) <= sent
    with open(tmp_path / "file", "wb") as file:
        assert transports.output_queue(file.fileno()) == 0


def test_windows_needs_nothing_of_posix_for_the_interface(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("fcntl", "termios"):
        monkeypatch.setitem(sys.modules, name, None)
    monkeypatch.setattr(sys, "platform", "win32")
    spec = importlib.util.spec_from_file_location("transports_of_windows", transports.__file__)
    assert spec is not None and spec.loader is not None
    made = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(made)
    assert made.NotOpen.preemptible is False and not hasattr(made, "output_queue")


# The pipe of a serial port


class Machine:
    """The programs of a machine, as they are looked up."""

    def __init__(self) -> None:
        self.looked: list[str] = []
        self.beside, self.suspected = "", "perhaps ModemManager"

    def find(self, port: str) -> str:
        self.looked.append(port)
        return self.beside

    def suspect(self, port: str) -> str:
        assert port == "/dev/ttyUSB0"
        return self.suspected


class Port:
    """A port that nothing is written to."""

    name = "/dev/ttyUSB0"

    def explain(self, error: OSError | None) -> str:
        return ""

    def unsent(self) -> int:
        return 0

    def close(self) -> None: ...


@pytest.mark.fork
@pytest.mark.virtual
async def test_who_has_a_port_is_looked_up_when_asked_and_again_after_10_s(monkeypatch: pytest.MonkeyPatch) -> None:
    machine = Machine()
    port: Any = Port()
    control: Any = object()
    monkeypatch.setattr(here, "beside", machine.find)
    monkeypatch.setattr(here, "suspects", machine.suspect)
    pipe = SerialPipe(port, control, "minicom has it, too")
    assert pipe.name == "/dev/ttyUSB0" and pipe.control is control
    assert pipe.limits == "minicom has it, too" and machine.looked == []
    assert (pipe.other_user(), pipe.suspects()) == ("", "perhaps ModemManager"), "minicom has gone"
    machine.beside = "screen has it, too"
    passed = await until(lambda: pipe.other_user() != "")
    assert 10.0 <= passed <= 10.02 and machine.looked == ["/dev/ttyUSB0"] * 2
    assert (pipe.other_user(), pipe.suspects()) == ("screen has it, too", ""), "who is known is no suspect"
    machine.beside = ""
    assert 10.0 <= await until(lambda: pipe.suspects() != "") <= 10.02 and pipe.other_user() == ""
    await pipe.close()


@pytest.mark.fork
@pytest.mark.virtual
@pytest.mark.parametrize("ask", ["other_user", "suspects"])
async def test_either_question_looks(monkeypatch: pytest.MonkeyPatch, ask: str) -> None:
    machine = Machine()
    monkeypatch.setattr(here, "beside", machine.find)
    monkeypatch.setattr(here, "suspects", machine.suspect)
    port: Any = Port()
    pipe = SerialPipe(port, port, "")
    getattr(pipe, ask)()
    assert machine.looked == ["/dev/ttyUSB0"]
    await pipe.close()
