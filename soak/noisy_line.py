"""Operators at the drives of one noisy line, through a whole session: the bus, its drives, the wire, the simulator.

Every value is unique. So the judge traces a value that is shown as a drive's to its origin, and counts a command in
the drive that executed it.
"""

from __future__ import annotations

import asyncio
import contextlib
import re
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from contextlib import AsyncExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from random import Random
from typing import Any

from multidrop.base.errors import DriveError, TransportLost
from multidrop.drives.events import Notice
from multidrop.features.sharing.server import SharedPort
from multidrop.features.sharing.stop_bytes import stop_bytes
from multidrop.shell.configuration import Settings
from multidrop.shell.connect.opening import open_port
from multidrop.shell.connect.urls import parse
from multidrop.shell.session import Session
from multidrop.simulator import cells
from multidrop.simulator.cell.spec import Faults
from multidrop.simulator.floor import Floor
from multidrop.simulator.serving.endpoints import serve_bus
from multidrop.simulator.serving.running import RunningFloor
from soak.judge import Judge, Ledger, Witness
from soak.languages import LANGUAGES, PROGRAM, TICKS

BUS = "line"
NUMBER = r"\d{7,8}"
"""A unique value."""
Opener = Callable[[Session], Awaitable[object]]


@dataclass(frozen=True)
class Setup:
    """A line to be judged. `names`: the drives of a shared line; empty: one drive without a name."""

    em: int = 1
    checksum: int = 1
    names: tuple[str, ...] = ("a", "b", "c")
    printing: bool = True
    """A program prints in the last drive."""
    level: float = 0.0
    """The probability of each fault of a byte."""
    hangups: bool = False
    seed: int = 1
    baud: int = 9600
    latest: float = 1.5
    """The longest delay of a late byte, s: longer than the host waits for a reply."""
    language: str = "mcode"

    @property
    def faults(self) -> Faults:
        """The faults of the wire."""
        level = self.level
        every = Faults(flip=level, drop=level, double=level, insert=level, late=level, late_by=(0.01, self.latest))
        after, lasts = (5.0, 1.0) if self.hangups else (None, None)
        return replace(every, delay=(0.0, 0.02), hangup_after=after, hangup_for=lasts)

    @property
    def shown(self) -> str:
        """The setup for a person."""
        if self.language != "mcode":
            return self.language + " hang-ups" * self.hangups
        drives = f"{len(self.names)} drives" if self.names else "one drive"
        more = " printing" * self.printing + " hang-ups" * self.hangups
        return f"EM={self.em} CK={self.checksum} {drives}{more}"

    def cell(self, serve: str = "") -> str:
        """The cell file."""
        served = f"serve = [{serve}]\n" if serve else ""
        language = LANGUAGES[self.language]
        tables = (
            language.drive(name, self.em, self.checksum, bool(self.names)) for name in self.names or (language.alone,)
        )
        head = f'seed = {self.seed}\n[[bus]]\nname = "{BUS}"\nbaud = {self.baud}\n{served}'
        late = f"[bus.faults]\ndelay = [0.0, {self.latest}]\n" if self.language == "modbus" else ""
        return head + "".join(f"[[bus.drive]]\n{table}" for table in tables) + late

    def write(self, folder: Path, serve: str = "") -> Path:
        """Write the cell and its program; return its path."""
        (folder / "tick.mxt").write_text(PROGRAM)
        (folder / "cell.toml").write_text(self.cell(serve))
        return folder / "cell.toml"


