"""A port of another machine through programs `ssh` in memory: logins, refusals, the bytes, the loss and the end."""

from __future__ import annotations

import asyncio
import errno
import os
import signal
import socket
import threading
from collections.abc import Iterator
from functools import partial

import pytest

from multidrop.base.errors import TransportLost
from multidrop.transports import Transport, Unreachable, ssh_session
from multidrop.transports.relay import Kind, frame
from multidrop.transports.relay_pipe import SocketStream
from multidrop.transports.ssh import FarPort, NotInstalled
from multidrop.transports.ssh_session import SshSession, greeted, open_ssh
from tests.support.cases import for_each
from tests.support.until import until
from tests.transports.ssh_in_memory import RELAY, SOCAT, FarRelay, Machine, Play, installed

pytestmark = pytest.mark.fork

FAR = FarPort("pc", "/dev/ttyUSB0")
LOGIN = FarPort("pc", "/dev/ttyUSB0", "me", 22)
BEAT = frame(Kind.BEAT)
BROKEN = "client_loop: send disconnect: Broken pipe"


@pytest.fixture
def here(monkeypatch: pytest.MonkeyPatch) -> Iterator[Machine]:
    machine = installed(monkeypatch)
    yield machine
    left = [program.command for program in machine.started if program.poll() is None]
    for program in machine.started:
        program.forget()
    assert left == [], "orphans"


def descriptors() -> int:
    return len(os.listdir("/dev/fd"))


class Ear:
    """What one transport has delivered."""

    def __init__(self, transport: Transport) -> None:
        self.data, self.losses = bytearray(), list[TransportLost]()
        transport.start(self.data.extend, self.losses.append)


# Refusals


@for_each(
    "play, told",
    [
        (
            Play(words="ssh: connect to host pc port 22: Connection refused\r\n", status=255),
            "not reached: ssh: connect",
        ),
        (
            Play(words="debug\nHost key verification failed.\n\n", status=255),
            "not reached: Host key verification failed",
        ),
        (Play(status=255), "not reached: ssh ended without a word"),
        (Play(status=-9), "ssh was ended by signal 9"),
        (Play(b"This account is not available.\n\n", status=1), "This account is not available."),
        (Play(b"welcome\n", "multidrop: no port /dev/ttyUSB0; plug it in.\n", 3), "no port /dev/ttyUSB0; plug it in"),
        (
            Play(b"", "2026/11/29 12:00:00 socat[12] E open(): No such file\n", 1),
            "open(): No such file; plug it in the",
        ),
        (Play(b"", "a  b\t c \n", 1), "a b c"),
        (Play(SOCAT, "2026/11/29 12:00:00 socat[12] E flock(5): busy\n", 1), "flock(5): busy; another program has the"),
        (Play(SOCAT, status=1), "the far side ended with status 1; try: ssh -p 22 me@pc multidrop relay /dev/ttyUSB0"),
        (Play(b"multidrop-relay 2\n"), "multidrop there speaks 'multidrop-relay 2', this one 'multidrop-relay 1'; ins"),
        (Play(b"multidrop-relay " + b"9" * 99 + b"\n"), f"multidrop there speaks 'multidrop-relay {'9' * 24}', this"),
        (Play(b"y\n" * 33000, status=0), "y"),
        (Play(b"", "x" * 9000, 1), "x" * 400),
    ],
)
async def test_what_goes_wrong_before_the_greeting_is_one_line(here: Machine, play: Play, told: str) -> None:
    before = descriptors()
    here.plays = [play]
    with pytest.raises(Unreachable) as caught:
        await open_ssh(LOGIN)
    text = str(caught.value)
    assert text.startswith(f"ssh://me@pc:22/dev/ttyUSB0: {told}") and "\n" not in text
    assert len(text) < 600, "a line that a person can read"
    for program in here.started:
        program.forget()
    assert descriptors() == before, "the connection is closed"


@for_each(
    "error, told",
    [
        (FileNotFoundError(errno.ENOENT, "No such file or directory", "ssh"), "install OpenSSH's client"),
        (PermissionError(errno.EACCES, "Permission denied", "/bin"), "Permission denied"),
        (OSError("no more processes"), "no more processes"),
    ],
)
async def test_an_ssh_that_cannot_be_started_is_told_with_the_reason(here: Machine, error: OSError, told: str) -> None:
    before, here.plays = descriptors(), [error]
    with pytest.raises(Unreachable) as caught:
        await open_ssh(LOGIN)
    assert str(caught.value) == f"ssh://me@pc:22/dev/ttyUSB0: the program ssh cannot be started; {told}"
    assert descriptors() == before


