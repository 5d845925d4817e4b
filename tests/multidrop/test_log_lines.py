"""`multidrop log` to the letter: what a moment, a difference, a filter and a log that is followed look like."""

from __future__ import annotations

import json
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest

from multidrop.cli import parse, run
from multidrop.commands.log import LONGEST, Following, joined, text
from multidrop.shell.log.files import Entry, Line, line_of, whole
from tests.support.cases import for_each
from tests.support.cell_session import bus, party
from tests.support.front_door import Command

AT = datetime(2026, 11, 22, 12, 41, 6, 20115, tzinfo=UTC)
Done = tuple[int, list[str], list[str]]


def entry(kind: str, text: str, bus: str = "press", drive: str = "b", after: float = 0.0, **more: Any) -> Entry:
    return Entry(AT + timedelta(seconds=after), kind, text, bus, drive, **more)


BEGIN = entry("log", "session of process 7", "", "", marks=True)
OPENED = entry("bus", "p: a, b", drive="")
TYPED = entry("typed", "@b PR P", by="operator", after=1.0)
PRINTED = entry("printed", "512", after=2.0)
STOP = entry("stop", "stop", "", "", after=3.0)
POLLS = (
    entry("sent", "aPR P,DN,V\n", drive="a", poll=True, after=4.0),
    entry("received", 'aPR P,DN,V\r\n18"a"6114\r\n>', drive="a", poll=True, after=4.5),
    *(
        entry(kind, text, "stage", "00", poll=True, after=after)
        for after, sent, reply in ((5.0, "PX", "1"), (5.2, "MSTX", "0"), (5.4, "PY", "2"), (5.6, "MSTY", "0"))
        for kind, text in (("sent", f"@00{sent}\r"), ("received", f"{reply}\r"))
    ),
)


@pytest.fixture
def log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The newest log of a person; tests write its entries."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MULTIDROP_CONFIG_DIR", str(tmp_path / "config"))
    monkeypatch.setenv("MULTIDROP_STATE_DIR", str(tmp_path / "state"))
    path = tmp_path / "state" / "logs" / "day.jsonl"
    path.parent.mkdir(parents=True)
    return path


@pytest.fixture
def done(capsys: pytest.CaptureFixture[str]) -> Callable[..., Done]:
    def call(*words: object) -> Done:
        code = run(parse(["log", *map(str, words)]))
        out, err = capsys.readouterr()
        return code, out.splitlines(), err.splitlines()

    return call


def put(path: Path, *entries: Entry) -> None:
    path.write_bytes(b"".join(map(line_of, entries)))


# A moment


def test_a_moment_names_its_session_the_stop_that_holds_and_the_place_of_each_axis(
    log: Path, done: Callable[..., Done]
) -> None:
    put(log, BEGIN, OPENED, TYPED, PRINTED, STOP, *POLLS)
    head = f"{log} at 2026-11-22 12:41:%s: session of process 7 since 2026-11-22 12:41:06.020"
    known = [
        "2026-11-22 12:41:06.020 *  press: p: a, b",
        "2026-11-22 12:41:07.020 >  press:b PR P",
        "2026-11-22 12:41:08.020 <  press:b 512",
    ]
    assert done("at", "12:41:08.5") == (0, [head % "08.500", *known], [])
    code, lines, err = done("at", "12:42", log)
    assert (code, err) == (0, [])
    assert lines[:3] == [
        head.replace("12:41:%s", "12:42:00.000", 1),
        "the log ends at 2026-11-22 12:41:11.620",
        "stopped since 2026-11-22 12:41:09.020",
    ]
    assert lines[-3:] == [
        "2026-11-22 12:41:11.620 =  stage:00 x position 1, velocity 0",
        "2026-11-22 12:41:11.620 =  stage:00 y position 2, velocity 0",
        "2026-11-22 12:41:10.020 =  press:a position 18, velocity 6114",
    ]
    put(log, TYPED)
    code, [first, *_], _ = done("at", "12:41:08")
    assert (code, first) == (0, f"{log} at 2026-11-22 12:41:08.000"), "no session is known"


