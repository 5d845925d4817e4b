"""The files of logs: which is the newest, what is remembered of those outside the folder, and their rotated parts."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from multidrop.base.errors import Diagnostic
from multidrop.shell.configuration import LogSettings, Settings
from multidrop.shell.log import files
from tests.support.cases import for_each
from tests.support.posix import has_mode


@pytest.fixture
def settings(tmp_path: Path) -> Settings:
    made = Settings({}, tmp_path / "config", tmp_path / "state", data=tmp_path / "data", log=LogSettings())
    files.fresh(made)
    return made


def written(path: Path, time: float = 5.0, data: bytes = b"") -> Path:
    path.write_bytes(data)
    os.utime(path, (time, time))
    return path


def listed(settings: Settings) -> list[str]:
    place = files.folder(settings) / "elsewhere"
    return place.read_text(encoding="utf-8").splitlines() if place.exists() else []


def test_only_a_file_outside_the_folder_is_remembered(settings: Settings, tmp_path: Path) -> None:
    files.note(settings, written(files.folder(settings) / "own.jsonl"))
    files.note(settings, tmp_path / "missing.log")
    files.note(settings, tmp_path)
    assert listed(settings) == []
    outside = written(tmp_path / "day.log")
    files.note(settings, outside)
    assert listed(settings) == [str(outside)]
    assert has_mode(files.folder(settings) / "elsewhere", 0o600)


def test_a_log_that_is_written_again_is_remembered_once_and_last_and_the_oldest_of_fifty_gives_way(
    settings: Settings, tmp_path: Path
) -> None:
    logs = [written(tmp_path / f"{number}.log") for number in range(files.NOTED + 1)]
    for each in logs[: files.NOTED]:
        files.note(settings, each)
    assert listed(settings) == [str(each) for each in logs[:50]]
    files.note(settings, logs[0])
    assert listed(settings) == [str(each) for each in (*logs[1:50], logs[0])]
    files.note(settings, logs[50])
    assert listed(settings) == [str(each) for each in (*logs[2:50], logs[0], logs[50])]


def test_a_log_is_remembered_by_where_it_is_and_not_by_a_link_to_it(settings: Settings, tmp_path: Path) -> None:
    real, link = written(tmp_path / "real.log"), tmp_path / "link.log"
    link.symlink_to(real)
    files.note(settings, real)
    files.note(settings, link)
    assert listed(settings) == [str(real)]


def test_a_folder_that_cannot_be_written_keeps_no_log_from_its_work(settings: Settings, tmp_path: Path) -> None:
    (files.folder(settings) / "elsewhere").mkdir()
    files.note(settings, written(tmp_path / "day.log"))
    assert (files.folder(settings) / "elsewhere").is_dir()


def test_the_newest_log_is_the_one_that_was_written_last(settings: Settings, tmp_path: Path) -> None:
    own = written(files.folder(settings) / "own.jsonl", 5.0)
    written(files.folder(settings) / "own.jsonl.1", 9.0)
    assert files.newest(settings) == own
    outside = written(tmp_path / "day.log", 7.0)
    files.note(settings, outside)
    assert files.newest(settings) == outside
    os.utime(own, (8.0, 8.0))
    assert files.newest(settings) == own
    own.unlink()
    assert files.newest(settings) == outside
    outside.unlink()
    with pytest.raises(Diagnostic) as caught:
        files.newest(settings)
    hint = "/log FILE begins one; [log] always = true in the configuration keeps one of each session"
    assert str(caught.value) == f"{files.folder(settings)}: no session log yet; {hint}"


@for_each(
    "there, numbers",
    [((), [0]), ((0,), [0]), ((0, 1, 2), [2, 1, 0]), ((1, 2), [2, 1]), ((0, 2), [0]), ((1,), [1])],
)
def test_the_parts_of_a_log_are_read_from_the_oldest(
    tmp_path: Path, there: tuple[int, ...], numbers: list[int]
) -> None:
    path = tmp_path / "log"
    for number in range(3):
        files.part(path, number).unlink(missing_ok=True)
    for number in there:
        written(files.part(path, number))
    assert files.part(path, 0) == path and files.part(path, 2) == tmp_path / "log.2"
    assert files.parts(path) == [files.part(path, number) for number in numbers]


def test_a_folder_is_its_only_part_and_cannot_be_read(tmp_path: Path) -> None:
    assert files.parts(tmp_path) == [tmp_path]
    for read in (files.whole, files.damaged):
        with pytest.raises(Diagnostic, match="cannot be read: Is a directory"):
            list(read(tmp_path))


ENTRY = b'{"time": "2026-11-22T11:37:05+00:00", "kind": "note", "text": "x"}\n'
BEGIN = f'{{"time": "2026-11-22T11:37:05+00:00", "kind": "log", "text": "{files.BEGIN}"}}\n'.encode()


def test_lines_have_the_number_of_their_file_from_where_reading_begins(tmp_path: Path) -> None:
    path = written(tmp_path / "log", data=b"one\n" + ENTRY + b"cut off")
    assert [(each.number, each.data) for each in files.lines(path)] == [(1, b"one\n"), (2, ENTRY), (3, b"cut off")]
    assert [each.where for each in files.lines(path, 4, 1)] == [f"{path}:2", f"{path}:3"]
    assert all(each.entry is None for each in files.lines(path) if each.number != 2)
    written(files.part(path, 1), data=b"older\n")
    assert [each.where for each in files.whole(path)][:2] == [f"{path}.1:1", f"{path}:1"]


def test_only_lines_of_the_last_session_are_called_damaged_and_blank_ones_are_not(tmp_path: Path) -> None:
    path = written(tmp_path / "log", data=b"bad\n" + BEGIN + b"\n" + ENTRY + b"worse\n" + ENTRY[:-1])
    assert files.damaged(path) == [f"{path}:5", f"{path}:6"]
    written(files.part(path, 1), data=ENTRY + b"{}\n")
    written(path, data=ENTRY + b"bad\n")
    assert files.damaged(path) == [f"{path}.1:2", f"{path}:2"]


def test_what_was_left_out_names_the_first_place() -> None:
    assert (
        files.left_out(["log:5"], "compared") == "1 line cannot be read, first log:5: what they held was not compared"
    )
    assert files.left_out(["a:1", "a:2"], "sent") == "2 lines cannot be read, first a:1: what they held was not sent"
