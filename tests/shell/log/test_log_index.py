"""The index lines that a writer puts into its log: where they say that they are, and ignored by all other readers."""

from __future__ import annotations

import json
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from multidrop.shell.log import files, index
from multidrop.shell.log.files import INDEX, LogEntry, entry_of, line_of
from multidrop.shell.log.index import EntryKey, IndexKeeper, LogIndex, index_of
from multidrop.shell.log.writer import Disk

AT = datetime(2026, 11, 22, 12, 0, tzinfo=UTC)
KEY = EntryKey("typed", "press", "a")


@pytest.fixture(autouse=True)
def often(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(index, "EVERY", 2000)
    monkeypatch.setattr(index, "SHARE", 2)


def head() -> bytes:
    return line_of(LogEntry(AT, "log", "session of process 1", marks=True))


def disk(path: Path, size: int = 10**6, parts: int = 3, begin: Callable[[], bytes] = head) -> Disk:
    return Disk(path, size, parts, begin, lambda number: b"")


def typed(number: int, text: str = "PR P") -> bytes:
    return line_of(LogEntry(AT + timedelta(seconds=number), "typed", f"{text} {number}", "press", "a", by="operator"))


def indexes(path: Path) -> list[tuple[int, LogIndex]]:
    """The index lines of a file, each with its offset."""
    data, found = path.read_bytes(), []
    for offset in (0, *(n + 1 for n, byte in enumerate(data) if byte == ord("\n"))):
        if (made := index_of(data[offset : data.find(b"\n", offset) + 1])) is not None:
            found.append((offset, made))
    return found


def test_an_index_line_has_its_own_place_and_the_place_of_the_last_entry_of_each_kind(tmp_path: Path) -> None:
    path = tmp_path / "log"
    path.write_bytes(b"an older line, cut off")
    log = disk(path)
    for number in range(60):
        log.put(typed(number))
    log.close()
    found, data = indexes(path), path.read_bytes()
    assert len(found) > 2
    for (offset, made), before in zip(found, [None, *found], strict=False):
        assert (made.at, made.base) == (offset, 0) and made.steady and made.polls == 0
        assert made.before == (None if before is None else before[0])
        entry = entry_of(data[made.entries[KEY] : offset])
        assert entry is not None and entry.time.isoformat(timespec="microseconds") == made.last
        assert data[made.session :].startswith(head())


def test_places_go_on_across_parts(tmp_path: Path) -> None:
    path = tmp_path / "log"
    log = disk(path, 5000, parts=9, begin=iter((head(), *[b""] * 9)).__next__)
    log.put(line_of(LogEntry(AT, "typed", "/resume")))
    for number in range(100):
        log.put(typed(number))
    log.close()
    one, two = path.with_name("log.2"), path.with_name("log.1")
    [(_, first), *_], [(offset, last), *_] = indexes(one), indexes(two)
    assert last.base == first.base + one.stat().st_size and last.at == last.base + offset
    assert last.session == 0 and last.resumed == len(head()) and last.before is None


def test_two_writers_of_a_file_make_no_index_beside_each_other(tmp_path: Path) -> None:
    path = tmp_path / "log"
    one = disk(path)
    for number in range(30):
        one.put(typed(number))
    known = len(indexes(path))
    other = disk(path)
    other.put(typed(30))
    for number in range(60):
        one.put(typed(number))
        other.put(typed(number))
    one.close()
    other.close()
    assert known > 0 and len(indexes(path)) == known


def test_other_readers_pass_over_an_index(tmp_path: Path) -> None:
    path = tmp_path / "log"
    log = disk(path)
    for number in range(60):
        log.put(typed(number))
    log.close()
    raw = path.read_bytes().splitlines(keepends=True)
    ours = [n for n, line in enumerate(raw) if index_of(line) is not None]
    assert [entry.text for n in ours if (entry := entry_of(raw[n])) is not None] == [INDEX] * len(ours) != []
    shown = list(files.lines(path))
    assert [line.number for line in shown] == [n + 1 for n in range(len(raw)) if n not in ours]
    assert files.damaged(path) == []


def test_a_clock_that_was_set_back_and_polls_are_noted() -> None:
    keeper, made = IndexKeeper(0), b""
    times = [0, 0.5, 0.1, 5] + [10] * 30
    made = keeper.take(head())
    for seconds in times:
        at = AT + timedelta(seconds=seconds)
        made = made or keeper.take(line_of(LogEntry(at, "sent", "PR P", "press", "a", poll=True)))
    found = index_of(made)
    assert found is not None and not found.steady and found.polls > 10 and not found.entries


@pytest.mark.parametrize(
    "change",
    [{"at": -1}, {"at": "1"}, {"base": 10**9}, {"entries": [["typed", 1]]}, {"entries": 5}, {"first": "noon"}, {"x": 1}]
    + [{"before": 10**9}, {"session": None}, {"resumed": 10**9}, {"polls": "many"}],
)
def test_an_index_line_with_wrong_parts_is_none(change: dict[str, object]) -> None:
    keeper, made = IndexKeeper(0), b""
    for line in (head(), *map(typed, range(30))):
        made = made or keeper.take(line)
    assert index_of(made) is not None
    fields = json.loads(made)
    assert index_of(json.dumps({**fields, "index": {**fields["index"], **change}}).encode()) is None
