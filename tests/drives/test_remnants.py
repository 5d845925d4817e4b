"""What a stop cuts off or a killed session leaves is no line of a program's; what a program prints is."""

import asyncio
from dataclasses import replace

import pytest

from multidrop.dialects import Owed, Request
from multidrop.dialects.codec import Kind
from multidrop.drives.events import Unsolicited
from multidrop.drives.inbox import DEBRIS_LASTS, Debris, Leftovers
from multidrop.families.lexium.host.mcode.codec import MCode
from multidrop.shell.configuration import Settings
from multidrop.shell.connect.opening import open_buses
from multidrop.shell.events import OnBus
from multidrop.shell.session import Session
from tests.support.cell_session import CellSession, bus, party
from tests.support.simulated_bus import SimulatedBus

pytestmark = pytest.mark.virtual

ALONE = 'personality = "LMDCM"\nset = {{ EM = {}, CK = {}, ES = {} }}'


@pytest.mark.wide
@pytest.mark.parametrize("names", [(), ("a", "b", "c")], ids=["alone", "party"])
@pytest.mark.parametrize("es", [1, 3])
@pytest.mark.parametrize("ck", [0, 1])
@pytest.mark.parametrize("em", [0, 1, 2, 3])
async def test_nothing_of_a_poll_that_was_cut_off_is_shown(em, ck, es, names, nightly):
    drives = [party(name, EM=em, CK=ck, ES=es) for name in names] or [ALONE.format(em, ck, es)]
    line = await SimulatedBus(*drives).open(*names)
    line.bus.telemetry.subscribe(names or ("",))
    for stop in range(0, 25, 1 if nightly else 12):
        await asyncio.sleep(0.2 + 0.00137 * stop)
        line.bus.stop()
        await line.bus.stopped()
        await asyncio.sleep(0.3)
    assert line.heard == []
    await line.bus.close()


async def test_opening_a_clean_line_again_right_behind_polls_shows_nothing():
    drives = [party("a", EM=0), party("b", EM=1, CK=0), party("c", EM=3, CK=0)]
    line = SimulatedBus(*drives)
    for _ in range(5):
        await line.open("a", "b", "c")
        line.bus.telemetry.subscribe(("a", "b", "c"))
        await asyncio.sleep(0.511)
        await line.bus.close()
        line.begin()
    assert line.heard == []
    await line.bus.close()


@pytest.mark.parametrize("em", [0, 1, 2, 3])
async def test_what_a_program_prints_is_shown_up_to_its_stop_and_behind_it(em):
    line = await SimulatedBus(ALONE.format(em, 0, 1)).open()
    [device] = line.devices.values()
    for text in ("PG 1", "LB G1", "IC R1", 'PR "tick ",R1', "H 30", "BR G1", "E", "PG", "EX G1"):
        device.execute(text, line.floor.now())
    line.bus.telemetry.subscribe(("",))
    await asyncio.sleep(1.0)
    line.bus.stop()
    printed = int(device.execute("PR R1", line.floor.now()).lines[0])
    await line.bus.stopped()  # until then a program is stopped again
    device.execute("EX G1", line.floor.now())
    await asyncio.sleep(0.5)
    whole = [text for text in line.heard if text.startswith("tick ")]
    assert whole[: printed - 1] == [f"tick {n}" for n in range(1, printed)]
    assert len(whole) > printed + 3
    await line.bus.close()


DEBRIS = ["#", "a#", "~~~~", "?~~~", ' P,"a', "-12a 0", "\x08\x00a 0", " ", '"', '0"', "0!"]
LINES = ["tick 100", 'say "hi"', "100", "b", "at home"]


@pytest.mark.parametrize("text", DEBRIS + LINES)
def test_what_counts_as_debris(text):
    asked = Request("a", 'PR P,"a ",V', Kind.PRINT, MCode(party=True), expect=r"(-?\d+)a (-?\d+)")
    left = Debris()
    left.request_written(b'aPR P,"a ",V\n', asked, 1.0)
    left.stop_written(b"\x1b~~~~~~\n", 2.0)
    shown = () if text in DEBRIS else (text,)
    assert left.removed(("x 1", text), MCode.stop_debris, 2.0 + DEBRIS_LASTS) == ("x 1", *shown)
    assert left.removed((text,), MCode.stop_debris, 2.1 + DEBRIS_LASTS) == (text,), "later, everything is shown"


# Of a session before


OWED = Owed(1, "a", "LMDCM", "LMDCM 6.002, Hw: 3.2", "LMDCM571", "040100097")


class Left(CellSession):
    """A line with drives a and b whose port holds these bytes when it is opened. `owed`: a download was killed."""

    def __init__(self, folder, stale, owed=(), **settings):
        super().__init__(folder, bus("line", *(party(name, **settings) for name in "ab")))
        self.stale, self.owed = stale, owed
        self.session = Session(Settings({}, folder / "config", folder / "state", data=folder / "data"), self.open)
        self.session.questions.agreed = True
        self.session.subscribe(self.events.append)

    async def open(self, connection, naming):
        [opened] = await open_buses(connection, naming)
        transport = opened.bus.link.transport
        start = transport.start

        def begin(received, broke):
            self.received = received
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
        cell.received(b"12  bVM=400000\r\nb is fast\r\n")
        await asyncio.sleep(1)
        assert cell.shown == ["b is fast"]


async def test_once_the_drives_have_replied_a_line_of_that_form_is_a_print(tmp_path):
    async with Left(tmp_path, b"", EM=1, CK=0) as cell:
        cell.received(b'0"b"\r\n')
        await asyncio.sleep(1)
        assert cell.shown == ['0"b"'] and cell.warned() == []


def test_the_parts_of_a_question_that_come_back_as_lines_are_no_output_and_a_flood_stays_whole():
    leftovers = Leftovers()
    leftovers.request_written(b'P\nR\n "<>",SN,"~2"\r', 9.0)
    parts, flood = ("P", "R", ' "<>",SN,"~2"'), ("P", "R", "17") * 2000
    assert leftovers.divided((*flood, *parts, "17"), lambda line: False, 9.1) == ((*flood, "17"), ())
