"""A line of which nothing is known, or that is not there: it keeps its place, says what came, and is searched there."""

import asyncio
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from multidrop.base.errors import NoAnswer
from multidrop.dialects.families import FAMILIES, seen
from multidrop.shell.channel import Front
from multidrop.shell.configuration import Settings
from multidrop.shell.events import By, Failed, Notified, Output
from multidrop.shell.session import Session
from multidrop.simulator.cells import read
from multidrop.simulator.floor import Floor
from multidrop.simulator.serving.running import RunningFloor
from multidrop.transports import Unreachable
from tests.support.cases import for_each
from tests.support.cell_session import bus, party, pmx
from tests.support.tuned_ports import TunedPipe, lead_to

pytestmark = pytest.mark.virtual
PORT = "/dev/ttyUSB9"


class Desk:
    """A screen's session; each port leads to a bus of a cell of its own name, unless it is in `absent`."""

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch, **cells: str) -> None:
        self.floors = {name: RunningFloor(Floor(read(cell, "cell.toml"))) for name, cell in cells.items()}
        self.absent: set[str] = set()
        self.pipes: list[Any] = []
        self.session: Any = Session(
            Settings({}, folder / "config", folder / "state", data=folder / "data"), reconnect=True
        )
        self.asked: list[str] = []
        self.agrees = True
        self.repeats = False
        self.session.front = Front(self.ask, screen=self.screen)
        self.events: list[Any] = []
        self.session.subscribe(self.events.append)
        lead_to(monkeypatch, self.transport)

    async def ask(self, question: str) -> bool:
        self.asked.append(question)
        return self.agrees

    async def screen(self, name: str) -> None: ...

    async def transport(self, connection: Any, port: str = "", within: Any = None, baud: Any = None) -> Any:
        name = connection.target.removeprefix("/dev/") or connection.host
        if name in self.absent:
            raise Unreachable(f"{name}: no such port")
        rate = baud or connection.baud or FAMILIES[connection.hints.family or "mcode"].baud
        floor = self.floors[name]
        pipe: Any = TunedPipe(floor, next(iter(floor.floor.wires)), rate, self.repeats)
        pipe.baud, pipe.port = rate, name
        self.pipes.append(pipe)
        return pipe

    def sent(self, baud: int = 0) -> bytes:
        return b"".join(pipe.written for pipe in self.pipes if baud in (0, pipe.baud))

    def told(self) -> str:
        return "\n".join(e.text for e in self.events if isinstance(e, Notified | Output | Failed))

    async def __aenter__(self) -> "Desk":
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.session.close()
        for floor in self.floors.values():
            floor.close()


async def test_a_line_at_another_baud_rate_says_what_came_and_is_searched_with_nothing_typed_again(
    tmp_path, monkeypatch
):
    async with Desk(tmp_path, monkeypatch, ttyUSB9=bus("b", party("a"), baud=19200)) as desk:
        session = desk.session
        (line,) = await session.open(PORT)
        assert line.silent and line.lost is None and session.selected_bus == "ttyUSB9"
        assert "no drive replies" in desk.told()
        assert "search (about" in desk.told() and "Enter alone begins it" in desk.told()
        before = desk.sent()
        await asyncio.sleep(60)
        assert desk.sent() == before, "it is asked only by a person: another baud rate may be an error to its drives"
        await session.run(session.enter_alone())
        assert "OE subroutine" in desk.asked[0] and len(desk.asked) == 1
        await asyncio.sleep(3)
        assert session.buses == {"ttyUSB9": line} and [*line.drives] == ["a"] and not line.silent
        await session.run("@a PR P")
        assert session.of(line).connection.baud == 19200 and line.line.baud == 19200
        assert "/keep ttyUSB9 saves that" in desk.told() and session.enter_alone() == ""
        assert session.selected.address == "a"


