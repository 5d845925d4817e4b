"""An adapter that repeats what it sends, and a gateway that greets: neither is ever taken for a drive's output."""

from __future__ import annotations

import asyncio
import itertools
from pathlib import Path
from typing import Any

import pytest

from multidrop.dialects.families import FAMILIES
from multidrop.drives.events import Unsolicited
from multidrop.shell.configuration import Settings
from multidrop.shell.events import Notified, OnBus, Printed
from multidrop.shell.session import Session
from multidrop.simulator.cells import read
from multidrop.simulator.floor import Floor
from multidrop.simulator.serving.running import RunningFloor
from tests.support.cases import for_each
from tests.support.cell_session import bus, drive, party, pmx
from tests.support.tuned_ports import TunedPipe, lead_to

pytestmark = pytest.mark.virtual
FOLDERS = itertools.count()


class Greeting(TunedPipe):
    """A gateway that sends a text of its own when a client connects; `late`: right after the first bytes of it."""

    greeting, late = b"", False

    def start(self, received: Any, lost: Any) -> None:
        super().start(received, lost)
        if not self.late:
            self._floor.loop.call_soon(received, self.greeting)

    def write(self, data: bytes) -> bool:
        if self.late and not self.written:
            self._floor.loop.call_soon(self._received, self.greeting)
        return super().write(data)


class Place:
    """A session whose port leads to a cell of one bus."""

    def __init__(
        self, folder: Path, patch: pytest.MonkeyPatch, cell: str, *, repeats: bool = True, lazy: bool = False,
        greeting: bytes = b"", late: bool = False, network: bool = False,
    ) -> None:  # fmt: skip
        folder = folder / str(next(FOLDERS))
        self.floor = RunningFloor(Floor(read(cell, "cell.toml")))
        self.session: Any = Session(Settings({}, folder / "c", folder / "s", data=folder / "d"), lazy=lazy)
        self.session.questions.agreed = True
        self.events: list[Any] = []
        self.session.subscribe(self.events.append)

        async def transport(connection: Any, port: str = "", within: Any = None, baud: Any = None) -> Any:
            rate = baud or connection.baud or FAMILIES[connection.hints.family or "mcode"].baud
            pipe: Any = Greeting(self.floor, "b", rate, repeats)
            pipe.greeting, pipe.late, pipe.network = greeting, late, network
            self.pipe = pipe
            return pipe

        lead_to(patch, transport)

    async def run(self, url: str, *lines: str) -> None:
        try:
            await self.session.open(url)
            for line in lines:
                await self.session.run(line)
        finally:
            await self.session.close()
            self.floor.close()

    @property
    def output(self) -> list[str]:
        """What goes to standard output."""
        lines: list[str] = []
        for event in self.events:
            if isinstance(event, Printed):
                lines.append(event.text)
            elif isinstance(event, OnBus) and isinstance(event.event, Unsolicited) and not event.event.greeting:
                lines += event.event.lines
        return lines

    @property
    def told(self) -> list[str]:
        return [event.text for event in self.events if isinstance(event, Notified)]


PORT = "/dev/ttyUSB9"
ALONE = 'personality = "LMDCM"\n'
TMCM = drive("TMCM", "1")
LINES: dict[str, tuple[str, str, list[str], list[str]]] = (
    {
        "pmx": (bus("b", pmx("00")), f"{PORT}?dialect=pmx", ["PX", "PX=5", "PX"], ["0", "5"]),
        "two pmx": (
            bus("b", pmx("00"), pmx("07")),
            f"{PORT}?dialect=pmx&drives=00,07",
            ["@07 PX", "@00 PX"],
            ["0", "0"],
        ),
        "tmcl": (bus("b", TMCM), f"{PORT}?dialect=tmcl", ["GAP 1, 0", "SAP 4, 0, 500", "GAP 4, 0"], ["0", "500"]),
    }
    | {
        f"mcode alone EM={em} CK={ck}": (
            bus("b", f"{ALONE}set = {{ EM = {em}, CK = {ck} }}"),
            PORT + more,
            ["PR P", "A=5000000", "PR A"],
            ["0", "5000000"],
        )
        for em in range(4)
        for ck in range(3)
        for more in ("", "?party=0")
    }
    | {
        f"mcode party EM={em} CK={ck} {more}": (
            bus("b", party("a", EM=em, CK=ck), party("k", EM=em, CK=ck)),
            PORT + more,
            ["@a PR P", "@k A=5000000", "@k PR A"],
            ["0", "5000000"],
        )
        for em in range(4)
        for ck in range(3)
        for more in ("?drives=a,k", "?party=1&drives=a,k")
    }
)


@for_each("name, lazy", [(name, lazy) for name in LINES for lazy in (False, True)])
async def test_our_own_bytes_are_never_output_and_the_adapter_is_said_once(tmp_path, monkeypatch, name, lazy):
    cell, url, lines, printed = LINES[name]
    place = Place(tmp_path, monkeypatch, cell, lazy=lazy)
    await place.run(url, *lines)
    sign = "&" if "?" in url else "?"
    assert place.output == printed
    assert [text for text in place.told if "repeats" in text] == [
        "ttyUSB9: the adapter repeats what it sends; multidrop removes its own bytes for this session. To state that "
        f"in the URL: {url}{sign}echo=local"
    ]


