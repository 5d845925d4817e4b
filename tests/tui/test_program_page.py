"""The program page: a file is edited, checked, saved, and sent to a drive by lines that a person sees."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
from textual import events
from textual.pilot import Pilot

from multidrop.families.lexium.host.mcode.debugging import MCodeDebugging
from multidrop.shell.events import Phase, ProgramRead, ProgramSeen
from multidrop.shell.state.backups import Copy, Drafts
from multidrop.tui.app import MultidropApp
from multidrop.tui.screens.dialogs import Confirm, SearchDialog
from multidrop.tui.screens.program import ProgramPage
from multidrop.tui.texts import OpenText
from tests.support.fake_session import FakeAssist, FakeSession, demo_session, settle, toasts
from tests.support.real_screen import real_screen, until
from tests.support.until import PATIENCE

pytestmark = pytest.mark.tui

TEXT = "PG 1\nLB G1\n MR 5 ' go\n E\nPG\n"
KEYS = frozenset({"enter", "escape", "up", "down", "end", "backspace"})
ROWS = ((1, "LB G1"), (6, "MR 5"), (11, "E"))


class KeepingAssist(FakeAssist):
    """With copies of texts that were not saved."""

    def __init__(self, folder: Path) -> None:
        super().__init__()
        self.folder = folder

    def drafts(self) -> Drafts:
        return Drafts(self.folder / "state")


@asynccontextmanager
async def page(folder: Path, *, file: str = "a.mxt", size: tuple[int, int] = (80, 24)) -> AsyncIterator[Pilot[int]]:
    """The page with a file open."""
    session = demo_session()
    app = MultidropApp(session, [], KeepingAssist(folder))
    async with app.run_test(size=size) as pilot:
        if file:
            app.texts.open(file)
        typed(pilot, "ctrl+e")
        await until(pilot, lambda: isinstance(app.screen, ProgramPage if file else SearchDialog))
        await settle(pilot)
        yield pilot


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("multidrop.tui.screens.program.CHECK_DELAY", 0.02)
    (tmp_path / "a.mxt").write_text(TEXT)
    return tmp_path


async def asked(pilot: Pilot[int]) -> None:
    """Wait for a question that has the focus: it takes no key before."""
    await until(pilot, lambda: isinstance(pilot.app.screen, Confirm) and pilot.app.screen.focused is not None)


def typed(pilot: Pilot[int], *pieces: str) -> None:
    """Keys by name and texts as pastes, without a pause between them."""
    for piece in pieces:
        key = piece in KEYS or "+" in piece
        pilot.app.post_message(events.Key(piece, None) if key else events.Paste(piece))


def shown(pilot: Pilot[int]) -> ProgramPage:
    found = next(each for each in pilot.app.screen_stack if isinstance(each, ProgramPage))
    assert isinstance(found, ProgramPage)
    return found


def session_of(pilot: Pilot[int]) -> FakeSession:
    assert isinstance(pilot.app, MultidropApp) and isinstance(pilot.app.session, FakeSession)
    return pilot.app.session


def sent(pilot: Pilot[int]) -> list[str]:
    return [line for line, _ in session_of(pilot).lines]


async def test_what_is_typed_is_in_the_text_and_ctrl_s_saves_it(folder: Path) -> None:
    async with page(folder) as pilot:
        typed(pilot, "end", "enter", "P=0")
        await until(pilot, lambda: "changed, not saved" in shown_heading(pilot))
        typed(pilot, "ctrl+s")
        await until(pilot, lambda: (folder / "a.mxt").read_text() == TEXT.replace("PG 1\n", "PG 1\nP=0\n"))
        await until(pilot, lambda: "changed" not in shown_heading(pilot))
        assert sent(pilot) == []


def shown_heading(pilot: Pilot[int]) -> str:
    for _ in range(3):
        pilot.app.tick()  # type: ignore[attr-defined]
    page = shown(pilot)
    page.take_text()
    if page.view is not None:
        page.show(page.view)
    return page.lines("heading").plain


async def test_an_error_is_found_marked_and_gone_to(folder: Path) -> None:
    async with page(folder) as pilot:
        typed(pilot, "ctrl+end", "up", "up", "end", "K9")
        await until(pilot, lambda: any(each.line == 4 for each in shown(pilot).findings.problems))
        await settle(pilot)
        assert "✗ 1 error" in shown_heading(pilot) and "4:2" in shown(pilot).lines("below").plain
        assert "✗" in shown(pilot).editor.render_line(3).text
        typed(pilot, "ctrl+home", "ctrl+f")
        await until(pilot, lambda: shown(pilot).editor.cursor_location == (3, 1))
        typed(pilot, "end", "backspace", "backspace")
        await until(pilot, lambda: not shown(pilot).findings.problems and not shown(pilot).findings.pending)


async def test_the_text_survives_a_stop_and_leaving_the_page(folder: Path) -> None:
    async with page(folder) as pilot:
        typed(pilot, "ctrl+end", "' mine")
        await until(pilot, lambda: "mine" in shown(pilot).editor.text)
        typed(pilot, "ctrl+x")
        await settle(pilot)
        assert session_of(pilot).stops == 1 and isinstance(pilot.app.screen, ProgramPage)
        typed(pilot, "escape")
        await settle(pilot)
        typed(pilot, "ctrl+e")
        await until(pilot, lambda: isinstance(pilot.app.screen, ProgramPage))
        assert shown(pilot).editor.text == TEXT + "' mine" and (folder / "a.mxt").read_text() == TEXT


async def test_a_copy_is_kept_while_a_text_is_not_saved(folder: Path) -> None:
    drafts = Drafts(folder / "state")
    async with page(folder) as pilot:
        typed(pilot, "ctrl+end", "' mine")
        await until(pilot, lambda: drafts.find("a.mxt") is not None)
        found = drafts.find("a.mxt")
        assert found is not None and found.text == TEXT + "' mine"
        typed(pilot, "ctrl+s")
        await until(pilot, lambda: drafts.find("a.mxt") is None)


async def test_the_end_of_the_app_keeps_a_copy_of_the_last_keys(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("multidrop.tui.screens.program.CHECK_DELAY", 1000.0)
    async with page(folder) as pilot:
        typed(pilot, "ctrl+end", "' last")
        await until(pilot, lambda: shown(pilot).editor.text.endswith("' last"))
        assert Drafts(folder / "state").find("a.mxt") is None
    found = Drafts(folder / "state").find("a.mxt")
    assert found is not None and found.text.endswith("' last")


async def test_a_copy_of_an_earlier_session_is_offered(folder: Path) -> None:
    Drafts(folder / "state").keep(Copy("a.mxt", "' of yesterday\n", "2026-11-21 22:10"))
    async with page(folder, file="") as pilot:
        typed(pilot, "a.mxt", "enter")
        await asked(pilot)
        typed(pilot, "enter")
        await until(pilot, lambda: shown(pilot).editor.text == "' of yesterday\n")
        assert (folder / "a.mxt").read_text() == TEXT


async def test_a_file_that_changed_meanwhile_is_asked_about(folder: Path) -> None:
    async with page(folder) as pilot:
        typed(pilot, "ctrl+end", "' mine")
        (folder / "a.mxt").write_text("another's\n")
        typed(pilot, "ctrl+s")
        await asked(pilot)
        typed(pilot, "enter")
        await settle(pilot)
        assert (folder / "a.mxt").read_text() == "another's\n"
        typed(pilot, "ctrl+s")
        await asked(pilot)
        typed(pilot, "down", "enter")
        await until(pilot, lambda: (folder / "a.mxt").read_text() == TEXT + "' mine")


async def test_quitting_names_what_is_not_saved(folder: Path) -> None:
    async with page(folder) as pilot:
        typed(pilot, "ctrl+end", "' mine")
        typed(pilot, "ctrl+q")
        await asked(pilot)
        assert isinstance(pilot.app.screen, Confirm)
        assert any("a.mxt is not saved" in line for line in pilot.app.screen.lines)


async def test_a_download_is_a_typed_line_after_a_question_and_saves_before(folder: Path) -> None:
    async with page(folder) as pilot:
        typed(pilot, "ctrl+end", "' mine", "ctrl+d")
        await asked(pilot)
        typed(pilot, "escape", "ctrl+r", "escape", "ctrl+d")
        await settle(pilot)
        await asked(pilot)
        assert sent(pilot) == [] and (folder / "a.mxt").read_text() == TEXT
        typed(pilot, "down", "enter")
        await until(pilot, lambda: sent(pilot) == ["/download a.mxt press:a"])
        assert (folder / "a.mxt").read_text().endswith("' mine")


async def test_a_program_is_run_or_traced_from_a_label_by_the_line_that_is_shown(folder: Path) -> None:
    async with page(folder) as pilot:
        typed(pilot, "ctrl+r", "run g1", "enter")
        await until(pilot, lambda: sent(pilot) == ["@press:a EX G1"])
        typed(pilot, "ctrl+r", "un g1", "enter")  # it is inside `Run`, and no word begins so
        await settle(pilot)
        assert len(sent(pilot)) == 1
        typed(pilot, "escape", "ctrl+r", "trace", "enter")
        await until(pilot, lambda: sent(pilot)[1:] == ["/trace press:a G1"])


async def test_single_step_is_not_offered_where_the_drive_cannot(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(MCodeDebugging, "cannot_step", "single step needs bare keys")
    async with page(folder) as pilot:
        typed(pilot, "ctrl+r")
        await until(pilot, lambda: isinstance(pilot.app.screen, SearchDialog))
        assert isinstance(pilot.app.screen, SearchDialog)
        offered = [match.text.plain.split()[0] for match in pilot.app.screen.found]
        assert "Run" in offered and "Trace" in offered and "Step" not in offered
        typed(pilot, "escape", "ctrl+t")
        await until(pilot, lambda: "single step needs bare keys" in "".join(toasts(pilot.app)))  # type: ignore[arg-type]
        assert sent(pilot) == []


async def test_the_line_that_is_executed_and_the_break_point_are_in_the_gutter(folder: Path) -> None:
    async with page(folder, size=(120, 40)) as pilot:
        session_of(pilot).emit(ProgramRead(67.0, "press", "a", ROWS))
        await until(pilot, lambda: bool(shown(pilot).findings.addresses))
        session_of(pilot).emit(ProgramSeen(67.0, "press", "a", 8, Phase.BEFORE, "G1"))
        await settle(pilot)
        editor = shown(pilot).editor
        assert editor.render_line(2).text.startswith("║") and editor.render_line(1).text.startswith("●")
        assert "waits before 8" in shown(pilot).lines("program-side").plain
        session_of(pilot).gate = asyncio.Event()
        typed(pilot, "ctrl+t", "ctrl+t", "ctrl+t")
        await settle(pilot)
        assert sent(pilot) == ["/step press:a"]  # one, however often it is pressed before that is done
        session_of(pilot).gate.set()
        session_of(pilot).emit(ProgramSeen(67.0, "press", "a", None))
        await settle(pilot)
        assert not editor.render_line(2).text.startswith("║")


async def test_a_break_point_is_set_at_a_label_or_an_address_and_removed_there(folder: Path) -> None:
    async with page(folder) as pilot:
        typed(pilot, "down", "ctrl+b")
        await until(pilot, lambda: sent(pilot) == ["/break press:a G1"])
        session_of(pilot).emit(ProgramSeen(67.0, "press", "a", None, Phase.EXECUTES, "G1"))
        session_of(pilot).emit(ProgramRead(67.0, "press", "a", ROWS))
        await until(pilot, lambda: bool(shown(pilot).findings.addresses))
        typed(pilot, "ctrl+b", "down", "ctrl+b")
        await until(pilot, lambda: sent(pilot)[1:] == ["/break press:a off", "/break press:a 6"])


def disk_that_hangs(app: MultidropApp) -> threading.Event:
    """Let every file wait until the event is set."""
    read, gate = app.texts.open, threading.Event()

    def hangs(name: str) -> OpenText:
        gate.wait(PATIENCE)
        return read(name)

    app.texts.open = hangs  # type: ignore[method-assign]
    return gate


@pytest.mark.real
async def test_keys_that_are_typed_while_a_slow_disk_reads_the_file_wait_for_it(folder: Path) -> None:
    async with page(folder, file="") as pilot:
        app = pilot.app
        assert isinstance(app, MultidropApp)
        gate = disk_that_hangs(app)
        try:
            typed(pilot, "a.mxt", "enter", "end", "Z")
            await until(pilot, lambda: isinstance(app.screen, ProgramPage))
            await until(pilot, lambda: app.keyboard.idle or app.keyboard.held)
            assert not app.keyboard.idle
        finally:
            gate.set()
        await until(pilot, lambda: shown(pilot).editor.text == TEXT.replace("PG 1", "PG 1Z", 1))


@pytest.mark.real
async def test_who_leaves_the_page_while_a_disk_hangs_has_the_keys_again(folder: Path) -> None:
    async with page(folder, file="") as pilot:
        app = pilot.app
        assert isinstance(app, MultidropApp)
        gate = disk_that_hangs(app)
        try:
            typed(pilot, "a.mxt", "enter")
            await until(pilot, lambda: isinstance(app.screen, ProgramPage))
            typed(pilot, "escape")
            await until(pilot, lambda: app.screen is app.main)
            typed(pilot, "PR P")
            await until(pilot, lambda: app.main.entry.value == "PR P")
        finally:
            gate.set()
        await settle(pilot)
        assert app.screen is app.main and app.main.entry.value == "PR P"


async def test_what_is_no_text_is_refused_and_what_the_drive_holds_is_read_into_a_new_file(folder: Path) -> None:
    (folder / "b.mxt").write_bytes(b"\0\1")
    async with page(folder, file="") as pilot:
        typed(pilot, "b.mxt", "enter")
        await until(pilot, lambda: any("not a text file" in each.text for each in pilot.app.last_records(9)))  # type: ignore[attr-defined]
        assert shown(pilot).text is None
        typed(pilot, "ctrl+e", "down", "down", "enter", "enter")
        await until(pilot, lambda: bool(sent(pilot)))
        assert sent(pilot)[0].startswith("/upload press-a-20261121-") and sent(pilot)[0].endswith(".mxt press:a")


async def test_a_paste_of_control_characters_cannot_reach_the_terminal(folder: Path) -> None:
    async with page(folder) as pilot:
        pilot.app.post_message(events.Paste("\x1b[2J\r\n' ok\x85"))
        await until(pilot, lambda: "' ok" in shown(pilot).editor.text)
        assert "\x1b" not in shown(pilot).editor.text
        assert all(each.isprintable() for each in shown(pilot).editor.render_line(0).text)


# On a real session with a simulated drive: an error is made and mended, then the program runs and is stopped.

LONG = "PG 1\nLB G1\n MA 5120000\n H\n MA 0\n H\n BR G1\n E\nPG\n"


@pytest.mark.slow
async def test_a_program_is_mended_downloaded_traced_and_stopped(folder: Path) -> None:
    (folder / "long.mxt").write_text(LONG)
    async with real_screen(folder, "sim:#eth") as pilot:
        app = pilot.app
        assert isinstance(app, MultidropApp)
        session = app.session
        await until(pilot, lambda: session.selected is not None)
        typed(pilot, "ctrl+e")
        await until(pilot, lambda: isinstance(app.screen, SearchDialog))
        typed(pilot, "long", "enter")
        await until(pilot, lambda: isinstance(app.screen, ProgramPage))
        page = app.screen
        assert isinstance(page, ProgramPage)
        typed(pilot, "end", "Z")
        await until(pilot, lambda: bool(page.findings.problems))
        typed(pilot, "backspace")
        await until(pilot, lambda: not page.findings.problems and not page.findings.pending)
        typed(pilot, "ctrl+d")
        await until(pilot, lambda: isinstance(app.screen, Confirm))
        typed(pilot, "down", "enter")
        await until(pilot, lambda: len(page.findings.addresses) == 7)
        typed(pilot, "ctrl+r")
        await until(pilot, lambda: isinstance(app.screen, SearchDialog))
        typed(pilot, "trace g1", "enter")
        await until(pilot, lambda: "▶" in page.editor.render_line(3).text)
        await until(pilot, lambda: "executes" in page.lines("below").plain)
        await until(pilot, lambda: "▶ moving" in page.lines("top").plain)
        typed(pilot, "ctrl+x")
        await until(pilot, lambda: "velocity 0" in page.query_one(".banner").plain)  # type: ignore[attr-defined]
        await until(pilot, lambda: "▶" not in page.editor.render_line(3).text)
        assert app.screen is page and page.editor.text == LONG
        assert next(iter((folder / "data" / "backups").iterdir())).suffix == ".mxt"


WRONG = """own_units = 3
foo = 1
[connections."a b"]
url = "sim:"
[connections.-x]
url = "sim:"
[screen]
theme = "no-such"
[keys]
nothing = "^D"
[log]
files = -1
"""


async def test_the_configuration_page_shows_all_errors_with_their_lines(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MULTIDROP_CONFIG_DIR", str(folder))
    (folder / "multidrop.toml").write_text(WRONG)
    async with page(folder, file=str(folder / "multidrop.toml"), size=(100, 40)) as pilot:
        await until(pilot, lambda: "files" in shown(pilot).lines("below").plain)
        told = shown(pilot).lines("below").plain.splitlines()
        places = [line.split()[1] for line in told if line.strip().startswith("✗")]
        assert places == ["1:1", "2:1", "3:1", "5:1", "8:1", "10:1", "12:1"], told
        assert not any("more; ^L" in line for line in told)
