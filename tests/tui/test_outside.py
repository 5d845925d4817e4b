"""Files that another program changes while a text of theirs is on the screen: what is shown is what is sent."""

from __future__ import annotations

import asyncio
import os
import threading
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
from textual import events
from textual.pilot import Pilot

from multidrop.base.errors import Diagnostic
from multidrop.shell.events import Phase, ProgramRead, ProgramSeen
from multidrop.shell.programs.edited_file import EditedFile, Outside
from multidrop.shell.state.backups import Copy, Drafts
from multidrop.tui.app import MultidropApp
from multidrop.tui.screens import program_file
from multidrop.tui.screens.dialogs import ChoiceList, Confirm, SearchDialog
from multidrop.tui.screens.macros import MacrosPage
from multidrop.tui.screens.parameters import ParametersPage
from multidrop.tui.screens.program import ProgramPage
from tests.support.fake_session import FakeAssist, FakeSession, demo_session, on_screen, settle, toasts
from tests.support.real_screen import real_screen, until
from tests.support.until import PATIENCE

pytestmark = pytest.mark.tui

TEXT = "PG 1\nLB G1\n MR 51200\n E\nPG\n"
OTHER = TEXT.replace("51200", "999999")
KEYS = frozenset({"enter", "escape", "up", "down", "end", "f3"})


class KeepingAssist(FakeAssist):
    """With copies of texts that were not saved."""

    def __init__(self, folder: Path) -> None:
        super().__init__()
        self.folder = folder

    def drafts(self) -> Drafts:
        return Drafts(self.folder / "state")


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("multidrop.tui.screens.program.CHECK_DELAY", 0.02)
    monkeypatch.setattr("multidrop.tui.terminal.keyboard.DEAF_TIME", 0.0)  # nobody types before a box is seen, here
    (tmp_path / "a.mxt").write_text(TEXT)
    return tmp_path


@asynccontextmanager
async def page(folder: Path, size: tuple[int, int] = (80, 24)) -> AsyncIterator[Pilot[int]]:
    app = MultidropApp(demo_session(), [], KeepingAssist(folder))
    async with app.run_test(size=size) as pilot:
        app.texts.open("a.mxt")
        await shown_again(pilot)
        yield pilot


async def shown_again(pilot: Pilot[int]) -> None:
    """Show the page, and wait until it has looked at the disk."""
    typed(pilot, "ctrl+e")
    await until(pilot, lambda: any(isinstance(each, ProgramPage) for each in pilot.app.screen_stack))
    await until(pilot, lambda: not pilot.app.keyboard.held)  # type: ignore[attr-defined]
    await settle(pilot)


def typed(pilot: Pilot[int], *pieces: str) -> None:
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


def sent(pilot: Pilot[int]) -> list[tuple[str, object]]:
    """The lines that were sent, each with the text that was shown of its file."""
    session = session_of(pilot)
    return list(zip([line for line, _ in session.lines], session.shown, strict=False))


def told(pilot: Pilot[int], words: str) -> int:
    """How many of the last lines of the transcript have these words."""
    pilot.app.tick()  # type: ignore[attr-defined]
    return sum(words in record.text for record in pilot.app.last_records(50))  # type: ignore[attr-defined]


async def question(pilot: Pilot[int], title: str) -> Confirm:
    """Wait for a question that has the focus: it takes no key before."""

    def asked() -> bool:
        box = pilot.app.screen
        return isinstance(box, Confirm) and title in box.heading and box.focused is not None

    await until(pilot, asked)
    assert isinstance(pilot.app.screen, Confirm)
    return pilot.app.screen


DOWNLOAD = "/download a.mxt press:a"