def test_a_moment_as_json_has_its_facts_then_the_lines_of_the_file_then_samples(
    log: Path, done: Callable[..., Done]
) -> None:
    put(log, BEGIN, OPENED, STOP, *POLLS[:2])
    code, [fact, *lines], err = done("at", "12:41:30", "--json")
    assert (code, err) == (0, [])
    assert json.loads(fact) == {
        "moment": {
            "at": "2026-11-22T12:41:30+00:00",
            "file": str(log),
            "session": "session of process 7",
            "since": AT.isoformat(),
            "stopped": (AT + timedelta(seconds=3)).isoformat(),
        }
    }
    assert lines[:-1] == [line_of(each).decode().rstrip("\n") for each in (STOP, OPENED, *POLLS[:2])]
    sample = {"time": (AT + timedelta(seconds=4)).isoformat(), "bus": "press", "drive": "a", "axis": ""}
    assert json.loads(lines[-1]) == {"sample": sample | {"position": 18, "velocity": 6114}}
    put(log, OPENED)
    fact = done("at", "12:41:30", "--json")[1][0]
    assert [json.loads(fact)["moment"][name] for name in ("session", "since", "stopped")] == ["", None, None]


def set_back(times: int) -> tuple[list[Entry], list[str], list[list[str]]]:
    """Entries whose clock is set back so often, by 100 s after 10 s each; the times, for a person and for JSON."""
    entries, words, facts = [BEGIN], [], []
    for number in range(times + 1):
        after = -90.0 * number
        entries += [entry("printed", f"{number}", after=after), entry("printed", f"{number} later", after=after + 10)]
        if number:
            both = [AT + timedelta(seconds=after + 100), AT + timedelta(seconds=after)]
            words.append(" to ".join(each.isoformat(" ", "milliseconds")[:23] for each in both))
            facts.append([each.isoformat() for each in both])
    return entries, words, facts


def test_a_clock_that_was_set_back_is_said_with_the_last_three_times(log: Path, done: Callable[..., Done]) -> None:
    for times in (1, 3, 4, 5):
        entries, words, facts = set_back(times)
        put(log, *entries)
        before = {4: "1 more, ", 5: "2 more, "}.get(times, "") + ", ".join(words[-3:])
        lines = done("at", "13:00")[1]
        assert lines[0] == f"the clock was set back in this log, from {before}; it has this time once"
        fact, *_ = done("at", "13:00", "--json")[1]
        moment = json.loads(fact)["moment"]
        assert (moment["clock_set_back"], moment["moments"]) == (facts, 1)


@for_each("times, said", [(1, "2 times: all are shown"), (4, "5 times: all are shown"),
                          (5, "6 times: the last 5 are shown")])  # fmt: skip
def test_a_time_that_a_log_has_more_than_once_is_shown_as_often(
    log: Path, done: Callable[..., Done], times: int, said: str
) -> None:
    minutes = [(minute, number) for number in range(times + 1) for minute in (0, 10)]
    put(log, BEGIN, *(entry("printed", f"{number}", after=60.0 * minute) for minute, number in minutes))
    lines = done("at", "12:45")[1]
    assert lines[0].endswith(f"; it has this time {said}")
    values = [each.rpartition(" ")[2] for each in lines if " <  press:b " in each]
    assert values == [f"{number}" for number in range(times + 1)][-5:]


# A difference


def test_the_first_difference_is_shown_for_both_runs(log: Path, done: Callable[..., Done], tmp_path: Path) -> None:
    other = tmp_path / "other.jsonl"
    put(log, BEGIN, TYPED, PRINTED)
    put(other, BEGIN, TYPED, entry("printed", "513", after=9.0))
    shown = [f"{log}:3: 2026-11-22 12:41:08.020 <  press:b 512", f"{other}:3: 2026-11-22 12:41:15.020 <  press:b 513"]
    assert done("bisect", log, other) == (1, shown, [])
    code, [fact], err = done("bisect", log, other, "--json")
    lines = [line_of(PRINTED), line_of(entry("printed", "513", after=9.0))]
    both = [{"where": f"{path}:3", **json.loads(line)} for path, line in zip((log, other), lines, strict=True)]
    assert (code, json.loads(fact), err) == (1, {"differ": True, "lines": [2, 2], "first": both}, [])


def test_a_run_that_ends_earlier_has_nothing_there(log: Path, done: Callable[..., Done], tmp_path: Path) -> None:
    other = tmp_path / "other.jsonl"
    put(log, BEGIN, TYPED, PRINTED)
    put(other, BEGIN, TYPED)
    line, nothing = f"{log}:3: 2026-11-22 12:41:08.020 <  press:b 512", f"{other}: nothing: its run has 1 line"
    assert done("bisect", log, other) == (1, [line, nothing], [])
    assert done("bisect", other, log) == (1, [nothing, line], [])
    code, [fact], _ = done("bisect", other, log, "--json")
    assert code == 1 and json.loads(fact)["lines"] == [1, 2] and json.loads(fact)["first"][0] is None
    assert done("bisect", log, log) == (0, ["no difference in 2 lines"], [])
    assert done("bisect", other, other) == (0, ["no difference in 1 line"], [])


