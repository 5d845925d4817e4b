"""Changes of macros' files by verbs and by the command line."""

from __future__ import annotations

import contextlib
import io
import shlex
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from multidrop.__main__ import main
from multidrop.base.errors import Diagnostic, DriveError
from multidrop.macros import Macro, MacroStore
from multidrop.shell.events import By, Notified, Output
from multidrop.shell.line_syntax import showing
from multidrop.shell.session import Session

HAND = "# by hand\nname = 'm' # mine\nkey = 'F3' # left\nnote = 'to and fro'\n\n# first\n[[step]]\nline = '/sleep 0'\n"


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "macros").mkdir()
    (tmp_path / "work").mkdir()
    monkeypatch.chdir(tmp_path / "work")
    monkeypatch.setenv("MULTIDROP_CONFIG_DIR", str(tmp_path))
    monkeypatch.setenv("MULTIDROP_STATE_DIR", str(tmp_path / "state"))
    (tmp_path / "macros" / "m.toml").write_text(HAND)
    return tmp_path / "macros"


async def run(session: Session, *lines: str, by: By = By.OPERATOR) -> list[str]:
    told: list[str] = []
    leave = session.subscribe(lambda event: told.append(event.text) if isinstance(event, Notified | Output) else None)
    for line in lines:
        await session.run(line, replace(session.origin, by=by))
    leave()
    return told


async def test_a_renamed_macro_keeps_key_and_remarks(session: Session, folder: Path) -> None:
    (folder / "n.toml").write_text(HAND.replace("'m'", "'n'").replace("F3", "").replace("/sleep 0", "/play m"))
    told = await run(session, "/macro rename m other")
    assert told == [
        f"macro m is other now, in {folder / 'other.toml'}",
        "macro n, step 1, plays m, which is gone",
    ]
    assert (folder / "other.toml").read_text(encoding="utf-8") == HAND.replace("'m'", '"other"')
    assert not (folder / "m.toml").exists()


async def test_a_recording_replaces_no_file_that_cannot_be_read(session: Session, folder: Path) -> None:
    (folder / "m.toml").write_text("name = 'm'\ncolour = 1\n")
    with pytest.raises(Diagnostic, match=r"m\.toml:2: unknown key 'colour'"):
        await session.run("/record m --replace")
    assert session.recording == ""


async def test_a_copy_is_on_no_key(session: Session, folder: Path) -> None:
    await run(session, "/macro copy m n")
    assert (folder / "n.toml").read_text(encoding="utf-8") == HAND.replace("'m'", '"n"').replace("'F3'", '""')
    for line in ("/macro copy m n", "/macro rename m n"):
        with pytest.raises(Diagnostic, match=r"n\.toml: the file exists already"):
            await session.run(line)
    assert (folder / "m.toml").read_text(encoding="utf-8") == HAND


async def test_a_note_is_changed_and_nothing_else(session: Session, folder: Path) -> None:
    await run(session, """/macro describe m it's "the press" ä""".replace("it's", "its"))
    assert (folder / "m.toml").read_text(encoding="utf-8") == HAND.replace("'to and fro'", r'"its \"the press\" ä"')


async def test_a_macro_beside_the_project_hides_the_users(session: Session, folder: Path) -> None:
    await run(session, "/macro copy m m --project", "/macro describe m here")
    assert (folder / "m.toml").read_text(encoding="utf-8") == HAND
    told = await run(session, "/macros")
    assert told == [
        "m                -    1 line  here  [macros]",
        f"macro m: the one in macros is played, not that in {folder}",
    ]
    assert f"macro m: the one in macros is played, not that in {folder}" in await run(session, "/play m")
    await run(session, "/key F5 m")
    assert session.macros.load("m").key == "F5" and "F3" in (folder / "m.toml").read_text(encoding="utf-8")


async def test_a_folder_that_cannot_be_made_is_told(session: Session, folder: Path) -> None:
    Path("macros").write_text("in the way")
    with pytest.raises(Diagnostic, match="macros: cannot make the folder"):
        await session.run("/macro copy m m --project")
    assert await run(session, "/macros") == ["m                F3   1 line  to and fro"]


async def test_a_deletion_is_asked_for(session: Session, folder: Path) -> None:
    asked: list[str] = []

    async def ask(question: str) -> bool:
        asked.append(question)
        return len(asked) > 1

    with pytest.raises(Diagnostic, match="nothing was deleted; --yes agrees to it"):
        await session.run("/macro delete m")
    session.front.ask = ask
    with pytest.raises(Diagnostic, match="the answer was no"):
        await session.run("/macro delete m")
    assert (folder / "m.toml").exists()
    await run(session, "/macro delete m")
    assert not (folder / "m.toml").exists()
    assert asked == [f"deletes macro m, the file {folder / 'm.toml'}"] * 2