async def test_an_unchanged_file_is_downloaded_without_a_note_or_another_question(folder: Path) -> None:
    async with page(folder) as pilot:
        os.utime("a.mxt", (1, 1))  # touched: its content is as it was
        typed(pilot, "ctrl+d")
        asked = await question(pilot, "Download a.mxt")
        assert not [line for line in asked.lines if line.startswith("!")] and len(asked.answers) == 4
        typed(pilot, "down", "enter")
        await until(pilot, lambda: sent(pilot) == [(DOWNLOAD, TEXT)])
        assert not told(pilot, "on the disk") and (folder / "a.mxt").read_text() == TEXT


async def test_a_download_sends_the_text_on_the_screen_whatever_the_disk_has_by_then(folder: Path) -> None:
    async with page(folder) as pilot:
        typed(pilot, "ctrl+d")
        await question(pilot, "Download a.mxt")
        (folder / "a.mxt").write_text(OTHER)
        typed(pilot, "down", "enter")
        await until(pilot, lambda: sent(pilot) == [(DOWNLOAD, TEXT)])
        assert (folder / "a.mxt").read_text() == OTHER  # and nothing of another program's is overwritten


async def test_a_download_of_a_file_that_changed_shows_the_new_text_first(folder: Path) -> None:
    async with page(folder) as pilot:
        (folder / "a.mxt").write_text(OTHER)
        typed(pilot, "ctrl+d")
        asked = await question(pilot, "Download a.mxt")
        assert shown(pilot).editor.text == OTHER and "Line 3 is now 'MR 999999'" in asked.lines[0]
        assert not any("the text on the screen is sent" in line for line in asked.lines)
        assert shown(pilot).editor.cursor_location == (2, 0)  # where it differs
        assert told(pilot, "a.mxt has changed on the disk: it was read again") == 1
        typed(pilot, "enter")  # the first answer sends nothing
        await until(pilot, lambda: isinstance(pilot.app.screen, ProgramPage))
        assert sent(pilot) == []
        typed(pilot, "ctrl+d")
        asked = await question(pilot, "Download a.mxt")
        assert not asked.lines[0].startswith("!")
        typed(pilot, "down", "enter")
        await until(pilot, lambda: sent(pilot) == [(DOWNLOAD, OTHER)])


async def test_a_text_with_errors_is_not_offered_for_a_download(folder: Path) -> None:
    async with page(folder) as pilot:
        typed(pilot, "ctrl+home", "K9\n", "ctrl+d")  # in one read: no check has come between
        words = "a.mxt has 1 error, so nothing is sent; ^F goes to the next error"
        await until(pilot, lambda: words in "".join(toasts(pilot.app)))  # type: ignore[arg-type]
        assert isinstance(pilot.app.screen, ProgramPage) and sent(pilot) == []


async def test_the_question_before_a_download_shows_each_line_whole_and_its_first_answer_sends_nothing(
    folder: Path,
) -> None:
    async with page(folder) as pilot:
        typed(pilot, "ctrl+d")
        asked = await question(pilot, "Download a.mxt")
        options = asked.query_one(ChoiceList)
        rows = [options.render_line(y).text.strip() for y in range(options.size.height)]
        assert rows == [
            "Cancel, send nothing",
            "Send it",
            "/download a.mxt press:a",
            "Send it; keep it at power-off",
            "/download a.mxt press:a --save",
            "Send it, only if it differs",
            "/download a.mxt press:a --only-changed",
        ]
        assert options.highlighted == 0
        typed(pilot, "enter")
        await until(pilot, lambda: isinstance(pilot.app.screen, ProgramPage))
        assert sent(pilot) == []


async def test_an_edited_text_is_saved_and_sent_as_it_was_shown(folder: Path) -> None:
    async with page(folder) as pilot:
        typed(pilot, "ctrl+end", "' mine", "ctrl+d")
        asked = await question(pilot, "Download a.mxt")
        assert "Save the file" in asked.answers[1][1]
        typed(pilot, "down", "enter")
        await until(pilot, lambda: sent(pilot) == [(DOWNLOAD, TEXT + "' mine")])
        assert (folder / "a.mxt").read_text() == TEXT + "' mine"