class NoisyLine:
    """A session on such a line, and its judge."""

    def __init__(self, setup: Setup, floor: RunningFloor, opener: Opener, folder: Path) -> None:
        self.setup, self.floor = setup, floor
        self.ledger = Ledger()
        self.language = LANGUAGES[setup.language]
        self.rng = Random(f"{setup}")
        self.devices: dict[str, Any] = {placed.spec.name: placed.device for placed in floor.floor.drives}
        asks, refused = self.language.asks, self.language.refused
        self.witnesses = {name: Witness(device, asks, refused) for name, device in self.devices.items()}
        self.judge = Judge(self.ledger, self.witnesses, checked=setup.checksum > 0 and self.language.checked)
        self._opener, self._folder = opener, folder
        self._notices: dict[str, list[str]] = {}
        self._held: dict[int, str] = {}
        self._serial = 0
        self._returning = asyncio.Lock()

    @property
    def wire(self) -> Any:
        """The simulated wire."""
        return self.floor.floor.wires[BUS]

    async def run(self, commands: int) -> Ledger:
        """Send so many commands through the faults; return what came of them."""
        await self._open()
        self._print_on()
        with self._noise():
            each = -(-commands // len(self.devices))
            await asyncio.gather(*(self._operate(name, each) for name in self.devices))
        self.judge.close()
        await self.session.close()
        return self.ledger

    @contextlib.contextmanager
    def _noise(self) -> Iterator[None]:
        """Let the faults begin; they end with the block."""
        boots = self._boots()
        self._fault(self.setup.faults)
        try:
            yield
        finally:
            self._fault(Faults())
            self.ledger.resets = self._boots() - boots

    def _fault(self, faults: Faults) -> None:
        wire = self.wire
        wire.disturb(faults, Random(self.setup.seed))
        after = faults.hangup_after
        wire._hang_up_at = None if after is None else self.floor.now() + after
        self.floor._turn()

    def _boots(self) -> int:
        return sum(each.boots for each in self.witnesses.values())

    async def _open(self) -> None:
        settings = Settings({}, self._folder / "config", self._folder / "state", data=self._folder / "data")
        self.session = Session(settings, reconnect=True)
        await self._opener(self.session)
        [self.bus] = self.session.buses.values()
        self.bus.watch(self._noticed)

    def _noticed(self, event: object) -> None:
        if isinstance(event, Notice):
            self._notices.setdefault(event.address, []).append(event.text)

    def _print_on(self) -> None:
        if self.setup.printing:
            self.floor._turn()
            *_, witness = self.witnesses.values()
            self.language.print_on(witness, self.floor.now())
            self.wire.look_again()
            self.floor._turn()

    async def _operate(self, name: str, commands: int) -> None:
        """One operator, who uses one drive."""
        address = name if self.setup.names else ""
        for number in range(commands):
            if number % 10 == 0:
                self._print_on()
            await self._once(name, address)
            await asyncio.sleep(max(0.0, self.rng.uniform(-0.03, 0.05)))  # often at once

    async def _once(self, name: str, address: str) -> None:
        await self._connected()
        self._serial += 1
        witness = self.witnesses[name]
        said = self.language.say(self.rng, self._serial, witness, self.floor.now())
        boots = self._boots()
        if said.prints:
            self._held[int(re.findall(NUMBER, said.prints)[0])] = name
        self._notices.pop(address, None)
        command = self.judge.begins(name, said.text, bool(said.prints))
        result: tuple[str, ...] | BaseException
        try:
            result = await self.bus.at(address).send(said.text)
        except (DriveError, TransportLost) as error:
            result = error
        self.judge.ends(command, result, self._notices.get(address, []))
        if said.prints and isinstance(result, tuple) and result != (said.prints,) and boots == self._boots():
            self._wrong_value(name, said.text, said.prints, result)

    async def _connected(self) -> None:
        """Wait until a line that hung up is back, as the session brings it back."""
        async with self._returning:
            self.ledger.hangups += self.bus.lost is not None
            while self.bus.lost is not None:
                await asyncio.sleep(0.05)

    def _wrong_value(self, name: str, text: str, shown: str, result: tuple[str, ...]) -> None:
        """Find the origin of a value that is not the drive's."""
        said, printed = f"@{name} {text}: {result}, held {shown}", "".join(result)
        numbers = [int(digits) for digits in re.findall(NUMBER, printed)]
        if "tick" in printed or any(TICKS <= number < TICKS + 1_000_000 for number in numbers):
            return self.ledger.misdeed("taken for a reply", said)
        for number in numbers:
            if number in self._held and str(number) not in shown:
                kind = "an older value" if self._held[number] == name else "credited to the wrong drive"
                return self.ledger.misdeed(kind, said)
        self.ledger.damage("damaged value", said)


@contextlib.asynccontextmanager
async def served(setup: Setup, folder: Path, scheme: str) -> AsyncIterator[NoisyLine]:
    """A line on a real port of this process, in real time: a pseudo-terminal (also shared), TCP, UDP or Modbus/TCP."""
    serve = '"pty:line.tty"' if scheme in ("pty", "rfc2217") else f'"{scheme}://127.0.0.1:0"'
    cell = cells.load(str(setup.write(folder, serve)))
    floor = RunningFloor(Floor(cell))
    async with AsyncExitStack() as stack:
        stack.callback(floor.close)
        [endpoint] = await serve_bus(floor, cell.buses[0], stack)
        place = f"serial:{folder / 'line.tty'}" if serve.startswith('"pty') else endpoint.endpoint
        if scheme == "rfc2217":
            place = await _shared(f"{place}?baud={setup.baud}", stack)
        url = f"{place}?{'&'.join(_query(setup, scheme))}"
        yield NoisyLine(setup, floor, lambda session: session.open(url), folder)


def _query(setup: Setup, scheme: str) -> Iterator[str]:
    yield "timeout=0.4"
    if scheme != "modbus":
        yield LANGUAGES[setup.language].url
        yield f"drives={','.join(setup.names)}"
    if scheme in ("pty", "rfc2217"):
        yield f"baud={setup.baud}"


async def _shared(url: str, stack: AsyncExitStack) -> str:
    """Share a port as `multidrop share` does; return where."""
    shared = SharedPort(await open_port(parse(url)), stop_bytes("mcode"), lambda said: None)
    stack.push_async_callback(shared.close)
    return await shared.open("127.0.0.1", 0)
