"""Why a drive is in trouble: two keys from the main screen, for every family; nothing is read that a reading clears."""

import asyncio
from contextlib import AsyncExitStack
from pathlib import Path

import pytest

from multidrop.drives.events import Conditioned, Silent
from multidrop.shell.events import OnBus
from multidrop.simulator.cells import load
from multidrop.simulator.floor import Floor
from multidrop.simulator.serving.endpoints import serve_bus
from multidrop.simulator.serving.running import RunningFloor
from multidrop.tui.panels.view import View, glances_of
from multidrop.tui.screen_model import ScreenModel
from multidrop.tui.screens.why import WhyPage, error_lines, facts, helping
from tests.support.cases import for_each
from tests.support.cell_session import ETHERNET, CellSession, bus, drive, party, pmx
from tests.support.fake_session import AT_LIMIT, a_move, a_talk, demo_session, emit, on_screen, press, readable
from tests.support.pty_screen import demo
from tests.support.real_screen import real_screen, until

LIMIT = "[bus.drive.world]\nlimit_plus = 100000"
KEYS = ("ctrl+a", "enter")
"""The job "why it is the worst"."""


def shown(app) -> str:
    return "\n".join(app.screen.lines(name).plain for name in ("heading", "why", "helps"))


@pytest.mark.tui
@pytest.mark.parametrize("size", [(80, 24), (120, 40)])
async def test_two_keys_say_why_the_worst_drive_is_in_trouble(size: tuple[int, int]) -> None:
    async with on_screen(demo_session(), *size) as (pilot, app, session):
        session.buses["pmx"].lost = None
        read = [each for each in a_move(session) if not isinstance(each.event, Silent)]
        await emit(pilot, *read, *a_talk(session))
        await press(pilot, *KEYS)
        assert isinstance(app.screen, WhyPage) and session.place == ("press", "b")
        page = shown(app)
        for text in ("press:b clamp", "PR ER shows and clears it", "EF=1", "2 lim+ ●", "@b PR VX", "last 20 s"):
            assert text in page, text
        assert [row.split()[0] for row in app.screen.lines("helps").plain.split("\n")[1:]] == ["r", "^N", "^E"]
        assert session.lines == [], "nothing was sent"
        await press(pilot, "escape")
        assert app.screen is app.main


@pytest.mark.tui
async def test_the_error_is_read_by_a_key_and_enter_and_the_stop_goes_first() -> None:
    async with on_screen(demo_session(), 80, 24) as (pilot, app, session):
        session.emit(*a_move(session), OnBus("press", Conditioned(session.time, "b", (AT_LIMIT,))))
        session.select("b", "press")
        await press(pilot, *"/page why", "enter")
        readable(pilot)
        session.lines.clear()
        await press(pilot, "enter")
        assert session.lines == []
        await press(pilot, "r")
        assert "Enter sends PR ER" in shown(app) and session.lines == []
        await press(pilot, "ctrl+x")
        assert session.stops == 1 and isinstance(app.screen, WhyPage)
        await press(pilot, "enter")
        assert session.lines == [] and "a stop or another drive came" in shown(app)
        await press(pilot, "r", "escape", "enter", "r")
        await press(pilot, "enter")
        assert [line for line, _ in session.lines] == ["PR ER"]


@pytest.mark.tui
@pytest.mark.pty
async def test_an_enter_typed_before_the_line_was_seen_reads_no_error() -> None:
    async with demo() as (screen, session, _):
        session.emit(*a_move(session), OnBus("press", Conditioned(session.time, "b", (AT_LIMIT,))))
        await screen.type(b"\x01", b"/clamp\r")
        assert isinstance(screen.app.screen, WhyPage) and session.place == ("press", "b")
        await screen.type(b"r\r")
        assert session.lines == []


@pytest.mark.tui
@pytest.mark.pty
async def test_both_keys_of_one_read_count() -> None:
    async with demo() as (screen, session, _):
        session.buses["pmx"].lost = None
        read = [each for each in a_move(session) if not isinstance(each.event, Silent)]
        session.emit(*read)
        await screen.type(b"\x01\r")
        assert isinstance(screen.app.screen, WhyPage) and session.place == ("press", "b")


class Looked(CellSession):
    """A cell with one drive that is polled for a screen."""

    async def __aenter__(self) -> "Looked":
        await super().__aenter__()
        session = self.session
        self.model = ScreenModel(lambda: session.selected_bus, lambda: session.buses)
        session.subscribe(self.model.take)
        (self.bus,) = session.buses.values()
        for begin in (self.bus.telemetry.subscribe, self.bus.telemetry.watch):
            begin([*self.bus.drives], 0.5)
        return self

    async def texts(self, *lines: str) -> dict[str, str]:
        """The facts a while after lines, which may fail."""
        for line in lines:
            await asyncio.wait([self.session.start(line)])
        await asyncio.sleep(8)
        session, now = self.session, self.session.now()
        view = View(session, self.model, glances_of(session, self.model, self.bus), now, True)
        assert view.chosen is not None and session.selected is not None
        self.view, self.drive = view, session.selected
        return {label: text for label, text, _ in facts(view, view.chosen, self.drive)}

    @property
    def lines(self) -> tuple[str, ...]:
        assert self.view.chosen is not None
        return error_lines(self.drive, self.view.chosen.readout.axes)


