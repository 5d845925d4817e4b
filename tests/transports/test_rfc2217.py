"""The client of RFC 2217 against a server in memory that confirms some requests and ignores or refuses others."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

import pytest

from multidrop.base.errors import TransportLost
from multidrop.transports import Unreachable, telnet
from multidrop.transports.rfc2217 import Rfc2217Pipe, negotiated
from multidrop.transports.telnet import OPTION, REPLY, Control, Setting, message
from tests.support.server_2217 import Server

pytestmark = pytest.mark.virtual

DTR = (Setting.CONTROL, Control.DTR_ON)
RTS = (Setting.CONTROL, Control.RTS_ON)


async def opened(server: Server) -> Rfc2217Pipe:
    return await negotiated(server, 9600)


async def test_opening_takes_no_longer_than_the_replies() -> None:
    server = Server()
    pipe = await opened(server)
    assert asyncio.get_running_loop().time() == 0.0
    needed = {(Setting.BAUD, 9600), (Setting.DATA_SIZE, 8), (Setting.PARITY, 1), (Setting.STOP_SIZE, 1)}
    assert needed | {DTR, RTS} <= set(server.asked)
    assert pipe.limits == "" and pipe.control.baud == 9600


@pytest.mark.parametrize(
    ("ignores", "named"),
    [((DTR, RTS), "DTR, RTS"), ((DTR,), "DTR"), ((Setting.PURGE,), "a purge"), ((Setting.CONTROL,), "flow control")],
)
async def test_a_wish_without_an_answer_is_said_once_and_the_port_is_open(
    ignores: tuple[tuple[int, int] | int, ...], named: str
) -> None:
    pipe = await opened(Server(ignores))
    remark = pipe.limits
    assert remark.startswith("the server does not confirm") and named in remark


@pytest.mark.parametrize("late", range(1, 9))
async def test_replies_may_come_in_any_order_and_byte_by_byte(late: int) -> None:
    pipe = await opened(Server(late=late))
    assert bool(pipe.limits) == (8 % late > 0)  # the last replies of some never come


@pytest.mark.parametrize(
    ("server", "reason"),
    [
        (lambda: Server(keeps={Setting.BAUD: 19200}), "the baud rate 9600 (it has 19200); "),
        (lambda: Server(keeps={Setting.PARITY: 3}), "no parity; "),
        (lambda: Server((Setting.STOP_SIZE, Setting.DATA_SIZE)), "8 data bits, 1 stop bit; "),
        (lambda: Server((Setting.BAUD,)), "the baud rate 9600; "),
    ],
)
async def test_a_needed_setting_that_is_refused_is_named(server: Callable[[], Server], reason: str) -> None:
    refusing = server()
    with pytest.raises(Unreachable) as caught:
        await opened(refusing)
    assert str(caught.value).startswith(f"{refusing.name}: the server does not accept {reason}")
    assert refusing.closed


async def test_a_server_of_another_kind_is_said_to_be_one() -> None:
    server = Server(option=telnet.option(telnet.DONT, OPTION))
    with pytest.raises(Unreachable, match="does not support RFC 2217; .* use tcp://"):
        await opened(server)


async def test_what_a_server_says_as_it_closes_the_pipe_is_quoted() -> None:
    server = Server(option=telnet.option(telnet.DO, OPTION) + b"Port already in use\r\n")
    server.late = 99
    opening = asyncio.create_task(opened(server))
    await asyncio.sleep(0.1)
    server.hang_up()
    with pytest.raises(Unreachable, match="the server said 'Port already in use'; try again once it is free"):
        await opening


async def test_options_that_were_not_offered_are_refused_once_each_and_ours_need_no_answer() -> None:
    echo = telnet.option(telnet.WILL, 1) + telnet.option(telnet.DO, 24) + telnet.option(telnet.WILL, telnet.BINARY)
    server = Server(option=echo + telnet.option(telnet.WILL, OPTION))
    await opened(server)
    answers = [each for each in server.options if each.verb in (telnet.DONT, telnet.WONT)]
    assert answers == [telnet.Option(telnet.DONT, 1), telnet.Option(telnet.WONT, 24)]


async def test_bytes_go_both_ways_and_those_before_the_start_are_kept() -> None:
    server, got = Server(), bytearray()
    pipe = await opened(server)
    server.send(telnet.escaped(bytes(range(256))))
    await asyncio.sleep(1)
    pipe.start(got.extend, lambda loss: None)
    assert pipe.write(bytes(range(256)) * 3)
    server.send(b"after")
    await asyncio.sleep(1)
    assert got == bytes(range(256)) + b"after"
    assert server.data == bytes(range(256)) * 3


async def test_a_stop_drops_what_is_unsent_here_and_at_the_server() -> None:
    server = Server()
    pipe = await opened(server)
    server.asked.clear()
    server.unsent = 7
    assert pipe.discard() == 7
    assert pipe.discard(whole=True) == 0
    assert server.asked == [(Setting.PURGE, 2)]


async def test_a_setting_that_is_refused_or_not_confirmed_is_an_error() -> None:
    server = Server()
    pipe = await opened(server)
    assert await pipe.ask("the baud rate", Setting.BAUD, 19200) == 19200
    server.ignores = (Setting.CONTROL,)
    with pytest.raises(OSError, match="does not confirm DTR"):
        await pipe.ask("DTR", *DTR)
    server.hang_up()
    await asyncio.sleep(1)
    with pytest.raises(OSError, match="was lost"):
        await pipe.ask("DTR", *DTR)


async def test_a_loss_names_the_reason_that_the_server_gave_last() -> None:
    server, losses = Server(), list[TransportLost]()
    pipe = await opened(server)
    pipe.start(lambda data: None, losses.append)
    await asyncio.sleep(1)
    server.send(message(Setting.SIGNATURE + REPLY, b"refused: pc:5000 writes"))
    server.hang_up()
    await asyncio.sleep(1)
    assert list(map(str, losses)) == [f"{server.name} was lost: refused: pc:5000 writes"]
