"""Several URLs at once: side by side, in their order, and no one waits for another."""

import asyncio
from types import SimpleNamespace

import pytest

from multidrop.base.errors import Diagnostic, NoAnswer
from multidrop.dialects import Hints
from multidrop.shell import stop_report
from multidrop.shell.configuration import Settings
from multidrop.shell.connect.opening import OpenedBus, open_buses
from multidrop.shell.openings import label
from multidrop.shell.session import Session
from multidrop.transports import Unreachable
from tests.shell.connect.fake_bus import FakeBus
from tests.support.cell_session import CellSession, bus, party

pytestmark = pytest.mark.virtual


class Floor:
    """URLs that take their time: `/NAME` leads to a bus after as many seconds as `takes` says."""

    def __init__(self, tmp_path, **takes):
        self.takes, self.buses, self.under_way = takes, {}, 0
        self.session = Session(Settings({}, tmp_path / "c", tmp_path / "s"), self.opener)

    async def opener(self, connection, naming):
        name = connection.target.removeprefix("/") or str(connection.port)
        takes = self.takes[name]
        self.under_way += 1
        try:
            await asyncio.sleep(abs(takes))
        finally:
            self.under_way -= 1
        if takes < 0:
            raise Unreachable(f"{name}: no such port")
        bus = self.buses[name] = FakeBus(naming(connection.short), "a")
        return [OpenedBus(bus, Hints())]


async def test_the_buses_stand_in_the_order_of_their_urls_and_take_as_long_as_the_slowest(tmp_path):
    floor = Floor(tmp_path, slow=3.0, fast=0.5, middle=1.0)
    loop = asyncio.get_running_loop()
    begin = loop.time()
    opening = asyncio.create_task(floor.session.open_all(["/slow", "/fast", "/middle"]))
    await asyncio.sleep(0.6)
    assert list(floor.session.buses) == ["fast"]
    await asyncio.sleep(0.6)
    assert list(floor.session.buses) == ["fast", "middle"]
    await opening
    assert loop.time() - begin == pytest.approx(3.0)
    assert list(floor.session.buses) == ["slow", "fast", "middle"]
    await floor.session.close()


async def test_nothing_is_selected_before_the_first_url_is_open_unless_a_person_selects(tmp_path):
    floor = Floor(tmp_path, slow=3.0, fast=0.5, dead=-1.0)
    opening = asyncio.create_task(floor.session.open_all(["/slow", "/fast"]))
    await asyncio.sleep(1.0)
    assert floor.session.selected_bus == "" and floor.session.selected is None
    with pytest.raises(Diagnostic, match="no bus is ready yet"):
        await floor.session.run("MR 100")
    await floor.session.run("@fast:a MR 100")
    floor.session.select("", "fast")
    assert floor.session.selected.address == "a"
    await opening
    assert floor.session.selected_bus == "fast"
    await floor.session.close()


async def test_a_bus_that_was_closed_before_its_turn_is_not_selected(tmp_path):
    floor = Floor(tmp_path, dead=-3.0, fast=0.5)
    opening = asyncio.create_task(floor.session.open_all(["/dead", "/fast"], lambda number, why: None))
    await asyncio.sleep(1.0)
    await floor.session.run("/close fast")
    await opening
    assert floor.session.selected_bus == "" and not floor.session.buses
    await floor.session.close()


async def test_a_dead_url_holds_back_no_other_and_is_reported(tmp_path):
    floor, failures = Floor(tmp_path, dead=-30.0, fast=0.5), []
    opening = asyncio.create_task(
        floor.session.open_all(["/dead", "nonsense", "/fast"], lambda number, why: failures.append((number, str(why))))
    )
    await asyncio.sleep(1.0)
    assert [number for number, _ in failures] == [1]
    await floor.session.run("@fast:a PR P")
    await opening
    assert failures[1:] == [(0, "dead: no such port")]
    assert floor.session.selected_bus == "fast"
    await floor.session.close()


async def test_without_a_receiver_the_first_failure_ends_the_others_and_closes_what_is_open(tmp_path):
    floor = Floor(tmp_path, fast=0.5, dead=-1.0, slow=60.0)
    with pytest.raises(Unreachable, match="no such port"):
        await floor.session.open_all(["/fast", "/dead", "/slow"])
    assert floor.under_way == 0
    await floor.session.close()
    assert all(bus.closed for bus in floor.buses.values())


async def test_a_wrong_url_is_an_error_before_anything_is_opened(tmp_path):
    floor = Floor(tmp_path, fast=0.5)
    with pytest.raises(Diagnostic):
        await floor.session.open_all(["/fast", "nonsense"])
    assert floor.buses == {} and floor.session.buses == {}


async def test_an_interruption_ends_every_opening(tmp_path):
    floor = Floor(tmp_path, one=30.0, two=30.0, fast=0.5)
    opening = asyncio.create_task(floor.session.open_all(["/one", "/fast", "/two"]))
    await asyncio.sleep(1.0)
    opening.cancel()
    with pytest.raises(asyncio.CancelledError):
        await opening
    assert floor.under_way == 0
    await floor.session.close()


async def test_a_stop_while_others_are_being_opened_reaches_the_open_ones(tmp_path):
    floor = Floor(tmp_path, slow=30.0, fast=0.5)
    opening = asyncio.create_task(floor.session.open_all(["/slow", "/fast"]))
    await asyncio.sleep(1.0)
    floor.session.stop()
    assert floor.buses["fast"].stops == 1
    opening.cancel()
    await asyncio.gather(opening, return_exceptions=True)
    await floor.session.close()


