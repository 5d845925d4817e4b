"""What a session that was killed leaves on the wire: the next one prints none of it, and every print of a program."""

import asyncio
from dataclasses import replace

import pytest

from multidrop.dialects import Owed
from multidrop.drives.events import Unsolicited
from multidrop.shell.connect.opening import open_buses
from multidrop.shell.connect.settings import Settings
from multidrop.shell.events import OnBus
from multidrop.shell.session import Session
from tests.support.cell_session import CellSession, bus, party

pytestmark = pytest.mark.virtual

OWED = Owed(1, "a", "LMDCM", "LMDCM 6.002, Hw: 3.2", "LMDCM571", "040100097")


class Left(CellSession):
    """A line with drives a and b whose port holds these bytes when it is opened. `owed`: a download was killed."""

    def __init__(self, folder, stale, owed=(), **settings):
        super().__init__(folder, bus("line", *(party(name, **settings) for name in "ab")))
        self.stale, self.owed = stale, owed
        self.session = Session(Settings({}, folder / "config", folder / "state"), self.open)
        self.session.questions.agreed = True
        self.session.subscribe(self.events.append)

    async def open(self, connection, naming):
        [opened] = await open_buses(connection, naming)
        transport = opened.bus.link.transport
        start = transport.start

        def begin(received, broke):
            start(received, broke)
            received(self.stale)

        transport.start = begin
        opened.bus.link.leftovers.recovering = bool(self.owed)
        return [replace(opened, hints=replace(opened.hints, owed=self.owed))]

    async def __aenter__(self):
        await self.session.open(self.url + "?drives=a,b")
        return self

    @property
    def shown(self):
        found = [each.event for each in self.events if isinstance(each, OnBus) and isinstance(each.event, Unsolicited)]
        return [line for event in found for line in event.lines]


@pytest.mark.parametrize(
    "reply", [b'0"b"', b'0 12 1"b"', b"51200~b", b'1~0042"b"', b'PR P,DN\xcf\x060"b"\xac', b"1~a17"]
)
async def test_a_late_reply_to_a_session_before_is_reported_and_a_print_is_shown(tmp_path, reply):
    async with Left(tmp_path, reply + b"\r\nLogic 000\r\n", EM=1, CK=0) as cell:
        await cell.session.run("@a PR V")
        await asyncio.sleep(1)
        assert cell.shown == ["Logic 000"] and cell.printed() == ["0"]
        [text] = [text for text in cell.warned() if "left by a session before" in text]
        assert "not printed by a program" in text


@pytest.mark.parametrize("echo", [b"aPG\r\n>", b"EM=0\r\n", b"PG 1\r\n1  aLB G1\r\n6  ", b"1=2\r\n14  aR1=3\r\n18  "])
async def test_the_echo_of_a_download_that_was_killed_is_no_print_and_one_after_it_is(tmp_path, echo):
    async with Left(tmp_path, echo, owed=(OWED,), EM=1, CK=0) as cell:
        assert cell.shown == [] and any("left by a session before" in text for text in cell.warned())
        for line in ("PG 1", "LB G1", 'PR "Logic 000"', "E", "PG", "EX G1"):
            await cell.session.run(f"@b {line}")
        await asyncio.sleep(1)
        assert cell.shown == ["Logic 000"]


async def test_the_echo_of_what_was_just_sent_is_no_print(tmp_path):
    async with Left(tmp_path, b"", EM=1, CK=0) as cell:
        await cell.session.run("@b VM=400000")
        cell.session.buses["line"].link._received(b"12  bVM=400000\r\nb is fast\r\n")
        await asyncio.sleep(1)
        assert cell.shown == ["b is fast"]


async def test_once_the_drives_have_replied_a_line_of_that_form_is_a_print(tmp_path):
    async with Left(tmp_path, b"", EM=1, CK=0) as cell:
        cell.session.buses["line"].link._received(b'0"b"\r\n')
        await asyncio.sleep(1)
        assert cell.shown == ['0"b"'] and cell.warned() == []
