"""`multidrop log judge`, `bisect` and `replay`: verdicts, and files that are damaged, old, empty or none."""

import json
import sys

import pytest

from multidrop.__main__ import main
from multidrop.shell.log.files import line_of
from tests.support.log_entries import AT, ENTRIES, entry, log_command, newest_log


@pytest.fixture
def log(tmp_path, monkeypatch):
    """The newest log of a person, with a session."""
    path = newest_log(tmp_path, monkeypatch)
    path.write_bytes(b"".join(map(line_of, ENTRIES)))
    return path


@pytest.fixture
def done(capsys):
    """Run `multidrop log`."""
    return log_command(capsys)


def judgeable(*entries):
    return (entry("log", "session of process 7", "", "", marks=True), entry("bus", "p: b", drive=""), *entries)


GOOD = judgeable(entry("stop", "stop", "", ""), entry("sent", "\x1b", drive="", stop=True), entry("sent", "bPR P\n"))
BAD = judgeable(entry("stop", "stop", "", ""), entry("sent", "bPR P\n"))


def test_judge_says_what_held_on_standard_error(log, done):
    log.write_bytes(b"".join(map(line_of, GOOD)))
    assert done("judge", log) == (0, [], [f"{log}: all 7 rules held (0 commands, 1 stop)"])


def test_judge_prints_a_line_a_breach_also_as_json(log, done):
    log.write_bytes(b"".join(map(line_of, BAD)))
    said = r"'bPR P\n' was sent before the stop"
    code, lines, err = done("judge", log)
    assert (code, lines) == (1, [f"{log}:4: 2026-11-22 12:41:06.020 first: {said}"])
    assert err == [f"{log}: 1 breach (0 commands, 1 stop)"]
    code, [line], _ = done("judge", log, "--json")
    assert json.loads(line) == {"rule": "first", "time": AT.isoformat(), "where": f"{log}:4", "text": said}
    assert code == 1


@pytest.mark.parametrize("torn", [b"{\n", b'{"time": "2026', b"\x00\xff\n", line_of(GOOD[1]).replace(b"bus", b"bos")])
def test_judge_counts_the_lines_that_it_cannot_read_and_does_not_say_that_all_rules_held(torn, log, done):
    whole_log = b"".join(map(line_of, GOOD))
    log.write_bytes(whole_log + torn)
    code, lines, err = done("judge", log)
    assert (code, lines) == (1, [])
    assert err == [
        f"1 line cannot be read, first {log}:6: what they held was not judged",
        f"{log}: no breach in the rest (0 commands, 1 stop)",
    ]
    log.write_bytes(b"\xff\n" + whole_log + b"\n\n" + torn)  # blank lines hold nothing
    _, _, [first, _] = done("judge", log)
    assert first == f"2 lines cannot be read, first {log}:1: what they held was not judged"


def test_judge_names_gaps(log, done):
    log.write_bytes(b"".join(map(line_of, (*GOOD, entry("missing", "12 entries", "", "")))))
    assert done("judge", log) == (0, [], [f"{log}: no breach in the rest (0 commands, 1 stop, 1 gap)"])


def test_bisect_refuses_a_file_that_has_no_entry_of_this_version(log, done, tmp_path):
    other = tmp_path / "other.jsonl"
    other.write_bytes(b"".join(map(line_of, ENTRIES)).replace(b"+00:00", b""))  # times without a zone
    log.write_bytes(other.read_bytes())
    for words in (("show", other), ("judge", other), ("bisect", log, other)):
        code, lines, [err] = done(*words)
        assert (code, lines) == (2, []) and "one JSON object a line" in err, words


@pytest.mark.parametrize("torn", [b"{\n", b'{"time": "2026', b"\x00\xff\n", b"x" * 3_000_000 + b"\n"])
def test_bisect_and_replay_say_what_they_cannot_read(torn, log, done, tmp_path, multidrop):
    other, lines = tmp_path / "other.jsonl", [line_of(each) for each in ENTRIES]
    begin = b'{"time": "2026-11-22T11:40:00+00:00", "kind": "log", "text": "session of process 7", "format": 1}\n'
    other.write_bytes(torn.rstrip(b"\n") + b"\n" + begin + b"".join(lines))  # a session before was cut off
    log.write_bytes(begin + b"".join(lines))
    assert done("bisect", log, other)[0] == 0
    other.write_bytes(begin + b"".join(lines) + torn)
    code, [said], [err] = done("bisect", log, other)
    place = f"{other}:{len(lines) + 2}"
    assert code == 1 and said.endswith("that can be read")
    assert err.endswith(f"cannot be read, first {place}: what they held was not compared")
    assert (
        f"first {place}: what they held was not sent"
        in multidrop("log", "replay", str(other), "--to", "sim:", "--yes").stderr
    )


def test_bisect_names_a_damaged_line_at_the_first_difference(log, done, tmp_path):
    other = tmp_path / "other.jsonl"
    damaged = [*map(line_of, ENTRIES)]
    damaged[5] = damaged[5].replace(b'"512"', b"512")
    other.write_bytes(b"".join(damaged))
    code, lines, [err] = done("bisect", log, other)
    assert (code, lines) == (2, []) and err.startswith(f"{other}:6: is not an entry of a session log")


@pytest.mark.parametrize(
    ("content", "why"),
    [
        (b"".join(map(line_of, ENTRIES)), "marks no commands and stops, as older versions did"),
        (b"", "is not a session log"),
        (b"\x00\xff", "is not a session log"),
        (None, "cannot be read"),
    ],
    ids=["older", "empty", "no log", "absent"],
)
def test_judge_refuses_what_it_cannot_judge(content, why, log, done):
    log.unlink()
    if content is not None:
        log.write_bytes(content)
    code, lines, [err] = done("judge", log)
    assert (code, lines) == (2, [])
    assert err.startswith(f"{log}: {why}")


def test_a_replay_of_no_file_is_refused_in_one_line(done, capsys):
    why = "Permission denied" if sys.platform == "win32" else "Is a directory"
    assert done("replay", "--to", "sim:", "/") == (2, [], [f"/: cannot be read: {why}"])
    assert main(["log", "replay", "--to", "sim:", long := "x" * 300]) == 2
    assert capsys.readouterr() == ("", f"{long}: cannot be read: File name too long\n")