@pytest.mark.parametrize("answer", ["keep", "read"])
async def test_a_text_edited_here_and_elsewhere_is_a_question_before_a_download(folder: Path, answer: str) -> None:
    async with page(folder) as pilot:
        typed(pilot, "ctrl+end", "' mine")
        await until(pilot, lambda: "mine" in shown(pilot).editor.text)
        (folder / "a.mxt").write_text(OTHER)
        typed(pilot, "ctrl+d")
        asked = await question(pilot, "Which text?")
        assert "a.mxt has changed on the disk." in asked.lines[0]
        typed(pilot, *([] if answer == "keep" else ["down"]), "enter")
        await until(pilot, lambda: isinstance(pilot.app.screen, ProgramPage))
        assert sent(pilot) == [] and (folder / "a.mxt").read_text() == OTHER
        typed(pilot, "ctrl+d")
        asked = await question(pilot, "Download a.mxt")  # it is asked once
        if answer == "read":
            assert shown(pilot).editor.text == OTHER
            typed(pilot, "down", "enter")
            await until(pilot, lambda: sent(pilot) == [(DOWNLOAD, OTHER)])
            return
        assert "! The file has changed on the disk" in asked.lines[0]
        typed(pilot, "down", "enter")
        asked = await question(pilot, "Save?")
        assert "Nothing was saved or sent" in asked.lines[1]
        typed(pilot, "down", "enter")
        await until(pilot, lambda: (folder / "a.mxt").read_text() == TEXT + "' mine")
        assert sent(pilot) == []


@pytest.mark.parametrize("edit", [False, True])
async def test_a_file_that_changed_while_the_page_was_left_is_noticed_on_return(folder: Path, edit: bool) -> None:
    async with page(folder) as pilot:
        typed(pilot, "ctrl+end", *(["' mine"] if edit else []), "escape")
        await until(pilot, lambda: pilot.app.screen is pilot.app.main)  # type: ignore[attr-defined]
        (folder / "a.mxt").write_text(OTHER)
        await shown_again(pilot)
        if edit:
            await question(pilot, "Which text?")
            typed(pilot, "enter")
            await until(pilot, lambda: isinstance(pilot.app.screen, ProgramPage))
            assert shown(pilot).editor.text == TEXT + "' mine"
        else:
            assert isinstance(pilot.app.screen, ProgramPage) and shown(pilot).editor.text == OTHER
            assert told(pilot, "a.mxt has changed on the disk: it was read again") == 1


@pytest.mark.parametrize("edit", [False, True])
async def test_a_page_that_is_shown_again_asks_nothing_about_an_unchanged_file(folder: Path, edit: bool) -> None:
    async with page(folder) as pilot:
        typed(pilot, "ctrl+end", *(["' mine"] if edit else []), "escape")
        await until(pilot, lambda: pilot.app.screen is pilot.app.main)  # type: ignore[attr-defined]
        (folder / "a.mxt").write_text(TEXT)
        await shown_again(pilot)
        assert isinstance(pilot.app.screen, ProgramPage) and not told(pilot, "on the disk")
        assert shown(pilot).editor.text == TEXT + ("' mine" if edit else "")


async def test_a_file_that_is_opened_again_is_read_again(folder: Path) -> None:
    async with page(folder) as pilot:
        (folder / "b.mxt").write_text("' b\n")
        typed(pilot, "ctrl+e")
        await until(pilot, lambda: isinstance(pilot.app.screen, SearchDialog))
        typed(pilot, "b.mxt", "enter")
        await until(pilot, lambda: shown(pilot).editor.text == "' b\n")
        (folder / "a.mxt").write_text(OTHER)
        typed(pilot, "ctrl+e")
        await until(pilot, lambda: isinstance(pilot.app.screen, SearchDialog))
        typed(pilot, "a.mxt", "enter")
        await until(pilot, lambda: shown(pilot).editor.text == OTHER)
        assert told(pilot, "it was read again") == 1


