"""The loop of a relay, turn by turn: what it waits for, what it passes on, and how it ends."""

from __future__ import annotations

import contextlib
import errno
import os
import select
import socket
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import pytest

from multidrop.base.errors import TransportLost
from multidrop.transports import relay
from multidrop.transports.relay import (
    CREDIT,
    GREETING,
    MOST_FRAME_BYTES,
    SILENCE,
    FrameSplitter,
    GarbledFrame,
    Kind,
    Relay,
    frame,
    serve,
)
from tests.support.cases import for_each

pytestmark = pytest.mark.fork

BEAT = frame(Kind.BEAT)
Steps = list[Callable[[], object]]


class Port:
    """A port with a descriptor, and the other end of its line. `held` are bytes in its driver, `fails` an error."""

    baud = 9600

    def __init__(self) -> None:
        self.inner, self.line = socket.socketpair()
        for each in (self.inner, self.line):
            each.setblocking(False)
        self.held = 0
        self.takes = 10**9
        self.fails: dict[str, OSError] = {}
        self.closed = False
        self.dropped = 0

    @property
    def control(self) -> Port:
        return self

    def fileno(self) -> int:
        return self.inner.fileno()

    def _fail(self, what: str) -> None:
        if what in self.fails:
            raise self.fails[what]

    def read(self) -> bytes | None:
        self._fail("read")
        return self.inner.recv(4096) or None

    def write(self, data: bytes) -> int:
        self._fail("write")
        taken = data[: self.takes]
        if not taken:
            raise BlockingIOError
        self.takes -= len(taken)
        return self.inner.send(taken)

    def unsent(self) -> int:
        return self.held

    def drop(self) -> int:
        self.dropped += 1
        return 0

    def explain(self, error: OSError | None) -> str:
        return f"the port is gone ({error.strerror if error else 'hung up'})"

    def close(self) -> None:
        self.closed = True

    def set_baud(self, baud: int) -> None:
        self._fail("set")
        self.baud = baud


@dataclass
class Bench:
    """A relay with both ends of its way. Each turn of its loop begins with the next step; then its input ends."""

    port: Port
    here: socket.socket
    there: socket.socket
    now: float = 1000.0
    steps: Steps = field(default_factory=list)
    waits: list[float] = field(default_factory=list)
    """How long each turn would have waited."""
    asked: list[tuple[bool, bool, bool]] = field(default_factory=list)
    """Whether it waited for the port to receive, for the port to send, and for the reader."""
    asleep: Steps = field(default_factory=list)
    """What happens at each pause of its end."""
    said: bytearray = field(default_factory=bytearray)
    slept: float = 0.0

    def select(self, reads: list[int], writes: list[int], _: Any, patience: float) -> Any:
        self.waits.append(patience)
        port = self.port.fileno()
        self.asked.append((port in reads, port in writes, self.there.fileno() in writes))
        if self.steps:
            self.steps.pop(0)()
        else:
            self.here.shutdown(socket.SHUT_WR)
        return select.select(reads, writes, [], 0)

    def sleep(self, seconds: float) -> None:
        assert seconds > 0
        self.now += seconds
        self.slept += seconds
        if self.asleep:
            self.asleep.pop(0)()

    def serve(self, **given: float) -> None:
        serve(self.port, self.there.fileno(), self.there.fileno(), **given)  # type: ignore[arg-type]

    def send(self, data: bytes) -> Callable[[], object]:
        return lambda: self.here.sendall(data)

    def later(self, seconds: float) -> Callable[[], None]:
        def pass_by() -> None:
            self.now += seconds

        return pass_by

    def hear(self) -> list[tuple[Kind, bytes]]:
        """What the relay has said behind its greeting."""
        while select.select([self.here], [], [], 0)[0] and (data := self.here.recv(65536)):
            self.said += data
        greeting, _, rest = bytes(self.said).partition(b"\n")
        assert greeting == GREETING.encode()
        return list(FrameSplitter().take(rest))

    def sent(self) -> bytes:
        """What has come out of the port."""
        try:
            return self.port.line.recv(10**6)
        except BlockingIOError:
            return b""