# Which program is started there


def asked(here: Machine) -> list[str]:
    """Which programs the far shells were told to try."""
    commands = [program.command[-1] for program in here.started]
    return [
        " ".join(word for word in ("multidrop relay --baud 19200", "b19200") if word in command) for command in commands
    ]


BOTH = "multidrop relay --baud 19200 b19200"


@for_each(
    "way, plays, told, tried",
    [
        ("", [127, 127], "neither multidrop nor socat is installed on pc; install multidrop", [BOTH, "b19200"]),
        ("", [127, 3], "the far side ended with status 3", [BOTH, "b19200"]),
        ("socat", [127], "socat is not installed on pc; install socat there", ["b19200"]),
        ("multidrop", [127], "multidrop is not installed on pc", ["multidrop relay --baud 19200"]),
        ("", [255], "not reached: ssh ended without a word", [BOTH]),
    ],
)
async def test_where_the_command_is_refused_as_a_whole_socat_alone_is_tried_once(
    here: Machine, way: str, plays: list[int], told: str, tried: list[str]
) -> None:
    here.started.clear()
    here.plays = [Play(status=status) for status in plays]
    with pytest.raises(Unreachable) as caught:
        await open_ssh(FAR, 19200, way=way)
    assert str(caught.value).startswith(f"ssh://pc/dev/ttyUSB0: {told}")
    assert (asked(here), here.plays) == (tried, [])
    assert isinstance(caught.value, NotInstalled) == (plays[-1] == 127)
    for program in here.started:
        program.forget()


async def test_a_server_that_allows_socat_only_is_used(here: Machine) -> None:
    here.plays = [Play(status=127), Play(SOCAT)]
    transport = await open_ssh(FAR, 19200, within=60.0)
    assert asked(here) == [BOTH, "b19200"]
    assert transport.limits.startswith("on pc socat passes the bytes on instead of multidrop: a stop waits there")
    await transport.close()


async def test_without_a_rate_a_port_is_asked_for_at_9600(here: Machine) -> None:
    here.plays = [Play(RELAY + BEAT)]
    transport = await open_ssh(FAR)
    assert "--baud 9600 -- /dev/ttyUSB0" in here.started[0].command[-1]
    assert transport.control is not None and transport.control.baud == 9600
    await transport.close()


# The first lines of the far side


class Pieces(SocketStream):
    """A session whose output comes in these pieces, and then ends with status 1."""

    def __init__(self, pieces: list[bytes]) -> None:
        ours, self.theirs = socket.socketpair()
        super().__init__("ssh://pc/dev/ttyUSB0", ours)
        self._pieces = iter(pieces)

    async def read_some(self) -> bytes:
        return next(self._pieces, b"")

    def status(self, within: float) -> int | None:
        return 1

    def mark(self) -> None:
        """Nothing is printed."""

    def close(self, lost: bool) -> None:
        super().close(lost)
        self.theirs.close()


async def first(pieces: list[bytes]) -> bytes:
    """The first bytes of the port, where a far side says these pieces."""
    session = Pieces(pieces)
    try:
        transport = await greeted(session, FAR, 19200, "")  # type: ignore[arg-type]
    except Unreachable:
        session.close(True)
        raise
    ear = Ear(transport)
    await asyncio.sleep(0)
    await asyncio.sleep(0)
    assert transport.control is not None and transport.control.baud == 19200
    await transport.close()
    return bytes(ear.data)


