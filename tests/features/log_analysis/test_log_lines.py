"""`multidrop log at`, `bisect`, `judge` and `replay` to the letter: moments, differences, verdicts, replays."""

from __future__ import annotations

import json
from collections.abc import Callable
from datetime import timedelta
from pathlib import Path

import pytest

from multidrop.shell.log.files import LogEntry, line_of
from tests.support.cases import for_each
from tests.support.cell_session import bus, party
from tests.support.front_door import Command
from tests.support.log_entries import (
    AT,
    BEGIN,
    OPENED,
    POLLS,
    PRINTED,
    STOP,
    TYPED,
    Done,
    entry,
    log_command,
    newest_log,
    put,
)


@pytest.fixture
def log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The newest log of a person; tests write its entries."""
    return newest_log(tmp_path, monkeypatch)


@pytest.fixture
def done(capsys: pytest.CaptureFixture[str]) -> Callable[..., Done]:
    """Run `multidrop log`."""
    return log_command(capsys)


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


def set_back(times: int) -> tuple[list[LogEntry], list[str], list[list[str]]]:
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
