"""`multidrop log` to the letter: what an entry, a filter and a log that is followed look like."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from multidrop.commands.log import LONGEST_JOINED_TEXT, Following, joined, text
from multidrop.shell.log.files import LogEntry, LogLine, line_of, whole
from tests.support.cases import for_each
from tests.support.log_entries import BEGIN, POLLS, PRINTED, STOP, TYPED, Done, entry, log_command, newest_log, put


@pytest.fixture
def log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The newest log of a person; tests write its entries."""
    return newest_log(tmp_path, monkeypatch)


@pytest.fixture
def done(capsys: pytest.CaptureFixture[str]) -> Callable[..., Done]:
    """Run `multidrop log`."""
    return log_command(capsys)


# Entries


@for_each("words, shown", [
    (["--drive", "a"], ["a"]),
    (["--drive", "b"], ["b", "other"]),
    (["--drive", "press:b"], ["b"]),
    (["--drive", "a", "--drive", "press:b"], ["a", "b"]),
    (["--drive", "all"], ["a", "b", "other"]),
    (["--drive", "x"], []),
    ([], ["a", "b", "other"]),
])  # fmt: skip
def test_entries_are_chosen_by_drive_or_by_bus_and_drive(
    log: Path, done: Callable[..., Done], words: list[str], shown: list[str]
) -> None:
    put(log, entry("printed", "a", drive="a"), entry("printed", "b"), entry("printed", "other", "line"))
    code, lines, err = done("show", *words)
    assert (code, [each.rpartition(" ")[2] for each in lines], err) == (0, shown, [])


@for_each("kind, line", [
    (entry("typed", "@b  PR P "), ">  press:b PR P"),
    (entry("typed", "@b PR P", ""), ">  b @b PR P"),
    (entry("typed", "PR P"), ">  press:b PR P"),
    (entry("typed", "@b PR P", drive=""), ">  press: PR P"),
    (entry("printed", "@b PR P"), "<  press:b @b PR P"),
    (entry("notice", "press is back"), "*  press is back"),
    (entry("failed", "b refused"), "!  b refused"),
    (entry("output", "a\tb"), "<  press:b a\tb"),
    (entry("sent", "\x18\xff\n"), r">> press:b \x18\xff\n"),
    (entry("printed", "x", "p\x1b"), r"<  p\x1b:b x"),
    (entry("log", "session", "", ""), "*  session"),
])  # fmt: skip
def test_an_entry_is_one_line_with_its_sign_and_its_place(kind: LogEntry, line: str) -> None:
    assert text(kind) == f"2026-11-22 12:41:06.020 {line}"


def replies(*pieces: LogEntry) -> list[str]:
    return [each.entry.text for each in joined(LogLine(Path("log"), 1, b"", each) for each in pieces) if each.entry]


def received(text: str, **more: Any) -> LogEntry:
    return entry("received", text, **more)


def test_the_pieces_of_one_reply_are_one_line_until_its_end() -> None:
    assert replies(received("1"), received("2\r\n"), received("3")) == ["12\r\n", "3"]
    assert replies(received("1"), entry("printed", "x"), received("2")) == ["1", "x", "2"]
    assert replies(received("1"), received("2", poll=True)) == ["1", "2"]
    assert replies(received("1"), received("2", drive="a")) == ["1", "2"]
    assert replies(received("1"), received("2", bus="x")) == ["1", "2"]
    assert replies(received("1"), received("2", after=1.0)) == ["12"]
    assert replies(*[received("x" * (LONGEST_JOINED_TEXT - 1)), received("y"), received("z")]) == [
        "x" * (LONGEST_JOINED_TEXT - 1) + "y",
        "z",
    ]
    [found] = joined(LogLine(Path("log"), n, b"", received(f"{n}", after=n)) for n in (1, 2))
    assert found.entry is not None and found.number == 1
    assert text(found.entry) == "2026-11-22 12:41:07.020 << press:b 12"


def test_a_damaged_line_ends_a_reply_and_stays_where_it_was(log: Path, done: Callable[..., Done]) -> None:
    log.write_bytes(line_of(received("1")) + b"{" + b"x" * 100 + b"\n \n" + line_of(received("2\n")))
    code, lines, [said] = done("show")
    assert code == 0
    assert lines == ["2026-11-22 12:41:06.020 << press:b 1", r"2026-11-22 12:41:06.020 << press:b 2\n"]
    assert said == f"{log}:2: not a whole entry: {b'{' + b'x' * 79!r}"
    assert [each.entry is None for each in joined(whole(log))] == [False, True, True, False]


def test_lines_before_the_first_entry_are_no_log_and_are_passed_over(log: Path, done: Callable[..., Done]) -> None:
    log.write_bytes(b"hello\n" + line_of(PRINTED))
    assert done("show") == (0, ["2026-11-22 12:41:08.020 <  press:b 512"], [])
    log.write_bytes(b"hello\nagain\n")
    assert done("show")[::2] == (
        2,
        [f"{log}:1: is not an entry of a session log; a log of this version is one JSON object a line"],
    )
    log.write_bytes(b"")
    assert done("show") == (0, [], [])


@for_each(
    "pattern, shown", [("P.*R? P", ["PR P"]), ("^2026.*b 5[0-9]+$", ["512"]), ("pr p", []), ("-i pr+ P", ["PR P"])]
)
def test_a_pattern_is_a_regular_expression(
    log: Path, done: Callable[..., Done], pattern: str, shown: list[str]
) -> None:
    put(log, BEGIN, TYPED, PRINTED)
    words = ["-i", pattern[3:]] if pattern.startswith("-i") else [pattern]
    code, lines, _ = done("grep", *words)
    assert (code, [each.partition(":b ")[2] for each in lines]) == (0 if shown else 1, shown)


# A log that is followed


def test_a_log_is_followed_as_json_with_the_filters_of_show(
    log: Path, done: Callable[..., Done], monkeypatch: pytest.MonkeyPatch
) -> None:
    put(log, BEGIN, TYPED, *POLLS[:2])
    added = line_of(entry("printed", "new", after=9.0)), line_of(entry("printed", "a", drive="a", after=9.0))
    waits: list[float] = []

    def wait(seconds: float) -> None:
        waits.append(seconds)
        if len(waits) == 2:
            raise KeyboardInterrupt
        with log.open("ab") as file:
            file.write(b"".join(added))

    monkeypatch.setattr("multidrop.commands.log.time.sleep", wait)
    code, lines, err = done("follow", log, "--json", "--drive", "b")
    assert (code, err) == (0, []) and [f"{each}\n".encode() for each in lines] == [line_of(TYPED), added[0]]
    assert waits == [0.1, 0.1]


def test_a_piece_of_a_followed_log_is_taken_once_it_is_whole(tmp_path: Path) -> None:
    path = tmp_path / "log"
    following = Following(path)
    path.write_bytes(b'{"time"')
    assert [*following.look()] == [] and not following.lost
    put(path, BEGIN, TYPED)
    assert [line.number for line in following.look()] == [1, 2]
    with path.open("ab") as file:
        file.write(line_of(PRINTED) + line_of(STOP)[:-1])
    assert [(line.number, line.entry) for line in following.look()] == [(3, PRINTED)]
    with path.open("ab") as file:
        file.write(b"\n")
    assert [(line.number, line.entry) for line in following.look()] == [(4, STOP)]
    assert [*following.look()] == [] and not following.lost