@pytest.mark.parametrize("repeats", [True, False])
async def test_a_line_goes_on_with_what_the_search_found_of_its_adapter(tmp_path, monkeypatch, repeats):
    async with Desk(tmp_path, monkeypatch, ttyUSB9=bus("b", party("a"), baud=19200)) as desk:
        (line,) = await desk.session.open(PORT)
        desk.repeats = repeats  # another adapter is plugged in meanwhile
        known = []

        def told(event):
            if isinstance(event, Notified) and "it is opened as" in event.text:
                known.append(line.line.inbox.echo is not None)

        desk.session.subscribe(told)
        await desk.session.run("/scan")
        await asyncio.sleep(3)
        assert [*line.drives] == ["a"]
        assert desk.session.of(line).connection.local_echo is repeats
        assert known == [repeats], "before anything is written to it again"
        assert "removes its own bytes" not in desk.told(), "the search has found that already"


async def test_a_line_in_another_language_is_searched_too(tmp_path, monkeypatch):
    async with Desk(tmp_path, monkeypatch, ttyUSB9=bus("b", pmx("07"))) as desk:
        (line,) = await desk.session.open(PORT)
        await desk.session.run("/scan")
        await asyncio.sleep(3)
        assert [drive.product for drive in line.drives.values()] == ["PMX-2ED-SA"]
        await desk.session.run("@07 PX")


async def test_without_a_yes_no_other_baud_rate_is_tried_and_the_line_stays(tmp_path, monkeypatch):
    async with Desk(tmp_path, monkeypatch, ttyUSB9=bus("b", party("a"), baud=19200)) as desk:
        (line,) = await desk.session.open(PORT)
        desk.agrees = False
        assert not await desk.session.start("/scan")
        await asyncio.sleep(5)
        assert {pipe.baud for pipe in desk.pipes} == {9600}
        assert [*desk.session.buses.values()] == [line] and line.silent and line.lost is None
        assert desk.session.enter_alone() == "/scan"


async def test_a_stop_ends_a_search_goes_first_and_the_line_stays(tmp_path, monkeypatch):
    async with Desk(tmp_path, monkeypatch, ttyUSB9=bus("b", party("a"), baud=19200)) as desk:
        (line,) = await desk.session.open(PORT)
        task = desk.session.start("/scan")
        await asyncio.sleep(1)
        written = len(desk.pipes[-1].written)
        desk.session.stop()
        assert desk.pipes[-1].written[written:], "the port that is searched got the stop at once"
        await task
        assert "the stop was sent with MCode at 9600 baud" in desk.told()
        await asyncio.sleep(5)
        assert [*desk.session.buses.values()] == [line] and line.lost is None


@pytest.mark.parametrize("turns", [0, 1, 2, 3, 5, 8])
async def test_a_search_that_a_stop_ends_as_it_begins_gives_the_line_back(tmp_path, monkeypatch, turns):
    async with Desk(tmp_path, monkeypatch, ttyUSB9=bus("b", party("a"), baud=19200)) as desk:
        (line,) = await desk.session.open(PORT)
        task = desk.session.start("/scan")
        for _ in range(turns):
            await asyncio.sleep(0)
        desk.session.stop()
        assert not await task
        await asyncio.sleep(8)
        assert [*desk.session.buses.values()] == [line] and line.lost is None and line.silent
        assert desk.session.enter_alone() == "/scan"


async def test_a_simulated_line_is_searched_and_comes_back_as_it_was(tmp_path):
    (tmp_path / "cell.toml").write_text(bus("b", party("a")))
    session: Any = Session(
        Settings({}, tmp_path / "config", tmp_path / "state", data=tmp_path / "data"), reconnect=True
    )

    async def agree(question: str) -> bool:
        return True

    async def screen(name: str) -> None: ...

    session.front = Front(agree, screen=screen)
    (line,) = await session.open(f"sim:{tmp_path / 'cell.toml'}#b?drives=z")
    assert line.silent
    await session.run("/scan")
    await asyncio.sleep(8)
    assert [*line.drives] == ["a"] and session.buses == {"b": line}
    await session.run("@a PR P")
    await session.close()


