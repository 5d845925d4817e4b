"""What a program prints beside polls of a party line: whole lines are shown, destroyed ones are reported as lost."""

import asyncio
import re

import pytest

from multidrop.dialects import End, Priority
from multidrop.dialects.families import family_of
from multidrop.drives.events import Sent, Traffic, Unsolicited
from multidrop.families.lexium.host.mcode.codec import MCode
from multidrop.families.lexium.host.mcode.state import MCodeState
from multidrop.shell.events import OnBus
from multidrop.simulator.cell.spec import Faults
from tests.support.cell_session import CellSession, bus, party
from tests.support.faults import disturb
from tests.support.procedure import ProcedureRunner

LINES = 60
PRINT = re.compile(rb"(?:^|(?<=[\n\x06>]))(p=\d+)[\x80-\xff]?\r\n")
WHOLE = re.compile(r"p=\d+")


class Printing(CellSession):
    """Three drives on a party line; a program in c prints p=1, p=2 and so on, one every `pause` ms."""

    def __init__(self, folder, pause, c=None, **settings):
        drives = (party(name, **(c if c and name == "c" else settings)) for name in "abc")
        super().__init__(folder, bus("line", *drives))
        self.pause = pause

    async def __aenter__(self):
        await super().__aenter__()
        program = (
            ("R1=0", "PG 1", "LB G1", "IC R1", 'PR "p=",R1')
            + ((f"H {self.pause}",) if self.pause else ())
            + (f"BR G1,R1<{LINES}", "E", "PG")
        )
        for line in program:
            self.device("line:c").execute(line, 0.0)
        return self

    def poll(self, period):
        telemetry = self.session.buses["line"].telemetry
        return telemetry.subscribe("abc", period), telemetry.watch("abc", 1.0)

    def heard(self, kind):
        return [each.event for each in self.events if isinstance(each, OnBus) and isinstance(each.event, kind)]

    @property
    def shown(self):
        return [line for event in self.heard(Unsolicited) for line in event.lines]

    @property
    def received(self):
        data = b"".join(event.data for event in self.heard(Traffic) if not event.outgoing)
        return [found.decode() for found in PRINT.findall(data)]


@pytest.mark.wide
@pytest.mark.virtual
@pytest.mark.parametrize("check", [0, 1, 2])
@pytest.mark.parametrize("em", [0, 1, 2, 3])
async def test_whole_prints_are_shown_and_nothing_else(tmp_path, em, check):
    async with Printing(tmp_path, 97, EM=em, CK=check) as cell:
        cell.poll(0.1)
        await cell.session.run("@c EX G1")
        await asyncio.sleep(LINES * 0.12 + 5)
        assert [line for line in cell.shown if not WHOLE.fullmatch(line)] == []
        assert cell.shown == list(dict.fromkeys(cell.shown)), "a print is shown twice"
        assert set(cell.received) <= set(cell.shown), "a print that came whole is not shown"
        if len(cell.shown) < LINES:
            assert any("printed lines may be lost" in text for text in cell.warned())


@pytest.mark.virtual
async def test_a_destroyed_print_names_the_drive_that_was_polled_and_what_was_received(tmp_path):
    async with Printing(tmp_path, 97, EM=1, CK=1) as cell:
        cell.poll(0.02)
        await cell.session.run("@c EX G1")
        await asyncio.sleep(LINES * 0.12 + 5)
        lost = [text for text in cell.warned() if "may be lost" in text]
        assert lost and len(cell.shown) < LINES
        for text in lost:
            assert re.fullmatch(
                r"line: beside a poll of [abc] something was damaged on the line: .* may be lost \(received .+\)", text
            )
        assert all(WHOLE.fullmatch(line) for line in cell.shown)


@pytest.mark.virtual
async def test_a_print_with_a_checksum_is_shown_without_it_beside_drives_that_have_none(tmp_path):
    async with Printing(tmp_path, 97, c={"EM": 1, "CK": 1}, EM=1, CK=0) as cell:
        cell.poll(0.05)
        await cell.session.run("@c EX G1")
        await asyncio.sleep(LINES * 0.12 + 5)
        assert len(cell.shown) > LINES / 2 and all(WHOLE.fullmatch(line) for line in cell.shown)
        assert set(cell.received) <= set(cell.shown)


@pytest.mark.virtual
async def test_polls_wait_after_a_print_at_most_a_fifth_of_a_second_and_a_typed_line_does_not(tmp_path):
    async with Printing(tmp_path, 20, EM=1, CK=0) as cell:
        await cell.session.run("@c EX G1")
        await asyncio.sleep(0.1)
        cell.events.clear()
        cell.poll(0.01)
        loop = asyncio.get_running_loop()
        began = loop.time()
        await asyncio.sleep(0.05)
        await cell.session.run("@c PR P")  # no print of its own program runs into it
        await asyncio.sleep(0.5)
        sent = [(event.request.text, event.at - began) for event in cell.heard(Sent)]
        assert sent[0][0] == "PR P" and sent[0][1] < 0.11
        assert sent[1][0] == "PR P,DN,V" and 0.19 < sent[1][1] < 0.25


@pytest.mark.virtual
async def test_the_prints_of_a_drive_are_shown_while_another_one_is_searched_for(tmp_path):
    async with Printing(tmp_path, 97, EM=1, CK=1) as cell:
        cell.world("/sim power b off")
        cell.poll(0.1)
        await cell.session.run("@c EX G1")
        await asyncio.sleep(LINES * 0.12 + 5)
        assert set(cell.received) <= set(cell.shown)
        assert [line for line in cell.shown if not WHOLE.fullmatch(line)] == []


@pytest.mark.parametrize("priority", [Priority.POLL, Priority.OPERATOR])
def test_a_late_reply_to_a_signed_request_is_no_line_of_a_program(bench, priority):
    wired = bench([{"name": "a", "party": True, "set": {"EM": 1}}], timeout=0.3)
    wired.wire.receive(b"\n\n", 0.0)
    wired.wait(0.1)
    disturb(wired.wire, Faults(delay=(0.5, 0.5)))
    state = MCodeState(MCode(em=1, party=True, escape=1), "a", "a", "LMDCM")
    asked = ProcedureRunner(family_of(state).motion(priority)).request
    assert asked is not None
    wired.line.ask(asked)
    wired.events()
    wired.wait(1.0)
    assert (wired.ended[-1].reply.end, wired.strays) == (End.TIMEOUT, [])


@pytest.mark.virtual
@pytest.mark.parametrize("em", [0, 1, 2, 3])
async def test_prints_with_a_name_which_replies_to_polls_have_too_are_shown(em, tmp_path):
    async with Printing(tmp_path, 29, EM=em, CK=0) as cell:
        for line in ("CP", "R1=0", "PG 1", "LB G1", "IC R1", "PR R1,DN", "H 29", f"BR G1,R1<{LINES}", "E", "PG"):
            cell.device("line:c").execute(line, 0.0)
        polls = cell.poll(0.02)
        await asyncio.sleep(0.5)
        cell.events.clear()
        await cell.session.run("@c EX G1")
        await asyncio.sleep(6)
        for each in polls:
            each.close()
        missing = [n for n in range(1, LINES + 1) if f'{n}"c"' not in cell.shown]
        assert len(missing) <= 4 * len(cell.warned()), cell.warned()  # one warning may be of several prints