@pytest.mark.virtual
@for_each(
    "pieces",
    [
        [RELAY + BEAT + frame(Kind.DATA, b"5\n12\n00")],
        [RELAY + frame(Kind.DATA, b"5\n12"), BEAT + frame(Kind.DATA, b"\n00")],
        [RELAY, frame(Kind.DATA, b"5\n12\n00"), BEAT],
        [RELAY[:-3], RELAY[-3:] + frame(Kind.DATA, b"5\n12\n00"), BEAT[:2], BEAT[2:]],
        [
            b"Welcome!\r\n\nmultidrop ",
            b"is here\n",
            b"\xff\n" + RELAY[:-1] + b"\r\n",
            BEAT,
            frame(Kind.DATA, b"never read"),
        ],
        [RELAY + frame(Kind.DATA, b"5\n12\n00")],
        [b"x" * 65534 + b"\n", RELAY + BEAT + frame(Kind.DATA, b"5\n12\n00")],
    ],
)
async def test_what_comes_with_and_after_the_greeting_is_from_the_port_in_any_grouping(pieces: list[bytes]) -> None:
    assert await first(pieces) == (b"" if b"never" in pieces[-1] else b"5\n12\n00")


@pytest.mark.virtual
@for_each(
    "pieces, told",
    [
        ([b"Go away\n", b"\n", b"\n"], "Go away"),
        ([b"x" * 65535 + b"\n", RELAY], "x" * 100),
        ([b"yes\n" * 1000] * 1000, "yes"),
        ([b"no end of a line"], "the far side ended with status 1; try: "),
        ([b"multidrop-relay 1 \nmultidrop-relay"], ""),
        ([b"multidrop-relay 7\n", RELAY], "multidrop there speaks 'multidrop-relay 7'"),
        ([b"multidrop-relays\n"], "multidrop-relays"),
        ([b"a\n", b"b\n", b"c\n \nd"], "c"),
    ],
)
async def test_a_far_side_that_says_other_things_is_refused_with_the_last_of_them(
    pieces: list[bytes], told: str
) -> None:
    if not told:
        assert await first(pieces) == b""
        return
    with pytest.raises(Unreachable) as caught:
        await first(pieces)
    assert str(caught.value).startswith(f"ssh://pc/dev/ttyUSB0: {told}")


@pytest.mark.virtual
async def test_a_loud_far_side_is_not_read_without_an_end() -> None:
    taken = []
    loud = (taken.append(1) or b"yes\n" * 250 for _ in range(200))
    with pytest.raises(Unreachable):
        await first(loud)  # type: ignore[arg-type]
    assert len(taken) == 66, "65536 bytes"


# An open port


async def test_through_a_relay_bytes_pass_both_ways_and_the_round_trip_is_measured(here: Machine) -> None:
    before, far = descriptors(), FarRelay(here, takes=0.25)
    here.plays = [Play(RELAY + frame(Kind.DATA, b"early "), "Welcome to pc\n", reply=far.reply)]
    transport = await open_ssh(FAR, 19200)
    (program,) = here.started
    assert (transport.name, transport.limits, transport.round_trip) == ("ssh://pc/dev/ttyUSB0", "", 0.25)
    assert transport.control is not None and transport.control.baud == 19200
    ear = Ear(transport)
    assert transport.write(b"PR P\r\n")
    await until(lambda: far.sent == b"PR P\r\n")
    program.say(frame(Kind.DATA, b"51200\r\n"))
    await until(lambda: ear.data == b"early 51200\r\n")
    await transport.close()
    assert (program.poll(), program.signals, ear.losses) == (0, [], [])
    program.forget()
    assert descriptors() == before


@for_each("said", [RELAY + b"garbage", RELAY])
async def test_a_far_side_that_goes_wrong_after_its_greeting_is_a_loss_of_an_open_port(
    here: Machine, said: bytes
) -> None:
    here.plays = [Play(said, f"Welcome to pc\n{BROKEN}\n", None if b"garbage" in said else 255)]
    transport = await open_ssh(FAR)
    ear = Ear(transport)
    await until(lambda: ear.losses)
    told = "the other end sends what is not of a relay" if b"garbage" in said else "; check the network and the other"
    assert told in str(ear.losses[0])
    assert BROKEN not in str(ear.losses[0]), "what was printed before the greeting is not the reason"
    await transport.close()


async def test_the_loss_of_an_open_port_quotes_what_ssh_has_said_since(here: Machine) -> None:
    for said in (RELAY + BEAT, SOCAT):
        for words, told in ((f"{BROKEN}\n", BROKEN), ("", "the connection has ended; check the network and the other")):
            here.plays = [Play(said, "Welcome to pc\n", deaf=True)]
            transport = await open_ssh(FAR)
            ear, program = Ear(transport), here.started[-1]
            program.print(words)
            program.end(255)
            await until(lambda ear=ear: ear.losses)
            assert str(ear.losses[0]).startswith(f"ssh://pc/dev/ttyUSB0 was lost: {told}")
            await transport.close()