@for_each("name, lazy", [(name, lazy) for name in LINES for lazy in (False, True)])
async def test_a_drive_that_echoes_is_no_adapter_that_does(tmp_path, monkeypatch, name, lazy):
    cell, url, lines, printed = LINES[name]
    place = Place(tmp_path, monkeypatch, cell, repeats=False, lazy=lazy)
    await place.run(url, *lines)
    assert place.output == printed
    assert not [text for text in place.told if "repeats" in text]


@for_each("name", ["pmx", "two pmx", "tmcl"])
async def test_a_stop_prints_nothing_of_itself(tmp_path, monkeypatch, name):
    cell, url, _, _ = LINES[name]
    place = Place(tmp_path, monkeypatch, cell)
    await place.session.open(url)
    place.session.stop("Ctrl+X")
    await asyncio.sleep(8.0)
    await place.session.close()
    place.floor.close()
    assert place.output == []


GREETINGS = [b"Welcome\r\n", b"Moxa NPort 5110\r\nPort 1 is open\r\n", b"Welcome\r", b"\xff\xfd\x03\xff\xfb\x01"]


@for_each(
    "name, greeting, late, repeats",
    [
        (name, greeting, late, repeats)
        for name in ("pmx", "two pmx", "tmcl")
        for greeting in GREETINGS
        for late in (False, True)
        for repeats in (False, True)
    ],
)
async def test_a_greeting_brings_no_reply_of_multidrops_own_questions_to_the_output(
    tmp_path, monkeypatch, name, greeting, late, repeats
):
    cell, url, lines, printed = LINES[name]
    place = Place(tmp_path, monkeypatch, cell, repeats=repeats, greeting=greeting, late=late)
    await place.run(url, *lines)
    assert place.output == printed


@for_each(
    "name, greeting, late, lazy",
    [
        (name, greeting, late, lazy)
        for name in LINES
        if "mcode" in name
        for greeting in (b"Welcome\r\n12345\r\n", b"Port 1 is open\r\nlogin: ")
        for late in (False, True)
        for lazy in (False, True)
    ],
)
async def test_a_gateways_greeting_is_no_output_of_a_drive(tmp_path, monkeypatch, name, greeting, late, lazy):
    cell, url, lines, printed = LINES[name]
    place = Place(tmp_path, monkeypatch, cell, repeats=False, lazy=lazy, greeting=greeting, late=late, network=True)
    await place.run(url, "/sleep 0.2", *lines)
    assert place.output == printed


async def test_what_is_printed_later_than_a_greeting_is_a_drives_output(tmp_path, monkeypatch):
    cell, url, _, _ = LINES["mcode alone EM=1 CK=0"]
    place = Place(tmp_path, monkeypatch, cell, repeats=False, lazy=True, greeting=b"Welcome\r\n", network=True)
    await place.session.open(url)
    await asyncio.sleep(3.0)
    place.floor.loop.call_soon(place.pipe.hear, b"12345\r\n")
    await asyncio.sleep(0.3)
    await place.session.run("PR P")
    await place.session.close()
    place.floor.close()
    assert place.output == ["12345", "0"]
    said = [text for text in place.told if "'Welcome'" in text and "may be a gateway's greeting" in text]
    assert len(said) == 1


@for_each("name", ["mcode alone EM=0 CK=0", "mcode alone EM=1 CK=0", "mcode alone EM=2 CK=0"])
async def test_questions_that_come_back_late_and_together_are_no_output(tmp_path, monkeypatch, name):
    cell, url, _, _ = LINES[name]
    place = Place(tmp_path, monkeypatch, cell, repeats=False)
    await place.session.open(url)
    await place.session.run("PR P")
    await place.session.run("PR VM")
    place.floor.loop.call_soon(place.pipe.hear, b'PR P,"~"\rPR VM,"~"\r\n')
    await asyncio.sleep(0.3)
    place.floor.loop.call_soon(place.pipe.hear, b"PR P\r\n")  # the trace of a program
    await asyncio.sleep(0.3)
    await place.session.close()
    place.floor.close()
    assert place.output == ["0", "768000", "PR P"]


@for_each("name", ["pmx", "tmcl"])
async def test_what_another_host_does_on_the_line_is_said_and_no_drives_output(tmp_path, monkeypatch, name):
    cell, url, _, _ = LINES[name]
    place = Place(tmp_path, monkeypatch, cell, repeats=False)
    await place.session.open(url)
    for _ in range(20):
        place.floor.loop.call_soon(place.pipe.hear, b"@07PX\r1234\r" * 9)
        await asyncio.sleep(0.3)
    await place.run(url)
    assert place.output == []
    said = [text for text in place.told if "without a question" in text]
    assert len(said) == 1 and "another program uses this line" in said[0]