@contextlib.contextmanager
def benches() -> Iterator[Bench]:
    made = Bench(Port(), *socket.socketpair())
    clock = SimpleNamespace(
        CLOCK_BOOTTIME=7,
        monotonic=lambda: made.now,
        clock_gettime=lambda which: made.now if which == 7 else 0.0,
        sleep=made.sleep,
    )
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(relay, "time", clock)
        patched.setattr(relay, "select", SimpleNamespace(select=made.select))
        yield made
    for each in (made.here, made.there, made.port.inner, made.port.line):
        each.close()


@pytest.fixture
def bench() -> Iterator[Bench]:
    with benches() as made:
        yield made


def test_both_sides_know_these_bytes_and_numbers() -> None:
    """Another version on the other machine relies on them."""
    assert GREETING == "multidrop-relay 1"
    assert (CREDIT, MOST_FRAME_BYTES, SILENCE, relay.BEAT, relay.MISSED) == (256, 4096, 6.0, 1.5, 3)
    assert frame(Kind.DATA, b"PR P\r") == b"D\x00\x05PR P\r"
    assert [frame(each) for each in Kind] == [bytes([each, 0, 0]) for each in b"DXTPSOL"]
    assert [int(each) for each in relay.PortSetting] == [1, 2, 3, 4]
    (longest,) = FrameSplitter().take(b"D\x10\x00" + b"x" * 4096)
    assert longest == (Kind.DATA, b"x" * 4096)
    with pytest.raises(GarbledFrame, match="^44 10 01 is not the beginning of a frame"):
        list(FrameSplitter().take(b"D\x10\x01" + b"x" * 4097))


def test_bytes_pass_both_ways_until_the_other_end_is_gone(bench: Bench) -> None:
    bench.steps = [bench.send(frame(Kind.DATA, b"PR P\r") + BEAT), lambda: bench.port.line.send(b"51200\r\n")]
    bench.serve()
    assert bench.sent() == b"PR P\r"
    assert bench.hear() == [
        (Kind.BEAT, b""),
        (Kind.DONE, (5).to_bytes(8)),
        (Kind.DATA, b"51200\r\n"),
    ]
    assert bench.port.closed and bench.slept < 0.01
    assert not os.get_blocking(bench.there.fileno())


BEGUN, STOP = frame(Kind.DATA, b"MR 5\r"), frame(Kind.DATA, b"\x1b")
DROP = frame(Kind.DROP)


@for_each("platform", ["linux", "darwin"])
def test_after_a_silence_it_ends_and_passes_on_only_a_stop(platform: str, monkeypatch: pytest.MonkeyPatch) -> None:
    for late, passed in [
        (BEGUN, b""),
        (DROP, b""),
        (BEGUN + DROP + STOP + BEGUN, b"\x1b"),
        (DROP + BEAT + STOP, b"\x1b"),
    ]:
        for given, limit in (({}, 6.0), ({"silence": 0.5}, 0.5)):
            with benches() as bench, monkeypatch.context() as patched:
                patched.setattr("sys.platform", platform)
                if platform == "darwin":
                    del relay.time.clock_gettime  # type: ignore[attr-defined]
                bench.port.takes = 3

                def at_last(bench: Bench = bench, late: bytes = late, limit: float = limit) -> None:
                    bench.port.takes = 100
                    bench.later(limit + 0.01)()
                    bench.here.sendall(late)

                bench.steps = [
                    bench.send(frame(Kind.DATA, b"MR 51200\r")),
                    bench.later(limit),
                    bench.send(BEAT),
                    bench.later(limit - 0.01),
                    bench.send(BEAT),
                    at_last,
                ]
                with pytest.raises(
                    TransportLost, match=f"^the relay has ended: it got no sign of life for {limit:g} s$"
                ):
                    bench.serve(**given)
                assert bench.sent() == b"MR " + passed, "the rest of the command waited here"
                assert (bench.port.dropped, bench.port.closed) == (len(passed), True)