async def test_what_another_program_saved_here_is_the_text_that_was_typed_here(folder: Path) -> None:
    async with page(folder) as pilot:
        typed(pilot, "ctrl+end", "' mine")
        await until(pilot, lambda: "mine" in shown(pilot).editor.text)
        (folder / "a.mxt").write_text(TEXT + "' mine")
        typed(pilot, "ctrl+d")
        asked = await question(pilot, "Download a.mxt")
        assert asked.answers[1][1].startswith("Send it\n")  # nothing to save


def a_folder(path: Path) -> None:
    path.unlink()
    path.mkdir()


@pytest.mark.parametrize(
    ("act", "note"),
    [
        (Path.unlink, "a.mxt is gone from the disk. Its text stays here; ^S saves it"),
        (a_folder, "a.mxt cannot be read again: is not a regular file. Its text stays here"),
        (lambda path: path.write_bytes(b"\0"), "a.mxt cannot be read again: is not a text file. Its text stays here"),
    ],
)
async def test_a_text_outlives_its_file(folder: Path, act: Callable[[Path], None], note: str) -> None:
    async with page(folder) as pilot:
        act(folder / "a.mxt")
        typed(pilot, "ctrl+d")
        await question(pilot, "Download a.mxt")
        assert told(pilot, note) == 1 and shown(pilot).editor.text == TEXT
        typed(pilot, "down", "enter")
        await until(pilot, lambda: sent(pilot) == [(DOWNLOAD, TEXT)])
        assert not (folder / "a.mxt").is_file() or (folder / "a.mxt").read_bytes() in (b"\0", TEXT.encode())


async def test_the_text_of_a_file_that_is_gone_is_not_called_saved(folder: Path) -> None:
    async with page(folder) as pilot:
        (folder / "a.mxt").unlink()
        typed(pilot, "escape")
        await until(pilot, lambda: pilot.app.screen is pilot.app.main)  # type: ignore[attr-defined]
        await shown_again(pilot)
        shown(pilot).show(shown(pilot).view)
        assert "new, not saved" in shown(pilot).lines("heading").plain
        assert [each.name for each in pilot.app.texts.unsaved()] == ["a.mxt"]  # type: ignore[attr-defined]
        typed(pilot, "ctrl+s")
        await until(pilot, lambda: (folder / "a.mxt").exists() and (folder / "a.mxt").read_text() == TEXT)


