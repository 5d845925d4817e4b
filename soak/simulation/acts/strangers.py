"""A Modbus device that is no Lexium drive, and a person at it: only what they type may reach it.

The person has a session of their own, which no fault of the others touches: the line is none of the machine's, so the
rules about its drives do not hold there. Automation works at it, with and without a yes, and ends early; a screen asks
for values; the connection is cut behind a write; the stop key is pressed.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Awaitable, Callable
from contextvars import copy_context
from random import Random

from multidrop.families.lexium.host.modbus.framing import READ_REGISTERS, WRITE_REGISTERS
from multidrop.families.lexium.manual.modbus.registers import REGISTERS
from multidrop.shell.channel import Front
from multidrop.shell.configuration import Settings
from multidrop.shell.events import FAILURES, By
from multidrop.shell.origin import Origin
from multidrop.shell.session import Session
from soak.simulation.acts.act import Act
from soak.simulation.records.told import Strange
from soak.simulation.system.kernel import WHO
from soak.simulation.world import World

HOST = "stranger.plant"
PORT = 502
IDENTIFY, END = 0x2B, 0x41
ILLEGAL_FUNCTION = 1
LINES = {
    "MA {}": (WRITE_REGISTERS, "MA"),
    "SL {}": (WRITE_REGISTERS, "SL"),
    "VM={}": (WRITE_REGISTERS, "VM"),
    "PR P": (READ_REGISTERS, "P"),
    "PR R1": (READ_REGISTERS, "R1"),
}
"""The lines that are typed, each with the one message that it is."""
IN_FLIGHT = 0.002
"""The time, s, in which a message and its reply are on their way."""
PAUSE = 2.0
"""The longest time between two deeds, s."""
LONGEST = 40.0
"""The time, s, in which all of it is over."""


class Plc(asyncio.Protocol):
    """A server that does not identify itself. Every register reads as 7; it takes every write."""

    def __init__(self, world: World, strange: Strange) -> None:
        self._world, self._strange = world, strange
        self._buffer = b""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Begin."""
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport

    def data_received(self, data: bytes) -> None:
        """Take whole messages, and reply to each."""
        self._buffer += data
        while len(self._buffer) > 7 and len(self._buffer) >= (size := 6 + int.from_bytes(self._buffer[4:6])):
            message, self._buffer = self._buffer[:size], self._buffer[size:]
            if message[7] != IDENTIFY:
                self._strange.heard.append((self._world.loop.now, _message(message[7], message[8:10])))
            answer = _answer(message[7:])
            self._transport.write(message[:4] + (len(answer) + 1).to_bytes(2) + message[6:7] + answer)


def _message(function: int, register: bytes) -> str:
    return f"{function:02x} {register.hex()}"


def _answer(pdu: bytes) -> bytes:
    if pdu[0] == READ_REGISTERS:
        count = int.from_bytes(pdu[3:5])
        return bytes((pdu[0], 2 * count)) + b"\0\7" * count
    return pdu[:5] if pdu[0] == WRITE_REGISTERS else bytes((pdu[0] | 0x80, ILLEGAL_FUNCTION))


class Visit:
    """One person at the device."""

    def __init__(self, world: World, rng: Random, strange: Strange) -> None:
        self._world, self._rng, self._strange = world, rng, strange
        folder = world.folder / f"visitor{world.step}"
        self.session = Session(Settings({}, folder / "config", folder / "state", data=folder / "data"), reconnect=True)
        self.session.front = Front(ask=self._ask)
        self._folder = folder

    async def _ask(self, question: str) -> bool:
        return self._rng.random() < 0.5

    def _line(self, may_write: bool = True) -> str:
        """A line, which may be sent once; one that writes perhaps never."""
        form = self._rng.choice(list(LINES))
        function, word = LINES[form]
        if may_write or function == READ_REGISTERS:
            self._strange.typed.append(_message(function, REGISTERS[word].address.to_bytes(2)))
        return form.format(self._rng.randrange(1000, 9000))

    async def type(self) -> None:
        """Type a line; the connection may be cut behind it."""
        if self._rng.random() < 0.3:
            self._world.loop.call_later(self._rng.random() * IN_FLIGHT, self._world.network.cut, HOST)
        await self.session.run(self._line())

    async def automate(self) -> None:
        """Let lines be sent by themselves, agreed to or not, and end that early."""
        self.session.questions.agreed = agreed = self._rng.random() < 0.7
        try:
            async with self.session.automations.run(Origin(By.SCRIPT), "script x") as origin:
                for _ in range(self._rng.randrange(1, 3)):
                    line = self._line(agreed)
                    await self.session.run(line, origin)
                if self._rng.random() < 0.3:
                    self.session.interrupt()
                await self.session.run("/fail of the script", origin)
        finally:
            self.session.questions.agreed = False

    async def look(self) -> None:
        """Show the device on a screen, which polls."""
        for bus in self.session.buses.values():
            polls = [bus.telemetry.subscribe([""], 0.05), bus.telemetry.watch([""], 0.1)]
            await asyncio.sleep(self._rng.random() * PAUSE)
            for each in polls:
                each.close()

    async def stop(self) -> None:
        """Press the stop key."""
        self._strange.stops.append(self._world.loop.now)
        self.session.stop("Ctrl+X")
        await asyncio.sleep(self._rng.random())
        await self.session.run("/resume")

    async def go(self) -> None:
        """Open the device, do some of it, and leave."""
        deeds: list[Callable[[], Awaitable[None]]] = [
            self.type,
            self.type,
            self.automate,
            self.automate,
            self.look,
            self.stop,
        ]
        try:
            for deed in [self._open, *(self._rng.choice(deeds) for _ in range(self._rng.randrange(3, 8)))]:
                with contextlib.suppress(*FAILURES):
                    await deed()
                await asyncio.sleep(self._rng.random() ** 2 * PAUSE)
        finally:
            await self.session.close()

    async def _open(self) -> None:
        await self.session.open(f"modbus://{HOST}:{PORT}?timeout=0.4", "plc")


def stranger(world: World, rng: Random) -> float:
    """Let a person open a device that is no drive."""
    strange = Strange()
    world.history.told.strangers.append(strange)
    server = world.network.listen(lambda: Plc(world, strange), HOST, PORT)
    world.stack.callback(server.close)
    context = copy_context()
    context.run(WHO.set, "far")
    world.visits.append(context.run(lambda: world.loop.create_task(Visit(world, rng, strange).go())))
    return LONGEST


STRANGER = Act("a device that is no drive", 1, stranger)