def test_a_port_that_is_lost_as_a_late_stop_comes_is_named_and_not_the_silence(bench: Bench) -> None:
    def at_last() -> None:
        bench.later(6.01)()
        bench.port.fails = {"write": OSError(errno.EIO, "Input/output error")}
        bench.here.sendall(DROP + STOP)

    bench.steps = [at_last]
    with pytest.raises(TransportLost, match=r"^the port is gone \(Input/output error\)$"):
        bench.serve()
    assert bench.hear()[-1] == (Kind.LOST, b"the port is gone (Input/output error)")


def test_it_sleeps_until_something_can_be_done_and_looks_often_while_the_driver_holds_bytes(bench: Bench) -> None:
    bench.port.takes, bench.port.held = 3, 3

    def sent() -> None:
        bench.port.held = 0

    bench.steps = [
        bench.later(0.0),
        bench.send(frame(Kind.DATA, b"MR 51200\r")),
        bench.later(0.0),
        sent,
        bench.later(4.0),
        lambda: setattr(bench.port, "takes", 100),
        bench.later(0.0),
    ]
    bench.serve()
    assert bench.waits[:2] == [6.0, 6.0]
    assert max(bench.waits[2:4]) == 0.002, "the driver reports nothing by itself"
    assert bench.waits[4:6] == [6.0, pytest.approx(2.0)]
    receives, sends, reads = zip(*bench.asked, strict=True)
    assert all(receives)
    assert sends == (False, False, True, True, True, True, False, False), "it waits for the port while bytes wait here"
    assert reads == (True, False, False, False, True, False, True, False)
    assert bench.sent() == b"MR 51200\r"
    assert bench.hear() == [(Kind.DONE, (3).to_bytes(8)), (Kind.DONE, (9).to_bytes(8))]


def test_from_a_port_that_floods_a_slow_reader_no_more_is_read_than_fits(bench: Bench) -> None:
    flood = bytes(range(256)) * 16
    bench.there.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4096)

    def line() -> None:
        if select.select([], [bench.port.line], [], 0)[1]:
            bench.port.line.send(flood)

    bench.steps = [line] * 60
    bench.asleep = [lambda: bench.hear()] * 400
    bench.serve()
    stopped = [receives for receives, _, _ in bench.asked]
    assert stopped[0] and not stopped[-1]
    data = b"".join(payload for _, payload in bench.hear())
    assert 65536 <= len(data) < 65536 + 20_000
    assert data == (flood * 60)[: len(data)], "at the end all that was read reaches the reader"


@for_each(
    "fails, told",
    [
        ("read", "the port is gone (Input/output error)"),
        ("write", "the port is gone (Input/output error)"),
        ("", "the port is gone (hung up)"),
    ],
)
def test_a_port_that_is_lost_is_told_here_and_there_and_closed(fails: str, told: str) -> None:
    with benches() as bench:
        bench.port.fails = {fails: OSError(errno.EIO, "Input/output error")}
        bench.steps = [bench.send(frame(Kind.DATA, b"PR P\r"))] if fails == "write" else []
        bench.steps.append(bench.port.line.close if not fails else lambda: bench.port.line.send(b"0"))
        with pytest.raises(TransportLost) as caught:
            bench.serve()
        assert str(caught.value) == told and bench.port.closed
        assert bench.hear() == [(Kind.LOST, told.encode())]


def test_a_port_that_is_lost_while_bytes_wait_for_it_is_told_too(bench: Bench) -> None:
    bench.port.takes = 0
    bench.steps = [
        bench.send(frame(Kind.DATA, b"PR P\r")),
        lambda: bench.port.fails.update(write=OSError(errno.EIO, "Input/output error")),
    ]
    with pytest.raises(TransportLost, match=r"^the port is gone \(Input/output error\)$"):
        bench.serve()
    assert bench.hear()[-1][0] is Kind.LOST


def test_the_reason_of_a_loss_is_cut_to_what_a_frame_may_be(bench: Bench) -> None:
    bench.port.fails = {"read": OSError(errno.EIO, "x" * 5000)}
    bench.steps = [lambda: bench.port.line.send(b"0")]
    with pytest.raises(TransportLost):
        bench.serve()
    ((kind, told),) = bench.hear()
    assert kind is Kind.LOST and len(told) == 1000 and told.startswith(b"the port is gone (xxx")


