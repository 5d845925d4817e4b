"""What was known at a moment of a log, and the first difference of two runs: found as bytes, as reading all would."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path
from typing import IO

import pytest
from hypothesis import given
from hypothesis import strategies as st

from multidrop.base.errors import Diagnostic
from multidrop.features.log_analysis import differences, log_parts, moments
from multidrop.features.log_analysis.differences import Run, first_difference
from multidrop.features.log_analysis.moments import BACK, KnownMoment, moment
from multidrop.shell.log.files import LogEntry, LogLine, line_of, lines
from tests.support.examples import examples

AT = datetime(2026, 11, 22, 12, 0, tzinfo=UTC)
TEXTS = st.sampled_from(["PR P", "512", '"kind": "bus", "bus": "x"', "\\", '", "text"', "/resume", "é\n", "closed"])
KINDS = ["bus", "typed", "printed", "unsolicited", "output", "notice", "failed", "stop", "missing"]
STEPS = ("typed", "printed", "unsolicited", "failed", "stop")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A folder; blocks are small in it, so that a short log has many."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(log_parts, "BLOCK", 700)
        patched.setattr(differences, "BLOCK", 700)
        yield tmp_path_factory.mktemp("logs")


def written(path: Path, entries: Sequence[LogEntry], parts: int = 1) -> Path:
    """Write a log in parts, as its rotation leaves them."""
    size = max(1, -(-len(entries) // parts))
    chunks = [entries[begin : begin + size] for begin in range(0, len(entries), size)] or [[]]
    for old in path.parent.glob(f"{path.name}*"):
        old.unlink()
    for number, chunk in enumerate(reversed(chunks)):
        name = path.with_name(f"{path.name}.{number}") if number else path
        name.write_bytes(b"".join(map(line_of, chunk)))
    return path


@st.composite
def logs(draw: st.DrawFn) -> list[LogEntry]:
    """The entries of a log: sessions, drives with odd names, polls between."""
    now, found = AT, [LogEntry(AT, "log", "session of process 1", marks=True)]
    for _ in range(draw(st.integers(0, 40))):
        now += timedelta(seconds=draw(st.sampled_from([0.0, 0.25, 3.0])))
        kind = draw(st.sampled_from([*KINDS, "sent", "received", "log"]))
        drive = draw(st.sampled_from(["", "a", 'b"', "c\\"]))
        bus = draw(st.sampled_from(["press", 'p"x'])) if drive or draw(st.booleans()) else ""
        if kind == "log":
            found.append(LogEntry(now, kind, draw(st.sampled_from(["session of process 2", "part of process 1"]))))
        else:
            text = "aPR P\n" if kind in ("sent", "received") else draw(TEXTS)
            found.append(LogEntry(now, kind, text, bus, drive, poll=kind in ("sent", "received")))
    return found


def known(path: Path, text: str) -> KnownMoment:
    """What was known at a time that a log has once."""
    found = moments.known(path, text)
    assert (found.total, found.backs) == (1, [])
    return found.known[0]


def shown(found: Sequence[LogLine]) -> list[LogEntry]:
    return [line.entry for line in found if line.entry is not None]


@examples(15, nightly=500)
@given(logs(), st.integers(1, 3), st.data())
def test_the_last_entry_of_each_kind_and_place_is_found(
    folder: Path, entries: list[LogEntry], parts: int, data: st.DataObject
) -> None:
    path = written(folder / "day.jsonl", entries, parts)
    at = data.draw(st.sampled_from([each.time for each in entries])) + timedelta(seconds=0.1)
    before = [each for each in entries if each.time <= at]
    begin = max(n for n, each in enumerate(before) if each.kind == "log" and each.text.startswith("session"))
    last = {(each.kind, each.bus, each.drive): each for each in before[begin:] if each.kind in KINDS}
    closed = {each.bus for each in last.values() if each.kind == "bus" and each.text == "closed"}
    expected = {key for key, each in last.items() if each.kind == "bus" or each.bus not in closed}
    found = known(path, at.isoformat())
    assert found.session == before[begin] and found.at == at
    kept = [each for each in shown(found.lines) if each.kind in KINDS]
    assert {(each.kind, each.bus, each.drive) for each in kept} == expected
    for each in kept:
        assert each == last[each.kind, each.bus, each.drive]
    assert (found.last is None) == (entries[-1].time > at)


def test_a_stop_holds_until_it_is_resumed(folder: Path) -> None:
    entries = [
        LogEntry(AT, "log", "session of process 1"),
        LogEntry(AT + timedelta(seconds=1), "stop", "stop of every drive"),
        LogEntry(AT + timedelta(seconds=2), "typed", "/resume"),
    ]
    path = written(folder / "stop.jsonl", entries)
    assert [known(path, f"12:00:0{second}").stopped for second in (0, 1, 2)] == [None, entries[1], None]


def test_samples_are_the_last_polls_of_each_drive_with_their_replies(folder: Path) -> None:
    def poll(after: float, drive: str, sent: str, *received: str) -> Iterator[LogEntry]:
        yield LogEntry(AT + timedelta(seconds=after), "sent", sent, "p", drive, poll=True)
        for number, each in enumerate(received):
            yield LogEntry(AT + timedelta(seconds=after + 0.01 * (number + 1)), "received", each, "p", drive, poll=True)

    entries = [
        LogEntry(AT, "log", "session of process 1"),
        *poll(1, "a", "PR P\n", "1\r\n"),
        *poll(2, "a", "PR V\n", "2\r\n"),
        *poll(3, "a", "PR P\n", "51", "2\r\n"),
        *poll(4, "b", "PR P\n", "7\r\n"),
        *poll(5, "b", "PR P\n"),
    ]
    found = shown(known(written(folder / "polls.jsonl", entries), "12:01").lines)
    assert [(each.drive, each.text) for each in found] == [
        ("a", "PR V\n"),
        ("a", "2\r\n"),
        ("a", "PR P\n"),
        ("a", "51"),
        ("a", "2\r\n"),
        ("b", "PR P\n"),
        ("b", "7\r\n"),
    ]


def test_times(folder: Path) -> None:
    last = datetime(2026, 11, 22, 12, 0, 30, tzinfo=timezone(timedelta(hours=1)))
    first = last - timedelta(days=2)
    for text, expected in {
        "12:00:30": last,
        "12:00:31": last.replace(day=21, second=31),
        "11:59": last.replace(hour=11, minute=59, second=0),
        "12:00:31+01:00": last.replace(day=21, second=31),
        "2026-11-20 08:00:00.250": datetime(2026, 11, 20, 8, 0, 0, 250000, tzinfo=last.tzinfo),
        "2026-11-22T11:00:00+00:00": datetime(2026, 11, 22, 11, 0, tzinfo=UTC),
    }.items():
        zoned = "+" in text
        assert moment(text, first, last) == (expected if zoned else expected.replace(tzinfo=None)), text
    after = moment("12:01", last, last)  # after the end of a short log
    assert after == last.replace(minute=1, second=0, tzinfo=None)
    for text in ("0002-01-01", "9998-12-31"):  # the first and the last year that every zone has
        assert moment(text, first, last) == datetime.fromisoformat(text)
    for text in ("noon", "0001-01-01T00:00+00:00", "9999-12-31T00:00+00:00", "9999-01-01"):
        with pytest.raises(Diagnostic, match=rf"^log at: '{re.escape(text)}' is not a time; as in 11:37:05.2"):
            moment(text, first, last)


def steps(*times: tuple[datetime, str]) -> list[LogEntry]:
    """A session with a line at each time."""
    head = LogEntry(times[0][0], "log", "session of process 1", marks=True)
    return [head, *(LogEntry(at, "typed", text, "p", "a") for at, text in times)]


@pytest.mark.parametrize("parts", [1, 2, 3])
def test_a_clock_that_was_set_back_passes_a_time_again(folder: Path, parts: int) -> None:
    def clock(hour: int, minute: int = 0) -> datetime:
        return AT.replace(hour=hour, minute=minute)

    entries = steps((clock(10), "1"), (clock(11), "2"), (clock(12), "3"), (clock(11, 5), "4"), (clock(11, 45), "5"))
    stop, resume = LogEntry(clock(12), "stop", "stop of every drive"), LogEntry(clock(11, 4), "typed", "/resume")
    path = written(folder / "set.jsonl", [*entries[:4], stop, resume, *entries[4:]], parts)
    for at, texts in {
        "10:30": ["1"],  # the clock passed it once
        "11:02": ["2"],
        "11:30": ["2", "4"],
        "11:50": ["2", "5"],
        "12:30": ["5"],
    }.items():
        found = moments.known(path, at)
        assert [[each.text for each in shown(one.lines) if each.drive] for one in found.known] == [[t] for t in texts]
        assert found.total == len(texts) and found.backs == [(clock(12), clock(11, 4))], at
        assert [one.stopped for one in found.known] == [None] * len(texts), "it was resumed, by an earlier clock"
        assert [one.last is not None for one in found.known] == [text == "5" for text in texts]


def test_a_time_without_a_zone_is_the_clock_as_it_was_shown(folder: Path) -> None:
    summer, winter = timezone(timedelta(hours=2)), timezone(timedelta(hours=1))
    times = [datetime(2026, 10, 25, *at, tzinfo=zone) for *at, zone in ((1, summer), (2, 30, summer), (2, 5, winter))]
    path = written(folder / "summer.jsonl", steps(*zip(times, "123", strict=True)))
    autumn = moments.known(path, "02:20")
    assert [one.at.tzinfo for one in autumn.known] == [summer, winter] and len(autumn.backs) == 1
    assert [each.text for each in shown(known(path, "2026-10-25 02:45+02:00").lines)] == ["2"]
    assert [each.text for each in shown(moments.known(path, "01:10").known[0].lines)] == ["1"]


def test_times_of_threads_in_another_order_are_one_moment(folder: Path) -> None:
    times = [AT + timedelta(seconds=second) for second in (0, 0.9, 0.1, 0.8, 2)]
    path = written(folder / "threads.jsonl", steps(*zip(times, "12345", strict=True)))
    assert [each.text for each in shown(known(path, "12:00:00.5").lines)] == ["3"] and timedelta(seconds=0.9) < BACK


def test_a_log_that_is_rotated_meanwhile_is_read_again(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = written(folder / "turn.jsonl", steps(*((AT, str(number)) for number in range(60))), 2)
    rotations = [1]
    opened = log_parts.open_part

    def rotating(part: Path) -> IO[bytes]:
        if rotations:
            rotations.pop()
            for number in (1, 0):
                path.with_name(f"{path.name}.{number}" if number else path.name).rename(f"{path}.{number + 1}")
            path.write_bytes(line_of(LogEntry(AT, "typed", "last", "p", "a")))
        return opened(part)

    for module in (log_parts, differences):
        monkeypatch.setattr(module, "open_part", rotating)
    run = Run(path)
    assert len(run.steps) == 61
    path.write_bytes(b"")
    with pytest.raises(Diagnostic, match="was rotated while it was read; try again$"):
        run.line(60)


@given(st.binary(max_size=300))
def test_any_file_is_read_or_refused(folder: Path, data: bytes) -> None:
    path = folder / "any.jsonl"
    path.write_bytes(data)
    for read in (lambda: moments.known(path, "12:00"), lambda: Run(path)):
        with pytest.raises(Diagnostic):
            read()


@examples(15, nightly=500)
@given(logs(), st.binary(max_size=60).filter(lambda data: b"\n" not in data), st.integers(0, 40))
def test_a_damaged_line_is_passed_over(folder: Path, entries: list[LogEntry], junk: bytes, place: int) -> None:
    path = written(folder / "damaged.jsonl", entries)
    whole = [line.data for line in lines(path)]
    place = min(place, len(whole))
    path.write_bytes(b"".join([*whole[:place], junk + b"\n", *whole[place:]]))
    found = known(path, (entries[-1].time + timedelta(seconds=1)).isoformat())
    assert found.session is not None and {each.data for each in found.lines} <= {*whole}


@pytest.mark.parametrize("begin", [b"\x1f\x8b\x08", b"BZh9", b"\xfd7zXZ\0", b"\x28\xb5\x2f\xfd", b"PK\x03\x04"])
def test_a_compressed_file_is_named_as_such(folder: Path, begin: bytes) -> None:
    (folder / "day.jsonl.gz").write_bytes(begin + bytes(20))
    for read in (lambda: known(folder / "day.jsonl.gz", "12:00"), lambda: Run(folder / "day.jsonl.gz")):
        with pytest.raises(Diagnostic, match="is compressed; unpack it first$"):
            read()


def by_place(entries: Sequence[LogEntry]) -> dict[tuple[str, str], list[tuple[str, str, bool]]]:
    """The steps of the last session, without times and origins."""
    begin = max(n for n, each in enumerate(entries) if each.kind == "log" and each.text.startswith("session"))
    found = defaultdict(list)
    for each in entries[begin:]:
        if each.kind in STEPS:
            found[each.bus, each.drive].append((each.kind, each.text, each.raw))
    return found


@examples(15, nightly=500)
@given(logs(), logs() | st.none(), st.data())
def test_the_first_difference_is_one_of_a_drive_after_equal_lines(
    folder: Path, entries: list[LogEntry], others: list[LogEntry] | None, data: st.DataObject
) -> None:
    if others is None:  # the same run at another time, with one entry changed or none
        later = [LogEntry(each.time + timedelta(hours=3), *tuple_of(each), by="macro") for each in entries]
        place = data.draw(st.integers(0, len(later)))
        others = later[:place] + later[place + 1 :] if place else later
    logged = entries, others
    if not all(any(each.kind == "log" and each.text.startswith("session") for each in log) for log in logged):
        return
    runs = [Run(written(folder / f"{name}.jsonl", log)) for name, log in zip("xy", logged, strict=True)]
    places = [by_place(log) for log in logged]
    found = first_difference(*runs)
    assert (found is None) == (places[0] == places[1])
    if found is None:
        return
    steps = [None if index is None else run.line(index).entry for run, index in zip(runs, found, strict=True)]
    named = {(each.bus, each.drive) for each in steps if each is not None}
    (place_of,) = named
    heads = []
    for run, index in zip(runs, found, strict=True):
        end = len(run.steps) if index is None else index
        before = [run.line(n).entry for n in range(end)]
        heads.append([(e.kind, e.text) for e in before if e is not None and (e.bus, e.drive) == place_of])
    assert heads[0] == heads[1]
    assert steps[0] is None or steps[1] is None or (steps[0].kind, steps[0].text) != (steps[1].kind, steps[1].text)


def tuple_of(entry: LogEntry) -> tuple[str, str, str, str]:
    return entry.kind, entry.text, entry.bus, entry.drive


def test_the_line_of_a_step_has_its_number_in_its_part(folder: Path) -> None:
    entries = [LogEntry(AT, "log", "session of process 1")]
    entries += [LogEntry(AT, "typed", f"MR {number}", "p", "a", by="operator") for number in range(40)]
    run = Run(written(folder / "parts.jsonl", entries, 3))
    assert [run.line(index).where for index in (0, 12, 13, 39)] == [
        f"{folder / 'parts.jsonl'}.2:2",
        f"{folder / 'parts.jsonl'}.2:14",
        f"{folder / 'parts.jsonl'}.1:1",
        f"{folder / 'parts.jsonl'}:13",
    ]


def test_two_drives_may_take_turns_in_another_order(folder: Path) -> None:
    head = [LogEntry(AT, "log", "session of process 1")]
    a = [LogEntry(AT, "printed", str(number), "p", "a") for number in range(3)]
    b = [LogEntry(AT, "printed", str(number), "p", "b") for number in range(3)]
    one = Run(written(folder / "one.jsonl", [*head, *a, *b]))
    other = Run(written(folder / "other.jsonl", [*head, b[0], a[0], a[1], b[1], b[2], a[2]]))
    assert first_difference(one, other) is None
    third = Run(written(folder / "third.jsonl", [*head, b[0], a[0], a[2], b[1], b[2]]))
    found = first_difference(one, third)
    assert found is not None
    assert [run.steps[index] for run, index in zip((one, third), found, strict=True) if index is not None] == [
        b'"kind": "printed", "bus": "p", "drive": "a", "text": "1"}',
        b'"kind": "printed", "bus": "p", "drive": "a", "text": "2"}',
    ]


@pytest.mark.parametrize(
    ("drive", "polls", "expected"),
    [
        ("a", [("aPR P,DN,V\n", 'aPR P,DN,V\r\n18"a"6114\r\n>')], [("", 18, 6114)]),
        ("a", [("aPR P,DN,V\n", "damage")], []),
        (
            "00",
            [("@00PX\r", "1\r"), ("@00MSTX\r", "0\r"), ("@00PY\r", "2\r"), ("@00MSTY\r", "0\r")],
            [("x", 1), ("y", 2)],
        ),
        (
            "1",
            [
                ("\1\6\1\0\0\0\0\0\x08", "\2\1d\6\0\0\2\0o"),
                ("\1\6\3\0\0\0\0\0\n", "\2\1d\6\0\0\0\5r"),
            ],
            [("", 512, 5)],
        ),
        ("é", [("x", "y")], []),
    ],
)
def test_the_last_position_of_a_drive_is_decoded_without_the_drive(
    folder: Path, drive: str, polls: list[tuple[str, str]], expected: list[tuple[object, ...]]
) -> None:
    entries = [LogEntry(AT, "log", "session of process 1")]
    for sent, received in polls:
        entries.append(LogEntry(AT, "sent", sent, "p", drive, poll=True))
        entries.append(LogEntry(AT, "received", received, "p", drive, poll=True))
    motions = known(written(folder / "motion.jsonl", entries), AT.isoformat()).motions
    found = [(each.axis, each.position, each.velocity) for each in motions.get(("p", drive), [])]
    assert [each[: len(wanted)] for each, wanted in zip(found, expected, strict=True)] == expected


@pytest.mark.parametrize("size", range(660, 720))
def test_a_line_that_is_longer_than_a_block_is_passed_over(folder: Path, size: int) -> None:
    log = written(
        folder / "long.jsonl", [LogEntry(AT, "log", "session of process 1"), LogEntry(AT, "typed", "PR P", "p", "a")]
    )
    log.write_bytes(log.read_bytes() + b"x" * (2 * 700) + b"\n" + b"y" * size + b"\n")
    assert [each.text for each in shown(known(log, "12:00:01").lines)] == ["PR P"]
    assert len(Run(log).steps) == 1


def test_a_torn_line_at_the_end_is_no_step(folder: Path) -> None:
    entries = [
        LogEntry(AT, "log", "session of process 1"),
        *(LogEntry(AT, "typed", each, "p", "a") for each in ("PR P", "S")),
    ]
    one, other = written(folder / "one.jsonl", entries), written(folder / "torn.jsonl", entries)
    other.write_bytes(other.read_bytes()[:-9])
    assert len(Run(other).steps) == 1 and first_difference(Run(one), Run(other)) == (1, None)
    other.write_bytes(one.read_bytes().replace(b"\n", b"\r\n"))
    assert first_difference(Run(one), Run(other)) is None
