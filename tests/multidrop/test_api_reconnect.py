"""Sessions that come back: what a loss leaves open is said, nothing is repeated, and nothing moves a changed drive."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest

from multidrop import AsyncSession, DriveError, Lost, Timeout, TransportLost, Unreferenced, connect_async
from multidrop.api.returns import Returns
from multidrop.drives.events import Traffic
from multidrop.shell.events import OnBus
from tests.support.behind_api import shell_of
from tests.support.cell_session import bus, drive, party, pmx

pytestmark = pytest.mark.virtual
IS = 'set = { EM = 1, IS = ["1,1,0"] }'
HOME = "world = { home = -2000, limit_minus = -40000 }"
CASES = {
    "mcode": (drive("LMDCM", "a", IS, HOME, party=True) + "\n[[bus.drive]]\n" + drive("LMDCM", "b", party=True), "a"),
    "pmx": (pmx("00", "world.x = { home = -2000 }"), "00"),
    "tmcl": (drive("TMCM", "1", HOME), "1"),
}


class Shop:
    """A line in virtual time, whose session comes back."""

    def __init__(self, session: AsyncSession, name: str) -> None:
        self.session, self.a = session, session.drive(name)
        self.sent: list[bytes] = []
        shell_of(session).subscribe(self._take)

    def _take(self, event: Any) -> None:
        if isinstance(event, OnBus) and isinstance(event.event, Traffic) and event.event.outgoing:
            self.sent.append(event.event.data)

    async def world(self, *words: str) -> None:
        for each in words:
            await self.session.send(f"/sim {each}")

    async def lose(self, *meanwhile: str) -> None:
        await self.world("unplug line", *meanwhile)
        await asyncio.sleep(1)
        await self.world("plug line")
        await self.session.wait_back()

    async def arrive(self) -> None:
        await self.a.move(5000)
        await self.a.wait()


def opened(folder: Path, family: str = "mcode", reconnect: bool = True, baud: int = 0) -> AsyncSession:
    (folder / "cell.toml").write_text(bus("line", CASES[family][0], baud=baud))
    return connect_async(f"sim:{folder / 'cell.toml'}", reconnect=reconnect)


@pytest.mark.parametrize("family", CASES)
async def test_a_drive_that_is_as_it_was_is_moved_again(tmp_path: Path, family: str) -> None:
    async with opened(tmp_path, family) as session:
        shop = Shop(session, CASES[family][1])
        await shop.arrive()
        await shop.lose()
        assert shop.a.referenced
        await shop.arrive()
        assert await shop.a.position() == 10000


@pytest.mark.parametrize("family", CASES)
async def test_a_restarted_drive_moves_only_once_its_position_counts(tmp_path: Path, family: str) -> None:
    async with opened(tmp_path, family) as session:
        name = CASES[family][1]
        shop = Shop(session, name)
        await shop.arrive()
        await shop.lose(f"power {name} off", f"power {name} on")
        shop.sent.clear()
        lines = {"mcode": "MR 5", "pmx": "X5", "tmcl": "MVP REL, 0, 5"}
        text = "position 5000 before its line was lost, 0 now"
        for call in (lambda: shop.a.move(5), lambda: shop.a.run_at(5), lambda: shop.a.send(lines[family])):
            with pytest.raises(Unreferenced, match=rf"{name}: .*{text}.*home it, set its position, or accept\(\)"):
                await call()
        with pytest.raises(Unreferenced):
            await session.send(f"@{name} {lines[family]}")
        assert not any(word in b"".join(shop.sent) for word in (b"MR", b"X5", b"JX", b"SL", b"HSPD"))
        assert not shop.a.referenced and await shop.a.position() == 0  # it is read
        if family == "tmcl":
            await shop.a.write("SEARCH_MODE", 1)
        await shop.a.home(*(() if family == "tmcl" else ("-",)))
        await shop.a.wait()
        await shop.a.move(5)
        assert await shop.a.homed()


@pytest.mark.parametrize("way", ["accept", "P"])
async def test_a_person_says_where_it_is(tmp_path: Path, way: str) -> None:
    async with opened(tmp_path) as session:
        shop = Shop(session, "a")
        await shop.arrive()
        await shop.lose("power a off", "power a on")
        with pytest.raises(Unreferenced):
            await shop.a.move(5)
        await (shop.a.accept() if way == "accept" else shop.a.send("P=5000"))
        await shop.a.move(5)
        await session.drive("b").move(5)  # the other one on the line is as it was


async def test_a_setting_that_differs_holds_it_as_well(tmp_path: Path) -> None:
    async with opened(tmp_path) as session:
        shop = Shop(session, "a")
        await shop.a.write("VM", 300000)
        await asyncio.sleep(2)  # it is read
        await shop.lose("power a off", "power a on")
        with pytest.raises(Unreferenced, match="VM 300000 before its line was lost, 768000 now"):
            await shop.a.move(5)


async def test_what_moved_when_the_line_was_lost_is_not_known_to_be_as_it_was(tmp_path: Path) -> None:
    async with opened(tmp_path) as session:
        shop = Shop(session, "a")
        await shop.a.run_at(10000)
        await shop.lose()
        assert await shop.a.velocity() == 10000  # nothing stops it
        with pytest.raises(Unreferenced, match="a command was too recent"):
            await shop.a.move(5)
        await shop.a.run_at(0)  # ends it
        await shop.a.wait()
        assert b"SL 10000" in b"".join(shop.sent) and b"".join(shop.sent).count(b"SL 10000") == 1


@pytest.mark.parametrize("family", CASES)
async def test_a_drive_that_got_no_command_and_was_not_read_yet_is_moved(
    tmp_path: Path, family: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Returns, "note", _reads_nothing)
    async with opened(tmp_path, family) as session:
        shop = Shop(session, CASES[family][1])
        await shop.lose()
        await shop.a.move(5)
        await shop.a.wait()
        assert await shop.a.position() == 5


@pytest.mark.parametrize("asked", [False, True])
@pytest.mark.parametrize("restarted", [False, True])
async def test_a_drive_whose_program_was_not_asked_for_yet_is_not_said_to_have_run_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, restarted: bool, asked: bool
) -> None:
    async def positions_only(returns: Returns, drive: Any) -> None:
        if not drive.strict:
            drive.strict = True
            await drive.motion()
            if asked:
                await returns._settings(drive, every=True)

    monkeypatch.setattr(Returns, "note", positions_only)
    # With a checksum, a program is taken to run until the drive is asked.
    (tmp_path / "cell.toml").write_text(bus("line", party("a"), party("b", "identity = { position = 300 }"), baud=0))
    async with connect_async(f"sim:{tmp_path / 'cell.toml'}", reconnect=True) as session:
        shop = Shop(session, "b")
        await asyncio.sleep(1)
        await shop.lose(*["power b off", "power b on"] * restarted)
        await session.drive("a").move(5)
        if restarted:
            with pytest.raises(Unreferenced, match="position 300 before its line was lost, 0 now"):
                await shop.a.move(5)
        else:
            await shop.a.move(5)


async def test_a_drive_that_was_commanded_and_not_read_is_not_known_to_be_as_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Returns, "note", _reads_nothing)
    async with opened(tmp_path) as session:
        shop = Shop(session, "a")
        await shop.a.move(5)
        await shop.lose()
        with pytest.raises(Unreferenced, match="a command was too recent"):
            await shop.a.move(5)
        await session.drive("b").move(5)  # it got none


async def _reads_nothing(returns: Returns, drive: Any) -> None:
    drive.strict = True


async def test_what_moves_by_itself_is_not_said_to_have_been_commanded(tmp_path: Path) -> None:
    slews = 'program_text = """\nPG 1\nLB SU\nSL 1000\nH\nE\nPG\n"""'
    (tmp_path / "cell.toml").write_text(
        bus("line", drive("LMDCM", "a", party=True), drive("LMDCM", "b", slews, party=True), baud=0)
    )
    async with connect_async(f"sim:{tmp_path / 'cell.toml'}", reconnect=True) as session:
        shop = Shop(session, "a")
        await asyncio.sleep(2)
        await shop.lose()
        with pytest.raises(Unreferenced, match="b: it moved, or a program ran in it, when it was last read"):
            await session.drive("b").move(5)
        await shop.a.move(5)


async def test_a_command_to_all_is_one_to_each(tmp_path: Path) -> None:
    async with opened(tmp_path) as session:
        shop = Shop(session, "a")
        await asyncio.sleep(1)
        await session.send("@* R1=5")
        await shop.lose()
        for each in session.drives:
            with pytest.raises(Unreferenced, match="a command was too recent"):
                await each.move(5)


async def test_a_drive_that_was_not_read_yet_is_unknown_in_the_report_of_a_loss(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Returns, "note", _reads_nothing)
    async with opened(tmp_path) as session:
        shop = Shop(session, "a")
        await shop.a.motion()
        await asyncio.sleep(0.1)
        await shop.a.motion()  # two readings: at rest
        await shop.lose()
        await asyncio.sleep(1)
        told = [each.message for each in caplog.records]
        assert "line: not known whether these move, as they were not read yet: b" in told
        assert not any("cannot be stopped" in each for each in told) and any(
            "b is at rest at 0" in each for each in told
        )


async def test_a_call_in_flight_says_what_is_known_and_nothing_is_sent_twice(tmp_path: Path) -> None:
    async with opened(tmp_path, baud=9600) as session:
        shop = Shop(session, "a")
        await shop.a.position()
        move = asyncio.create_task(shop.a.move(700))
        while not any(b"MR 700" in each for each in shop.sent):
            await asyncio.sleep(0.0005)
        await shop.world("unplug line")
        with pytest.raises(Lost, match="it is not known whether 'MR 700' was executed") as lost:
            await move
        assert lost.value.unproven == "MR 700" and isinstance(lost.value, TransportLost)
        with pytest.raises(Lost, match="no command of this call is in doubt$"):
            await shop.a.move(800)
        with pytest.raises(Timeout, match="^wait_back: line still lost after 1 s$"):
            await session.wait_back(timeout=1)
        await shop.world("plug line")
        await session.wait_back()
        await shop.a.position()
        await asyncio.sleep(5)
        assert b"".join(shop.sent).count(b"MR") == 1


async def test_without_reconnect_it_stays_lost(tmp_path: Path) -> None:
    async with opened(tmp_path, reconnect=False) as session:
        shop = Shop(session, "a")
        await shop.world("unplug line", "plug line")
        await asyncio.sleep(5)
        for call in (shop.a.position, session.wait_back):
            with pytest.raises(Lost):
                await call()


PROGRAM = "PG 100\nLB G1\n H 500\n E\nPG\n"


async def test_events_name_a_limit_an_error_the_end_of_a_program_a_loss_and_the_return(tmp_path: Path) -> None:
    async with opened(tmp_path) as session:
        shop = Shop(session, "a")
        await shop.a.send("IS=3,2,0")
        await shop.a.programs.download("go.mxt", PROGRAM)
        found: list[tuple[str, str]] = []

        async def listen() -> None:
            async for event in session.events("a", every=0.1):
                found.append((event.kind, str(event)))

        listening = asyncio.create_task(listen())
        await asyncio.sleep(0.2)
        await shop.a.send("EX G1")
        await asyncio.sleep(1)
        assert found == [("program ended", "a: its program has ended (running)")]
        await shop.a.run_at(10000)
        await shop.world("input a 3 0")
        await asyncio.sleep(1)
        await shop.lose()
        await asyncio.sleep(1)
        listening.cancel()
        assert found[1:] == [
            ("error", "a: limit+ is active; read_error() reads and clears its number"),
            ("limit", "a: the plus limit is reached"),
            ("lost", f"line: sim:{tmp_path / 'cell.toml'}#line was lost: unplugged"),
            ("back", "line: the line is back"),
        ]


async def test_events_end_where_no_line_comes_back(tmp_path: Path) -> None:
    async with opened(tmp_path, reconnect=False) as session:
        events = session.events()
        await session.send("/sim unplug line")
        assert [event.kind async for event in events] == ["lost"]


async def test_a_drive_that_stays_away_is_held(tmp_path: Path) -> None:
    async with opened(tmp_path) as session:
        shop = Shop(session, "a")
        await shop.arrive()
        await shop.lose("power a off")
        with pytest.raises(Unreferenced, match="it has not replied since|it does not reply since"):
            await shop.a.move(5)
        assert not shop.a.referenced


async def test_a_loss_while_it_is_compared_holds_it_for_the_next_return(tmp_path: Path) -> None:
    async with opened(tmp_path) as session:
        shop = Shop(session, "a")
        await shop.arrive()
        await shop.world("unplug line", "power a off", "power a on")
        await asyncio.sleep(1)
        await shop.world("plug line")
        while shell_of(session).buses["line"].link.away is not None:
            await asyncio.sleep(0.001)
        await shop.world("unplug line")
        await asyncio.sleep(2)
        await shop.lose()
        with pytest.raises(Unreferenced, match="position 5000 before"):
            await shop.a.move(5)
        with pytest.raises(DriveError):
            await shop.a.move_to(5)
