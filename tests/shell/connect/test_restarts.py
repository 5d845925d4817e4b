"""A power cycle is said once; the position does not count until it is given a reference. Slow is not restarted."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from multidrop.base.errors import Diagnostic, DriveError, NoAnswer, Refused
from multidrop.dialects.families import FAMILIES
from multidrop.drives.drive import Drive
from multidrop.shell.events import ProgramRead, ProgramSeen, SettingsRead
from tests.support.cell_session import CellSession, bus, party, pmx

pytestmark = pytest.mark.virtual
TMCM = 'personality = "TMCM"'
LINE = "line"


class Polled(CellSession):
    """A cell with one bus, whose drives are polled and their conditions watched."""

    def __init__(self, folder: Path, *drives: str, faults: str = "", watched: bool = True) -> None:
        super().__init__(folder, bus(LINE, *drives) + faults, reconnect=True)
        self.watched = watched

    async def __aenter__(self) -> Polled:
        await super().__aenter__()
        telemetry = self.session.buses[LINE].telemetry
        addresses = list(self.session.buses[LINE].drives)
        telemetry.subscribe(addresses, 0.5)
        if self.watched:
            telemetry.watch(addresses, 1.0)
        return self

    def restarts(self) -> list[str]:
        return [text for text in self.told() if "was restarted (" in text and "not referenced" in text]

    def unreferenced(self, address: str) -> frozenset[str]:
        return self.session.buses[LINE].drives[address].state.unreferenced

    async def cycle(self, name: str, off: float = 8.0) -> None:
        self.world(f"power {name} off")
        await asyncio.sleep(off)
        self.world(f"power {name} on")
        await asyncio.sleep(30)


HOMING = 'set = { EM = 1, IS = ["1,1,0"] }'
PARTY = f'personality = "LMDCM"\nname = "b"\nparty = true\n{HOMING}'
CASES = {
    "MCode": (PARTY, "b", "b", "@b MA 51200", "position 51200 before, 0 now", "@b HM 1", {""}),
    "MCode, alone": (f'personality = "LMDCM"\n{HOMING}', "", "!", "MA 51200", "sign-on", "HM 1", {""}),
    "PMX": (pmx("00"), "00", "00", "@00 X5000", "x position 5000 before, 0 now", "@00 HX-", {"x", "y"}),
    "TMCL": (TMCM, "1", "1", "@1 MVP ABS, 0, 51200", "position 51200 before, 0 now", "@1 RFS START, 0", {""}),
}
HOME = "\nworld = { home = -2000, limit_minus = -4000 }"


@pytest.mark.parametrize("family", CASES)
async def test_a_power_cycle_is_said_once_and_a_homing_gives_the_reference(tmp_path: Path, family: str) -> None:
    drive, address, name, move, sign, home, axes = CASES[family]
    async with Polled(tmp_path, drive + HOME) as cell:
        await cell.session.run(move)
        await asyncio.sleep(8)
        before = len(cell.written(LINE))
        await cell.cycle(name)
        assert len(cell.restarts()) == 1 and sign in cell.restarts()[0], cell.told()
        assert cell.unreferenced(address) == axes
        assert b"MA" not in cell.written(LINE)[before:]
        await cell.session.run(home)
        await asyncio.sleep(0.1)
        assert cell.unreferenced(address) == axes  # it has only begun
        await asyncio.sleep(60)
        assert cell.unreferenced(address) == axes - {"x" if family == "PMX" else ""}, cell.told()
        assert len(cell.restarts()) == 1


@pytest.mark.parametrize(
    ("drive", "address", "name", "move", "line"),
    [
        (party("b"), "b", "b", "@b MA 51200", "@b P=100"),
        (pmx("00"), "00", "00", "@00 X5000", "@00 PX=100"),
        (TMCM, "1", "1", "@1 MVP ABS, 0, 51200", "@1 SAP 1, 0, 0"),
    ],
)
async def test_a_position_that_is_set_is_a_reference(tmp_path, drive, address, name, move, line) -> None:
    async with Polled(tmp_path, drive) as cell:
        await cell.session.run(move)
        await asyncio.sleep(8)
        await cell.cycle(name)
        assert (lost := cell.unreferenced(address))
        await cell.session.run(line)
        assert cell.unreferenced(address) == lost - {"x" if address == "00" else ""}


async def test_a_homing_that_a_stop_ends_is_no_reference(tmp_path: Path) -> None:
    async with Polled(tmp_path, PARTY + "\nworld = { home = -2000000 }") as cell:
        await cell.session.run("@b MA 5000")
        await asyncio.sleep(8)
        await cell.cycle("b")
        await cell.session.run("@b HM 1")
        await asyncio.sleep(3)
        cell.session.stop()
        await asyncio.sleep(10)
        assert cell.unreferenced("b") == {""}
        await cell.session.run("/referenced b")
        assert not cell.unreferenced("b")


async def test_settings_that_are_reset_are_a_sign_where_the_position_is_none(tmp_path: Path) -> None:
    async with Polled(tmp_path, party("b")) as cell:
        await cell.session.run("@b VM=100000")
        await asyncio.sleep(8)
        await cell.cycle("b")
        (said,) = cell.restarts()
        assert "VM 100000 before, 768000 now" in said and "position 0 before, 0 now" in said
        assert cell.unreferenced("b") == {""}


@pytest.mark.parametrize(("failure", "missing"), [(NoAnswer("no reply"), True), (Refused("refused"), False)])
async def test_a_drive_that_falls_silent_again_before_it_was_looked_at_is_looked_at_later(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, failure: DriveError, missing: bool
) -> None:
    async def unread(*_: object) -> None:
        raise failure

    async with CellSession(tmp_path, bus(LINE, party("b"))) as cell:
        line = cell.session.buses[LINE]
        drive = line.drives["b"]
        with monkeypatch.context() as patched:
            patched.setattr(Drive, "motion", unread)
            line.roster.restarts.replied_again(drive, "sign-on")
            await asyncio.sleep(5)
        assert (drive.missing, drive.state.unreferenced, cell.warned()) == (missing, frozenset(), [])
        line.roster.restarts.replied_again(drive, "sign-on")
        await asyncio.sleep(5)
        assert drive.state.unreferenced == {""} and "b was restarted (sign-on; position 0 now)" in cell.warned()[0]


@pytest.mark.parametrize("commands", [[], ["@b MA 51200"], ["@b MA 51200", "@b VM=100000"]])
async def test_a_drive_that_was_only_silent_is_not_restarted(tmp_path: Path, commands: list[str]) -> None:
    async with Polled(tmp_path, party("b")) as cell:
        for line in commands:
            await cell.session.run(line)
        await asyncio.sleep(8)
        for quiet in (3.0, 12.0):
            cell.world("unplug line")
            await asyncio.sleep(quiet)
            cell.world("plug line")
            await asyncio.sleep(20)
        assert cell.restarts() == [] and cell.unreferenced("b") == frozenset()


@pytest.mark.parametrize(
    ("family", "line", "found"),
    [
        ("mcode", "HM 1", ("", True)),
        ("mcode", "hi 3", ("", True)),
        ("mcode", "P=5", ("", False)),
        ("mcode", "PR P", None),
        ("mcode", "P", None),
        ("mcode", "PS", None),
        ("modbus", "HM 1", ("", True)),
        ("modbus", "P 0", ("", False)),
        ("pmx", "HLX+", ("x", True)),
        ("pmx", "ZHY-", ("y", True)),
        ("pmx", "PY=0", ("y", False)),
        ("pmx", "PX", None),
        ("pmx", "HCAX", None),
        ("tmcl", "RFS START, 0", ("", True)),
        ("tmcl", "RFS STOP, 0", None),
        ("tmcl", "SAP 1, 0, 5", ("", False)),
        ("tmcl", "SAP 4, 0, 5", None),
    ],
)
def test_the_lines_that_give_a_reference(family: str, line: str, found: tuple[str, bool] | None) -> None:
    record = FAMILIES[family]
    given = record(record.new_state(record.codec, "")).referencing(line)
    assert (None if given is None else (given.axis, given.homing)) == found


@pytest.mark.parametrize("line", ["@b MA 0", "@b P=0", "@b VM=5000", "@* P=0", "@* VM=5000"])
async def test_what_was_sent_before_a_silence_is_no_restart(tmp_path: Path, line: str) -> None:
    async with Polled(tmp_path, party("b")) as cell:
        await cell.session.run("@b MA 51200")
        await asyncio.sleep(8)
        await cell.session.run(line)
        drive = cell.session.buses[LINE].drives["b"]
        drive.missing = True  # as after a reply that noise has eaten
        await asyncio.sleep(8)
        assert cell.restarts() == []


async def test_a_lost_line_that_comes_back_with_a_restarted_drive_says_so(tmp_path: Path) -> None:
    async with Polled(tmp_path, party("b")) as cell:
        await cell.session.run("@b MA 51200")
        await asyncio.sleep(8)
        cell.world("unplug line")
        await asyncio.sleep(3)
        cell.world("power b off")
        cell.world("power b on")
        cell.world("plug line")
        await asyncio.sleep(20)
        (said,) = cell.restarts()
        assert "position 51200 before, 0 now" in said


async def test_a_drive_that_the_line_lacks_is_not_referenced(tmp_path: Path) -> None:
    async with Polled(tmp_path, party("a"), party("b")) as cell:
        with pytest.raises(Diagnostic, match="no drive zz"):
            await cell.session.run("/referenced zz")


# What rests on a drive that was restarted


PROGRAM = '\nprogram_text = """PG 1\\nLB G1\\nH 500\\nE\\nPG\\n"""'


def forgotten(cell: Polled, address: str) -> list[bool]:
    """For each reading of the program of a drive that was published: whether it is what the drive holds."""
    return [each.known for each in cell.events if isinstance(each, ProgramRead) and each.address == address]


async def test_the_program_the_labels_and_the_settings_of_a_restarted_drive_are_not_known(tmp_path: Path) -> None:
    async with Polled(tmp_path, party("b") + PROGRAM) as cell:
        drive = cell.session.buses[LINE].drives["b"]
        await cell.session.run("/list b")
        await cell.session.run("@b MA 51200")
        await asyncio.sleep(8)
        assert forgotten(cell, "b") == [True] and cell.session.names.offered(drive, "EX ")
        await cell.cycle("b")
        assert forgotten(cell, "b") == [True, False]
        assert not cell.session.names.offered(drive, "EX ")
        assert [each.known for each in cell.events if isinstance(each, SettingsRead)] == [False]
        assert [each.break_point for each in cell.events if isinstance(each, ProgramSeen)] == [""]


async def test_a_listing_of_a_drive_without_a_program_says_so(tmp_path: Path) -> None:
    async with Polled(tmp_path, party("b")) as cell:
        await cell.session.run("/list b")
        assert cell.told()[-1] == "b: no program"


async def test_drives_that_nothing_shows_to_have_run_on_may_have_been_restarted_too(tmp_path: Path) -> None:
    async with Polled(tmp_path, party("a"), party("b"), party("c") + PROGRAM, party("d")) as cell:
        await cell.session.run("/list c")
        for line in ("@a MA 5000", "@b MA 51200", "@d MA 400"):
            await cell.session.run(line)
        await asyncio.sleep(8)
        await cell.cycle("b")
        assert len(cell.restarts()) == 1 and cell.restarts()[0].startswith("line: b was restarted")
        doubts = [each for each in cell.told() if "may have been restarted, too" in each]
        assert len(doubts) == 1 and doubts[0].startswith("line: c may have been restarted, too"), cell.told()
        assert forgotten(cell, "c") == [True, False] and not cell.unreferenced("c")
        assert forgotten(cell, "a") == []


async def test_drives_of_a_line_that_are_all_restarted_are_each_named_once(tmp_path: Path) -> None:
    async with Polled(tmp_path, party("a"), party("b"), party("c")) as cell:
        await cell.session.run("@a MA 5000")
        await cell.session.run("@b MA 51200")
        await asyncio.sleep(8)
        for name in "abc":
            cell.world(f"power {name} off")
        await asyncio.sleep(8)
        for name in "abc":
            cell.world(f"power {name} on")
        await asyncio.sleep(60)
        assert sorted(each[:21] for each in cell.restarts()) == ["line: a was restarted", "line: b was restarted"]
        doubts = [each for each in cell.told() if "may have been restarted, too" in each]
        assert len(doubts) == 1 and doubts[0].startswith("line: c may have been restarted, too"), cell.told()


async def test_a_drive_that_was_silent_beside_no_restart_is_not_doubted(tmp_path: Path) -> None:
    async with Polled(tmp_path, party("a"), party("b")) as cell:
        await asyncio.sleep(8)
        await cell.cycle("b")
        assert not cell.restarts() and not [each for each in cell.told() if "may have been" in each]


async def test_from_where_a_restarted_module_counts_its_distances_is_not_known(tmp_path: Path) -> None:
    async with Polled(tmp_path, TMCM) as cell:
        drive = cell.session.buses[LINE].drives["1"]
        await cell.session.run("@1 SAP 127, 0, 1")
        await cell.session.run("@1 MVP REL, 0, 51200")
        await asyncio.sleep(8)
        assert drive.state.relative == {0: 1}
        await cell.cycle("1")
        assert cell.restarts() and drive.state.relative == {}
