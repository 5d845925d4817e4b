"""The verbs of macros: nothing that somebody wrote is overwritten without a word, and a key plays one macro or none."""

from __future__ import annotations

from pathlib import Path

import pytest

from multidrop.__main__ import main
from multidrop.base.errors import Diagnostic
from multidrop.shell.events import Notified, Output
from multidrop.shell.session import Session

HAND = "# by hand\nname = 'm' # mine\nkey = 'F3' # left\nnote = 'to and fro'\n\n# first\n[[step]]\nline = '/sleep 0'\n"


@pytest.fixture(autouse=True)
def folder(tmp_path: Path) -> Path:
    (tmp_path / "macros").mkdir()
    return tmp_path / "macros"


def put(folder: Path, name: str, key: str = "") -> Path:
    path = folder / f"{name}.toml"
    path.write_text(HAND.replace("'m'", f"'{name}'").replace("F3", key))
    return path


class Heard:
    def __init__(self, session: Session) -> None:
        self.lines: list[str] = []
        session.subscribe(lambda event: self.lines.append(event.text) if isinstance(event, Notified | Output) else None)


async def run(session: Session, *lines: str) -> list[str]:
    heard = Heard(session)
    for line in lines:
        await session.run(line)
    return heard.lines


# -- /record


async def test_a_macro_that_is_there_is_not_recorded_over(session: Session, folder: Path) -> None:
    path = put(folder, "m", "F3")
    with pytest.raises(Diagnostic, match="macro m exists already; use another name; /record m --replace"):
        await session.run("/record m")
    assert session.recording == "" and "# by hand" in path.read_text()


async def test_replace_keeps_key_and_note(session: Session, folder: Path) -> None:
    put(folder, "m", "F3")
    await run(session, "/record m --replace", "/sleep 0", "/sleep 0.001", "/record stop")
    macro = session.macros.load("m")
    assert (macro.key, macro.note, [step.line for step in macro.steps]) == (
        "F3",
        "to and fro",
        ["/sleep 0", "/sleep 0.001"],
    )


@pytest.mark.parametrize("before", [True, False])
async def test_a_file_that_changed_meanwhile_stays_and_nothing_recorded_is_lost(
    session: Session, folder: Path, before: bool
) -> None:
    if before:
        put(folder, "m", "F3")
    await run(session, "/record m --replace" if before else "/record m", "/sleep 0")
    edited = put(folder, "m", "F7").read_bytes()
    told = await run(session, "/record stop")
    assert (folder / "m.toml").read_bytes() == edited
    assert [step.line for step in session.macros.load("m-2").steps] == ["/sleep 0"]
    assert told[0] == "m was changed meanwhile and stays unchanged" and "macro m-2: 1 line" in told[1]


async def test_a_recording_that_cannot_be_written_goes_on(session: Session, folder: Path) -> None:
    await run(session, "/record m", "/sleep 0")
    folder.rename(folder.with_name("gone"))
    folder.write_text("in the way")
    with pytest.raises(Diagnostic, match="nothing is lost, the recording goes on"):
        await session.run("/record stop")
    assert session.recording == "m"
    folder.unlink()
    await session.run("/record stop")
    assert session.recording == "" and [step.line for step in session.macros.load("m").steps] == ["/sleep 0"]


async def test_the_words_of_record(session: Session) -> None:
    for line in ("/record m x", "/record m --replace y", "/record --replace"):
        with pytest.raises(Diagnostic):
            await session.run(line)
    assert session.recording == ""


# -- /key


async def test_a_key_is_put_into_the_file_and_its_remarks_stay(session: Session, folder: Path) -> None:
    path = put(folder, "m", "F3")
    before = path.read_text()
    assert await run(session, "/key f4 m") == ["F4 plays m"]
    assert path.read_text() == before.replace("'F3'", '"F4"')
    assert await run(session, "/key F4 off") == ["F4 plays nothing; no longer on it: m"]
    assert path.read_text() == before.replace("'F3'", '""')


async def test_a_key_with_two_macros_is_named_and_can_be_freed(session: Session, folder: Path) -> None:
    put(folder, "a", "F5"), put(folder, "b", "F5"), put(folder, "c")
    told = await run(session, "/macros")
    assert told[-1] == "a and b are both on F5, which plays none of them"
    assert await run(session, "/key F5 b") == ["F5 plays b; no longer on it: a"]
    put(folder, "a", "F5")
    assert await run(session, "/key F5 c") == ["F5 plays c; no longer on it: a, b"]
    put(folder, "a", "F5")
    assert await run(session, "/key F5 off") == ["F5 plays nothing; no longer on it: a, c"]
    with pytest.raises(Diagnostic, match="nothing is on F5"):
        await session.run("/key F5 off")


async def test_a_key_changes_nothing_where_the_macro_is_not_there(session: Session, folder: Path) -> None:
    path = put(folder, "a", "F5")
    before = path.read_bytes()
    with pytest.raises(Diagnostic, match="no macro 'x'"):
        await session.run("/key F5 x")
    assert path.read_bytes() == before


async def test_a_file_that_cannot_be_read_is_told_and_hides_no_other(session: Session, folder: Path) -> None:
    put(folder, "a", "F5")
    (folder / "broken.toml").write_text("name =")
    heard = Heard(session)
    with pytest.raises(Diagnostic, match=r"broken\.toml"):
        await session.run("/macros")
    assert heard.lines[0].startswith("a  ")
    told = await run(session, "/key F5 off", "/key F6 a")
    assert [line for line in told if "it may be on" in line] == [line for line in told if "broken.toml" in line]


def test_macro_list_names_a_key_with_two_macros(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("MULTIDROP_CONFIG_DIR", str(folder.parent))
    put(folder, "a", "F5"), put(folder, "b", "F5")
    assert main(["macro", "list"]) == 0
    out, err = capsys.readouterr()
    assert [line.split()[0] for line in out.splitlines()] == ["a", "b"]
    assert err == "a and b are both on F5, which plays none of them\n"