async def test_the_heading_names_a_change_while_the_page_is_shown(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(program_file, "LOOK_PERIOD", 0.0)
    async with page(folder) as pilot:
        (folder / "a.mxt").write_text(OTHER)

        def heading() -> str:
            shown(pilot).show(shown(pilot).view)
            return shown(pilot).lines("heading").plain

        await until(pilot, lambda: "● the file has changed on the disk" in heading())
        assert shown(pilot).editor.text == TEXT  # nothing changes under a person's eyes
        typed(pilot, "ctrl+end", "' mine")
        await until(pilot, lambda: "● not saved; file has changed on the disk" in heading())
        (folder / "a.mxt").write_text(TEXT)
        await until(pilot, lambda: "on the disk" not in heading())


@pytest.mark.real
async def test_a_disk_that_hangs_holds_only_the_keys_and_escape_leaves(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    gate, look = threading.Event(), EditedFile.look

    def hangs(self: EditedFile) -> Outside:
        gate.wait(PATIENCE)
        return look(self)

    async with page(folder) as pilot:
        monkeypatch.setattr(EditedFile, "look", hangs)
        app = pilot.app
        assert isinstance(app, MultidropApp)
        try:
            typed(pilot, "ctrl+d")
            await until(pilot, lambda: app.keyboard.held)
            typed(pilot, "ctrl+x")
            await until(pilot, lambda: session_of(pilot).stops == 1)
            typed(pilot, "escape")
            await until(pilot, lambda: app.screen is app.main)
            (folder / "a.mxt").write_text(OTHER)
        finally:
            gate.set()
        typed(pilot, "PR P")
        await until(pilot, lambda: app.main.entry.value == "PR P")
        assert app.screen is app.main and sent(pilot) == []


@pytest.mark.real
async def test_a_stop_while_the_file_is_saved_keeps_the_download_back(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    gate, save = threading.Event(), EditedFile.save

    def hangs(self: EditedFile, *given: object) -> None:
        gate.wait(PATIENCE)
        save(self, *given)  # type: ignore[arg-type]

    monkeypatch.setattr(EditedFile, "save", hangs)
    async with page(folder) as pilot:
        typed(pilot, "ctrl+end", "' mine", "ctrl+d")
        await question(pilot, "Download a.mxt")
        typed(pilot, "down", "enter")
        await until(pilot, lambda: isinstance(pilot.app.screen, ProgramPage))
        typed(pilot, "ctrl+x")
        await until(pilot, lambda: session_of(pilot).stops == 1)
        gate.set()
        await until(pilot, lambda: (folder / "a.mxt").read_text().endswith("mine"))
        await settle(pilot)
        assert session_of(pilot).lines == []


async def test_the_copy_of_an_edit_of_another_content_is_not_saved_unasked(folder: Path) -> None:
    (folder / "b.mxt").write_text("' before\n")
    Drafts(folder / "state").keep(Copy("b.mxt", "' mine\n", "2026-11-21 22:10", EditedFile("b.mxt").digest))
    (folder / "b.mxt").write_text("' another's\n")
    async with page(folder) as pilot:
        typed(pilot, "ctrl+e")
        await until(pilot, lambda: isinstance(pilot.app.screen, SearchDialog))
        typed(pilot, "b.mxt", "enter")
        asked = await question(pilot, "A text that was not saved")
        assert any("The file has changed since then" in line for line in asked.lines)
        typed(pilot, "enter")
        await until(pilot, lambda: shown(pilot).editor.text == "' mine\n")
        typed(pilot, "ctrl+s")
        await question(pilot, "Save?")
        assert (folder / "b.mxt").read_text() == "' another's\n"


async def test_a_break_point_goes_to_the_line_that_is_shown_right_after_an_edit(folder: Path) -> None:
    rows = ((1, "LB G1"), (6, "MR 51200"), (11, "E"))
    async with page(folder) as pilot:
        session_of(pilot).emit(ProgramRead(67.0, "press", "a", rows))
        await until(pilot, lambda: bool(shown(pilot).findings.addresses))
        typed(pilot, "ctrl+home", "' one more line\n", "down", "down", "ctrl+b")
        await until(pilot, lambda: [line for line, _ in session_of(pilot).lines] == ["/break press:a 6"])
        session_of(pilot).emit(ProgramSeen(67.0, "press", "a", None, Phase.EXECUTES, ""))
        session_of(pilot).emit(ProgramRead(68.0, "press", "a", (), False))  # a download began
        await until(pilot, lambda: not shown(pilot).findings.addresses and not shown(pilot).findings.pending)
        typed(pilot, "ctrl+r")
        await until(pilot, lambda: isinstance(pilot.app.screen, SearchDialog))
        assert "may be another one" in pilot.app.screen.heading  # type: ignore[attr-defined]


# On a real session with a simulated drive


async def test_the_drive_holds_the_program_that_was_on_the_screen(folder: Path) -> None:
    async with real_screen(folder, "sim:#eth") as pilot:
        app = pilot.app
        assert isinstance(app, MultidropApp)
        await until(pilot, lambda: app.session.selected is not None)
        app.texts.open("a.mxt")
        await shown_again(pilot)
        typed(pilot, "ctrl+d")
        await question(pilot, "Download a.mxt")
        (folder / "a.mxt").write_text(OTHER)
        typed(pilot, "down", "enter")
        await until(pilot, lambda: told(pilot, "verified, 3 lines"))
        held = app.model.bus("eth").readout(app.session.selected.address).program.lines  # type: ignore[union-attr]
        assert [text.strip() for _, text in held] == ["LB G1", "MR 51200", "E"]
        await until(pilot, lambda: len(shown(pilot).findings.addresses) == 3)


# Macros


def macro(folder: Path, *lines: str, name: str = "m", key: str = "F3") -> Path:
    path = folder / "config" / "macros" / f"{name}.toml"
    path.parent.mkdir(parents=True, exist_ok=True)
    steps = "".join(f"[[step]]\nline = {line!r}\n" for line in lines)
    path.write_text(f"name = {name!r}\nkey = {key!r}\n{steps}")
    return path


@asynccontextmanager
async def with_macros(folder: Path) -> AsyncIterator[tuple[Pilot[int], MultidropApp]]:
    async with real_screen(folder, "sim:#eth") as pilot:
        app = pilot.app
        assert isinstance(app, MultidropApp)
        await until(pilot, lambda: app.session.selected is not None and "m" in app.macros.shown_macros)
        yield pilot, app


def pause(monkeypatch: pytest.MonkeyPatch) -> None:
    """No press is the repetition of a held key."""
    monkeypatch.setattr("multidrop.tui.keymap.REPEATED_WITHIN", 0.0)


async def test_a_key_plays_a_macro_that_changed_on_the_disk_at_its_second_press(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pause(monkeypatch)
    macro(folder, "PR 1")
    async with with_macros(folder) as (pilot, app):
        typed(pilot, "f3")
        await until(pilot, lambda: told(pilot, "macro m: 1 round played") == 1)  # unchanged: at once
        macro(folder, "PR 2")
        typed(pilot, "f3")
        await until(pilot, lambda: told(pilot, "macro m has changed on the disk; nothing was sent, press F3 again"))
        await settle(pilot)
        assert told(pilot, "PR 2") == 0
        typed(pilot, "f3")
        await until(pilot, lambda: told(pilot, "macro m: 1 round played") == 2)
        assert told(pilot, "PR 2")


async def test_a_key_that_another_program_gave_to_another_macro_plays_it_at_its_second_press(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pause(monkeypatch)
    path = macro(folder, "PR 1")
    async with with_macros(folder) as (pilot, app):
        path.write_text(path.read_text().replace("key = 'F3'", ""))
        macro(folder, "PR 2", name="other")
        typed(pilot, "f3")
        await until(pilot, lambda: told(pilot, "F3 plays other now; nothing was sent, press F3 again"))
        typed(pilot, "f3")
        await until(pilot, lambda: told(pilot, "macro other: 1 round played"))


async def painted(pilot: Pilot[int], app: MultidropApp) -> None:
    """Paint once more while no key waits: an Enter plays what is shown."""
    await until(pilot, lambda: isinstance(app.screen, MacrosPage) and app.keyboard.idle)
    app.model.changed = True
    await settle(pilot)


async def test_the_page_of_macros_plays_the_lines_that_it_shows(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pause(monkeypatch)
    macro(folder, "PR 1")
    async with with_macros(folder) as (pilot, app):
        await app.run_action("act.page('macros')")
        await until(pilot, lambda: isinstance(app.screen, MacrosPage) and "PR 1" in app.screen.lines("steps").plain)
        macro(folder, "PR 2")
        typed(pilot, "enter")
        await until(pilot, lambda: told(pilot, "has changed on the disk since it was shown here; nothing was sent"))
        assert not told(pilot, "round played")
        await until(pilot, lambda: "PR 2" in app.screen.lines("steps").plain)  # type: ignore[attr-defined]
        await painted(pilot, app)
        typed(pilot, "enter")
        await until(pilot, lambda: told(pilot, "macro m: 1 round played"))


async def test_a_macro_whose_lines_could_not_be_shown_is_not_played() -> None:
    session = demo_session()
    load = session.macros.load

    def broken(name: str) -> object:
        raise Diagnostic("not TOML", f"{name}.toml:1", "correct the line")

    session.macros.load = broken  # type: ignore[assignment,method-assign]
    async with on_screen(session) as (pilot, app, _):
        await app.run_action("act.page('macros')")
        await until(pilot, lambda: "✗" in app.screen.lines("macros").plain)  # type: ignore[attr-defined]
        session.macros.load = load  # type: ignore[method-assign]
        session.time += 1
        await pilot.press("enter")
        await until(pilot, lambda: told(pilot, "not TOML") == 1)
        assert session.lines == [] and told(pilot, "nothing was played") == 1
        await until(pilot, lambda: "✗" not in app.screen.lines("macros").plain)  # type: ignore[attr-defined]
        session.time += 1
        await settle(pilot)
        await pilot.press("enter")
        await until(pilot, lambda: [line for line, _ in session.lines] == ["/play home-all"])


async def test_a_macro_that_changed_is_named_when_it_is_read_again(folder: Path) -> None:
    path = macro(folder, "PR 1")
    async with with_macros(folder) as (pilot, app):
        path.write_text(path.read_text() + "note = 'x'\n".replace("note", "# note"))
        app.model.changed = True
        await settle(pilot)
        assert not told(pilot, "has changed")  # it plays the same
        macro(folder, "PR 2")
        app.model.changed = True
        await until(pilot, lambda: told(pilot, "macro m has changed: it is played as it is now") == 1)
        await asyncio.sleep(0)
        assert told(pilot, "has changed") == 1


# Settings, and lines that name a file


async def test_a_file_of_settings_is_read_again_before_its_values_are_used(folder: Path) -> None:
    file = folder / "p.toml"
    file.write_text("[parameters]\nVM = 100\n")
    async with real_screen(folder, "sim:#eth") as pilot:
        app = pilot.app
        assert isinstance(app, MultidropApp)
        await until(pilot, lambda: app.session.selected is not None)
        await app.run_action("act.page('parameters')")
        page = app.screen
        assert isinstance(page, ParametersPage)

        def shows(text: str) -> bool:
            return text in "\n".join(page.lines(part).plain for part in ("columns", "table"))

        await until(pilot, lambda: app.model.bus("eth").readout("").settings is not None)
        page.edited("VM")
        page.action_ask("file")
        page.typed(str(file))
        await until(pilot, lambda: shows("p.toml") and shows("100"))
        page.action_differing()
        await settle(pilot)
        assert "on the disk" not in page.said[0]  # unchanged
        file.write_text("[parameters]\nVM = 999\n")
        page.action_differing()
        await until(pilot, lambda: shows("999"))
        assert "has changed on the disk: it was read again" in page.said[0]
        file.unlink()
        page.action_read()
        await until(pilot, lambda: "the values shown are those that it had" in page.said[0])
        assert shows("p.toml") and shows("999")
        page.action_defaults()
        file.write_text("[parameters]\nVM = 1\n")
        page.action_differing()
        await settle(pilot)
        assert shows("default") and not shows("p.toml")


async def test_a_typed_line_warns_of_a_text_in_the_editor_that_is_not_saved(folder: Path) -> None:
    async with real_screen(folder, "sim:#eth") as pilot:
        app = pilot.app
        assert isinstance(app, MultidropApp)
        await until(pilot, lambda: app.session.selected is not None)
        app.texts.open("a.mxt")
        await shown_again(pilot)
        await app.session.run("/check a.mxt")
        assert not told(pilot, "in the editor is not saved")
        typed(pilot, "ctrl+end", "' mine")
        await until(pilot, lambda: "mine" in shown(pilot).editor.text)
        for count, line in enumerate(("/check a.mxt", "/download a.mxt"), 1):
            await app.session.run(line)
            words = "a.mxt: its text in the editor is not saved; the file on the disk is used"
            assert told(pilot, words) == count