@for_each("said", [RELAY + BEAT, SOCAT])
async def test_a_lost_ssh_is_ended_at_once_and_one_that_still_works_gets_time_for_its_last_bytes(
    here: Machine, said: bytes
) -> None:
    for lost, took in ((True, 0.05), (False, 2.5)):
        here.plays = [Play(said, deaf=True)]
        transport = await open_ssh(FAR)
        ear, began = Ear(transport), here.clock.now
        if lost:
            here.started[-1].close_output()
            await until(lambda ear=ear: ear.losses)
        await transport.close()
        assert here.clock.now - began == pytest.approx(took)
        assert here.started[-1].signals == [signal.SIGTERM]


async def test_through_socat_the_bytes_pass_as_they_are_and_its_failure_is_waited_for(here: Machine) -> None:
    before, everything = descriptors(), bytes(range(256)) * 3
    here.plays = [Play(SOCAT, reply=lambda data: data, last=b"rest")]
    began = here.clock.now
    transport = await open_ssh(FAR)
    assert here.clock.now - began == pytest.approx(0.3)
    ear, (program,) = Ear(transport), here.started
    assert (transport.name, transport.control, transport.round_trip) == ("ssh://pc/dev/ttyUSB0", None, None)
    assert transport.write(everything)
    await until(lambda: ear.data == everything)
    assert (program.heard, transport.discard()) == (everything, 0)
    await transport.close()
    assert (program.poll(), program.signals, ear.losses) == (0, [], [])
    program.forget()
    assert descriptors() == before


async def test_a_stop_through_socat_drops_only_what_has_not_left(here: Machine) -> None:
    gate = threading.Event()
    here.plays = [Play(SOCAT, reply=lambda data: b"" if gate.wait() else b"")]
    transport = await open_ssh(FAR)
    Ear(transport)
    transport.write(b"MR 51200\r" * 100_000)
    dropped = transport.discard()
    assert 0 < dropped < 900_000
    transport.write(b"\x1b")
    gate.set()
    await until(lambda: here.started[0].heard.endswith(b"\x1b"))
    assert len(here.started[0].heard) == 900_000 - dropped + 1
    await transport.close()


# Time and the end


@pytest.mark.virtual
@for_each(
    "within, words, told",
    [
        (None, "", "not reached within 20 s: no reply; try `ssh -p 22 me@pc`"),
        (None, "Enter the key:\n", "not reached within 20 s: Enter the key:; try `ssh -p 22 me@pc`"),
        (0.5, "", "not reached within 0.5 s: no reply; try `ssh -p 22 me@pc`"),
    ],
)
async def test_a_far_side_without_a_greeting_is_given_up_in_time_and_ended(
    here: Machine, within: float | None, words: str, told: str
) -> None:
    loop = asyncio.get_running_loop()
    began, clock, before = loop.time(), here.clock.now, descriptors()
    here.plays = [Play(words=words, deaf=True)]
    with pytest.raises(Unreachable) as caught:
        await open_ssh(LOGIN, within=within)
    assert str(caught.value) == f"ssh://me@pc:22/dev/ttyUSB0: {told}"
    program = here.started[-1]
    assert (loop.time() - began, program.signals) == (pytest.approx(within or 20.0), [signal.SIGTERM])
    assert here.clock.now - clock < 0.1, "a person waits for it"
    program.forget()
    assert descriptors() == before


@pytest.mark.virtual
async def test_the_second_program_has_as_much_time_as_the_first(here: Machine) -> None:
    loop = asyncio.get_running_loop()
    for within in (None, 0.5):
        began, here.plays = loop.time(), [Play(status=127), Play(deaf=True)]
        with pytest.raises(Unreachable, match=f"not reached within {within or 20:g} s"):
            await open_ssh(FAR, within=within)
        assert loop.time() - began == pytest.approx(within or 20.0)