def test_input_of_another_program_is_named_as_that(bench: Bench) -> None:
    bench.steps = [bench.send(b"GET / HTTP/1.1\r\n")]
    with pytest.raises(TransportLost, match="^standard input is not from multidrop: 47 45 54 is not the beginning of"):
        bench.serve()
    assert bench.port.closed


@for_each(
    "problem, told",
    [
        (OSError(errno.EINVAL, "Invalid argument"), b"Invalid argument"),
        (OSError("in words"), b"in words"),
        (OSError(), b"refused"),
        (None, b""),
    ],
)
def test_the_outcome_of_a_change_is_one_text(problem: OSError | None, told: bytes) -> None:
    with benches() as bench:
        bench.port.fails = {"set": problem} if problem else {}
        bench.steps = [bench.send(frame(Kind.SET, b"\x09\x01\x00\x00\x4b\x00"))]
        bench.serve()
        assert bench.hear() == [(Kind.OUTCOME, b"\x09" + told)]
        assert bench.port.baud == (9600 if problem else 19200)


@for_each("dies", ["input", "reader"])
def test_where_the_other_end_has_died_it_ends_at_once(dies: str) -> None:
    with benches() as bench, contextlib.ExitStack() as stack:
        source, sink = socket.socketpair(), socket.socketpair()
        for each in (*source, *sink):
            stack.enter_context(each)

        def die() -> None:
            (source if dies == "input" else sink)[0].close()  # what it has not read makes it a reset

        source[1].sendall(b"never read")
        sink[1].sendall(b"never read")
        bench.steps = [die, *[lambda: bench.port.line.send(b"0")] * 3]
        left = len(bench.steps)
        serve(bench.port, source[1].fileno(), sink[1].fileno())  # type: ignore[arg-type]
        assert len(bench.steps) >= left - 2 and bench.slept < 0.01
        assert bench.port.closed


def test_at_the_end_it_waits_for_the_driver_to_send_a_last_stop(bench: Bench) -> None:
    bench.port.held = 2

    def sends() -> None:
        bench.port.held -= 1

    bench.steps, bench.asleep = [bench.send(STOP)], [sends, sends]
    bench.serve()
    assert bench.slept == pytest.approx(0.004)


def test_at_the_end_it_waits_no_longer_than_a_second(bench: Bench) -> None:
    bench.port.held = 2
    bench.serve()
    assert bench.slept == pytest.approx(1.0, abs=0.01)


def test_at_the_end_a_reader_that_takes_nothing_is_given_a_second_too(bench: Bench) -> None:
    bench.there.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4096)
    bench.steps = [lambda: bench.port.line.send(bytes(4096))] * 10
    bench.serve()
    assert bench.slept == pytest.approx(1.0, abs=0.01)


def test_a_late_stop_drops_what_waits_here_and_in_the_driver() -> None:
    with benches() as bench:
        bench.port.takes = 2
        far = Relay(bench.port)  # type: ignore[arg-type]
        far.receive(frame(Kind.DATA, b"MR 51200\r"))
        assert (bench.sent(), far.held) == (b"MR", False)
        bench.port.takes = 100
        far.late(DROP + STOP)
        assert (bench.sent(), bytes(far.queue), bench.port.dropped) == (b"\x1b", b"", 1)


def test_bytes_are_reported_once_and_as_soon_as_they_have_left_the_driver() -> None:
    with benches() as bench:
        far = Relay(bench.port)  # type: ignore[arg-type]
        far.out.clear()
        bench.port.held = 4
        far.receive(frame(Kind.DATA, b"PR P\r"))
        assert (bytes(far.out), far.held) == (frame(Kind.DONE, (1).to_bytes(8)), True)
        far.out.clear()
        far.push()
        assert not far.out, "nothing more has left"
        bench.port.held = 0
        far.push()
        far.push()
        assert (bytes(far.out), far.held) == (frame(Kind.DONE, (5).to_bytes(8)), False)
