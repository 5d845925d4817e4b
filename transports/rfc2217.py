"""Serial ports of a device server, over the network (RFC 2217): a pipe in a TCP pipe.

Opening asks for the settings that a line needs: baud rate, 8N1. A server must confirm each of them. It also asks for
what is only a wish: no flow control, DTR, RTS, empty buffers. A server that ignores a wish is used all the same.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterable

from multidrop.base.errors import TransportLost
from multidrop.transports import Lost, PortControl, Received, Transport, Unreachable, telnet
from multidrop.transports.sockets import open_tcp
from multidrop.transports.telnet import Control, Setting

CONFIRM = 3.0
"""Seconds that a server has to confirm a setting."""
GRACE = 0.3
"""Seconds that a server has to confirm wishes, once it has confirmed what is needed."""
PIECE = 256
"""The bytes of a write that leave whole. A longer one counts as several; no message of a drive is."""
QUOTED = 80
"""Characters of what a server says as it refuses a client."""
_HELLO = b"".join(
    telnet.option(verb, number)
    for verb, number in (
        (telnet.WILL, telnet.OPTION),
        (telnet.WILL, telnet.BINARY),
        (telnet.DO, telnet.BINARY),
        (telnet.WILL, telnet.SGA),
        (telnet.DO, telnet.SGA),
    )
)
_OFFERED = (telnet.BINARY, telnet.SGA)
_LINES = {
    "DTR": (Control.DTR_ON, Control.DTR_OFF),
    "RTS": (Control.RTS_ON, Control.RTS_OFF),
    telnet.BREAK: (Control.BREAK_ON, Control.BREAK_OFF),
}
_WISHES = {
    telnet.FLOW: (Setting.CONTROL, Control.NO_FLOW),
    "DTR": (Setting.CONTROL, Control.DTR_ON),
    "RTS": (Setting.CONTROL, Control.RTS_ON),
    "a purge": (Setting.PURGE, telnet.PURGE_BOTH),
}


async def open_rfc2217(host: str, port: int, baud: int = 9600, within: float | None = None) -> Rfc2217Pipe:
    """Open the port that `host:port` serves, at `baud` bits/s, 8N1. Raises Unreachable.

    `within`: time to connect, s.
    """
    inner = await open_tcp(host, port, "rfc2217", within)
    return await negotiated(inner, baud)


async def negotiated(inner: Transport, baud: int) -> Rfc2217Pipe:
    """Agree with the server at the other end of a pipe, or close it. Raises Unreachable."""
    pipe = Rfc2217Pipe(inner)
    try:
        await pipe.agree(baud)
    except BaseException:
        await pipe.close()
        raise
    return pipe


class Rfc2217Pipe(Transport):
    """One port of a device server."""

    may_invalidate = True
    preemptible = True

    def __init__(self, inner: Transport) -> None:
        self._inner, self.name = inner, inner.name
        self._loop = asyncio.get_running_loop()
        self._decoder = telnet.Decoder()
        self._received: Received | None = None
        self._lost: Lost | None = None
        self._loss: TransportLost | None = None
        self._early = bytearray()
        self._delivers = False
        self._farewell = ""
        """The signature that the server sent last: a server that refuses a client gives its reason there."""
        self._agreed = asyncio.Event()
        """The server supports RFC 2217, or the pipe is lost."""
        self._asked: dict[str, tuple[int, asyncio.Future[int]]] = {}
        """The settings to be confirmed, each with the value asked for."""
        self.control: Rfc2217Control = Rfc2217Control(self, self._loop)
        self.limits = ""
        """The wishes that the server did not confirm, for a person."""

    # Opening

    async def agree(self, baud: int) -> None:
        """Agree on RFC 2217 and on the settings. Raises Unreachable."""
        self._inner.start(self._take, self._break)
        self._inner.write(_HELLO)
        try:
            async with asyncio.timeout(CONFIRM):
                await self._agreed.wait()
        except TimeoutError:
            raise self._refused(
                "the server does not support RFC 2217; if it passes bytes on unchanged, use tcp://"
            ) from None
        self._check()
        needed = {
            telnet.NAMES[setting]: (int(setting), value)
            for setting, value in {Setting.BAUD: baud, **telnet.NEEDED}.items()
        }
        answers = {what: self._ask(what, *setting) for what, setting in (needed | _WISHES).items()}
        await self._settled(answers[what] for what in needed)
        wrong = [what for what, (_, value) in needed.items() if _answer(answers[what]) != value]
        if wrong:
            rate = telnet.NAMES[Setting.BAUD]
            kept = f" (it has {rate_taken})" if rate in wrong and (rate_taken := _answer(answers[rate])) else ""
            named = ", ".join(f"{refusal} {baud}{kept}" if refusal == rate else refusal for refusal in wrong)
            raise self._refused(f"the server does not accept {named}; check the settings of its port")
        self.control.baud = baud
        await self._settled((answers[what] for what in _WISHES), GRACE)
        if ignored := [what for what in _WISHES if _answer(answers[what]) is None]:
            self.limits = f"the server does not confirm {', '.join(ignored)}; a party line does not need it"
        self._asked.clear()

    async def _settled(self, answers: Iterable[asyncio.Future[int]], within: float = CONFIRM) -> None:
        """Wait until all are confirmed, or for this time. Raises Unreachable where the server closes the pipe."""
        await asyncio.wait([*answers], timeout=within)
        self._check()

    def _check(self) -> None:
        if self._loss is not None:
            reason = str(self._loss).removeprefix(f"{self.name} was lost: ")
            raise self._refused("try again once it is free" if self._early else reason)

    def _refused(self, reason: str) -> Unreachable:
        said = self._early.decode("latin-1").strip()[:QUOTED]
        return Unreachable(f"{self.name}: the server said {said!r}; {reason}" if said else f"{self.name}: {reason}")

    def _ask(self, what: str, setting: int, value: int) -> asyncio.Future[int]:
        """Ask for a setting; the future has the value that the server confirms."""
        answer: asyncio.Future[int] = self._loop.create_future()
        self._asked[what] = value, answer
        self._inner.write(telnet.message(setting, value))
        return answer

    async def ask(self, what: str, setting: int, value: int) -> int:
        """Ask for a setting, and return the value that the server confirms. Raises OSError if it confirms none."""
        if self._loss is not None:
            raise OSError(str(self._loss))
        answer = self._ask(what, setting, value)
        await asyncio.wait([answer], timeout=CONFIRM)
        if (accepted := _answer(answer)) is None:
            raise OSError(f"the server does not confirm {what}")
        return accepted

    # Receiving

    def _take(self, data: bytes) -> None:
        for event in self._decoder.receive(data):
            if isinstance(event, telnet.Data):
                self._farewell = ""
                if self._delivers and self._received is not None:
                    self._received(event.data)
                else:
                    self._early += event.data
            elif isinstance(event, telnet.Option):
                # Take an option. What was offered above needs no reply, anything else that the server wants is
                # refused.
                if event.option == telnet.OPTION and event.verb in (telnet.DO, telnet.WILL):
                    self._agreed.set()
                elif event.verb in telnet.REFUSAL and event.option not in _OFFERED:
                    self._inner.write(telnet.option(telnet.REFUSAL[event.verb], event.option))
            elif isinstance(event, telnet.Subnegotiation) and (setting := telnet.parsed(event.body)):
                self._confirmed(*setting)

    def _confirmed(self, number: int, value: bytes) -> None:
        setting = number - telnet.REPLY
        if setting == Setting.SIGNATURE:
            self._farewell = value.decode("utf-8", "replace")
            return
        confirmed = int.from_bytes(value)
        what = telnet.group_of(confirmed) if setting == Setting.CONTROL else _NAMED.get(setting, "")
        if what in self._asked and not self._asked[what][1].done():
            self._asked[what][1].set_result(confirmed)

    def _break(self, error: TransportLost) -> None:
        self._loss = TransportLost(f"{self.name} was lost: {self._farewell}") if self._farewell else error
        self._agreed.set()
        for _, answer in self._asked.values():
            answer.cancel()
        if self._delivers and self._lost is not None:
            self._lost(self._loss)

    # The pipe

    def start(self, received: Received, lost: Lost) -> None:
        self._received, self._lost = received, lost
        self._loop.call_soon(self._begin)

    def _begin(self) -> None:
        self._delivers = True
        early, self._early = bytes(self._early), bytearray()
        if early and self._received is not None:
            self._received(early)
        if self._loss is not None and self._lost is not None:
            self._lost(self._loss)

    def write(self, data: bytes) -> bool:
        """Queue bytes in pieces; False where they were dropped."""
        pieces = [data[at : at + PIECE] for at in range(0, len(data), PIECE)]
        return all([self._inner.write(telnet.escaped(piece)) for piece in pieces])

    @property
    def pending(self) -> int:
        return self._inner.pending

    def discard(self, whole: bool = False) -> int:
        """Drop unsent bytes, and unless `whole` ask the server to purge its own. No message is cut in two."""
        dropped = self._inner.discard(whole=True)
        if not whole:
            self._inner.write(_PURGE)
        return dropped

    def preempt(self, whole: bool, make: Callable[[int], bytes]) -> bool:
        purge = b"" if whole else _PURGE
        return self._inner.preempt(True, lambda dropped: purge + telnet.escaped(make(dropped)))

    def follow(self, make: Callable[[int], bytes | None], key: bool = False) -> bool:
        def escaped(waiting: int) -> bytes | None:
            data = make(waiting)
            return data and telnet.escaped(data)

        return self._inner.follow(escaped, key)

    def yielded(self, note: Callable[[bool], None] = lambda last: None) -> bool:
        return self._inner.yielded(note)

    async def close(self) -> None:
        self._lost = self._received = None
        await self._inner.close()


_PURGE = telnet.message(Setting.PURGE, telnet.PURGE_UNSENT)
_NAMED = {int(setting): name for setting, name in telnet.NAMES.items()} | {int(Setting.PURGE): "a purge"}


def _answer(answer: asyncio.Future[int]) -> int | None:
    """The value that a server confirmed; None: it confirmed none."""
    return answer.result() if answer.done() and not answer.cancelled() else None


class Rfc2217Control(PortControl):
    """The settings of the port at the server. Each call waits for its confirmation, in a thread that is not the loop's.

    Each raises OSError where the server refuses the value or does not reply.
    """

    def __init__(self, pipe: Rfc2217Pipe, loop: asyncio.AbstractEventLoop) -> None:
        self._pipe, self._loop = pipe, loop
        self.baud = 0

    def set_baud(self, baud: int) -> None:
        taken = self._ask(telnet.NAMES[Setting.BAUD], Setting.BAUD, baud)
        if taken != baud:
            raise OSError(f"the server does not accept {baud} baud (it has {taken})")
        self.baud = baud

    def _switch(self, line: str, on: bool) -> None:
        self._ask(line, Setting.CONTROL, _LINES[line][not on])

    def _ask(self, what: str, setting: int, value: int) -> int:
        return asyncio.run_coroutine_threadsafe(self._pipe.ask(what, setting, value), self._loop).result()