async def test_a_login_that_is_cancelled_leaves_no_program(here: Machine) -> None:
    clock, before, gate = here.clock.now, descriptors(), threading.Event()
    for play in (Play(deaf=True), Play(gate=gate, deaf=True)):
        here.plays = [play]
        opening = asyncio.create_task(open_ssh(FAR))
        count = len(here.started)
        await until(lambda play=play, count=count: not here.plays if play.gate else len(here.started) > count)
        await asyncio.sleep(0)
        opening.cancel()
        with pytest.raises(asyncio.CancelledError):
            await opening
        gate.set()
        await until(lambda count=count: len(here.started) > count and here.started[-1].poll() is not None)
        assert here.started[-1].signals == [signal.SIGTERM]
    assert here.clock.now - clock < 0.2
    for program in here.started:
        program.forget()
    await until(lambda: descriptors() == before)


def session(here: Machine, play: Play) -> SshSession:
    here.plays = [play]
    return SshSession(FAR, 9600, "")


@for_each(
    "play, lost, signals, took",
    [
        (Play(last=b"x" * 2_000_000), False, [], 0.0),
        (Play(status=3), False, [], 0.0),
        (Play(status=255), True, [], 0.0),
        (Play(deaf=True), False, [signal.SIGTERM], 2.5),
        (Play(deaf=True), True, [signal.SIGTERM], 0.05),
        (Play(deaf=True, ignores=(signal.SIGTERM,)), False, [signal.SIGTERM, signal.SIGKILL], 2.5 + 1.0),
        (Play(deaf=True, ignores=(signal.SIGTERM,)), True, [signal.SIGTERM, signal.SIGKILL], 0.05 + 1.0),
    ],
)
def test_closing_lets_ssh_end_by_itself_and_ends_one_that_does_not_in_time(
    here: Machine, play: Play, lost: bool, signals: list[int], took: float
) -> None:
    began, before = here.clock.now, descriptors()
    closing = session(here, play)
    program = here.started[-1]
    closing.close(lost)
    assert (program.signals, here.clock.now - began) == (signals, pytest.approx(took))
    assert program.poll() is not None
    program.forget()
    assert descriptors() == before


def test_an_ssh_that_says_nothing_and_stays_is_ended_after_its_time(
    here: Machine, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ssh_session, "ENDING_TIMEOUT", 0.01)
    gate = threading.Event()
    closing = session(here, Play(reply=lambda data: b"" if gate.wait() else b""))
    closing.write(b"PR P\r")
    closing.close(False)
    assert here.started[0].signals == [signal.SIGTERM]
    gate.set()


def test_ssh_does_not_inherit_that_this_thread_blocks_sigpipe(here: Machine) -> None:
    for blocked in (signal.SIG_BLOCK, signal.SIG_UNBLOCK):
        before = signal.pthread_sigmask(blocked, {signal.SIGPIPE})
        try:
            session(here, Play(status=0)).close(True)
            mask = signal.pthread_sigmask(signal.SIG_BLOCK, [])
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
        assert signal.SIGPIPE not in here.started[-1].mask
        assert (signal.SIGPIPE in mask) == (blocked == signal.SIG_BLOCK), "it is as it was before"


def test_the_last_words_are_the_last_line_since_the_last_mark(here: Machine) -> None:
    open_session = session(here, Play())
    (program,) = here.started
    assert open_session.last_words() == ""
    for printed, told in [
        ("Warning: added pc\r\n", "Warning: added pc"),
        ("client_loop: sent\nmultidrop: the port is gone.\n\n", "the port is gone"),
        ("2026/11/29 12:00:00 socat[7] W exiting..\n", "exiting"),
        (f"{'long ' * 1000}\nshort\n", "short"),
        (f"{'word  ' * 200}\n", "word " * 80),
    ]:
        program.print(printed)
        assert open_session.last_words() == told
    open_session.mark()
    assert open_session.last_words() == ""
    program.print("Connection to pc closed.\n")
    assert open_session.last_words() == "Connection to pc closed"
    program.end(0)
    open_session.close(True)


async def test_bytes_that_ssh_has_not_taken_are_known(here: Machine) -> None:
    gate = threading.Event()
    open_session = session(here, Play(reply=lambda data: b"" if gate.wait() else b""))
    assert open_session.unsent() == 0
    open_session.write(b"1")
    await until(lambda: here.started[0].heard == b"1")
    open_session.write(b"MR 51200\r" * 100)
    assert open_session.unsent() >= 900
    gate.set()
    await until(lambda: open_session.unsent() == 0)
    open_session.close(False)
    assert partial(open_session.status, 0.1)() == 0