MCODE = ["IS=2,2,1", "MR 300000"]


@pytest.mark.virtual
@for_each(
    "made, lines, clears",
    [
        (party("a", LIMIT), MCODE, "PR ER"),
        (ETHERNET + "\n" + LIMIT, MCODE, "PR ER"),
        (drive("MDIE", "!", LIMIT), ["S2=2,1", "MR 300000"], "PR ER"),
        (pmx("00", "[bus.drive.world.x]\nlimit_plus = 1000"), ["X30000"], "CLRX"),
    ],
)
async def test_a_limit_has_its_line_that_clears_it_and_the_controls_help(
    tmp_path: Path, made: str, lines: list[str], clears: str
) -> None:
    async with Looked(tmp_path, bus("line", made)) as cell:
        found = await cell.texts(*lines)
        assert cell.lines == (clears,) and cell.view.chosen is not None
        assert [key for key, _ in helping(cell.view.chosen, cell.drive)][:2] == ["r", "^N"]
        assert ("EF=1" in found) == (clears == "PR ER")
        if clears == "PR ER":
            found = await cell.texts("PR ER")
            assert "error 83: plus limit reached; move in the minus direction" in found["last error"]
            assert "EF=1" not in found and not cell.lines
            assert any("of 300000: error 83: plus limit reached" in text for text in cell.told())


@pytest.mark.virtual
async def test_a_module_without_error_numbers_says_so_and_a_silent_drive_since_when(tmp_path: Path) -> None:
    async with Looked(tmp_path, bus("line", drive("TMCM"))) as cell:
        assert (await cell.texts())["error"] == "a module has no error to read: each refusal says its own"
        cell.world("unplug line")
        found = await cell.texts()
        assert "lost" in found or "no reply since" in found["silent"]
        assert ("t", "traffic: what is sent and received on the line") in helping(cell.view.glances[0], cell.drive)


@pytest.mark.virtual
async def test_a_refusal_is_the_last_error_and_a_program_without_a_line_says_so(tmp_path: Path) -> None:
    program = 'program_text = """PG 1\nLB G1\nH 40\nBR G1\nE\nPG\n"""'
    async with Looked(tmp_path, bus("line", party("a", program))) as cell:
        assert (await cell.texts())["program"] == "not running"
        found = await cell.texts("ZZ", "EX G1")
        assert "error 60: unknown command" in found["last error"]
        assert found["program"] == "runs; its line is not reported"
        assert not any(b"ER" in data for data in [cell.written("line").partition(b"EX")[2]])


@pytest.mark.tui
async def test_two_keys_on_a_real_session_read_no_error(tmp_path: Path) -> None:
    (tmp_path / "cell.toml").write_text(bus("press", party("a"), party("b", LIMIT), baud=0))
    async with real_screen(tmp_path, f"sim:{tmp_path / 'cell.toml'}", (120, 40)) as pilot:
        app = pilot.app
        await until(pilot, lambda: "press" in app.session.buses and app.session.selected)
        for line in ("@b IS=2,2,1", "@b MR 300000"):
            await pilot.press(*line, "enter")
        await until(pilot, lambda: app.model.bus("press").readout("b").in_trouble)
        await pilot.press(*KEYS)
        assert isinstance(app.screen, WhyPage)
        await until(pilot, lambda: "EF=1" in shown(app) and "lim+ ●" in shown(app))
        assert app.session.buses["press"].drives["b"].state.last_error == 0


@pytest.mark.tui
async def test_over_modbus_the_page_says_the_error_too_and_reads_none(tmp_path: Path) -> None:
    served = bus("eth", f"{ETHERNET}\n{LIMIT}", baud=0, serve=["modbus://127.0.0.1:0"])
    (tmp_path / "cell.toml").write_text(served)
    async with AsyncExitStack() as stack:
        floor = RunningFloor(Floor(load(tmp_path / "cell.toml")))
        stack.callback(floor.close)
        ((url, *_),) = [await serve_bus(floor, each, stack) for each in floor.floor.cell.buses]
        pilot = await stack.enter_async_context(real_screen(tmp_path, url.endpoint, (120, 40)))
        app = pilot.app
        await until(pilot, lambda: app.session.buses and app.session.selected)
        (name,) = app.session.buses
        for line in ("IS=2,2,1", "MR 300000"):
            await pilot.press(*line, "enter")
        await until(pilot, lambda: app.model.bus(name).readout("").in_trouble)
        await pilot.press(*KEYS)
        assert isinstance(app.screen, WhyPage)
        await until(pilot, lambda: "PR ER" in shown(app))
        assert app.session.buses[name].drives[""].state.last_error == 0
