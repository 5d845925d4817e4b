"""What the client of RFC 2217 sends, waits for and passes on, and what it tells of a server that does not."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

import pytest

from multidrop.base.errors import TransportLost
from multidrop.transports import Unreachable, rfc2217, telnet
from multidrop.transports.rfc2217 import Rfc2217Pipe, negotiated, open_rfc2217
from multidrop.transports.telnet import OPTION, REPLY, Control, Setting, message
from tests.support.cases import for_each
from tests.support.server_2217 import Server

PURGE = message(Setting.PURGE, 2)
NAME = Server.name


class Ear:
    """What one pipe has delivered."""

    def __init__(self, pipe: Rfc2217Pipe) -> None:
        self.data, self.losses = bytearray(), list[TransportLost]()
        pipe.start(self.data.extend, self.losses.append)


def now() -> float:
    return asyncio.get_running_loop().time()


# Opening


@pytest.mark.virtual
async def test_the_first_bytes_offer_the_options_that_a_line_needs() -> None:
    server = Server()
    await negotiated(server, 9600)
    assert server.pieces[0] == b"\xff\xfb\x2c\xff\xfb\x00\xff\xfd\x00\xff\xfb\x03\xff\xfd\x03"
    asked = {(1, 9600), (2, 8), (3, 1), (4, 1), (5, 1), (5, 8), (5, 11), (12, 3)}
    assert set(server.asked) == asked and len(server.asked) == len(asked)


@pytest.mark.virtual
@for_each(
    "given, passed",
    [((), (9600, None)), ((19200,), (19200, None)), ((19200, 0.5), (19200, 0.5))],
)
async def test_it_is_opened_over_tcp_at_9600_unless_another_rate_is_given(
    given: tuple[Any, ...], passed: tuple[int, float | None], monkeypatch: pytest.MonkeyPatch
) -> None:
    server, asked = Server(), list[tuple[object, ...]]()

    async def connect(*given: object) -> Server:
        asked.append(given)
        return server

    monkeypatch.setattr(rfc2217, "open_tcp", connect)
    pipe = await open_rfc2217("gateway", 2217, *given)
    assert asked == [("gateway", 2217, "rfc2217", passed[1])]
    assert (pipe.name, pipe.control.baud, server.asked[0]) == (NAME, passed[0], (Setting.BAUD, passed[0]))
    assert pipe.may_invalidate and pipe.preemptible, "a stop goes ahead of the loop"


@pytest.mark.virtual
@for_each(
    "server, took, told",
    [
        (
            lambda: Server(option=b""),
            3.0,
            "the server does not support RFC 2217; if it passes bytes on unchanged, use tcp://",
        ),
        (
            lambda: Server(option=telnet.option(telnet.WONT, OPTION) + telnet.option(telnet.DO, 1)),
            3.0,
            "the server does not support RFC 2217; if it passes bytes on unchanged, use tcp://",
        ),
        (
            lambda: Server(option=b"  login: \r\n"),
            3.0,
            "the server said 'login:'; the server does not support RFC 2217; if it passes bytes on unchanged, use tcp://",
        ),
        (
            lambda: Server(option=b"x" * 100),
            3.0,
            f"the server said '{'x' * 80}'; the server does not support RFC 2217; if it passes bytes on unchanged, use "
            "tcp://",
        ),
        (
            lambda: Server((Setting.BAUD, Setting.PARITY)),
            3.0,
            "the server does not accept the baud rate 9600, no parity; check the settings of its port",
        ),
        (
            lambda: Server(keeps={Setting.BAUD: 0}),
            0.0,
            "the server does not accept the baud rate 9600; check the settings of its port",
        ),
        (
            lambda: Server(keeps={Setting.STOP_SIZE: 2, Setting.BAUD: 300}),
            0.0,
            "the server does not accept the baud rate 9600 (it has 300), 1 stop bit; check the settings of its port",
        ),
    ],
)
async def test_a_server_that_does_not_do_what_is_needed_is_refused_after_three_seconds(
    server: Callable[[], Server], took: float, told: str
) -> None:
    refusing, began = server(), now()
    with pytest.raises(Unreachable) as caught:
        await negotiated(refusing, 9600)
    assert str(caught.value) == f"{NAME}: {told}"
    assert (now() - began, refusing.closed) == (pytest.approx(took), True)


@pytest.mark.virtual
async def test_wishes_are_waited_for_only_a_moment_and_those_without_an_answer_are_named_in_order() -> None:
    began = now()
    pipe = await negotiated(Server((Setting.PURGE, (Setting.CONTROL, Control.DTR_ON))), 9600)
    assert now() - began == pytest.approx(0.3)
    assert pipe.limits == "the server does not confirm DTR, a purge; a party line does not need it"


@pytest.mark.virtual
@for_each(
    "said, told",
    [
        (b"", "closed"),
        (b"Port in use\r\n", "the server said 'Port in use'; try again once it is free"),
        (message(Setting.SIGNATURE + REPLY, b"in use by pc:5000"), "in use by pc:5000"),
        (message(Setting.SIGNATURE + REPLY, b"caf\xe9"), "caf\ufffd"),
    ],
)
async def test_a_server_that_hangs_up_while_it_is_opened_is_refused_at_once_with_its_reason(
    said: bytes, told: str
) -> None:
    for option in (b"", telnet.option(telnet.DO, OPTION)):
        server = Server(option=option, late=99)
        opening, began = asyncio.create_task(negotiated(server, 9600)), now()
        await asyncio.sleep(0.1)
        server.send(said)
        server.hang_up()
        with pytest.raises(Unreachable) as caught:
            await opening
        assert str(caught.value) == f"{NAME}: {told}"
        assert now() - began == pytest.approx(0.1) and server.closed


@pytest.mark.virtual
async def test_an_opening_that_is_cancelled_closes_the_pipe_below() -> None:
    server = Server(option=b"")
    opening = asyncio.create_task(negotiated(server, 9600))
    await asyncio.sleep(0.1)
    opening.cancel()
    with pytest.raises(asyncio.CancelledError):
        await opening
    assert server.closed


@pytest.mark.virtual
@for_each(
    "wants, answer",
    [
        ((telnet.WILL, 1), (telnet.DONT, 1)),
        ((telnet.DO, 24), (telnet.WONT, 24)),
        ((telnet.WILL, telnet.BINARY), None),
        ((telnet.DO, telnet.BINARY), None),
        ((telnet.WILL, telnet.SGA), None),
        ((telnet.DO, telnet.SGA), None),
        ((telnet.DO, OPTION), None),
        ((telnet.WILL, OPTION), None),
        ((telnet.WONT, 1), None),
        ((telnet.DONT, 24), None),
        ((telnet.WONT, OPTION), None),
    ],
)
async def test_what_the_server_wants_beside_what_was_offered_is_refused(
    wants: tuple[int, int], answer: tuple[int, int] | None
) -> None:
    server = Server()
    await negotiated(server, 9600)
    server.pieces.clear()
    server.send(telnet.option(*wants))
    await asyncio.sleep(1)
    assert server.pieces == ([telnet.option(*answer)] if answer else [])


# An open pipe


@pytest.mark.virtual
async def test_a_write_leaves_in_pieces_of_256_bytes_and_tells_whether_all_were_taken() -> None:
    server = Server()
    pipe = await negotiated(server, 9600)
    server.pieces.clear()
    data = bytes(range(256)) * 2
    assert pipe.write(data[:600]) and pipe.write(b"")
    assert server.pieces == [telnet.escaped(data[:256]), telnet.escaped(data[256:])]
    server.full = True
    assert not pipe.write(b"PR P\r")


@pytest.mark.virtual
async def test_a_stop_of_another_thread_goes_behind_a_purge_unless_bytes_have_to_stay_whole() -> None:
    server = Server()
    pipe = await negotiated(server, 9600)
    server.pieces.clear()
    for whole, ahead in ((False, PURGE), (True, b"")):
        server.unsent = 7
        assert pipe.pending == 7
        assert pipe.preempt(whole, lambda dropped: b"\x1b\xff%d" % dropped)
        assert server.pieces.pop() == ahead + b"\x1b\xff\xff7"
    server.full = True
    assert not pipe.preempt(False, lambda dropped: b"\x1b")


@pytest.mark.virtual
async def test_what_follows_a_stop_is_asked_for_once_and_escaped() -> None:
    server = Server()
    pipe = await negotiated(server, 9600)
    server.unsent = 9
    assert pipe.follow(lambda waiting: b"%d\xff" % waiting)
    assert pipe.follow(lambda waiting: b"", key=True)
    assert not pipe.follow(lambda waiting: None, True)
    assert server.followed == [(False, b"9\xff\xff"), (True, b""), (True, None)]
    noted: list[bool] = []
    assert not pipe.yielded(noted.append) and not pipe.yielded()
    assert noted == [False]


@pytest.mark.virtual
async def test_a_discard_purges_the_server_too_unless_bytes_have_to_stay_whole() -> None:
    server = Server()
    pipe = await negotiated(server, 9600)
    server.pieces.clear()
    server.unsent = 5
    assert (pipe.discard(whole=True), server.pieces) == (5, [])
    server.unsent = 6
    assert (pipe.discard(), server.pieces) == (6, [PURGE])


@pytest.mark.virtual
async def test_bytes_before_the_start_come_first_and_none_after_the_close() -> None:
    server = Server()
    pipe = await negotiated(server, 9600)
    server.send(b"early ")
    await asyncio.sleep(1)
    ear = Ear(pipe)
    server.received(b"late ")
    assert ear.data == b"", "nothing is delivered from within the start"
    await asyncio.sleep(1)
    server.received(b"now")
    assert ear.data == b"early late now"
    await pipe.close()
    server.received(b"never")
    server.lost(TransportLost("closed"))
    await asyncio.sleep(1)
    assert (ear.data, ear.losses, server.closed) == (b"early late now", [], True)


@pytest.mark.virtual
async def test_where_nothing_came_nothing_is_delivered() -> None:
    pipe, heard = await negotiated(Server(), 9600), list[bytes]()
    pipe.start(heard.append, lambda loss: None)
    await asyncio.sleep(1)
    assert heard == []


@pytest.mark.virtual
async def test_a_pipe_that_is_closed_right_behind_its_start_delivers_nothing() -> None:
    server = Server()
    pipe = await negotiated(server, 9600)
    server.send(b"early")
    server.hang_up()
    await asyncio.sleep(1)
    ear = Ear(pipe)
    await pipe.close()
    await asyncio.sleep(1)
    assert (ear.data, ear.losses) == (b"", [])


@pytest.mark.virtual
async def test_a_loss_before_the_start_is_told_once_behind_the_bytes_that_came() -> None:
    server = Server()
    pipe = await negotiated(server, 9600)
    server.send(b"last words")
    server.hang_up()
    await asyncio.sleep(1)
    ear = Ear(pipe)
    assert ear.losses == []
    await asyncio.sleep(1)
    assert (ear.data, list(map(str, ear.losses))) == (b"last words", [f"{NAME} was lost: closed"])


@pytest.mark.virtual
async def test_a_signature_is_no_reason_of_a_loss_where_bytes_have_come_since() -> None:
    server = Server()
    pipe = await negotiated(server, 9600)
    ear = Ear(pipe)
    await asyncio.sleep(1)
    server.send(message(Setting.SIGNATURE + REPLY, b"ser2net") + b"51200\r\n")
    await asyncio.sleep(1)
    assert ear.losses == []
    server.hang_up()
    await asyncio.sleep(1)
    assert (ear.data, list(map(str, ear.losses))) == (b"51200\r\n", [f"{NAME} was lost: closed"])


@pytest.mark.virtual
async def test_confirmations_that_nobody_waits_for_change_nothing() -> None:
    server = Server(late=99)
    opening = asyncio.create_task(negotiated(server, 9600))
    await asyncio.sleep(0.1)
    for setting, value in ((7, 16), (106, 1), (107, 16), (105, 200), (101, 9600), (101, 19200), (102, 8), (102, 7)):
        server.send(message(setting, value))
    server.send(message(Setting.PARITY + REPLY, 1) + message(Setting.STOP_SIZE + REPLY, 1))
    server.send(message(Setting.CONTROL + REPLY, Control.NO_FLOW) + message(Setting.PURGE + REPLY, 3))
    server.send(message(Setting.CONTROL + REPLY, Control.DTR_ON) + message(Setting.CONTROL + REPLY, Control.RTS_ON))
    pipe = await opening
    assert (pipe.control.baud, pipe.limits) == (9600, ""), "the first one counts"
    ear = Ear(pipe)
    server.send(message(101, 300) + b"\xff\xfa\x18\x01\xff\xf0" + b"\xff\xfa\x2c\xff\xf0" + b"\xff\xf4" + b"ok")
    await asyncio.sleep(1)
    assert (ear.data, ear.losses) == (b"ok", [])


@pytest.mark.virtual
async def test_a_question_that_is_not_confirmed_ends_after_three_seconds_or_at_the_loss() -> None:
    server = Server()
    pipe = await negotiated(server, 9600)
    server.ignores = (Setting.CONTROL,)
    began = now()
    with pytest.raises(OSError, match="^the server does not confirm DTR$"):
        await pipe.ask("DTR", Setting.CONTROL, Control.DTR_ON)
    assert now() - began == pytest.approx(3.0)
    asking = asyncio.create_task(pipe.ask("DTR", Setting.CONTROL, Control.DTR_ON))
    await asyncio.sleep(0.1)
    server.hang_up()
    began = now()
    with pytest.raises(OSError, match="^the server does not confirm DTR$"):
        await asking
    assert now() == began
    server.asked.clear()
    with pytest.raises(OSError, match="was lost: closed"):
        await pipe.ask("DTR", Setting.CONTROL, Control.DTR_ON)
    assert server.asked == []


async def test_the_settings_change_from_another_thread_and_a_refusal_leaves_the_rate() -> None:
    server = Server()
    pipe = await negotiated(server, 9600)
    server.asked.clear()
    control = pipe.control
    for change, given in (
        (control.set_dtr, True),
        (control.set_dtr, False),
        (control.set_rts, True),
        (control.set_rts, False),
        (control.set_break, True),
        (control.set_break, False),
    ):
        await asyncio.to_thread(change, given)
    assert server.asked == [(5, value) for value in (8, 9, 11, 12, 5, 6)]
    await asyncio.to_thread(control.set_baud, 19200)
    assert (server.asked[-1], control.baud) == ((1, 19200), 19200)
    server.keeps = {Setting.BAUD: 4800}
    with pytest.raises(OSError, match=r"^the server does not accept 38400 baud \(it has 4800\)$"):
        await asyncio.to_thread(control.set_baud, 38400)
    assert control.baud == 19200