async def test_a_stop_before_a_line_is_open_is_not_said_to_reach_it_and_is_the_first_to_be_sent_there(tmp_path):
    async def slow(connection, naming):
        await asyncio.sleep(5.0)
        opened = await open_buses(connection, naming)
        for placed in opened[0].floor.floor.drives:
            placed.device.execute("SL 5000", opened[0].floor.now())
        return opened

    cell = CellSession(tmp_path, bus("press", party("a", ES=1), party("b", ES=3)), opener=slow)
    opening = asyncio.create_task(cell.session.open(cell.url))
    await asyncio.sleep(1.0)
    cell.session.stop("Ctrl+X")
    assert cell.told()[0] == "Ctrl+X: stop not sent to every drive; macros and scripts wait for /resume"
    assert cell.warned() == [
        f"{cell.url}: stop not sent (still being opened): the stop is the first to be sent if it opens - use the E-stop"
    ]
    assert cell.session.tally().urgent and "(still being opened)" in stop_report.words(cell.session.tally())
    await opening
    assert cell.written("press").startswith(b"\x1b")
    assert "press: the stop that came while it was being opened was sent first" in cell.told()
    await cell.session.buses["press"].stopped()
    assert not cell.moving() and cell.session.tally().stand
    await cell.session.close()


async def test_a_stop_before_an_opening_is_not_for_it(tmp_path):
    floor = Floor(tmp_path, late=3.0, never=-3.0)
    floor.session.stop()
    opening = asyncio.create_task(floor.session.open("/late"))
    await asyncio.sleep(1.0)
    assert stop_report.words(floor.session.tally()) == "no drive is open"
    await opening
    assert floor.buses["late"].stops == 0
    with pytest.raises(Unreachable):
        await floor.session.open("/never")
    floor.session.stop()
    assert floor.session.tally().found and not floor.session.opening
    await floor.session.close()


async def test_equal_names_are_given_in_the_order_of_the_urls_and_again_after_a_failure(tmp_path):
    floor = Floor(tmp_path, **{"a/x": 2.0, "b/x": 1.0})
    await floor.session.open_all(["/a/x", "/b/x"])
    assert list(floor.session.buses) == ["x", "x-2"] and floor.buses["a/x"].name == "x"
    await floor.session.close()
    floor.takes = {"a/x": -1.0, "b/x": 1.0}
    with pytest.raises(Unreachable):
        await floor.session.open("/a/x")
    await floor.session.open("/b/x")
    assert list(floor.session.buses) == ["x"]
    await floor.session.close()


async def test_a_name_that_another_opening_took_meanwhile_is_not_given_twice(tmp_path):
    floor = Floor(tmp_path, **{"a/x": 2.0, "b/x": 1.0, "c/x": 3.0})
    await asyncio.gather(*(floor.session.open(url) for url in ("/a/x", "/b/x", "/c/x")))
    assert sorted(floor.session.buses) == ["x", "x-2", "x-3"]
    assert len({bus.name for bus in floor.buses.values()}) == 3
    await floor.session.close()


async def test_drives_that_do_not_reply_close_their_bus_only(tmp_path):
    floor, failures = Floor(tmp_path, mute=0.5, fast=0.5), []

    async def mute(hints):
        raise NoAnswer("no drive replies")

    opener = floor.opener

    async def muted(connection, naming):
        [opened] = await opener(connection, naming)
        if connection.target == "/mute":
            opened.bus.identify = mute
        return [opened]

    session = Session(floor.session.settings, muted)
    await session.open_all(["/mute", "/fast"], lambda number, why: failures.append((number, str(why))))
    assert failures == [(0, "no drive replies")] and floor.buses["mute"].closed
    assert list(session.buses) == ["fast"] and session.selected_bus == "fast"
    await session.close()


async def test_lines_of_one_host_are_named_by_their_ports(tmp_path):
    floor = Floor(tmp_path, **{"5031": 0.1, "5032": 0.2, "5033": 0.1})
    await floor.session.open_all(["tcp://cell:5031", "tcp://cell:5032"])
    assert list(floor.session.buses) == ["cell-5031", "cell-5032"]
    await floor.session.open("tcp://cell:5033")
    await floor.session.open("tcp://cell:5033", "spare")
    await floor.session.open("tcp://cell:5033")
    assert list(floor.session.buses)[2:] == ["cell", "spare", "cell-5033"]
    await floor.session.close()


@pytest.mark.parametrize(
    ("labels", "addresses", "names"),
    [
        ({"a": "left"}, ["a"], ["left"]),
        ({"a": "left"}, ["z"], ["left"]),
        ({"a": "left"}, ["a", "z"], ["left", ""]),
        ({"a": "left", "b": "right"}, ["z"], [""]),
        ({"a": "left", "b": "right"}, ["b", "a"], ["right", "left"]),
        ({}, ["a"], [""]),
    ],
)
async def test_a_drive_has_the_name_of_its_address_and_a_sole_one_the_sole_name(labels, addresses, names):
    drives = {each: SimpleNamespace(address=each, label="old") for each in addresses}
    label(SimpleNamespace(drives=drives), SimpleNamespace(labels=labels))
    assert [each.label for each in drives.values()] == names


async def test_a_line_while_the_drives_are_looked_for_is_not_said_to_be_for_a_closed_bus(tmp_path):
    (tmp_path / "cell.toml").write_text(bus("press", party("a")))
    session = Session(Settings({}, tmp_path / "c", tmp_path / "s"))
    opening = asyncio.ensure_future(session.open(f"sim:{tmp_path / 'cell.toml'}"))
    while not session.buses:
        await asyncio.sleep(0.001)
    with pytest.raises(Diagnostic, match="no bus is ready yet") as caught:
        await session.run("SL 20000")
    assert "press is being opened" in str(caught.value)
    await opening
    await session.run("PR P")
    await session.close()