async def test_a_macro_changes_no_macros(session: Session, folder: Path) -> None:
    for line in ("/macro delete m", "/macro describe m x", "/macro import x"):
        with pytest.raises(Diagnostic, match="a macro does not change macros"):
            await run(session, line, by=By.MACRO)
    assert (folder / "m.toml").read_text(encoding="utf-8") == HAND


@pytest.mark.parametrize(
    "line", ["/macro", "/macro m", "/macro rename m", "/macro copy m n --force", "/macro show m n"]
)
async def test_the_words_of_macro(session: Session, line: str) -> None:
    with pytest.raises(Diagnostic, match="usage: /macro"):
        await session.run(line)


async def test_an_editor_never_takes_the_stop_key(session: Session) -> None:
    with pytest.raises(Diagnostic, match="would take Ctrl.X.*in another terminal: multidrop macro edit m"):
        await session.run("/macro edit m")
    with pytest.raises(Diagnostic, match="no macro 'x'"):
        await session.run("/macro edit x")


async def test_the_screen_has_an_editor_of_its_own(session: Session, folder: Path) -> None:
    opened: list[str] = []

    async def edit(path: str) -> None:
        opened.append(path)

    session.front.edit = edit
    await run(session, "/macro edit m")
    assert opened == [str(folder / "m.toml")]


async def test_keys_are_in_pages(session: Session) -> None:
    await run(session, "/macro copy m n", "/key F3 n --page 2")
    assert [session.macros.load(name).place for name in "mn"] == ["F3", "F3 (page 2)"]
    assert session.macros.pages() == ["1", "2"]
    assert await run(session, "/key F3 off --page 2") == ["F3 of page 2 plays nothing; no longer on it: n"]
    assert session.macros.load("m").key == "F3"
    with pytest.raises(Diagnostic, match="invalid page 'a b'"):
        await session.run('/key F3 n --page "a b"')


# -- function-key strings


def test_an_import_is_whole_or_not_at_all(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("keys.txt").write_text("F3 MR 1^M^pPR P^M ; there\nF4 ^f3^[\n")
    (folder / "f4.toml").write_text(HAND.replace("'m'", "'f4'").replace("F3", ""))
    assert main(["macro", "import", "keys.txt"]) == 2
    assert "keys.txt: f4 exists already; nothing was imported; --force replaces them" in capsys.readouterr().err
    assert sorted(path.stem for path in folder.iterdir()) == ["f4", "m"]
    assert main(["macro", "import", "keys.txt", "--force"]) == 0
    told = capsys.readouterr().err.splitlines()
    assert told[1] == "macro f3: F3 plays another macro already, so it is on no key"
    assert told[3].endswith("after which no line runs; /stop stops every drive")
    assert main(["macro", "export", "out.txt", "f3", "f4"]) == 0
    assert Path("out.txt").read_text(encoding="utf-8") == "F3 MR 1^M^pPR P^M ; there\nF4 ^f3^[\n"


def test_a_file_that_cannot_be_read_is_never_replaced(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("keys.txt").write_text("F4 MR 1^M\nF5 MR 2^M\n")
    (folder / "f5.toml").write_text("name = 'f5'\ncolour = 1\n")
    assert main(["macro", "import", "keys.txt", "--force"]) == 2
    assert "f5.toml:2: unknown key 'colour'" in capsys.readouterr().err
    assert (folder / "f5.toml").read_text(encoding="utf-8") == "name = 'f5'\ncolour = 1\n" and not (
        folder / "f4.toml"
    ).exists()


def test_an_import_that_cannot_be_written_puts_everything_back(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    Path("keys.txt").write_text("F4 MR 1^M\nF5 MR 2^M\n")
    save = MacroStore.save

    def full(store: MacroStore, macro: object, before: bytes | None = None) -> Path:
        if getattr(macro, "name", "") == "f5":
            raise Diagnostic("cannot write the file (No space left on device)", "f5.toml")
        return save(store, macro, before)  # type: ignore[arg-type]

    monkeypatch.setattr(MacroStore, "save", full)
    assert main(["macro", "import", "keys.txt"]) == 2
    assert "No space left on device); nothing was imported" in capsys.readouterr().err
    assert [path.stem for path in folder.iterdir()] == ["m"]


def test_an_export_replaces_no_file(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["macro", "export", "out.txt"]) == 2
    assert "macro m: a macro that does nothing has no counterpart" in capsys.readouterr().err
    (folder / "m.toml").write_text(HAND.replace("/sleep 0", "MR 1"))
    assert main(["macro", "export", "out.txt"]) == 0
    assert Path("out.txt").read_text(encoding="utf-8") == "F3 MR 1^M ; to and fro\n"
    assert main(["macro", "export", "out.txt"]) == 2
    assert "out.txt: exists already" in capsys.readouterr().err


def test_function_keys_come_from_standard_input_and_go_to_standard_output(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(b"F5 MR 7^M\nF6 ^x\n")))
    assert main(["macro", "import", "-"]) == 2
    assert capsys.readouterr().err.startswith("standard input:2:")
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(b"F5 MR 7^M\n")))
    assert main(["macro", "import", "-"]) == 0
    assert main(["macro", "export", "-", "f5"]) == 0
    assert capsys.readouterr().out == "F5 MR 7^M\n"
    assert not Path("-").exists()