def test_json_names_the_lines_that_were_not_compared(log: Path, done: Callable[..., Done], tmp_path: Path) -> None:
    other = tmp_path / "other.jsonl"
    put(log, BEGIN, TYPED)
    other.write_bytes(line_of(BEGIN) + line_of(TYPED) + b"{\n")
    code, [fact], [said] = done("bisect", log, other, "--json")
    equal = {"differ": False, "lines": [1, 1], "first": [None, None]}
    assert (code, json.loads(fact)) == (1, equal | {"unreadable": [f"{other}:3"]})
    assert said == f"1 line cannot be read, first {other}:3: what they held was not compared"
    assert done("bisect", log, log, "--json")[1] == [json.dumps(equal)]


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
def test_an_entry_is_one_line_with_its_sign_and_its_place(kind: Entry, line: str) -> None:
    assert text(kind) == f"2026-11-22 12:41:06.020 {line}"


def replies(*pieces: Entry) -> list[str]:
    return [each.entry.text for each in joined(Line(Path("log"), 1, b"", each) for each in pieces) if each.entry]


def received(text: str, **more: Any) -> Entry:
    return entry("received", text, **more)


def test_the_pieces_of_one_reply_are_one_line_until_its_end() -> None:
    assert replies(received("1"), received("2\r\n"), received("3")) == ["12\r\n", "3"]
    assert replies(received("1"), entry("printed", "x"), received("2")) == ["1", "x", "2"]
    assert replies(received("1"), received("2", poll=True)) == ["1", "2"]
    assert replies(received("1"), received("2", drive="a")) == ["1", "2"]
    assert replies(received("1"), received("2", bus="x")) == ["1", "2"]
    assert replies(received("1"), received("2", after=1.0)) == ["12"]
    assert replies(*[received("x" * (LONGEST - 1)), received("y"), received("z")]) == ["x" * (LONGEST - 1) + "y", "z"]
    [found] = joined(Line(Path("log"), n, b"", received(f"{n}", after=n)) for n in (1, 2))
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


# The verdict of a judge


def test_a_judge_counts_what_it_judged_and_says_what_was_left_out(log: Path, done: Callable[..., Done]) -> None:
    command = entry("sent", "bMR 5\n", command="MR 5", after=2.0)
    stopped = (entry("stop", "stop", "", ""), entry("sent", "\x1b", drive="", stop=True))
    put(log, BEGIN, OPENED, TYPED, command, *stopped)
    code, lines, [said] = done("judge", log)
    assert (code, lines, said) == (0, [], f"{log}: all 7 rules held (1 command, 1 stop)")
    put(log, entry("log", "session of process 6", "", ""), TYPED, BEGIN, OPENED, TYPED, command, *stopped)
    assert done("judge", log)[2] == [f"{log}: all 7 rules held (1 command, 1 stop, older sessions left out)"]


# A replay


def test_a_log_without_lines_for_a_drive_is_not_replayed(log: Path, done: Callable[..., Done]) -> None:
    put(log, BEGIN, OPENED, entry("typed", "/drives", "", ""))
    assert done("replay", log, "--to", "sim:") == (
        2,
        [],
        [f"{log}: no line of the log was sent to a drive; /log before the lines keeps them"],
    )


def test_a_replay_says_where_the_answers_differ_and_against_a_cell_it_compares_positions(
    log: Path, multidrop: Command, tmp_path: Path
) -> None:
    (tmp_path / "cell.toml").write_text(bus("press", party("b"), baud=0))
    sent = (entry("sent", "bPR P\n"), entry("received", "\x06512\r\n"))
    put(log, BEGIN, OPENED, entry("typed", "PR P", by="operator"), *sent, entry("printed", "512"))
    compared = ["1 line replayed, 0 differ", "press:b: 1 position compared, largest difference 0 steps"]
    for cell in ("cell.toml", "sim:cell.toml"):  # its drive begins where that of the log was
        done = multidrop("log", "replay", str(log), "--against", cell)
        assert (done.returncode, done.stdout, done.stderr.splitlines()) == (0, "", compared)
    done = multidrop("log", "replay", str(log), "--to", "sim:cell.toml", "--yes")
    differs = f"{log}:3: press:b PR P: then 512; now 0\n"
    counts = ["1 line replayed, 1 differ", "1 of 1 line gave another answer than in the log"]
    assert (done.returncode, done.stdout, done.stderr.splitlines()) == (1, differs, counts)
    done = multidrop("log", "replay", str(log), "--to", "sim:cell.toml", "--yes", "--json")
    first, last = map(json.loads, done.stdout.splitlines())
    assert first["differs"] == "then 512; now 0" and last == {"summary": {"lines": 1, "differ": 1}}
