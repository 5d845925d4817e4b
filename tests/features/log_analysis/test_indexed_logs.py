"""A moment of a log with an index is that of the same log without one, whatever became of the index."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import IO

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.base.errors import Diagnostic
from multidrop.features.log_analysis import log_parts, moments
from multidrop.features.log_analysis.moments import Moments
from multidrop.shell.log import index
from multidrop.shell.log.files import LogEntry, line_of, parts
from multidrop.shell.log.index import IndexKeeper, index_of
from tests.support.examples import examples

AT = datetime(2026, 11, 22, 12, 0, tzinfo=UTC)
KINDS = ["bus", "typed", "printed", "unsolicited", "output", "notice", "failed", "stop", "missing"]
TEXTS = st.sampled_from(["PR P", '"kind": "bus", "bus": "x"', "/resume", "closed", "index", "x" * 300])


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A folder; in it an index line describes few entries, and blocks are small."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(index, "EVERY", 600)
        patched.setattr(index, "SHARE", 1)
        patched.setattr(log_parts, "BLOCK", 2500)
        yield tmp_path_factory.mktemp("logs")


@st.composite
def logs(draw: st.DrawFn) -> list[LogEntry]:
    """The entries of a log of up to three sessions, whose clock may be set back, or show another zone."""
    now, found = AT, [LogEntry(AT, "log", "session of process 1", marks=True)]
    for _ in range(draw(st.integers(0, 60))):
        now += timedelta(seconds=draw(st.sampled_from([0.0, 0.25, 3.0, 3.0, 3.0, -0.5, -8.0])))
        kind = draw(st.sampled_from([*KINDS, "sent", "received", "sent", "received", "log"]))
        drive = draw(st.sampled_from(["", "a", 'b"']))
        bus = draw(st.sampled_from(["press", 'p"x'])) if drive or draw(st.booleans()) else ""
        if kind == "log":
            found.append(LogEntry(now, kind, draw(st.sampled_from(["session of process 2", "part of process 1"]))))
        elif kind in ("sent", "received"):
            found.append(LogEntry(now, kind, "aPR P\n", bus, drive, poll=draw(st.booleans())))
        elif kind == "stop":
            found.append(LogEntry(now, kind, "stop of every drive"))
        else:
            found.append(LogEntry(now, kind, draw(TEXTS), bus, drive))
    return found


def written(path: Path, entries: Sequence[LogEntry], count: int, keeper: IndexKeeper | None) -> Path:
    """Write a log in parts, with an index if there is a keeper of one."""
    for old in path.parent.glob(f"{path.name}*"):
        old.unlink()
    size = max(1, -(-len(entries) // count))
    chunks = [entries[begin : begin + size] for begin in range(0, len(entries), size)]
    for number, chunk in enumerate(chunks):
        if keeper is not None and number:
            keeper.begin_part()
        data = b""
        for entry in chunk:
            line = line_of(entry)
            data += line + (keeper.take(line) if keeper is not None else b"")
        left = len(chunks) - 1 - number
        path.with_name(f"{path.name}.{left}" if left else path.name).write_bytes(data)
    return path


def facts(path: Path, text: str) -> object:
    """What `log at` shows, without places in the file; the problem of a log that has nothing then."""
    try:
        found: Moments = moments.known(path, text)
    except Diagnostic as problem:
        return str(problem).partition(": ")[2]
    return (
        found.total,
        found.backs,
        [
            (one.at, one.session, one.last, one.stopped, [line.entry for line in one.lines], one.motions)
            for one in found.known
        ],
    )


@examples(40, nightly=1000)
@given(logs(), st.integers(1, 3), st.data())
def test_a_moment_is_that_of_the_log_without_an_index(
    folder: Path, entries: list[LogEntry], count: int, data: st.DataObject
) -> None:
    at = data.draw(st.sampled_from([each.time for each in entries])) + timedelta(seconds=0.1)
    plain = facts(written(folder / "plain.jsonl", entries, count, None), at.isoformat())
    assert facts(written(folder / "day.jsonl", entries, count, IndexKeeper(0)), at.isoformat()) == plain


def cut(data: bytes, place: int) -> bytes:
    """A power failure took the end of the file."""
    return data[:place]


def zeros(data: bytes, place: int) -> bytes:
    """A block that was never written has zeros."""
    return data[:place] + bytes(min(40, len(data) - place)) + data[place + 40 :]


def inserted(data: bytes, place: int) -> bytes:
    return data[:place] + b"junk\n" + data[place:]


@examples(40, nightly=1000)
@given(logs(), st.sampled_from([cut, zeros, inserted]), st.data())
def test_a_log_with_a_damaged_index_still_answers(
    folder: Path, entries: list[LogEntry], damage: Callable[[bytes, int], bytes], data: st.DataObject
) -> None:
    path = written(folder / "day.jsonl", entries, 1, IndexKeeper(0))
    made = path.read_bytes().splitlines(keepends=True)
    offsets = [sum(map(len, made[:n])) for n in range(len(made))]
    ours = [n for n, line in enumerate(made) if index_of(line) is not None]
    if not ours:
        return
    number = data.draw(st.sampled_from(ours))
    inside = 0 if damage is inserted else data.draw(st.integers(0, len(made[number]) - 41))
    whole = damage(b"".join(made), offsets[number] + inside)
    left = entries[: number - sum(n < number for n in ours)] if damage is cut else entries
    path.write_bytes(whole)
    at = data.draw(st.sampled_from([each.time for each in left])) + timedelta(seconds=0.1)
    assert facts(path, at.isoformat()) == facts(written(folder / "plain.jsonl", left, 1, None), at.isoformat())


def test_a_part_that_was_removed_takes_its_entries_along(folder: Path) -> None:
    entries = [LogEntry(AT, "log", "session of process 1"), LogEntry(AT, "output", "early", "press", "a")]
    entries += [LogEntry(AT + timedelta(seconds=n), "typed", f"PR P {n}", "press", "a") for n in range(60)]
    path = written(folder / "day.jsonl", entries, 3, IndexKeeper(0))
    parts(path)[0].unlink()
    found = moments.known(path, "12:00:50").known[0]
    assert found.session is None and [line.entry.text for line in found.lines if line.entry] == ["PR P 50"]


def test_a_moment_of_a_long_log_is_found_in_few_bytes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(index, "EVERY", 8_000)
    monkeypatch.setattr(log_parts, "BLOCK", 16_000)
    entries = [LogEntry(AT, "log", "session of process 1"), LogEntry(AT, "output", "early", "press", "a")]
    entries += [LogEntry(AT + timedelta(seconds=n), "typed", f"PR P {n}", "press", "a") for n in range(6000)]
    path = written(tmp_path / "day.jsonl", entries, 2, IndexKeeper(0))
    read = 0
    opened = log_parts.open_part

    def counting(part: Path) -> IO[bytes]:
        file = opened(part)

        class Counted:
            def __enter__(self) -> Counted:
                return self

            def __exit__(self, *_: object) -> None:
                file.close()

            def seek(self, *place: int) -> int:
                return file.seek(*place)

            def read(self, size: int) -> bytes:
                nonlocal read
                data = file.read(size)
                read += len(data)
                return data

            def readline(self, size: int) -> bytes:
                nonlocal read
                data = file.readline(size)
                read += len(data)
                return data

        return Counted()  # type: ignore[return-value]

    for module in (log_parts, moments):
        monkeypatch.setattr(module, "open_part", counting)
    found = moments.known(path, "12:50").known[0]
    assert [line.entry.text for line in found.lines if line.entry] == ["early", "PR P 3000"]
    assert read < sum(map(os.path.getsize, parts(path))) / 4