# -- the command line


def editing(monkeypatch: pytest.MonkeyPatch, program: str) -> None:
    monkeypatch.delenv("VISUAL", raising=False)
    monkeypatch.setenv("EDITOR", shlex.join([sys.executable, "-c", f"import sys; path = sys.argv[-1]; {program}"]))


@pytest.mark.process
def test_an_editor_changes_a_macro(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    editing(monkeypatch, "text = open(path).read(); open(path, 'w').write(text.replace('fro', 'there'))")
    assert main(["macro", "edit", "m"]) == 0
    assert (folder / "m.toml").read_text(encoding="utf-8") == HAND.replace("fro", "there")
    editing(monkeypatch, "open(path, 'a').write('x'); sys.exit(3)")
    assert main(["macro", "edit", "m"]) == 2
    assert "the editor ended with 3; m is as it was; your text is in" in capsys.readouterr().err
    assert (folder / "m.toml").read_text(encoding="utf-8") == HAND.replace("fro", "there")


def test_without_a_terminal_no_editor_is_guessed(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delenv("VISUAL", raising=False)
    monkeypatch.setenv("EDITOR", " ")
    assert main(["macro", "edit", "m"]) == 2
    assert capsys.readouterr().err == "no editor is known; set VISUAL or EDITOR to its command\n"
    assert (folder / "m.toml").read_text(encoding="utf-8") == HAND


@pytest.mark.process
def test_an_editor_that_is_not_there_is_told(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("VISUAL", "no-such-editor -w")
    assert main(["macro", "edit", "m"]) == 2
    assert "no-such-editor: cannot run (No such file or directory); set VISUAL or EDITOR" in capsys.readouterr().err


def test_the_command_line_changes_macros(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["macro", "describe", "m", "a", "b"]) == 0
    assert main(["macro", "rename", "m", "n"]) == 0
    assert main(["macro", "copy", "n", "o"]) == 0
    assert main(["macro", "key", "f4", "o", "--page", "jog"]) == 0
    capsys.readouterr()
    assert main(["macro", "list"]) == 0
    assert capsys.readouterr().out.splitlines() == [
        "n                F3   1 line  a b",
        "o                F4 (page jog) 1 line  a b",
    ]
    assert main(["macro", "delete", "n"]) == 2
    assert main(["macro", "delete", "n", "--yes"]) == 0
    assert not (folder / "n.toml").exists()
    assert main(["macro", "delete", "n", "--yes"]) == 2


async def test_a_macro_that_changed_while_its_deletion_was_asked_about_stays(session: Session, folder: Path) -> None:
    async def ask(question: str) -> bool:
        (folder / "m.toml").write_text((folder / "m.toml").read_text() + "# another's work\n")
        return True

    session.front.ask = ask
    with pytest.raises(Diagnostic, match="has changed since you were asked; nothing was deleted"):
        await session.run("/macro delete m")
    assert "another's work" in (folder / "m.toml").read_text()


async def test_another_macro_that_came_to_hide_the_one_that_is_deleted_stays(session: Session, folder: Path) -> None:
    project = Path("macros")

    async def ask(question: str) -> bool:
        project.mkdir()
        (project / "m.toml").write_bytes((folder / "m.toml").read_bytes())
        return True

    session.front.ask = ask
    with pytest.raises(Diagnostic, match="nothing was deleted"):
        await session.run("/macro delete m")
    assert (project / "m.toml").exists() and (folder / "m.toml").exists()


async def test_a_macro_is_played_as_it_was_shown_or_not_at_all(session: Session, folder: Path) -> None:
    shown = session.macros.load("m")
    (folder / "m.toml").write_text((folder / "m.toml").read_text() + "# a remark\n")
    line = showing("/play m", shown)
    assert line is not None
    with contextlib.suppress(DriveError, Diagnostic):  # there is no drive: it came that far
        await session.run(line)
    other = replace(shown, steps=(*shown.steps, *shown.steps))
    line = showing("/play m", other)
    assert line is not None
    with pytest.raises(Diagnostic, match="macro m has changed on the disk since it was shown here; nothing was sent"):
        await session.run(line)


async def test_a_key_is_not_put_into_a_file_that_changed_meanwhile(
    session: Session, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    on_key = session.macros.on_key

    def slow(*given: str) -> tuple[list[Macro], list[Diagnostic]]:
        (folder / "m.toml").write_text((folder / "m.toml").read_text() + "# another's work\n")
        return on_key(*given)

    monkeypatch.setattr(session.macros, "on_key", slow)
    with pytest.raises(Diagnostic, match="the file has changed meanwhile"):
        session.macros.set_key("m", "F4")
    assert "another's work" in (folder / "m.toml").read_text()