async def test_a_port_that_is_not_there_keeps_its_place_and_is_tried_like_a_lost_one(tmp_path, monkeypatch):
    cells = {"ttyUSB9": bus("b", party("a")), "ttyUSB8": bus("c", party("k"))}
    async with Desk(tmp_path, monkeypatch, **cells) as desk:
        session, failures = desk.session, []
        desk.absent = {"ttyUSB9"}
        await session.open_all(
            [f"{PORT}?drives=a", "/dev/ttyUSB8?drives=k"], lambda number, failure: failures.append(failure)
        )
        assert [*session.buses] == ["ttyUSB9", "ttyUSB8"] and session.selected_bus == "ttyUSB8" and not failures
        assert "ttyUSB9: no such port" in str(session.buses["ttyUSB9"].lost)
        await asyncio.sleep(20)
        assert desk.told().count("trying again") == 1
        session.stop()
        assert "ttyUSB9" in "\n".join(e.text for e in desk.events if isinstance(e, Notified) and e.warning)
        session.resume()
        desk.absent.clear()
        await asyncio.sleep(5)
        line = session.buses["ttyUSB9"]
        assert [*line.drives] == ["a"] and line.lost is None
        back = next(pipe for pipe in desk.pipes if pipe.port == "ttyUSB9")
        assert back.written[:1] == b"\x1b", back.written[:60]
        assert "ttyUSB9: a LMDCM" in desk.told()
        await session.run("@ttyUSB9:a PR P")


async def test_all_ports_that_are_not_there_keep_their_places(tmp_path, monkeypatch):
    async with Desk(tmp_path, monkeypatch) as desk:
        desk.absent = {"ttyUSB9", "ttyUSB8"}
        await desk.session.open_all([PORT, "/dev/ttyUSB8"], lambda number, failure: None)
        assert [*desk.session.buses] == ["ttyUSB9", "ttyUSB8"] and desk.session.selected_bus == "ttyUSB9"
        await desk.session.run("/close ttyUSB9")
        assert [*desk.session.buses] == ["ttyUSB8"]


async def test_stated_drives_that_are_off_are_asked_again_by_themselves(tmp_path, monkeypatch):
    async with Desk(tmp_path, monkeypatch, ttyUSB9=bus("b", party("a"))) as desk:
        floor = desk.floors["ttyUSB9"]
        floor.command("power b:a off")
        (line,) = await desk.session.open(f"{PORT}?drives=a")
        assert "asked again every 5 s" in desk.told() and "nothing was received" in desk.told()
        before = len(desk.sent())
        await asyncio.sleep(30)
        assert len(desk.sent()) > before and not line.drives
        assert desk.told().count("asked again every 5 s") == 1
        floor.command("power b:a on")
        await asyncio.sleep(12)
        assert [*line.drives] == ["a"]


async def test_a_script_opens_no_line_without_drives(tmp_path, monkeypatch):
    async with Desk(tmp_path, monkeypatch, ttyUSB9=bus("b", party("a"), baud=19200)) as desk:
        with pytest.raises(NoAnswer, match="no drive replies"):
            await desk.session.run(f"/open {PORT}", replace(desk.session.origin, by=By.SCRIPT))
        assert not desk.session.buses


@for_each(
    "data, text",
    [
        (b"", ""),
        (b"\xff\xfe\x80" * 100, "300 bytes came, none of them readable: another baud rate?"),
        (b"\xff\xfe\x80\x41", "4 bytes came, 1 of them readable: another baud rate?"),
        (b"ok>\r\n", "5 bytes came that are no reply ('ok>'): another language, or an adapter that repeats what it"),
        (bytes.fromhex("02 01 64 01 00 00 00 05 6D"), "frames came as TMCL drives send them: dialect=tmcl"),
    ],
)
def test_what_came_is_said(data: bytes, text: str) -> None:
    assert seen(data, "mcode").startswith(text) and bool(seen(data, "mcode")) == bool(text)
