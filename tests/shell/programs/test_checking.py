"""`/check`, and the rewriting of program files in canonical spelling."""

from __future__ import annotations

import os
import stat
from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from multidrop.base import atomic
from multidrop.base.errors import Diagnostic, Inexpressible
from multidrop.shell.configuration import Settings
from multidrop.shell.events import Notified, Output
from multidrop.shell.programs.checking import ending_of, examine, rewrite
from multidrop.shell.session import Session

GOOD = "va q1=5\t' half a turn\r\nPG 1\r\n  lb ga      'start\r\n\tmr q1   ` go \r\n\tH\r\n e   \r\npg\r\n\r\ns"
SPELLED = "VA Q1=5\t' half a turn\r\nPG 1\r\n  LB GA      'start\r\n\tMR Q1   ` go \r\n\tH\r\n E\r\nPG\r\n\r\nS"
WRONG = "PG 1\nLB G1\nmr 5\nMR 6\nQ9=1\nE\nPG\n"


@pytest.fixture
async def session(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[Session]:
    monkeypatch.chdir(tmp_path)
    made = Session(Settings({}, tmp_path / "config", tmp_path / "state", data=tmp_path / "data"))
    yield made
    await made.close()


async def test_a_file_is_checked_for_the_selected_drive_and_nothing_is_sent(session: Session) -> None:
    Path("a.mxt").write_text(WRONG)
    Path("b.mxt").write_text("PG 1\nLB G1\nS1=0,0,0\nE\nPG\n")
    Path("cell.toml").write_text('[[bus]]\nname = "x"\n[[bus.drive]]\npersonality = "MDI"\n')
    news: list[object] = []
    session.subscribe(news.append)
    with pytest.raises(Inexpressible, match=r"a\.mxt: 1 error for LMDCM"):
        await session.run("/check a.mxt")
    notices = [each.text.partition(" ")[0] for each in news if isinstance(each, Notified)]
    assert notices == ["a.mxt:3:1:", "a.mxt:5:1:"]
    with pytest.raises(Inexpressible, match="for LMDCM"):
        await session.run("/check b.mxt")
    await session.run("/check b.mxt mdi")
    await session.run("/open sim:cell.toml")
    await session.run("/check b.mxt")
    facts = [each.text for each in news if isinstance(each, Output)]
    assert facts == ["b.mxt: nothing wrong, 3 lines of program"] * 2
    with pytest.raises(Diagnostic, match="no personality PMX; valid for a.mxt: LMDOM"):
        await session.run("/check a.mxt PMX")
    with pytest.raises(Diagnostic, match="cannot be read"):
        await session.run("/check none.mxt")


def spelled(path: Path) -> bytes:
    checked = examine(str(path), "LMDCM")
    rewrite(checked)
    return path.read_bytes()


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "latin-1"])
def test_a_file_is_spelled_anew_in_its_own_encoding_and_once(tmp_path: Path, encoding: str) -> None:
    (file := tmp_path / "a.mxt").write_bytes(f"' 20 °C\n{GOOD}\x1a".encode(encoding))
    file.chmod(0o640)
    expected = f"' 20 °C\n{SPELLED}\x1a".encode(encoding)
    assert spelled(file) == expected
    before = os.stat(file)
    assert spelled(file) == expected
    after = os.stat(file)
    assert (before.st_ino, before.st_mtime_ns) == (after.st_ino, after.st_mtime_ns)
    assert os.name != "posix" or stat.S_IMODE(after.st_mode) == 0o640


def test_a_file_with_errors_is_not_touched(tmp_path: Path) -> None:
    (file := tmp_path / "a.mxt").write_text(WRONG)
    assert spelled(file) == WRONG.encode() and os.listdir(tmp_path) == ["a.mxt"]


@pytest.mark.fork
def test_a_link_stays_a_link(tmp_path: Path) -> None:
    (tmp_path / "real.mxt").write_text("vm 5000\n")
    (link := tmp_path / "a.mxt").symlink_to("real.mxt")
    assert spelled(link) == b"VM=5000\n" and link.is_symlink()


def test_a_file_that_cannot_be_written_is_as_it_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (file := tmp_path / "a.mxt").write_text("vm 5000\n")

    def full(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(atomic.os, "fsync", full)
    with pytest.raises(Diagnostic, match="cannot be written: No space left on device; the file is as it was"):
        spelled(file)
    assert file.read_text() == "vm 5000\n" and os.listdir(tmp_path) == ["a.mxt"]


def test_a_file_that_changed_meanwhile_stays_as_it_is(tmp_path: Path) -> None:
    (file := tmp_path / "a.mxt").write_text("vm 5000\n")
    checked = examine(str(file), "LMDCM")
    file.write_text("vm 6000\n")
    with pytest.raises(Diagnostic, match="has changed since it was checked"):
        rewrite(checked)
    assert file.read_text() == "vm 6000\n"


def test_a_file_that_is_read_only_stays_as_it_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (file := tmp_path / "a.mxt").write_text("vm 5000\n")
    monkeypatch.setattr(os, "access", lambda path, mode: False)  # for root no file is read-only
    with pytest.raises(Diagnostic, match="cannot be written: it is read-only"):
        spelled(file)
    assert file.read_text() == "vm 5000\n"


@pytest.mark.fork
def test_only_a_regular_file_is_replaced(tmp_path: Path) -> None:
    (file := tmp_path / "a.mxt").write_text("vm 5000\n")
    checked = examine(str(file), "LMDCM")
    file.unlink()
    os.mkfifo(file)
    with pytest.raises(Diagnostic, match="is not a regular file"):
        rewrite(checked)
    assert stat.S_ISFIFO(os.stat(file).st_mode)


@pytest.mark.parametrize(
    ("product", "ending"),
    [("", ".mxt"), ("LMDCE", ".mxt"), ("TMCM-1241", ".tmc"), ("PMX-4EX-SA", ".prg"), ("of another maker", ".mxt")],
)
def test_a_program_file_ends_as_the_language_of_its_drive_has_it(product: str, ending: str) -> None:
    assert ending_of(product) == ending
